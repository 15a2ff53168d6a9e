"""Every operator of the language paper's appendix B against its formula, computed here by plain mathematics."""

import math
import random

import pytest
from shapely.affinity import rotate as turned
from shapely.affinity import translate
from shapely.geometry import box

from .scenes import (
    EGO,
    EGO_HEADING,
    EGO_POSITION,
    arctan,
    compiled,
    drawn,
    minus,
    offset_local,
    plus,
    refused,
    rotate,
    value,
)

D = math.radians
P, A = (10.0, 20.0), D(70)
BEFORE = EGO + "p = new OrientedPoint at (10, 20), facing 70 deg\nR = CircularRegion((10, 20), 5)\n"

SCALARS = {
    "relative heading of p": A - EGO_HEADING,
    "relative heading of p from 20 deg": A - D(20),
    "apparent heading of p": A - arctan(minus(P, EGO_POSITION)),
    "apparent heading of p from (1, 1)": A - arctan(minus(P, (1, 1))),
    "distance to p": math.dist(P, EGO_POSITION),
    "distance from (1, 1) to p": math.dist(P, (1, 1)),
    "distance from (10, 30) to R": 5.0,
    "distance past (1, 2)": rotate(minus(EGO_POSITION, (1, 2)), -EGO_HEADING)[1],
    "distance past (1, 2) of p": rotate(minus(P, (1, 2)), -A)[1],
    "angle to p": arctan(minus(P, EGO_POSITION)),
    "angle from (1, 1) to p": arctan(minus(P, (1, 1))),
    "(20 deg relative to 30 deg)": D(50),
    "(20 deg relative to p)": D(20) + A,
    "max(1, 2) + abs(-3)": 5,
    "min([4, 2, 3], key=lambda x: -x)": 4,
    "sorted([3, 1, 2], reverse=True)[0]": 3,
    "sum([x * x for x in filter(lambda x: x > 1, range(4))])": 13,
    "list(map(lambda x, y: x + y, [1, 2], [3, 4]))[1]": 6,
    "[1, 2, 3][1:][0]": 2,
    "math.hypot(3, 4)": 5.0,
}
VECTORS = {
    "p.position offset by (1, 2)": plus(P, (1, 2)),
    "(p offset by (1, 2)).position": offset_local(P, A, (1, 2)),
    "((1, 2) relative to p).position": offset_local(P, A, (1, 2)),
    "(1, 2) relative to (3, 4)": (4, 6),
    "p.position offset along 20 deg by (1, 2)": plus(P, rotate((1, 2), D(20))),
    "relative position of p": minus(P, EGO_POSITION),
    "(front of ego).position": offset_local(EGO_POSITION, EGO_HEADING, (0, 2.5)),
    "(back of ego).position": offset_local(EGO_POSITION, EGO_HEADING, (0, -2.5)),
    "(left of ego).position": offset_local(EGO_POSITION, EGO_HEADING, (-1, 0)),
    "(right of ego).position": offset_local(EGO_POSITION, EGO_HEADING, (1, 0)),
    "(front left of ego).position": offset_local(EGO_POSITION, EGO_HEADING, (-1, 2.5)),
    "(front right of ego).position": offset_local(EGO_POSITION, EGO_HEADING, (1, 2.5)),
    "(back left of ego).position": offset_local(EGO_POSITION, EGO_HEADING, (-1, -2.5)),
    "ego.backRight.position": offset_local(EGO_POSITION, EGO_HEADING, (1, -2.5)),
    "Vector(1, 2).rotatedBy(90 deg)": (-2, 1),
    "Vector(1, 2).offsetRotated(20 deg, (3, 4))": plus((1, 2), rotate((3, 4), D(20))),
    "1 @ 2 + 3 @ 4": (4, 6),
}
TRUTHS = {
    "p in R": True,
    "(10, 26) in R": False,
    "ego can see (8, 4)": abs(math.remainder(arctan((5, 8)) - EGO_HEADING, math.tau)) <= D(40),
    "any([False, p in R])": True,
    "all([True, (0, 0) in R])": False,
    "(10, 20) in R.intersect(CircularRegion((13, 20), 4))": True,
    "(10, 20) in R.difference(CircularRegion((13, 20), 4))": False,
    "(99, 20) in R.union(CircularRegion((99, 20), 4))": True,
    "ego intersects CircularRegion((3, -4), 1)": True,
    "3 in [1, 2, 3]": True,
    "isinstance(ego, Object)": True,
}


@pytest.mark.parametrize("expression", SCALARS)
def test_a_scalar_is_what_the_paper_says(expression: str) -> None:
    assert value(expression, f"import math\n{BEFORE}") == pytest.approx(SCALARS[expression])


