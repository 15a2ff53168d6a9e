"""Measures that programs record, against NumPy on the labels, over random tracks with gaps and without some speeds."""

from __future__ import annotations

import math
import random
import sys
from collections import Counter
from itertools import pairwise, product
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from shapely.geometry import LineString, Polygon

from scenicq import labels as for_scenic
from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

NEVER = 1e6
GAP_S = 1.5
PLACE = "at (Range(-999, 999), Range(-999, 999)), facing Range(0, 360) deg"
PROGRAM = f"""from scenicq.labels import time_to_collision, time_headway, deceleration_to_avoid, post_encroachment_time
from scenicq.labels import box_distance, jerk, course_change, along
ego = new Object {PLACE}
c = new Object {PLACE}
record time_to_collision(ego, c) as ttc
record time_headway(ego, c) as thw
record deceleration_to_avoid(ego, c) as drac
record post_encroachment_time(ego, c) as pet
record box_distance(ego, c) as apart
record along(ego, c) as ahead
record jerk(c) as jerk
record course_change(c, 2) as turned
"""


Samples = list[tuple[float, float, float, float]]


def drive(draw: random.Random, times: list[float], after: Samples | None = None) -> Samples:
    """x, y, heading and speed at each time; perhaps ahead of another."""
    x, y, heading, speed = draw.uniform(-12, 12), draw.uniform(-12, 12), draw.uniform(-3, 3), draw.uniform(0, 9)
    turn = draw.choice([0.0, draw.uniform(-0.4, 0.4)])
    if after is not None and draw.random() < 0.7:
        x, y, heading, _ = after[0]
        ahead, aside, speed = draw.uniform(6, 15), draw.uniform(-2, 2), draw.uniform(0, 3)
        x += -math.sin(heading) * ahead - math.cos(heading) * aside
        y += math.cos(heading) * ahead - math.sin(heading) * aside
    found: Samples = []
    for step in np.diff(times, append=times[-1]):
        found.append((x, y, math.remainder(heading, math.tau), speed))
        x, y = x - math.sin(heading) * speed * step, y + math.cos(heading) * speed * step
        heading += turn * step
        speed = max(0.0, speed + draw.uniform(-2, 2) * step)
    return found


def recordings(draw: random.Random, count: int) -> list[Recording]:
    found = []
    for n in range(count):
        size = draw.choice([1, 4, 12])
        times = np.cumsum([draw.choice([0.25, 0.5]) if draw.random() < 0.93 else 2.0 for _ in range(size)]).tolist()
        ways = [drive(draw, times)]
        ways.append(drive(draw, times, ways[0]))
        own = draw.random() < 0.6
        labels = []
        for k, (time, mine, its) in enumerate(zip(times, *ways, strict=True)):
            moves = (-math.sin(its[2]) * its[3], math.cos(its[2]) * its[3])
            objects = (LabelObject(f"o{k}", "Car", "car", *its[:3], 1.8, 4.2, velocity=moves if own else None,
                                   track=draw.choice(["t", "t", "t"])),)  # fmt: skip
            motion = (-math.sin(mine[2]) * mine[3], math.cos(mine[2]) * mine[3])
            ego = LabelObject("ego", "Car", "car", *mine[:3], 2.0, 4.8, velocity=motion)
            seen = objects if draw.random() < 0.9 or size == 1 else ()
            labels.append(Label(f"r{n:02}-{k}", f"r{n:02}", round(time * 1e6), "m", ego, seen))
        found.append(Recording(f"r{n:02}", "m", tuple(labels)))
    return found


# --- the definitions


def corners(x: float, y: float, heading: float, width: float, length: float) -> np.ndarray:
    ahead, right = np.array([-np.sin(heading), np.cos(heading)]), np.array([np.cos(heading), np.sin(heading)])
    return np.array([[x, y] + a * length / 2 * ahead + r * width / 2 * right for a, r in
                     ((1, 1), (1, -1), (-1, -1), (-1, 1))])  # fmt: skip


def box(each: LabelObject) -> Polygon:
    return Polygon(corners(each.x, each.y, each.heading, each.width, each.length))


def time_to_collision(one: LabelObject, other: LabelObject, moves: np.ndarray) -> float:
    """When a corner of one box comes to a side of the other, or they touch now."""
    if box(one).intersects(box(other)):
        return 0.0
    best = NEVER
    a, b = (corners(each.x, each.y, each.heading, each.width, each.length) for each in (one, other))
    for points, sides, velocity in ((b, a, moves), (a, b, -moves)):
        for point, (p, q) in product(points, pairwise([*sides, sides[0]])):
            # point + t * velocity = p + s * (q - p)
            system = np.column_stack([velocity, p - q])
            if abs(np.linalg.det(system)) > 1e-12:
                t, s = np.linalg.solve(system, p - point)
                if t >= 0 and -1e-9 <= s <= 1 + 1e-9:
                    best = min(best, t)
    return best


