"""Arithmetic of intervals over ends of any kind, never too narrow; what is exact stays so."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from scenicq.forest.interval_ends import Ends
from scenicq.forest.interval_values import FloatOrArray, Interval
from scenicq.forest.nodes import ArithmeticOp

__all__ = ["IntervalArithmetic"]

E = TypeVar("E")
_RANGES: Mapping[ArithmeticOp, tuple[float, float]] = {
    ArithmeticOp.SIN: (-1.0, 1.0),
    ArithmeticOp.COS: (-1.0, 1.0),
    ArithmeticOp.ASIN: (-math.pi / 2, math.pi / 2),
    ArithmeticOp.ATAN: (-math.pi / 2, math.pi / 2),
    ArithmeticOp.ACOS: (0.0, math.pi),
    ArithmeticOp.ATAN2: (-math.pi, math.pi),
}
"""What functions give of anything."""


@dataclass(frozen=True, slots=True)
class IntervalArithmetic(Generic[E]):
    """Operations on intervals.

    Attributes:
        ends: The arithmetic of the ends.
        slack: Metres or radians by which rounding may put values beyond where comparisons and seams of angles lie.
    """

    ends: Ends[E]
    slack: float = field(default=0.0, kw_only=True)

    def everything(self) -> Interval[E]:
        """Any number."""
        return self.within(-math.inf, math.inf)

    def within(self, low: float, high: float) -> Interval[E]:
        """The interval between two numbers."""
        return self.ends.between(self.ends.number(low), self.ends.number(high))

    def operation(self, op: ArithmeticOp, args: Sequence[Interval[E]]) -> Interval[E]:
        """An operation of the node language."""
        ends, first = self.ends, args[0]
        match op:
            case ArithmeticOp.ADD:
                total = first
                for other in args[1:]:
                    total = self.add(total, other)
                return total
            case ArithmeticOp.SUB:
                return self.add(first, self.negative(args[1]))
            case ArithmeticOp.NEG:
                return self.negative(first)
            case ArithmeticOp.MUL:
                return self.multiply(first, args[1])
            case ArithmeticOp.DIV:
                return self.divide(first, args[1])
            case ArithmeticOp.ABS:
                far = self.largest(first)
                return ends.known(far) if first.exact else ends.between(self.nearest(first), far)
            case ArithmeticOp.MIN:
                return self._ends_of(args, ends.least, ends.least)
            case ArithmeticOp.MAX:
                return self._ends_of(args, ends.most, ends.most)
            case ArithmeticOp.FLOOR:
                return ends.between(ends.plus(first.low, ends.number(-1.0)), first.high)
            case ArithmeticOp.CEIL:
                return ends.between(first.low, ends.plus(first.high, ends.number(1.0)))
            case ArithmeticOp.SQRT if first.exact:
                return ends.known(ends.root(first.low))
            case ArithmeticOp.SQRT:
                zero = ends.number(0.0)
                return ends.between(ends.root(ends.most([zero, first.low])), ends.root(ends.most([zero, first.high])))
            case ArithmeticOp.SIN if first.exact:
                return ends.known(ends.sine(first.low))
            case ArithmeticOp.COS if first.exact:
                return ends.known(ends.cosine(first.low))
            case ArithmeticOp.WRAP:
                return self._wrapped(first)
            case _:
                return self.within(*_RANGES.get(op, (-math.inf, math.inf)))

    def add(self, a: Interval[E], b: Interval[E]) -> Interval[E]:
        """The sum."""
        low = self.ends.plus(a.low, b.low)
        if a.exact and b.exact:
            return Interval(low, low, True)
        return self.ends.between(low, self.ends.plus(a.high, b.high))

    def negative(self, a: Interval[E]) -> Interval[E]:
        """The negative."""
        low = self.ends.negative(a.high)
        return Interval(low, low, True) if a.exact else Interval(low, self.ends.negative(a.low))

    def multiply(self, a: Interval[E], b: Interval[E]) -> Interval[E]:
        """The product."""
        ends = self.ends
        if a.exact and b.exact:
            product = ends.times(a.low, b.low)
            return Interval(product, product, True)
        for one, other in ((a, b), (b, a)):
            factor = other.low
            if other.exact and isinstance(factor, float) and factor:
                low, high = ends.times(one.low, factor), ends.times(one.high, factor)
                return Interval(low, high) if factor > 0 else Interval(high, low)
        products = [ends.times(x, y) for x in a[:2] for y in b[:2]]
        return ends.between(ends.least(products), ends.most(products))

    def divide(self, a: Interval[E], b: Interval[E]) -> Interval[E]:
        """The quotient; everything where the divisor may be 0.

        Not by way of the reciprocal, which is infinite for the tiniest numbers.
        """
        ends, zero = self.ends, self.ends.number(0.0)
        if a.exact and b.exact:
            return ends.known(ends.divided(a.low, b.low))
        if b.exact and isinstance(b.low, float) and b.low:
            low, high = ends.divided(a.low, b.low), ends.divided(a.high, b.low)
            return Interval(low, high) if b.low > 0 else Interval(high, low)
        vague = ends.both(ends.at_most(b.low, zero), ends.at_most(zero, b.high))
        quotients = [ends.divided(x, y) for x in a[:2] for y in b[:2]]
        return ends.between(
            ends.where(vague, ends.number(-math.inf), ends.least(quotients)),
            ends.where(vague, ends.number(math.inf), ends.most(quotients)),
        )

    def _ends_of(
        self, args: Sequence[Interval[E]], low: Callable[[Sequence[E]], E], high: Callable[[Sequence[E]], E]
    ) -> Interval[E]:
        found = low([arg.low for arg in args])
        if all(arg.exact for arg in args) and low == high:
            return Interval(found, found, True)
        return self.ends.between(found, high([arg.high for arg in args]))

    def hull(self, parts: Sequence[Interval[E]]) -> Interval[E]:
        """The smallest interval around some."""
        return self._ends_of(parts, self.ends.least, self.ends.most)

    def largest(self, a: Interval[E]) -> E:
        """The greatest distance from zero."""
        if a.exact:
            return self.ends.magnitude(a.low)
        return self.ends.most([a.high, self.ends.negative(a.low)])

    def nearest(self, a: Interval[E]) -> E:
        """The least distance from zero."""
        return self.ends.most([self.ends.number(0.0), a.low, self.ends.negative(a.high)])

    def _wrapped(self, angle: Interval[E]) -> Interval[E]:
        """An angle in [-pi, pi]: beyond half a turn, and where rounding may decide at the seam, it is anything."""
        ends, most = self.ends, self.ends.number(math.pi - self.slack)
        if angle.exact:
            value = ends.turned(angle.low)
            return self.heading_unless(ends.negation(ends.at_most(ends.magnitude(value), most)), Interval(value, value))
        inside = ends.both(ends.at_most(ends.negative(most), angle.low), ends.at_most(angle.high, most))
        return self.heading_unless(ends.negation(inside), angle)

    def heading_unless(self, vague: FloatOrArray, heading: Interval[E]) -> Interval[E]:
        """A heading that is anything in (-pi, pi] where something makes it vague."""
        ends, half = self.ends, self.ends.number(math.pi)
        return ends.between(ends.where(vague, ends.negative(half), heading.low), ends.where(vague, half, heading.high))

    def at_most(self, a: E, b: E, beyond: float = 0.0) -> FloatOrArray:
        """Whether an end is at most another, or so little beyond it that rounding may have put it there."""
        return self.ends.at_most(a, self.ends.plus(b, self.ends.number(self.slack + beyond)))
