"""An object's own lanes by their definition, sharing no code: polygons of shapely and centrelines in NumPy.

The lanes of an object are those that contain it and whose direction there is within 60 degrees of its heading, or that
continue the last lane of its track; where there is none, or no heading, all are. The last lane is the one that was its
only one when it last had a single one, within 1.5 s; one that leads across its heading and continues nothing is none. A
lane continues itself and those that lead to it. What is expected of a program is told by going through who plays whom
and which of its lanes each object is in.
"""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely

from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.geometry.elements import Lane
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

STREET = street()
AREAS = [(lane, lane.polygon, np.array(lane.centerline.lines[0].coords)) for lane in STREET.lanes]
CROSSING = [lane for lane in STREET.lanes if lane.road is not None and lane.road.intersection is not None]
CLEAR_M, CLEAR_RAD = 0.06, 1e-4
"""How far places are from edges (beyond the map's own tolerance), and directions from 60 degrees off: rounding and
tolerances are judged elsewhere."""


def turn(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))


def direction(line: np.ndarray, x: float, y: float) -> float | None:
    """The heading of the nearest segment of a line; None where two are as near and differ."""
    start, step = line[:-1], line[1:] - line[:-1]
    place = np.array([x, y])
    share = np.clip(((place - start) * step).sum(1) / (step**2).sum(1), 0, 1)
    away = np.hypot(*(start + share[:, None] * step - place).T)
    nearest = np.flatnonzero(away <= away.min() + 1e-6)
    headings = [math.atan2(-step[each][0], step[each][1]) for each in nearest]
    return headings[0] if all(turn(headings[0], each) < 1e-6 for each in headings) else None


@cache
def around(x: float, y: float) -> tuple[tuple[Lane, float], ...] | None:
    """The lanes that contain a place, with their directions; None where it is close to an edge, or between segments."""
    place, found = shapely.Point(x, y), list[tuple[Lane, float]]()
    for lane, area, line in AREAS:
        if area.boundary.distance(place) < CLEAR_M:
            return None
        if area.contains(place):
            way = direction(line, x, y)
            if way is None:
                return None
            found.append((lane, way))
    return tuple(found)


LAST: dict[int, tuple[LabelObject, Lane | None]] = {}
"""The last lanes of the tracks of label objects, before they come there, by their `id`."""


def meant_lanes(thing: LabelObject, last: Lane | None) -> list[Lane]:
    """The lanes that contain it and lead its way, or go on from the last."""
    near = around(thing.x, thing.y)
    assert near is not None
    leading = [] if last is None else [last, *last.successors]
    return [
        lane
        for lane, way in near
        if (thing.heading is not None and turn(way, thing.heading) <= math.radians(60)) or lane in leading
    ]


def own_lanes(thing: LabelObject, rule: str) -> list[Lane]:
    meant = meant_lanes(thing, LAST[id(thing)][1] if id(thing) in LAST else None)
    everything = [lane for lane, _ in around(thing.x, thing.y) or ()]
    return everything if rule == "any" or not meant or thing.heading is None else meant


class Passage:
    """The last lanes of tracks, label by label."""

    def __init__(self) -> None:
        self.seen: dict[str, tuple[int, Lane | None]] = {}

    def before(self, track: str, time_us: int) -> Lane | None:
        when, last = self.seen.get(track, (0, None))
        return last if time_us - when <= 1_500_000 else None

    def pass_on(self, thing: LabelObject, time_us: int) -> None:
        track = thing.track or thing.id
        last = self.before(track, time_us)
        LAST[id(thing)] = thing, last
        there, meant = own_lanes(thing, "any"), meant_lanes(thing, last)
        if len(own_lanes(thing, "along")) == 1 and (thing.heading is None or meant):
            last = own_lanes(thing, "along")[0]
        elif len(there) == 1:
            last = None
        self.seen[track] = time_us, last


def is_clear(thing: LabelObject) -> bool:
    near = around(thing.x, thing.y)
    return near is not None and (
        thing.heading is None or all(abs(turn(way, thing.heading) - math.radians(60)) > CLEAR_RAD for _, way in near)
    )


