"""The elements of the map as look-ups give them: which there are, where each counts, and which one lies at a place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, cast

from shapely.geometry import Polygon

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import ArithmeticOp, Constant, DirectionAt, Feature, Index, Node, Select
from scenicq.geometry import shapes
from scenicq.geometry.abstract_map import (
    AbstractElement,
    AbstractNetwork,
    AbstractOccupancy,
    LinkedFrom,
    LinkStep,
    NeedsMapError,
)
from scenicq.geometry.elements import Intersection, Lane, Maneuver, NetworkElement
from scenicq.geometry.network import Network
from scenicq.geometry.occupancy import TOLERANCE, ElementAtPoint, Layer, Occupancy
from scenicq.geometry.passing_lanes import areas_at, areas_everywhere
from scenicq.geometry.regions import PolygonSet
from scenicq.geometry.road_direction import RoadDirection
from scenicq.geometry.shapes import Shape

__all__ = ["LOOKUPS", "LaneRule", "LookupEntry", "LookupTable", "Lookups", "own", "ways_at", "ways_everywhere"]

LaneRule: TypeAlias = Literal["along", "any"]
"""Which of several lanes that contain an object are its own: those that lead its way, or all."""

LookupEntry: TypeAlias = tuple[NetworkElement, "NetworkElement | tuple[Maneuver, ...] | None", NetworkElement]
"""An element whose area counts, what is found there, and what it is found for: at a point once for each of these."""


def own(elements: Iterable[NetworkElement]) -> list[LookupEntry]:
    """Elements that are found in their own area."""
    return [(element, element, element) for element in elements]


def _lane_groups(network: Network) -> list[list[LookupEntry]]:
    return [[(lane, lane.group, lane) for lane in network.lanes], own(network.laneGroups)]


def _roads(network: Network) -> list[list[LookupEntry]]:
    return [[(lane, lane.road, lane) for lane in network.lanes], own(network.allRoads)]


def _lane_sections(network: Network) -> list[list[LookupEntry]]:
    """The sections of lanes, each with what of its lane lies within the tolerance of it and in none of them.

    Scenic looks for the lane first, which holds more points than its sections where cracks are between these.
    """
    found: list[LookupEntry] = []
    for lane in network.lanes:
        found += [(section, section, lane) for section in lane.sections]
        cracks = shapes.difference(lane.polygon, shapes.union_all([section.polygon for section in lane.sections]))
        for section in lane.sections if cracks.area > 0 else ():
            beside = shapes.intersection(cracks, shapes.band(section.polygon, TOLERANCE))
            parts = shapes.polygonal_part(beside)
            found += [(NetworkElement(section.id, cast(Polygon, part)), section, lane) for part in parts]
    return [found]


def _elements(network: Network) -> list[list[LookupEntry]]:
    return [own(kind) for kind in network.top_level]


def _directed(network: Network) -> list[list[LookupEntry]]:
    """What has directions of traffic; lanes too, where the map has no roads."""
    kinds: tuple[Sequence[NetworkElement], ...] = (network.intersections, network.roads, network.shoulders)
    return [own(kind) for kind in kinds] + ([] if network.roads else [own(network.lanes)])


def ways_at(intersection: Intersection, x: float, y: float) -> tuple[Maneuver, ...]:
    """The ways through an intersection that hold a point, else those within the map's tolerance, else the nearest."""
    ways, areas = _ways(intersection)
    return tuple(ways[number] for number in areas_at(areas, x, y))


def ways_everywhere(intersection: Intersection) -> list[list[LookupEntry]]:
    """Where which ways through an intersection are those of `ways_at`."""
    ways, areas = _ways(intersection)
    found: list[list[LookupEntry]] = []
    for layer in areas_everywhere(areas) if areas else []:
        parts = [(NetworkElement(intersection.id, cast(Polygon, part)), held) for part, held in layer]
        found.append([(part, tuple(ways[number] for number in held), part) for part, held in parts])
    return found


def _ways(intersection: Intersection) -> tuple[list[Maneuver], list[Shape]]:
    """The ways through an intersection that have a lane there, and the areas of these."""
    ways = [way for way in intersection.maneuvers if way.connectingLane is not None]
    return ways, [way.connectingLane.polygon for way in ways if way.connectingLane is not None]


