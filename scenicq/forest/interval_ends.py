"""The arithmetic of an interval's ends: the protocol `Ends`, and its versions for floats and for NumPy arrays.

Arrays broadcast with one another and with floats. `query/prefilter/sql_ends` has the version for SQL.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol, TypeVar, cast

import numpy as np

from scenicq.forest.interval_values import FloatOrArray, Interval
from scenicq.geometry.angles import azimuth, azimuth_array, wrap

__all__ = ["ARRAYS", "FLOATS", "Ends"]

E = TypeVar("E")


class Ends(Protocol[E]):
    """The operations that interval arithmetic needs of ends; conditions have the type that `at_most` returns."""

    def number(self, value: float) -> E:
        """An end that is a plain number."""
        ...

    def between(self, low: E, high: E) -> Interval[E]:
        """The interval between two ends. It is exact if both are known to be one finite number; arrays never are."""
        ...

    def known(self, value: E) -> Interval[E]:
        """The interval of one number; all numbers where it is infinite or nan."""
        ...

    def plus(self, a: E, b: E) -> E:
        """The sum."""
        ...

    def negative(self, a: E) -> E:
        """The negative."""
        ...

    def times(self, a: E, b: E) -> E:
        """The product; zero times an infinite end is zero."""
        ...

    def divided(self, a: E, b: E) -> E:
        """The quotient. It is zero where the divisor is infinite, and not finite where the divisor is zero."""
        ...

    def least(self, parts: Sequence[E]) -> E:
        """The least."""
        ...

    def most(self, parts: Sequence[E]) -> E:
        """The greatest."""
        ...

    def hypot(self, a: E, b: E) -> E:
        """The length of a vector."""
        ...

    def root(self, a: E) -> E:
        """The square root; nan for negative numbers."""
        ...

    def sine(self, a: E) -> E:
        """The sine of an angle in radians."""
        ...

    def cosine(self, a: E) -> E:
        """The cosine of an angle in radians."""
        ...

    def magnitude(self, a: E) -> E:
        """The distance from zero."""
        ...

    def heading(self, x: E, y: E) -> E:
        """The heading of a vector in radians, in [-pi, pi), counter-clockwise from the y axis."""
        ...

    def turned(self, a: E) -> E:
        """An angle in radians, less whole turns, in [-pi, pi]."""
        ...

    def at_most(self, a: E, b: E) -> FloatOrArray:
        """Whether an end is at most another."""
        ...

    def both(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        """Whether both hold."""
        ...

    def either(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        """Whether one of two holds."""
        ...

    def negation(self, a: FloatOrArray) -> FloatOrArray:
        """Whether something does not hold."""
        ...

    def where(self, condition: FloatOrArray, a: E, b: E) -> E:
        """The first where a condition holds, else the second."""
        ...


class _Floats:
    """Ends that are floats."""

    def number(self, value: float) -> float:
        return value

    def between(self, low: float, high: float) -> Interval[float]:
        return Interval(low, high, low == high and math.isfinite(low))

    def known(self, value: float) -> Interval[float]:
        return Interval(value, value, True) if math.isfinite(value) else Interval(-math.inf, math.inf)

    def plus(self, a: float, b: float) -> float:
        return a + b

    def negative(self, a: float) -> float:
        return -a

    def times(self, a: float, b: float) -> float:
        return 0.0 if a == 0 or b == 0 else a * b

    def divided(self, a: float, b: float) -> float:
        return 0.0 if math.isinf(b) else math.nan if b == 0 else a / b

    def least(self, parts: Sequence[float]) -> float:
        return min(parts)

    def most(self, parts: Sequence[float]) -> float:
        return max(parts)

    def hypot(self, a: float, b: float) -> float:
        return math.hypot(a, b)

    def root(self, a: float) -> float:
        return math.sqrt(a) if a >= 0 else math.nan

    def sine(self, a: float) -> float:
        return math.sin(a)

    def cosine(self, a: float) -> float:
        return math.cos(a)

    def magnitude(self, a: float) -> float:
        return abs(a)

    def heading(self, x: float, y: float) -> float:
        return azimuth(x, y)

    def turned(self, a: float) -> float:
        return wrap(a) if math.isfinite(a) else math.nan

    def at_most(self, a: float, b: float) -> bool:
        return a <= b

    def both(self, a: bool, b: bool) -> bool:
        return a and b

    def either(self, a: bool, b: bool) -> bool:
        return a or b

    def negation(self, a: bool) -> bool:
        return not a

    def where(self, condition: bool, a: float, b: float) -> float:
        return a if condition else b


class _Arrays:
    """Ends that are arrays or floats. The caller silences warnings about nan by `np.errstate`."""

    def number(self, value: float) -> FloatOrArray:
        return value

    def between(self, low: FloatOrArray, high: FloatOrArray) -> Interval[FloatOrArray]:
        return Interval(low, high)

    def known(self, value: FloatOrArray) -> Interval[FloatOrArray]:
        defined = np.isfinite(value)
        if np.all(defined):
            return Interval(value, value, True)
        return Interval(np.where(defined, value, -np.inf), np.where(defined, value, np.inf))

    def plus(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        return a + b

    def negative(self, a: FloatOrArray) -> FloatOrArray:
        return -a

    def times(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        product = a * b
        return np.where(np.isnan(product), 0.0, product)

    def divided(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        return np.where(np.isinf(b), 0.0, np.divide(a, b))

    def least(self, parts: Sequence[FloatOrArray]) -> FloatOrArray:
        found = parts[0]
        for part in parts[1:]:
            found = np.minimum(found, part)
        return found

    def most(self, parts: Sequence[FloatOrArray]) -> FloatOrArray:
        found = parts[0]
        for part in parts[1:]:
            found = np.maximum(found, part)
        return found

    def hypot(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        return np.hypot(a, b)

    def root(self, a: FloatOrArray) -> FloatOrArray:
        return np.sqrt(a)

    def sine(self, a: FloatOrArray) -> FloatOrArray:
        return np.sin(a)

    def cosine(self, a: FloatOrArray) -> FloatOrArray:
        return np.cos(a)

    def magnitude(self, a: FloatOrArray) -> FloatOrArray:
        return np.abs(a)

    def heading(self, x: FloatOrArray, y: FloatOrArray) -> FloatOrArray:
        return azimuth_array(x, y)

    def turned(self, a: FloatOrArray) -> FloatOrArray:
        return np.remainder(a + math.pi, math.tau) - math.pi

    def at_most(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        return np.less_equal(a, b)

    def both(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        return np.logical_and(a, b)

    def either(self, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        return np.logical_or(a, b)

    def negation(self, a: FloatOrArray) -> FloatOrArray:
        return np.logical_not(a)

    def where(self, condition: FloatOrArray, a: FloatOrArray, b: FloatOrArray) -> FloatOrArray:
        return cast("FloatOrArray", np.where(condition, a, b))


FLOATS: Ends[float] = _Floats()
ARRAYS: Ends[FloatOrArray] = _Arrays()
