"""What lies on a union of regions has the direction of the part that holds it."""

import math

import pytest
from scenes import compiled

from scenicq.geometry.default_street import street
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

UP = "PolylineRegion([(0, 0), (0, 10)])"
RIGHT = "PolylineRegion([(20, 0), (30, 0)])"
UNIONS = {
    f"{UP} + {RIGHT}": ((0, 5, 0), (25, 0, -90)),
    f"{UP}.union({RIGHT})": ((0, 5, 0), (25, 0, -90)),
    f"Uniform({UP}, {RIGHT}) + {RIGHT}": ((0, 5, 0), (25, 0, -90)),
    "network.lanes[0].union(network.lanes[9])": None,
    "Uniform(network.lanes[0], network.lanes[3]).union(network.lanes[9])": None,
    "Uniform(network.lanes[0].union(network.lanes[9]), network.lanes[3])": None,
}
"""Unions, and the x, y and heading in degrees of places in each of their parts; of lanes, halfway along each."""


def places(union: str) -> tuple[tuple[float, float, float], ...]:
    if UNIONS[union] is not None:
        return UNIONS[union]
    lines = [street().lanes[number].centerline.lines[0] for number in (0, 9)]
    middles = [(line.interpolate(0.5, normalized=True), line.interpolate(0.51, normalized=True)) for line in lines]
    return tuple((p.x, p.y, math.degrees(math.atan2(q.y - p.y, q.x - p.x)) - 90) for p, q in middles)


@pytest.mark.parametrize("union", UNIONS)
def test_each_part_gives_its_own(union):
    matcher = Matcher(compiled(f"model scenic.domains.driving.model\nego = new Object on {union}, with width 0.1\n"))
    for x, y, degrees in places(union):
        for turn, expected in ((0, Match), (40, NoMatch), (180, NoMatch)):
            ego = LabelObject("ego", "Object", "thing", float(x), float(y), math.radians(degrees + turn), 0.1, 1.0)
            verdict = matcher.match(Label("f", "r", 0, "street", ego, ()))
            assert isinstance(verdict, expected), (x, y, degrees, turn)
