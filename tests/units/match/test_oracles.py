"""Generate and match, perturb, brute force: the matcher against the improviser and against one monolithic formula."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import pytest
from programs import HEADER, PROGRAMS
from scenes import compiled, drawn, label_of

from scenicq.forest.walk import leaves
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import replay
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown

SEEDS = range(6)


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.one_in(4)
def test_a_drawn_scene_matches_among_distractors(name):
    scenario = compiled(HEADER + PROGRAMS[name])
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    for seed in SEEDS:
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed), distractors=3)
        verdict = matcher.match(label)
        assert isinstance(verdict, Match), (seed, verdict)


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.one_in(4)
def test_the_witness_of_a_match_satisfies_the_program_in_plain_evaluation(name):
    scenario = compiled(HEADER + PROGRAMS[name])
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    for seed in range(3):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed), distractors=3)
        found = matcher.examine(label)
        for group in found.plan.groups:
            items = found.search.items(group.group, found.assignment)
            # where a field allows several directions at what is observed, one of them is chosen each time
            known = found.values()
            open_ = {leaf for _, node, _ in items for leaf in leaves(node) if leaf.identity not in known}
            ways = itertools.product(*(enumerate(leaf.weights) for leaf in open_))
            assert any(
                replay(
                    items,
                    {**known, **{leaf.identity: float(number) for leaf, (number, _) in zip(open_, way, strict=True)}},
                    EXACT,
                    matcher.options.precision,
                )
                for way in ways
            ), (seed, group)


def test_a_verdict_does_not_hang_on_what_was_matched_before():
    for name in list(PROGRAMS)[::3]:
        scenario = compiled(HEADER + PROGRAMS[name])
        labels = []
        for seed in range(3):
            label = label_of(scenario, drawn(scenario, seed), random.Random(seed), distractors=2)
            moved = tuple(replace(each, x=each.x + 1.0) for each in label.objects)
            labels += [label, replace(label, objects=moved)]
        alone = [Matcher(scenario, MatchOptions(tolerance=EXACT)).match(label) for label in labels]
        matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
        assert [matcher.match(label) for label in labels] == alone, name
        assert [matcher.match(label) for label in reversed(labels)] == alone[::-1], name
        assert list(matcher.match_all([(label, None) for label in labels])) == alone, name


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.one_in(8)
def test_every_method_gives_the_same_verdict(name):
    scenario = compiled(HEADER + PROGRAMS[name])
    seen = set()
    for seed in range(3):
        rng = random.Random(seed)
        label = label_of(scenario, drawn(scenario, seed), rng)
        moved = list(label.objects)
        if moved:
            victim = rng.randrange(len(moved))
            off = rng.choice([0.0, 0.02, 1.0, 8.0])
            moved[victim] = replace(moved[victim], x=moved[victim].x + off, heading=moved[victim].heading + off / 4)
        for each in (label, replace(label, objects=tuple(moved))):
            verdicts = {
                method: type(Matcher(scenario, MatchOptions(tolerance=EXACT, method=method)).match(each))
                for method in ("auto", "smt", "monolithic")
            }
            decided = {verdict for verdict in verdicts.values() if verdict is not Unknown}
            assert len(decided) <= 1, (seed, verdicts)
            assert verdicts["auto"] is not Unknown, (seed, verdicts)
            seen |= decided
    assert Match in seen


PERTURBED: dict[str, tuple[str, str, float]] = {
    # program: object, what is pushed, how far outside of its support
    "ahead": ("other", "ahead", 12.0),
    "figure 3": ("other", "ahead", 12.0),
    "offset": ("other", "right", 10.0),
    "left of": ("other", "heading", 0.3),
    "facing field": ("ego", "heading", 0.6),
    "visible road": ("other", "ahead", -300.0),
    "apparently": ("other", "heading", 0.5),
    "toward": ("other", "heading", 0.1),
    "figure 6": ("side", "right", -9.0),
    "shared": ("second", "ahead", 3.0),
    "shared heading": ("second", "heading", 1.5),
    "hidden requirement": ("other", "ahead", 3.0),
    "nonlinear": ("other", "heading", 0.9),
    "discrete": ("third", "right", 3.5),
    "follow": ("other", "right", 6.0),
    "requirement": ("other", "ahead", 45.0),
}


@pytest.mark.parametrize("name", PERTURBED)
def test_a_scene_pushed_out_of_the_support_does_not_match(name):
    import math

    scenario = compiled(HEADER + PROGRAMS[name])
    who, what, far = PERTURBED[name]
    index = next(each.index for each in scenario.objects if each.name == who)
    for seed in SEEDS:
        scene = drawn(scenario, seed)
        values = dict(scene.values)
        (x, y), heading = values[index, "position"], values[index, "heading"]
        frame = values[scenario.ego, "heading"]
        right, ahead = (far, 0.0) if what == "right" else (0.0, far) if what == "ahead" else (0.0, 0.0)
        c, s = math.cos(frame), math.sin(frame)
        values[index, "position"] = (x + right * c - ahead * s, y + right * s + ahead * c)
        values[index, "heading"] = heading + (far if what == "heading" else 0.0)
        label = label_of(scenario, replace(scene, values=values), random.Random(seed))
        verdict = Matcher(scenario, MatchOptions(tolerance=EXACT)).match(label)
        assert isinstance(verdict, NoMatch), (seed, verdict)


@pytest.mark.parametrize("cars", [3, 4])
def test_a_row_is_found_among_cars_that_are_a_little_beside_it(cars):
    """Each decoy fits by itself: only what the cars share tells, and a part of the row before all of it."""
    program = "ego = new Car\nshift = Range(-2, 2)\nlast = ego\n"
    program += f"for i in range({cars}):\n    last = new Car at last offset by shift @ 8\n"
    scenario = compiled(HEADER + program)
    matcher = Matcher(scenario, MatchOptions(tolerance=Tolerance(position=0.1)))
    for seed in range(6):
        rng = random.Random(seed)
        label = label_of(scenario, drawn(scenario, seed), rng)
        near = [
            replace(each, id=f"{each.id}-{number}", x=each.x + rng.uniform(0.3, 1.7) * rng.choice([-1, 1]))
            for each in label.objects
            for number in range(2)
        ]
        among = rng.sample([*near, *label.objects], len(near) + len(label.objects))
        found = matcher.match(replace(label, objects=tuple(among)))
        assert isinstance(found, Match)
        assert len({*found.correspondence.values()}) == cars + 1
        # without one of the right ones the others do not do
        left = [each for each in among if each.id != f"object-{1 + seed % cars}"]
        assert isinstance(matcher.match(replace(label, objects=tuple(left))), NoMatch)
    assert any(group.parts for plan in matcher.plans.plans.values() for group in plan.joint)
