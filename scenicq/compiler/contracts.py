"""Contracts: what a recording must show of an object's motion in an action, or in a behavior of Scenic's libraries.

Each action, and each behavior of the libraries, has a row: a function whose parameters are its own, and which makes
conditions about one sample over what is observed of the object. What is not observed is unknown, as in all conditions
over time. What says nothing about motion (lights, gears, throttle) has a row, too: it is known, and constrains nothing.

How a contract is checked. A *mode* is entered at a sample. From `--reaction` and `settles_s` seconds after that, the
mode is out of its contract at a sample if `shows` is false at every sample of the last `settles_s` seconds:
accelerations are slopes over a second, and boxes jump, so that only what no sample of a second shows is not shown. And
what the program's own conditions switch to, which slopes show before it comes, breaks nothing. `shows_from` is the same
for what depends on the place where the mode was entered. A behavior that goes through several phases gives a contract
for each: modes of their own, one after the other.

What is weaker than what behaviors do: the order of the lanes of a trajectory is seen by the direction of travel alone;
a change of lanes need not begin, only end; that a heading is *held* is seen by motion along the object's own heading;
other vehicles are those that play a role; and who does not ask may forget a walker that was sent (`remains`).
"""

# ruff: noqa: N803 - parameters have Scenic's names

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast

from scenicq.compiler import operators
from scenicq.compiler.coerce import property_node, read_over_time, to_heading, to_scalar, to_vector
from scenicq.compiler.contract_bounds import BOUNDS
from scenicq.compiler.element_lookups import LookupTable
from scenicq.compiler.lane_courses import dead_ends, lane_course, lanes_and_junctions
from scenicq.compiler.values import Choice, Instance, ModelValue, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.compute import fold
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    ArithmeticOp,
    CompareOp,
    Constant,
    DirectionAt,
    Distance,
    Encloses,
    LogicOp,
    Node,
    RegionUnion,
    Select,
    Undefined,
)
from scenicq.geometry.elements import Lane, LaneSection, NetworkElement
from scenicq.geometry.regions import Everywhere, Nowhere, PointSet, PolygonSet, PolylineSet, Region

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["ACTIONS", "BEHAVIORS", "Contract", "action_contract", "behavior_contract"]


@dataclass(frozen=True, slots=True)
class Contract:
    """What must be shown in one mode.

    Attributes:
        name: The name of the action or behavior, as programs write it.
        shows: A condition about one sample; None where the mode constrains nothing.
        settles_s: Seconds of a window of which some sample must show it; the first begins when the reaction is over.
        over: The mode ends at the first sample at which this holds, also at that of its entry; None: never by itself.
        least_steps: Samples that it lasts at least: 1 where an action is taken before it is over.
        remains: Whether what it shows goes on after it is over, until the object does something else, as who is sent
            walks on.
        shows_from: Gives what must be shown besides by who entered the mode at a place, an expression: where it was as
            observed, or a feature that is not observed; None where nothing depends on it.
    """

    name: str
    shows: Node | None = None
    settles_s: float = field(default=BOUNDS["window"].value, kw_only=True)
    over: Node | None = field(default=None, kw_only=True)
    least_steps: int = field(default=0, kw_only=True)
    remains: bool = field(default=False, kw_only=True)
    shows_from: Callable[[Node], Node] | None = field(default=None, kw_only=True)


def action_contract(
    run: Interpreter, name: str, agent: Instance, positional: Sequence[ModelValue],
    keywords: Mapping[str, ModelValue], span: Span,
) -> Contract | None:  # fmt: skip
    """What an object must show that takes an action.

    Args:
        run: The run of the program.
        name: The action.
        agent: The object.
        positional: Its arguments.
        keywords: Its arguments by name.
        span: Where the program takes it.

    Returns:
        The contract; None if the libraries have no such action.

    Raises:
        ScenarioError: wrong-arity, wrong-type or wrong-value, for arguments that the action cannot have.
    """
    made = _made(_ACTIONS, run, name, agent, positional, keywords, span)
    return None if made is None else made[0]


