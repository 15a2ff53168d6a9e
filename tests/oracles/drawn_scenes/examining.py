"""Generate and match, perturb: labels drawn from a program, shuffled among distractors, and pushed outside of it."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from examples import Example
from outside import TooManyError, outside

from scenicq.errors import ScenarioError
from scenicq.exporters.sample import PATIENCE_S, sample_labels
from scenicq.forest.scenario import BuiltIn, Scenario
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

ATTEMPTS = 3000
_PUSHES = (3.0, 12.0, 60.0, 4000.0)
_TURNS = (0.3, 1.0, 2.0, 3.0)
_WAIVED = (frozenset(), frozenset({BuiltIn.CONTAINMENT}), frozenset({BuiltIn.CONTAINMENT, BuiltIn.COLLISION}))


@dataclass
class Outcome:
    """What came of one program.

    Attributes:
        drawn, matched: Scenes, and those that match with the default options.
        enforced: Those that match with the built-in requirements that they were drawn with.
        pushed, excluded: Labels that are certainly outside, and those that do not match.
        waived: Built-in requirements without which scenes had to be drawn.
        faults: What went wrong.
    """

    drawn: int = 0
    matched: int = 0
    enforced: int = 0
    pushed: int = 0
    excluded: int = 0
    waived: frozenset[BuiltIn] = frozenset()
    faults: list[str] = field(default_factory=list)


def drawn_labels(
    scenario: Scenario, count: int, seed: int, timeout_s: float = PATIENCE_S
) -> tuple[list[Label], frozenset[BuiltIn]]:
    """Labels with as many built-in requirements as allow for any; with those that were waived."""
    for waived in _WAIVED:
        try:
            return list(sample_labels(scenario, count, seed, waived, ATTEMPTS, timeout_s)), waived
        except ScenarioError:
            if waived == _WAIVED[-1]:
                raise
    raise AssertionError


def shuffled(label: Label, rng: random.Random, distractors: int = 3) -> Label:
    """The label with its objects in another order, among others of their classes that play no role."""
    things = list(label.objects)
    for number in range(distractors):
        model = rng.choice(label.objects or (label.ego,))
        x, y = (part + rng.uniform(-30, 30) for part in (model.x, model.y))
        things.append(replace(model, id=f"distractor-{number}", x=x, y=y, heading=rng.uniform(-3.1, 3.1)))
    rng.shuffle(things)
    return replace(label, objects=tuple(things))


def pushes(label: Label, rng: random.Random) -> Iterator[Label]:
    """The label with one object moved or turned, little at first."""
    for far, turn in zip(_PUSHES, _TURNS, strict=True):
        number = rng.randrange(-1, len(label.objects))
        way = rng.uniform(-math.pi, math.pi)
        thing = label.ego if number < 0 else label.objects[number]
        for moved in (
            replace(thing, x=thing.x + far * math.cos(way), y=thing.y + far * math.sin(way)),
            replace(thing, heading=math.remainder((thing.heading or 0.0) + rng.choice((-1, 1)) * turn, math.tau)),
        ):
            yield _with(label, number, moved)


def _with(label: Label, number: int, thing: LabelObject) -> Label:
    if number < 0:
        return replace(label, ego=thing)
    return replace(label, objects=(*label.objects[:number], thing, *label.objects[number + 1 :]))


def examine(example: Example, count: int, seed: int) -> Outcome:
    """Draw labels from a program, match them, push them out."""
    scenario, outcome = example.compiled(), Outcome()
    labels, outcome.waived = drawn_labels(scenario, count, seed)
    # how long it takes is not the question here: eleven roles of one class take 23 s
    usual = Matcher(scenario, MatchOptions(tolerance=EXACT, timeout_s=60.0))
    strict = Matcher(scenario, replace(usual.options, enforce=frozenset(BuiltIn) - outcome.waived))
    for number, label in enumerate(labels):
        rng = random.Random(f"{seed}/{number}")
        crowd = shuffled(label, rng)
        outcome.drawn += 1
        verdict, again = usual.match(crowd), strict.match(crowd)
        outcome.matched += isinstance(verdict, Match)
        outcome.enforced += isinstance(again, Match)
        outcome.faults += [f"scene {number}: {each}" for each in (verdict, again) if not isinstance(each, Match)]
        for moved in pushes(label, rng):
            try:
                out = outside(scenario, moved)
            except TooManyError:
                break
            if out:
                outcome.pushed += 1
                verdict = usual.match(moved)
                outcome.excluded += isinstance(verdict, NoMatch)
                if not isinstance(verdict, NoMatch):
                    outcome.faults.append(f"scene {number}, pushed: {verdict} {moved}")
                break
    return outcome
