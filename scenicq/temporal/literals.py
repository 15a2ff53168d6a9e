"""Conditions as literals: which of them are one condition or its negation, so that they come out together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenicq.forest.nodes import Node
from scenicq.forest.value_numbers import ValueNumbers, is_total, without_negation
from scenicq.forest.walk import postorder

__all__ = ["Literal", "literals_of"]


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
        root, positive = (
            without_negation(condition) if all(map(is_total, postorder([condition]))) else (condition, True)
        )
        known = first.setdefault(numbers.expression(root), Literal(atom, positive))
        found.append(Literal(known.atom, known.positive == positive))
    return tuple(found)
