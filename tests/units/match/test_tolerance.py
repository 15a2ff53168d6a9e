"""Tolerances: what the option means, which scope holds for which feature, and that sizes are kept to."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from programs import HEADER
from scenes import compiled, drawn, label_of

from scenicq.errors import DataError
from scenicq.forest.groups import PARAMS
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, SLACK, Margin, Tolerance, parse_tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

PEOPLE = (
    HEADER
    + "ego = new Car\nlead = new Car ahead of ego by 5, with speed 3\nperson = new Pedestrian left of ego by 4\n"
    + "param wind = 3\nrequire (distance to person) < 100\n"
)


@pytest.fixture(scope="module")
def people():
    return compiled(PEOPLE)


def test_the_default_is_that_of_the_query_paper_and_exact_is_for_generated_labels():
    assert parse_tolerance("") == Tolerance() == MatchOptions().tolerance
    assert Tolerance().of(0, "position") == Margin("disc", 0.25, 0.25)
    assert Tolerance().of(0, "heading") == Margin("arc", math.radians(5), math.radians(5))
    assert parse_tolerance("exact") == EXACT
    assert {EXACT.of(0, name).size for name in ("position", "heading", "speed")} == {1e-3}
    assert {parse_tolerance("0.1").of(0, name).size for name in ("position", "heading", "speed")} == {0.1}


def test_units_and_properties():
    given = parse_tolerance("x=0.25m, y=0.5 m,heading=0.1rad,speed=0.5m/s,viewAngle=90deg")
    assert given.of(1, "position") == Margin("box", 0.25, 0.5)
    assert given.of(1, "position").reach == math.hypot(0.25, 0.5)
    assert given.of(1, "position").sure == 0.25 - SLACK
    assert given.of(1, "heading").size == 0.1
    assert given.of(1, "speed").size == 0.5
    assert given.of(1, "viewAngle").size == math.pi / 2
    assert given.of(1, "width").size == 1e-3
    assert parse_tolerance("exact,position=2").of(0, "heading").size == 1e-3


@pytest.mark.parametrize(
    "text",
    [
        "x=1", "x=1,y=1,position=1", "ego.x=1", "ego.x=1,ego.y=1,ego.position=2", "heading=181deg", "position=-1",
        "position=inf", "position=1,position=2", "position=1deg", "heading=1m", ".position=1", "position=1,exact",
        "position=", "heading", "=1",
    ],
)  # fmt: skip
def test_what_is_no_tolerance_is_refused(text):
    with pytest.raises(DataError) as caught:
        parse_tolerance(text)
    assert [each.code for each in caught.value.diagnostics] == ["option-invalid"]


def test_the_most_specific_scope_holds(people):
    text = "position=1,speed=4,wind=5,Vehicle.position=2,Car.heading=7deg,lead.position=3,Object.heading=9deg"
    tolerance = parse_tolerance(text).for_scenario(people)
    ego, lead, person = (
        next(each.index for each in people.objects if each.name == name) for name in ("ego", "lead", "person")
    )
    assert [tolerance.of(index, "position").size for index in (ego, lead, person)] == [2, 3, 1]
    degrees = [round(math.degrees(tolerance.of(index, "heading").size)) for index in (ego, lead, person)]
    assert degrees == [7, 7, 9]
    assert tolerance.of(lead, "speed").size == 4
    assert tolerance.of(PARAMS, "wind").size == 5


def test_a_scope_s_disc_replaces_a_box_of_all_and_the_other_way_round(people):
    tolerance = parse_tolerance("x=1,y=2,lead.position=3").for_scenario(people)
    assert [tolerance.of(index, "position").kind for index in (0, 1)] == ["box", "disc"]
    tolerance = parse_tolerance("lead.x=1,lead.y=3").for_scenario(people)
    assert [tolerance.of(index, "position").kind for index in (0, 1)] == ["disc", "box"]


@pytest.mark.parametrize(
    ("text", "word", "hint"),
    [
        ("leed.position=1", "leed", "`lead`"),
        ("Pedestrain.position=1", "Pedestrain", "`Pedestrian`"),
        ("spede=1", "spede", "`speed`"),
        ("wheel=1", "wheel", "position"),
    ],
)
def test_an_unknown_scope_or_property_is_named_with_what_is_similar(people, text, word, hint):
    with pytest.raises(DataError) as caught:
        Matcher(people, MatchOptions(tolerance=parse_tolerance(text)))
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "option-invalid"
    assert word in diagnostic.message
    assert hint in diagnostic.hints[0]


@pytest.mark.parametrize(
    "text",
    ["position=0.25,heading=5deg", "x=0.25,y=0.5,heading=2.5deg", "0.1,ego.heading=15deg", "position=1,speed=0.5"],
)
def test_the_text_of_a_tolerance_says_the_same(text):
    tolerance = parse_tolerance(text)
    again = parse_tolerance(str(tolerance))
    for index, name in ((0, "position"), (0, "heading"), (0, "speed"), (1, "heading")):
        assert again.of(index, name).size == pytest.approx(tolerance.of(index, name).size, abs=2e-4)


@pytest.mark.parametrize(
    ("tolerance", "text"),
    [
        (Tolerance(position=0.12345, heading=math.radians(4.999)), "position=0.124,heading=5deg"),
        (Tolerance(position=2 / 3, heading=math.radians(1 / 3)), "position=0.667,heading=0.34deg"),
        (Tolerance(position=0.25, heading=4.0), "position=0.25,heading=180deg"),
        (Tolerance(x=0.1, y=0.2004, other=0.5), "0.5,x=0.1,y=0.201,heading=5deg"),
        (
            Tolerance(rules=(("", "speed", 1.0001), ("ego", "heading", 0.1))),
            "position=0.25,heading=5deg,speed=1.001,ego.heading=5.73deg",
        ),
    ],
)
def test_a_tolerance_is_shown_rounded_up(tolerance, text):
    assert str(tolerance) == text


@pytest.mark.parametrize(
    ("scope", "tolerant"),
    [("lead", {"Car"}), ("person", {"Pedestrian"}), ("Pedestrian", {"Pedestrian"}), ("Object", {"Car", "Pedestrian"})],
)
@pytest.mark.parametrize("method", ["auto", "smt", "monolithic"])
def test_a_displaced_object_matches_within_its_own_scope_only(people, method, scope, tolerant):
    label = label_of(people, drawn(people, 1), random.Random(1))
    tolerance = parse_tolerance(f"exact,{scope}.position=1")
    matcher = Matcher(people, MatchOptions(tolerance=tolerance, method=method))
    for victim in label.objects:
        moved = [replace(each, x=each.x + 0.6) if each is victim else each for each in label.objects]
        verdict = matcher.match(replace(label, objects=tuple(moved)))
        assert isinstance(verdict, Match if victim.category in tolerant else NoMatch), (victim.category, verdict)


@pytest.mark.parametrize("loose", ["a", "b"])
def test_objects_with_tolerances_of_their_own_are_not_interchangeable(loose):
    ahead = "new Car offset by (0, 6), facing ego.heading, with allowCollisions True\n"
    scenario = compiled(f"{HEADER}ego = new Car\na = {ahead}b = {ahead}")
    ego = LabelObject("ego", "Car", "Car", 2.0, 0.0, 0.0, 2.0, 4.5)
    near = LabelObject("near", "Car", "Car", 2.0, 6.0, 0.0, 2.0, 4.5)
    off = replace(near, id="off", x=2.6)
    scoped = MatchOptions(tolerance=parse_tolerance(f"exact,{loose}.position=1"))
    plain = Matcher(scenario, MatchOptions(tolerance=EXACT))
    for objects in ((near, off), (off, near)):
        label = Label("frame", "recording", 0, "street", ego, objects)
        assert isinstance(plain.match(label), NoMatch)
        # what was found out of the scenario without scopes is of no use with them
        for matcher in (Matcher(scenario, scoped), plain.relaxed(scoped)):
            # by first fit, and by the search, which knows who may be swapped
            for verdict in (matcher.match(label), matcher.examine(label).verdict):
                assert isinstance(verdict, Match), verdict
                assert verdict.correspondence[loose] == "off"
