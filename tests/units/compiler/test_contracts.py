"""Contracts are what the table says, in three truth values: a second reading of it, in plain NumPy and Shapely.

Tracks are random: they begin on lanes of the sample's crossing and go their way, faster and slower, turned and shifted,
and of some samples speeds, headings, accelerations or places are missing.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from scenicq.compiler.contract_bounds import BOUNDS
from scenicq.compiler.contracts import ACTIONS, BEHAVIORS, action_contract, behavior_contract
from scenicq.compiler.environment import Environment
from scenicq.compiler.imports import Modules
from scenicq.compiler.temporal import TimedStatements
from scenicq.errors import ScenarioError, Source, Span
from scenicq.forest import build
from scenicq.forest.nodes import Feature
from scenicq.geometry.network import Network
from scenicq.importers.base import read_maps
from scenicq.importers.report import Report
from scenicq.syntax.parser import parse
from scenicq.temporal.atoms import AtomColumns

MAP = next((Path(__file__).parents[3] / "sample_data" / "crossroads" / "maps").iterdir())
FEATURES = json.loads(MAP.read_text(encoding="utf-8"))["features"]
EGO, OTHER, WALKER = 0, 1, 2
PROGRAM = """
model scenic.domains.driving.model
ego = new Car at (1, 1)
other = new Car at (2, 2)
walker = new Pedestrian at (3, 3)
lanes = {each.uid: each for each in network.lanes}
sections = {each.uid: each.sections[0] for each in network.lanes}
"""


@cache
def network() -> Network:
    return Network("crossroads", read_maps({"crossroads": MAP}, Report())["crossroads"])


@cache
def program():
    source = Source("contract.scenic", PROGRAM)
    world = Modules(network(), 3, False, None, map_defaults=True)
    run = world.interpreter
    run.timed, run.gap_s = TimedStatements("ignore"), 1.5
    scope = Environment({}, Environment({}, world.base, library=True), user=True)
    run.run(parse(source, 3).body, scope)
    return run, scope.names, Span(source, 0, 5)


def contracts(name: str, agent: int, *args, **named):
    run, _, span = program()
    make = action_contract if name in ACTIONS else behavior_contract
    made = make(run, name, run.objects[agent], args, named, span)
    return made if isinstance(made, tuple) else (made,)


def lane(name: str):
    return program()[1]["lanes"][name]


# --- tracks


class Tracks:
    """Three objects that move side by side for so many samples."""

    def __init__(self, seed: int, count: int = 120) -> None:
        rng = np.random.default_rng(seed)
        self.count, self.columns = count, {}
        starts = [each for each in FEATURES if each["properties"]["kind"] == "lane"]
        for index in (EGO, OTHER, WALKER):
            places, headings = [], []
            while len(places) < count:
                line = np.array(starts[rng.integers(len(starts))]["properties"]["centerline"][0], dtype=float)
                along = line[-1] - line[0]
                heading = math.atan2(-along[0], along[1]) + rng.normal(0, 0.3)
                place = line[0] + along * rng.uniform(0, 1)
                for _ in range(20):
                    heading += rng.normal(0, 0.05)
                    place = place + rng.uniform(0, 4) * np.array([-math.sin(heading), math.cos(heading)])
                    places.append(place + rng.normal(0, 1.0, 2))
                    headings.append(heading + (math.pi if rng.random() < 0.1 else 0.0))
            x, y = np.array(places[:count]).T
            heading = np.remainder(np.array(headings[:count]) + math.pi, math.tau) - math.pi
            speed = np.abs(rng.choice([0.2, 1.5, 4.5, 5.2, 9.5, 11.8, 14.0], count) + rng.normal(0, 0.4, count))
            acceleration = rng.choice([0.0, 1.0, -1.0], count) * rng.uniform(0, 1, count)
            course = heading + rng.choice([0.0, 0.4, 0.7, math.pi], count)
            moves = speed * -np.sin(course), speed * np.cos(course)
            self.columns[index] = {"position": (x, y), "heading": (heading,), "speed": (speed,),
                                   "acceleration": (acceleration,), "velocity": moves,
                                   "width": (np.full(count, 2.0),), "length": (np.full(count, 4.0),)}  # fmt: skip
            for name in ("position", "heading", "speed", "acceleration"):
                gone = rng.random(count) < 0.08
                for column in self.columns[index][name]:
                    column[gone] = np.nan
            unmoved = np.isnan(speed)
            for column in moves:
                column[unmoved] = np.nan

    def __len__(self) -> int:
        return self.count

    def observed(self, index: int, name: str):
        return self.columns[index].get(name)


# --- the second reading; a truth value is 1, 0, or 0.5 where it is not known

Truth = Any


def both(*values: Truth) -> Truth:
    return np.minimum.reduce(np.broadcast_arrays(*values))


def either(*values: Truth) -> Truth:
    return np.maximum.reduce(np.broadcast_arrays(*values))


def at_most(a: Any, b: Any) -> Truth:
    a, b = np.broadcast_arrays(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
    return np.where(np.isnan(a) | np.isnan(b), 0.5, (a <= b).astype(float))


def wrapped(angle: Any) -> Any:
    return np.abs(np.arctan2(np.sin(angle), np.cos(angle)))


def areas(*kinds: str, ids: tuple[str, ...] | None = None):
    return shapely.union_all([
        shapely.geometry.shape(each["geometry"]) for each in FEATURES
        if each["properties"]["kind"] in kinds and (ids is None or each["properties"]["id"] in ids)
    ])  # fmt: skip


JUNCTION = areas("intersection")
DRIVABLE = areas("lane", "road", "lane_group", "intersection")
STRAIGHT = {
    "west-in-0": "east-out-0", "west-in-1": "east-out-1", "east-in-0": "west-out-0", "east-in-1": "west-out-1",
    "north-in-0": "south-out-0", "south-in-0": "north-out-0",
}  # fmt: skip


def course(name: str):
    """Where a lane leads to, straight on at the crossing."""
    if name in STRAIGHT:
        on = (name, f"{name}>{STRAIGHT[name]}", STRAIGHT[name])
        return areas("lane", ids=on) | JUNCTION
    if ">" in name:
        return areas("lane", ids=(name, name.partition(">")[2])) | JUNCTION
    return areas("lane", ids=(name,))


class Seen:
    """One object at all samples."""

    def __init__(self, tracks: Tracks, index: int) -> None:
        columns = tracks.columns[index]
        self.x, self.y = columns["position"]
        (self.heading,), (self.speed,), (self.acceleration,) = (
            columns[name] for name in ("heading", "speed", "acceleration")
        )
        self.vx, self.vy = columns["velocity"]

    def away(self, area: Any) -> Any:
        there = ~np.isnan(self.x)
        found = np.full(len(self.x), np.nan)
        found[there] = shapely.distance(area, shapely.points(self.x[there], self.y[there]))
        return found

    def in_junction(self) -> Truth:
        return at_most(self.away(JUNCTION), 1e-9)

    def along_road(self) -> Truth:
        lanes = [
            each for each in FEATURES if each["properties"]["kind"] == "lane" and ">" not in each["properties"]["id"]
        ]
        shapes = [shapely.geometry.shape(each["geometry"]) for each in lanes]
        found = np.full(len(self.x), 0.5)
        for n in np.flatnonzero(~np.isnan(self.x)):
            far = [shape.distance(shapely.Point(self.x[n], self.y[n])) for shape in shapes]
            nearest = int(np.argmin(far))
            line = np.array(lanes[nearest]["properties"]["centerline"][0], dtype=float)
            way = math.atan2(-(line[-1] - line[0])[0], (line[-1] - line[0])[1])
            if far[nearest] > 20.0:
                found[n] = 0.0
            elif not math.isnan(self.heading[n]):
                found[n] = float(wrapped(self.heading[n] - way) <= math.radians(30))
        return either(found, self.in_junction())

    def fast_enough(self, target: float) -> Truth:
        return at_most(min(target - 1.0, 0.85 * target), self.speed)

    def slow_enough(self, target: float) -> Truth:
        return at_most(self.speed, max(target + 1.0, 1.15 * target))

    def approaches(self, target: float, where: Truth = 0.0, other: float = 0.0) -> Truth:
        gains, loses = at_most(0.3, self.acceleration), at_most(self.acceleration, -0.3)
        held = both(at_most(self.speed, target + 3.0), self.brakes())
        slow = either(self.fast_enough(target), gains, both(where, self.fast_enough(other)))
        return both(slow, either(self.slow_enough(target), loses, both(where, self.slow_enough(other)), held))

    def rests(self) -> Truth:
        return at_most(self.speed, np.nextafter(0.5, 0))

    def brakes(self) -> Truth:
        return either(at_most(self.acceleration, 0.2), self.rests())

    def has_speed(self, speed: float) -> Truth:
        return both(
            at_most(min(speed - 0.5, 0.85 * speed), self.speed), at_most(self.speed, max(speed + 0.5, 1.15 * speed))
        )

    def moves(self) -> Any:
        return np.arctan2(-self.vx, self.vy)

    def ahead(self) -> Truth:
        return either(at_most(wrapped(self.moves() - self.heading), math.radians(30)), self.rests())

    def follows(self, target: float) -> Truth:
        near = at_most(self.away(JUNCTION), 10.0)
        return both(self.along_road(), self.approaches(target, near, 5.0), at_most(self.away(DRIVABLE), 1.0))


def trajectory(seen: Seen, names: tuple[str, ...]) -> Truth:
    return at_most(seen.away(areas("lane", ids=names) | JUNCTION), 1.0)


def crosses(seen: Seen, other: Seen) -> Truth:
    right = (seen.x - other.x) * np.cos(other.heading) + (seen.y - other.y) * np.sin(other.heading)
    ahead = -(seen.x - other.x) * np.sin(other.heading) + (seen.y - other.y) * np.cos(other.heading)
    in_time = right * other.speed / ahead
    fast = either(at_most(min(1.0 - 0.5, 0.85), seen.speed), at_most(0.3, seen.acceleration))
    most = np.where(np.isnan(in_time), np.nan, np.maximum(in_time + 0.5, 1.15 * in_time))
    slow = either(at_most(seen.speed, 1.5), at_most(seen.speed, most), at_most(seen.acceleration, -0.3))
    return both(fast, slow, seen.ahead())


def distance(one: Seen, other: Seen) -> Any:
    return np.hypot(one.x - other.x, one.y - other.y)


def velocity_is(seen: Seen, vx: Any, vy: Any) -> Truth:
    return at_most(np.hypot(seen.vx - vx, seen.vy - vy), np.maximum(0.5, 0.15 * np.hypot(vx, vy)))


Row = tuple[str, int, tuple[Any, ...], dict[str, Any], int, Callable[..., Truth]]
GOES = ("west-in-0", "west-in-0>north-out-0", "north-out-0")


def rows() -> list[Row]:
    """The action or behavior, who does it, its arguments, the phase, and what the table says of it."""
    ego, other = program()[0].objects[:2]
    goes = [lane(name) for name in GOES]
    return [
        ("FollowLaneBehavior", EGO, (10,), {}, 0, lambda e, o, w: e.follows(10)),
        ("FollowLaneBehavior", EGO, (), {"target_speed": 5}, 0, lambda e, o, w: e.follows(5)),
        ("FollowLaneBehavior", EGO, (10, lane("west-in-0")), {}, 0, lambda e, o, w: both(
            e.along_road(), e.approaches(10, at_most(e.away(JUNCTION), 10.0), 5.0),
            at_most(e.away(course("west-in-0")), 1.0),
        )),
        ("FollowTrajectoryBehavior", EGO, (10, goes), {}, 0, lambda e, o, w: both(
            trajectory(e, GOES), e.along_road(), e.approaches(10, at_most(e.away(JUNCTION), 1.0), 5.0)
        )),
        ("FollowTrajectoryBehavior", EGO, (10, goes), {"turn_speed": 4}, 0, lambda e, o, w: both(
            trajectory(e, GOES), e.along_road(), e.approaches(10, at_most(e.away(JUNCTION), 1.0), 4.0)
        )),
        ("TurnBehavior", EGO, (goes,), {}, 0, lambda e, o, w: both(trajectory(e, GOES), e.approaches(6))),
        ("LaneChangeBehavior", EGO, (program()[1]["sections"]["west-in-1"],), {}, 0, lambda e, o, w: both(
            at_most(e.away(DRIVABLE), 1.0), e.approaches(10)
        )),
        ("DriveAvoidingCollisions", EGO, (10, 60), {}, 0, lambda e, o, w: either(
            e.follows(10), both(at_most(distance(e, o), 60.0), e.brakes())
        )),
        ("CrossingBehavior", WALKER, (ego,), {}, 1, lambda e, o, w: crosses(w, e)),
        ("CrossingBehavior", WALKER, (ego, 1, 9, 4.5), {}, 2, lambda e, o, w: both(w.has_speed(4.5), w.ahead())),
        ("WalkForwardBehavior", WALKER, (1.5,), {}, 0, lambda e, o, w: both(w.has_speed(1.5), w.ahead())),
        ("WalkBehavior", WALKER, (), {}, 0, lambda e, o, w: at_most(w.speed, 1.9)),
        ("SetBrakeAction", EGO, (0.5,), {}, 0, lambda e, o, w: e.brakes()),
        ("SetSpeedAction", EGO, (5,), {}, 0, lambda e, o, w: e.has_speed(5)),
        ("SetWalkingSpeedAction", WALKER, (1.4,), {}, 0, lambda e, o, w: w.has_speed(1.4)),
        ("SetVelocityAction", EGO, (-3, 4), {}, 0, lambda e, o, w: velocity_is(e, -3.0, 4.0)),
        ("OffsetAction", EGO, ((0, 0.5),), {}, 0, lambda e, o, w: either(
            velocity_is(e, -5 * np.sin(e.heading), 5 * np.cos(e.heading)), e.rests()
        )),
        ("SetPositionAction", EGO, (other,), {}, 0, lambda e, o, w: at_most(distance(e, o), 0.5)),
        ("SetTransformAction", EGO, ((20, 0), 1), {}, 0, lambda e, o, w: both(
            at_most(np.hypot(e.x - 20, e.y), 0.5), at_most(wrapped(e.heading - 1), math.radians(30))
        )),
        ("SetReverseAction", EGO, (True,), {}, 0, lambda e, o, w: either(
            at_most(-e.vx * np.sin(e.heading) + e.vy * np.cos(e.heading), 0.5), e.rests()
        )),
        ("SetWalkingDirectionAction", WALKER, (1,), {}, 0, lambda e, o, w: either(
            at_most(wrapped(w.heading - 1), math.radians(30)), at_most(wrapped(w.moves() - 1), math.radians(30)),
            w.rests(),
        )),
        ("SetWalkAction", WALKER, (True, 4), {}, 0, lambda e, o, w: at_most(w.speed, 4.6)),
        ("SetWalkAction", WALKER, (False,), {}, 0, lambda e, o, w: w.rests()),
    ]  # fmt: skip


NAMES = [f"{n}-{row[0]}" for n, row in enumerate(rows())]
RARE = {"SetPositionAction", "SetTransformAction", "SetVelocityAction"}
"""What random tracks do not show."""


def differences(condition: Any, tracks: Tracks, wanted: Callable[..., Truth], agent: int) -> list[int]:
    """Samples at which production and the second reading differ.

    Where a speed is not observed, production may know what holds for every speed.
    """
    found = AtomColumns(None, tracks).truth_of(condition) / 2
    seen = [Seen(tracks, index) for index in (EGO, OTHER, WALKER)]
    expected = wanted(*seen)
    different = found != expected
    whole = seen[agent].speed
    agreed = np.isnan(whole) & (expected == 0.5)
    for speed in (0.0, 0.4, 1.0, 3.0, 5.0, 8.0, 10.0, 12.0, 14.0, 40.0) if different.any() else ():
        seen[agent].speed = np.where(np.isnan(whole), speed, whole)
        agreed &= wanted(*seen) == found
    different &= ~agreed
    return np.flatnonzero(different).tolist()


@pytest.mark.parametrize("number", range(len(NAMES)), ids=NAMES)
@pytest.mark.one_in(3)
def test_shows_what_the_table_says(number):
    name, agent, args, named, phase, wanted = rows()[number]
    condition = contracts(name, agent, *args, **named)[phase].shows
    held: set[float] = set()
    for seed in range(3):
        tracks = Tracks(seed)
        assert differences(condition, tracks, wanted, agent) == []
        held |= set((AtomColumns(None, tracks).truth_of(condition) / 2).tolist())
    assert held >= ({0.0, 0.5} if name in RARE else {0.0, 0.5, 1.0})


@pytest.mark.parametrize("name", ["FollowLaneBehavior", "LaneChangeBehavior"])
@pytest.mark.one_in(2)
def test_lane_of_entry_is_kept(name):
    args = (10,) if name == "FollowLaneBehavior" else (program()[1]["sections"]["west-in-1"],)
    (contract,) = contracts(name, EGO, *args)
    held: set[float] = set()
    for seed in range(3):
        tracks = Tracks(seed)
        seen = Seen(tracks, EGO)
        for start in np.flatnonzero(~np.isnan(seen.x))[::9]:
            here = shapely.Point(seen.x[start], seen.y[start])
            inside = [
                each["properties"]["id"] for each in FEATURES
                if each["properties"]["kind"] == "lane" and shapely.geometry.shape(each["geometry"]).covers(here)
            ]  # fmt: skip
            # lanes reach as far as the tolerance of the map: not near their borders
            if not inside and seen.away(DRIVABLE)[start] < 2:
                continue
            expected = (
                either(*(at_most(seen.away(course(each)), 1.0) for each in inside))
                if inside
                else at_most(seen.away(DRIVABLE), 1e9)
            )
            if name == "LaneChangeBehavior":
                expected = either(expected, at_most(seen.away(course("west-in-1")), 1.0))
            first = np.full(len(tracks), start)
            then = Feature(EGO, "position", "vector", current=False)
            for place in (then, build.constant((float(here.x), float(here.y)))):
                condition = contract.shows_from(place)
                found = AtomColumns(None, tracks, start=first).truth_of(condition) / 2
                assert (found == expected).all()
                held |= set(found.tolist())
    assert held == {0.0, 0.5, 1.0}


def test_unobserved_entry_leaves_the_lane_open():
    tracks = Tracks(1)
    (contract,) = contracts("FollowLaneBehavior", EGO, 10)
    start = int(np.flatnonzero(np.isnan(tracks.columns[EGO]["position"][0]))[0])
    condition = contract.shows_from(Feature(EGO, "position", "vector", current=False))
    found = AtomColumns(None, tracks, start=np.full(len(tracks), start)).truth_of(condition)
    assert not (found == 0).any()


# --- when behaviors are over


def over(contract: Any, tracks: Tracks) -> Truth:
    return AtomColumns(None, tracks).truth_of(contract.over) / 2


@pytest.mark.parametrize("seed", range(3))
def test_behaviors_are_over_where_scenic_says(seed):
    tracks = Tracks(seed)
    ego, other, walker = (Seen(tracks, index) for index in (EGO, OTHER, WALKER))
    del other
    waits, walks, then = contracts("CrossingBehavior", WALKER, program()[0].objects[0], threshold=40)
    assert (over(waits, tracks) == at_most(distance(ego, walker), 40.0)).all()
    ahead = -(walker.x - ego.x) * np.sin(ego.heading) + (walker.y - ego.y) * np.cos(ego.heading)
    assert (over(walks, tracks) == at_most(ahead, -1e-12)).all()
    assert waits.shows is None
    assert then.least_steps == 1
    assert then.remains
    (goes,) = contracts("FollowTrajectoryBehavior", EGO, 10, [lane("west-in-0")])
    assert (over(goes, tracks) == at_most(ego.away(JUNCTION), 5.0 - 1e-12)).all()
    (changes,) = contracts("LaneChangeBehavior", EGO, program()[1]["sections"]["west-in-1"])
    middle = shapely.LineString(
        next(each for each in FEATURES if each["properties"]["id"] == "west-in-1")["properties"]["centerline"][0]
    )
    assert (over(changes, tracks) == at_most(ego.away(middle), 0.5)).all()
    (follows,) = contracts("FollowLaneBehavior", EGO)
    out = [each for each in FEATURES if each["properties"]["kind"] == "lane" and "-out-" in each["properties"]["id"]]
    out = [each for each in out if ">" not in each["properties"]["id"]]
    ends = shapely.MultiPoint([each["properties"]["centerline"][0][-1] for each in out])
    inside = at_most(ego.away(shapely.union_all([shapely.geometry.shape(each["geometry"]) for each in out])), 1e-9)
    assert (over(follows, tracks) == both(inside, at_most(ego.away(ends), 10.0))).all()
    (turns,) = contracts("TurnBehavior", EGO, [lane("west-in-0")])
    known = ~np.isnan(ego.x) & ~np.isnan(ego.heading)
    boxes = [
        shapely.affinity.translate(
            shapely.affinity.rotate(shapely.box(-1, -2, 1, 2), h, (0, 0), use_radians=True), x, y
        )
        for h, x, y in zip(ego.heading[known], ego.x[known], ego.y[known], strict=True)
    ]
    assert (over(turns, tracks)[known] == [float(not JUNCTION.covers(box)) for box in boxes]).all()
    assert (over(turns, tracks)[~known] == 0.5).all()


def test_windows():
    goes = [lane(name) for name in GOES]
    kept = [("FollowLaneBehavior", (10,)), ("FollowLaneBehavior", (10, lane("west-in-0"))),
            ("FollowTrajectoryBehavior", (10, goes)), ("DriveAvoidingCollisions", ()),
            ("LaneChangeBehavior", (program()[1]["sections"]["west-in-1"],))]  # fmt: skip
    assert {contracts(name, EGO, *args)[0].settles_s for name, args in kept} == {2.0}
    assert contracts("SetBrakeAction", EGO, 1)[0].settles_s == 1.0


# --- names and arguments

SCENIC = {
    "domains/driving/actions.py":
        "SetPositionAction OffsetAction SetVelocityAction SetSpeedAction SteeringAction SetThrottleAction "
        "SetSteerAction SetBrakeAction SetHandBrakeAction SetReverseAction RegulatedControlAction WalkingAction "
        "SetWalkingDirectionAction SetWalkingSpeedAction",
    "simulators/carla/actions.py":
        "SetLocationAction SetAngularVelocityAction SetTransformAction VehicleAction SetManualGearShiftAction "
        "SetGearAction SetManualFirstGearShiftAction SetTrafficLightAction SetAutopilotAction "
        "SetVehicleLightStateAction PedestrianAction SetJumpAction SetWalkAction TrackWaypointsAction",
    "simulators/lgsvl/actions.py":
        "FollowWaypointsAction CancelWaypointsAction SetDestinationAction TrackWaypointsAction",
    "domains/driving/behaviors.scenic":
        "ConstantThrottleBehavior DriveAvoidingCollisions AccelerateForwardBehavior WalkForwardBehavior "
        "FollowLaneBehavior FollowTrajectoryBehavior TurnBehavior LaneChangeBehavior",
    "simulators/carla/behaviors.scenic": "AutopilotBehavior WalkForwardBehavior WalkBehavior CrossingBehavior",
    "simulators/lgsvl/behaviors.scenic": "DriveTo WalkBehavior FollowWaypoints",
}  # fmt: skip
"""The names of Scenic 3.1.1's driving libraries, by their files; MetaDrive's and the Newtonian simulator add none."""
ABSTRACT = {"SteeringAction", "WalkingAction", "VehicleAction", "PedestrianAction"}


def test_all_names_of_scenic_are_known():
    names = {file: set(text.split()) for file, text in SCENIC.items()}
    actions = {name for file, found in names.items() if file.endswith(".py") for name in found}
    behaviors = {name for file, found in names.items() if file.endswith(".scenic") for name in found}
    assert actions - ABSTRACT == ACTIONS
    assert behaviors == BEHAVIORS


NOTHING: dict[str, tuple[Any, ...]] = {
    "SetThrottleAction": (0.5,), "SetSteerAction": (-1,), "SetHandBrakeAction": (True,), "SetReverseAction": (False,),
    "RegulatedControlAction": (0.1, 0.2, 0.3), "SetAngularVelocityAction": (1,), "SetManualGearShiftAction": (True,),
    "SetGearAction": (1,), "SetManualFirstGearShiftAction": (), "SetTrafficLightAction": ("green",),
    "SetAutopilotAction": (True,), "SetVehicleLightStateAction": (0,), "SetJumpAction": (True,),
    "TrackWaypointsAction": ([],), "FollowWaypointsAction": ([],), "CancelWaypointsAction": (),
    "SetDestinationAction": ((1, 2),), "SetBrakeAction": (0,), "ConstantThrottleBehavior": (0.5,),
    "AccelerateForwardBehavior": (), "AutopilotBehavior": (), "DriveTo": ((1, 2),), "FollowWaypoints": ([],),
}  # fmt: skip


def test_what_shows_nothing():
    """Every name either stands in the table above or constrains nothing."""
    for name, args in NOTHING.items():
        assert all(each.shows is None for each in contracts(name, EGO, *args))
    shown = {row[0] for row in rows()} | {"SetLocationAction"}
    assert shown | set(NOTHING) == ACTIONS | BEHAVIORS


@pytest.mark.parametrize(
    ("name", "args", "named", "code"),
    [
        ("SetBrakeAction", (), {}, "wrong-arity"),
        ("SetBrakeAction", (1, 2), {}, "wrong-arity"),
        ("SetBrakeAction", (2,), {}, "wrong-value"),
        ("SetBrakeAction", ("much",), {}, "wrong-type"),
        ("SetBrakeAction", (None,), {}, "wrong-type"),
        ("SetThrottleAction", (-0.1,), {}, "wrong-value"),
        ("SetThrottleAction", (), {"brake": 1}, "wrong-arity"),
        ("SetReverseAction", (1,), {}, "wrong-type"),
        ("SetVelocityAction", ((1, 2),), {}, "wrong-arity"),
        ("SetSpeedAction", ((1, 2),), {}, "wrong-type"),
        ("SetPositionAction", (5,), {}, "wrong-type"),
        ("SetManualFirstGearShiftAction", (1,), {}, "wrong-arity"),
        ("SetWalkAction", ("yes",), {}, "wrong-type"),
        ("SetAutopilotAction", (), {}, "wrong-arity"),
        ("FollowLaneBehavior", (10,), {"speed": 3}, "wrong-arity"),
        ("FollowLaneBehavior", ("fast",), {}, "wrong-type"),
        ("FollowLaneBehavior", (10, 3), {}, "wrong-type"),
        ("FollowTrajectoryBehavior", (10,), {}, "wrong-type"),
        ("FollowTrajectoryBehavior", (10, [1]), {}, "wrong-type"),
        ("TurnBehavior", (), {}, "wrong-arity"),
        ("LaneChangeBehavior", (), {}, "wrong-arity"),
        ("LaneChangeBehavior", (1,), {}, "wrong-type"),
        ("CrossingBehavior", (1,), {}, "wrong-type"),
        ("WalkForwardBehavior", (1, 2), {}, "wrong-arity"),
    ],
)
def test_wrong_arguments(name, args, named, code):
    with pytest.raises(ScenarioError) as caught:
        contracts(name, EGO, *args, **named)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == code
    assert name in diagnostic.message or "needed here" in diagnostic.message
    assert diagnostic.span is not None


def test_unknown_names_are_left_to_the_caller():
    run, _, span = program()
    assert action_contract(run, "HonkAction", run.objects[0], (), {}, span) is None
    assert action_contract(run, "FollowLaneBehavior", run.objects[0], (), {}, span) is None
    assert behavior_contract(run, "SetBrakeAction", run.objects[0], (1,), {}, span) is None


def test_page_has_the_bounds():
    page = Path(__file__).parents[2] / "language" / "contracts.md"
    rows = [line for line in page.read_text(encoding="utf-8").split("## Bounds")[1].splitlines() if line[:2] == "| "]
    expected = [
        f"| {name} | {each.value:g} {each.unit} | {each.meaning} | {each.evidence} |" for name, each in BOUNDS.items()
    ]
    assert rows[1:] == expected
    assert all(each.evidence and each.meaning for each in BOUNDS.values())