def lives(samples: list[tuple[float, LabelObject]]) -> list[list[tuple[float, LabelObject]]]:
    """The samples of a track in stretches without gaps."""
    found = [samples[:1]] if samples else []
    for before, each in pairwise(samples):
        if each[0] - before[0] > GAP_S:
            found.append([])
        found[-1].append(each)
    return found


def slope(samples: list[tuple[float, float]], at: float) -> float | None:
    """The least-squares slope around a time: equally many on both sides, as long as there are any."""
    numbers = [n for n, (time, _) in enumerate(samples) if time == at]
    if not numbers:
        return None
    low = high = numbers[0]
    while high - low < 3 or samples[high][0] - samples[low][0] < 1 - 1e-6:
        if low == 0 and high == len(samples) - 1:
            return None
        low, high = max(low - 1, 0), min(high + 1, len(samples) - 1)
    times, values = np.array(samples[low : high + 1]).T
    return float(np.polyfit(times - at, values, 1)[0])


def turned(life: list[tuple[float, LabelObject]], number: int, seconds: float) -> float | None:
    """How the direction between points at least half a metre apart changes, segment by segment."""
    corner, owner = [0], []
    for n, (_, each) in enumerate(life):
        last = life[corner[-1]][1]
        if math.hypot(each.x - last.x, each.y - last.y) >= 0.5:
            corner.append(n)
        owner.append(len(corner) - 1)
    later = next((n for n, (time, _) in enumerate(life) if time >= life[number][0] + seconds - 1e-6), None)
    if later is None:
        return None
    if len(corner) == 1:
        return 0.0
    points = [(life[n][1].x, life[n][1].y) for n in corner]
    ways = [math.atan2(q[1] - p[1], q[0] - p[0]) for p, q in pairwise(points)]
    total = [0.0, *np.cumsum([math.remainder(b - a, math.tau) for a, b in pairwise(ways)])]

    def on(n: int) -> int:
        """The segment on which a sample is: of those at its corner the nearest, of equals the one that it drives on."""
        here = life[n][1]
        away = []
        for segment in (owner[n], owner[n] - 1):
            if 0 <= segment < len(ways):
                (px, py), (qx, qy) = points[segment], points[segment + 1]
                far = 1e3  # the first and the last go on
                dx, dy = (qx - px), (qy - py)
                begin = (px - far * dx, py - far * dy) if segment == 0 else (px, py)
                end = (qx + far * dx, qy + far * dy) if segment == len(ways) - 1 else (qx, qy)
                line = LineString([begin, end])
                away.append((round(line.distance(LineString([(here.x, here.y), (here.x, here.y)])), 6), segment))
        return min(away, key=lambda each: each[0])[1]

    return total[on(later)] - total[on(number)]


def encroached(one: list[tuple[float, LabelObject]], other: list[tuple[float, LabelObject]]) -> float:
    times = [abs(s - t) for (s, a), (t, b) in product(one, other) if box(a).intersects(box(b))]
    return min(times, default=NEVER)


