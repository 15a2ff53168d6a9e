"""Conditions as literals: which of them are one condition or its negation, so that they come out together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenicq.forest.nodes import Compare, CompareOp, Logic, LogicOp, Node
from scenicq.forest.value_numbers import ValueNumbers
from scenicq.forest.walk import postorder
from scenicq.temporal.definedness import is_total

__all__ = ["Literal", "literals_of"]

_NEGATED = {CompareOp.GE: CompareOp.LT, CompareOp.GT: CompareOp.LE, CompareOp.NE: CompareOp.EQ}
"""Comparisons as the negation of another one, where both sides have a value."""


@dataclass(frozen=True, slots=True)
class Literal:
    """A condition as another one or its negation.

    Attributes:
        atom: The number of the other one, the first of its kind.
        positive: Whether it is the other one itself.
    """

    atom: int
    positive: bool = True


def literals_of(conditions: Sequence[Node]) -> tuple[Literal, ...]:
    """Each of some conditions as the first one that has the same value wherever both are read, or the opposite one.

    Args:
        conditions: Boolean expressions, each about one sample.
    """
    numbers, first = ValueNumbers(), dict[int, Literal]()
    found: list[Literal] = []
    for atom, condition in enumerate(conditions):
        # without a value neither a condition nor its negation holds
        root, positive = _base(condition) if all(map(is_total, postorder([condition]))) else (condition, True)
        known = first.setdefault(numbers.expression(root), Literal(atom, positive))
        found.append(Literal(known.atom, known.positive == positive))
    return tuple(found)


def _base(condition: Node) -> tuple[Node, bool]:
    """A condition without negations, and whether it is meant rather than its negation."""
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
