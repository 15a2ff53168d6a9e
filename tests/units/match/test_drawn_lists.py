"""Lists that hang on where an object is, in requirements: gone through and asked as on the drawn scene."""

import random

import pytest
import shapely
from scenes import STREET, compiled

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

PROGRAM = (
    "model scenic.domains.driving.model\n"
    "ego = new Car with regionContainedIn None\no = new Car with regionContainedIn None\n{}\n"
)
CONDITIONS = {
    "require o.lane in ego.road.lanes": lambda a, b: bool(a.road and b.lane and b.lane in a.road.lanes),
    "require o._lane not in ego.road.lanes": lambda a, b: bool(a.road and b.lane not in a.road.lanes),
    "require any(o.position in l for l in ego.road.lanes)": lambda a, b: bool(a.road and a.near(b, a.road.lanes)),
    "require all(l is not o._lane for l in ego.laneGroup.lanes)": lambda a, b: (
        bool(a.group and b.lane not in a.group.lanes)
    ),
    "require len([l for l in ego.laneGroup.lanes if o.position in l]) == 1": lambda a, b: bool(
        a.group and len(a.near(b, a.group.lanes)) == 1
    ),
    "require o._lane in (ego._road.lanes if ego._road else [])": lambda a, b: bool(a.road and b.lane in a.road.lanes),
    "require sorted([len(l.sections) for l in ego.road.lanes])[-1] >= 1": lambda a, b: bool(a.road),
    "def beside(a, b):\n    for l in a.road.lanes:\n        if l is b._lane:\n            return True\n"
    "    return False\nrequire beside(ego, o)": lambda a, b: bool(a.road and b.lane in a.road.lanes),
    "require (o._lane in ego.road.lanes) if ego._road else (distance to o) < 30": lambda a, b: (
        b.lane in a.road.lanes if a.road else a.apart(b) < 30
    ),
}  # fmt: skip


class Place:
    """A place and what the map says of it."""

    def __init__(self, x: float, y: float) -> None:
        self.x, self.y = x, y
        self.lane, self.road, self.group = (getattr(STREET, name)(x, y) for name in ("laneAt", "roadAt", "laneGroupAt"))

    def near(self, other, lanes):
        return [lane for lane in lanes if shapely.intersects_xy(lane.polygon, other.x, other.y)]

    def apart(self, other):
        return ((self.x - other.x) ** 2 + (self.y - other.y) ** 2) ** 0.5

    def car(self, name):
        heading = next(iter(STREET.roadDirection.values(self.x, self.y)), 0.0)
        return LabelObject(name, "Car", "car", self.x, self.y, heading, 2.0, 4.5)


def places(count: int) -> list[Place]:
    rng = random.Random(7)
    west, south, east, north = shapely.union_all(STREET.drivableRegion.polygons).bounds
    found: list[Place] = []
    while len(found) < count:
        place = Place(rng.uniform(west, east), rng.uniform(south, north))
        if place.lane is not None or place.road is not None:
            found.append(place)
    return found


@pytest.mark.parametrize("text", CONDITIONS, ids=lambda text: text.splitlines()[-1][8:40])
@pytest.mark.one_in(8)
def test_they_are_those_of_the_drawn_scene(text):
    matcher = Matcher(compiled(PROGRAM.format(text)), MatchOptions())
    wanted = CONDITIONS[text]
    spots = places(60)
    seen = set()
    for one, other in zip(spots[::2], spots[1::2], strict=True):
        verdict = matcher.match(Label("f", "r", 0, "street", one.car("ego"), (other.car("o"),)))
        holds = wanted(one, other)
        seen.add(holds)
        assert isinstance(verdict, Match if holds else NoMatch), (one.x, one.y, other.x, other.y, verdict)
    assert True in seen
