"""Expressions over observed features as SQL, where SQL can say them.

Only ever used for *necessary* conditions: every comparison is widened by `SLACK`, so that rounding in the database
cannot exclude what the matcher would accept, and what cannot be translated becomes None, which excludes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    Feature,
    Logic,
    LogicOp,
    Node,
    Norm,
    Rotate,
    Scale,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder

__all__ = ["SLACK", "Columns", "angle_between", "number", "requirement_sql"]

SLACK = 1e-6
"""Metres or radians by which every condition is widened."""

Columns = Mapping[tuple[int, str], str | tuple[str, str]]
"""The column of each (object, property); a pair for vectors."""

_FUNCTIONS: dict[ArithmeticOp, str] = {
    ArithmeticOp.ABS: "abs",
    ArithmeticOp.SIN: "sin",
    ArithmeticOp.COS: "cos",
    ArithmeticOp.MIN: "least",
    ArithmeticOp.MAX: "greatest",
}
_INFIX = {ArithmeticOp.ADD: "+", ArithmeticOp.SUB: "-", ArithmeticOp.MUL: "*"}


def number(value: float) -> str:
    """A literal that reads back as the same double."""
    return f"({value!r}::DOUBLE)"


def wrapped(angle: str) -> str:
    """An angle normalised to [-pi, pi]."""
    return f"({angle} - 2*pi()*round(({angle})/(2*pi())))"


def angle_between(angle: str, low: float, high: float) -> str:
    """Whether an angle, taken modulo 2 pi, lies in an interval of less than a full turn."""
    middle, half = (low + high) / 2, (high - low) / 2
    return f"abs({wrapped(f'{angle} - {number(middle)}')}) <= {number(half + SLACK)}"


def _scalar(node: Node, args: list[object]) -> object:
    match node:
        case Arithmetic():
            texts = cast("list[str]", args)
            if node.op in _INFIX:
                return "(" + f" {_INFIX[node.op]} ".join(texts) + ")"
            if node.op in _FUNCTIONS:
                return f"{_FUNCTIONS[node.op]}({', '.join(texts)})"
            if node.op is ArithmeticOp.NEG:
                return f"(-{texts[0]})"
            return wrapped(texts[0]) if node.op is ArithmeticOp.WRAP else None
        case Norm():
            x, y = cast("tuple[str, str]", args[0])
            return f"sqrt({x}*{x} + {y}*{y})"
        case Bearing():
            x, y = cast("tuple[str, str]", args[0])
            return f"atan2(-({x}), {y})"
        case Coordinate():
            return cast("tuple[str, str]", args[0])[node.axis]
        case _:
            return None


def _value(node: Node, args: list[object], columns: Columns) -> object:
    match node:
        case Constant():
            if isinstance(node.value, float):
                return number(node.value)
            if isinstance(node.value, tuple):
                return (number(node.value[0]), number(node.value[1]))
            return None
        case Feature():
            return columns.get((node.object, node.property))
        case VectorOf():
            return (args[0], args[1])
        case VectorSum():
            (a, b), (c, d) = cast("list[tuple[str, str]]", args)
            return (f"({a} + {c})", f"({b} + {d})")
        case Scale():
            (x, y), factor = cast("tuple[tuple[str, str], str]", tuple(args))
            return (f"({x} * {factor})", f"({y} * {factor})")
        case Rotate():
            (x, y), angle = cast("tuple[tuple[str, str], str]", tuple(args))
            return (f"({x}*cos({angle}) - {y}*sin({angle}))", f"({x}*sin({angle}) + {y}*cos({angle}))")
        case _:
            return _scalar(node, args)


def _negated(op: CompareOp) -> CompareOp:
    return {
        CompareOp.LT: CompareOp.GE,
        CompareOp.LE: CompareOp.GT,
        CompareOp.GT: CompareOp.LE,
        CompareOp.GE: CompareOp.LT,
        CompareOp.EQ: CompareOp.NE,
        CompareOp.NE: CompareOp.EQ,
    }[op]


def _comparison(op: CompareOp, left: object, right: object) -> str | None:
    if not (isinstance(left, str) and isinstance(right, str)):
        return None
    match op:
        case CompareOp.LT | CompareOp.LE:
            return f"{left} <= {right} + {number(SLACK)}"
        case CompareOp.GT | CompareOp.GE:
            return f"{left} >= {right} - {number(SLACK)}"
        case CompareOp.EQ:
            return f"abs({left} - {right}) <= {number(SLACK)}"
        case CompareOp.NE:
            return None


def requirement_sql(root: Node, columns: Columns) -> str | None:
    """A condition that holds wherever the requirement does, or None if SQL cannot say one.

    Args:
        root: A boolean expression over observed features.
        columns: Columns of the features; a feature without one makes its part untranslatable.
    """
    values: dict[int, object] = {}
    plain = [node for node in postorder((root,)) if not isinstance(node, Compare | Logic)]
    for node in plain:
        args = [values.get(id(child)) for child in children(node)]
        values[id(node)] = None if any(arg is None for arg in args) else _value(node, args, columns)

    def truth(node: Node, *, negated: bool) -> str | None:
        match node:
            case Compare():
                op = _negated(node.op) if negated else node.op
                return _comparison(op, values.get(id(node.left)), values.get(id(node.right)))
            case Logic() if node.op is LogicOp.NOT:
                return truth(node.args[0], negated=not negated)
            case Logic():
                parts = [truth(arg, negated=negated) for arg in node.args]
                if (node.op is LogicOp.AND) != negated:
                    known = [part for part in parts if part is not None]
                    return "(" + " AND ".join(known) + ")" if known else None
                if any(part is None for part in parts):
                    return None
                return "(" + " OR ".join(part for part in parts if part is not None) + ")"
            case _:
                return None

    return truth(root, negated=False)
