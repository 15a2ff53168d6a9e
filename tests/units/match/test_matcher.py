"""Algorithm 1 on labels made by hand: what is compared, who may play whom, and that unknown never becomes no."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest
from left_to_solvers import leave_to_solvers
from programs import HEADER, PROGRAMS
from scenes import compiled, drawn, label_of

from scenicq.errors import CannotEvaluate
from scenicq.forest.scenario import BuiltIn
from scenicq.match.decide import solver_step
from scenicq.match.linear import linear_program
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem import conditioned
from scenicq.match.problem.outcome import Undecided
from scenicq.match.search import group_cache, group_plan
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.smt.answer import NoAnswer, Sat, Unsat
from scenicq.smt.worker_solver import WorkerSolver
from scenicq.store.labels import Label, LabelObject

EGO = LabelObject("ego", "Car", "car", 1.75, 50.0, 0.0, 2.0, 4.5)


def car(name, x, y, heading=0.0, **more):
    return LabelObject(name, more.pop("category", "Car"), "car", x, y, heading, more.pop("width", 2.0), 4.5, **more)


def frame(*objects, ego=EGO, **params):
    return Label("frame", "recording", 0, "street", ego, objects, params)


def verdict(text, label, solver=None, **options):
    return Matcher(compiled(HEADER + text), MatchOptions(**options), solver).match(label)


class Fixed:
    """A solver with one answer."""

    name = "fixed"

    def __init__(self, answer):
        self.answer = answer
        self.calls = 0

    def loads(self):
        return True

    def check(self, problem, *, precision, timeout_s):
        self.calls += 1
        return self.answer


class Absent(Fixed):
    """A solver that is not there."""

    def __init__(self):
        super().__init__(None)

    def loads(self):
        return False


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("Uniform(1, 2)", True), ("Uniform(0, 1)", True), ("Uniform(None, 1)", True), ("Uniform(True, 2)", True),
        ("not Uniform(0, 1)", True), ("Uniform(0, 1) and a.position.y > 11", False),
        ("Uniform(a.position.y * 0, a.position.y * 2)", True), ("Uniform(a.position.y - 10, 0)", False),
    ],
)  # fmt: skip
def test_a_choice_of_numbers_is_a_condition(condition, holds):
    """As in Python, a number that is not zero is true."""
    found = verdict(f"ego = new Car\na = new Car\nrequire {condition}\n", frame(car("a", 0.0, 10.0)))
    assert isinstance(found, Match if holds else NoMatch)


NONLINEAR = (
    "angle = Range(-20, 20) deg\nego = new Car\nother = new Car offset along angle relative to ego.heading by "
    "(0, Range(5, 10)), facing angle relative to ego.heading"
)
THERE = car("there", 1.75, 57.0)


# --- what is compared


@pytest.mark.parametrize(
    ("given", "expected"),
    [({"weather": "rain"}, Match), ({"weather": "snow"}, NoMatch), ({}, Match), ({"map": "elsewhere"}, Match)],
)
@pytest.mark.parametrize("method", ["auto", "smt", "monolithic"])
def test_a_param_is_compared_where_the_label_has_it(given, expected, method):
    text = "param weather = Uniform('sun', 'rain')\nparam time = 12\nego = new Car"
    assert isinstance(verdict(text, frame(**given), method=method), expected)


def test_a_param_can_be_ignored():
    text = "param time = Range(10, 12)\nego = new Car"
    assert isinstance(verdict(text, frame(time=13.0)), NoMatch)
    assert isinstance(verdict(text, frame(time=13.0), ignore_params=frozenset({"time"})), Match)


def test_a_mutated_object_excludes_nothing_but_what_it_was_placed_by_does():
    text = "ego = new Car\nother = new Car ahead of ego by 5\nthird = new Pedestrian ahead of other by 1\nmutate other"
    walker = LabelObject("walker", "Pedestrian", "person", 1.75, 50 + 2.25 + 5 + 4.5 + 1, 0.0, 0.0, 0.0)
    far = car("far", 5.0, 90.0, 2.0)
    plain = text.replace("mutate other", "")
    near_enough = Tolerance(position=0.6)
    assert isinstance(verdict(plain, frame(far, walker), tolerance=near_enough), NoMatch)
    assert isinstance(verdict(text, frame(far, walker), tolerance=near_enough), Match)
    assert isinstance(verdict(text, frame(far, replace(walker, y=80.0)), tolerance=near_enough), NoMatch)


def test_a_property_that_the_label_lacks_is_unobserved():
    text = "ego = new Car\nother = new Car ahead of ego by 5, with speed 3"
    at = 50 + 4.5 + 5
    assert isinstance(verdict(text, frame(car("a", 1.75, at))), Match)
    assert isinstance(verdict(text, frame(car("a", 1.75, at, velocity=(0.0, 3.0)))), Match)
    assert isinstance(verdict(text, frame(car("a", 1.75, at, velocity=(0.0, 4.0)))), NoMatch)


def test_objects_that_observe_different_things_do_not_multiply():
    text = "ego = new Car\nfor i in range(12):\n    new Car"
    things = [car(f"{i}", 1.75, 60.0 + i, attributes={f"a{i % 3}": True}) for i in range(14)]
    assert isinstance(verdict(text, frame(*things), budget=2000), Match)


# --- who may play whom


def test_any_object_of_its_class_can_be_the_ego():
    text = "ego = new Car\nother = new Car ahead of ego by 5"
    label = frame(car("back", 5.25, 50.0), car("front", 5.25, 59.5), ego=replace(EGO, y=100.0))
    assert isinstance(verdict(text, label), NoMatch)
    found = verdict(text, label, ego="any")
    assert isinstance(found, Match)
    assert found.correspondence == {"ego": "back", "other": "front"}


def test_the_label_ego_can_play_another_role_where_any_object_is_the_ego():
    text = "ego = new Car\nother = new Car ahead of ego by 5"
    found = verdict(text, frame(car("back", 1.75, 40.5)), ego="any")
    assert isinstance(found, Match)
    assert found.correspondence == {"ego": "back", "other": "ego"}


@pytest.mark.parametrize(("count", "expected"), [(1, Match), (2, NoMatch), (0, NoMatch)])
def test_exact_leaves_nobody_over(count, expected):
    things = [car(f"{i}", 1.75, 60.0 + 8 * i) for i in range(count)]
    assert isinstance(verdict("ego = new Car\nother = new Car", frame(*things), exact=True), expected)


def test_exact_counts_what_the_radius_holds():
    label = frame(car("near", 1.75, 60.0), car("far", 1.75, 100.0))
    assert isinstance(verdict("ego = new Car\nother = new Car", label, exact=True, radius=20.0), Match)


def test_given_roles_restrict_the_search():
    scenario = compiled(HEADER + "ego = new Car\nother = new Car ahead of ego by Range(1, 30)")
    label = frame(car("a", 1.75, 60.0), car("b", 1.75, 70.0), car("c", 5.25, 70.0))
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    assert matcher.match(label, fixed_roles={"other": "b"}).correspondence["other"] == "b"
    assert isinstance(matcher.match(label, fixed_roles={"other": "c"}), NoMatch)
    assert [match.correspondence["other"] for match in matcher.matches(label)] == ["a", "b"]


def test_regions_of_one_name_do_not_make_twins():
    text = "ego = new Car\na = new Car on Uniform(*network.lanes[:2])\nb = new Car on Uniform(*network.lanes[2:4])"
    scenario = compiled(HEADER + text)
    for seed in range(8):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        for objects in (label.objects, label.objects[::-1]):
            assert isinstance(
                Matcher(scenario, MatchOptions(tolerance=EXACT)).match(replace(label, objects=objects)), Match
            )


def test_objects_in_areas_that_are_put_together_alike_are_interchangeable():
    place = "spot = new OrientedPoint on Uniform(*network.lanes).centerline"
    scenario = compiled(HEADER + f"ego = new Car\nfor i in range(8):\n    {place}\n    new Car at spot")
    matcher = Matcher(scenario, MatchOptions(correspondences=20))
    assert len(list(matcher.findings(frame(*(car(f"{n}", 1.75, 40.0 + 7 * n) for n in range(9)))))) == 9


def test_objects_that_must_not_touch_are_still_interchangeable():
    scenario = compiled(HEADER + "ego = new Car\nfor i in range(9):\n    new Pedestrian")
    things = [LabelObject(f"{i}", "Pedestrian", "person", 9.5, 60.0 + 2 * max(i, 1), 0.0, 0.5, 0.5) for i in range(9)]
    enforce = frozenset({BuiltIn.COLLISION})
    crowd = Matcher(scenario, MatchOptions(tolerance=EXACT, enforce=enforce, budget=10_000))
    assert isinstance(crowd.match(frame(*things)), NoMatch)
    assert isinstance(crowd.match(frame(*things, replace(things[0], id="x", y=100.0))), Match)


@pytest.mark.parametrize(
    ("said", "count"),
    [
        ("(distance from a to b) < 40", 1),
        ("abs(relative heading of a from b) < 10 deg", 1),
        ("(distance to a) < 90 and (distance to b) < 90", 1),
        ("a.position.x + b.position.x > -99 or False", 1),
        ("(distance to a) < 90", 2),
        ("b.position.y - a.position.y < 90", 2),
        ("(distance to a) < 90 and (distance to b) < 80", 2),
    ],
)
def test_objects_are_interchangeable_where_exchanging_them_says_the_same(said, count):
    scenario = compiled(HEADER + f"ego = new Car\na = new Car\nb = new Car\nrequire {said}")
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    assert len(list(matcher.matches(frame(car("a", 1.75, 62.0), car("b", 1.75, 70.0))))) == count


# --- requirements over what is not observed


@pytest.mark.parametrize(("y", "expected"), [(60.5, Match), (62.5, NoMatch), (58.0, NoMatch)])
def test_a_requirement_over_a_hidden_variable_joins_its_group(y, expected):
    text = "gap = Range(0, 20)\nego = new Car\nother = new Car ahead of ego by gap\nrequire gap > 5 and gap < 7"
    assert isinstance(verdict(text, frame(car("a", 1.75, y))), expected)


def test_a_requirement_that_is_only_probable_excludes_nothing():
    text = "ego = new Car\nother = new Car\nrequire[0.9] other.position.y < 0\n"
    assert isinstance(verdict(text, frame(THERE)), Match)


@pytest.fixture
def no_search(monkeypatch):
    """Nothing of our own decides before a solver is asked."""
    leave_to_solvers(monkeypatch)


# --- unknown never becomes no


@pytest.mark.usefixtures("no_search")
@pytest.mark.parametrize("method", ["auto", "smt", "monolithic"])
@pytest.mark.parametrize("reason", ["timeout", "crash", "memory", "garbage"])
def test_what_the_solver_does_not_decide_is_unknown_with_its_reason(method, reason):
    solver = Fixed(NoAnswer(reason))
    found = verdict(NONLINEAR, frame(THERE), solver, method=method)
    assert isinstance(found, Unknown)
    assert found.reason == reason
    assert found.cause.what
    assert solver.calls


@pytest.mark.usefixtures("no_search")
@pytest.mark.parametrize("solver", [None, Absent()])
@pytest.mark.parametrize("method", ["auto", "smt", "monolithic"])
def test_what_the_built_in_solver_leaves_open_is_unknown_where_there_is_no_other(method, solver, monkeypatch):
    # nor is a question made that nobody is asked: for fields at hidden points that takes seconds
    monkeypatch.setattr(solver_step, "encode_groups", None)
    assert verdict(NONLINEAR, frame(THERE), solver, method=method).reason == "nonlinear"


@pytest.mark.usefixtures("no_search")
def test_a_witness_that_does_not_replay_is_no_match():
    class Liar(Fixed):
        def check(self, problem, *, precision, timeout_s):
            self.calls += 1
            return Sat({variable.name: 0.123 for variable in problem.variables})

    solver = Liar(None)
    found = verdict(NONLINEAR, frame(THERE), solver)
    assert isinstance(found, Unknown)
    assert found.reason == "precision"
    assert solver.calls == 3


@pytest.mark.usefixtures("no_search")
def test_an_unknown_correspondence_does_not_hide_one_that_matches():
    # The first candidate is undecided, the second is right.
    text = "ego = new Car\nother = new Car offset by (Range(-1, 1), Range(5, 10))"
    scenario = compiled(HEADER + text)
    label = frame(car("a", 2.0, 57.0), car("b", 1.5, 58.0))

    def search(items, *rest):
        if (2.0, 57.0) in [item[2] for item in items]:
            return Undecided(items[0][0], "nonlinear")
        return (yield from real(items, *rest))

    real = group_cache.search_decomposed
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(group_plan, "closed_form_of", lambda *_: None)
        patch.setattr(group_cache, "search_decomposed", search)
        assert (
            Matcher(scenario, MatchOptions(tolerance=EXACT), Fixed(NoAnswer("timeout")))
            .match(label)
            .correspondence["other"]
            == "b"
        )
        lone = Matcher(scenario, MatchOptions(tolerance=EXACT), Fixed(NoAnswer("timeout"))).match(
            frame(label.objects[0])
        )
        assert isinstance(lone, Unknown)
        assert lone.correspondence == {"ego": "ego", "other": "a"}
        assert lone.cause.what == "other.position"
        refuted = Matcher(scenario, MatchOptions(tolerance=EXACT), Fixed(Unsat())).match(frame(label.objects[0]))
        assert isinstance(refuted, NoMatch)


def test_what_geometry_cannot_tell_is_unknown(monkeypatch):
    def fails(*_):
        raise CannotEvaluate("whether moons meet")

    monkeypatch.setattr(conditioned, "condition_group", fails)
    for method in ("auto", "smt", "monolithic"):
        found = verdict(NONLINEAR, frame(THERE), Fixed(Unsat()), method=method)
        assert isinstance(found, Unknown)
        assert found.reason == "unsupported: whether moons meet"


@pytest.mark.usefixtures("no_search")
def test_a_linear_program_without_an_answer_is_no_proof(monkeypatch):
    def fails(*_):
        raise linear_program.not_linear()

    monkeypatch.setattr(linear_program, "_solve", fails)
    scenario = compiled(HEADER + PROGRAMS["shared"])
    label = label_of(scenario, drawn(scenario, 1), random.Random(1))
    assert isinstance(Matcher(scenario, MatchOptions(tolerance=EXACT)).match(label), Unknown)


def test_the_budget_leaves_a_frame_unknown():
    text = "ego = new Car\n" + "".join(f"c{i} = new Car\n" for i in range(4))
    text += "require (distance from c0 to c1) + (distance from c2 to c3) < 0.01"
    things = [car(f"{i}", 1.75, 20.0 + 7 * i) for i in range(9)]
    found = verdict(text, frame(*things), budget=50)
    assert isinstance(found, Unknown)
    assert found.reason == "budget"


# --- solvers that die


HERE = str(Path(__file__).parent)


@pytest.mark.usefixtures("no_search")
@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        pytest.param("hang", "timeout", marks=pytest.mark.slow),
        ("garble", "garbage"),
        ("eat", "memory"),
        ("die", "crash"),
    ],
)
def test_a_solver_that_misbehaves_harms_its_own_frames_only(kind, reason, monkeypatch):
    monkeypatch.syspath_prepend(HERE)
    scenario = compiled(HEADER + NONLINEAR)
    plain = frame(car("a", 40.0, 57.0))
    with WorkerSolver(f"bad_checks:{kind}") as solver:
        matcher = Matcher(scenario, MatchOptions(tolerance=EXACT, timeout_s=0.5), solver)
        verdicts = [matcher.match(label) for label in (frame(THERE), plain, frame(THERE), plain)]
    assert [type(each) for each in verdicts] == [Unknown, NoMatch, Unknown, NoMatch]
    assert {each.reason for each in verdicts if isinstance(each, Unknown)} == {reason}


@pytest.mark.usefixtures("no_search")
def test_a_worker_that_is_killed_is_replaced(monkeypatch):
    monkeypatch.syspath_prepend(HERE)
    scenario = compiled(HEADER + NONLINEAR)
    with WorkerSolver("bad_checks:killed") as solver:
        found = Matcher(scenario, MatchOptions(tolerance=EXACT, timeout_s=5.0), solver).match(frame(THERE))
        assert isinstance(found, Unknown)
        assert found.reason == "crash"
    with WorkerSolver("built_in:check") as solver:
        assert isinstance(Matcher(scenario, MatchOptions(tolerance=EXACT), solver).match(frame(THERE)), Match)


def test_what_the_baseline_cannot_say_is_blamed_on_the_first_constraint(monkeypatch):
    def refused(*_):
        raise CannotEvaluate("no words for it")

    monkeypatch.setattr(Matcher, "ask", refused)
    program = "ego = new Car\nother = new Car offset by (Range(-1, 1), 8), facing Range(-5, 5) deg\n"
    found = verdict(program, frame(car("a", 1.75, 58.0)), method="monolithic")
    assert isinstance(found, Unknown)
    assert found.cause.what == "ego.position"
