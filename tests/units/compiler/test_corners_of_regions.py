"""Corners of polygons and polylines are known points, however they are known; sides of rectangles may be negative."""

import math

import pytest

from scenicq.forest.nodes import Constant, PointIn
from scenicq.forest.walk import postorder
from scenicq.geometry.regions import PolylineSet
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match
from scenicq.store.labels import Label, LabelObject

from .scenes import compiled, refused

HEADER = "model scenic.domains.driving.model\nego = new Car at (1.75, 20), facing 0 deg\n"
AHEAD = {
    "network.lanes[0].flowFrom(Vector(1.75, 20), 4)": (1.75, 24.0),
    "(follow roadDirection from (1.75, 20) for 4)": (1.75, 24.0),
    "(follow roadDirection from Vector(1.75, 20) for 4).position": (1.75, 24.0),
    "(Vector(1.75, 20) offset along roadDirection by (0, 4))": (1.75, 24.0),
    "Vector(1.75, 20) + Vector(0, 4)": (1.75, 24.0),
}


@pytest.mark.parametrize("corner", AHEAD)
def test_where_a_field_with_one_direction_leads_is_known(corner):
    scenario = compiled(f"{HEADER}new Car on PolylineRegion([(1.75, 20), {corner}])\n")
    place = scenario.objects[-1].properties["position"].value
    (point,) = (node for node in postorder([place]) if isinstance(node, PointIn))
    assert isinstance(point.region, Constant)
    assert isinstance(point.region.value, PolylineSet)
    (line,) = point.region.value.lines
    assert line.coords[1] == pytest.approx(AHEAD[corner], abs=1e-6)


@pytest.mark.parametrize(
    "corner", ["(Range(0, 1), 4)", "ego.position", "(follow roadDirection from ego for 4)", "(new Point on road)"]
)
def test_a_random_corner_is_refused(corner):
    code, at = refused(
        f"{HEADER}new Car on PolylineRegion([(1.75, 20), {corner}])\n".replace("at (1.75, 20)", "on road")
    )
    assert code == "unsupported-region"
    assert "PolylineRegion" in at


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
@pytest.mark.parametrize(("width", "length"), [(-4, 6), (4, -6), (-4, -6), (4, 6)])
@pytest.mark.parametrize("size", ["{}", "Uniform({}, {})"])
def test_a_rectangle_is_the_same_with_negative_sides(heading, width, length, size):
    given = size.format(width, width), size.format(length, length)
    text = f"ego = new Object in RectangularRegion((3, -5), {heading}, {given[0]}, {given[1]}), facing 0 deg\n"
    matcher = Matcher(compiled(text))
    for across, ahead in ((1.9, 2.9), (-1.9, 2.9), (-1.9, -2.9), (2.4, 0), (0, 3.4), (-2.4, 0), (0, -3.4)):
        x = 3 + across * math.cos(heading) - ahead * math.sin(heading)
        y = -5 + across * math.sin(heading) + ahead * math.cos(heading)
        label = Label("f", "r", 0, "street", LabelObject("ego", "Object", "thing", x, y, 0.0, 1.0, 1.0), ())
        assert isinstance(matcher.match(label), Match) is (abs(across) < 2 and abs(ahead) < 3), (across, ahead)