def behavior_contract(
    run: Interpreter, name: str, agent: Instance, positional: Sequence[ModelValue],
    keywords: Mapping[str, ModelValue], span: Span,
) -> tuple[Contract, ...] | None:  # fmt: skip
    """What an object must show that runs a behavior of the libraries: a contract for each phase, in their order.

    The behavior is over with the last of them. Arguments are those of `action_contract`.

    Returns:
        The contracts, at least one; None if the libraries have no such behavior.

    Raises:
        ScenarioError: wrong-arity, wrong-type or wrong-value, for arguments that the behavior cannot have.
    """
    return _made(_BEHAVIORS, run, name, agent, positional, keywords, span)


def _made(
    rows: Mapping[str, Callable[..., object]], run: Interpreter, name: str, agent: Instance,
    positional: Sequence[ModelValue], keywords: Mapping[str, ModelValue], span: Span,
) -> tuple[Contract, ...] | None:  # fmt: skip
    row = rows.get(name)
    if row is None:
        return None
    motion = _Motion(run, name, agent, span)
    try:
        given = inspect.signature(row).bind(motion, *positional, **keywords)
    except TypeError as error:
        raise fail("wrong-arity", f"`{name}` cannot take these arguments", span, str(error)) from None
    with read_over_time():
        made = row(*given.args, **given.kwargs)
    return (made,) if isinstance(made, Contract) else cast("tuple[Contract, ...]", made)


# --- the language of contracts


def _both(*conditions: Node | None) -> Node:
    """All of some conditions; those that are None are left out."""
    return _connected(LogicOp.AND, conditions)


def _either(*conditions: Node | None) -> Node:
    """One of some conditions; those that are None are left out."""
    return _connected(LogicOp.OR, conditions)


def _connected(op: LogicOp, conditions: Sequence[Node | None]) -> Node:
    there = [each for each in conditions if each is not None]
    return build.connect(op, there, next((each.span for each in there if each.span is not None), None))


def _bound(name: str) -> float:
    return BOUNDS[name].value


