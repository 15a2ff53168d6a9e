"""A region that is chosen at random has what each of its options has."""

from __future__ import annotations

import random

import pytest
import shapely
from drawing import draw_scene

from scenicq.forest.improvise import Scene
from scenicq.forest.scenario import Scenario

from .scenes import compiled, drawn, network

MODEL = "model scenic.domains.driving.model\nego = new Object at (3, 20), with regionContainedIn everywhere\n"


def scene_of(scenario: Scenario, seed: int) -> Scene:
    scene = draw_scene(scenario, random.Random(seed))
    assert scene is not None
    return scene


LANES = [0, 9, 14]
"""Numbers of lanes that differ in all that is asked."""
LINES = (
    "start.position.x", "end.heading", "points[1].x", "length", "pointAlongBy(7).y", "pointAlongBy(0.25, True).x",
    "project((3, 20)).y",
)  # fmt: skip
REGIONS = (
    "distanceTo((70, -33))", "containsPoint((1.75, 20))", "containsObject(ego)", "intersects(network.roads[0])",
    "union(circular_region)", "intersect(circular_region)", "difference(circular_region)",
)  # fmt: skip
ASKED = [
    *(f"{{}}.centerline.{each}" for each in LINES), "{}.leftEdge.length",
    "{}.boundary.length", "{}.centerline[1].x", "{}.centerline[-1].y", "(70, 3) in {}.footprint",
    *(f"{{}}.{each}" for each in REGIONS[:4]),
    *(f"(distance from (99, 5) to {{}}.{each})" for each in REGIONS[4:]),
    *(f"{{}}.centerline.{each}" for each in REGIONS[:1]),
    "({}.orientation at (3, 20))",
]  # fmt: skip


@pytest.mark.parametrize("question", ASKED)
def test_it_has_what_the_option_has(question: str) -> None:
    starts = {network().lanes[lane].centerline.lines[0].coords[0]: lane for lane in LANES}
    asked = question.replace("circular_region", "CircularRegion((0, 20), 30)")
    each = ", ".join(f"a{lane} = {asked.format(f'network.lanes[{lane}]')}" for lane in LANES)
    options = ", ".join(f"network.lanes[{lane}]" for lane in LANES)
    text = f"{MODEL}zone = Uniform({options})\n"
    scenario = compiled(
        f"{text}param answer = {asked.format('zone')}, {each}, start = zone.centerline.start.position\n"
    )
    seen = set()
    for seed in range(4):
        params = scene_of(scenario, seed).params
        lane = starts[params["start"]]  # type: ignore[index]
        assert params["answer"] == pytest.approx(params[f"a{lane}"])  # type: ignore[index]
        seen.add(lane)
    assert len(seen) > 1


@pytest.mark.parametrize("method", ["difference", "union", "intersect"])
def test_a_choice_of_many_takes_as_many_steps_as_one(method: str) -> None:
    many = "many = [lane for k in range(60) for lane in network.lanes]\nzone = Uniform(*Uniform(*many).group.lanes)\n"
    compiled(f"{MODEL}{many}new Object on zone.{method}(network.roads[0])\n")


BENT = [(0.0, 0.0), (4.0, 0.0), (10.0, 0.0), (10.0, 10.0), (13.0, 14.0)]
DISTANCES = (("Range(0, 9)", 1), ("Range(-40, 40)", 1), ("Range(-9, -2)", 1), ("Range(11, 90)", 1), ("Range(0, 1)", 25))
"""Distances, and what they are multiplied by where they are shares of the length."""


@pytest.mark.parametrize(("distance", "factor"), DISTANCES)
def test_a_point_at_a_random_distance_is_where_shapely_puts_it(distance: str, factor: int) -> None:
    share = ", normalized=True" if factor > 1 else ""
    scenario = compiled(
        f"{MODEL}path = PolylineRegion({BENT})\nD = {distance}\nend = path.pointAlongBy(D{share})\n"
        "param far = D, x = end.x, y = end.y\n"
    )
    for seed in range(8):
        params = scene_of(scenario, seed).params
        point = shapely.LineString(BENT).interpolate(params["far"] * factor)  # type: ignore[operator]
        assert (params["x"], params["y"]) == pytest.approx((point.x, point.y))


@pytest.mark.parametrize("seed", range(8))
def test_a_point_is_projected_where_shapely_puts_it(seed: int) -> None:
    scenario = compiled(
        f"{MODEL}path = PolylineRegion({BENT})\np = new Point at (Range(-5, 20), Range(-5, 20))\n"
        "near = path.project(p)\nparam px = p.position.x, py = p.position.y, x = near.x, y = near.y\n"
    )
    params = scene_of(scenario, seed).params
    line = shapely.LineString(BENT)
    point = line.interpolate(line.project(shapely.Point(params["px"], params["py"])))
    assert (params["x"], params["y"]) == pytest.approx((point.x, point.y))
    known = drawn(f"{MODEL}near = PolylineRegion({BENT}).project(({params['px']}, {params['py']}))\n"
                  "param x = near.x, y = near.y\n")[1].params  # fmt: skip
    assert (known["x"], known["y"]) == pytest.approx((point.x, point.y))


SAME = {"a is b": True, "a == b": True, "a is not b": False, "a != b": False, "not (b == a)": False, "b is a": True}


@pytest.mark.parametrize("condition", SAME)
@pytest.mark.one_in(8)
def test_two_choices_of_many_elements_are_compared(condition: str) -> None:
    """A scene has one of 10^5 outcomes; nested choices and those that share nothing are compared as well."""
    many = "many = [lane for k in range(15) for lane in network.lanes]\n"
    drawn_from = "a, b = Uniform(*many), Uniform(*Uniform(*many).group.lanes)\n"
    ends = "".join(
        f"{x} = distance from a.centerline.{x}.position to b.centerline.{x}.position\n" for x in ("start", "end")
    )
    scenario = compiled(f"{MODEL}{many}{drawn_from}{ends}param apart = start + end, says = {condition}\n")
    for seed in range(6):
        params = scene_of(scenario, seed).params
        assert bool(params["says"]) == (SAME[condition] == (params["apart"] < 1e-6))
    apart = "a, b = Uniform(*network.lanes[:2]), Uniform(*network.lanes[2:4])\n"
    assert drawn(f"{MODEL}{apart}param says = {condition}\n")[1].params["says"] == (not SAME[condition])