Chosen = dict[str, tuple[LabelObject, Lane | None]]
"""Who plays each role, and which of its lanes it is in."""


@dataclass(frozen=True)
class Said:
    """A condition, as text and as what it says."""

    text: str
    holds: Callable[[Chosen], bool]


def said(draw: random.Random, roles: list[str], depth: int = 1) -> Said:
    a, b = draw.sample(roles, 2) if len(roles) > 1 else (roles[0], roles[0])
    limit = draw.choice([0.5, 2.2, 4.1])

    def inside(c: Chosen) -> bool:
        (thing, _), (_, lane) = c[a], c[b]
        return lane is not None and lane.polygon.covers(shapely.Point(thing.x, thing.y))

    def near(c: Chosen) -> bool:
        (thing, _), (_, lane) = c[a], c[b]
        return lane is not None and lane.polygon.distance(shapely.Point(thing.x, thing.y)) < limit

    def same(of: Callable[[Lane], object]) -> Callable[[Chosen], bool]:
        return lambda c: c[a][1] is not None and c[b][1] is not None and of(c[a][1]) is of(c[b][1])

    match draw.choice(["lane", "lane", "other", "group", "road", "section", "in", "in", "near", "none", "not", "or"]):
        case "lane":
            return Said(f"{a}.lane is {b}.lane", same(lambda lane: lane))
        case "other":
            return Said(f"{a}.lane is not {b}._lane", lambda c: c[a][1] is not None and c[a][1] is not c[b][1])
        case "group":
            return Said(f"{a}.laneGroup is {b}.laneGroup", same(lambda lane: lane.group))
        case "road":
            return Said(f"{a}.road is {b}.road", same(lambda lane: lane.road))
        case "section":
            return Said(f"{a}.laneSection.lane is {b}.lane", same(lambda lane: lane))
        case "in":
            return Said(f"{a}.position in {b}.lane", inside)
        case "near":
            return Said(f"(distance from {a} to {b}.lane) < {limit}", near)
        case "none":
            return Said(f"{a}._lane is None", lambda c: c[a][1] is None)
        case "not" if depth:
            # without a lane, what asks for one has no value, nor has its negation
            inner = draw.choice([Said(f"{a}._lane is {b}._lane", lambda c: c[a][1] is c[b][1])])
            return Said(f"not ({inner.text})", lambda c: not inner.holds(c))
        case _:
            one, other = (
                Said(f"{x}._lane is network.elements['{lane.id}']", lambda c, x=x, lane=lane: c[x][1] is lane)
                for x, lane in ((a, draw.choice(STREET.lanes)), (b, draw.choice(STREET.lanes)))
            )
            return Said(f"({one.text}) or ({other.text})", lambda c: one.holds(c) or other.holds(c))


ANYWHERE = "in everywhere, facing Range(-180, 180) deg"


def program(draw: random.Random) -> tuple[str, list[str], list[Said]]:
    roles = ["ego", "a", "b"][: draw.choice([2, 2, 3])]
    asked = [said(draw, roles) for _ in range(draw.choice([0, 1, 1, 1, 2]))]
    placed: list[str] = [f"ego = new Car {ANYWHERE}"]
    for role in roles[1:]:
        where = draw.choice(["", "", "ego.lane", "ego.laneGroup", "ego.road"])
        placed.append(f"{role} = new Car {f'in {where}, facing Range(-180, 180) deg' if where else ANYWHERE}")
        if where:
            asked.append(placed_in(role, where))
    lines = [f"require {each.text}" for each in asked if each.text]
    return "\n".join(["model scenic.domains.driving.model", *placed, *lines, ""]), roles, asked


def placed_in(role: str, where: str) -> Said:
    def holds(c: Chosen) -> bool:
        thing, lane = c[role][0], c["ego"][1]
        if lane is None:
            return False
        owner = {"ego.lane": lane, "ego.laneGroup": lane.group, "ego.road": lane.road}[where]
        return owner is not None and owner.polygon.covers(shapely.Point(thing.x, thing.y))

    return Said("", holds)