@dataclass(frozen=True, slots=True)
class _Motion:
    """What is observed of an object, and conditions on it.

    Attributes:
        run: The run of the program.
        name: The action or behavior in question.
        agent: The object.
        span: Where the program names it.
        distances: How far it is from regions that have been asked about, each asked about once.
    """

    run: Interpreter
    name: str
    agent: Instance
    span: Span
    distances: dict[int, tuple[Node, Node]] = field(default_factory=dict[int, "tuple[Node, Node]"])

    def observed(self, name: str) -> Node:
        """A property of the object."""
        return cast(Node, property_node(self.agent, name, self.span))

    @property
    def place(self) -> Node:
        """Where the object is."""
        return to_vector(self.agent, self.span)

    def number(self, value: ModelValue, name: str, low: float = -math.inf, high: float = math.inf) -> Node:
        """An argument as a number.

        Raises:
            ScenarioError: wrong-type; wrong-value, for a known one that is not within the ends.
        """
        if value is None or isinstance(value, bool):
            raise self.wrong(value, f"`{name}` is a number")
        found = to_scalar(value, self.span)
        if isinstance(found, Constant) and not low <= cast(float, found.value) <= high:
            raise fail("wrong-value", f"`{name}` of `{self.name}` lies between {low:g} and {high:g}", self.span,
                       f"this is {cast(float, found.value):g}")  # fmt: skip
        return found

    def truth(self, value: ModelValue, name: str) -> bool:
        """An argument as a truth value that is known.

        Raises:
            ScenarioError: wrong-type.
        """
        if isinstance(value, Constant):
            value = value.value
        if not isinstance(value, bool):
            raise self.wrong(value, f"`{name}` is True or False")
        return value

    def wrong(self, value: ModelValue, message: str) -> Exception:
        """What is wrong with an argument."""
        return fail("wrong-type", f"{message} in `{self.name}`", self.span, f"this is {describe(value)}")

    # --- speed

    def compare(self, op: CompareOp, left: Node, right: Node | float) -> Node:
        """A comparison."""
        other = build.constant(right) if isinstance(right, float | int) else right
        return build.compare(op, left, other, self.span)

    def gains(self) -> Node:
        """The object gets faster."""
        return self.compare(CompareOp.GE, self.observed("acceleration"), _bound("change"))

    def loses(self) -> Node:
        """The object gets slower."""
        return self.compare(CompareOp.LE, self.observed("acceleration"), -_bound("change"))

    def rests(self) -> Node:
        """The object is at rest."""
        return self.compare(CompareOp.LT, self.observed("speed"), _bound("rest"))

    def brakes(self) -> Node:
        """The object does not get faster, or is at rest."""
        return _either(self.compare(CompareOp.LE, self.observed("acceleration"), _bound("brake")), self.rests())

    def at_least(self, speed: Node, margin: float) -> Node:
        """The object is as fast as that, or less within bounds, in comparisons that are affine in the number."""
        return self._against(CompareOp.GE, speed, -margin)

    def at_most(self, speed: Node, margin: float) -> Node:
        """The object is not faster, but within bounds."""
        return self._against(CompareOp.LE, speed, margin)

    def _against(self, op: CompareOp, speed: Node, margin: float) -> Node:
        now, sign = self.observed("speed"), math.copysign(1.0, margin)
        by_margin = build.add(speed, build.constant(margin), self.span)
        share = build.constant(1.0 + sign * _bound("speed share"))
        by_share = build.arithmetic(ArithmeticOp.MUL, speed, share, span=self.span)
        return _either(self.compare(op, now, by_margin), self.compare(op, now, by_share))

    def approaches(self, target: Node, where_else: Node | None = None, other: Node | None = None) -> Node:
        """The speed is near a target, or approaches it; or it is above it, and is held.

        Args:
            target: The target.
            where_else: Where another target counts as well, as before and in turns.
            other: That target.
        """
        margin = _bound("speed")
        slow = fast = None
        if where_else is not None and other is not None:
            slow = _both(where_else, self.at_least(other, margin))
            fast = _both(where_else, self.at_most(other, margin))
        return _both(
            _either(self.at_least(target, margin), self.gains(), slow),
            _either(self.at_most(target, margin), self.loses(), fast, self.holds(target)),
        )

    def holds(self, target: Node) -> Node:
        """The object is faster than a target, by not too much, and does not get faster still."""
        most = build.add(target, build.constant(_bound("held")), self.span)
        return _both(self.compare(CompareOp.LE, self.observed("speed"), most), self.brakes())

    def has_speed(self, speed: Node) -> Node:
        """The speed is one that was set, whatever its sign."""
        wanted = build.arithmetic(ArithmeticOp.ABS, speed, span=self.span)
        margin = _bound("set speed")
        return _both(self.at_least(wanted, margin), self.at_most(wanted, margin))

    # --- place

    def within(self, region: Region | Node, distance: float) -> Node:
        """The centre lies so many metres from a region at most."""
        return self.compare(CompareOp.LE, self.away(region), distance)

    def away(self, region: Region | Node) -> Node:
        """How far the centre is from a region."""
        if id(region) not in self.distances:
            area = cast(Node, region) if is_node(region) else build.constant(cast(Region, region))
            self.distances[id(region)] = area, fold(Distance(area, self.place, span=self.span))
        return self.distances[id(region)][1]

    def near_junction(self, distance: float) -> Node | None:
        """The centre is in a junction, or so many metres before one; None where the map has none."""
        junctions = self.run.network.intersectionRegion
        return None if junctions.is_empty else self.within(junctions, distance)

    def turned_from(self, heading: Node, *directions: Node) -> Node:
        """One of some directions differs from a heading by less than the bound."""
        turns = (build.arithmetic(ArithmeticOp.WRAP, build.minus(each, heading, self.span)) for each in directions)
        most = math.radians(_bound("heading"))
        off = (build.arithmetic(ArithmeticOp.ABS, each, span=self.span) for each in turns)
        return _either(*(self.compare(CompareOp.LE, each, most) for each in off))

    def motion_along(self, heading: Node) -> Node:
        """The object moves, or faces, in a direction, or is at rest."""
        moves = build.bearing(self.observed("velocity"), self.span)
        return _either(self.turned_from(heading, to_heading(self.agent, self.span), moves), self.rests())

    def walks_ahead(self) -> Node:
        """The object moves in the direction that it faces, or is at rest."""
        moves = build.bearing(self.observed("velocity"), self.span)
        return _either(self.turned_from(to_heading(self.agent, self.span), moves), self.rests())

    def heads_along_road(self, *, against: bool = False) -> Node:
        """Outside of junctions the object heads in the direction of the traffic, or against it."""
        along: Node = DirectionAt(build.constant(self.run.network.roadDirection), self.place, span=self.span)
        if against:
            along = build.add(along, build.constant(math.pi), self.span)
        heads = self.turned_from(along, to_heading(self.agent, self.span))
        return _either(heads, self.near_junction(0.0))

    def in_course_of(self, lane: ModelValue, name: str, *, against: bool = False) -> Node:
        """The centre is in a lane or where it leads to."""
        return self.within(self.course(lane, name, against=against), _bound("lane"))

    def course(self, lane: ModelValue, name: str, *, against: bool = False) -> Node:
        """Where a driver comes to who keeps to a lane.

        Raises:
            ScenarioError: wrong-type: that is no lane.
        """

        def area(option: ModelValue) -> Region:
            option = option.lane if isinstance(option, LaneSection) else option
            if not isinstance(option, Lane):
                raise self.wrong(option, f"`{name}` is a lane of the map")
            return lane_course(self.run, option, self.span, against=against)

        return self.map_outcomes(lane, area)

    def map_outcomes(self, value: ModelValue, make: Callable[[ModelValue], Region]) -> Node:
        """What is made of a value, or of each outcome of a choice; where there is no element, there is no region."""
        if isinstance(value, Choice):
            nothing = build.constant(Undefined("there is no such element here"), self.span)
            options = (nothing if each is None else self.map_outcomes(each, make) for each in value.options)
            return Select(value.index, tuple(options), span=self.span)
        return build.constant(make(value), self.span)

    def lanes(self, value: ModelValue, name: str) -> list[ModelValue]:
        """A list of lanes, some of which may be random.

        Raises:
            ScenarioError: wrong-type.
        """
        if not isinstance(value, list | tuple) or not value:
            raise self.wrong(value, f"`{name}` is a list of lanes")
        return list(cast("Sequence[ModelValue]", value))

    def area_of(self, lanes: Sequence[ModelValue], name: str) -> Node:
        """The area of lanes, and of the junctions that they cross."""

        def area(option: ModelValue) -> Region:
            if not isinstance(option, Lane | LaneSection):
                raise self.wrong(option, f"`{name}` is made of lanes")
            lane = option.lane if isinstance(option, LaneSection) else option
            return lanes_and_junctions((lane,), lane.name)

        parts = tuple(self.map_outcomes(each, area) for each in lanes)
        return parts[0] if len(parts) == 1 else fold(RegionUnion(parts, span=self.span))

    def behind(self, lane: ModelValue, name: str) -> Node:
        """What a lane leads to: the junction behind its end, or the end itself."""

        def target(option: ModelValue) -> Region:
            if not isinstance(option, Lane):
                raise self.wrong(option, f"`{name}` is made of lanes")
            junction = next((each.intersection for each in option.maneuvers if each.intersection is not None), None)
            if junction is not None:
                return junction.region
            if option.centerline is None:
                return Nowhere()
            x, y = option.centerline.lines[-1].coords[-1][:2]
            return PointSet(((x, y),), f"the end of {option.name}")

        return self.map_outcomes(lane, target)