LOOKUPS: dict[str, tuple[str, Callable[[Network], list[list[LookupEntry]]]]] = {
    "laneAt": ("lane", lambda network: [own(network.lanes)]),
    "laneSectionAt": ("lane", _lane_sections),
    "laneGroupAt": ("lane", _lane_groups),
    "roadAt": ("lane", _roads),
    "intersectionAt": ("intersection", lambda network: [own(network.intersections)]),
    "crossingAt": ("crossing", lambda network: [own(network.crossings)]),
    "sidewalkAt": ("sidewalk", lambda network: [own(network.sidewalks)]),
    "shoulderAt": ("shoulder", lambda network: [own(network.shoulders)]),
    "elementAt": ("element", _elements),
    "nominalDirectionsAt": ("element", _directed),
}
"""The look-ups of the network: which ranks they share, and the elements in the order in which they count."""


_FOUND_IN: dict[str, tuple[str, tuple[LinkedFrom, ...]]] = {
    "laneAt": ("lane", (LinkedFrom("lane"),)),
    "laneSectionAt": ("lane_section", (LinkedFrom("lane_section"),)),
    "laneGroupAt": ("lane_group", (LinkedFrom("lane", (LinkStep("group"),)), LinkedFrom("lane_group"))),
    "roadAt": ("road", (LinkedFrom("lane", (LinkStep("road"),)), LinkedFrom("road"))),
    "intersectionAt": ("intersection", (LinkedFrom("intersection"),)),
    "crossingAt": ("crossing", (LinkedFrom("crossing"),)),
    "sidewalkAt": ("sidewalk", (LinkedFrom("sidewalk"),)),
    "shoulderAt": ("shoulder", (LinkedFrom("shoulder"),)),
}
"""The look-ups of elements of one kind: the kind, and the elements at a place that lead to them, as in `LOOKUPS`."""


class LookupTable:
    """The elements that one look-up may give, and where each lies.

    Attributes:
        family: Which look-ups share ranks with it.
        options: The elements.
        occupancy: Where they lie.
    """

    def __init__(
        self, family: str, options: tuple[NetworkElement | tuple[Maneuver, ...], ...], occupancy: Occupancy
    ) -> None:
        """Take them."""
        self.family, self.options, self.occupancy = family, options, occupancy

    @classmethod
    def of_network(cls, network: Network, name: str) -> LookupTable:
        """That of one of the `LOOKUPS`, which over an abstract map has an element that stands for all.

        Args:
            network: The map.
            name: The look-up.
        """
        family, layers = LOOKUPS[name]
        called = f"network.{name}"
        if not isinstance(network, AbstractNetwork):
            return cls.of_layers(called, family, layers(network))
        if name not in _FOUND_IN:
            raise NeedsMapError
        kind, starts = _FOUND_IN[name]
        return cls.of_any(AbstractOccupancy(called, kind, starts), family, network)

    @classmethod
    def of_any(cls, found: AbstractOccupancy, family: str, network: Network) -> LookupTable:
        """That of one element that stands for all.

        Args:
            found: Where it lies.
            family: Which look-ups share ranks with it.
            network: The abstract map.
        """
        # each place has one of its own; a lane that is not cut is its own section
        there = ("lane" if found.kind == "lane_section" else found.kind) in network.kinds
        return cls(family, (AbstractElement(found),) if there else (), found)

    @classmethod
    def of_layers(cls, name: str, family: str, layers: list[list[LookupEntry]]) -> LookupTable:
        """That of some elements.

        Args:
            name: What messages call it.
            family: Which look-ups share ranks with it.
            layers: The elements in the order in which they count.
        """
        found = (element for layer in layers for _, element, _ in layer if element is not None)
        options: tuple[NetworkElement | tuple[Maneuver, ...], ...] = tuple(dict.fromkeys(found))
        numbers = {element: number for number, element in enumerate(options)}
        nothing = len(options)

        places: list[Layer] = []
        ids: list[tuple[str, ...]] = []
        ways: list[tuple[RoadDirection | None, ...]] = []
        continued: list[tuple[frozenset[int], ...]] = []
        names: list[tuple[str, ...]] = []
        for layer in layers:
            owners = {owner: number for number, owner in enumerate(dict.fromkeys(owner for _, _, owner in layer))}
            parts = [(part, *entry) for entry in layer for part in shapes.simple_parts([entry[0].polygon])]
            ids.append(tuple(area.id for _, area, _, _ in parts))
            ways.append(tuple(each.orientation if isinstance(each, Lane) else None for each in owners))
            continued.append(tuple(each.continued if isinstance(each, Lane) else frozenset() for each in owners))
            names.append(tuple(owner.id for owner in owners))
            places.append(
                tuple(
                    (part, nothing if element is None else numbers[element], owners[owner])
                    for part, _, element, owner in parts
                )
            )
        occupancy = Occupancy(tuple(places), nothing, name, tuple(ids), tuple(ways), tuple(continued), tuple(names))
        return cls(family, options, occupancy)


