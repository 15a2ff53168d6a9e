"""Comparisons of random values: truth values that are used as numbers, and vectors that are looked for in lists."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from drawing import draw_scene

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

from .scenes import compiled, value

A = "a = Range(0, 10)\n"
NUMBERS = {
    "a coordinate": "ego = new Object at (a > 5, a)\n",
    "the end of a range": "ego = new Object at (a, Range(0, a > 5))\n",
    "a heading": "ego = new Object at (a, 0), facing (a > 5)\n",
    "a term": "ego = new Object at (a, 2 * (a > 5))\n",
    "an argument": "ego = new Object at (a, max(a > 5, 0.5))\n",
    "made whole": "ego = new Object at (a, int(a > 5))\n",
    "joined": "ego = new Object at (a, 3 < a < 8 or not (a > 2))\n",
    "a choice": "b = Uniform(1, 2)\nego = new Object at (b == 1, b + Uniform(True, 4))\n",
    "hidden": "c = Range(0, 10)\nego = new Object at (a, 0)\nrequire (c > a) + (c > 5) + (c < 2) == 2\n",
    "compared": "c = Range(0, 10)\nego = new Object at (a, 0)\nrequire (c > a) == (c > 5)\n",
    "a property": "ego = new Object at (a, 1), with odd (a > 5)\nnew Object at (20, 10 + ego.odd)\n",
}


def label(*places: tuple[float, float, float]) -> Label:
    ego, *others = (LabelObject(f"o{n}", "Object", "Object", *place, 1.0, 1.0) for n, place in enumerate(places))
    return Label("frame", "recording", 0, "street", ego, tuple(others))


@pytest.mark.parametrize("method", ["auto", "smt"])
@pytest.mark.parametrize("name", NUMBERS)
def test_a_truth_value_is_one_or_zero_where_a_number_is_needed(name: str, method: str) -> None:
    scenario = compiled(A + NUMBERS[name])
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT, method=method))  # type: ignore[arg-type]
    for seed in range(3):
        scene = draw_scene(scenario, random.Random(seed))
        assert scene is not None
        drawn = label(*[
            (*scene.values[n, "position"], scene.values[n, "heading"])  # type: ignore[misc]
            for n in range(len(scenario.objects))
        ])  # fmt: skip
        assert isinstance(matcher.match(drawn), Match), drawn
        beside = replace(drawn.ego, y=drawn.ego.y + 0.37, heading=drawn.ego.heading + 0.1)  # type: ignore[operator]
        assert isinstance(matcher.match(replace(drawn, ego=beside)), NoMatch), beside


@pytest.mark.parametrize(
    ("place", "matches"),
    [((4, 0), True), ((6, 1), True), ((4, 1), False), ((6, 0), False), ((6, 0.5), False), ((11, 1), False)],
)
def test_a_truth_value_depends_on_what_it_is_about(place: tuple[float, float], matches: bool) -> None:
    matcher = Matcher(compiled(A + "ego = new Object at (a, a > 5)\n"), MatchOptions(tolerance=EXACT))
    assert isinstance(matcher.match(label((*place, 0.0))), Match if matches else NoMatch)


def test_known_truth_values_are_numbers_as_in_python() -> None:
    assert value("(True, False) offset by (1, 2)") == (2.0, 2.0)
    assert value("max(True, 0.5)") == 1.0


P = "p = Uniform((1, 2), (3, 4), (5, 6))\nego = new Object at p\n"


@pytest.mark.parametrize(
    ("requirement", "left"),
    [
        ("p in [(1, 2), (5, 6), (7, 8)]", {(1, 2), (5, 6)}),
        ("ego.position in ((1, 2), (3, 4))", {(1, 2), (3, 4)}),
        ("p not in [(1, 2), (5, 6)]", {(3, 4)}),
        ("(3, 4) in [p, (0, 0)]", {(3, 4)}),
    ],
)
def test_a_vector_is_in_a_list_if_it_equals_an_item(requirement: str, left: set[tuple[int, int]]) -> None:
    scenario = compiled(f"{P}require {requirement}\n")
    scenes = [draw_scene(scenario, random.Random(seed)) for seed in range(20)]
    assert {scene.values[0, "position"] for scene in scenes if scene is not None} == left
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    for place in ((1, 2), (3, 4), (5, 6), (7, 8)):
        verdict = matcher.match(label((float(place[0]), float(place[1]), 0.0)))
        assert isinstance(verdict, Match if place in left else NoMatch), place


def test_known_vectors_in_lists() -> None:
    assert value("(1, 2) in [(1, 2), (3, 4)]") is True
    assert value("(1, 3) in [(1, 2), (3, 4)]") is False
    assert value("ego.position in [(3, -4)]") is True


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("(ego.width, o.width) == (1, 1)", True),
        ("[ego.position.x > 5, 1] == [False, 1]", True),
        ("(ego.position.x, 0) == (3, 0)", False),
        ("(ego.position.x, 0) != (3, 0)", True),
        ("(ego.position.x, 0) == (0, 0)", True),
        ("not (ego.position.x, o.position.x) != (0, 7)", True),
        ("not ((ego.position.x, 0) == [0, 0]) and not ((ego.position.x, 0) == (0,))", True),
        ("(ego.position.x, 'a') == (0, 'b')", False),
    ],
)
def test_lists_that_hold_what_a_scene_says_are_compared_item_by_item(condition: str, holds: bool) -> None:
    objects = "ego = new Object at (Range(-9, 9), 0)\no = new Object at (Range(-9, 9), 5)\n"
    scenario = compiled(f"{objects}require {condition} or o.position.x > 8\n")
    found = Matcher(scenario, MatchOptions(tolerance=EXACT)).match(label((0.0, 0.0, 0.0), (7.0, 5.0, 0.0)))
    assert isinstance(found, Match if holds else NoMatch)
