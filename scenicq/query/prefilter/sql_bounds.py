"""Bounds of expressions as SQL: the domain of intervals with ends that are SQL, a few alternatives kept apart.

A value is a few alternatives, each of which is bounded over the columns of the objects that it speaks of; options of a
choice are alternatives. Every comparison is widened by `SLACK`, so that rounding in the database cannot exclude what
the matcher would accept, and what SQL cannot say is unbounded, which excludes nothing. Whether an expression takes
every value within its alternatives travels with them: a *necessary* condition needs the bounds alone, a *sufficient*
one needs that, too.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from scenicq.forest.interpret import OnMap, RegionNode, interpret, steps_of
from scenicq.forest.interval_values import Interval, IntervalValue, IntervalVector, Truth
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.nodes import (
    COURSE,
    Among,
    ArithmeticOp,
    CompareOp,
    Constant,
    CourseCoordinate,
    DiscreteRange,
    Distance,
    Feature,
    Identity,
    Index,
    Leaf,
    LogicOp,
    Node,
    Range,
    Value,
)
from scenicq.geometry.regions import Region
from scenicq.limits import LIMITS
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.sql_ends import SQL, Expr, any_of

__all__ = ["ARITHMETIC", "ON_EGO_COURSE", "Columns", "SqlBounds"]

ON_EGO_COURSE = ("along the ego's course", "beside the ego's course")
"""Features of label objects that programs cannot name, by axis: pairs of the ends between which they are."""


class Alternatives(NamedTuple):
    """What is known of a value.

    Attributes:
        values: The value lies in one of them.
        attained: The random variables that it depends on, where it takes every value of the alternatives, whatever else
            is random; None where it may not.
    """

    values: tuple[IntervalValue[Expr], ...]
    attained: frozenset[Identity] | None = None


Columns = Mapping[tuple[int, str], str | tuple[str, str]]
"""The column of each (object, property) that has one; a pair for vectors."""


ARITHMETIC = IntervalDomain(SQL, slack=SLACK)
"""Operations on intervals whose ends are SQL."""
_PLANE = IntervalVector(ARITHMETIC.everything(), ARITHMETIC.everything())


@dataclass(slots=True)
class SqlBounds:
    """Bounds of the nodes of one scenario over the columns of some objects.

    Attributes:
        columns: The columns; a feature without one is unbounded.
        nearest: SQL of a lower bound of the distance from a point, given as SQL, to a region, if there is one.
    """

    columns: Columns
    nearest: Callable[[Region, str, str], str | None] = lambda region, x, y: None
    _known: dict[int, Alternatives] = field(default_factory=dict["int", "Alternatives"])
    _kept: list[Node] = field(default_factory=list[Node])

    def intervals(self, root: Node, *, attained: bool = False) -> tuple[Interval[Expr], ...]:
        """The alternatives of a scalar expression; if it is to attain them all and may not, there are none."""
        value = self._value(root)
        if attained and value.attained is None:
            return ()
        found = tuple(each for each in value.values if isinstance(each, Interval))
        return found if len(found) == len(value.values) else () if attained else (ARITHMETIC.everything(),)

    def boxes(self, root: Node, *, attained: bool = False) -> tuple[IntervalVector[Expr], ...]:
        """The alternatives of a vector expression; if it is to attain them all and may not, there are none."""
        value = self._value(root)
        if attained and value.attained is None:
            return ()
        found = tuple(each for each in value.values if isinstance(each, IntervalVector))
        return found if len(found) == len(value.values) else () if attained else (_PLANE,)

    def exact(self, root: Node) -> Expr | None:
        """A scalar expression that the columns determine, None if they do not."""
        found = self.intervals(root)
        return found[0].low if len(found) == 1 and found[0].exact else None

    def exact_vector(self, root: Node) -> tuple[Expr, Expr] | None:
        """A vector expression that the columns determine, None if they do not."""
        found = self.boxes(root)
        x, y = found[0]
        return (x.low, y.low) if len(found) == 1 and x.exact and y.exact else None

    def can_hold(self, root: Node) -> str | bool:
        """SQL that is true wherever a condition can hold; True if it always can."""
        return any_of([each.can_hold if isinstance(each, Truth) else True for each in self._value(root).values])

    def can_fail(self, root: Node) -> str | bool:
        """SQL that is true wherever a condition can fail; True if it always can."""
        return any_of([each.can_fail if isinstance(each, Truth) else True for each in self._value(root).values])

    def _value(self, root: Node) -> Alternatives:
        if id(root) not in self._known:
            domain = IntervalDomain(SQL, self._column, slack=SLACK, boxed=False)
            # what is known by its id must stay: another node would get the id, and with it the bounds
            self._kept.append(root)
            self._known = interpret(steps_of(root), _Alternatives(domain, self._on_map), self._known)
        return self._known[id(root)]

    def _on_map(self, node: OnMap, args: Sequence[Alternatives]) -> Alternatives | None:
        """Bounds of what hangs on the map; None where nothing is known."""
        return self._on_course(node) if isinstance(node, CourseCoordinate) else self._distance(node, args)

    def _on_course(self, node: CourseCoordinate) -> Alternatives | None:
        """The ends between which an object is along, or beside, the course of the ego."""
        owner, place = node.course, node.point
        if not (isinstance(owner, Feature) and isinstance(place, Feature) and owner.current == place.current):
            return None
        if place.property != "position" or (owner.object, owner.property) not in self.columns:
            return None
        ends = self.columns.get((place.object, ON_EGO_COURSE[node.axis]))
        if not isinstance(ends, tuple):
            return None
        return Alternatives((Interval(*ends) if node.end is None else SQL.known(ends[node.end]),))

    def _distance(self, node: OnMap, args: Sequence[Alternatives]) -> Alternatives | None:
        """Bounds of the distance from a known point to a region of the map."""
        if not (isinstance(node, Distance) and isinstance(node.region, Constant) and len(args[1].values) == 1):
            return None
        region, (point,) = node.region.value, args[1].values
        if not (isinstance(region, Region) and isinstance(point, IntervalVector) and point.x.exact and point.y.exact):
            return None
        x, y = point.x.low, point.y.low
        low = self.nearest(region, x, y) if isinstance(x, str) and isinstance(y, str) else None
        return None if low is None else Alternatives((Interval(low, math.inf),))

    def _column(self, node: Feature) -> IntervalValue[Expr]:
        column = None if node.property == COURSE else self.columns.get((node.object, node.property))
        if isinstance(column, tuple):
            return IntervalVector(*map(SQL.known, column))
        if column is not None and node.kind == "boolean":
            return Truth(column, SQL.negation(column))
        return None if column is None else SQL.known(column)


class _Alternatives:
    """Operations on alternatives: those of the domain on each combination of them."""

    def __init__(
        self,
        domain: IntervalDomain[Expr],
        on_map: Callable[[OnMap, Sequence[Alternatives]], Alternatives | None],
    ) -> None:
        self.domain = domain
        self.known_on_map = on_map

    def constant(self, value: Value) -> Alternatives:
        return self._few([self.domain.constant(value)])

    def feature(self, node: Feature) -> Alternatives:
        return self._few([self.domain.feature(node)])

    def among(self, node: Among, args: Sequence[Alternatives]) -> Alternatives:
        return self._few([self.domain.among(node, ())], None)

    def variable(self, node: Leaf, args: Sequence[Alternatives]) -> Alternatives:
        own = frozenset((node.identity,))
        if isinstance(node, Index) and len(node.weights) <= LIMITS.sql_alternatives:
            return Alternatives(tuple(map(self.domain.constant, map(float, range(len(node.weights))))), own)
        known = all(map(_is_number, args))
        ends = [arg.values[0] for arg in args if len(arg.values) == 1]
        if isinstance(node, DiscreteRange) and len(ends) == len(args):
            low, high = self.domain.hull([each for each in ends if isinstance(each, Interval)])[:2]
            if isinstance(low, float) and isinstance(high, float) and high - low < LIMITS.sql_alternatives:
                numbers = range(math.ceil(low), math.floor(high) + 1)
                return self._few([self.domain.constant(float(number)) for number in numbers], own if known else None)
        attained = own if isinstance(node, Range) and known else None
        return self._each(lambda *chosen: self.domain.variable(node, chosen), args, attained)

    def arithmetic(self, op: ArithmeticOp, args: Sequence[Alternatives]) -> Alternatives:
        attained = None
        match op:
            case ArithmeticOp.ADD | ArithmeticOp.SUB | ArithmeticOp.NEG:
                attained = _independent(args)
            case ArithmeticOp.MUL if sum(not all(map(_is_point, arg.values)) for arg in args) <= 1:
                attained = _independent(args)
            case ArithmeticOp.DIV if _is_number(args[1]):
                attained = _independent(args)
            case _:
                pass
        return self._each(lambda *chosen: self.domain.arithmetic(op, chosen), args, attained)

    def vector(self, x: Alternatives, y: Alternatives) -> Alternatives:
        return self._each(self.domain.vector, (x, y), _independent((x, y)))

    def sum(self, left: Alternatives, right: Alternatives) -> Alternatives:
        return self._each(self.domain.sum, (left, right), _independent((left, right)))

    def scale(self, vector: Alternatives, factor: Alternatives) -> Alternatives:
        return self._each(self.domain.scale, (vector, factor))

    def rotate(self, vector: Alternatives, angle: Alternatives) -> Alternatives:
        return self._each(self.domain.rotate, (vector, angle))

    def coordinate(self, vector: Alternatives, axis: int) -> Alternatives:
        return self._each(lambda *chosen: self.domain.coordinate(chosen[0], axis), (vector,), vector.attained)

    def norm(self, vector: Alternatives) -> Alternatives:
        return self._each(self.domain.norm, (vector,))

    def bearing(self, vector: Alternatives) -> Alternatives:
        return self._each(self.domain.bearing, (vector,))

    def compare(self, op: CompareOp, left: Alternatives, right: Alternatives) -> Alternatives:
        pairs = itertools.product(left.values, right.values)
        found = [self.domain.compare(op, one, other) for one, other in pairs]
        return Alternatives(
            (Truth(any_of([each.can_hold for each in found]), any_of([each.can_fail for each in found])),)
        )

    def logic(self, op: LogicOp, args: Sequence[Alternatives]) -> Alternatives:
        return self._each(lambda *chosen: self.domain.logic(op, chosen), args)

    def select(self, index: Alternatives, options: Sequence[Alternatives]) -> Alternatives:
        used = [option.attained for option in options if option.attained is not None]
        # what is chosen may share random variables with what is not, but not with the choice
        free = (
            index.attained is not None and len(used) == len(options) and not any(map(index.attained.intersection, used))
        )
        attained = index.attained.union(*used) if free and index.attained is not None else None
        return self._few([each for option in options for each in option.values], attained)

    def on_map(self, node: OnMap, args: Sequence[Alternatives]) -> Alternatives:
        known = self.known_on_map(node, args)
        return self._each(lambda *chosen: self.domain.on_map(node, chosen), args) if known is None else known

    def region(self, node: RegionNode, args: Sequence[Alternatives]) -> Alternatives:
        return self._each(lambda *chosen: self.domain.region(node, chosen), args)

    def _each(
        self,
        operation: Callable[..., IntervalValue[Expr]],
        args: Sequence[Alternatives],
        attained: frozenset[Identity] | None = None,
    ) -> Alternatives:
        values = [arg.values for arg in args]
        if math.prod(map(len, values)) > LIMITS.sql_alternatives**2:
            values, attained = [(self._joined(each),) for each in values], None
        return self._few([operation(*chosen) for chosen in itertools.product(*values)], attained)

    def _few(self, found: Sequence[IntervalValue[Expr]], attained: frozenset[Identity] | None = None) -> Alternatives:
        """At most so many alternatives, none of them endless to read."""
        values = list(dict.fromkeys(found))
        if len(values) > LIMITS.sql_alternatives:
            values, attained = [self._joined(values)], None
        values = tuple(map(self._readable, values))
        if not all(map(_is_bounded, values)):
            attained = None
        return Alternatives(values, frozenset() if len(values) == 1 and _is_point(values[0]) else attained)

    def _joined(self, parts: Sequence[IntervalValue[Expr]]) -> IntervalValue[Expr]:
        """What holds all of some alternatives."""
        return parts[0] if len(parts) == 1 else self.domain.select(None, parts)

    def _readable(self, value: IntervalValue[Expr]) -> IntervalValue[Expr]:
        """The value; an interval with an end that would be endless to read has no ends."""
        if isinstance(value, IntervalVector):
            return IntervalVector(self._short(value.x), self._short(value.y))
        return self._short(value) if isinstance(value, Interval) else value

    def _short(self, value: Interval[Expr]) -> Interval[Expr]:
        long = any(isinstance(end, str) and len(end) > LIMITS.sql_characters for end in value[:2])
        return self.domain.everything() if long else value


def _independent(args: Sequence[Alternatives]) -> frozenset[Identity] | None:
    """The random variables of values that are all attained, and depend on none together."""
    used = [arg.attained for arg in args if arg.attained is not None]
    together = frozenset[Identity]().union(*used)
    return together if len(used) == len(args) and len(together) == sum(map(len, used)) else None


def _coordinates(value: IntervalValue[Expr]) -> tuple[Interval[Expr], ...]:
    """The intervals of a number or of a point; none of anything else."""
    return (value,) if isinstance(value, Interval) else (value.x, value.y) if isinstance(value, IntervalVector) else ()


def _is_point(value: IntervalValue[Expr]) -> bool:
    """Whether a value is a single number or point."""
    found = _coordinates(value)
    return bool(found) and all(each.exact for each in found)


def _is_bounded(value: IntervalValue[Expr]) -> bool:
    """Whether no end is infinite or unknown."""
    ends = [end for each in _coordinates(value) for end in each[:2]]
    return not any(isinstance(end, float) and not math.isfinite(end) for end in ends)


def _is_number(value: Alternatives) -> bool:
    """Whether a value is one number that is known without the columns."""
    first = value.values[0]
    return len(value.values) == 1 and _is_point(first) and isinstance(first, Interval) and isinstance(first.low, float)
