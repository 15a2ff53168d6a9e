"""Choices among map elements, one below the other: the verdict of every combination evaluated plainly."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from left_to_solvers import leave_to_solvers

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.geometry.default_street import street
from scenicq.geometry.membership import contains
from scenicq.geometry.network import Network
from scenicq.importers.base import read_maps
from scenicq.importers.report import Report
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, parse_tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.smt.worker_solver import WorkerSolver
from scenicq.store.labels import Label, LabelObject

from .nested_choices import REACH, Composer, clear, label_for, small_map

MAP = Path(__file__).parents[4] / "sample_data" / "crossroads" / "maps"
LABELS = 3
MODEL = "model scenic.domains.driving.model\nego = new Car\n"


@cache
def network() -> Network:
    features = read_maps({"crossroads": next(MAP.iterdir())}, Report())["crossroads"]
    return small_map(list(features), 3)


def check(seed: int) -> list[bool]:
    """The verdicts of one program on a few labels, each compared with the plain one."""
    rng = random.Random(seed)
    program = Composer(network(), rng).compose()
    text = "\n".join([*program.lines, ""])
    if not any(True for _ in program.combinations()):
        return []
    try:
        scenario = compile_scenario(Source("nested.scenic", text), network())
    except ScenarioError as error:
        if error.diagnostics[0].code != "impossible-requirement":
            raise
        return []
    matcher = Matcher(scenario, MatchOptions(tolerance=parse_tolerance(f"position={REACH},heading=180deg")))
    found: list[bool] = []
    for _ in range(LABELS):
        label = label_for(program, rng)
        expected = clear(program, label)
        if expected is None:
            continue
        verdict = matcher.match(label)
        assert isinstance(verdict, Match if expected else NoMatch), (seed, text, label, verdict)
        found.append(expected)
    return found


@pytest.mark.slow
def test_verdicts_are_those_of_all_combinations(rounds: Callable[[int], int]) -> None:
    found = [each for seed in range(rounds(40)) for each in check(seed)]
    assert 0.2 < sum(found) / len(found) < 0.9


def test_a_search_that_takes_too_long_ends_as_unknown() -> None:
    rng = random.Random(3)
    program = Composer(network(), rng).compose()
    text = "\n".join([*program.lines, ""])
    scenario = compile_scenario(Source("nested.scenic", text), network())
    options = MatchOptions(tolerance=parse_tolerance(f"position={REACH},heading=180deg"), timeout_s=-1.0)
    labels = (label_for(program, rng) for _ in range(20))
    verdicts = [Matcher(scenario, options).match(label) for label in labels]
    assert any(isinstance(verdict, Unknown) and verdict.reason == "timeout" for verdict in verdicts)
    assert not any(isinstance(verdict, Match) for verdict in verdicts)


@pytest.mark.slow
def test_verdicts_are_those_of_all_combinations_of_many_programs() -> None:
    found = [each for seed in range(40, 160) for each in check(seed)]
    assert len(found) > 260


def test_two_cars_on_one_random_lane_are_on_one() -> None:
    # where lanes cross, the direction of either will do
    text = "a = new Car on lane, facing roadDirection\nb = new Car on lane, facing roadDirection\n"
    lanes = street().lanes
    scenario = compile_scenario(Source("lane.scenic", f"{MODEL}lane = Uniform(*network.lanes)\n{text}"), street())
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    places = [lane.centerline.pieces[0].interpolate(0.4, normalized=True) for lane in lanes[::5]]
    things = [
        LabelObject(
            str(number), "Car", "car", place.x, place.y, street().roadDirection.values(place.x, place.y)[0], 2, 4
        )
        for number, place in enumerate(places)
    ]
    ego = LabelObject("ego", "Car", "car", places[0].x, places[0].y, things[0].heading, 2, 4)
    matched = set()
    for one, other in itertools.permutations(range(len(places)), 2):
        label = Label("f", "r", 0, "street", ego, (things[one], things[other]))
        shared = any(
            contains(lane.region, *places[one].coords[0]) and contains(lane.region, *places[other].coords[0])
            for lane in lanes
        )
        assert isinstance(matcher.match(label), Match if shared else NoMatch), (one, other)
        matched.add(shared)
    assert matched == {True, False}


def chosen(name: str, options: dict[str, list[float | str]], picks: dict[str, int]) -> float:
    """The number that a choice comes out as, where some of the choices are among others."""
    found = options[name][picks[name]]
    return chosen(found, options, picks) if isinstance(found, str) else found


@pytest.mark.slow
def test_choices_that_several_objects_share_come_out_the_same_in_all(rounds: Callable[[int], int]) -> None:
    found = []
    for seed in range(rounds(60)):
        rng = random.Random(seed)
        options: dict[str, list[float | str]] = {}
        for number in range(rng.randint(4, 7)):
            some: list[float | str] = [0.0, 5.0, 10.0] if number < 2 else [*options, *options, 0.0, 5.0]
            options[f"v{number}"] = [rng.choice(some) for _ in range(rng.randint(2, 3))]
        names = [*options][-rng.randint(2, 3) :]
        lines = [f"{name} = Uniform({', '.join(map(str, those))})" for name, those in options.items()]
        lines += [f"new Object at ({name}, {10 * number})" for number, name in enumerate(names)]
        text = "\n".join(["ego = new Object at (0, 50)", *lines, ""])
        scenario = compile_scenario(Source("shared.scenic", text), street())
        matcher = Matcher(scenario, MatchOptions(tolerance=EXACT, enforce=frozenset()))
        all_picks = [dict(zip(options, each, strict=True)) for each in itertools.product(
            *(range(len(those)) for those in options.values())
        )]  # fmt: skip
        possible = {tuple(chosen(name, options, picks) for name in names) for picks in all_picks}
        ego = LabelObject("ego", "Object", "Object", 0.0, 50.0, 0.0, 1.0, 1.0)
        for xs in itertools.product((0.0, 5.0, 10.0), repeat=len(names)):
            things = tuple(
                LabelObject(str(number), "Object", "Object", x, 10.0 * number, 0.0, 1.0, 1.0)
                for number, x in enumerate(xs)
            )
            verdict = matcher.match(Label("f", "r", 0, "street", ego, things))
            assert isinstance(verdict, Match if xs in possible else NoMatch), (text, xs, verdict)
            found.append(xs in possible)
    assert 0.2 < sum(found) / len(found) < 0.8


NONLINEAR = """class Thing:
    position: (Range(-99, 99), Range(-99, 99))
    heading: Range(-180, 180) deg
