"""The real network of Boston Seaport: counts, speed, and direction against the map's own answers."""

# pyright: basic

import math
import random
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import Point

from scenicq.geometry.angles import distance
from scenicq.geometry.membership import bounds, contains, contains_many
from scenicq.geometry.membership import distance as distance_to
from scenicq.geometry.network import Network, read_geojson
from scenicq.geometry.proximity import meets, witness_point
from scenicq.geometry.regions import Sector, intersection
from scenicq.geometry.sampling import sample

MAP = Path(__file__).parents[4] / "shared" / "data" / "boston" / "maps" / "boston-seaport.geojson"
pytestmark = pytest.mark.skipif(not MAP.exists(), reason="the Boston map is not on this machine")


@pytest.fixture(scope="module")
def network() -> Network:
    problems: list[str] = []
    features = read_geojson(MAP, lambda identifier, message: problems.append(f"{identifier}: {message}"))
    assert problems == []
    return Network("boston-seaport", features)


def test_everything_is_there(network: Network) -> None:
    assert network.problems == ()
    counts = (network.lanes, network.laneGroups, network.allRoads, network.intersections)
    assert [len(kind) for kind in counts] == [1180, 966, 926, 332]
    assert sum(section._laneToLeft is not None for section in network.laneSections) == 214
    assert all(section.laneToLeft.laneToRight is section for section in network.laneSections if section._laneToLeft)
    assert all(lane.road is not None and lane.group is not None for lane in network.lanes)
    assert sum(not road.is1Way for road in network.allRoads) == 372


def test_directions_in_lanes(network: Network) -> None:
    rng = random.Random(3)
    xy = np.array([sample(network.laneRegion, rng) for _ in range(300)])
    found = network.roadDirection.values_many(xy)
    apart = 0
    for (x, y), values in zip(xy.tolist(), found, strict=True):
        assert values == network.roadDirection.values(x, y)
        lane = network.laneAt(x, y)
        assert lane is not None
        assert lane.centerline is not None
        turns = []
        for line in lane.centerline.lines:
            place = line.project(Point(x, y))
            before, after = line.interpolate(max(place - 0.01, 0)), line.interpolate(min(place + 0.01, line.length))
            turns.append(math.atan2(before.x - after.x, after.y - before.y))
        apart += not any(distance(value, turn) < 0.8 for value in values for turn in turns)
    assert apart <= 3, "a few centrelines of the map have hooks, at whose corners any direction is as good"


def test_directions_exist_wherever_lanes_are(network: Network) -> None:
    west, south, east, north = bounds(network.laneRegion)
    rng = np.random.default_rng(5)
    xy = np.stack([rng.uniform(west, east, 100_000), rng.uniform(south, north, 100_000)], axis=1)
    found = network.roadDirection.values_many(xy)
    inside = contains_many(network.laneRegion, xy)
    assert all(values for values, within in zip(found, inside, strict=True) if within)


def test_visible_road(network: Network) -> None:
    rng = random.Random(11)
    for _ in range(20):
        x, y = sample(network.laneRegion, rng)
        visible = intersection(network.drivableRegion, Sector((x, y), 50, rng.uniform(-4, 4), rng.uniform(1, 6)))
        for _ in range(5):
            place = Point(x + rng.uniform(-60, 60), y + rng.uniform(-60, 60))
            away = distance_to(visible, place.x, place.y)
            assert meets(visible, place, away + 1e-6) is True
            assert away == 0 or meets(visible, place, away - 1e-6) is False
            witness = witness_point(visible, place, away + 0.5)
            assert witness is not None
            assert contains(visible, *witness)