def thing(draw: random.Random, name: str, last: Lane | None = None, *, one: bool = False) -> LabelObject:
    """A car where lanes overlap, along one of them, across, or without a heading; with one own lane if asked."""
    while True:
        lane = draw.choice(CROSSING if draw.random() < 0.9 else STREET.lanes)
        if last is not None and draw.random() < 0.7:
            lane = draw.choice([last, *last.successors])
        if draw.random() < 0.85:
            spot = lane.centerline.lines[0].interpolate(draw.random(), normalized=True)
            x, y = spot.x + draw.uniform(-2, 2), spot.y + draw.uniform(-2, 2)
        else:
            x, y = draw.uniform(-12, 12), draw.uniform(-12, 12)
        near = around(x, y)
        if near is None or (len(near) < 2 and draw.random() < 0.7):
            continue
        way = draw.choice(near)[1] if near else 0.0
        heading = way + draw.choice([draw.uniform(-0.3, 0.3), draw.uniform(-3.1, 3.1), *(k + draw.uniform(-0.02, 0.02)
                                    for k in (math.radians(60), -math.radians(60)))])  # fmt: skip
        made = LabelObject(
            name,
            "Car",
            "Car",
            x,
            y,
            None if draw.random() < 0.12 else math.remainder(heading, math.tau),
            2.0,
            4.5,
            track=name,
        )
        meant = meant_lanes(made, last)
        if is_clear(made) and not (one and len(own_lanes(made, "any") if made.heading is None else meant) != 1):
            return made


def label(
    draw: random.Random, number: int, passage: Passage, time_us: int, *, one: bool = False, count: int | None = None
) -> Label:
    others = draw.randint(2, 4) if count is None else count
    ego, *objects = (
        thing(draw, name, passage.before(name, time_us), one=one) for name in ("ego", *map(str, range(others)))
    )
    for each in (ego, *objects):
        passage.pass_on(each, time_us)
    return Label(f"{number:05}", "r", time_us, STREET.name, ego, tuple(objects))


def continuing(labels: list[Label]) -> int:
    """How many cars have other lanes of their own than their heading tells."""
    things = [each for world in labels for each in (world.ego, *world.objects) if each.heading is not None]
    told = [(own_lanes(each, "along"), meant_lanes(each, None) or own_lanes(each, "any")) for each in things]
    return sum(mine != theirs for mine, theirs in told)


def choices(world: Label, roles: list[str], rule: str) -> Iterator[Chosen]:
    for playing in itertools.permutations(world.objects, len(roles) - 1):
        things = (world.ego, *playing)
        for lanes in itertools.product(*(own_lanes(each, rule) or [None] for each in things)):
            yield dict(zip(roles, zip(things, lanes, strict=True), strict=True))


def dataset_of(folder: Path, recordings: list[Recording]) -> Dataset:
    write_dataset(folder, iter(recordings), {STREET.name: STREET.features}, name="d")
    return open_dataset(folder)


def told(dataset: Dataset, text: str, **how) -> dict[str, str]:
    results = Query(dataset, Source("p.scenic", text), QueryOptions(**how)).results()
    return {each.frame: type(each.verdict).__name__ for each in results}


def check_frames(folder: Path, seed: int, programs: int, frames: int) -> Counter[str]:
    draw, seen = random.Random(seed), Counter[str]()
    passage, time_us, labels = Passage(), 0, list[Label]()
    for number in range(frames):
        time_us += draw.choice([500_000, 500_000, 500_000, 2_000_000])
        labels.append(label(draw, number, passage, time_us))
    seen["continuing"] = continuing(labels)
    dataset = dataset_of(folder, [Recording("r", STREET.name, tuple(labels))])
    for number in range(programs):
        text, roles, asked = program(draw)
        rule = draw.choice(["along", "along", "any"])
        right = {
            each.frame
            for each in labels
            if any(all(one.holds(chosen) for one in asked) for chosen in choices(each, roles, rule))
        }
        ways = [{}, {"proofs": False}, {"prefilter": False}]
        if number % 5 == 0:
            ways.append({"match": MatchOptions(tolerance=EXACT, method="smt")})
        for way in ways:
            found = told(dataset, text, **{"match": MatchOptions(tolerance=EXACT), "lanes": rule, **way})
            # a solver may run out of its budget
            left = {frame for frame, verdict in found.items() if verdict == "Unknown" and "match" in way}
            sure = {frame: verdict for frame, verdict in found.items() if frame not in left}
            assert sure == dict.fromkeys(right - left, "Match"), (text, rule, way, set(found) ^ right)
            seen["left"] += len(left & right)
        seen["match"] += len(right)
        seen["no"] += frames - len(right)
        everything = {
            each.frame
            for each in labels
            if any(all(one.holds(chosen) for one in asked) for chosen in choices(each, roles, "any"))
        }
        seen["only any"] += len(everything - right)
    return seen


