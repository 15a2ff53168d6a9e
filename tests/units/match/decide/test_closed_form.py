"""Closed forms agree with the decision ladder wherever they are clear, and their witnesses replay."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import pytest
from programs import HEADER, PROGRAMS
from scenes import STREET, compiled, drawn, label_of

from scenicq.forest.walk import leaves
from scenicq.match.decide.cascade import decide
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import prepare_label
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match

OPTIONS = (
    MatchOptions(tolerance=EXACT),
    MatchOptions(tolerance=Tolerance(x=0.5, y=0.2, heading=0.1), radius=30.0),
    MatchOptions(tolerance=Tolerance(position=1.0, heading=0.3)),
)
NAMES = [
    "ahead", "offset", "left of", "facing field", "visible road", "picked lane", "discrete", "row", "crowd", "figure 3",
    "normal", "requirement", "beyond", "apparently", "toward", "speed",
]  # fmt: skip


def labels(scenario, seed):
    rng = random.Random(seed)
    label = label_of(scenario, drawn(scenario, seed), rng, distractors=3, sizes=bool(seed % 2))
    yield label
    for scale in (0.3, 1.0, 6.0):
        moved = [
            replace(
                each,
                x=each.x + rng.uniform(-scale, scale),
                y=each.y + rng.uniform(-scale, scale),
                heading=each.heading + rng.uniform(-scale, scale) / 3,
            )
            for each in label.objects
        ]
        yield replace(label, objects=tuple(moved))


def replays(items, values, tolerance):
    """Whether a witness replays with one of the directions that fields allow where the label is."""
    turns = [leaf for leaf in leaves(*(node for _, node, _ in items)) if leaf.identity not in values]
    picks = itertools.product(*(range(len(turn.weights)) for turn in turns))
    return any(
        replay(items, {**values, **{t.identity: float(n) for t, n in zip(turns, pick, strict=True)}}, tolerance, 1e-6)
        for pick in picks
    )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.one_in(4)
def test_a_clear_answer_is_that_of_the_ladder(name):
    scenario = compiled(HEADER + PROGRAMS[name], STREET)
    rng = random.Random(7)
    said = {Satisfied: 0, Refuted: 0}
    for seed in range(2):
        for label in labels(scenario, seed):
            for options in OPTIONS:
                matcher = Matcher(scenario, options)
                cast = prepare_label(scenario, label, 0, replace(options, radius=None), {})
                disc = None if options.radius is None else ((label.ego.x, label.ego.y), options.radius)
                tried = LabelSearch(scenario, options, replace(cast, disc=disc), matcher.ask)
                for signature, candidates in cast.signatures(matcher.plans.relevant):
                    for group in matcher.plans.plan(signature).groups:
                        if group.closed_form is None:
                            continue
                        for _ in range(3):
                            ways = {index: rng.choice(candidates[index]) for index in group.roles}
                            assignment = {scenario.ego: 0, **ways}
                            if len(set(assignment.values())) < len(assignment):
                                continue
                            answer = group.closed_form.decide(
                                lambda index, key, a=assignment, seen=cast.seen: seen[a[index]][key],
                                options,
                                MapLookups(),
                            )
                            if answer is None:
                                continue
                            said[type(answer)] += 1
                            items = tried.items(group.group, assignment)
                            outcome = decide(items, options.tolerance)
                            assert type(outcome) is type(answer)
                            if isinstance(answer, Refuted):
                                assert answer == outcome
                            if isinstance(answer, Satisfied):
                                assert replays(items, answer.values, options.tolerance)
    assert said[Satisfied] > 0


DOUBLED = """
ego = new Car on road
{start}
for number in range(60):
    turn = turn + turn
other = new Car at (3, 40), facing turn
require {condition}
"""


@pytest.mark.parametrize("start", ["turn = ego.heading", "turn = Range(0, 1e-20) + ego.heading"])
@pytest.mark.parametrize("condition", ["turn > 1e9 or ego.heading < 10", "sin(ego.heading) < 1 / (ego.heading + 9)"])
def test_what_grows_beyond_bounds_is_left_to_the_ladder(start, condition):
    scenario = compiled(HEADER + DOUBLED.format(start=start, condition=condition), STREET)
    label = label_of(scenario, drawn(scenario, 0), random.Random(0))
    assert isinstance(Matcher(scenario, MatchOptions(tolerance=EXACT)).match(label), Match)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.one_in(4)
def test_a_label_with_known_candidates_has_the_verdict_that_a_search_finds(name):
    scenario = compiled(HEADER + PROGRAMS[name], STREET)
    for seed in range(3):
        for label in labels(scenario, seed):
            for options in OPTIONS:
                matcher = Matcher(scenario, options)
                full = matcher.match(label)
                cast = prepare_label(scenario, label, 0, options, {})
                among = getattr(cast, "candidates", None)
                if among is None:
                    continue
                (short,) = matcher.match_all([(label, among)])
                assert type(short) is type(full)
                assert getattr(short, "correspondence", None) == getattr(full, "correspondence", None)
