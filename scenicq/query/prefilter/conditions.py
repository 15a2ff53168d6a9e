"""Necessary conditions: what must hold of a frame's columns for the frame to match.

Taken from the forest by interval analysis. Each condition has a name, the place in the program it comes from, and holds
for every label that matches (the tests compare with and without them). It is about the ego alone, about one object and
the ego, or about two objects.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from scenicq.errors import Span
from scenicq.forest.ego_frame import DISTANCE, PLACE, in_ego_frame
from scenicq.forest.interval_values import Interval
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    Contains,
    DirectionAt,
    DiscAt,
    Encloses,
    Feature,
    Node,
    PointIn,
    RectangleAt,
    RegionIntersection,
    Rotate,
    SectorAt,
    Select,
    VectorSum,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import conjuncts, features
from scenicq.geometry.network import Network
from scenicq.geometry.regions import IntersectionOf, Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import SLACK, Tolerance
from scenicq.query.prefilter.map_relations import MapRelations, shared_look_ups
from scenicq.query.prefilter.regions import RegionNames, near_region, nearest_box
from scenicq.query.prefilter.sql_bounds import ARITHMETIC, SqlBounds
from scenicq.query.prefilter.sql_ends import SQL, Expr, all_of, any_of, between, less, modulo_turn, number
from scenicq.store.schema import MEMBERSHIP_RADIUS_M

__all__ = [
    "EGO",
    "ConditionReader",
    "NecessaryCondition",
    "conditions",
    "difference",
    "object_columns",
    "turned_within",
]

EGO = "ego"
"""Alias of the frame's row; the objects of a condition are called `a` and, if there are two, `b`."""

_NUMBERS = ("heading", "width", "length", "height")


@dataclass(frozen=True, slots=True)
class NecessaryCondition:
    """A necessary condition.

    Attributes:
        what: The feature or requirement, in the words of the program.
        objects: The objects it is about but the ego, ascending: none, one (`a`) or two (`a` and `b`).
        sql: Over the columns of `ego`, `a` and `b`; true where the label does not tell. Empty for one on memberships.
        span: Where the program says it.
        region: For a condition on memberships: SQL that holds of some row of the object's (or the ego's).
    """

    what: str
    objects: tuple[int, ...]
    sql: str
    span: Span | None
    region: str = ""


def object_columns(alias: str, prefix: str = "") -> dict[str, str | tuple[str, str]]:
    """The properties that have columns, with them.

    Args:
        alias: Of the table.
        prefix: Of the columns: those of the ego's begin with `ego_`.
    """
    start = f"{alias}.{prefix}"
    found: dict[str, str | tuple[str, str]] = {name: f"{start}{name}" for name in _NUMBERS}
    found["position"] = (f"{start}x", f"{start}y")
    vx, vy = f"{start}motion_vx", f"{start}motion_vy"
    found["velocity"] = (vx, vy)
    found["speed"] = f"sqrt({vx} * {vx} + {vy} * {vy})"
    found["acceleration"], found["angularSpeed"] = f"{start}acceleration", f"{start}yaw_rate"
    if not prefix:
        found[PLACE], found[DISTANCE] = (f"{start}ego_right", f"{start}ego_ahead"), f"{start}ego_distance"
    return found