def test_frames_are_those_of_the_definition(tmp_path, rounds):
    seen = check_frames(tmp_path / "d", 1, rounds(24), 60)
    assert min(seen["match"], seen["no"], seen["only any"], seen["continuing"]) >= 5, seen


@pytest.mark.slow
def test_many_frames_are_those_of_the_definition(tmp_path):
    for seed in range(2, 4):
        check_frames(tmp_path / f"{seed}", seed, 24, 80)


# --- over time: at each sample the lanes that an object is in there


def check_intervals(folder: Path, seed: int, programs: int) -> Counter[str]:
    draw, seen = random.Random(seed), Counter[str]()
    recordings: list[Recording] = []
    for name in ("r", "s"):
        # with one own lane each, which of them is meant from sample to sample does not matter
        passage = Passage()
        labels = [label(draw, number, passage, number * 500_000, one=True, count=3) for number in range(12)]
        seen["continuing"] += continuing(labels)
        recordings.append(
            Recording(
                name,
                STREET.name,
                tuple(Label(f"{name}{e.frame}", name, e.timestamp_us, e.map, e.ego, e.objects) for e in labels),
            )
        )
    dataset = dataset_of(folder, recordings)
    for number in range(programs):
        asked, always, steps = said(draw, ["ego", "a"]), draw.random() < 0.5, draw.choice([1, 2])
        head = f"model scenic.domains.driving.model\nego = new Car {ANYWHERE}\na = new Car {ANYWHERE}\n"
        formula = f"{'always' if always else 'eventually'} ({asked.text})"
        text = f"{head}require {formula}\nterminate after {steps / 2} seconds\n"
        for rule in ("along", "any"):
            right: set[tuple[str, str]] = set()
            for recording, first in itertools.product(recordings, range(12 - steps)):
                stretch = recording.labels[first : first + steps + 1]
                for track in "012":
                    truths = [holds_at(each, track, asked, rule) for each in stretch]
                    if (all if always else any)(truths):
                        right.add((stretch[0].frame, track))
            options = QueryOptions(
                MatchOptions(tolerance=EXACT), lanes=rule, prefilter=number % 2 == 0,
                time=IntervalOptions(intervals="all"), interval_reasons=number % 3 > 0,
            )  # fmt: skip
            found = set[tuple[str, str]]()
            for each in Query(dataset, Source("p.scenic", text), options).results():
                assert not isinstance(each.verdict, Unknown), (text, rule, each)
                if isinstance(each.verdict, Match):
                    found.add((each.frame, each.verdict.correspondence["a"]))
            if rule == "along":
                assert found == right, (text, rule, found ^ right)
                seen["match"] += len(right)
            else:
                # of several lanes one is kept to: what holds with those of each sample is no less
                assert found <= right, (text, rule, found - right)
    return seen


def holds_at(world: Label, track: str, asked: Said, rule: str) -> bool:
    things = (world.ego, next(each for each in world.objects if each.track == track))
    return any(
        asked.holds(dict(zip(("ego", "a"), zip(things, lanes, strict=True), strict=True)))
        for lanes in itertools.product(*(own_lanes(each, rule) or [None] for each in things))
    )


def test_intervals_are_those_of_the_definition(tmp_path, rounds):
    programs = rounds(40)
    assert check_intervals(tmp_path / "d", 1, programs)["match"] > 2 * programs


@pytest.mark.slow
def test_many_intervals_are_those_of_the_definition(tmp_path):
    for seed in range(2, 4):
        check_intervals(tmp_path / f"{seed}", seed, 40)