def check(told: object, wanted: float | None, what: object) -> None:
    if wanted is None:
        assert told is None, what
    else:
        assert told == pytest.approx(wanted, rel=1e-9, abs=1e-9), what


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.one_in(2)
def test_measures_are_those_of_numpy(tmp_path, seed):
    draw, seen = random.Random(seed), Counter[str]()
    made = recordings(draw, 14)
    write_dataset(tmp_path / "d", made, {}, name="d")
    dataset = open_dataset(tmp_path / "d")
    found = {each.frame: each for each in Query(dataset, Source("p.scenic", PROGRAM), QueryOptions()).results()}
    # what a label observes of motion is in the store
    stored = {label.frame: label for label in dataset.labels()}
    for recording in made:
        times = [(label.timestamp_us - recording.labels[0].timestamp_us) / 1e6 for label in recording.labels]
        tracks = {
            "ego": [(time, label.ego) for time, label in zip(times, recording.labels, strict=True)],
            "t": [
                (time, label.objects[0]) for time, label in zip(times, recording.labels, strict=True) if label.objects
            ],
        }
        accelerations = [
            (time, stored[label.frame].objects[0].motion.acceleration)
            for time, label in zip(times, recording.labels, strict=True)
            if label.objects
        ]
        for time, label in zip(times, recording.labels, strict=True):
            if not label.objects:
                continue
            result = found[label.frame]
            assert isinstance(result.verdict, Match)
            value = {name: each.values[0] for name, each in result.recorded.items()}
            one, other = label.ego, label.objects[0]
            moves = stored[label.frame].objects[0].motion.velocity
            check(value["apart"], box(one).distance(box(other)), label)
            if moves is None:
                ahead = value["ahead"]
                # where it is not ahead, no braking is needed, however fast it is
                assert [value["ttc"], value["drac"]] == [None, 0 if ahead is not None and ahead <= 0 else None]
                seen["unobserved"] += 1
            else:
                mine = np.array(one.velocity)
                check(value["ttc"], min(time_to_collision(one, other, np.array(moves) - mine), NEVER), label)
                seen["collision" if 0 < value["ttc"] < NEVER else "none"] += 1
            ahead, speed = value["ahead"], math.hypot(*one.velocity)
            if ahead is not None:
                way = ahead + (other.length - one.length) / 2
                check(value["thw"], way / speed if way >= 0 and speed > 1e-6 else NEVER, label)
                if moves is not None:
                    closing, gap = speed - math.hypot(*moves), ahead - (one.length + other.length) / 2
                    wanted = (
                        0.0 if ahead <= 0 or closing <= 0 else min(closing**2 / 2 / gap, NEVER) if gap > 0 else NEVER
                    )
                    check(value["drac"], wanted, label)
                    seen["braking" if 0 < wanted < NEVER else "none"] += 1
            (own,) = [life for life in lives(tracks["ego"]) if time in [t for t, _ in life]]
            (its,) = [life for life in lives(tracks["t"]) if time in [t for t, _ in life]]
            check(value["pet"], encroached(own, its), label)
            seen["encroachment" if value["pet"] < NEVER else "none"] += 1
            mine = [(t, a) for t, a in accelerations if t in [at for at, _ in its] and a is not None]
            check(value["jerk"], slope(mine, time), (label, mine))
            seen["jerk" if value["jerk"] is not None else "no jerk"] += 1
            check(value["turned"], turned(its, [t for t, _ in its].index(time), 2.0), label)
            seen["turned" if value["turned"] else "not turned"] += 1
    least = ("unobserved", "collision", "braking", "encroachment", "jerk", "no jerk", "turned", "not turned")
    assert min(seen[each] for each in least) >= 2, seen


@pytest.mark.slow
def test_requirements_ask_the_same(tmp_path):
    draw = random.Random(5)
    write_dataset(tmp_path / "d", recordings(draw, 10), {}, name="d")
    dataset = open_dataset(tmp_path / "d")
    bounds = {"ttc": 4, "thw": 1, "drac": 2, "pet": 1, "apart": 6, "jerk": 0.1, "turned": 0.05}
    names = {"ttc": "time_to_collision(ego, c)", "thw": "time_headway(ego, c)", "drac": "deceleration_to_avoid(ego, c)",
             "pet": "post_encroachment_time(ego, c)", "apart": "box_distance(ego, c)", "jerk": "jerk(c)",
             "turned": "course_change(c, 2)"}  # fmt: skip
    every = {each.frame: each for each in Query(dataset, Source("p.scenic", PROGRAM), QueryOptions()).results()}
    seen = Counter[str]()
    for (name, bound), method in product(bounds.items(), ("auto", "smt", "monolithic")):
        text = f"{PROGRAM}require {names[name]} < {bound}\n"
        query = Query(dataset, Source("p.scenic", text), QueryOptions(match=MatchOptions(method=method)))
        told = {each.frame: each.verdict for each in query.results()}
        for frame, result in every.items():
            value = result.recorded[name].values[0] if isinstance(result.verdict, Match) else None
            if not isinstance(result.verdict, Match):
                assert frame not in told
            elif value is None:
                # between its ends, which the requirement may know
                seen["open"] += isinstance(told.get(frame), Unknown)
            else:
                assert isinstance(told.get(frame), Match) == (value < bound), (name, method, frame, value)
                assert not isinstance(told.get(frame), Unknown)
                seen[f"{name} {value < bound}"] += 1
    assert min(seen[f"{name} {held}"] for name in bounds for held in (True, False)) > 0, seen
    assert seen["open"] > 0