k = Uniform(1, 3, 9)
a = Range(1, 2)
b = Range(1, 2)
c = Range(1, 2)
ego = new Thing with pace k * a * b * c, with drive k + a * b - b * c, with third a * a * b + c * k
"""


@pytest.mark.parametrize(("chosen", "option"), [(1, 0), (3, 1), (9, 2), (5, None)])
@pytest.mark.one_in(2)
def test_what_is_left_of_an_option_goes_to_a_solver_where_nothing_else_decides_it(
    chosen: float, option: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    leave_to_solvers(monkeypatch)
    a, b, c = 1.3, 1.7, 1.1
    shown = {"pace": chosen * a * b * c, "drive": chosen + a * b - b * c, "third": a * a * b + c * chosen}
    ego = LabelObject("ego", "Object", "thing", 0.0, 0.0, heading=0.0, attributes=shown)
    label = Label("frame", "recording", 0, "street", ego)
    scenario = compile_scenario(Source("nonlinear.scenic", NONLINEAR), street())
    options = MatchOptions(tolerance=EXACT)
    assert isinstance(Matcher(scenario, options).match(label), Unknown)
    with WorkerSolver("built_in:check") as solver:
        verdict = Matcher(scenario, options, solver).match(label)
    if option is None:
        assert isinstance(verdict, NoMatch)
        return
    assert isinstance(verdict, Match)
    assert verdict.witness["nonlinear.scenic:4:5"] == option
    for found, drawn in zip(
        [verdict.witness[f"nonlinear.scenic:{line}:5"] for line in (5, 6, 7)], (a, b, c), strict=True
    ):
        assert found == pytest.approx(drawn, abs=0.01)