# --- actions


def _nothing(motion: _Motion) -> Contract:
    return Contract(motion.name)


def _set_position(motion: _Motion, pos: ModelValue) -> Contract:
    away = operators.distance_to(motion.place, to_vector(pos, motion.span), motion.span)
    return Contract(motion.name, motion.compare(CompareOp.LE, away, _bound("position")))


def _set_transform(motion: _Motion, pos: ModelValue, heading: ModelValue) -> Contract:
    faces = motion.turned_from(to_heading(heading, motion.span), to_heading(motion.agent, motion.span))
    return Contract(motion.name, _both(_set_position(motion, pos).shows, faces))


def _offset(motion: _Motion, offset: ModelValue) -> Contract:
    """Moved by so much at each step, an object has a velocity, or goes on saying that it has none."""
    per_second = build.scale(to_vector(offset, motion.span), build.constant(1.0 / _step_s(motion)), motion.span)
    wanted = build.rotate(per_second, to_heading(motion.agent, motion.span), motion.span)
    return Contract(motion.name, _either(_has_velocity(motion, wanted), motion.rests()))


def _step_s(motion: _Motion) -> float:
    step = motion.run.params.get("time_step") or motion.run.params.get("timestep")
    known = step is not None and isinstance(step[0], int | float) and not isinstance(step[0], bool) and step[0] > 0
    return float(step[0]) if step is not None and known else 0.1