def test_real_scenic_is_told_the_same(monkeypatch):
    """The module that Scenic imports, on the objects of scenes."""
    made = {name: ModuleType(name) for name in ("scenic", "scenic.core", "scenic.core.distributions")}
    made["scenic.core.distributions"].distributionFunction = lambda function: function
    for name, module in made.items():
        monkeypatch.setitem(sys.modules, name, module)
    draw, seen = random.Random(3), Counter[str]()
    for _ in range(300):
        one, other = (
            LabelObject("o", "Car", "car", draw.uniform(-9, 9), draw.uniform(-9, 9), draw.uniform(-3, 3), 2.0, 4.0,
                        velocity=draw.choice([(0.0, 0.0), (draw.uniform(-4, 4), draw.uniform(-4, 4))]))
            for _ in range(2)
        )  # fmt: skip
        a, b = (
            SimpleNamespace(position=(o.x, o.y, 0), heading=o.heading, width=o.width, length=o.length,
                            velocity=(*o.velocity, 0), speed=math.hypot(*o.velocity))
            for o in (one, other)
        )  # fmt: skip
        wanted = time_to_collision(one, other, np.subtract(other.velocity, one.velocity))
        assert for_scenic.time_to_collision(a, b) == pytest.approx(wanted, rel=1e-7, abs=1e-7)
        assert for_scenic.box_distance(a, b) == pytest.approx(box(one).distance(box(other)), abs=1e-9)
        assert for_scenic.post_encroachment_time(a, b) == (0 if box(one).intersects(box(other)) else NEVER)
        seen["comes" if 0 < wanted < NEVER else "touches" if wanted == 0 else "never"] += 1
    assert min(seen.values()) > 20, seen
    back = SimpleNamespace(position=(1.75, 60.0, 0), heading=0.0, width=2.0, length=4.0, speed=10.0)
    front = SimpleNamespace(position=(1.75, 80.0, 0), heading=0.0, width=2.0, length=5.0, speed=4.0)
    assert for_scenic.time_headway(back, front) == pytest.approx(20.5 / 10)
    assert for_scenic.deceleration_to_avoid(back, front) == pytest.approx(36 / 2 / 15.5)
    assert for_scenic.time_headway(front, back) == NEVER
    assert for_scenic.deceleration_to_avoid(front, back) == 0
    assert (for_scenic.jerk(back), for_scenic.course_change(back, 3)) == (0, 0)
    assert street().lanes


@pytest.mark.slow
def test_what_is_hidden_is_behind_a_box(tmp_path):
    draw, seen, labels = random.Random(8), Counter[str](), []
    for n in range(60):
        ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, 2.0, 4.0)
        screen = LabelObject("s", "Car", "car", draw.uniform(-6, 6), draw.uniform(4, 7), draw.uniform(-3, 3), 2.0, 4.5)
        thing = LabelObject("w", "Pedestrian", "walker", draw.uniform(-6, 6), draw.uniform(10, 14), 0.3, 0.6, 0.6)
        labels.append(Label(f"f{n:02}", f"r{n:02}", n, "m", ego, (screen, thing)))
    write_dataset(tmp_path / "d", [Recording(each.recording, "m", (each,)) for each in labels], {}, name="d")
    dataset = open_dataset(tmp_path / "d")
    text = f"""model scenic.domains.driving.model
from scenicq.labels import hides
ego = new Car {PLACE}
s = new Car {PLACE}
w = new Pedestrian {PLACE}
record hides(s, w) as middle
record hides(s, w, whole=True) as whole
record hides(w, s, viewer=s) as itself
"""
    every = {each.frame: each for each in Query(dataset, Source("p.scenic", text), QueryOptions()).results()}
    for method in ("auto", "smt"):
        asked = QueryOptions(match=MatchOptions(method=method))
        found = {
            each.frame for each in Query(dataset, Source("p.scenic", f"{text}require hides(s, w)\n"), asked).results()
        }
        assert found == {frame for frame, each in every.items() if each.recorded["middle"].values[0]}
    for label in labels:
        screen, thing = label.objects
        told = {name: each.values[0] for name, each in every[label.frame].recorded.items()}
        area = box(screen)
        assert told["middle"] is area.intersects(LineString([(0, 0), (thing.x, thing.y)]))
        # of all of its box, points along its sides and inside
        edge = [box(thing).exterior.interpolate(at / 12) for at in range(29)]
        assert told["whole"] is all(area.intersects(LineString([(0, 0), point])) for point in edge)
        assert told["itself"] is False
        seen[f"{told['middle']} {told['whole']}"] += 1
    assert min(seen[each] for each in ("True True", "True False", "False False")) > 2, seen
