"""Explanations: the closest correspondence, what it breaks, the smallest tolerance, and the formulas."""

from __future__ import annotations

import math

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.limits import Beyond, Limits
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import show_value
from scenicq.match.tolerance import EXACT, Tolerance, parse_tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.explain.changes import show_tolerance
from scenicq.query.explain.frame_explanation import REASONS, explain, show_explanation
from scenicq.query.explain.nearest_miss import closest, narrow_advice, widen_tolerance
from scenicq.store.labels import Label, LabelObject

STREET = street()
TEXT = """model scenic.domains.driving.model
ego = new Car
other = new Car ahead of ego by Range(4, 10),
    facing Range(-10, 10) deg relative to ego.heading
"""


def matcher(text=TEXT, **options):
    return Matcher(
        compile_scenario(Source("test.scenic", text), STREET), MatchOptions(**{"tolerance": EXACT, **options})
    )


def car(name, x, y, heading=0.0):
    return LabelObject(name, "Car", "car", x, y, heading, 2.0, 4.5)


EGO = car("ego", 1.75, 50.0)


def frame(*objects):
    return Label("f1", "r", 0, "street", EGO, objects)


def test_a_match_is_explained_by_its_values():
    found = explain(matcher(), frame(car("a", 1.75, 60.0)))
    assert isinstance(found.verdict, Match)
    values = {proof.span.text: proof.value for proof in found.proofs if proof.span.source.name == "test.scenic"}
    assert values["Range(4, 10)"] == pytest.approx(5.5)
    assert values["Range(-10, 10)"] == pytest.approx(0.0)
    text = show_explanation(found)
    assert "frame f1 matches" in text
    assert "ego = ego, other = a" in text
    assert "test.scenic:3:33" in text


def test_a_heading_outside_of_its_interval_shows_value_interval_and_distance():
    turned = car("a", 1.75, 60.0, math.radians(47))
    found = explain(matcher(), frame(turned, car("b", 40.0, 80.0)))
    assert isinstance(found.verdict, NoMatch)
    assert found.correspondence == {"ego": "ego", "other": "a"}
    (violation,) = found.violations
    assert violation.what == "other.heading"
    assert violation.value == "is 47.0 deg"
    assert violation.allowed == "allowed: -10.0 deg to 10.0 deg; 37.0 deg off"
    assert violation.span.text.startswith("facing Range")
    text = show_explanation(found)
    assert "4 |     facing Range(-10, 10) deg relative to ego.heading" in text
    assert "^^^^" in text


def test_a_position_off_its_place_shows_how_far():
    found = explain(matcher(), frame(car("a", 4.75, 60.0)))
    assert [violation.what for violation in found.violations] == ["other.position"]
    assert found.violations[0].allowed == "3.00 m off"
    assert found.closest.widening_m == pytest.approx(3.0, rel=0.02)


def test_a_requirement_shows_both_sides_and_no_tolerance_helps():
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Car\nrequire (distance to other) < 20\n"
    found = explain(matcher(text), frame(car("a", 1.75, 80.0)))
    assert found.closest is None
    (violation,) = found.violations
    assert violation.allowed == "30 m < 20 m is false"
    assert "no tolerance would make it match" in show_explanation(found)


def test_what_a_label_does_not_tell_is_undecided_and_not_excluded():
    found = explain(matcher(TEXT + "require other.speed > 1\n"), frame(car("a", 1.75, 60.0)))
    assert isinstance(found.verdict, Unknown)
    (violation,) = found.violations
    assert violation.reason == found.verdict.reason == "unobserved"
    text = show_explanation(found)
    assert text.startswith("frame f1 is undecided: unobserved\n")
    assert "undecided[frame-undecided]: " in text
    assert "is not decided: the label does not tell what the program asks" in text
    assert "other.speed is not observed" in text
    assert "excluded" not in text


def test_each_reason_of_a_limit_is_said_in_words():
    limits = Limits.__dataclass_fields__.values()
    reasons = {each.metadata["more"] for each in limits if each.metadata["beyond"] is Beyond.UNDECIDED}
    assert {each for each in reasons if " " not in each} <= REASONS.keys()


def test_a_missing_class_is_said():
    found = explain(matcher(), frame())
    assert found.violations[0].what == "other.class"
    assert "no Car" in show_explanation(found)


def test_formulas_are_smtlib_with_their_verdicts():
    found = explain(matcher(), frame(car("a", 4.75, 60.0)), formulas=True)
    verdicts = {formula.name: "verdict: unsat" in formula.text for formula in found.formulas}
    assert [name.partition("-")[2] for name, unsat in verdicts.items() if unsat] == ["other.position"]
    for formula in found.formulas:
        assert "(check-sat)" in formula.text


@pytest.mark.parametrize("widening", [0.0, 0.3, 2.0, 50.0])
@pytest.mark.parametrize("base", [Tolerance(), Tolerance(x=0.2, y=0.3, heading=0.1)])
def test_widening_is_monotone_in_every_part(widening, base):
    small, large = widen_tolerance(base, widening), widen_tolerance(base, widening + 0.1)
    assert large.position > small.position >= base.position
    assert large.other > small.other
    assert math.pi >= large.heading >= small.heading >= base.heading
    if base.x is not None:
        assert large.x > small.x
        assert large.y > small.y


