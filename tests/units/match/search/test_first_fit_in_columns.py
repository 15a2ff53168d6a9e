"""First fit over columns: the same verdict, correspondence and witness, to the last bit, as in batches of one."""

from __future__ import annotations

import gc
import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from programs import HEADER, PROGRAMS
from scenes import STREET, compiled, drawn, label_of

from scenicq.garbage import pause_collector
from scenicq.match.decide.range_forms import clip, cos_sin
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import candidates_of
from scenicq.match.search.first_fit import LabelRow
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Match, NoMatch

ROWS = """
ego = new Car on road
front = ego
for number in range(3):
    front = new Car ahead of front by Range(2, 4) + Range(0, 1)
new Bicycle right of front by Normal(1.5, 0.25)
"""
ANY_HEADING = """
ego = new Car on road
other = new Car at (ego offset by (Range(-3, 3), Range(5, 30))), facing Normal(0, 1) relative to ego.heading
require other.length * 2 > ego.width and (distance from ego to other) > 4
"""
TURNED = """
ego = new Car on road
other = new Car at ego.position offset along (ego.heading + 0.3) by (Range(-3, 3), Range(5, 30)),
    facing (Range(-1, 1) + min(ego.heading, 0.2)) relative to roadDirection
"""
FASTER = """
ego = new Car on road
other = new Car ahead of ego by Range(1, 2) + ego.speed, with speed Range(0, 30), facing Discrete({0.1: 1, 0.2: 2})
"""
CASES = {**PROGRAMS, "rows": ROWS, "any heading": ANY_HEADING, "turned": TURNED, "faster": FASTER}
SURE = (
    "ahead",
    "offset",
    "left of",
    "facing field",
    "normal",
    "rows",
    "any heading",
    "turned",
    "visible road",
    "speed",
)
"""Programs of which every drawn scene is decided together with the others."""
OPTIONS = (
    MatchOptions(),
    MatchOptions(tolerance=Tolerance(x=0.5, y=0.2, heading=0.1), radius=30.0),
    MatchOptions(tolerance=Tolerance(position=1.0, heading=0.3)),
)


def labels(scenario, seeds):
    for seed in seeds:
        rng = random.Random(seed)
        scene = drawn(scenario, seed)
        label = label_of(scenario, scene, rng, distractors=seed % 4, sizes=bool(seed % 2))
        speed, heading = (scene.values.get((scenario.ego, name), 0.0) for name in ("speed", "heading"))
        label = replace(label, ego=replace(label.ego, velocity=(-speed * math.sin(heading), speed * math.cos(heading))))
        yield label
        moved = [
            replace(each, x=each.x + rng.choice([0.0, 0.2, 6.0]), heading=each.heading + rng.choice([0.0, 0.05, 2.0]))
            for each in label.objects
        ]
        yield replace(label, objects=tuple(moved))
        yield replace(label, objects=label.objects[1:])
        if seed % 2:
            unsized = [replace(each, width=None, length=None) for each in label.objects]
            yield replace(label, objects=tuple(unsized))


def with_candidates(scenario, options, found):
    return [(label, candidates_of(scenario, label, 0, options, {})) for label in found]


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("options", OPTIONS, ids=["plain", "box", "disc"])
@pytest.mark.one_in(12)
def test_the_same_is_found_together(name, options):
    scenario = compiled(HEADER + CASES[name], STREET)
    matcher = Matcher(scenario, options)
    asked = with_candidates(matcher.scenario, options, labels(scenario, range(4)))
    alone = [matcher.match(label, candidates=among) for label, among in asked]
    together = list(matcher.match_all(asked))
    assert together == alone
    assert list(map(str, together)) == list(map(str, alone))
    if not options.radius:
        assert any(isinstance(verdict, Match) for verdict in together)
    brief = list(matcher.match_all(asked, details=False))
    assert [_in_brief(each) for each in brief] == [_in_brief(each) for each in alone]
    # a search by itself comes as far as first fit
    searched = [next(matcher.findings(label, candidates=among)).verdict for label, among in asked]
    assert [_in_brief(each) for each in searched if isinstance(each, NoMatch)] == [
        _in_brief(each) for each in alone if isinstance(each, NoMatch)
    ]


def _in_brief(verdict):
    """What is said of a verdict where nobody reads why."""
    return (NoMatch, verdict.cause.what, verdict.cause.span) if isinstance(verdict, NoMatch) else verdict


