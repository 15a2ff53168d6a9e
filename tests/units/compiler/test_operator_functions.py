"""An operator that is called as a function is the operator that is written as a phrase."""

import random

import pytest
from drawing import draw_scene

from .scenes import compiled, refused

THINGS = """model scenic.domains.driving.model
ego = new Object at (1, 2), facing 20 deg, with regionContainedIn everywhere
a = new Object at (5, 9), facing 70 deg, with regionContainedIn everywhere
b = new Object at (-3, 8), facing -60 deg, with regionContainedIn everywhere
disc = CircularRegion((9, 9), 2)
"""
FUNCTIONS = {
    "FieldAt(roadDirection, a)": "roadDirection at a",
    "RelativeTo(3, a.heading)": "3 relative to a.heading",
    "RelativeTo((1, 2), b).position.x": "((1, 2) relative to b).position.x",
    "OffsetAlong(a, b.heading, (3, 4)).y": "(a offset along b.heading by (3, 4)).y",
    "Follow(roadDirection, a, 8).position.y": "(follow roadDirection from a for 8).position.y",
    "RelativePosition(a).x": "(relative position of a).x",
    "RelativePosition(a, b).x": "(relative position of a from b).x",
    "RelativeHeading(a)": "relative heading of a",
    "RelativeHeading(a, b)": "relative heading of a from b",
    "ApparentHeading(a)": "apparent heading of a",
    "ApparentHeading(a, b)": "apparent heading of a from b",
    "DistanceFrom(a)": "distance to a",
    "DistanceFrom(disc, b)": "distance from disc to b",
    "DistancePast(a)": "distance past a",
    "DistancePast(a, b)": "distance past a of b",
    "AngleTo(a)": "angle to a",
    "AngleFrom(a, b)": "angle from a to b",
    "CanSee(a, b)": "a can see b",
    "Intersects(a, b)": "a intersects b",
    "Implies(1 < 2, 2 < 1)": "not (1 < 2) or 2 < 1",
    "distance to Visible(disc)": "distance to (visible disc)",
    "distance to NotVisible(disc)": "distance to (not visible disc)",
    "distance to VisibleFromOp(disc, b)": "distance to (disc visible from b)",
    "distance to NotVisibleFromOp(disc, b)": "distance to (disc not visible from b)",
    "Front(a).position.x": "(front of a).position.x",
    "BackLeft(a).position.x": "(back left of a).position.x",
    "RelativeHeading(Uniform(a, b))": "relative heading of Uniform(a, b)",
}


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.one_in(3)
def test_it_is_the_phrase(function: str) -> None:
    random_choice = "Uniform" in function
    same = [f"param p = {function}\n"] if random_choice else [f"param p = {function}, q = {FUNCTIONS[function]}\n"]
    scene = draw_scene(compiled(THINGS + same[0]), random.Random(1))
    other = draw_scene(compiled(THINGS + f"param q = {FUNCTIONS[function]}\n"), random.Random(1))
    assert scene is not None
    assert other is not None
    assert scene.params["p"] == pytest.approx(other.params["q"])


@pytest.mark.parametrize(
    "call", ["RelativeHeading()", "RelativeTo(1)", "AngleTo(ego, ego)", "FieldAt(roadDirection)", "Front()"]
)
def test_it_takes_what_the_phrase_takes(call: str) -> None:
    assert refused(f"{THINGS}x = {call}\n")[0] == "wrong-arity"


def test_a_program_may_use_the_name_for_something_else() -> None:
    scene = draw_scene(compiled(THINGS + "Front = 3\nparam p = Front\n"), random.Random(1))
    assert scene is not None
    assert scene.params["p"] == 3
