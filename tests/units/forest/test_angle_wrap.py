"""Headings as numbers: in (-180, 180] degrees for Scenic 3, as they are written before; matching counts no turns."""

from __future__ import annotations

import math
import random

import pytest
from drawing import draw_scene

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest import build
from scenicq.forest.angle_wrap import any_turn, one_turn
from scenicq.forest.improvise import Scene
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Range
from scenicq.forest.scenario import Scenario
from scenicq.geometry.default_street import street
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

STREET = street()
D = math.radians


def compiled(text: str, version: int) -> Scenario:
    new = "new " if version == 3 else ""
    return compile_scenario(Source("test.scenic", text.replace("NEW ", new)), STREET, version=version)


def drawn(text: str, version: int, seed: int = 0) -> Scene | None:
    return draw_scene(compiled(text, version), random.Random(seed))


@pytest.mark.parametrize(
    ("angle", "number"), [("200 deg", -160), ("-190 deg", 170), ("540 deg", 180), ("180 deg", 180), ("-90 deg", -90)]
)
def test_the_heading_of_an_object_as_a_number(angle: str, number: float) -> None:
    text = f"ego = NEW Object facing {angle}\nparam once = ego.heading, twice = ego.heading * 2\n"
    for version, expected in ((3, number), (2, float(angle.split(maxsplit=1)[0]))):
        scene = drawn(text, version)
        assert scene is not None
        assert scene.params == {"once": pytest.approx(D(expected)), "twice": pytest.approx(D(2 * expected))}


def test_what_is_computed_from_a_random_heading_takes_it_within_one_turn() -> None:
    text = "ego = NEW Object facing Range(190, 200) deg\nother = NEW Object ahead of ego by 9, facing ego.heading / 2\n"
    for version, (low, high) in ((3, (-85, -80)), (2, (95, 100))):
        for seed in range(10):
            scene = drawn(text, version, seed)
            assert scene is not None
            assert D(low) <= scene.values[1, "heading"] <= D(high)  # type: ignore[operator]


def test_requirements_ask_for_the_number_within_one_turn() -> None:
    below = "ego = NEW Object facing 200 deg\nrequire ego.heading < 0\n"
    assert drawn(below, 3) is not None
    assert drawn(below, 2) is None
    beyond = "ego = NEW Object facing Range(100, 200) deg\nrequire ego.heading > 180 deg\n"
    assert drawn(beyond, 3) is None
    assert drawn(beyond, 2) is not None


@pytest.mark.parametrize(
    ("degrees", "matches"), [(195, True), (-165, True), (195 + 360, True), (185, False), (-155, False), (15, False)]
)
@pytest.mark.parametrize("version", [2, 3])
def test_a_label_matches_whatever_turns_its_heading_has(version: int, degrees: float, matches: bool) -> None:
    scenario = compiled("x = Range(190, 200) deg\nego = NEW Object facing x, at 3 @ 4\n".replace(
        "3 @ 4", "(3, 4)" if version == 3 else "3 @ 4"), version)  # fmt: skip
    ego = LabelObject("ego", "Object", "Object", 3.0, 4.0, D(degrees), 1.0, 1.0)
    verdict = Matcher(scenario, MatchOptions(tolerance=EXACT)).match(Label("frame", "recording", 0, "street", ego, ()))
    assert isinstance(verdict, Match if matches else NoMatch)


def test_wrapping_is_left_out_where_it_changes_nothing() -> None:
    within, beyond = (Range(build.constant(-1.0), build.constant(high)) for high in (3.0, 4.0))
    assert one_turn(within) is within
    wrapped = one_turn(beyond)
    assert isinstance(wrapped, Arithmetic)
    assert wrapped.op is ArithmeticOp.WRAP
    assert any_turn(wrapped) is beyond
    # half of a heading is another one for each turn: there the wrapping stays
    half = build.arithmetic(ArithmeticOp.MUL, wrapped, build.constant(0.5))
    assert any_turn(half) is half
    double = any_turn(build.arithmetic(ArithmeticOp.MUL, wrapped, build.constant(2.0)))
    assert isinstance(double, Arithmetic)
    assert double.args[0] is beyond