def _set_velocity(motion: _Motion, xVel: ModelValue, yVel: ModelValue, zVel: ModelValue = 0) -> Contract:
    motion.number(zVel, "zVel")
    wanted = build.vector(motion.number(xVel, "xVel"), motion.number(yVel, "yVel"), motion.span)
    return Contract(motion.name, _has_velocity(motion, wanted))


def _has_velocity(motion: _Motion, wanted: Node) -> Node:
    """The velocity differs from one by what a speed may differ from that one's."""
    off = build.norm(build.vector_difference(motion.observed("velocity"), wanted, motion.span), motion.span)
    share = build.arithmetic(
        ArithmeticOp.MUL, build.norm(wanted, motion.span), build.constant(_bound("speed share")), span=motion.span
    )
    near = motion.compare(CompareOp.LE, off, _bound("set speed"))
    return _either(near, motion.compare(CompareOp.LE, off, share))


def _set_speed(motion: _Motion, speed: ModelValue) -> Contract:
    return Contract(motion.name, motion.has_speed(motion.number(speed, "speed")))


def _share(name: str, low: float) -> Callable[[_Motion, ModelValue], Contract]:
    """An action with a share of what is possible, which shows nothing."""

    def make(motion: _Motion, value: ModelValue) -> Contract:
        motion.number(value, name, low, 1.0)
        return Contract(motion.name)

    make.__signature__ = _named(name)  # type: ignore[attr-defined]
    return make


def _switch(name: str) -> Callable[[_Motion, ModelValue], Contract]:
    """An action that switches something, which shows nothing."""

    def make(motion: _Motion, value: ModelValue) -> Contract:
        motion.truth(value, name)
        return Contract(motion.name)

    make.__signature__ = _named(name)  # type: ignore[attr-defined]
    return make


def _any(*names: str, **optional: ModelValue) -> Callable[..., Contract]:
    """What takes arguments of these names, and shows nothing."""

    def make(motion: _Motion, *_: ModelValue, **__: ModelValue) -> Contract:
        return Contract(motion.name)

    make.__signature__ = _named(*names, **optional)  # type: ignore[attr-defined]
    return make


def _named(*names: str, **optional: ModelValue) -> inspect.Signature:
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    parameters = [inspect.Parameter(name, kind) for name in ("motion", *names)]
    parameters += [inspect.Parameter(name, kind, default=value) for name, value in optional.items()]
    return inspect.Signature(parameters)


def _set_brake(motion: _Motion, brake: ModelValue) -> Contract:
    strength = motion.number(brake, "brake", 0.0, 1.0)
    released = motion.compare(CompareOp.LE, strength, 0.0)
    return Contract(
        motion.name,
        None if isinstance(released, Constant) and released.value is True else _either(released, motion.brakes()),
    )


def _set_reverse(motion: _Motion, reverse: ModelValue) -> Contract:
    if not motion.truth(reverse, "reverse"):
        return Contract(motion.name)
    back = build.arithmetic(ArithmeticOp.NEG, to_heading(motion.agent, motion.span), span=motion.span)
    ahead = build.coordinate(build.rotate(motion.observed("velocity"), back, motion.span), 1, motion.span)
    return Contract(motion.name, _either(motion.compare(CompareOp.LE, ahead, _bound("rest")), motion.rests()))


def _set_walking_direction(motion: _Motion, heading: ModelValue) -> Contract:
    return Contract(motion.name, motion.motion_along(to_heading(heading, motion.span)))


def _set_walk(motion: _Motion, enabled: ModelValue, maxSpeed: ModelValue = 1.4) -> Contract:
    most = motion.number(maxSpeed, "maxSpeed")
    walks = motion.truth(enabled, "enabled")
    return Contract(motion.name, motion.at_most(most, _bound("set speed")) if walks else motion.rests())


