"""Courses against their definition (`tests/oracles/labels/courses.py`), over random tracks and places."""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from courses import Course, Lanes, Sample, lanes_of

from scenicq.geometry.default_street import street
from scenicq.geometry.driven_courses import track_courses
from scenicq.geometry.network import Network

NOWHERE = Network("none", ())
GAP = 1.5


def _free_track(draw: random.Random) -> list[Sample]:
    """A random drive: bends and loops, standstill, going back, gaps, sometimes one sample."""
    count = draw.choice([1, 2, 3, 8, 20, 40])
    t, x, y, heading = 0.0, draw.uniform(-40, 40), draw.uniform(-40, 40), draw.uniform(-3, 3)
    turn, speed = draw.uniform(-0.5, 0.5), draw.choice([0.0, 2.0, 6.0, 12.0])
    samples: list[Sample] = []
    for _ in range(count):
        samples.append((t, x, y, None if draw.random() < 0.05 else heading))
        if draw.random() < 0.15:
            turn = draw.uniform(-0.9, 0.9)
        if draw.random() < 0.15:
            speed = draw.choice([0.0, 0.0, 0.3, 2.0, 8.0, -3.0])
        step = draw.choice([0.5, 0.5, 0.5, 0.5, 0.5, 2.0]) if draw.random() < 0.2 else 0.5
        t += step
        heading += turn * step * (speed != 0)
        x += -math.sin(heading) * speed * step + draw.gauss(0, 0.03)
        y += math.cos(heading) * speed * step + draw.gauss(0, 0.03)
    return samples


def _track_on_lanes(draw: random.Random, lanes: Lanes) -> list[Sample]:
    """A drive along lanes, beside their middles."""
    name = draw.choice(sorted(lanes))
    at, t, aside = draw.uniform(0, lanes[name].line.length), 0.0, draw.uniform(-1.5, 1.5)
    samples: list[Sample] = []
    speed = draw.choice([0.0, 4.0, 10.0])
    backward = draw.random() < 0.1
    for _ in range(draw.choice([1, 1, 2, 5, 15])):
        line = lanes[name].line
        a, b = line.interpolate(max(at - 0.1, 0)), line.interpolate(min(at + 0.1, line.length))
        heading = math.atan2(a.x - b.x, b.y - a.y)
        here = line.interpolate(at)
        x, y = here.x - aside * math.cos(heading), here.y - aside * math.sin(heading)
        samples.append((t, x, y, heading + draw.gauss(0, 0.05) + (math.pi if backward else 0.0)))
        t += 0.5
        at += speed * 0.5
        if at > line.length and lanes[name].after:
            at -= line.length
            name = draw.choice(lanes[name].after)
    return samples


def _compare(samples: list[Sample], network: Network, lanes: Lanes, draw: random.Random, seen: Counter[str]) -> None:
    places = np.array([(x, y, math.nan if h is None else h) for _, x, y, h in samples])
    mine = track_courses(network, np.array([each[0] for each in samples]), places, GAP)
    for number in draw.sample(range(len(samples)), min(3, len(samples))):
        truth = Course(samples, number, lanes, GAP)
        for _ in range(4):
            spread = draw.choice([2.0, 8.0, 40.0])
            about = draw.choice(samples)
            place = about[1] + draw.gauss(0, spread), about[2] + draw.gauss(0, spread)
            low, high, right, left = mine[number].ends(*place)
            if not truth.known:
                assert (low, high, right, left) == (-math.inf, math.inf, -math.inf, math.inf)
                seen["no course"] += 1
                continue
            options = truth.plausible(place)
            where = f"{samples} at {number}, {place}: {low, high, right, left}, not {options}"
            seen["several" if len(options) > 1 else "one"] += 1
            if high == math.inf or low == -math.inf:
                seen["beyond"] += 1
                way, end = (1, low) if high == math.inf else (-1, high)
                assert any(sign == way and abs(along - end) < 0.1 for along, _, sign in options), where
                assert (right, left) == (-math.inf, math.inf), where
            elif low < high or right < left:
                assert len(options) > 1, where
            else:
                assert any(
                    abs(along - low) < 0.06 and side is not None and abs(side - left) < 0.06
                    for along, side, _ in options
                ), where  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_places_along_random_drives_without_a_map(seed: int) -> None:
    draw, seen = random.Random(seed), Counter[str]()
    for _ in range(20):
        _compare(_free_track(draw), NOWHERE, {}, draw, seen)
    assert seen["one"] > 5 * seen["several"]
    assert seen["beyond"] > 3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.one_in(3)
def test_places_along_random_drives_on_lanes(seed: int, rounds: Callable[[int], int]) -> None:
    draw, seen, network = random.Random(seed), Counter[str](), street()
    lanes = lanes_of(network.features)
    for _ in range(rounds(40)):
        _compare(_track_on_lanes(draw, lanes), network, lanes, draw, seen)
    assert seen["one"] > 5 * seen["several"]