@dataclass(frozen=True, slots=True, eq=False)
class AbstractLookup:
    """A look-up at a random place over an abstract map.

    Attributes:
        element: What stands for any element there.
        key: What identifies the look-up.
        table: Its elements.
        place: The place.
        going: Which way goes who is there, where that matters.
    """

    element: AbstractElement
    key: object
    table: LookupTable
    place: Node
    going: tuple[Node, ...]


class Lookups:
    """The look-ups of one run of a program: the same one at the same place is the same choice.

    Attributes:
        tables: By what identifies a look-up.
        indices: Which option lies at a place, by look-up and place; places are kept so that they stay what they are.
        ranks: Which of several elements that overlap, by family and place.
        known: Properties of objects, by index and name: their values, or None for those that are random.
        courses: Where a driver who keeps to a lane comes to, by the lane and whether it is driven against its way.
        abstract: Look-ups over an abstract map, by the identity of the index.
    """

    def __init__(self) -> None:
        """Start with none."""
        self.tables: dict[object, LookupTable] = {}
        self.indices: dict[tuple[object, object], Node] = {}
        self.ranks: dict[tuple[object, ...], Index] = {}
        self.known: dict[tuple[int, str], Constant | None] = {}
        self.courses: dict[tuple[Lane, bool], PolygonSet] = {}
        self.abstract: dict[int, AbstractLookup] = {}
        self._kept: list[Node] = []

    def table(self, key: object, make: Callable[[], LookupTable]) -> LookupTable:
        """The table of a look-up, made once."""
        if key not in self.tables:
            self.tables[key] = make()
        return self.tables[key]

    def index(self, key: object, table: LookupTable, place: Node, going: tuple[Node, ...], span: Span) -> Node:
        """Which option lies at a random place; of several one that leads the way somebody goes, if that is given."""
        where = (place.object, place.property, place.current) if isinstance(place, Feature) else id(place)
        whose = (key, bool(going)), where
        if whose not in self.indices:
            self._kept.append(place)
            index = self.indices[whose] = self._make_index(table, place, going, where, span)
            if isinstance(table.occupancy, AbstractOccupancy):
                self.abstract[id(index)] = AbstractLookup(AbstractElement(table.occupancy), key, table, place, going)
        return self.indices[whose]

    def options(self, table: LookupTable, index: Node) -> tuple[NetworkElement | tuple[Maneuver, ...], ...]:
        """What may lie at a place.

        Args:
            table: The options.
            index: Which of them lies there.
        """
        known = self.abstract.get(id(index))
        return table.options if known is None else (known.element,)

    def numbers(
        self, table: LookupTable, place: Node, span: Span, count: int | None = None, going: tuple[Node, ...] = ()
    ) -> tuple[Node, ...]:
        """The numbers of the options at a place, by rank: all, or so many of them; after the last the first again.

        Args:
            table: The options.
            place: The place.
            span: Where they are asked for.
            count: How many.
            going: Which way goes who is there and the last lane of its track, where that matters.
        """
        options = table.occupancy
        scale = build.constant(float(options.scale), span)

        def number(rank: int) -> Node:
            ranked = ElementAtPoint(options, rank, by_heading=bool(going))
            angle = DirectionAt(build.constant(ranked, span), place, going, span=span)
            return build.arithmetic(ArithmeticOp.MUL, angle, scale, span=span)

        return tuple(map(number, range(options.depth if count is None else count)))

    def _make_index(self, table: LookupTable, place: Node, going: tuple[Node, ...], where: object, span: Span) -> Node:
        depth = table.occupancy.depth
        if depth == 1:
            return self.numbers(table, place, span)[0]
        rank = self.ranks.setdefault((table.family, where), Index((1.0,) * depth, span=span))
        if len(rank.weights) < depth:
            # more overlap here than the ranks of the family tell apart
            wide = (table.family, where, depth)
            rank = self.ranks.setdefault(wide, Index((1.0,) * depth, span=span))
        return Select(rank, self.numbers(table, place, span, len(rank.weights), going), span=span)
