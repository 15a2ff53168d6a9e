"""Building expressions: small constructors that fold what is already known.

The vocabulary of the language paper's appendix B: `offset_local`, `rotate`, `heading_toward`, `visible_region` and
so on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from scenicq.errors import Span
from scenicq.forest.compute import fold
from scenicq.forest.nodes import (
    MIRRORED,
    Among,
    AmongOp,
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    DiscAt,
    Feature,
    Logic,
    LogicOp,
    Node,
    Norm,
    RectangleAt,
    Rotate,
    Scale,
    SectorAt,
    Value,
    VectorOf,
    VectorSum,
)

__all__ = [
    "add",
    "arithmetic",
    "bearing",
    "box",
    "compare",
    "constant",
    "coordinate",
    "logic",
    "minus",
    "norm",
    "offset_local",
    "opposite",
    "rotate",
    "scale",
    "sector",
    "vector",
    "vector_difference",
    "vector_sum",
]


def constant(value: Value, span: Span | None = None) -> Constant:
    """A known value; integers become floats."""
    return Constant(float(value) if isinstance(value, int) and not isinstance(value, bool) else value, span=span)


def arithmetic(op: ArithmeticOp, *args: Node, span: Span | None = None) -> Node:
    """An operation on scalars."""
    return fold(Arithmetic(op, args, span=span))


def _is(node: Node, value: float) -> bool:
    return isinstance(node, Constant) and node.value == value


def add(left: Node, right: Node, span: Span | None = None) -> Node:
    """The sum of two scalars."""
    if _is(left, 0.0):
        return right
    return left if _is(right, 0.0) else arithmetic(ArithmeticOp.ADD, left, right, span=span)


def minus(left: Node, right: Node, span: Span | None = None) -> Node:
    """The difference of two scalars."""
    return left if _is(right, 0.0) else arithmetic(ArithmeticOp.SUB, left, right, span=span)


def compare(op: CompareOp, left: Node, right: Node, span: Span | None = None) -> Node:
    """A comparison; of how many label objects there are with a number, whether there are at least so many."""
    for one, other, way in ((left, right, op), (right, left, MIRRORED.get(op, op))):
        match one, other:
            case Among(op=AmongOp.COUNT), Constant(value=float() as number) if abs(number) < _MANY:
                return _count_against(one, way, number, span)
            case _:
                pass
    return fold(Compare(op, left, right, span=span))


_MANY = 1e9


def _count_against(many: Among, op: CompareOp, number: float, span: Span | None) -> Node:
    def at_least(least: int) -> Node:
        if least <= 0:
            return constant(True, span)
        return replace(many, op=AmongOp.AT_LEAST, kind="boolean", number=least, span=span)

    def negation(node: Node) -> Node:
        return logic(LogicOp.NOT, node, span=span)

    match op:
        case CompareOp.GE:
            return at_least(math.ceil(number))
        case CompareOp.GT:
            return at_least(math.floor(number) + 1)
        case CompareOp.LT:
            return negation(at_least(math.ceil(number)))
        case CompareOp.LE:
            return negation(at_least(math.floor(number) + 1))
        case _ if number != math.floor(number):
            return constant(op is CompareOp.NE, span)
        case _:
            more = negation(at_least(int(number) + 1))
            least = at_least(int(number))
            same = more if isinstance(least, Constant) else logic(LogicOp.AND, least, more, span=span)
            return same if op is CompareOp.EQ else negation(same)


def logic(op: LogicOp, *args: Node, span: Span | None = None) -> Node:
    """A connective."""
    return fold(Logic(op, args, span=span))


def connect(op: LogicOp, args: Sequence[Node], span: Span | None = None) -> Node:
    """`and` or `or` of conditions, without those that are known."""
    decisive = op is LogicOp.OR
    if any(isinstance(each, Constant) and each.value is decisive for each in args):
        return constant(decisive)
    left = [each for each in args if not (isinstance(each, Constant) and each.value is not decisive)]
    return logic(op, *left, span=span) if len(left) > 1 else left[0] if left else constant(not decisive)


def vector(x: Node, y: Node, span: Span | None = None) -> Node:
    """A vector from its coordinates."""
    return fold(VectorOf(x, y, span=span))


def coordinate(value: Node, axis: int, span: Span | None = None) -> Node:
    """The x (0) or y (1) of a vector."""
    if isinstance(value, VectorOf):
        return value.y if axis else value.x
    return fold(Coordinate(value, axis, span=span))


def vector_sum(left: Node, right: Node, span: Span | None = None) -> Node:
    """The sum of two vectors."""
    return fold(VectorSum(left, right, span=span))


def vector_difference(left: Node, right: Node, span: Span | None = None) -> Node:
    """The difference of two vectors; of one place and itself the null vector, wherever it is."""
    if _is_same_place(left, right):
        return constant((0.0, 0.0), span)
    return vector_sum(left, scale(right, constant(-1.0), span), span)


def _is_same_place(left: Node, right: Node) -> bool:
    match left, right:
        case Feature(object=one, property="position", current=now), Feature(
            object=other, property="position", current=then
        ):
            return one == other and now == then
        case _:
            return left is right and not isinstance(left, Feature)


def scale(value: Node, factor: Node, span: Span | None = None) -> Node:
    """A vector times a scalar."""
    return fold(Scale(value, factor, span=span))


def rotate(value: Node, angle: Node, span: Span | None = None) -> Node:
    """A vector turned counter-clockwise by an angle (appendix B: rotate)."""
    return value if _is(angle, 0.0) else fold(Rotate(value, angle, span=span))


def norm(value: Node, span: Span | None = None) -> Node:
    """The length of a vector."""
    return fold(Norm(value, span=span))


def bearing(value: Node, span: Span | None = None) -> Node:
    """The heading in which a vector points (appendix B: arctan of the vector)."""
    return fold(Bearing(value, span=span))


def offset_local(origin: Node, heading: Node, offset: Node, span: Span | None = None) -> Node:
    """A position offset in a local frame (appendix B: offsetLocal): x to the right, y ahead."""
    return vector_sum(origin, rotate(offset, heading, span), span)


def box(position: Node, heading: Node, width: Node, length: Node, span: Span | None = None) -> Node:
    """The bounding box of an object (appendix B: boundingBox)."""
    return fold(RectangleAt(position, heading, width, length, span=span))


def sector(center: Node, radius: Node, heading: Node | None, angle: Node | None, span: Span | None = None) -> Node:
    """A visible region (appendix B: visibleRegion): a sector, or a disc where there is no view angle below 2 pi."""
    full = angle is None or (isinstance(angle, Constant) and isinstance(angle.value, float) and angle.value >= math.tau)
    if heading is None or angle is None or full:
        return fold(DiscAt(center, radius, span=span))
    return fold(SectorAt(center, radius, heading, angle, span=span))


_OPPOSITE = {
    CompareOp.LT: CompareOp.GE, CompareOp.LE: CompareOp.GT, CompareOp.GT: CompareOp.LE, CompareOp.GE: CompareOp.LT,
    CompareOp.EQ: CompareOp.NE, CompareOp.NE: CompareOp.EQ,
}  # fmt: skip


def opposite(truth: Node) -> Node:
    """What holds exactly where a truth value does not; of a comparison, the opposite one."""
    if isinstance(truth, Compare) and truth.op in _OPPOSITE:
        return compare(_OPPOSITE[truth.op], truth.left, truth.right, truth.span)
    return logic(LogicOp.NOT, truth, span=truth.span)
