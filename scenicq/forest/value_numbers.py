"""Value numbering: expressions get numbers, and equal numbers mean equal values.

A condition and its negation have one number: one of them is the base of the other.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import cast

from scenicq.forest.nodes import (
    AheadInLanes,
    Among,
    AmongOp,
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    CourseCoordinate,
    DirectionAt,
    Feature,
    Intersects,
    LaneCourse,
    Logic,
    LogicOp,
    Measure,
    Node,
    Norm,
    Scale,
    Undefined,
    Value,
    VectorSum,
)
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.regions import DifferenceOf, IntersectionOf, UnionOf

__all__ = ["ValueNumbers", "is_total", "parts_of", "without_negation"]

_NEGATED = {CompareOp.GE: CompareOp.LT, CompareOp.GT: CompareOp.LE, CompareOp.NE: CompareOp.EQ}
"""Comparisons as the negation of another one, where both sides have a value."""
_TOTAL = {
    ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.MUL, ArithmeticOp.NEG, ArithmeticOp.ABS, ArithmeticOp.MIN,
    ArithmeticOp.MAX, ArithmeticOp.SIN, ArithmeticOp.COS, ArithmeticOp.ATAN, ArithmeticOp.ATAN2, ArithmeticOp.FLOOR,
    ArithmeticOp.CEIL, ArithmeticOp.WRAP,
}  # fmt: skip
"""Operations that have a value for all numbers."""


@dataclass(frozen=True, slots=True)
class ValueNumbers:
    """Gives expressions numbers: equal ones mean the same, whatever the order of what has none."""

    _numbers: dict[Hashable, int] = field(default_factory=dict["Hashable", int])

    def number(self, form: Hashable) -> int:
        """The number of anything that is told apart by equality."""
        return self._numbers.setdefault(form, len(self._numbers))

    def expression(self, root: Node, swap: Mapping[int, int] | None = None, known: dict[int, int] | None = None) -> int:
        """The number of an expression; random variables stay themselves.

        Args:
            root: The expression.
            swap: The objects that are put for others, by index.
            known: The numbers of nodes, by their ids, with the same exchange; takes those that are found.
        """
        numbers: dict[int, int] = {} if known is None else known
        swap = swap or {}
        for node in postorder([root], beyond=numbers):
            below = [numbers[id(child)] for child in children(node)]
            own: Hashable = None
            match node:
                case Constant():
                    own = (type(node.value).__name__, parts_of(node.value))
                case Feature():
                    own = (swap.get(node.object, node.object), node.property, node.current)
                case Among():
                    parts = [self.expression(each) for each in node.body.parts]
                    own = (node.op, node.category, node.number, node.excluded, *parts)
                    below = [*sorted(below[: node.excluded]), *below[node.excluded :]]
                case Norm(vector=VectorSum(left, Scale(right, Constant(-1)))):
                    below = sorted((numbers[id(left)], numbers[id(right)]))
                case Arithmetic(ArithmeticOp.ABS, (Arithmetic(ArithmeticOp.WRAP, (inner,)),)) if _is_difference(inner):
                    below = sorted(numbers[id(child)] for child in children(inner))
                case Arithmetic(op=ArithmeticOp.ADD | ArithmeticOp.MUL | ArithmeticOp.MIN | ArithmeticOp.MAX):
                    own, below = node.op, sorted(below)
                case Logic() | Compare(op=CompareOp.EQ | CompareOp.NE):
                    own, below = node.op, sorted(below)
                case Arithmetic() | Compare():
                    own = node.op
                case VectorSum() | Intersects():
                    below = sorted(below)
                case Coordinate():
                    own = node.axis
                case CourseCoordinate():
                    own = node.axis, node.end
                case Measure():
                    own = node.measure, node.seconds, node.end
                case LaneCourse():
                    own = id(node.network), node.gap_s
                case AheadInLanes():
                    own = id(node.network)
                case _ if is_leaf(node):
                    own = node.identity  # type: ignore[union-attr]
                case _:
                    pass
            numbers[id(node)] = self.number((type(node).__name__, cast("Hashable", own), tuple(below)))
        return numbers[id(root)]


def parts_of(value: Value) -> Hashable:
    """A value as what tells it apart: regions and fields are themselves, but what is put together anew is its parts."""
    match value:
        case UnionOf() | IntersectionOf():
            return value.parts
        case DifferenceOf():
            return value.base, value.removed
        case _:
            return value


def without_negation(condition: Node) -> tuple[Node, bool]:
    """A condition without negations, and whether it is meant rather than its negation; it has a value (`is_total`)."""
    positive = True
    while isinstance(condition, Logic) and condition.op is LogicOp.NOT:
        (condition,) = condition.args
        positive = not positive
    if isinstance(condition, Compare):
        left, right, op = condition.left, condition.right, condition.op
        if op in _NEGATED:
            op, positive = _NEGATED[op], not positive
        if op is CompareOp.LE:  # a <= b is not b < a
            left, right, op, positive = right, left, CompareOp.LT, not positive
        condition = Compare(op, left, right)
    return condition, positive


def is_total(node: Node) -> bool:
    """Whether a node has a value whenever those below it that matter have one."""
    match node:
        case Arithmetic():
            return node.op in _TOTAL
        case Constant():
            return not isinstance(node.value, Undefined)
        case DirectionAt(field=Constant(value=VectorField() as field)):
            return field.reach is None
        case Among():
            # there may be nobody who is the nearest
            return node.op is not AmongOp.NEAREST
        case _:
            return not isinstance(node, DirectionAt)


def _is_difference(node: Node) -> bool:
    return isinstance(node, Arithmetic) and node.op is ArithmeticOp.SUB
