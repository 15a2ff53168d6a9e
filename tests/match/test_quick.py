"""Closed forms agree with the decision ladder wherever they are clear, and their witnesses replay."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from programs import HEADER, PROGRAMS
from scenes import STREET, compiled, drawn, label_of

from scenicq.match.attempt import Attempt
from scenicq.match.casting import cast_roles
from scenicq.match.ground import replay
from scenicq.match.ladder import No, Yes, decide
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions, Tolerance
from scenicq.match.quick import Places

OPTIONS = (
    MatchOptions(),
    MatchOptions(tolerance=Tolerance(x=0.5, y=0.2, heading=0.1), radius=30.0),
    MatchOptions(tolerance=Tolerance(position=1.0, heading=0.3)),
)
NAMES = ["ahead", "offset", "left of", "facing field", "visible road", "picked lane", "discrete", "row", "crowd"]


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


@pytest.mark.parametrize("name", NAMES)
def test_a_clear_answer_is_that_of_the_ladder(name):
    scenario = compiled(HEADER + PROGRAMS[name], STREET)
    rng = random.Random(7)
    said = {Yes: 0, No: 0}
    for seed in range(2):
        for label in labels(scenario, seed):
            for options in OPTIONS:
                matcher = Matcher(scenario, options)
                cast = cast_roles(scenario, label, 0, replace(options, radius=None), {})
                disc = None if options.radius is None else ((label.ego.x, label.ego.y), options.radius)
                attempt = Attempt(scenario, options, replace(cast, disc=disc), matcher.ask)
                for signature, candidates in cast.signatures(matcher._relevant):
                    for group in matcher.plan(signature).groups:
                        if group.quick is None:
                            continue
                        for _ in range(3):
                            ways = {index: rng.choice(candidates[index]) for index in group.roles}
                            assignment = {scenario.ego: 0, **ways}
                            if len(set(assignment.values())) < len(assignment):
                                continue
                            answer = group.quick.decide(
                                lambda index, key, a=assignment, seen=cast.seen: seen[a[index]][key],
                                disc,
                                options.tolerance,
                                Places(),
                            )
                            if answer is None:
                                continue
                            said[type(answer)] += 1
                            items = attempt.items(group.group, assignment)
                            assert type(decide(items, options.tolerance)) is type(answer)
                            if isinstance(answer, Yes):
                                assert replay(items, answer.values, options.tolerance, 1e-6)
    assert said[Yes] > 0


@pytest.mark.parametrize("name", NAMES)
def test_a_label_with_known_candidates_has_the_verdict_that_a_search_finds(name):
    scenario = compiled(HEADER + PROGRAMS[name], STREET)
    for seed in range(3):
        for label in labels(scenario, seed):
            for options in OPTIONS:
                matcher = Matcher(scenario, options)
                full = matcher.match(label)
                cast = cast_roles(scenario, label, 0, options, {})
                among = getattr(cast, "candidates", None)
                if among is None:
                    continue
                places = matcher.look_up([(label, among)])
                short = matcher.match(label, among=among, places=places)
                assert type(short) is type(full)
                assert getattr(short, "correspondence", None) == getattr(full, "correspondence", None)
