"""The abstract domain of intervals: bounds that hold every value, with ends of any kind (`interval_ends`).

A scalar has an interval, a vector or region has a box. A condition has a `Truth`: whether it can hold and whether it
can fail. Anything else (a text, a vector field) has None. Ends may be columns over many labels or samples. Then an
expression over observed values has exact intervals, whose ends are its values; where nothing is observed they are
infinite.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import TypeVar

from scenicq.forest.interpret import OnMap, RegionNode
from scenicq.forest.interval_arithmetic import IntervalArithmetic
from scenicq.forest.interval_values import FloatOrArray, Interval, IntervalValue, IntervalVector, Truth
from scenicq.forest.nodes import (
    AheadInLanes,
    Among,
    AmongOp,
    ArithmeticOp,
    CompareOp,
    Corridor,
    CourseCoordinate,
    DirectionAt,
    DiscAt,
    DiscreteRange,
    Distance,
    Feature,
    Identity,
    Index,
    LaneCourse,
    Leaf,
    LogicOp,
    Measure,
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
from scenicq.geometry.measures import NEVER
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import SLACK, Region

__all__ = ["IntervalDomain"]

E = TypeVar("E")
_OPEN = Truth(True, True)


def _unobserved(node: Feature) -> None:
    return None


@dataclass(frozen=True, slots=True)
class IntervalDomain(IntervalArithmetic[E]):
    """Outer bounds.

    Attributes:
        observed: What is known of a feature; None where it is not observed.
        points: Tighter boxes for some random points: (west, east), (south, north) in metres.
        boxed: Whether the boxes of regions bound distances and membership; if not, either may come out as anything.
    """

    observed: Callable[[Feature], IntervalValue[E]] = _unobserved
    points: Mapping[Identity, tuple[tuple[float, float], tuple[float, float]]] = field(
        default_factory=dict["Identity", tuple[tuple[float, float], tuple[float, float]]]
    )
    boxed: bool = True

    def _plane(self) -> IntervalVector[E]:
        return IntervalVector(self.everything(), self.everything())

    def _scalar(self, value: IntervalValue[E]) -> Interval[E]:
        if isinstance(value, Interval):
            return value
        return self.within(0.0, 1.0) if isinstance(value, Truth) else self.everything()

    def _pair(self, value: IntervalValue[E]) -> IntervalVector[E]:
        return value if isinstance(value, IntervalVector) else self._plane()

    # --- leaves

    def constant(self, value: Value) -> IntervalValue[E]:
        """A known value; an undefined one is unbounded."""
        if isinstance(value, bool):
            return Truth(value, not value)
        if isinstance(value, float):
            return self.ends.known(self.ends.number(value))
        if isinstance(value, tuple):
            return IntervalVector(*(self.ends.known(self.ends.number(part)) for part in value))
        if isinstance(value, Region):
            west, south, east, north = region_bounds(value)
            return IntervalVector(self.within(west, east), self.within(south, north))
        return self.everything() if isinstance(value, Undefined) else None

    def feature(self, node: Feature) -> IntervalValue[E]:
        """What is observed, or anything of its kind."""
        found = self.observed(node)
        if found is not None:
            return found
        return self._plane() if node.kind == "vector" else self.everything() if node.kind == "scalar" else None

    def variable(self, node: Leaf, args: Sequence[IntervalValue[E]]) -> IntervalValue[E]:
        """The support of a random variable."""
        match node:
            case Range() | DiscreteRange():
                return self.hull([self._scalar(arg) for arg in args])
            case TruncatedNormal():
                return self.ends.between(self._scalar(args[2]).low, self._scalar(args[3]).high)
            case Index():
                return self.within(0.0, len(node.weights) - 1.0)
            case PointIn():
                return self._point(node, self._pair(args[0]))
            case _:
                return self.everything()

    def _point(self, node: PointIn, region: IntervalVector[E]) -> IntervalVector[E]:
        if node.identity not in self.points:
            return region
        (x0, x1), (y0, y1) = self.points[node.identity]
        return self._common(region, IntervalVector(self.within(x0, x1), self.within(y0, y1)))

    def _common(self, a: IntervalVector[E], b: IntervalVector[E]) -> IntervalVector[E]:
        """The box that two boxes have in common."""
        most, least = self.ends.most, self.ends.least
        x, y = (self.ends.between(most([p.low, q.low]), least([p.high, q.high])) for p, q in zip(a, b, strict=True))
        return IntervalVector(x, y)

    # --- scalars

    def arithmetic(self, op: ArithmeticOp, args: Sequence[IntervalValue[E]]) -> Interval[E]:
        """An operation on numbers; a truth value counts as 0 or 1."""
        return self.operation(op, [self._scalar(arg) for arg in args])

    # --- vectors

    def vector(self, x: IntervalValue[E], y: IntervalValue[E]) -> IntervalVector[E]:
        """A vector of two numbers."""
        return IntervalVector(self._scalar(x), self._scalar(y))

    def sum(self, left: IntervalValue[E], right: IntervalValue[E]) -> IntervalVector[E]:
        """The sum of two vectors."""
        a, b = self._pair(left), self._pair(right)
        return IntervalVector(self.add(a.x, b.x), self.add(a.y, b.y))

    def scale(self, vector: IntervalValue[E], factor: IntervalValue[E]) -> IntervalVector[E]:
        """A vector times a number."""
        a, by = self._pair(vector), self._scalar(factor)
        return IntervalVector(self.multiply(a.x, by), self.multiply(a.y, by))

    def rotate(self, vector: IntervalValue[E], angle: IntervalValue[E]) -> IntervalVector[E]:
        """A box around a vector that is turned by an angle in radians."""
        (x, y), by = self._pair(vector), self._scalar(angle)
        ends = self.ends
        if not by.exact:
            reach = ends.hypot(self.largest(x), self.largest(y))
            around = ends.between(ends.negative(reach), reach)
            return IntervalVector(around, around)
        c, s = ends.known(ends.cosine(by.low)), ends.known(ends.sine(by.low))
        across = self.add(self.multiply(x, c), self.negative(self.multiply(y, s)))
        return IntervalVector(across, self.add(self.multiply(x, s), self.multiply(y, c)))

    def coordinate(self, vector: IntervalValue[E], axis: int) -> Interval[E]:
        """One coordinate."""
        return self._pair(vector)[axis]

    def norm(self, vector: IntervalValue[E]) -> Interval[E]:
        """The length of a vector."""
        x, y = self._pair(vector)
        if x.exact and y.exact:
            return self.ends.known(self.ends.hypot(x.low, y.low))
        far = self.ends.hypot(self.largest(x), self.largest(y))
        return self.ends.between(self.ends.hypot(self.nearest(x), self.nearest(y)), far)

    def bearing(self, vector: IntervalValue[E]) -> Interval[E]:
        """The heading of a known vector; of others, and of those of hardly any length, it is anything."""
        x, y = self._pair(vector)
        if not x.exact or not y.exact:
            return self.within(-math.pi, math.pi)
        ends, slack = self.ends, self.ends.number(self.slack)
        short = ends.at_most(ends.plus(ends.magnitude(x.low), ends.magnitude(y.low)), slack)
        value = ends.heading(x.low, y.low)
        seam = ends.negation(ends.at_most(ends.magnitude(value), ends.number(math.pi - self.slack)))
        return self.heading_unless(ends.either(short, seam), Interval(value, value))

    # --- truth

    def compare(self, op: CompareOp, left: IntervalValue[E], right: IntervalValue[E]) -> Truth:
        """A comparison of numbers; open for other values."""
        if not isinstance(left, Interval) or not isinstance(right, Interval):
            return _OPEN
        below, above = self.at_most(left.low, right.high), self.at_most(right.low, left.high)
        match op:
            case CompareOp.LT | CompareOp.LE:
                return Truth(below, above)
            case CompareOp.GT | CompareOp.GE:
                return Truth(above, below)
            case CompareOp.EQ:
                return Truth(self.ends.both(below, above), True)
            case CompareOp.NE:
                return Truth(True, self.ends.both(below, above))

    def logic(self, op: LogicOp, args: Sequence[IntervalValue[E]]) -> Truth:
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

    def select(self, index: IntervalValue[E], options: Sequence[IntervalValue[E]]) -> IntervalValue[E]:
        """The smallest interval or box around all options; open for truth values, None for mixed or other kinds."""
        if any(isinstance(option, Truth) for option in options):
            return _OPEN
        scalars = [option for option in options if isinstance(option, Interval)]
        if scalars and len(scalars) == len(options):
            return self.hull(scalars)
        pairs = [option for option in options if isinstance(option, IntervalVector)]
        if pairs and len(pairs) == len(options):
            return IntervalVector(self.hull([pair.x for pair in pairs]), self.hull([pair.y for pair in pairs]))
        return None

    def among(self, node: Among, args: Sequence[IntervalValue[E]]) -> IntervalValue[E]:
        """Nothing is known of other label objects."""
        match node.kind:
            case "boolean":
                return _OPEN
            case "vector":
                return self._plane()
            case "scalar":
                return self.within(0.0, math.inf) if node.op is AmongOp.COUNT else self.everything()
            case _:
                return None

    # --- the map

    def on_map(self, node: OnMap, args: Sequence[IntervalValue[E]]) -> IntervalValue[E]:
        """What the boxes say: a point in a region is in its box, and no point is nearer to a region than to its box."""
        match node:
            case DirectionAt():
                return self.within(-math.pi, math.pi)
            case Measure(measure="time_to_collision"):
                return self.within(0.0, NEVER)
            case CourseCoordinate() | Measure():
                return self.within(-math.inf, math.inf)
            case LaneCourse():
                return None
            case Distance():
                region, point = map(self._pair, args)
                return self._distance(region, point) if self.boxed else self.within(0.0, math.inf)
            case _:
                one, other = map(self._pair, args)
                return Truth(self._meet(one, other), True) if self.boxed else _OPEN

    def _distance(self, region: IntervalVector[E], point: IntervalVector[E]) -> Interval[E]:
        ends, zero, endless = self.ends, self.ends.number(0.0), self.ends.number(math.inf)
        x, y = (self.add(p, self.negative(q)) for p, q in zip(point, region, strict=True))
        near = ends.hypot(self.nearest(x), self.nearest(y))
        far = ends.hypot(self.largest(x), self.largest(y))
        # nothing is known of how far what is anywhere is from nothing
        return ends.between(
            ends.where(ends.at_most(zero, near), near, zero), ends.where(ends.at_most(zero, far), far, endless)
        )

    def _meet(self, a: IntervalVector[E], b: IntervalVector[E]) -> FloatOrArray:
        """Whether two boxes have a point in common."""
        found = [self.at_most(p.low, q.high, SLACK) for p, q in (*zip(a, b, strict=True), *zip(b, a, strict=True))]
        return reduce(self.ends.both, found)

    def region(self, node: RegionNode, args: Sequence[IntervalValue[E]]) -> IntervalValue[E]:
        """The box of a region."""
        boxes = [self._pair(arg) for arg in args]
        match node:
            case RegionUnion():
                return IntervalVector(self.hull([box.x for box in boxes]), self.hull([box.y for box in boxes]))
            case RegionIntersection():
                return reduce(self._common, boxes)
            case RegionDifference():
                return boxes[0]
            case Corridor() | AheadInLanes():
                return self._pair(None)
            case DiscAt() | SectorAt():
                reach = self.largest(self._scalar(args[1]))
            case RectangleAt():
                reach = self.ends.hypot(*(self.largest(self._scalar(arg)) for arg in args[2:]))
        around = self.ends.between(self.ends.negative(reach), reach)
        return IntervalVector(self.add(boxes[0].x, around), self.add(boxes[0].y, around))