@dataclass(slots=True)
class ConditionReader:
    """Reads conditions off one scenario; `of` gives bounds over the columns of some objects."""

    scenario: Scenario
    tolerance: Tolerance
    names: RegionNames
    relations: MapRelations
    road: RoadDirection
    required: tuple[Node, ...] = field(init=False)
    bounds: dict[tuple[int, ...], SqlBounds] = field(default_factory=dict["tuple[int, ...]", "SqlBounds"])

    def __post_init__(self) -> None:
        """Take apart what is required."""
        said = [each.condition for each in self.scenario.requirements if each.built_in is None]
        self.required = tuple(part for each in said for part in conjuncts(each))

    def of(self, objects: tuple[int, ...]) -> SqlBounds:
        """SqlBounds over the columns of some objects and the ego's."""
        if objects not in self.bounds:
            aliases = {self.scenario.ego: (EGO, "ego_")} | dict(zip(objects, (("a", ""), ("b", "")), strict=False))
            columns = {
                (index, name): column
                for index, (alias, prefix) in aliases.items()
                for name, column in object_columns(alias, prefix).items()
            }
            self.bounds[objects] = SqlBounds(columns, self._nearest)
        return self.bounds[objects]

    def _nearest(self, region: Region, x: str, y: str) -> str | None:
        """How near a region may be to the ego: objects are too many to look at each box for each of them."""
        return nearest_box(region, self.names, x, y) if (x, y) == (f"{EGO}.ego_x", f"{EGO}.ego_y") else None

    def involved(self, *roots: Node, about: int | None = None) -> tuple[int, ...]:
        """The objects that expressions are about, the ego left out."""
        found = {index for index, _ in features(*roots)}
        if about is not None:
            found.add(about)
        return tuple(sorted(found - {self.scenario.ego}))

    # --- comparisons

    def comparison(self, index: int, name: str, node: Node) -> Iterator[tuple[tuple[int, ...], str, str]]:
        """Objects, SQL and membership condition that a feature's expression implies."""
        objects = self.involved(node, about=index)
        if len(objects) > 2:
            objects = (index,)
        bounds = self.of(objects)
        own = bounds.columns.get((index, name))
        if name == "position":
            yield from self._position(index, node, objects, bounds)
        elif name == "heading":
            yield objects, self._heading(index, node, bounds), ""
        elif isinstance(own, str):
            size = self.tolerance.of(index, name).size
            allowed = [between(own, limits, size) for limits in bounds.intervals(node)]
            yield objects, _sql(any_of(allowed)), ""

    def _position(
        self, index: int, node: Node, objects: tuple[int, ...], bounds: SqlBounds
    ) -> Iterator[tuple[tuple[int, ...], str, str]]:
        reach = self.tolerance.of(index, "position").reach
        own = bounds.columns[index, "position"]
        if isinstance(node, PointIn):
            # Memberships are recorded up to a distance: a wider tolerance cannot be prefiltered by them.
            names = self.names if reach <= MEMBERSHIP_RADIUS_M - SLACK else None
            place = (own[0], own[1])
            for near, sql in self._inside(node.region, place, bounds, names, reach):
                yield (() if index == self.scenario.ego else (index,)) if near else objects, sql, near
            return
        x, y = (own[0], own[1])
        place, rest, moved = self.framed((x, y), node, bounds)
        if not moved:
            return
        allowed = [all_of([between(place[0], a, reach), between(place[1], b, reach)]) for a, b in bounds.boxes(rest)]
        yield objects, _sql(any_of(allowed)), ""

    def framed(self, place: tuple[Expr, Expr], node: Node, bounds: SqlBounds) -> tuple[tuple[Expr, Expr], Node, bool]:
        """A place seen in the frames that an expression goes through, and what is left of the expression."""
        moved = False
        while True:
            if self._from_ego(node, place):
                assert isinstance(node, VectorSum)
                assert isinstance(node.right, Rotate)
                alias = str(place[0]).removesuffix(".x")
                place, node, moved = (f"{alias}.ego_right", f"{alias}.ego_ahead"), node.right.vector, True
            elif isinstance(node, VectorSum):
                sides = ((node.left, node.right), (node.right, node.left))
                for part, rest in sides:
                    if known := bounds.exact_vector(part):
                        shifted = [difference(p, q) for p, q in zip(place, known, strict=True)]
                        place, node, moved = (shifted[0], shifted[1]), rest, True
                        break
                else:
                    return place, node, moved
            elif isinstance(node, Rotate) and (angle := bounds.exact(node.angle)) is not None:
                vector = ARITHMETIC.vector(*map(SQL.known, place))
                x, y = ARITHMETIC.rotate(vector, SQL.known(SQL.negative(angle)))
                place, node, moved = (x.low, y.low), node.vector, True
            else:
                return place, node, moved

    def _from_ego(self, node: Node, place: tuple[Expr, Expr]) -> bool:
        """Whether an expression is an offset in the ego's frame: each object's place in it is a column."""
        return (
            isinstance(node, VectorSum)
            and isinstance(node.right, Rotate)
            and self.is_ego(node.left, "position")
            and self.is_ego(node.right.angle, "heading")
            and place in (("a.x", "a.y"), ("b.x", "b.y"))
        )

    def is_ego(self, node: Node, name: str) -> bool:
        """Whether an expression is a property of the ego."""
        return isinstance(node, Feature) and (node.object, node.property) == (self.scenario.ego, name)

    def _inside(
        self, region: Node, place: tuple[str, str], bounds: SqlBounds, names: RegionNames | None, reach: float
    ) -> Iterator[tuple[str, str]]:
        """Conditions on memberships, or SQL, that a place in a region meets to within metres."""
        todo = [region]
        while todo:
            match todo.pop():
                case Constant(value=known) if isinstance(known, Region):
                    parts = known.parts if isinstance(known, IntersectionOf) else (known,)
                    for part in parts:
                        near = None if names is None else near_region(part, names, reach)
                        if near is not None:
                            yield near, ""
                case RegionIntersection(parts=parts):
                    todo += reversed(parts)
                case Select() as looked_up if names is not None:
                    near = self.relations.may_be_in(looked_up, reach, self.required)
                    if near is not None:
                        yield near, ""
                case DiscAt() | SectorAt() as seen:
                    yield "", _sql(self._in_view(seen, place, bounds, reach))
                case _:
                    pass

    def _in_view(
        self, region: DiscAt | SectorAt, place: tuple[str, str], bounds: SqlBounds, reach: float
    ) -> str | bool:
        center = bounds.exact_vector(region.center)
        if center is None:
            return True
        from_ego = self.is_ego(region.center, "position") and place == ("a.x", "a.y")
        dx, dy = (difference(p, q) for p, q in zip(place, center, strict=True))
        away = "a.ego_distance" if from_ego else f"sqrt({number(dx)} * {number(dx)} + {number(dy)} * {number(dy)})"
        near = any_of([less(away, SQL.plus(each.high, reach)) for each in bounds.intervals(region.radius)])
        if not isinstance(region, SectorAt) or not isinstance(region.angle, Constant):
            return near
        half = float(region.angle.value) / 2 if isinstance(region.angle.value, float) else math.pi
        if not (from_ego and self.is_ego(region.heading, "heading") and 0 <= half <= math.pi / 2):
            return near
        # a wedge of at most half a turn lies on one side of each of its edges
        aside = f"abs(a.ego_right) * {number(math.cos(half))} - a.ego_ahead * {number(math.sin(half))}"
        return all_of([near, less(f"({aside})", reach)])

    def _heading(self, index: int, node: Node, bounds: SqlBounds) -> str:
        own, terms, along = self.heading_terms(index, node, bounds)
        alternatives = [SQL.known(0.0)]
        for term in terms:
            alternatives = [ARITHMETIC.add(total, more) for total in alternatives for more in bounds.intervals(term)]
        each = turned_within(own, alternatives, self.tolerance.of(index, "heading").size + SLACK, along)
        return f"({own} IS NULL OR {self.off_lanes(along)}{each})" if each and along else each

    def off_lanes(self, directions: str) -> str:
        """That a place is off all lanes, with `OR`, where the columns of directions know less there than the map."""
        return f"{directions.removesuffix('road_directions')}lane IS NULL OR " if self.road.beside else ""

    def heading_terms(self, index: int, node: Node, bounds: SqlBounds) -> tuple[str, Sequence[Node], str]:
        """A heading's column, the terms that it is the sum of, and the column of directions that one of them is.

        That one is left out of the terms, as is the ego's heading: the column is then what is left of the heading.
        """
        own = bounds.columns[index, "heading"]
        assert isinstance(own, str)
        alias = own.removesuffix("heading")
        rest: list[Node] = _summands(node)
        fields = [term for term in rest if isinstance(term, DirectionAt)]
        along = len(fields) == 1 and self.own_direction(fields[0], index)
        if along:
            rest = [term for term in rest if not isinstance(term, DirectionAt)]
        relative = next((term for term in rest if self.is_ego(term, "heading")), None)
        if relative is not None and index != self.scenario.ego:
            own, rest = f"{alias}relative_heading", [term for term in rest if term is not relative]
        return own, rest, f"{alias}road_directions" if along else ""

    def own_direction(self, node: DirectionAt, index: int) -> bool:
        """Whether an expression is the direction of the road where an object is."""
        field_, point = node.field, node.point
        return (
            isinstance(point, Feature)
            and (point.object, point.property) == (index, "position")
            and isinstance(field_, Constant)
            and field_.value is self.road
        )

    # --- requirements

    def requirement(self, root: Node) -> Iterator[tuple[tuple[int, ...], str, str]]:
        """The same for a requirement."""
        for part in conjuncts(in_ego_frame(root, self.scenario.ego)):
            objects = self.involved(part)
            if (looked_up := self.relations.may_hold(part, self.required)) is not None:
                yield objects, "", looked_up[1]
                continue
            if (places := shared_look_ups(part)) is not None and len(objects) == 1:
                shared = self.relations.may_share(places, self.required)
                if shared is not None:
                    yield objects, "", shared
                    continue
            if len(objects) > 2:
                continue
            if (held := _held(part)) is not None:
                region, place = held
                own = self.of((place.object,)).columns[place.object, "position"]
                for near, sql in self._inside(region, (own[0], own[1]), self.of(objects), self.names, 0.0):
                    yield (() if place.object == self.scenario.ego else (place.object,)) if near else objects, sql, near
                continue
            yield objects, _sql(self.of(objects).can_hold(part)), ""