def _autopilot(motion: _Motion, enabled: ModelValue = True, **options: ModelValue) -> Contract:
    motion.truth(enabled, "enabled")
    return Contract(motion.name)


def _set_autopilot(motion: _Motion, enabled: ModelValue, **options: ModelValue) -> Contract:
    return _autopilot(motion, enabled, **options)


_ACTIONS: Mapping[str, Callable[..., Contract]] = {
    # all of Scenic's driving simulators
    "SetPositionAction": _set_position,
    "OffsetAction": _offset,
    "SetVelocityAction": _set_velocity,
    "SetSpeedAction": _set_speed,
    "SetThrottleAction": _share("throttle", 0.0),
    "SetSteerAction": _share("steer", -1.0),
    "SetBrakeAction": _set_brake,
    "SetHandBrakeAction": _switch("handBrake"),
    "SetReverseAction": _set_reverse,
    "RegulatedControlAction": _any("throttle", "steer", "past_steer", max_throttle=0.5, max_brake=0.5, max_steer=0.8),
    "SetWalkingDirectionAction": _set_walking_direction,
    "SetWalkingSpeedAction": _set_speed,
    # CARLA's
    "SetLocationAction": _set_position,
    "SetAngularVelocityAction": _any("angularVel"),
    "SetTransformAction": _set_transform,
    "SetManualGearShiftAction": _switch("manualGearShift"),
    "SetGearAction": _any("gear"),
    "SetManualFirstGearShiftAction": _nothing,
    "SetTrafficLightAction": _any("color", distance=100, group=False),
    "SetAutopilotAction": _set_autopilot,
    "SetVehicleLightStateAction": _any("vehicleLightState"),
    "SetJumpAction": _switch("jump"),
    "SetWalkAction": _set_walk,
    "TrackWaypointsAction": _any("waypoints", cruising_speed=10),
    # LGSVL's
    "FollowWaypointsAction": _any("waypoints"),
    "CancelWaypointsAction": _nothing,
    "SetDestinationAction": _any("dest"),
}
ACTIONS = frozenset(_ACTIONS)
"""The actions of Scenic's driving simulators."""


# --- behaviors


def _follow_lane(
    motion: _Motion, target_speed: ModelValue = 10, laneToFollow: ModelValue = None,
    is_oppositeTraffic: ModelValue = False,
) -> Contract:  # fmt: skip
    """Keeps to the lane entered on, or to one that is given; slows down to turn."""
    against = motion.truth(is_oppositeTraffic, "is_oppositeTraffic")
    target = motion.number(target_speed, "target_speed")
    turning = motion.near_junction(_bound("junction"))
    shows = _both(
        motion.heads_along_road(against=against),
        motion.approaches(target, turning, build.constant(_bound("turn speed"))),
    )
    over = None if against else _leads_nowhere(motion)
    if laneToFollow is not None:
        kept = motion.in_course_of(laneToFollow, "laneToFollow", against=against)
        return Contract(motion.name, _both(shows, kept), settles_s=_bound("lane window"), over=over)
    on_lanes = motion.within(motion.run.network.drivableRegion, _bound("lane"))
    return Contract(
        motion.name, _both(shows, on_lanes), settles_s=_bound("lane window"), over=over,
        shows_from=_keeps_lane(motion, against=against),
    )  # fmt: skip


def _keeps_lane(motion: _Motion, *, against: bool = False) -> Callable[[Node], Node]:
    """The centre is where a lane leads to that the object entered on; if it entered on none, it may be anywhere."""
    lookups, network = motion.run.lookups, motion.run.network
    table = lookups.table((id(network), "laneAt"), lambda: LookupTable.of_network(network, "laneAt"))
    lanes = (cast(Lane, each) for each in table.options)
    courses = [lane_course(motion.run, each, motion.span, against=against) for each in lanes]
    options = tuple(build.constant(each) for each in (*courses, Everywhere()))

    def keeps(place: Node) -> Node:
        numbers = lookups.numbers(table, place, motion.span) if table.options else ()
        areas = (fold(Select(number, options, span=motion.span)) for number in numbers)
        with read_over_time():
            return (
                _either(*(motion.within(each, _bound("lane")) for each in areas)) if numbers else build.constant(True)
            )

    return keeps


