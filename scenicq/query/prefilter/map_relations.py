"""Look-ups of elements of the map as relations in SQL: what lies where the ego is, and what the program makes of it.

`ego.lane` at an observed place is one of the elements whose areas are there, which are rows of `memberships`. What a
program makes of an element (its own area, the lane to its left, its group, the lanes ahead of it) is a relation between
elements and the regions of a map, so that "in `ego.lane`" is a join. Each relation is asked in two ways: of all
elements that may be meant (necessary), and of those that surely lie at the place, where any of them may be meant
(sufficient).
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.column_domain import ColumnDomain, first_direction
from scenicq.forest.columns import DEFINED, UNKNOWN, Column, truth_of
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    Feature,
    Identity,
    Index,
    Node,
    Select,
    Undefined,
)
from scenicq.forest.walk import children, is_leaf
from scenicq.geometry.abstract_map import AbstractArea, AbstractOccupancy, LinkedFrom, led_kind
from scenicq.geometry.angles import ALONG
from scenicq.geometry.links import DIRECTS, IS_SECTION
from scenicq.geometry.occupancy import TOLERANCE, ElementAtPoint, Occupancy
from scenicq.geometry.regions import PolygonSet, Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.limits import LIMITS
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.regions import RegionNames, among_names, region_ids
from scenicq.query.prefilter.sql_ends import number
from scenicq.store.sql import sql_text

__all__ = ["LookUp", "MapRelations", "MeantElements", "allowed_elements", "is_along", "look_up_of", "shared_look_ups"]

_AT = f"distance <= {number(TOLERANCE + SLACK)}"
"""An element that may be found at a place."""
_OF_LANES = ("lane_group", "road")
"""The kinds of elements whose direction is that of their lane at a place."""
_DIRECTED = ("lane", "lane_section", *_OF_LANES)
"""The kinds of elements of which it is known how far they lead from a heading."""
_TURNED = "turned"
"""The table of how far the lanes in which objects are, of groups and roads, lead from their headings."""
_EVERY_RANK = 1 << 30
"""More elements than lie at any place."""


@dataclass(frozen=True, slots=True, eq=False)
class LookUp:
    """The number of the element that lies where an object is.

    Attributes:
        occupancy: The elements.
        object: The object, by index.
        ranks: Any of so many elements at the place may be meant; where there are more, it is not known which.
        choice: What chooses among them; None where it is always the same.
        by_heading: Whether the way that the object goes says which of several may be meant.
    """

    occupancy: Occupancy
    object: int
    ranks: int = 1
    choice: Identity | None = None
    by_heading: bool = False

    def is_like(self, other: LookUp) -> bool:
        """Whether both are of one element."""
        same = self.occupancy is other.occupancy and self.object == other.object
        return same and self.by_heading == other.by_heading

    def is_same(self, other: LookUp) -> bool:
        """Whether both always find the same element."""
        return self.is_like(other) and self.choice is other.choice

    def leads_to(self, other: LookUp) -> bool:
        """Whether what it finds always leads to what another one finds, which is something else, over any map."""
        one, two = self.occupancy, other.occupancy
        if not isinstance(one, AbstractOccupancy) or not isinstance(two, AbstractOccupancy):
            return False
        alike = (self.object, self.by_heading) == (other.object, other.by_heading) and self.choice is other.choice
        return alike and one is not two and one.leads_to(two)


def look_up_of(node: Node) -> LookUp | None:
    """The look-up whose number an expression is, whichever of several elements at a place is meant."""
    ranked, choice = (node,), None
    if isinstance(node, Select) and isinstance(node.index, Index):
        ranked, choice = node.options, node.index.identity
    found = [_of_rank(each) for each in ranked]
    first = found[0]
    if first is None or not all(each is not None and each.is_like(first) for each in found):
        return None
    ranks = _EVERY_RANK if isinstance(first.occupancy, AbstractOccupancy) else len(found)
    return replace(first, ranks=ranks, choice=choice)


def _of_rank(node: Node) -> LookUp | None:
    match node:
        case Arithmetic(
            ArithmeticOp.MUL,
            (DirectionAt(Constant(ElementAtPoint() as one), Feature(property="position") as place), Constant()),
        ):
            return LookUp(one.options, place.object, by_heading=one.by_heading)
        case _:
            return None


def is_along(heading: Node, region: Node, object: int, road: RoadDirection) -> bool:
    """Whether a heading is the direction where an object is of the very lane, or section of one, that a region is.

    Args:
        heading: The heading.
        region: The region.
        object: The object, by index.
        road: The map's direction of the road, which is that of no lane alone.
    """
    match heading, region:
        case (
            DirectionAt(field=Select() as fields, point=Feature(property="position") as place),
            Select() as areas,
        ) if fields.index is areas.index and place.object == object:
            pass
        case _:
            return False
    look_up = look_up_of(areas.index)
    if look_up is None:
        return False
    occupancy = look_up.occupancy
    if isinstance(occupancy, AbstractOccupancy):
        return occupancy.kind in _DIRECTED and _is_of_area(fields.options[0], areas.options[0], road)
    if not occupancy.is_of_lanes:
        return False
    # of what is no lane it is not known how far it leads from a heading
    pairs = list(zip(areas.options, fields.options, strict=True))[: occupancy.nothing]
    return all(_is_undefined(area) or _is_of_area(field, area, road) for area, field in pairs)


def _is_of_area(field: Node, area: Node, road: RoadDirection) -> bool:
    """Whether a direction is that of the one element whose area another one is."""
    match field, area:
        case Constant(value=direction), Constant(value=PolygonSet() as found) if direction is not road:
            return direction is found.orientation and (isinstance(found, AbstractArea) or len(found.ids) == 1)
        case _:
            return False


def _is_undefined(area: Node) -> bool:
    """Whether there is no such area."""
    return isinstance(area, Constant) and isinstance(area.value, Undefined)


@functools.lru_cache(maxsize=256)
def allowed_elements(root: Node) -> tuple[LookUp, frozenset[int]] | None:
    """The numbers of elements at one place for which a condition holds, if it asks for nothing else."""
    inner: dict[int, LookUp] = {}
    todo, seen = [root], set[int]()
    while todo:
        node = todo.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if (look_up := look_up_of(node)) is not None:
            inner[id(node)] = look_up
        elif isinstance(node, Feature) or is_leaf(node):
            return None
        else:
            todo += children(node)
    look_up = next(iter(inner.values()), None)
    if look_up is None or not all(each.is_same(look_up) for each in inner.values()):
        return None
    count = look_up.occupancy.nothing + 1
    numbers = Column(np.arange(count, dtype=np.float64), np.full(1, DEFINED))
    try:
        domain = ColumnDomain(_absent, _absent, first_direction)
        found = interpret(steps_of(root, known=inner), domain, dict.fromkeys(inner, numbers))[id(root)]
    except CannotEvaluate:
        return None
    if bool((found.status == UNKNOWN).any()):
        return None
    holds = np.broadcast_to(truth_of(found.data) & (found.status == DEFINED), count)
    return look_up, frozenset(np.flatnonzero(holds).tolist())


def _among(look_up: LookUp, required: Sequence[Node]) -> frozenset[int]:
    """The numbers of the elements that may be meant by a look-up where all of some conditions hold."""
    found = [each for each in map(allowed_elements, required) if each is not None and each[0].is_same(look_up)]
    return frozenset(range(look_up.occupancy.nothing + 1)).intersection(*(numbers for _, numbers in found))


def _absent(node: Node, *_: object) -> Column:
    raise CannotEvaluate(f"{type(node).__name__} is none of the element's")


def shared_look_ups(node: Node) -> tuple[LookUp, LookUp] | None:
    """The look-ups at the two places at which one element lies, if that is what a condition says."""
    if not isinstance(node, Compare) or node.op is not CompareOp.EQ:
        return None
    one, other = look_up_of(node.left), look_up_of(node.right)
    if one is None or other is None or one.object == other.object:
        return None
    alike = one.occupancy is other.occupancy or _are_of_one_kind(one.occupancy, other.occupancy)
    return (one, other) if alike else None


def _are_of_one_kind(one: Occupancy, other: Occupancy) -> bool:
    """Whether elements that two look-ups find over any map may be the same."""
    return isinstance(one, AbstractOccupancy) and isinstance(other, AbstractOccupancy) and one.kind == other.kind


@dataclass(frozen=True, slots=True)
class MeantElements:
    """Which elements may be meant where the ego is.

    Attributes:
        among: Their numbers; None where each condition has some of its own.
        most: Any of so many elements at the place may be meant, surely; 0 for what is possible.
        shared: Whether the same element is meant where another object is.
    """

    among: frozenset[int] | None
    most: int = 0
    shared: bool = False


@dataclass(slots=True)
class MapRelations:
    """The relations that a plan asks for: tables of frames and of regions that are meant there.

    Attributes:
        names: What the map's regions are called in `memberships`.
        ego: Index of the ego.
    """

    names: RegionNames
    ego: int
    _tables: dict[_Table, str] = field(default_factory=dict["_Table", str])
    _turned: bool = False

    @property
    def is_empty(self) -> bool:
        """Whether no condition asks for a table."""
        return not self._tables

    def queries(self, rows: str, maps: str, links: str) -> Iterator[tuple[str, str]]:
        """The tables that conditions ask for, each with its query.

        Args:
            rows: The table of memberships of the ego and whoever may play a role, with the numbers `f` of their frames.
            maps: SQL of the numbers `f` of frames with their `map`.
            links: The table of how the elements of these maps hang together.
        """
        if self._turned:
            directed = f"l.map = m.map AND l.region = a.region AND l.link = {sql_text(DIRECTS)}"
            # a lane that only touches a place may direct it, or not
            yield (
                _TURNED,
                f"SELECT a.f, a.object, l.target AS region, min(a.turn) AS turn FROM {rows} a "
                f"JOIN ({maps}) m USING (f) JOIN {links} l ON {directed} WHERE a.distance <= {number(SLACK)} "
                "GROUP BY ALL HAVING bool_and(a.distance = 0)",
            )
        for table, name in self._tables.items():
            own = "object <> 'ego'" if table.everybody else "object = 'ego'"
            at = f"SELECT f, object, kind, region, distance, turn FROM {rows} WHERE {own} AND {_AT}"
            if table.starts:
                starts = table.starts[:1] if table.most else table.starts
                found = [_led_to(each, table, at, maps, links) for each in starts]
                yield name, f"SELECT DISTINCT f, object, region FROM ({' UNION ALL '.join(found)})"
                continue
            first = f"region IN {among_names(table.first, self.names)}" if table.first else "true"
            pairs = ([pair[side] for pair in table.pairs] for side in (0, 1))
            relation = self.names.table("source, region", *pairs)
            meant = _meant(f"SELECT * FROM ({at}) WHERE {first}", table) if table.most else at
            yield (
                name,
                f"SELECT DISTINCT e.f, e.object, r.region FROM ({meant}) e JOIN {relation} r ON r.source = e.region",
            )

    def possible_elements(self, look_up: LookUp, required: Sequence[Node]) -> MeantElements:
        """Which elements a look-up may mean where all of some conditions hold."""
        return MeantElements(_among(look_up, required))

    def in_region(
        self, region: Select, look_up: LookUp, meant: MeantElements, reach: float, turn: float | None = None
    ) -> str | None:
        """A condition on memberships that an object meets which lies in a region that depends on where the ego is.

        Args:
            region: The region.
            look_up: That where the ego is, on which the region depends.
            meant: The elements that may be meant: the map may have no such region for others.
            reach: Metres that the object may be off; at most `MEMBERSHIP_RADIUS_M`.
            turn: How far the region, a lane, leads from the object's heading at most; None for any way.

        Returns:
            SQL over the columns of `memberships` and `q.f`; None if the region is not made of elements of the map.
        """
        regions = self._regions(region, look_up)
        if regions is None:
            return None
        among = range(look_up.occupancy.nothing) if meant.among is None else meant.among
        regions = {place: ids for place, ids in regions.items() if place in among}
        if not meant.most and look_up.occupancy.nothing in regions:
            return None
        first = region.options[0]
        if isinstance(first, Constant) and isinstance(first.value, AbstractArea):
            # what lies there may lead to the region
            look_up = replace(look_up, occupancy=first.value.found)
        table = self._table(look_up, regions, meant.most)
        if table is None:
            return None
        near = f"(q.f, region) IN (SELECT f, region FROM {table}) AND distance <= {number(reach + SLACK)}"
        if turn is None:
            return f"({near})"
        if isinstance(look_up.occupancy, AbstractOccupancy) and look_up.occupancy.kind in _OF_LANES:
            self._turned = True
            rows = f"SELECT f, object, region FROM {_TURNED} WHERE turn"
            if meant.most:
                return f"({near} AND (q.f, q.object, region) IN ({rows} <= {number(turn)}))"
            return f"({near} AND (q.f, q.object, region) NOT IN ({rows} > {number(turn)}))"
        # it is not known of those beside a lane; sections with lines of their own have directions of their own
        led = f"coalesce(section_turn, turn) <= {number(turn)}"
        led = led if meant.most else f"coalesce({led}, true)"
        return f"({near} AND {led})"

    def may_hold(self, look_up: LookUp, numbers: frozenset[int], required: Sequence[Node]) -> str | None:
        """A condition on memberships that a condition on what lies where an object is amounts to.

        Args:
            look_up: That where the object is.
            numbers: Those of the elements for which the condition holds.
            required: All that is required, the condition among it.

        Returns:
            SQL over the columns of the object's memberships; None where the condition may hold where nothing lies.
        """
        among = numbers & _among(look_up, required)
        if look_up.occupancy.nothing in among:
            return None
        if isinstance(look_up.occupancy, AbstractOccupancy):
            if not among:
                return "false"
            if look_up.occupancy.is_found_itself:
                return f"(kind = {sql_text(look_up.occupancy.kind)} AND {_AT})"
            table = self._table(look_up, {0: ("",)}, everybody=look_up.object != self.ego)
            return f"((q.f, q.object) IN (SELECT f, object FROM {table}))"
        sources = self._sources(look_up.occupancy)
        if sources is None:
            return None
        ids = sorted({each for layer in sources for each, place in layer if place in among})
        return f"(region IN {among_names(ids, self.names)} AND {_AT})"

    def surely_holds(self, look_up: LookUp, among: Collection[int], most: int) -> str | None:
        """A condition on memberships: that one of some elements lies where an object is, and may be the one meant."""
        if look_up.occupancy.nothing in among:
            return None
        if look_up.object != self.ego and not isinstance(look_up.occupancy, AbstractOccupancy):
            return None
        everybody = look_up.object != self.ego
        table = self._table(look_up, dict.fromkeys(among, ("",)), most, everybody=everybody)
        who = "(q.f, q.object) IN (SELECT f, object" if everybody else "q.f IN (SELECT f"
        return None if table is None else f"({who} FROM {table}))"

    def may_share(self, places: tuple[LookUp, LookUp], required: Sequence[Node]) -> str | None:
        """A condition on memberships of an object in whose place the element may lie that may lie where the ego is.

        Args:
            places: The look-ups at both places.
            required: All that is required: without more, nothing may lie at both.
        """
        found = [allowed_elements(each) for each in required]
        there = [look_up for look_up, numbers in filter(None, found) if look_up.occupancy.nothing not in numbers]
        if not self._is_of_ego(places) or not any(place.is_like(each) for place in places for each in there):
            return None
        if isinstance(places[0].occupancy, AbstractOccupancy):
            return self._both_lead_to_one(places, 0)
        table = self._table(places[0], self._themselves(places[0].occupancy))
        return None if table is None else f"((q.f, region) IN (SELECT f, region FROM {table}) AND {_AT})"

    def surely_share(self, places: tuple[LookUp, LookUp], among: Collection[int], most: int) -> str | None:
        """The same where one of some elements surely lies at both places, and any at either may be meant.

        Args:
            places: The look-ups at both places.
            among: The numbers of those that may be meant.
            most: Any of so many elements at a place may be meant.
        """
        if not self._is_of_ego(places):
            return None
        if isinstance(places[0].occupancy, AbstractOccupancy):
            return self._both_lead_to_one(places, most) if 0 in among else None
        own = {place: ids for place, ids in self._themselves(places[0].occupancy).items() if place in among}
        mine = next(each for each in places if each.object == self.ego)
        others = next(each for each in places if each is not mine)
        ego, anybody = self._table(mine, own, most), self._table(others, own, most, everybody=True)
        if ego is None or anybody is None:
            return None
        theirs = f"(q.f, q.object, region) IN (SELECT f, object, region FROM {anybody})"
        return f"({theirs} AND (q.f, region) IN (SELECT f, region FROM {ego}))"

    def _both_lead_to_one(self, places: tuple[LookUp, LookUp], most: int) -> str:
        """The same over any map: that elements at both places lead to one."""
        mine, others = sorted(places, key=lambda each: each.object != self.ego)
        ego, anybody = (self._table(each, {0: ("",)}, most, everybody=each is others) for each in (mine, others))
        same = f"{anybody} b JOIN {ego} e ON b.f = e.f AND b.region = e.region"
        return f"((q.f, q.object) IN (SELECT b.f, b.object FROM {same}))"

    def _is_of_ego(self, places: tuple[LookUp, LookUp]) -> bool:
        """Whether the ego is at one of two places, which are of two objects."""
        return self.ego in (places[0].object, places[1].object)

    def _themselves(self, occupancy: Occupancy) -> dict[int, Sequence[str]]:
        """Each element as the regions in which it is found."""
        found: dict[int, Sequence[str]] = {}
        for layer in self._sources(occupancy) or ():
            for each, place in layer:
                found[place] = (*found.get(place, ()), each)
        return found

    def of_ego(self, index: Node) -> LookUp | None:
        """The look-up where the ego is, whose number an expression is."""
        found = look_up_of(index)
        return found if found is not None and found.object == self.ego else None

    def _regions(self, region: Select, look_up: LookUp) -> dict[int, Sequence[str]] | None:
        """The regions of each element that a choice by its number has; None if some has no name."""
        meant: dict[int, Sequence[str]] = {}
        for place, option in enumerate(region.options):
            if not isinstance(option, Constant):
                return None
            if isinstance(option.value, AbstractArea):
                meant[place] = ("",)
            elif isinstance(option.value, Region):
                ids = region_ids(option.value, self.names)
                if ids is None:
                    return None
                meant[place] = ids
        return meant

    def _sources(self, occupancy: Occupancy) -> list[list[tuple[str, int]]] | None:
        """For each layer the regions in which elements are found, with their numbers; None where some has no name."""
        known = self.names.elements
        layers: list[list[tuple[str, int]]] = []
        for layer, ids in zip(occupancy.layers, occupancy.elements, strict=True):
            if not all(each in known for each in ids):
                return None
            pairs = ((known[each], place) for each, (_, place, _) in zip(ids, layer, strict=True))
            layers.append(list(dict.fromkeys(pairs)))
        return layers

    def _table(
        self, look_up: LookUp, meant: Mapping[int, Sequence[str]], most: int = 0, *, everybody: bool = False
    ) -> str | None:
        """The table of a relation: for each frame the regions that are meant where the ego is.

        Args:
            look_up: Gives the element.
            meant: The regions that are meant, by element.
            most: Any of so many elements at the place may be meant, surely; 0 for what is possible.
            everybody: Whether it is of where all others are, instead.
        """
        occupancy, by_heading = look_up.occupancy, bool(most) and look_up.by_heading
        if isinstance(occupancy, AbstractOccupancy):
            # what is meant is what it finds itself
            return self._named(_Table((), occupancy.starts if meant else (), (), most, everybody, by_heading))
        layers = self._sources(occupancy)
        if layers is None:
            return None
        # where an element of the first layer lies, no other layer counts
        sources = layers[0] if most else [each for layer in layers for each in layer]
        pairs = sorted({(source, each) for source, place in sources for each in meant.get(place, ())})
        if len(pairs) > LIMITS.related_regions:
            return None
        first = tuple(sorted({source for source, _ in layers[0]})) if most else ()
        return self._named(_Table(tuple(pairs), (), first, most, everybody, by_heading))

    def _named(self, table: _Table) -> str:
        return self._tables.setdefault(table, f"meant{len(self._tables)}")


@dataclass(frozen=True, slots=True)
class _Table:
    """A relation between elements where the ego is and regions.

    Attributes:
        pairs: The element, and a region that is meant.
        starts: Instead, over any map: the elements at a place that lead to what is meant.
        first: The elements of the first layer, of which that one must be; empty where any of them will do.
        most: How many of these may lie at the place; 0 for any number, of all layers.
        everybody: Whether it is of where all others than the ego are.
        by_heading: Whether the way that somebody goes says which of several is meant.
    """

    pairs: tuple[tuple[str, str], ...]
    starts: tuple[LinkedFrom, ...]
    first: tuple[str, ...]
    most: int
    everybody: bool
    by_heading: bool


def _meant(at: str, table: _Table) -> str:
    """SQL of the elements at a place of which any may be meant, surely.

    Args:
        at: SQL of the elements of the first layer at each place.
        table: The relation.
    """
    several = (
        f"SELECT *, count(*) OVER (PARTITION BY f, object) AS several FROM ({at}) "
        f"QUALIFY distance = 0 AND several <= {table.most}"
    )
    if not table.by_heading:
        return several
    return f"SELECT * FROM ({several}) WHERE several = 1 OR turn <= {number(ALONG - SLACK)}"


def _led_to(start: LinkedFrom, table: _Table, at: str, maps: str, links: str) -> str:
    """SQL of what elements at places lead to: their frame, object and region.

    Args:
        start: The elements, and what leads from them.
        table: The relation.
        at: SQL of all elements at each place.
        maps: As of `MapRelations.queries`.
        links: The same.
    """
    at = f"SELECT a.*, m.map FROM ({at}) a JOIN ({maps}) m USING (f)"
    if start.kind == "lane_section":
        # a lane that is not cut is one, too
        known = f"SELECT map, region FROM {links} WHERE link = {sql_text(IS_SECTION)}"
        at = f"SELECT * FROM ({at}) WHERE (map, region) IN ({known})"
    else:
        at = f"SELECT * FROM ({at}) WHERE kind = {sql_text(start.kind)}"
    joined, region, kind = "", "e.region", start.kind
    for step, (link, within) in enumerate(start.links):
        own = f"l{step}.kind = {sql_text(kind)} AND l{step}.link = {sql_text(link)}"
        if within is not None:
            own += f" AND l{step}.begins <= {number(within)}"
        joined += f" JOIN {links} l{step} ON l{step}.map = e.map AND l{step}.region = {region} AND {own}"
        region, kind = f"l{step}.target", led_kind(kind, link)
    return f"SELECT e.f, e.object, {region} AS region FROM ({_meant(at, table) if table.most else at}) e{joined}"
