"""Angles at ties are Scenic's: the null vector's direction is -90 degrees, what lies opposite keeps its sign."""

import math

import pytest
from scenes import compiled

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

PLACED = {
    "new Object beyond ego by (3, 11)": (11.0, -3.0, 0.0),
    "new Object beyond ego.position by 4 from ego": (4.0, 0.0, 0.0),
    "new Object beyond spot by 4 from spot": (4.0, 0.0, 0.0),
    "new Object at spot offset along (angle from spot to spot) by (0, 4)": (4.0, 0.0, 0.0),
    "new Object at spot offset along (angle from ego to ego) by (0, 4)": (4.0, 0.0, 0.0),
    "new Object at (5, 5), facing (angle from ego to ego)": (5.0, 5.0, -math.pi / 2),
    "new Object at (5, 5), facing (angle from spot to spot)": (5.0, 5.0, -math.pi / 2),
    "new Object at (5, 5), facing (apparent heading of ego from ego)": (5.0, 5.0, math.pi / 2),
    "new Object at ego, facing toward ego": (0.0, 0.0, -math.pi / 2),
}


def label(x: float, y: float, heading: float) -> Label:
    ego = LabelObject("ego", "Object", "thing", 0.0, 0.0, 0.0, 2.0, 4.0)
    return Label("f", "r", 0, "street", ego, (LabelObject("o", "Object", "thing", x, y, heading, 1.0, 1.0),))


@pytest.mark.parametrize("method", ["auto", "smt"])
@pytest.mark.parametrize("placed", PLACED)
def test_its_direction_is_to_the_right(placed, method):
    spot = "spot = new OrientedPoint on PointSetRegion('posts', [(0, 0)])"
    text = f"ego = new Object at (0, 0)\n{spot}\n{placed}\n"
    x, y, heading = PLACED[placed]
    matcher = Matcher(compiled(text), MatchOptions(method=method))
    assert isinstance(matcher.match(label(x, y, heading)), Match)
    assert isinstance(matcher.match(label(-x - 1, y, heading)), NoMatch)
    assert isinstance(matcher.match(label(x, y, heading + 1)), NoMatch)


@pytest.mark.parametrize(("condition", "holds"), [("(angle to o) < -3", True), ("(angle to o) > 3", False)])
def test_straight_behind_is_half_a_turn_clockwise(condition, holds):
    text = f"ego = new Object at (0, 0)\no = new Object at (0, -9)\nrequire {condition}\n"
    assert isinstance(Matcher(compiled(text)).match(label(0.0, -9.0, 0.0)), Match) is holds


@pytest.mark.parametrize("ego", [k * math.pi / 4 for k in range(-3, 5)])
@pytest.mark.parametrize("turn", [-math.pi, math.pi])
def test_opposite_ways_are_half_a_turn_apart_in_the_sense_of_their_difference(ego, turn):
    other = ego + turn
    for condition, apart in (("relative heading of o", other - ego), ("relative heading of ego from o", ego - other)):
        for sign in (">", "<"):
            text = f"ego = new Object at (0, 0), facing {ego} \no = new Object at (0, -9), facing {other}\n"
            text += f"require ({condition}) {sign} 0\n"
            seen = Label(
                "f", "r", 0, "street", LabelObject("ego", "Object", "thing", 0.0, 0.0, ego, 2.0, 4.0),
                (LabelObject("o", "Object", "thing", 0.0, -9.0, other, 1.0, 1.0),),
            )  # fmt: skip
            expected = (apart > 0) is (sign == ">")
            assert isinstance(Matcher(compiled(text)).match(seen), Match) is expected, (condition, sign)