def _leads_nowhere(motion: _Motion) -> Node | None:
    """The object is near the end of a lane that leads nowhere; None where the map has no such lane."""
    ends = dead_ends(motion.run.network.lanes)
    if not ends:
        return None
    lanes = PolygonSet(tuple(lane.polygon for lane, _ in ends), "lanes that lead nowhere")
    points = PointSet(tuple(end for _, end in ends), "the ends of lanes that lead nowhere")
    return _both(motion.within(lanes, 0.0), motion.within(points, _bound("dead end")))


def _follow_trajectory(
    motion: _Motion, target_speed: ModelValue = 10, trajectory: ModelValue = None, turn_speed: ModelValue = None
) -> Contract:
    """Goes through some lanes, in junctions at another speed."""
    lanes = motion.lanes(trajectory, "trajectory")
    target = motion.number(target_speed, "target_speed")
    half = build.arithmetic(ArithmeticOp.MUL, target, build.constant(0.5), span=motion.span)
    turn = half if turn_speed is None else motion.number(turn_speed, "turn_speed")
    shows = _both(
        motion.within(motion.area_of(lanes, "trajectory"), _bound("lane")),
        motion.heads_along_road(),
        motion.approaches(target, motion.near_junction(_bound("lane")), turn),
    )
    end = motion.away(motion.behind(lanes[-1], "trajectory"))
    over = motion.compare(CompareOp.LT, end, _bound("trajectory end"))
    return Contract(motion.name, shows, settles_s=_bound("lane window"), over=over)


def _turn(motion: _Motion, trajectory: ModelValue, target_speed: ModelValue = 6) -> Contract:
    """Follows a line, or lanes, while it is in a junction."""
    if is_node(trajectory) and kind_of(cast(Node, trajectory)) == "region":
        followed = motion.within(cast(Node, trajectory), _bound("line"))
    elif isinstance(trajectory, NetworkElement | PolylineSet):
        region = trajectory.region if isinstance(trajectory, NetworkElement) else trajectory
        followed = motion.within(region, _bound("line"))
    else:
        followed = motion.within(motion.area_of(motion.lanes(trajectory, "trajectory"), "trajectory"), _bound("lane"))
    box = operators.object_box(motion.agent, motion.span)
    inside = fold(Encloses(build.constant(motion.run.network.intersectionRegion), box, span=motion.span))
    shows = _both(followed, motion.approaches(motion.number(target_speed, "target_speed")))
    return Contract(motion.name, shows, over=build.opposite(inside))


def _change_lane(
    motion: _Motion, laneSectionToSwitch: ModelValue, is_oppositeTraffic: ModelValue = False,
    target_speed: ModelValue = 10,
) -> Contract:  # fmt: skip
    """Is in the old lane, then across, then in the new one; over when it is in the middle of that."""
    against = motion.truth(is_oppositeTraffic, "is_oppositeTraffic")

    def line(option: ModelValue) -> Region:
        if not isinstance(option, LaneSection | Lane):
            raise motion.wrong(option, "`laneSectionToSwitch` is a section of a lane")
        lane = option.lane if isinstance(option, LaneSection) else option
        return Nowhere() if lane.centerline is None else lane.centerline

    new = motion.in_course_of(laneSectionToSwitch, "laneSectionToSwitch", against=against)
    from_old = _keeps_lane(motion)
    shows = _both(
        motion.within(motion.run.network.drivableRegion, _bound("lane")),
        motion.approaches(motion.number(target_speed, "target_speed")),
    )
    middle = motion.within(motion.map_outcomes(laneSectionToSwitch, line), _bound("arrived"))
    return Contract(
        motion.name, shows, settles_s=_bound("lane window"), over=middle,
        shows_from=lambda place: _either(new, from_old(place)),
    )  # fmt: skip


def _drive_avoiding_collisions(
    motion: _Motion, target_speed: ModelValue = 25, avoidance_threshold: ModelValue = 10
) -> Contract:
    """Keeps to its lane, and brakes where another vehicle is near."""
    follows = _follow_lane(motion, target_speed)
    assert follows.shows is not None
    threshold = motion.number(avoidance_threshold, "avoidance_threshold")
    others = (each for each in motion.run.objects if each is not motion.agent and each.cls.derives_from("Vehicle"))
    near = [
        motion.compare(CompareOp.LE, operators.distance_to(motion.agent, each, motion.span), threshold)
        for each in others
    ]
    avoids = _both(_either(*near), motion.brakes()) if near else None
    return replace(follows, shows=_either(follows.shows, avoids))