@pytest.mark.parametrize(("x", "heading"), [(1.8, 0.0), (4.75, 0.0), (1.75, 1.0), (3.0, 0.6), (60.0, 2.0)])
def test_the_smallest_tolerance_is_smallest_and_is_enough(x, heading):
    label = frame(car("a", x, 60.0, heading))
    found = closest(matcher(), label)
    assert found is not None
    # the same as by hand: metres to the line, degrees to the interval at 20 degrees a metre
    turned = max(0.0, heading - math.radians(10)) / math.radians(20)
    wanted = max(abs(x - 1.75), turned) - 1e-3
    assert found.widening_m == pytest.approx(wanted, rel=0.02, abs=4e-3)
    assert isinstance(matcher(tolerance=found.tolerance).match(label), Match)
    too_small = widen_tolerance(EXACT, 0.95 * wanted - 2e-3)
    assert isinstance(matcher(tolerance=too_small).match(label), NoMatch)


def test_a_shown_tolerance_is_never_too_small():
    shown = show_tolerance(Tolerance(position=0.12341, heading=math.radians(5.001)))
    assert shown == "position=0.124,heading=5.01deg"
    assert show_tolerance(Tolerance(x=1.0, y=2.0, heading=0.0)) == "x=1,y=2,heading=0deg"


def test_no_number_is_shown_as_minus_zero():
    assert show_value("heading", -1e-9) == "0.0 deg"
    assert show_value("position", (-1e-9, -0.001)) == "(0.00, 0.00)"
    assert show_value("width", -0.0) == "0"


def test_what_matches_needs_no_wider_tolerance():
    assert closest(matcher(), frame(car("a", 1.75, 60.0))).widening_m == 0


def advised(label, text=TEXT, **options):
    mine = matcher(text, **options)
    return narrow_advice(mine, label, closest(mine, label))


def test_a_part_that_is_enough_alone_is_advised_alone():
    found = advised(frame(car("a", 4.0, 60.0)), tolerance=Tolerance())
    assert len(found.alone) == 1
    assert found.alone[0].position == pytest.approx(2.25, abs=2e-3)
    assert show_tolerance(found.alone[0]).startswith("position=2.25")
    found = advised(frame(car("a", 1.75, 60.0, math.radians(50))), tolerance=Tolerance())
    assert len(found.alone) == 1
    assert math.degrees(found.alone[0].heading) == pytest.approx(40, abs=0.05)


def test_a_size_is_advised_by_its_name():
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Car with width Range(1, 1.5)\n"
    found = advised(frame(car("a", 1.75, 60.0)), text, tolerance=Tolerance())
    assert len(found.alone) == 1
    assert found.alone[0].of(1, "width").size == pytest.approx(0.5, abs=2e-3)
    assert show_tolerance(found.alone[0]).startswith("width=0.50")


def test_where_several_parts_are_needed_none_is_wider_than_it_must_be():
    label = frame(car("a", 4.0, 60.0, math.radians(30)))
    found = advised(label, tolerance=Tolerance())
    assert found.alone == ()
    assert found.tolerance.position == pytest.approx(2.25, abs=0.03)
    assert math.degrees(found.tolerance.heading) == pytest.approx(20, abs=0.5)
    assert isinstance(matcher(tolerance=found.tolerance).match(label), Match)
    for fewer in (
        Tolerance(position=2.2, heading=found.tolerance.heading),
        Tolerance(position=found.tolerance.position, heading=math.radians(19.5)),
    ):
        assert isinstance(matcher(tolerance=fewer).match(label), NoMatch)


@pytest.mark.parametrize("scope", ["", "ego.heading=15deg,", "Car.position=0.5,", "x=0.2,y=0.3,"])
def test_what_is_advised_is_enough_as_the_option_takes_it(scope):
    for x, heading in ((4.0, 0.0), (1.75, 1.0), (3.0, 0.6), (9.0, 2.0)):
        label = frame(car("a", x, 60.0, heading))
        found = advised(label, tolerance=parse_tolerance(f"{scope}heading=4deg"))
        for each in found.alone or (found.tolerance,):
            assert isinstance(matcher(tolerance=parse_tolerance(show_tolerance(each))).match(label), Match)


def test_an_explained_match_shows_values_what_is_allowed_and_what_is_to_spare():
    text = TEXT + "require (distance to other) < 20 and abs(relative heading of other) < 30 deg\n"
    found = explain(matcher(text), frame(car("a", 1.75, 60.0, math.radians(4))))
    told = {each.what: (each.value, each.allowed, each.spare) for each in found.margins}
    assert told["other.heading"] == ("4.0 deg", "allowed: -10.0 deg to 10.0 deg", "6.0 deg to spare")
    assert told["(distance to other) < 20"] == ("10 m < 20 m", "", "10 m to spare")
    assert told["abs(relative heading of other) < 30 deg"] == ("4.0 deg < 30.0 deg", "", "26.0 deg to spare")
    assert "what the label shows:" in show_explanation(found)


def test_an_explained_match_says_where_the_tolerance_is_needed():
    found = explain(matcher(tolerance=Tolerance()), frame(car("a", 1.75, 60.0, math.radians(12))))
    (heading,) = (each for each in found.margins if each.what == "other.heading")
    assert heading.spare == "2.0 deg off, within tolerance"


def test_a_requirement_of_a_whole_box_says_so():
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Car\nrequire other in intersection\n"
    found = explain(matcher(text), frame(car("a", 1.75, 80.0)))
    assert "`.position in` asks of the centre alone" in show_explanation(found)
