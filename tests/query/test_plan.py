"""The prefilter loses nothing: with and without it the results are the same."""

from __future__ import annotations

import math
import random
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.compiler.standin import street
from scenicq.errors import Source
from scenicq.forest.improvise import draw_scene
from scenicq.match.options import MatchOptions, Tolerance
from scenicq.match.verdict import Match, Unknown
from scenicq.query.plan import make_plan
from scenicq.query.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

sys.path.insert(0, str(Path(__file__).parents[1] / "match"))
from programs import HEADER, PROGRAMS
from scenes import label_of

STREET = street()
OPTIONS = {
    "default": MatchOptions(),
    "wide box": MatchOptions(tolerance=Tolerance(x=0.5, y=0.25, heading=math.radians(10)), classes="coarse"),
    "wide disc": MatchOptions(tolerance=Tolerance(position=3.0, heading=math.radians(60))),
    "radius": MatchOptions(tolerance=Tolerance(position=0.5), radius=25.0),
    "any ego": MatchOptions(tolerance=Tolerance(position=0.2, heading=0.1), ego="any"),
}


def nudged(thing: LabelObject, rng: random.Random) -> LabelObject:
    scale = rng.choice([0.0, 0.0, 0.3, 2.0, 10.0])
    return replace(
        thing,
        x=thing.x + rng.uniform(-scale, scale),
        y=thing.y + rng.uniform(-scale, scale),
        heading=None if rng.random() < 0.05 else (thing.heading or 0.0) + rng.uniform(-scale, scale) / 5,
    )


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    """Scenes of every program, as they are and nudged, as one recording on the street."""
    rng = random.Random(1)
    labels: list[Label] = []
    for text in PROGRAMS.values():
        scenario = compile_scenario(Source("test.scenic", HEADER + text), STREET)
        for _ in range(2):
            scene = draw_scene(scenario, rng, 5000)
            assert scene is not None
            label = label_of(scenario, scene, rng, distractors=2, sizes=rng.random() < 0.5)
            for change in range(3):
                things = tuple(nudged(each, rng) if change else each for each in label.objects)
                ego = nudged(label.ego, rng) if change == 2 else label.ego
                number = len(labels)
                labels.append(
                    replace(
                        label,
                        frame=f"frame-{number:04}",
                        timestamp_us=number,
                        ego=replace(ego, id="ego", heading=ego.heading or 0.0),
                        objects=things,
                    )
                )
    target = tmp_path_factory.mktemp("plan") / "dataset"
    write_dataset(
        target, iter([Recording("recording", "street", tuple(labels))]), {"street": STREET.features}, name="t"
    )
    return open_dataset(target)


def found(dataset: Dataset, text: str, options: MatchOptions, *, prefilter: bool) -> tuple[dict, Query]:
    query = Query(
        dataset, Source("test.scenic", HEADER + text), QueryOptions(options, solver="portable", prefilter=prefilter)
    )
    return {r.frame: type(r.verdict) for r in query.results() if isinstance(r.verdict, Match | Unknown)}, query


def cases():
    """Every program under every option; those that keep a solver busy only by request."""
    for options in OPTIONS:
        for name in PROGRAMS:
            busy = name == "badly parked" or (name in ("nonlinear", "follow", "figure 6") and options != "default")
            yield pytest.param(name, options, marks=[pytest.mark.slow] * busy)


@pytest.mark.parametrize(("name", "options"), list(cases()))
def test_the_prefilter_loses_nothing(dataset, name, options):
    text = PROGRAMS[name]
    with_it, query = found(dataset, text, OPTIONS[options], prefilter=True)
    without, _ = found(dataset, text, OPTIONS[options], prefilter=False)
    assert with_it == without
    assert query.funnel.frames == dataset.manifest.total.frames
    assert query.funnel.candidates >= len(with_it)


@pytest.mark.parametrize("name", ["ahead", "offset", "facing field", "requirement", "visible road", "picked lane"])
def test_the_prefilter_is_worth_having(dataset, name):
    _, query = found(dataset, PROGRAMS[name], MatchOptions(), prefilter=True)
    idle = query.funnel.candidates - query.funnel.matches
    assert idle < (dataset.manifest.total.frames - query.funnel.matches) / 2


def test_every_step_is_named_after_the_program(dataset):
    text = "ego = new Car\nother = new Car ahead of ego by Range(4, 10)\nrequire (distance to other) < 9"
    scenario = compile_scenario(Source("test.scenic", HEADER + text), STREET)
    plan = make_plan(scenario, STREET, MatchOptions())
    names = [step.what for step in plan.steps]
    assert "other.class" in names
    assert "require (distance to other) < 9" in names
    assert all(step.span is not None for step in plan.steps)


def test_a_hostile_map_name_stays_a_string(dataset):
    scenario = compile_scenario(Source("test.scenic", HEADER + "ego = new Car"), STREET)
    plan = make_plan(replace_name(scenario), STREET, MatchOptions())
    connection = dataset.connect()
    assert "DROP" not in plan.sql.replace("''", "")
    assert len(list(plan.run(connection))) == dataset.manifest.total.frames


def replace_name(scenario):
    return replace(scenario, map="street'; DROP TABLE labels; --")


def test_the_steps_add_up_to_what_is_left(dataset):
    text = "ego = new Car\nother = new Car ahead of ego by Range(4, 10)\nrequire (distance to other) < 9"
    scenario = compile_scenario(Source("test.scenic", HEADER + text), STREET)
    plan = make_plan(scenario, STREET, MatchOptions())
    left = plan.left(dataset.connect())
    assert left[0] == dataset.manifest.total.frames
    assert left == sorted(left, reverse=True)
    rows = list(plan.run(dataset.connect()))
    assert left[-1] == sum(row.step is None for row in rows)
    for number, step in enumerate(plan.steps):
        assert left[number] - left[number + 1] == sum(row.step is step for row in rows)
