"""`lanesAhead`: a lane and what it leads to, against all ways through the network, and as it is matched."""

from types import SimpleNamespace

import pytest

import scenicq
from scenicq.compiler.lanes_ahead import lanes_ahead
from scenicq.errors import ScenarioError
from scenicq.store.dataset import open_dataset

MODEL = "model scenic.domains.driving.model\n"


@pytest.fixture(scope="module")
def network(crossroads):
    dataset = open_dataset(crossroads)
    return dataset.network(dataset.maps[0])


def _ahead(network, lane, distance):
    run = SimpleNamespace(budget=SimpleNamespace(step=lambda span: None), network=network)
    return lanes_ahead(run, lane, distance, None)


def _reached(lane, left, seen):
    """Lanes on all ways from the end of a lane that begin before so many metres."""
    for each in lane.successors:
        if left >= 0 and each not in seen:
            length = sum(line.length for line in each.centerline.lines)
            yield each
            yield from _reached(each, left - length, {*seen, each})


@pytest.mark.parametrize("distance", [0, 5, 30, 1000])
def test_it_is_what_all_ways_reach(network, distance):
    assert any(len(lane.successors) > 1 for lane in network.lanes)
    for lane in network.lanes:
        region = _ahead(network, lane, distance)
        assert set(region.ids) == {lane.id, *(each.id for each in _reached(lane, distance, {lane}))}
        assert len(region.ids) == len(set(region.ids)) == len(region.polygons)
        assert region.orientation is network.roadDirection


@pytest.mark.parametrize("distance", [True, "far", None, float("inf")])
def test_other_distances_are_refused(network, distance):
    with pytest.raises(ScenarioError, match="wrong-type"):
        _ahead(network, network.lanes[0], distance)


def test_a_car_past_the_end_of_the_lane_is_found(crossroads):
    town = scenicq.open(crossroads)
    program = MODEL + "ego = new Car on road, with viewAngle 40 deg, with visibleDistance 60\n" + (
        "lead = new Car on {}\nrequire ego can see lead\n"
    )  # fmt: skip
    short, long = (town.match(program.format(where), jobs=1) for where in ("ego.lane", "ego.lane.lanesAhead(60)"))
    assert {each.frame for each in short} < {each.frame for each in long}
    assert long.funnel.unknowns == 0


def test_hidden_points_are_decided(crossroads):
    program = MODEL + "ego = new Car on road\nspot = new OrientedPoint on ego.lane.lanesAhead(30)\n" + (
        "beside = new Car at spot offset by Range(-1, 1) @ 0\nrequire (distance from ego to beside) < 40\n"
    )  # fmt: skip
    found = scenicq.open(crossroads).match(program, jobs=1)
    assert len(found) > 0
    assert found.funnel.unknowns == 0