@pytest.mark.parametrize("expression", VECTORS)
def test_a_vector_is_what_the_paper_says(expression: str) -> None:
    found = value(f"({expression}).x", BEFORE), value(f"({expression}).y", BEFORE)
    assert found == pytest.approx(VECTORS[expression])


@pytest.mark.parametrize("expression", TRUTHS)
def test_a_condition_is_what_the_paper_says(expression: str) -> None:
    assert value(expression, BEFORE) is TRUTHS[expression]


def test_the_parts_of_an_object_face_its_way() -> None:
    assert value("(front left of ego).heading") == pytest.approx(EGO_HEADING)


def test_one_random_value_used_twice_is_one() -> None:
    assert value("x - x", f"{EGO}x = Range(0, 1)\n") == 0.0
    assert value("x - resample(x)", f"{EGO}x = Range(0, 1)\n") != 0.0
    assert value("resample(3)") == 3.0


def test_a_random_object_keeps_its_own_box_and_heading() -> None:
    before = f"{EGO}a = new Object at (50, 0), facing 90 deg\nb = new Object at (90, 0)\nc = Uniform(a, b)\n"
    for seed in range(8):
        _, scene = drawn(
            f"{before}param x = c.position.x\nparam h = relative heading of c from 0\nparam s = c is a\n", seed
        )
        assert (scene.params["x"] == 50) == (scene.params["h"] == pytest.approx(D(90))) == scene.params["s"]


def test_a_random_lane_without_neighbour_is_no_scene() -> None:
    text = (
        "model scenic.domains.driving.model\nlane = Uniform(*network.laneSections)\nego = new Car on lane.laneToLeft\n"
    )
    scenario = compiled(text)
    assert len(scenario.requirements) >= 1
    ids = {section._laneToLeft.id for section in _sections() if section._laneToLeft}
    for seed in range(5):
        _, scene = drawn(text, seed)
        x, y = scene.values[0, "position"]
        assert any(section.id in ids and section.polygon.buffer(1e-6).contains(_point(x, y)) for section in _sections())


def _sections():
    from .scenes import network

    return network().laneSections


def _point(x: float, y: float):
    import shapely

    return shapely.Point(x, y)


def test_requirements_see_the_ego_and_the_names_of_their_moment() -> None:
    text = "ego = new Object at (1, 1)\nx = 5\nrequire (distance to (1, 1)) < x\nx = -1\nego = new Object at (50, 50)\n"
    assert drawn(text)[0].ego == 1


@pytest.mark.parametrize(
    ("expression", "code"),
    [
        ("ego relative to p", "wrong-type"),
        ("altitude to p", "unsupported-construct"),
        ("distance past p of (1, 2)", "wrong-type"),
        ("apparent heading of (1, 2)", "wrong-type"),
        ("front of (1, 2)", "wrong-type"),
        ("1 if Range(0, 1) > 0.5 else 2", "random-branch"),
        ("ego.lane", "unknown-attribute"),
        ("ego.positon", "unknown-attribute"),
        ("R[0]", "wrong-type"),
        ("DiscreteRange(5, 1)", "wrong-value"),
        ("TruncatedNormal(0, 1, 5, 1)", "wrong-value"),
        ("VectorField('f', lambda p: 0)", "unsupported-construct"),
    ],
)
def test_what_has_no_meaning_is_refused(expression: str, code: str) -> None:
    assert refused(f"{BEFORE}param answer = {expression}\n")[0] == code


@pytest.mark.parametrize("asked", ["to other", "from other", "to other from ego", "from ego to other"])
def test_minimum_distance_is_that_of_boxes(asked: str) -> None:
    """As shapely has it of both boxes."""
    draw = random.Random(asked)
    for _ in range(6):
        places = [(draw.uniform(-6, 6), draw.uniform(-6, 6), draw.uniform(-180, 180)) for _ in range(2)]
        sizes = [(draw.uniform(1, 4), draw.uniform(1, 4)) for _ in range(2)]
        made = [
            f"new Object at ({x}, {y}), facing {turn} deg, with width {width}, with length {length}, "
            "with allowCollisions True, with requireVisible False"
            for (x, y, turn), (width, length) in zip(places, sizes, strict=True)
        ]
        text = f"ego = {made[0]}\nother = {made[1]}\nparam apart = (minimum distance {asked})\n"
        boxes = [
            translate(turned(box(-w / 2, -h / 2, w / 2, h / 2), turn, origin=(0, 0)), x, y)
            for (x, y, turn), (w, h) in zip(places, sizes, strict=True)
        ]
        assert drawn(text)[1].params["apart"] == pytest.approx(boxes[0].distance(boxes[1]), abs=1e-9)