def _held(condition: Node) -> tuple[Node, Feature] | None:
    """A region, and the place of an object that lies in it where a condition holds: a box has its centre inside."""
    match condition:
        case (
            Contains(region=region, point=Feature(property="position") as place)
            | Encloses(outer=region, inner=RectangleAt(center=Feature(property="position") as place))
        ):
            return region, place
        case _:
            return None


def difference(a: Expr, b: Expr) -> Expr:
    """A number less another."""
    return SQL.plus(a, SQL.negative(b))


def _sql(condition: str | bool) -> str:
    """SQL of a condition, empty if it always holds."""
    return condition if isinstance(condition, str) else "" if condition else "false"


def turned_within(own: str, alternatives: Sequence[Interval[Expr]], width: float, directions: str = "") -> str:
    """Whether an angle lies in an interval, or within a width of it; with slack.

    Args:
        own: The angle.
        alternatives: The intervals, of which one does.
        width: In radians.
        directions: A list of angles, of which one is added to the intervals.

    Returns:
        SQL, empty where every angle does.
    """
    spans: list[tuple[Expr, Expr]] = []
    for low, high, _ in alternatives:
        span = difference(high, low)
        if (isinstance(span, float) and span + 2 * width >= math.tau) or math.inf in (high, span):
            return ""
        spans.append((SQL.plus(low, -width), SQL.plus(span, 2 * width)))

    def holds(turned: str) -> str:
        # from where each span starts
        angles = [(modulo_turn(number(difference(turned, start))), span) for start, span in spans]
        return _sql(any_of([less(angle, span) for angle, span in angles]))

    if not directions:
        return holds(own)
    one, each = holds(f"{own} - {directions}[1]"), holds(f"{own} - d")
    if not each:
        return ""
    # most places have one direction, for which arithmetic takes a fraction of what a function of lists does
    return f"CASE WHEN len({directions}) = 1 THEN {one} ELSE len(list_filter({directions}, lambda d: {each})) > 0 END"


