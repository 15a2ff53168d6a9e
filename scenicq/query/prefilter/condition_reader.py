"""What constraints of a scenario say over the columns of a frame and of its objects: one reader with two answers.

*May*: each condition holds of every label that matches. What SQL cannot say always may be, so it is no condition.
*Must*: the conditions together prove that a constraint holds, by a band of `SLACK` around every bound, for some values
of the random variables. What SQL cannot say, or a label lacks, is never proved.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import reduce

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.ego_frame import DISTANCE, PLACE, in_ego_frame
from scenicq.forest.groups import Comparison
from scenicq.forest.interval_values import Interval, IntervalVector
from scenicq.forest.nodes import (
    COURSE,
    GOING,
    LAST_LANE,
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
from scenicq.geometry.driven_courses import GAP_S
from scenicq.geometry.regions import Everywhere, IntersectionOf, Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.limits import LIMITS
from scenicq.match.problem.observation import course_rules
from scenicq.match.tolerance import SLACK, Tolerance
from scenicq.query.prefilter.map_relations import (
    MapRelations,
    MeantElements,
    allowed_elements,
    is_along,
    shared_look_ups,
)
from scenicq.query.prefilter.regions import near_region, nearest_box
from scenicq.query.prefilter.said_columns import in_said_truths, said_columns
from scenicq.query.prefilter.sql_bounds import ARITHMETIC, ON_EGO_COURSE, SqlBounds
from scenicq.query.prefilter.sql_ends import (
    SQL,
    Expr,
    SqlTruth,
    all_of,
    any_of,
    between,
    difference,
    less,
    number,
    within_turn,
)
from scenicq.store.reader import LAST
from scenicq.store.schema import MEMBERSHIP_RADIUS_M

__all__ = ["EGO", "ColumnCondition", "ConditionReader", "course_column", "object_columns"]

EGO = "ego"
"""Alias of the frame's row; the objects of a condition are called `a` and, if there are two, `b`."""

_NUMBERS = ("heading", "width", "length", "height")
_AT_THE_PLACE = -2 * SLACK
"""How far a place may be from a bound for it to be surely on the right side, where comparisons allow for slack."""
_NO_END = 1e300
"""What no measure is beyond; products of it with 0 are numbers, as those of infinity are not."""
_NO_TURN = -1.0
"""No lane leads as little from any heading."""


@dataclass(frozen=True, slots=True)
class ColumnCondition:
    """A condition on a frame and at most two of its objects.

    Attributes:
        objects: The objects it is about but the ego, ascending: none, one (`a`) or two (`a` and `b`).
        sql: Over the columns of `ego`, `a` and `b`, null where the label lacks them; or whether it always holds.
        region: For a condition on memberships: SQL that holds of some row of the object's (or the ego's).
        what: The feature or requirement, in the words of the program.
        span: Where the program says it.
        open: SQL that is true where what is not observed would tell, of a condition that is to prove something.
    """

    objects: tuple[int, ...]
    sql: SqlTruth = True
    region: str = ""
    what: str = ""
    span: Span | None = None
    open: SqlTruth = False


def object_columns(alias: str, prefix: str = "") -> dict[str, str | tuple[str, str]]:
    """The properties that have columns, with them.

    Args:
        alias: The alias of the table.
        prefix: How the columns begin: those of the ego with `ego_`.
    """
    start = f"{alias}.{prefix}"
    found: dict[str, str | tuple[str, str]] = {name: f"{start}{name}" for name in _NUMBERS}
    found["position"] = (f"{start}x", f"{start}y")
    vx, vy = f"{start}motion_vx", f"{start}motion_vy"
    found["velocity"] = (vx, vy)
    found["speed"] = f"sqrt({vx} * {vx} + {vy} * {vy})"
    found["acceleration"], found["angularSpeed"] = f"{start}acceleration", f"{start}yaw_rate"
    found[GOING], found[LAST_LANE] = f"{start}heading", f"{start}{LAST}"
    if not prefix:
        found[PLACE], found[DISTANCE] = (f"{start}ego_right", f"{start}ego_ahead"), f"{start}ego_distance"
        for name, column in zip(ON_EGO_COURSE, ("ego_along", "ego_beside"), strict=True):
            known = f"{start}{column}"
            found[name] = (
                f"coalesce({known} - {known}_less, {-_NO_END})", f"coalesce({known} + {known}_more, {_NO_END})"
            )  # fmt: skip
    return found