def _crossing(
    motion: _Motion, reference_actor: ModelValue, min_speed: ModelValue = 1, threshold: ModelValue = 10,
    final_speed: ModelValue = None,
) -> tuple[Contract, ...]:  # fmt: skip
    """Waits for another object, crosses its way when that comes, and goes on once it has passed."""
    if not isinstance(reference_actor, Instance) or not reference_actor.oriented:
        raise motion.wrong(reference_actor, "`reference_actor` is an object")
    span = motion.span
    least, near = motion.number(min_speed, "min_speed"), motion.number(threshold, "threshold")
    final = least if not final_speed else motion.number(final_speed, "final_speed")
    away = operators.distance_to(motion.agent, reference_actor, span)
    line = build.vector_difference(motion.place, to_vector(reference_actor, span), span)
    back = build.arithmetic(ArithmeticOp.NEG, to_heading(reference_actor, span), span=span)
    seen = build.rotate(line, back, span)
    right, ahead = (build.coordinate(seen, axis, span) for axis in (0, 1))
    # as fast as it must be to be on the other's way together with it
    per_second = build.arithmetic(
        ArithmeticOp.DIV, cast(Node, property_node(reference_actor, "speed", span)), ahead, span=span
    )
    in_time = build.arithmetic(ArithmeticOp.MUL, right, per_second, span=span)
    margin = _bound("set speed")
    walks = _both(
        _either(motion.at_least(least, margin), motion.gains()),
        _either(motion.at_most(least, margin), motion.at_most(in_time, margin), motion.loses()),
        motion.walks_ahead(),
    )
    return (
        Contract(motion.name, over=motion.compare(CompareOp.LE, away, near)),
        Contract(motion.name, walks, over=motion.compare(CompareOp.LT, ahead, 0.0)),
        _sent(motion, _both(motion.has_speed(final), motion.walks_ahead())),
    )


def _sent(motion: _Motion, shows: Node | None = None) -> Contract:
    """Takes an action once, and is over."""
    return Contract(motion.name, shows, over=build.constant(True), least_steps=1, remains=shows is not None)


def _walk_forward(motion: _Motion, speed: ModelValue = 0.5) -> Contract:
    return _sent(motion, _both(motion.has_speed(motion.number(speed, "speed")), motion.walks_ahead()))


def _walk(motion: _Motion, maxSpeed: ModelValue = 1.4) -> Contract:
    return _sent(motion, _set_walk(motion, True, maxSpeed).shows)


def _constant_throttle(motion: _Motion, x: ModelValue) -> Contract:
    motion.number(x, "x", 0.0, 1.0)
    return _sent(motion)


def _accelerate_forward(motion: _Motion) -> Contract:
    return _sent(motion)


def _use_autopilot(motion: _Motion, enabled: ModelValue = True, **options: ModelValue) -> Contract:
    _autopilot(motion, enabled)
    return _sent(motion)


_BEHAVIORS: Mapping[str, Callable[..., Contract | tuple[Contract, ...]]] = {
    # all of Scenic's driving simulators
    "ConstantThrottleBehavior": _constant_throttle,
    "DriveAvoidingCollisions": _drive_avoiding_collisions,
    "AccelerateForwardBehavior": _accelerate_forward,
    "WalkForwardBehavior": _walk_forward,
    "FollowLaneBehavior": _follow_lane,
    "FollowTrajectoryBehavior": _follow_trajectory,
    "TurnBehavior": _turn,
    "LaneChangeBehavior": _change_lane,
    # CARLA's
    "AutopilotBehavior": _use_autopilot,
    "WalkBehavior": _walk,
    "CrossingBehavior": _crossing,
    # LGSVL's
    "DriveTo": _any("target"),
    "FollowWaypoints": _any("waypoints"),
}
BEHAVIORS = frozenset(_BEHAVIORS)
"""The behaviors of Scenic's libraries for driving."""
