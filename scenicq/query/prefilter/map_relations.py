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
)
from scenicq.forest.walk import children, is_leaf
from scenicq.geometry.abstract_map import AbstractArea, AbstractOccupancy
from scenicq.geometry.angles import ALONG
from scenicq.geometry.occupancy import TOLERANCE, ElementAtPoint, Occupancy
from scenicq.geometry.regions import PolygonSet, Region
from scenicq.limits import LIMITS
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.regions import RegionNames, among_names, region_ids
from scenicq.query.prefilter.sql_ends import number
from scenicq.store.sql import sql_text

__all__ = ["LookUp", "MapRelations", "MeantElements", "allowed_elements", "is_along", "look_up_of", "shared_look_ups"]

_AT = f"distance <= {number(TOLERANCE + SLACK)}"
"""An element that may be found at a place."""
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


def is_along(heading: Node, region: Node, object: int) -> bool:
    """Whether a heading is the direction where an object is of the very lane that a region is.

    Args:
        heading: The heading.
        region: The region.
        object: The object, by index.
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
        return occupancy.is_of_lanes
    if not occupancy.is_of_lanes:
        return False
    layer, *others = occupancy.layers
    if others:
        return False
    return all(
        isinstance(area, Constant)
        and isinstance(field, Constant)
        and isinstance(area.value, PolygonSet)
        and area.value.orientation is field.value is occupancy.ways[0][owner]
        for _, number, owner in layer
        for area, field in ((areas.options[number], fields.options[number]),)
    )


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
        found = interpret(steps_of(root, known=inner), _TABULATED, dict.fromkeys(inner, numbers))[id(root)]
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


_TABULATED = ColumnDomain(_absent, _absent, first_direction)
"""What conditions are for each element, where they hang on nothing else."""


def shared_look_ups(node: Node) -> tuple[LookUp, LookUp] | None:
    """The look-ups at the two places at which one element lies, if that is what a condition says."""
    if not isinstance(node, Compare) or node.op is not CompareOp.EQ:
        return None
    one, other = look_up_of(node.left), look_up_of(node.right)
    if one is None or other is None or one.occupancy is not other.occupancy or one.object == other.object:
        return None
    return one, other


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

    @property
    def is_empty(self) -> bool:
        """Whether no condition asks for a table."""
        return not self._tables

    def queries(self, rows: str) -> Iterator[tuple[str, str]]:
        """The tables that conditions ask for, each with its query.

        Args:
            rows: The table of memberships of the ego and whoever may play a role, with the numbers `f` of their frames.
        """
        for table, name in self._tables.items():
            own = "object <> 'ego'" if table.everybody else "object = 'ego'"
            kind = f" AND kind = {sql_text(table.kind)}" if table.kind else ""
            at = f"SELECT f, object, region, distance, turn FROM {rows} WHERE {own} AND {_AT}{kind}"
            if table.most:
                first = f" WHERE region IN {among_names(table.first, self.names)}" if table.first else ""
                at = (
                    f"SELECT *, count(*) OVER (PARTITION BY f, object) AS several FROM ({at}){first} "
                    f"QUALIFY distance = 0 AND several <= {table.most}"
                )
            if table.by_heading:
                at = f"SELECT * FROM ({at}) WHERE several = 1 OR turn <= {number(ALONG - SLACK)}"
            meant, joined = "region", ""
            if not table.kind:
                pairs = ([pair[side] for pair in table.pairs] for side in (0, 1))
                relation = self.names.table("source, region", *pairs)
                meant, joined = "r.region", f" JOIN {relation} r ON r.source = e.region"
            yield name, f"SELECT DISTINCT e.f, e.object, {meant} AS region FROM ({at}) e{joined}"

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
        regions = self._regions(region)
        if regions is None:
            return None
        among = range(look_up.occupancy.nothing) if meant.among is None else meant.among
        regions = {place: ids for place, ids in regions.items() if place in among}
        if not meant.most and look_up.occupancy.nothing in regions:
            return None
        table = self._table(look_up, regions, meant.most)
        if table is None:
            return None
        near = f"(q.f, region) IN (SELECT f, region FROM {table}) AND distance <= {number(reach + SLACK)}"
        if turn is None:
            return f"({near})"
        # it is not known of those beside a lane
        led = f"turn <= {number(turn)}" if meant.most else f"coalesce(turn <= {number(turn)}, true)"
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
            return f"(kind = {sql_text(look_up.occupancy.kind)} AND {_AT})" if among else "false"
        sources = self._sources(look_up.occupancy)
        if sources is None:
            return None
        ids = sorted({each for layer in sources for each, place in layer if place in among})
        return f"(region IN {among_names(ids, self.names)} AND {_AT})"

    def surely_holds(self, look_up: LookUp, among: Collection[int], most: int) -> str | None:
        """A condition on frames: that one of some elements lies where the ego is, and may be the one that is meant."""
        if look_up.occupancy.nothing in among:
            return None
        table = self._table(look_up, dict.fromkeys(among, ("",)), most)
        return None if table is None else f"(q.f IN (SELECT f FROM {table}))"

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
        own = {place: ids for place, ids in self._themselves(places[0].occupancy).items() if place in among}
        mine = next(each for each in places if each.object == self.ego)
        others = next(each for each in places if each is not mine)
        ego, anybody = self._table(mine, own, most), self._table(others, own, most, everybody=True)
        if ego is None or anybody is None:
            return None
        theirs = f"(q.f, q.object, region) IN (SELECT f, object, region FROM {anybody})"
        return f"({theirs} AND (q.f, region) IN (SELECT f, region FROM {ego}))"

    def _is_of_ego(self, places: tuple[LookUp, LookUp]) -> bool:
        """Whether the ego is at one of two places, which are of two objects."""
        return self.ego in (places[0].object, places[1].object)

    def _themselves(self, occupancy: Occupancy) -> dict[int, Sequence[str]]:
        """Each element as the regions in which it is found."""
        if isinstance(occupancy, AbstractOccupancy):
            return {0: (occupancy.kind,)}
        found: dict[int, Sequence[str]] = {}
        for layer in self._sources(occupancy) or ():
            for each, place in layer:
                found[place] = (*found.get(place, ()), each)
        return found

    def of_ego(self, index: Node) -> LookUp | None:
        """The look-up where the ego is, whose number an expression is."""
        found = look_up_of(index)
        return found if found is not None and found.object == self.ego else None

    def _regions(self, region: Select) -> dict[int, Sequence[str]] | None:
        """The regions of each element that a choice by its number has; None if some has no name."""
        meant: dict[int, Sequence[str]] = {}
        for place, option in enumerate(region.options):
            if not isinstance(option, Constant):
                return None
            if isinstance(option.value, AbstractArea):
                meant[place] = (option.value.kind,)
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
            # what is meant is the element itself
            return self._named(_Table((), occupancy.kind if meant else "", (), most, everybody, by_heading))
        layers = self._sources(occupancy)
        if layers is None:
            return None
        # where an element of the first layer lies, no other layer counts
        sources = layers[0] if most else [each for layer in layers for each in layer]
        pairs = sorted({(source, each) for source, place in sources for each in meant.get(place, ())})
        if len(pairs) > LIMITS.related_regions:
            return None
        first = tuple(sorted({source for source, _ in layers[0]})) if most else ()
        return self._named(_Table(tuple(pairs), "", first, most, everybody, by_heading))

    def _named(self, table: _Table) -> str:
        return self._tables.setdefault(table, f"meant{len(self._tables)}")


@dataclass(frozen=True, slots=True)
class _Table:
    """A relation between elements where the ego is and regions.

    Attributes:
        pairs: The element, and a region that is meant.
        kind: Instead: the kind of elements of which each means itself.
        first: The elements of the first layer, of which that one must be; empty where any of them will do.
        most: How many of these may lie at the place; 0 for any number, of all layers.
        everybody: Whether it is of where all others than the ego are.
        by_heading: Whether the way that somebody goes says which of several is meant.
    """

    pairs: tuple[tuple[str, str], ...]
    kind: str
    first: tuple[str, ...]
    most: int
    everybody: bool
    by_heading: bool
