"""What is known of a value in the domain of intervals, over ends of any kind."""

from __future__ import annotations

from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

__all__ = ["FloatOrArray", "Interval", "IntervalValue", "IntervalVector", "Truth", "can_hold"]

E = TypeVar("E")
FloatOrArray: TypeAlias = Any
"""A float or an array of floats; as a truth value, a bool or an array of them."""


class Interval(NamedTuple, Generic[E]):
    """A number between two ends.

    Attributes:
        low, high: The ends; infinite where nothing is known.
        exact: Whether both ends are the number itself.
    """

    low: E
    high: E
    exact: bool = False


class IntervalVector(NamedTuple, Generic[E]):
    """A vector whose coordinates are between ends, or a region that has no points elsewhere."""

    x: Interval[E]
    y: Interval[E]


class Truth(NamedTuple):
    """Whether a condition can hold, and whether it can fail: bools, or arrays of them."""

    can_hold: FloatOrArray
    can_fail: FloatOrArray


IntervalValue: TypeAlias = Interval[E] | IntervalVector[E] | Truth | None


def can_hold(value: IntervalValue[FloatOrArray]) -> FloatOrArray:
    """Whether a value can count as true where it stands as a condition."""
    if isinstance(value, Truth):
        return value.can_hold
    if isinstance(value, Interval) and value.exact:
        return np.not_equal(value.low, 0)
    return True