def course_column(scenario: Scenario) -> dict[tuple[int, str], str]:
    """A mark that objects have columns on the ego's course: a program cuts it at the same gaps as an ingest did."""
    rules = course_rules(scenario).get(scenario.ego)
    return {(scenario.ego, COURSE): ""} if rules is not None and rules.gap_s == GAP_S else {}


@dataclass(slots=True)
class ConditionReader:
    """Reads constraints of one scenario.

    Attributes:
        scenario: The scenario.
        tolerance: The tolerance of its properties.
        relations: Those of the map, which gets the tables that conditions ask for.
        road: The map's direction of the road.
        proving: Whether conditions are what must hold, not what may.
        radius: Metres within which objects must be, where conditions are to prove it; None for any distance.
    """

    scenario: Scenario
    tolerance: Tolerance
    relations: MapRelations
    road: RoadDirection
    proving: bool = False
    radius: float | None = None
    _required: tuple[Node, ...] = field(init=False)
    _said: tuple[Node, ...] = field(init=False)
    _bounds: dict[tuple[int, ...], SqlBounds] = field(default_factory=dict["tuple[int, ...]", "SqlBounds"])

    def __post_init__(self) -> None:
        """Take apart what is required."""
        stated = [each.condition for each in self.scenario.requirements if each.built_in is None]
        self._required = tuple(part for each in stated for part in conjuncts(each))
        self._said = tuple(map(in_said_truths, self._required))

    def comparison(
        self, item: Comparison, meant: MeantElements | None = None, heading: Node | None = None
    ) -> Iterator[ColumnCondition]:
        """What it says that a feature of a label object has a value that an expression takes.

        Args:
            item: The feature, of an object, with its expression.
            meant: The elements that may be meant where the ego is, where that is to be proved.
            heading: What the object's heading is compared with, for a position: it is told with it where it is that
                of the lane that the object is in.
        """
        index, node = item.object, item.expression
        objects = self._objects(node, about=index)
        if len(objects) > 2:
            objects = (index,)
        bounds = self._over(objects)
        own = bounds.columns.get((index, item.property))
        width = self._width(index, item.property)
        if own is None or width is None or not self._has_columns(node, bounds):
            yield self._unreadable(objects)
        elif item.property == "position":
            yield from self._position(index, node, objects, width, meant, heading)
        elif item.property == "heading":
            yield ColumnCondition(objects, self._heading(index, node, bounds, width))
        elif isinstance(own, str):
            allowed = [between(own, limits, width) for limits in self._intervals(node, bounds)]
            yield ColumnCondition(objects, any_of(allowed))
        else:
            yield self._unreadable(objects)

    def requirement(self, root: Node, meant: MeantElements | None = None) -> Iterator[ColumnCondition]:
        """What it says that a condition holds, whatever random variables come out as where that is to be proved.

        Args:
            root: The condition.
            meant: The elements that may be meant where the ego is, where that is to be proved.
        """
        for part in conjuncts(in_said_truths(in_ego_frame(root, self.scenario.ego))):
            objects = self._objects(part)
            looked_up = self._looked_up(part, objects, meant)
            if looked_up is not None:
                yield looked_up
            elif len(objects) > 2 or not self._has_columns(part, self._over(objects)):
                yield self._unreadable(objects)
            elif not self.proving and (held := _held(part)) is not None:
                yield from self._inside(held[1].object, held[0], objects, 0.0, meant)
            elif self.proving:
                yield ColumnCondition(objects, SQL.negation(self._over(objects).can_fail(part)))
            else:
                yield ColumnCondition(objects, self._over(objects).can_hold(part))

    # --- what both answers differ in

    def _unreadable(self, objects: tuple[int, ...]) -> ColumnCondition:
        """What SQL cannot say."""
        return ColumnCondition(objects, not self.proving)

    def _width(self, index: int, name: str) -> float | None:
        """How far a value may, or surely may, be off, where comparisons allow for slack; None where it may not."""
        margin = self.tolerance.of(index, name)
        if self.proving:
            return margin.sure - SLACK if margin.sure > SLACK else None
        return margin.reach if name == "position" else margin.size

    def _has_columns(self, node: Node, bounds: SqlBounds) -> bool:
        """Whether what an expression speaks of has columns, as it must to be proved; otherwise it is unbounded."""
        return not self.proving or all(key in bounds.columns for key in features(node))

    def _intervals(self, node: Node, bounds: SqlBounds) -> tuple[Interval[Expr], ...]:
        return bounds.intervals(node, attained=self.proving)

    def _near(self, place: tuple[Expr, Expr], box: IntervalVector[Expr], width: float) -> SqlTruth:
        """Whether a place may, or must, be within a width in metres of some point of a box."""
        if not self.proving:
            return all_of([between(own, limits, width) for own, limits in zip(place, box, strict=True)])
        off = [
            difference(own, limits.low)
            if limits.exact
            else SQL.most([difference(limits.low, own), difference(own, limits.high), 0.0])
            for own, limits in zip(place, box, strict=True)
        ]
        return SQL.at_most(SQL.plus(*(SQL.times(each, each) for each in off)), (width + SLACK) ** 2)

    # --- positions

    def _position(
        self, index: int, node: Node, objects: tuple[int, ...], width: float, meant: MeantElements | None,
        heading: Node | None,
    ) -> Iterator[ColumnCondition]:  # fmt: skip
        if isinstance(node, PointIn):
            yield from self._inside(index, node.region, objects, width, meant, heading)
            return
        bounds = self._over(objects)
        x, y = bounds.columns[index, "position"]
        place, rest, moved = self._framed((x, y), node, bounds)
        if moved or self.proving:
            boxes = bounds.boxes(rest, attained=self.proving)
            yield ColumnCondition(objects, any_of([self._near(place, box, width) for box in boxes]))

    def _framed(self, place: tuple[Expr, Expr], node: Node, bounds: SqlBounds) -> tuple[tuple[Expr, Expr], Node, bool]:
        """A place seen in the frames that an expression goes through, and what is left of the expression."""
        moved = False
        while True:
            if self._is_from_ego(node, place):
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

    def _is_from_ego(self, node: Node, place: tuple[Expr, Expr]) -> bool:
        """Whether an expression is an offset in the ego's frame: each object's place in it is a column."""
        return (
            isinstance(node, VectorSum)
            and isinstance(node.right, Rotate)
            and self._is_ego(node.left, "position")
            and self._is_ego(node.right.angle, "heading")
            and place in (("a.x", "a.y"), ("b.x", "b.y"))
        )

    def _inside(
        self, index: int, region: Node, objects: tuple[int, ...], width: float, meant: MeantElements | None,
        heading: Node | None = None,
    ) -> Iterator[ColumnCondition]:  # fmt: skip
        """That an object's place, or one within a width of it in metres, lies in a region."""
        parts = _intersected(region)
        own = () if index == self.scenario.ego else (index,)
        if self.proving:
            # of several parts each may have a place of its own nearby: the place itself is asked for
            width = min(width, MEMBERSHIP_RADIUS_M - SLACK) if len(parts) == 1 else -SLACK
            yield self._within_radius(own, width)
        for part in parts:
            near: str | None = None
            match part:
                case DiscAt() | SectorAt():
                    yield ColumnCondition(objects, self._in_view(part, index, objects, width))
                    continue
                case _ if width > MEMBERSHIP_RADIUS_M - SLACK:
                    pass  # memberships are recorded up to a distance: a wider tolerance cannot be told by them
                case Select():
                    near = (
                        None
                        if self.proving and len(parts) > 1
                        else self._in_looked_up(index, part, width, meant, heading)
                    )
                case _ if isinstance(part, Region):
                    near = near_region(part, self.relations.names, width)
                case _:
                    pass
            yield self._unreadable(objects) if near is None else ColumnCondition(own, region=near)

    def _within_radius(self, own: tuple[int, ...], width: float) -> ColumnCondition:
        """That an object is within the radius, and all that is within a width of it in metres."""
        if self.radius is None:
            return ColumnCondition(own)
        left = self.radius - width - 2 * SLACK
        return ColumnCondition(own, f"a.ego_distance <= {number(left)}" if own else left > 0)

    def _in_looked_up(
        self, index: int, region: Select, width: float, meant: MeantElements | None, heading: Node | None
    ) -> str | None:
        """A condition on memberships that an object meets in a region that depends on where the ego is."""
        look_up = self.relations.of_ego(region.index)
        if look_up is None:
            return None
        if not self.proving:
            meant = self.relations.possible_elements(look_up, self._required)
        if meant is None or (self.proving and self.radius is not None):
            return None
        return self.relations.in_region(region, look_up, meant, width, self._turn(index, region, heading))

    def _turn(self, index: int, region: Select, heading: Node | None) -> float | None:
        """How far the lane that an object is in may, or must at most, lead from its heading; None for any way."""
        if heading is None or not is_along(heading, region, index, self.road):
            return None
        width = self._width(index, "heading")
        return _NO_TURN if width is None else width if self.proving else width + SLACK

    def _in_view(self, region: DiscAt | SectorAt, index: int, objects: tuple[int, ...], width: float) -> SqlTruth:
        bounds = self._over(objects)
        place, center = bounds.columns[index, "position"], bounds.exact_vector(region.center)
        radius = bounds.exact(region.radius)
        if center is None or (self.proving and radius is None):
            return not self.proving
        from_ego = self._is_ego(region.center, "position") and place == ("a.x", "a.y")
        dx, dy = (difference(p, q) for p, q in zip(place, center, strict=True))
        away = "a.ego_distance" if from_ego else f"sqrt({number(dx)} * {number(dx)} + {number(dy)} * {number(dy)})"
        width = _AT_THE_PLACE if self.proving else width
        near = any_of([less(away, SQL.plus(each.high, width)) for each in bounds.intervals(region.radius)])
        if isinstance(region, DiscAt):
            return near
        angle = region.angle.value if isinstance(region.angle, Constant) else None
        if not (isinstance(angle, float) and from_ego and self._is_ego(region.heading, "heading")):
            return False if self.proving else near
        half = min(abs(angle) / 2, math.pi)
        if not self.proving and half > math.pi / 2:
            return near
        # a wedge of at most half a turn lies on one side of each of its edges
        aside = f"abs(a.ego_right) * {number(math.cos(half))} - a.ego_ahead * {number(math.sin(half))}"
        return all_of([near, less(f"({aside})", width)])

    # --- headings

    def _heading(self, index: int, node: Node, bounds: SqlBounds, width: float) -> SqlTruth:
        """That a heading is within a width in radians of some value of an expression, modulo a full turn."""
        own = bounds.columns[index, "heading"]
        assert isinstance(own, str)
        alias = own.removesuffix("heading")
        terms = _summands(node)
        # the direction of the road at the place and the ego's heading are left out: there are columns without them
        fields = [term for term in terms if isinstance(term, DirectionAt)]
        directions = ""
        if len(fields) == 1 and self._is_own_direction(fields[0], index):
            directions, terms = f"{alias}road_directions", [term for term in terms if term is not fields[0]]
        relative = next((term for term in terms if self._is_ego(term, "heading")), None)
        if relative is not None and index != self.scenario.ego:
            own, terms = f"{alias}relative_heading", [term for term in terms if term is not relative]
        allowed = self._intervals(reduce(build.add, terms, build.constant(0.0)), bounds)
        near = within_turn(own, allowed, width, directions)
        if not directions:
            return near
        # the columns of directions know less than the map does beside the lanes
        off = [f"{alias}lane IS NULL"] if self.road.has_beside else []
        if self.proving:
            return all_of([f"len({directions}) > 0", *map(SQL.negation, off), near])
        return any_of([f"{own} IS NULL", *off, near])

    def _is_own_direction(self, node: DirectionAt, index: int) -> bool:
        """Whether an expression is the direction of the road where an object is."""
        road, point = node.field, node.point
        return (
            isinstance(point, Feature)
            and (point.object, point.property) == (index, "position")
            and isinstance(road, Constant)
            and road.value is self.road
        )

    # --- look-ups

    def _looked_up(
        self, condition: Node, objects: tuple[int, ...], meant: MeantElements | None
    ) -> ColumnCondition | None:
        """A condition on the elements of the map at one or two places; None where it is none, or SQL cannot say it."""
        relations = self.relations
        if (found := allowed_elements(condition)) is not None:
            look_up, numbers = found
            if not self.proving:
                near = relations.may_hold(look_up, numbers, self._required)
                return None if near is None else ColumnCondition(objects, region=near)
            if meant is not None and meant.shared and look_up.object != self.scenario.ego:
                return ColumnCondition(objects)
            if meant is None or (meant.among is not None and look_up.object != self.scenario.ego):
                return self._unreadable(objects)
            near = relations.surely_holds(look_up, numbers if meant.among is None else meant.among, meant.most)
            return self._unreadable(objects) if near is None else ColumnCondition(objects, region=near)
        places = shared_look_ups(condition)
        if places is None or len(objects) != 1:
            return None
        if not self.proving:
            near = relations.may_share(places, self._required)
            return None if near is None else ColumnCondition(objects, region=near)
        near = None
        if meant is not None and meant.among is None:
            near = relations.surely_share(places, range(places[0].occupancy.nothing), meant.most)
        elif meant is not None and meant.shared and meant.among is not None:
            near = relations.surely_share(places, meant.among, meant.most)
        return self._unreadable(objects) if near is None else ColumnCondition(objects, region=near)

    # --- columns

    def _over(self, objects: tuple[int, ...]) -> SqlBounds:
        """Bounds over the columns of some objects and the ego's."""
        if objects not in self._bounds:
            aliases = {self.scenario.ego: (EGO, "ego_")} | dict(zip(objects, (("a", ""), ("b", "")), strict=False))
            columns = {
                (index, name): column
                for index, (alias, prefix) in aliases.items()
                for name, column in object_columns(alias, prefix).items()
            }
            attributes = {index: f"{alias}.{prefix}attributes" for index, (alias, prefix) in aliases.items()}
            own = [(index, name) for index in aliases for name in self.scenario.objects[index].properties]
            columns |= said_columns(self._said, attributes, own)
            columns |= course_column(self.scenario)
            self._bounds[objects] = SqlBounds(columns, self._nearest)
        return self._bounds[objects]

    def _nearest(self, region: Region, x: str, y: str) -> str | None:
        """How near a region may be to the ego: objects are too many to look at each box for each of them."""
        own = (f"{EGO}.ego_x", f"{EGO}.ego_y")
        return nearest_box(region, self.relations.names, x, y) if (x, y) == own else None

    def _objects(self, root: Node, about: int | None = None) -> tuple[int, ...]:
        """The objects that an expression is about, the ego left out."""
        found = {index for index, _ in features(root)}
        if about is not None:
            found.add(about)
        return tuple(sorted(found - {self.scenario.ego}))

    def _is_ego(self, node: Node, name: str) -> bool:
        """Whether an expression is a property of the ego."""
        return isinstance(node, Feature) and (node.object, node.property) == (self.scenario.ego, name)


def _intersected(root: Node) -> list[Node | Region]:
    """The regions whose intersection a region is, all of them narrower than everywhere."""
    found: list[Node | Region] = []
    todo = [root]
    while todo:
        match todo.pop():
            case RegionIntersection(parts=parts):
                todo += reversed(parts)
            case Constant(value=IntersectionOf(parts=parts)):
                found += parts
            case Constant(value=Everywhere()):
                pass
            case Constant(value=region) if isinstance(region, Region):
                found.append(region)
            case region:
                found.append(region)
    return found


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
