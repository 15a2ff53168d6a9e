"""The functions that terms are made of, and their values in floating point."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum

__all__ = ["Operator", "operate"]


class Operator(StrEnum):
    """Functions of real numbers: angles in radians, `ATAN2` takes y before x, `POW` a constant integer power."""

    ADD = "add"
    SUB = "sub"
    MUL = "mul"
    DIV = "div"
    NEG = "neg"
    ABS = "abs"
    MIN = "min"
    MAX = "max"
    SQRT = "sqrt"
    SIN = "sin"
    COS = "cos"
    TAN = "tan"
    ASIN = "asin"
    ACOS = "acos"
    ATAN = "atan"
    ATAN2 = "atan2"
    POW = "pow"
    EXP = "exp"
    LOG = "log"


def operate(operator: Operator, values: list[float]) -> float:
    """Apply a function to floating point numbers; NaN where it is undefined, an infinity where it overflows."""
    if any(math.isnan(value) for value in values):
        return math.nan
    try:
        return _FUNCTIONS[operator](values)
    except (ValueError, ZeroDivisionError):
        return math.nan
    except OverflowError:
        odd_negative = operator is Operator.POW and values[0] < 0 and values[1] % 2 == 1
        return -math.inf if odd_negative else math.inf


_FUNCTIONS: dict[Operator, Callable[[list[float]], float]] = {
    Operator.ADD: sum,
    Operator.SUB: lambda v: v[0] - v[1],
    Operator.MUL: math.prod,
    Operator.DIV: lambda v: v[0] / v[1],
    Operator.NEG: lambda v: -v[0],
    Operator.ABS: lambda v: abs(v[0]),
    Operator.MIN: min,
    Operator.MAX: max,
    Operator.SQRT: lambda v: math.sqrt(v[0]),
    Operator.SIN: lambda v: math.sin(v[0]),
    Operator.COS: lambda v: math.cos(v[0]),
    Operator.TAN: lambda v: math.tan(v[0]),
    Operator.ASIN: lambda v: math.asin(v[0]),
    Operator.ACOS: lambda v: math.acos(v[0]),
    Operator.ATAN: lambda v: math.atan(v[0]),
    # adding 0.0 turns -0.0, which is no real number, into 0.0
    Operator.ATAN2: lambda v: math.atan2(v[0] + 0.0, v[1]) if v[0] or v[1] else math.nan,
    Operator.POW: lambda v: v[0] ** int(v[1]),
    Operator.EXP: lambda v: math.exp(v[0]),
    Operator.LOG: lambda v: math.log(v[0]),
}