def _summands(node: Node) -> list[Node]:
    """The terms of a sum; the sum itself if it has very many: terms that are shared count again and again."""
    found: list[Node] = []
    stack = [node]
    while stack:
        if len(stack) + len(found) > LIMITS.heading_terms:
            return [node]
        part = stack.pop()
        if isinstance(part, Arithmetic) and part.op is ArithmeticOp.ADD:
            stack.extend(part.args)
        else:
            found.append(part)
    return found


def conditions(
    scenario: Scenario, network: Network, options: MatchOptions, relations: MapRelations
) -> Iterator[NecessaryCondition]:
    """The necessary conditions of a scenario whose ego is the label's own, in the order of the program.

    Args:
        scenario: The scenario.
        network: The map it was compiled for.
        options: Tolerances.
        relations: Those of the map, which gets the tables that conditions ask for.
    """
    if any(owner.mutated for owner in scenario.objects):
        return  # noise of any size hides where things are
    tolerance = options.tolerance.for_scenario(scenario)
    reader = ConditionReader(scenario, tolerance, relations.names, relations, network.roadDirection)
    for owner in scenario.objects:
        named: Mapping[str, Node] = {name: given.value for name, given in owner.properties.items()}
        compared = [name for name in ("position", "heading") if name in named]
        compared += [name for name in named if owner.properties[name].explicit and name not in compared]
        for name in compared:
            what, span = f"{owner.name}.{name}", owner.properties[name].span
            for objects, sql, region in reader.comparison(owner.index, name, named[name]):
                if sql or region:
                    yield NecessaryCondition(what, objects, sql, span, region)
    for requirement in scenario.requirements:
        if requirement.built_in is not None or requirement.span is None:
            continue
        what = " ".join(requirement.span.text.split())
        for objects, sql, region in reader.requirement(requirement.condition):
            if sql or region:
                yield NecessaryCondition(what, objects, sql, requirement.span, region)
