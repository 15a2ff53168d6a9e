"""Closed forms of numbers, texts and regions that hang on the label: what the cascade says, alone and in batches."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from programs import HEADER
from scenes import STREET, compiled, drawn, label_of

from scenicq.match.decide.cascade import decide
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import candidates_of, prepare_label
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch

OTHER = "ego = new Car with viewAngle 100 deg, with visibleDistance 20\nother = new Pedestrian "
TURNED = ", facing Range(-180, 180) deg"
VALUES = {
    "range": f"{OTHER}ahead of ego by 5, with pace Range(0, 3)",
    "sum": f"{OTHER}ahead of ego by 5, with pace 2 * Range(0, 3) - Range(1, 2)",
    "unbounded": f"{OTHER}ahead of ego by 5, with pace Normal(0, 1) + Range(1, 2)",
    "number": f"{OTHER}ahead of ego by 5, with pace 3",
    "of another": f"{OTHER}ahead of ego by 5, with pace ego.width + Range(0, 1)",
    "choice": f"{OTHER}ahead of ego by 5, with pace Uniform(1, Range(4, 6))",
    "text": f"{OTHER}ahead of ego by 5, with state 'parked'",
    "texts": f"{OTHER}ahead of ego by 5, with state Uniform('parked', 'moving')",
    "truth": f"{OTHER}ahead of ego by 5, with state Uniform(True, False)",
}
PLACES = {
    "view": f"{OTHER}on visible road{TURNED}",
    "whole view": f"{OTHER}in ego.visibleRegion{TURNED}",
    "out of view": f"{OTHER}on not visible road{TURNED}",
    "disc": f"{OTHER}in CircularRegion(ego.position offset by (0, 10), 8){TURNED}",
    "rectangle": f"{OTHER}in RectangularRegion(ego.position, ego.heading + 0.3, 9, 20){TURNED}",
    "ring": f"{OTHER}in CircularRegion(ego.position, 20).difference(CircularRegion(ego.position, 8)){TURNED}",
    "beside": f"{OTHER}in CircularRegion(ego.position, 20).difference(road){TURNED}",
    "both": f"{OTHER}in CircularRegion(ego.position, 12).union(crossing){TURNED}",
}
OPTIONS = {
    "exact": MatchOptions(tolerance=EXACT),
    "box": MatchOptions(tolerance=Tolerance(x=0.5, y=0.2, heading=0.1, other=0.1), radius=60.0),
    "disc": MatchOptions(tolerance=Tolerance(position=1.0, heading=0.3, other=0.5)),
}
NUMBERS, OTHERS = (0.0, 1.0, 2.5, 3.0, 3.2, 7.0), ("parked", "standing", True, 1.0, 0.0)


def labels(scenario, seed):
    """Scenes as labels that observe what the program sets; as drawn, moved, and with odd values."""
    rng, scene = random.Random(seed), drawn(scenario, seed)
    label = label_of(scenario, scene, rng, distractors=2)
    attributes = {name: scene.values[1, name] for name in ("pace", "state") if (1, name) in scene.values}
    seen = [replace(each, attributes=attributes) for each in label.objects]
    yield replace(label, objects=tuple(seen))
    odd = {"pace": NUMBERS, "state": OTHERS}
    for scale in (0.05, 0.6, 6.0):
        moved = [
            replace(
                each,
                x=each.x + rng.uniform(-scale, scale),
                y=each.y + rng.uniform(-scale, scale),
                attributes={name: rng.choice([value, *odd[name]]) for name, value in attributes.items()},
            )
            for each in seen
        ]
        yield replace(label, objects=tuple(moved))


@pytest.mark.parametrize("name", VALUES | PLACES)
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
@pytest.mark.one_in(4)
def test_a_clear_answer_is_that_of_the_cascade(name, options):
    scenario = compiled(HEADER + (VALUES | PLACES)[name], STREET)
    said = {Satisfied: 0, Refuted: 0}
    matcher = Matcher(scenario, options)
    for label in [label for seed in range(6) for label in labels(scenario, seed)]:
        problem = prepare_label(scenario, label, 0, replace(options, radius=None), {})
        disc = None if options.radius is None else ((label.ego.x, label.ego.y), options.radius)
        search = LabelSearch(scenario, options, replace(problem, disc=disc), matcher.ask)
        for signature, candidates in problem.signatures(matcher.plans.relevant):
            for plan in matcher.plans.plan(signature).groups:
                assert plan.closed_form is not None
                for number in candidates[1] if plan.roles else (0,):
                    assignment = {0: 0, 1: number}
                    answer = plan.closed_form.decide(
                        lambda index, key, a=assignment, seen=problem.seen: seen[a[index]][key], options, MapLookups()
                    )
                    if answer is None:
                        continue
                    said[type(answer)] += 1
                    items = search.items(plan.group, assignment)
                    outcome = decide(items, options.tolerance)
                    assert type(outcome) is type(answer)
                    if isinstance(answer, Satisfied):
                        assert replay(items, answer.values, options.tolerance, 1e-6)
                    elif plan.group.constraints[0].property not in ("position", "heading"):
                        assert answer == outcome
    assert said[Satisfied]
    assert said[Refuted] or name in PLACES


@pytest.mark.parametrize("name", VALUES | PLACES)
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
@pytest.mark.one_in(4)
def test_batches_find_what_labels_alone_find(name, options):
    scenario = compiled(HEADER + (VALUES | PLACES)[name], STREET)
    matcher = Matcher(scenario, options)
    asked = [
        (label, candidates_of(matcher.scenario, label, 0, options, {}))
        for seed in range(8)
        for label in labels(scenario, seed)
    ]
    alone = [matcher.match(label, candidates=among) for label, among in asked]
    together = list(matcher.match_all(asked))
    assert [*map(str, together)] == [*map(str, alone)]
    assert {Match, NoMatch} >= {type(verdict) for verdict in together}
    assert any(isinstance(verdict, Match) for verdict in together)


@pytest.mark.parametrize("name", [name for name in VALUES | PLACES if name != "choice"])
def test_scenes_of_the_program_need_no_search(name, monkeypatch):
    scenario = compiled(HEADER + (VALUES | PLACES)[name], STREET)
    options = MatchOptions(tolerance=Tolerance(position=0.01, heading=0.01))
    asked = []
    for seed in range(6):
        label = next(labels(scenario, seed))
        (mine,) = (number for number, each in enumerate(label.objects, 1) if each.id == "object-1")
        asked.append((label, {1: (mine,)}))
    searched = []
    monkeypatch.setattr(Matcher, "_findings", lambda *args: searched.append(args))
    assert all(isinstance(verdict, Match) for verdict in Matcher(scenario, options).match_all(asked))
    assert not searched