@pytest.mark.parametrize("name", ["ahead", "offset"])
def test_what_surely_does_not_match_is_not_searched_one_by_one(name, monkeypatch):
    scenario = compiled(HEADER + CASES[name], STREET)
    options = MatchOptions(tolerance=Tolerance(position=0.01, heading=0.01))
    matcher = Matcher(scenario, options)
    found = []
    for label in labels(scenario, range(4)):
        away = tuple(replace(each, x=each.x + 500.0) for each in label.objects)
        found.append(replace(label, objects=(*away, *(replace(each, id=f"{each.id}-too") for each in away))))
    asked = with_candidates(matcher.scenario, options, [each for each in found if each.objects])
    told = [_in_brief(matcher.match(label, candidates=among)) for label, among in asked]
    alone = []
    monkeypatch.setattr(Matcher, "_findings", lambda *args: alone.append(args))
    for details in (False, True):
        assert [_in_brief(each) for each in matcher.match_all(asked, details=details)] == told
    assert not alone
    assert {each[0] for each in told} == {NoMatch}


@pytest.mark.parametrize("name", SURE)
def test_what_surely_matches_is_not_decided_one_by_one(name, monkeypatch):
    scenario = compiled(HEADER + CASES[name], STREET)
    options = MatchOptions(tolerance=Tolerance(position=0.01, heading=0.01))
    matcher = Matcher(scenario, options)
    asked = []
    for seed in range(6):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        who = {each.id: number for number, each in enumerate(label.objects, 1)}
        asked.append((label, {each.index: (who[f"object-{each.index}"],) for each in scenario.objects if each.index}))
    alone = []
    monkeypatch.setattr(Matcher, "_findings", lambda *args: alone.append(args))
    found = list(matcher.match_all(asked))
    assert not alone
    assert all(isinstance(verdict, Match) for verdict in found)


@pytest.mark.parametrize("name", ["ahead", "rows", "offset"])
def test_labels_are_let_go_without_the_collector(name):
    scenario = compiled(HEADER + CASES[name], STREET)
    matcher = Matcher(scenario, MatchOptions())
    asked = with_candidates(matcher.scenario, MatchOptions(), labels(scenario, range(4)))
    gc.collect()
    with pause_collector():
        assert list(matcher.match_all(asked))
        assert not [each for each in gc.get_objects() if isinstance(each, LabelRow)]


numbers = st.floats(allow_nan=False, allow_infinity=False, width=64)


@settings(derandomize=True, deadline=None, max_examples=100, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=20))
def test_columns_are_what_numbers_are(rows):
    values, lows, highs = (np.array(each) for each in zip(*rows, strict=True))
    one_by_one = [clip(*row) for row in rows]
    together = clip(values, lows, highs).tolist()
    assert list(map(repr, together)) == list(map(repr, one_by_one))
    cosines, sines = cos_sin(values)
    assert [*zip(cosines.tolist(), sines.tolist(), strict=True)] == [cos_sin(float(value)) for value in values]
    assert math.cos(rows[0][0]) == cosines[0]


@pytest.mark.parametrize("name", sorted(CASES))
@pytest.mark.one_in(4)
def test_whole_numbers_of_a_label_are_numbers(name):
    """Whoever makes labels in Python writes `x=3`, too."""
    scenario = compiled(HEADER + CASES[name], STREET)
    matcher = Matcher(scenario, MatchOptions(tolerance=Tolerance(position=1.0, heading=0.6)))

    def rounded(each, number):
        size = {"width": number(2), "length": number(4)}
        return replace(
            each, x=number(round(each.x)), y=number(round(each.y)), heading=number(round(each.heading)), **size
        )

    made = list(labels(scenario, range(4)))
    one, other = (
        [replace(each, ego=rounded(each.ego, number), objects=tuple(rounded(one, number) for one in each.objects))
         for each in made]
        for number in (int, float)
    )  # fmt: skip
    told: list[list[object]] = []
    for some in (one, other):
        verdicts = matcher.match_all(with_candidates(scenario, matcher.options, some))
        told.append([(type(each), getattr(each, "witness", None)) for each in verdicts])
    assert told[0] == told[1]
    assert [(type(each := matcher.match(label)), getattr(each, "witness", None)) for label in one] == told[0]
