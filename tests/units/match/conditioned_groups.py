"""The groups of a program, conditioned on a label drawn from it."""

from __future__ import annotations

import random

from programs import HEADER
from scenes import STREET, compiled, drawn, label_of

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import prepare_label
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.tolerance import EXACT


def groups(text, seed):
    """The groups of a program conditioned on a label drawn from it, for the true roles and for others."""
    scenario = compiled(HEADER + text, STREET)
    rng = random.Random(seed)
    label = label_of(scenario, drawn(scenario, seed), rng, distractors=2)
    options = MatchOptions(tolerance=EXACT)
    cast = prepare_label(scenario, label, 0, options, {})
    matcher = Matcher(scenario, options)
    attempt = LabelSearch(scenario, options, cast, matcher.ask)
    found = {thing.id: number for number, thing in enumerate((label.ego, *label.objects))}
    right = {
        thing.index: 0 if thing.index == scenario.ego else found[f"object-{thing.index}"] for thing in scenario.objects
    }
    for signature, candidates in cast.signatures(matcher.plans.relevant):
        wrong = {index: rng.choice(numbers) for index, numbers in candidates.items()}
        for each in matcher.plans.plan(signature).groups:
            for assignment, true in ((right, True), (wrong | {scenario.ego: 0}, False)):
                yield attempt.items(each.group, assignment), true
                for part in each.parts:
                    yield attempt.items(part.group, assignment), true
