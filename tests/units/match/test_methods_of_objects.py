"""Methods of objects are those of their boxes, with shapely's geometry as the oracle; those of points are of places."""

import math
import random

import shapely
from scenes import compiled
from shapely import affinity

from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match
from scenicq.store.labels import Label, LabelObject

HERE = (0.0, 0.0)


def box(thing: LabelObject) -> shapely.Polygon:
    assert thing.heading is not None
    assert thing.width is not None
    assert thing.length is not None
    around = shapely.box(-thing.width / 2, -thing.length / 2, thing.width / 2, thing.length / 2)
    return affinity.translate(affinity.rotate(around, thing.heading, HERE, use_radians=True), thing.x, thing.y)


def scenes(count: int):
    rng = random.Random(1)

    def thing(name: str) -> LabelObject:
        place = (rng.uniform(-5, 5), rng.uniform(-5, 5))
        return LabelObject(name, "Object", "thing", *place, rng.uniform(-3, 3), rng.uniform(1, 4), rng.uniform(1, 6))

    for _ in range(count):
        yield thing("ego"), thing("o"), (round(rng.uniform(-5, 5), 3), round(rng.uniform(-5, 5), 3))


def holds(condition: str, ego: LabelObject, other: LabelObject, *, version: int = 3) -> bool:
    made = "new Object" if version == 3 else "Object"
    clear = "with allowCollisions True, with requireVisible False, with visibleDistance 99"
    text = "\n".join(
        f"{name}{made} {place}, facing {thing.heading}, with width {thing.width}, with length {thing.length}, {clear}"
        for name, thing in (("ego = ", ego), ("o = ", other))
        for place in [f"at ({thing.x}, {thing.y})" if version == 3 else f"at {thing.x} @ {thing.y}"]
    )
    scenario = compiled(f"{text}\nrequire {condition}\n", version=version)
    return isinstance(Matcher(scenario).match(Label("f", "r", 0, "street", ego, (other,))), Match)


def test_an_object_is_as_far_as_its_box():
    for ego, other, (x, y) in scenes(12):
        for at, point in ((f"Vector({x}, {y})", (x, y)), ("o", (other.x, other.y)), ("o.position", (other.x, other.y))):
            apart = box(ego).distance(shapely.Point(point))
            assert holds(f"ego.distanceTo({at}) <= {apart + 1e-6}", ego, other)
            assert holds(f"ego.distanceTo({at}) >= {apart - 1e-6}", ego, other)


def test_a_place_is_as_far_as_it_is():
    for ego, other, (x, y) in scenes(4):
        apart = math.hypot(x - ego.x, y - ego.y)
        assert holds(f"abs(ego.position.distanceTo(Vector({x}, {y})) - {apart}) < 1e-6", ego, other)


def test_in_the_second_version_an_object_is_as_far_as_its_place():
    for ego, other, (x, y) in scenes(4):
        apart = math.hypot(x - ego.x, y - ego.y)
        assert holds(f"abs(ego.distanceTo({x} @ {y}) - {apart}) < 1e-6", ego, other, version=2)


def test_what_it_holds_and_meets_is_told_by_its_box():
    seen = set()
    for ego, other, (x, y) in scenes(30):
        inside, meets = box(ego).contains(shapely.Point(x, y)), box(ego).intersects(box(other))
        assert holds(f"ego.containsPoint(Vector({x}, {y}))", ego, other) is inside
        assert holds("ego.intersects(o)", ego, other) is meets
        seen.add((inside, meets))
    assert len(seen) > 2
