"""`scenicq.labels` where real Scenic runs a program: stand-ins for Scenic's lanes have the courses of our own map."""

from __future__ import annotations

import random
import sys
from types import ModuleType, SimpleNamespace

import pytest
import shapely

from scenicq import labels
from scenicq.geometry.default_street import street
from scenicq.geometry.driven_courses import lane_course
from scenicq.geometry.lane_stretches import ahead_in_lanes, own_lanes


class Rejected(Exception):
    pass


@pytest.fixture
def scenic(monkeypatch):
    """As much of Scenic as the module asks for; nothing is random."""
    made = {name: ModuleType(name) for name in ("scenic", "scenic.core", "scenic.core.distributions")}
    made["scenic.core.distributions"].distributionFunction = lambda function: function
    made["scenic.core.distributions"].RejectionException = Rejected
    made["scenic.syntax.veneer"] = ModuleType("scenic.syntax.veneer")
    made["scenic.core.regions"] = ModuleType("scenic.core.regions")
    made["scenic.core.regions"].PolygonalRegion = lambda polygon: polygon
    made["scenic.core.regions"].nowhere = "nowhere"
    made["scenic.core.regions"].PolylineRegion = lambda polyline: polyline
    for name, module in made.items():
        monkeypatch.setitem(sys.modules, name, module)


class Lane:
    """A lane as Scenic has it: what it leads to is told by manoeuvres, and by another one behind its end."""

    def __init__(self, lane):
        points = [(x, y, 0) for line in lane.centerline.lines for x, y in line.coords]
        self.uid, self.polygon, self.centerline = lane.id, lane.polygon, SimpleNamespace(points=points)
        self.maneuvers, self._successor, self.network = [], None, None


@pytest.fixture(scope="module")
def lanes():
    own = street().lanes
    made = {lane.id: Lane(lane) for lane in own}
    network = SimpleNamespace(lanes=[*made.values()])
    for lane in own:
        made[lane.id].network = network
        inside = any(each.intersection for each in lane.maneuvers)
        for other in lane.successors:
            if inside:
                made[lane.id].maneuvers.append(SimpleNamespace(connectingLane=made[other.id], endLane=None))
            else:
                made[lane.id]._successor = made[other.id]
    return made


def test_courses_are_those_of_our_own_map(scenic, lanes):
    network, draw = street(), random.Random(1)
    lane_names = [each.id for each in network.lanes]
    compared = 0
    for _ in range(60):
        line = network.elements[draw.choice(lane_names)].centerline.lines[0]
        at = line.interpolate(draw.uniform(0, line.length))
        x, y, heading = at.x + draw.gauss(0, 0.5), at.y + draw.gauss(0, 0.5), draw.uniform(-3, 3)
        near = network.lanesAt(x, y)
        owner = SimpleNamespace(position=(x, y, 0), heading=heading, _lane=lanes[near[0].id] if near else None)
        place = (x + draw.gauss(0, 20), y + draw.gauss(0, 20))
        low, high, right, left = lane_course(network, x, y, heading).ends(*place)
        if low == high and right == left:
            assert labels.along(owner, place) == pytest.approx(low, abs=1e-6)
            assert labels.beside(owner, SimpleNamespace(position=place)) == pytest.approx(left, abs=1e-6)
            compared += 1
        else:
            asked = labels.beside if low == high else labels.along
            with pytest.raises(Rejected):
                asked(owner, place)
    assert compared > 40


def test_regions_are_scenics(scenic, lanes):
    owner = SimpleNamespace(position=(1.75, 60.0), heading=0.0, _lane=lanes["north-out-0"])
    corridor = labels.corridor(owner, 1.5)
    assert labels.course(owner).length == pytest.approx(100, abs=0.1)
    assert corridor.area == pytest.approx(300 + 7.07, abs=0.1)
    nowhere = SimpleNamespace(position=(0.0, 0.0), heading=0.0)
    assert labels.along(nowhere, (0.0, 20.0)) == 20


def test_what_lies_ahead_is_that_of_our_own_map(scenic, lanes):
    network, draw = street(), random.Random(1)
    compared = 0
    for _ in range(40):
        x, y, heading = draw.uniform(-12, 12), draw.uniform(-12, 12), draw.uniform(-3, 3)
        near = network.lanesAt(x, y)
        owner = SimpleNamespace(position=(x, y, 0), heading=heading, _lane=lanes[near[0].id] if near else None)
        parts = ahead_in_lanes(network, x, y, heading, None, 30.0)
        if parts:
            assert labels.ahead(owner, 30).symmetric_difference(shapely.union_all(parts)).area < 1e-6
            compared += len(own_lanes(network, x, y, heading, None)) < len(near)
        else:
            assert labels.ahead(owner, 30) == "nowhere"
    assert compared > 5


class Car(SimpleNamespace):
    pass


class Bus(Car):
    pass


@pytest.fixture(params=["a scene", "a simulation"])
def there(request, scenic):
    """The ego at the origin, and who is around it, in a requirement on a scene or while a simulation runs."""
    ego, near, bus, far = (Car(position=(x, 0, 0)) for x in (0, 5, -5, 9))
    bus.__class__ = Bus
    drawn = SimpleNamespace(objects=(ego, far, near, bus))
    first, veneer = SimpleNamespace(objects=(ego, far)), sys.modules["scenic.syntax.veneer"]
    simulated = request.param == "a simulation"
    veneer.ego = lambda: ego
    veneer.currentScenario, veneer.currentSimulation = (first, drawn) if simulated else (drawn, None)
    return SimpleNamespace(ego=ego, near=near, bus=bus, far=far)


def test_all_but_the_ego_count(there):
    assert labels.count(Car) == 3
    assert labels.count(Bus) == 1
    assert labels.count(Car, within=SimpleNamespace(containsPoint=lambda place: place[0] > 0)) == 2
    assert labels.others(Car) == []


def test_the_first_of_the_nearest_is_meant(there):
    assert labels.nearest(Car) is there.near
    assert labels.nearest(Bus) is there.bus


def test_what_is_read_of_nobody_rejects_the_scene(there):
    nobody = labels.nearest(str)
    assert nobody is not there.near
    with pytest.raises(Rejected, match="there is nobody whose speed is asked"):
        assert nobody.speed > 1


def test_without_scenic_it_says_what_it_is_for(monkeypatch):
    monkeypatch.setitem(sys.modules, "scenic.core.distributions", None)
    with pytest.raises(RuntimeError, match="is for programs that Scenic runs"):
        labels.along(SimpleNamespace(position=(0, 0), heading=0), (1, 1))
