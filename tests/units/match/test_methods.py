"""Brute force: every correspondence, one formula each, against every method; and the witnesses, replayed."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import pytest
from programs import HEADER, PROGRAMS
from scenes import compiled, drawn, label_of

from scenicq.errors import SolverError
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.smt.solver import open_solver
from scenicq.store.classes import class_matches

METHODS = ("auto", "smt")


def correspondences(scenario, label):
    """Every injective way to give the objects label objects of their class."""
    roles = [thing for thing in scenario.objects if thing.index != scenario.ego]
    for chosen in itertools.permutations(label.objects, len(roles)):
        if all(class_matches(role.category, each.category, "fine") for role, each in zip(roles, chosen, strict=True)):
            yield {role.name: each.id for role, each in zip(roles, chosen, strict=True)}


def brute_force(scenario, label, options, solver=None):
    """The verdict of one formula per correspondence, and the correspondences that it allows."""
    matcher = Matcher(scenario, replace(options, method="monolithic"), solver)
    verdicts = [(given, matcher.match(label, fixed_roles=given)) for given in correspondences(scenario, label)]
    allowed = [given for given, verdict in verdicts if isinstance(verdict, Match)]
    if allowed:
        return Match, allowed
    return (Unknown if any(isinstance(verdict, Unknown) for _, verdict in verdicts) else NoMatch), []


def varied(scenario, seed, rng):
    """A sampled label with a distractor, as it is or with one object moved or turned."""
    label = label_of(scenario, drawn(scenario, seed), rng, distractors=1)
    if not label.objects or rng.random() < 0.4:
        return label
    things = list(label.objects)
    number = rng.randrange(len(things))
    off = rng.choice([0.005, 0.4, 3.0])
    things[number] = replace(
        things[number], x=things[number].x + rng.choice([0, off]), heading=things[number].heading + rng.choice([0, off])
    )
    return replace(label, objects=tuple(things))


def scopes(scenario, rng):
    """Sizes for random objects and classes."""
    names = ["ego", "Object", *(each.name for each in scenario.objects), *(each.category for each in scenario.objects)]
    sizes = {"position": (0.001, 0.02, 0.5), "heading": (0.001, 0.1)}
    rules = {(rng.choice(names), rng.choice(list(sizes))) for _ in range(3)}
    drawn_sizes = [(scope, name, rng.choice(sizes[name])) for scope, name in sorted(rules)]
    return replace(EXACT, rules=tuple(drawn_sizes))


SMALL = [name for name in PROGRAMS if name not in ("crowd", "row")]


def check_against_brute_force(name, seeds, solver=None):
    scenario = compiled(HEADER + PROGRAMS[name])
    for seed in seeds:
        rng = random.Random(f"{name}-{seed}")
        label = varied(scenario, seed, rng)
        scoped = scopes(scenario, rng)
        tolerance = rng.choice([EXACT, Tolerance(x=0.25, y=0.25, heading=0.087), Tolerance(position=0.5), scoped])
        options = MatchOptions(tolerance=tolerance, timeout_s=5.0)
        expected, allowed = brute_force(scenario, label, options, solver)
        for method in METHODS:
            matcher = Matcher(scenario, replace(options, method=method), solver)
            verdict = matcher.match(label)
            assert method != "auto" or not isinstance(verdict, Unknown), (seed, verdict)
            if Unknown not in (expected, type(verdict)):
                assert type(verdict) is expected, (seed, method, verdict)
            if isinstance(verdict, Match) and expected is Match:
                found = {role: thing for role, thing in verdict.correspondence.items() if thing != "ego"}
                assert found in allowed
                every = [dict(each.correspondence) for each in matcher.matches(label)]
                assert len(every) == len({tuple(sorted(each.items())) for each in every})
                for each in every:
                    assert {role: thing for role, thing in each.items() if thing != "ego"} in allowed


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.one_in(8)
def test_brute_force_agrees(name):
    check_against_brute_force(name, range(3))


@pytest.fixture(scope="module")
def dreal():
    try:
        opened = open_solver("dreal")
    except SolverError as error:
        pytest.skip(error.diagnostics[0].message)
    with opened:
        yield opened


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_brute_force_agrees_on_many_labels(name):
    check_against_brute_force(name, range(3, 14))


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_brute_force_agrees_on_many_labels_with_dreal(name, dreal):
    check_against_brute_force(name, range(11), dreal)


def test_all_matches_are_all_there_are():
    # no two roles are interchangeable, so that every correspondence is listed
    text = (
        "ego = new Car\nfirst = new Car ahead of ego by Range(1, 60)\nsecond = new Car ahead of first by Range(-60, 60)"
    )
    scenario = compiled(HEADER + text)
    for seed in range(5):
        scene = drawn(scenario, seed)
        label = label_of(scenario, scene, random.Random(seed))
        options = MatchOptions(tolerance=Tolerance(position=20.0, heading=3.14))
        _, allowed = brute_force(scenario, label, options)
        found = [dict(match.correspondence) for match in Matcher(scenario, options).matches(label)]
        without_ego = [{role: thing for role, thing in each.items() if role != "ego"} for each in found]
        assert sorted(map(str, without_ego)) == sorted(map(str, allowed))


def test_interchangeable_objects_are_listed_once():
    scenario = compiled(
        HEADER + "ego = new Car\nfor i in range(3):\n    new Pedestrian offset by (Range(-50, 50), Range(-50, 50))"
    )
    label = label_of(scenario, drawn(scenario, 1), random.Random(1))
    four = (*label.objects, replace(label.objects[0], id="fourth"))
    found = list(Matcher(scenario, MatchOptions(tolerance=EXACT)).matches(replace(label, objects=four)))
    assert len(found) == 4
