"""The domain of intervals: outer bounds of values, never too narrow, over ends of any kind (`interval_ends`).

A scalar is an interval, a vector or a region a box, a truth value whether it can hold and whether it can fail; anything
else (a text, a vector field) is None. With ends that are columns, an expression over what many labels or samples
observe has exact intervals: their ends are its values, and where nothing is observed they are infinite.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Generic, TypeVar

from scenicq.forest.interpret import OnMap, RegionNode
from scenicq.forest.interval_ends import Ends
from scenicq.forest.interval_values import Array, Bounds, Interval, IntervalVector, Truth
from scenicq.forest.nodes import (
    ArithmeticOp,
    CompareOp,
    DirectionAt,
    DiscAt,
    DiscreteRange,
    Distance,
    Feature,
    Identity,
    Index,
    Leaf,
    LogicOp,
    PointIn,
    Range,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    SectorAt,
    TruncatedNormal,
    Undefined,
    Value,
)
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import SLACK, Region

__all__ = ["IntervalDomain"]

E = TypeVar("E")
_OPEN = Truth(True, True)
_RANGES: Mapping[ArithmeticOp, tuple[float, float]] = {
    ArithmeticOp.SIN: (-1.0, 1.0),
    ArithmeticOp.COS: (-1.0, 1.0),
    ArithmeticOp.ASIN: (-math.pi / 2, math.pi / 2),
    ArithmeticOp.ATAN: (-math.pi / 2, math.pi / 2),
    ArithmeticOp.ACOS: (0.0, math.pi),
    ArithmeticOp.ATAN2: (-math.pi, math.pi),
}
"""What functions give of anything."""


def _unobserved(node: Feature) -> None:
    return None


@dataclass(frozen=True, slots=True)
class IntervalDomain(Generic[E]):
    """Outer bounds.

    Attributes:
        ends: The arithmetic of the ends.
        observed: What is known of a feature; None where it is not observed.
        points: Tighter boxes for some random points: (west, east), (south, north) in metres.
        slack: Metres or radians by which rounding may put values beyond where comparisons and seams of angles lie.
    """

    ends: Ends[E]
    observed: Callable[[Feature], Bounds[E]] = _unobserved
    points: Mapping[Identity, tuple[tuple[float, float], tuple[float, float]]] = field(
        default_factory=dict["Identity", tuple[tuple[float, float], tuple[float, float]]]
    )
    slack: float = 0.0

    def everything(self) -> Interval[E]:
        """Any number."""
        return self._within(-math.inf, math.inf)

    def _within(self, low: float, high: float) -> Interval[E]:
        return self.ends.between(self.ends.number(low), self.ends.number(high))

    def _plane(self) -> IntervalVector[E]:
        return IntervalVector(self.everything(), self.everything())

    def _scalar(self, value: Bounds[E]) -> Interval[E]:
        if isinstance(value, Interval):
            return value
        return self._within(0.0, 1.0) if isinstance(value, Truth) else self.everything()

    def _pair(self, value: Bounds[E]) -> IntervalVector[E]:
        return value if isinstance(value, IntervalVector) else self._plane()

    # --- leaves

    def constant(self, value: Value) -> Bounds[E]:
        """A known value; an undefined one is unbounded."""
        if isinstance(value, bool):
            return Truth(value, not value)
        if isinstance(value, float):
            return self.ends.known(self.ends.number(value))
        if isinstance(value, tuple):
            return IntervalVector(*(self.ends.known(self.ends.number(part)) for part in value))
        if isinstance(value, Region):
            west, south, east, north = region_bounds(value)
            return IntervalVector(self._within(west, east), self._within(south, north))
        return self.everything() if isinstance(value, Undefined) else None

    def feature(self, node: Feature) -> Bounds[E]:
        """What is observed, or anything of its kind."""
        found = self.observed(node)
        if found is not None:
            return found
        return self._plane() if node.kind == "vector" else self.everything() if node.kind == "scalar" else None

    def variable(self, node: Leaf, args: Sequence[Bounds[E]]) -> Bounds[E]:
        """The support of a random variable."""
        match node:
            case Range() | DiscreteRange():
                return self._hull([self._scalar(arg) for arg in args])
            case TruncatedNormal():
                return self.ends.between(self._scalar(args[2]).low, self._scalar(args[3]).high)
            case Index():
                return self._within(0.0, len(node.weights) - 1.0)
            case PointIn():
                return self._point(node, self._pair(args[0]))
            case _:
                return self.everything()

    def _point(self, node: PointIn, region: IntervalVector[E]) -> IntervalVector[E]:
        if node.identity not in self.points:
            return region
        (x0, x1), (y0, y1) = self.points[node.identity]
        return self._common(region, IntervalVector(self._within(x0, x1), self._within(y0, y1)))

    def _common(self, a: IntervalVector[E], b: IntervalVector[E]) -> IntervalVector[E]:
        """The box that two boxes have in common."""
        most, least = self.ends.most, self.ends.least
        x, y = (self.ends.between(most([p.low, q.low]), least([p.high, q.high])) for p, q in zip(a, b, strict=True))
        return IntervalVector(x, y)

    # --- scalars

    def arithmetic(self, op: ArithmeticOp, args: Sequence[Bounds[E]]) -> Interval[E]:
        """An operation on numbers; a truth value counts as 0 or 1."""
        return self._operation(op, [self._scalar(arg) for arg in args])

    def _operation(self, op: ArithmeticOp, args: list[Interval[E]]) -> Interval[E]:
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
                near, far = self._nearest(first), self._largest(first)
                return ends.known(far) if first.exact else ends.between(near, far)
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
                return self._within(*_RANGES.get(op, (-math.inf, math.inf)))

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

    def _hull(self, parts: Sequence[Interval[E]]) -> Interval[E]:
        return self._ends_of(parts, self.ends.least, self.ends.most)

    def _largest(self, a: Interval[E]) -> E:
        """The greatest distance from zero."""
        return self.ends.most([a.high, self.ends.negative(a.low)])

    def _nearest(self, a: Interval[E]) -> E:
        """The least distance from zero."""
        return self.ends.most([self.ends.number(0.0), a.low, self.ends.negative(a.high)])

    def _wrapped(self, angle: Interval[E]) -> Interval[E]:
        """An angle in (-pi, pi]: beyond half a turn, and where rounding may decide at the seam, it is anything."""
        ends, half, slack = self.ends, math.pi, self.slack
        value = angle
        if angle.exact:
            turned = ends.plus(ends.remainder(ends.plus(angle.low, ends.number(half)), math.tau), ends.number(-half))
            value = Interval(turned, turned)
        above = ends.negation(ends.at_most(value.low, ends.number(slack - half)))
        inside = ends.both(above, ends.at_most(value.high, ends.number(half - slack)))
        return ends.between(
            ends.where(inside, value.low, ends.number(-half)), ends.where(inside, value.high, ends.number(half))
        )

    # --- vectors

    def vector(self, x: Bounds[E], y: Bounds[E]) -> IntervalVector[E]:
        """A vector of two numbers."""
        return IntervalVector(self._scalar(x), self._scalar(y))

    def sum(self, left: Bounds[E], right: Bounds[E]) -> IntervalVector[E]:
        """The sum of two vectors."""
        a, b = self._pair(left), self._pair(right)
        return IntervalVector(self.add(a.x, b.x), self.add(a.y, b.y))

    def scale(self, vector: Bounds[E], factor: Bounds[E]) -> IntervalVector[E]:
        """A vector times a number."""
        a, by = self._pair(vector), self._scalar(factor)
        return IntervalVector(self.multiply(a.x, by), self.multiply(a.y, by))

    def rotate(self, vector: Bounds[E], angle: Bounds[E]) -> IntervalVector[E]:
        """A box around what a vector turns to."""
        (x, y), by = self._pair(vector), self._scalar(angle)
        ends = self.ends
        if not by.exact:
            reach = ends.hypot(self._largest(x), self._largest(y))
            around = ends.between(ends.negative(reach), reach)
            return IntervalVector(around, around)
        c, s = ends.known(ends.cosine(by.low)), ends.known(ends.sine(by.low))
        across = self.add(self.multiply(x, c), self.negative(self.multiply(y, s)))
        return IntervalVector(across, self.add(self.multiply(x, s), self.multiply(y, c)))

    def coordinate(self, vector: Bounds[E], axis: int) -> Interval[E]:
        """One coordinate."""
        return self._pair(vector)[axis]

    def norm(self, vector: Bounds[E]) -> Interval[E]:
        """The length of a vector."""
        x, y = self._pair(vector)
        far = self.ends.hypot(self._largest(x), self._largest(y))
        if x.exact and y.exact:
            return self.ends.known(far)
        return self.ends.between(self.ends.hypot(self._nearest(x), self._nearest(y)), far)

    def bearing(self, vector: Bounds[E]) -> Interval[E]:
        """Any heading."""
        return self._within(-math.pi, math.pi)

    # --- truth

    def compare(self, op: CompareOp, left: Bounds[E], right: Bounds[E]) -> Truth:
        """A comparison of numbers; open for other values."""
        if not isinstance(left, Interval) or not isinstance(right, Interval):
            return _OPEN
        below, above = self._at_most(left.low, right.high), self._at_most(right.low, left.high)
        match op:
            case CompareOp.LT | CompareOp.LE:
                return Truth(below, above)
            case CompareOp.GT | CompareOp.GE:
                return Truth(above, below)
            case CompareOp.EQ:
                return Truth(self.ends.both(below, above), True)
            case CompareOp.NE:
                return Truth(True, self.ends.both(below, above))

    def _at_most(self, a: E, b: E, beyond: float = 0.0) -> Array:
        return self.ends.at_most(a, self.ends.plus(b, self.ends.number(self.slack + beyond)))

    def logic(self, op: LogicOp, args: Sequence[Bounds[E]]) -> Truth:
        """A combination of truth values."""
        parts = [arg if isinstance(arg, Truth) else _OPEN for arg in args]
        if op is LogicOp.NOT:
            return Truth(parts[0].can_fail, parts[0].can_hold)
        hold, fail = parts[0]
        both, either = self.ends.both, self.ends.either
        for part in parts[1:]:
            if op is LogicOp.AND:
                hold, fail = both(hold, part.can_hold), either(fail, part.can_fail)
            else:
                hold, fail = either(hold, part.can_hold), both(fail, part.can_fail)
        return Truth(hold, fail)

    def select(self, index: Bounds[E], options: Sequence[Bounds[E]]) -> Bounds[E]:
        """What holds all options."""
        if any(isinstance(option, Truth) for option in options):
            return _OPEN
        scalars = [option for option in options if isinstance(option, Interval)]
        if scalars and len(scalars) == len(options):
            return self._hull(scalars)
        pairs = [option for option in options if isinstance(option, IntervalVector)]
        if pairs and len(pairs) == len(options):
            return IntervalVector(self._hull([pair.x for pair in pairs]), self._hull([pair.y for pair in pairs]))
        return None

    # --- the map

    def on_map(self, node: OnMap, args: Sequence[Bounds[E]]) -> Bounds[E]:
        """Points are in a region only where they are in its box, and no closer to it than to its box."""
        match node:
            case DirectionAt():
                return self._within(-math.pi, math.pi)
            case Distance():
                return self._distance(self._pair(args[0]), self._pair(args[1]))
            case _:
                return Truth(self._meet(self._pair(args[0]), self._pair(args[1])), True)

    def _distance(self, region: IntervalVector[E], point: IntervalVector[E]) -> Interval[E]:
        ends, zero, endless = self.ends, self.ends.number(0.0), self.ends.number(math.inf)
        x, y = (self.add(p, self.negative(q)) for p, q in zip(point, region, strict=True))
        near = ends.hypot(self._nearest(x), self._nearest(y))
        far = ends.hypot(self._largest(x), self._largest(y))
        # nothing is known of how far what is anywhere is from nothing
        return ends.between(
            ends.where(ends.at_most(zero, near), near, zero), ends.where(ends.at_most(zero, far), far, endless)
        )

    def _meet(self, a: IntervalVector[E], b: IntervalVector[E]) -> Array:
        """Whether two boxes have a point in common."""
        found = [self._at_most(p.low, q.high, SLACK) for p, q in (*zip(a, b, strict=True), *zip(b, a, strict=True))]
        return reduce(self.ends.both, found)

    def region(self, node: RegionNode, args: Sequence[Bounds[E]]) -> Bounds[E]:
        """The box of a region."""
        boxes = [self._pair(arg) for arg in args]
        match node:
            case RegionUnion():
                return IntervalVector(self._hull([box.x for box in boxes]), self._hull([box.y for box in boxes]))
            case RegionIntersection():
                return reduce(self._common, boxes)
            case RegionDifference():
                return boxes[0]
            case DiscAt() | SectorAt():
                reach = self._largest(self._scalar(args[1]))
            case RectangleAt():
                reach = self.ends.hypot(*(self._largest(self._scalar(arg)) for arg in args[2:]))
        around = self.ends.between(self.ends.negative(reach), reach)
        return IntervalVector(self.add(boxes[0].x, around), self.add(boxes[0].y, around))
