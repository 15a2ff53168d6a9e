"""Sufficient conditions: what of a frame's columns proves that it matches, without the matcher.

Each group of constraints has a condition that is true only where the group can surely be satisfied, by a band of
`SLACK` around every bound. Together with the necessary conditions they cut the frames in three: those that miss a
necessary condition do not match, those with objects that meet the sufficient ones match, and about the others the
matcher is asked.

A condition is read off a group in which one constraint at most hangs on what its random variables come out as; the
others must hold whatever that is. The values that this one constraint allows must be known exactly: a point of a
region, or sums of ranges and choices, each used once. Whatever the columns lack is never proved.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

from scenicq.forest.groups import PARAMS, Comparison, Condition, Constraint, Group
from scenicq.forest.interval_values import Interval
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    DiscAt,
    DiscreteRange,
    Identity,
    Index,
    Node,
    PointIn,
    Range,
    RegionIntersection,
    SectorAt,
    Select,
    VectorOf,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import features, postorder
from scenicq.geometry.network import Network
from scenicq.geometry.regions import Everywhere, IntersectionOf, Region
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import build_groups, relevant_properties
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.conditions import EGO, ConditionReader, difference, object_columns, turned_within
from scenicq.query.prefilter.map_relations import (
    LookUp,
    MapRelations,
    allowed_elements,
    look_up_of,
    shared_look_ups,
)
from scenicq.query.prefilter.regions import near_region
from scenicq.query.prefilter.sql_bounds import ARITHMETIC, SqlBounds
from scenicq.query.prefilter.sql_ends import SQL, Expr, all_of, any_of, number
from scenicq.store.schema import MEMBERSHIP_RADIUS_M
from scenicq.store.sql import sql_text

__all__ = ["SufficientCondition", "sufficient_conditions"]

_T = TypeVar("_T")
_COLUMNED = frozenset(object_columns(EGO))
"""Properties that a label has in columns; all others are among its attributes."""

Filled: TypeAlias = tuple[list[Interval[Expr]], frozenset[Identity]]
"""Intervals all of whose numbers an expression takes, and the random variables of which it hangs."""


@dataclass(frozen=True, slots=True)
class SufficientCondition:
    """A condition that proves a part of a match.

    Attributes:
        objects: The objects it is about but the ego, ascending: none, one (`a`) or two (`a` and `b`).
        sql: Over the columns of `ego`, `a` and `b`; not true where a label lacks what it needs.
        places: Conditions on memberships, each of which some row of the object must meet, too.
    """

    objects: tuple[int, ...]
    sql: str
    places: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True, slots=True)
class _Meant:
    """Which elements may be meant where the ego is.

    Attributes:
        among: Their numbers; None where each condition has some of its own.
        most: Any of so many elements at the place may be meant.
        shared: Whether the same element is meant where another object is.
    """

    among: frozenset[int] | None
    most: int
    shared: bool = False


class _OpenError(Exception):
    """The columns do not prove it."""


def sufficient_conditions(
    scenario: Scenario, network: Network, options: MatchOptions, relations: MapRelations
) -> tuple[SufficientCondition, ...] | None:
    """Conditions that together prove that a label matches, for distinct label objects within the radius.

    Args:
        scenario: The scenario, ready to be matched.
        network: The map it was compiled for.
        options: Tolerances and what is in force.
        relations: Those of the map, which gets the tables that conditions ask for.

    Returns:
        None if the columns cannot prove it.
    """
    noisy = any(owner.mutated for owner in scenario.objects)
    if noisy or options.method != "auto" or options.ego != "label" or options.exact or scenario.dynamics is not None:
        return None
    try:
        return tuple(_Prover(scenario, network, options, relations).all())
    except _OpenError:
        return None


class _Prover:
    def __init__(self, scenario: Scenario, network: Network, options: MatchOptions, relations: MapRelations) -> None:
        tolerance = options.tolerance.for_scenario(scenario)
        self.scenario, self.options, self.tolerance = scenario, options, tolerance
        self.names, self.relations = relations.names, relations
        self.reader = ConditionReader(scenario, tolerance, self.names, relations, network.roadDirection)

    def all(self) -> list[SufficientCondition]:
        """Conditions of all groups, where a label has columns for all that is compared and nothing else."""
        relevant = relevant_properties(self.scenario, self.options)
        found = [SufficientCondition((), f"{EGO}.ego_class <> ''")]
        for index, names in enumerate(relevant):
            others = sorted(names - _COLUMNED)
            own = index == self.scenario.ego
            column = f"{EGO}.ego_attributes" if own else "a.attributes"
            if others:
                found.append(SufficientCondition(() if own else (index,), _lacks(column, others)))
        params = [name for name, given in self.scenario.params.items() if given.explicit]
        compared = [name for name in params if name not in self.options.ignore_params]
        if compared:
            found.append(SufficientCondition((), _lacks(f"{EGO}.params", compared)))
        signature = (*(names & _COLUMNED for names in relevant), frozenset[str]())
        return found + [self.group(group) for group in build_groups(self.scenario, signature, self.options)]

    def group(self, group: Group) -> SufficientCondition:
        """What proves a group."""
        objects = tuple(index for index in group.objects if index != self.scenario.ego)
        # of a third object there are no columns
        bounds, texts, places, chosen = self.reader.of(objects), list[str](), list[tuple[int, str]](), 0
        meant = self._meant(group)
        for constraint in group.constraints:
            _check_columns(constraint, bounds)
            if isinstance(constraint, Condition):
                if allowed_elements(constraint.expression) is not None:
                    places += self._looked_up(constraint.expression, meant)
                    continue
                equal = shared_look_ups(constraint.expression)
                if equal is not None and len(objects) == 1:
                    places.append((objects[0], self._shared(equal, meant)))
                    continue
                texts.append(_told(SQL.negation(bounds.can_fail(constraint.expression))))
                continue
            chosen += 1
            if constraint.object == PARAMS or chosen > 1:
                raise _OpenError
            sql, near = self._comparison(constraint, bounds, meant)
            texts.append(sql)
            places += near
        return SufficientCondition(
            objects, " AND ".join(dict.fromkeys(f"({text})" for text in texts if text)), tuple(places)
        )

    def _meant(self, group: Group) -> _Meant | None:
        """Which elements may be meant where the ego is, for all that a group asks of them together.

        Where conditions look up elements of several kinds, it is not known which of each go together.
        """
        said = [each.expression for each in group.constraints if isinstance(each, Condition)]
        equations = [places for each in said if (places := shared_look_ups(each)) is not None]
        nodes = postorder([each.expression for each in group.constraints])
        found = [look_up for node in nodes if isinstance(node, Select) and (look_up := look_up_of(node.index))]
        found += [place for places in equations for place in places]
        allowed = [known for each in said if (known := allowed_elements(each))]
        found += [look_up for look_up, _ in allowed]
        if not found:
            return None
        objects = {each.object for each in found}
        alike = all(each.occupancy is found[0].occupancy for each in found)
        if not alike or self.scenario.ego not in objects or len(objects) != 1 + len(equations):
            return _Meant(None, 1)
        among = frozenset(range(found[0].occupancy.nothing)).intersection(*(numbers for _, numbers in allowed))
        return _Meant(among, min(each.ranks for each in found), shared=bool(equations))

    def _looked_up(self, condition: Node, meant: _Meant | None) -> list[tuple[int, str]]:
        """That a condition on what lies where the ego is surely holds."""
        found = allowed_elements(condition)
        if found is None or meant is None:
            raise _OpenError
        if found[0].object != self.scenario.ego:
            if meant.shared:
                return []
            raise _OpenError
        near = self.relations.surely_holds(found[0], found[1] if meant.among is None else meant.among, meant.most)
        if near is None:
            raise _OpenError
        return [(self.scenario.ego, near)]

    def _shared(self, places: tuple[LookUp, LookUp], meant: _Meant | None) -> str:
        """That the same element surely lies where the ego and another object are."""
        if meant is None or meant.among is None or not meant.shared:
            raise _OpenError
        near = self.relations.surely_share(places, meant.among, meant.most)
        if near is None:
            raise _OpenError
        return near

    def _comparison(
        self, item: Comparison, bounds: SqlBounds, meant: _Meant | None
    ) -> tuple[str, list[tuple[int, str]]]:
        own, node = bounds.columns[item.object, item.property], item.expression
        sure = self.tolerance.of(item.object, item.property).sure
        if sure <= SLACK:
            raise _OpenError
        if item.property == "position":
            return self._position(item.object, node, bounds, sure, meant)
        if item.property == "heading":
            return self._heading(item.object, node, bounds, sure), []
        if not isinstance(own, str):
            raise _OpenError
        allowed = [
            all_of([SQL.at_most(SQL.plus(low, -sure), own), SQL.at_most(own, SQL.plus(high, sure))])
            for low, high, _ in _filled(node, bounds)[0]
        ]
        return _told(any_of(allowed)), []

    def _heading(self, index: int, node: Node, bounds: SqlBounds, sure: float) -> str:
        own, terms, directions = self.reader.heading_terms(index, node, bounds)
        alternatives, _ = _sum([_filled(term, bounds) for term in terms])
        # `turned_within` allows for slack where what is asked for is certain
        within = turned_within(own, alternatives, sure - SLACK, directions)
        known = [f"len({directions}) > 0"] * bool(directions)
        if directions and (off := self.reader.off_lanes(directions)):
            known.append(f"NOT ({off}false)")
        return " AND ".join([*known, *[within] * bool(within)]) or "true"

    def _position(
        self, index: int, node: Node, bounds: SqlBounds, sure: float, meant: _Meant | None
    ) -> tuple[str, list[tuple[int, str]]]:  # fmt: skip
        own = bounds.columns[index, "position"]
        place = (own[0], own[1])
        if isinstance(node, PointIn) and isinstance(node.region, Select):
            return "", self._in_looked_up(index, node.region, sure, meant)
        if isinstance(node, PointIn):
            return self._inside(index, node.region, place, bounds, sure)
        rest_place, rest, _ = self.reader.framed(place, node, bounds)
        if (known := bounds.exact_vector(rest)) is not None:
            return _close([difference(p, q) for p, q in zip(rest_place, known, strict=True)], sure), []
        if not isinstance(rest, VectorOf):
            raise _OpenError
        (across, one), (along, other) = _filled(rest.x, bounds), _filled(rest.y, bounds)
        if one & other or len(across) * len(along) > LIMITS.proof_alternatives:
            raise _OpenError
        close = [
            _close([_beyond(p, limits) for p, limits in zip(rest_place, (x, y), strict=True)], sure)
            for x in across
            for y in along
        ]
        return _told(any_of(close)), []

    def _inside(
        self, index: int, region: Node, place: tuple[str, str], bounds: SqlBounds, sure: float
    ) -> tuple[str, list[tuple[int, str]]]:
        """That the place, or one within tolerance of it, lies in a region."""
        views, regions = _parts(region)
        # of several parts each may have a place of its own nearby: the place itself is asked for
        reach = min(sure, MEMBERSHIP_RADIUS_M) if len(views) + len(regions) == 1 else 0.0
        texts = [self._in_view(view, place, bounds) for view in views]
        places: list[tuple[int, str]] = []
        for part in regions:
            near = near_region(part, self.names, reach - SLACK)
            if near is None:
                raise _OpenError
            places.append((index, near))
        if self.options.radius is not None and index != self.scenario.ego:
            texts.append(f"{place[0].removesuffix('.x')}.ego_distance <= {number(self.options.radius - reach - SLACK)}")
        elif self.options.radius is not None and self.options.radius <= reach + SLACK:
            raise _OpenError
        return " AND ".join(texts), places

    def _in_looked_up(self, index: int, region: Select, sure: float, meant: _Meant | None) -> list[tuple[int, str]]:
        """That a place, or one within tolerance of it, lies in a region that hangs on where the ego is."""
        look_up = self.relations.of_ego(region.index)
        if look_up is None or meant is None or self.options.radius is not None:
            raise _OpenError
        among = range(look_up.occupancy.nothing) if meant.among is None else meant.among
        near = self.relations.surely_in(region, look_up, min(sure, MEMBERSHIP_RADIUS_M) - SLACK, among, meant.most)
        if near is None:
            raise _OpenError
        return [(index, near)]

    def _in_view(self, region: DiscAt | SectorAt, place: tuple[str, str], bounds: SqlBounds) -> str:
        radius = bounds.exact(region.radius)
        if radius is None or place != ("a.x", "a.y") or not self.reader.is_ego(region.center, "position"):
            raise _OpenError
        near = _told(SQL.at_most("a.ego_distance", SQL.plus(radius, -SLACK)))
        if not isinstance(region, SectorAt):
            return near
        angle = region.angle.value if isinstance(region.angle, Constant) else None
        if not isinstance(angle, float) or not self.reader.is_ego(region.heading, "heading"):
            raise _OpenError
        half = min(abs(angle) / 2, math.pi)
        aside = f"abs(a.ego_right) * {number(math.cos(half))} - a.ego_ahead * {number(math.sin(half))}"
        return f"{near} AND {aside} <= {number(-SLACK)}"


def _parts(root: Node) -> tuple[list[DiscAt | SectorAt], list[Region]]:
    """The views and the regions of the map of which a region is the intersection."""
    views: list[DiscAt | SectorAt] = []
    regions: list[Region] = []
    todo = [root]
    while todo:
        region = todo.pop()
        match region:
            case DiscAt() | SectorAt():
                views.append(region)
            case RegionIntersection():
                todo += region.parts
            case Constant(value=IntersectionOf() as value):
                regions += value.parts
            case Constant(value=Everywhere()):
                pass
            case Constant() if isinstance(region.value, Region):
                regions.append(region.value)
            case _:
                raise _OpenError
    return views, regions


def _filled(root: Node, bounds: SqlBounds) -> Filled:
    """The numbers that an expression takes: all of those in some intervals, and no others.

    Raises:
        _OpenError: It is not known, or a random variable is used twice.
    """
    found: dict[int, Filled] = {}
    for node in postorder((root,)):
        with suppress(_OpenError, KeyError):
            found[id(node)] = _filled_by(node, bounds, found)
    if id(root) not in found:
        raise _OpenError
    return found[id(root)]


def _filled_by(node: Node, bounds: SqlBounds, found: Mapping[int, Filled]) -> Filled:
    """The same from what is found of the nodes below."""
    known = bounds.exact(node)
    if known is not None:
        return [SQL.known(known)], frozenset()
    match node:
        case Range(low=Constant(value=float(low)), high=Constant(value=float(high))):
            return [Interval(min(low, high), max(low, high))], frozenset((node.identity,))
        case DiscreteRange(low=Constant(value=float(low)), high=Constant(value=float(high))):
            if high - low >= LIMITS.proof_alternatives:
                raise _OpenError
            numbers = range(math.ceil(low), math.floor(high) + 1)
            return [SQL.known(float(each)) for each in numbers], frozenset((node.identity,))
        case Arithmetic(op=ArithmeticOp.ADD):
            return _sum([found[id(arg)] for arg in node.args])
        case Arithmetic(op=ArithmeticOp.NEG | ArithmeticOp.SUB | ArithmeticOp.MUL):
            return _combined(node.op, [found[id(arg)] for arg in node.args])
        case Arithmetic(op=ArithmeticOp.DIV, args=(_, Constant(value=float(divisor)))) if divisor:
            return _combined(node.op, [found[id(arg)] for arg in node.args])
        case Select(index=Index() as index):
            options = [found[id(option)] for option in node.options]
            used = frozenset((index.identity,)).union(*(variables for _, variables in options))
            return _few([each for alternatives, _ in options for each in alternatives]), used
        case _:
            raise _OpenError


def _sum(terms: Sequence[Filled]) -> Filled:
    total: Filled = ([SQL.known(0.0)], frozenset())
    for term in terms:
        total = _combined(ArithmeticOp.ADD, [total, term])
    return total


def _combined(op: ArithmeticOp, args: Sequence[Filled]) -> Filled:
    """What an operation makes of independent expressions; of a product, one at most is not single numbers."""
    loose = [not all(each.exact for each in alternatives) for alternatives, _ in args]
    if op in (ArithmeticOp.MUL, ArithmeticOp.DIV) and sum(loose) > 1:
        raise _OpenError
    used = frozenset[Identity]().union(*(variables for _, variables in args))
    if len(used) != sum(len(variables) for _, variables in args):
        raise _OpenError
    chosen: list[list[Interval[Expr]]] = [[]]
    for alternatives, _ in args:
        chosen = _few([[*each, more] for each in chosen for more in alternatives])
    found: list[Interval[Expr]] = []
    for each in chosen:
        made = ARITHMETIC.arithmetic(op, each)
        if any(isinstance(end, float) and not math.isfinite(end) for end in made[:2]):
            raise _OpenError
        found.append(made)
    return found, used


def _few(found: list[_T]) -> list[_T]:
    if len(found) > LIMITS.proof_alternatives:
        raise _OpenError
    return found


def _beyond(place: Expr, limits: Interval[Expr]) -> Expr:
    """How far a number is beyond an interval."""
    return SQL.most([difference(limits.low, place), difference(place, limits.high), 0.0])


def _close(off: Sequence[Expr], sure: float) -> str:
    """Whether a vector is short."""
    x, y = off
    squares = [SQL.times(each, each) for each in (x, y)]
    return _told(SQL.at_most(SQL.plus(*squares), sure * sure))


def _check_columns(constraint: Constraint, bounds: SqlBounds) -> None:
    """Raise unless there are columns for all that a constraint speaks of; where a label lacks it they are null."""
    asked = features(constraint.expression)
    own = [(constraint.object, constraint.property)] if isinstance(constraint, Comparison) else []
    if not all(key in bounds.columns for key in (*asked, *own)):
        raise _OpenError


def _told(condition: str | bool) -> str:
    """SQL of a condition.

    Raises:
        _OpenError: It never holds.
    """
    if condition is False:
        raise _OpenError
    return condition if isinstance(condition, str) else "true"


def _lacks(column: str, names: Sequence[str]) -> str:
    """That an object in JSON has none of some names."""
    if not all(name.isidentifier() for name in names):
        raise _OpenError
    paths = [f'$."{name}"' for name in names]
    absent = [f"json_extract({column}, {sql_text(path)}) IS NULL" for path in paths]
    return f"({' AND '.join(absent)})"
