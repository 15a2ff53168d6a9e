"""The meaning of operations, comparisons and connectives of known numbers and truth values; it loads no geometry.

An operation that has no value is `Undefined`. `compute` has the meaning of all other nodes.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import cast

from scenicq.forest.nodes import ArithmeticOp, CompareOp, LogicOp, Undefined, Value

__all__ = ["arithmetic", "compare", "connect"]

_Numbers = Sequence[float]


def _unary(function: Callable[[float], float]) -> Callable[[_Numbers], float]:
    return lambda args: function(args[0])


def _binary(function: Callable[[float, float], float]) -> Callable[[_Numbers], float]:
    return lambda args: function(args[0], args[1])


_FUNCTIONS: dict[ArithmeticOp, Callable[[_Numbers], float]] = {
    ArithmeticOp.ADD: sum,
    ArithmeticOp.SUB: _binary(operator.sub),
    ArithmeticOp.MUL: _binary(operator.mul),
    ArithmeticOp.DIV: lambda args: args[0] / args[1],
    ArithmeticOp.FLOORDIV: lambda args: args[0] // args[1],
    ArithmeticOp.MOD: _binary(operator.mod),
    # it refuses what is not real
    ArithmeticOp.POW: _binary(math.pow),
    ArithmeticOp.NEG: _unary(operator.neg),
    ArithmeticOp.ABS: _unary(abs),
    ArithmeticOp.MIN: min,
    ArithmeticOp.MAX: max,
    ArithmeticOp.SQRT: _unary(math.sqrt),
    ArithmeticOp.SIN: _unary(math.sin),
    ArithmeticOp.COS: _unary(math.cos),
    ArithmeticOp.TAN: _unary(math.tan),
    ArithmeticOp.ASIN: _unary(math.asin),
    ArithmeticOp.ACOS: _unary(math.acos),
    ArithmeticOp.ATAN: _unary(math.atan),
    ArithmeticOp.ATAN2: _binary(math.atan2),
    ArithmeticOp.EXP: _unary(math.exp),
    ArithmeticOp.LOG: _unary(math.log),
    ArithmeticOp.FLOOR: _unary(math.floor),
    ArithmeticOp.CEIL: _unary(math.ceil),
}
"""All operations but `WRAP`, which geometry knows."""

_ORDER: dict[CompareOp, Callable[[float, float], bool]] = {
    CompareOp.LT: operator.lt,
    CompareOp.LE: operator.le,
    CompareOp.GT: operator.gt,
    CompareOp.GE: operator.ge,
}


def arithmetic(op: ArithmeticOp, args: Sequence[float]) -> float | Undefined:
    """The value of an operation other than `WRAP`."""
    try:
        result = _FUNCTIONS[op](args)
    except (ZeroDivisionError, ValueError, OverflowError):
        return Undefined(f"`{op.value}` has no value at {', '.join(f'{arg:.6g}' for arg in args)}")
    return float(result) if math.isfinite(result) else Undefined(f"`{op.value}` has no finite value here")


def compare(op: CompareOp, left: Value, right: Value) -> bool:
    """Whether a comparison holds; values other than numbers are equal or not."""
    if op in _ORDER:
        return _ORDER[op](cast(float, left), cast(float, right))
    return (left == right) == (op is CompareOp.EQ)


def connect(op: LogicOp, args: Sequence[Value]) -> Value:
    """The value of a connective: true or false where that does not depend on what is undefined."""
    if op is LogicOp.NOT:
        return args[0] if isinstance(args[0], Undefined) else not args[0]
    decisive = op is LogicOp.OR
    known = [bool(arg) for arg in args if not isinstance(arg, Undefined)]
    if decisive in known:
        return decisive
    return next((arg for arg in args if isinstance(arg, Undefined)), not decisive)
