"""The prefilter loses nothing: with and without it the results are the same."""

from __future__ import annotations

import math
import random
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from drawing import draw_scene
from shapely.geometry import LineString

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.prefilter.executor import blocks, extents, run_prefilter
from scenicq.query.prefilter.plan import make_plan
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Recording
from scenicq.store.writer import write_dataset

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2] / "match"))
from made_up import RANDOM, TIED
from nudged_scenes import dataset_of
from programs import HEADER, PROGRAMS
from scenes import label_of

STREET = street()
OPTIONS = {
    "default": MatchOptions(tolerance=EXACT),
    "wide box": MatchOptions(tolerance=Tolerance(x=0.5, y=0.25, heading=math.radians(10)), classes="coarse"),
    "wide disc": MatchOptions(tolerance=Tolerance(position=3.0, heading=math.radians(60))),
    "radius": MatchOptions(tolerance=Tolerance(position=0.5), radius=25.0),
    "any ego": MatchOptions(tolerance=Tolerance(position=0.2, heading=0.1), ego="any"),
}


@pytest.fixture(scope="module")
def dataset(program_scenes) -> Dataset:
    """Scenes of every program."""
    return program_scenes


@pytest.fixture(scope="module")
def tied(tmp_path_factory) -> Dataset:
    """Scenes of the programs whose objects are tied to each other, and of random ones."""
    return dataset_of(TIED | RANDOM, tmp_path_factory.mktemp("tied"))


def found(
    dataset: Dataset, text: str, options: MatchOptions, *, prefilter: bool, reasons: bool = True
) -> tuple[dict, Query]:
    how = QueryOptions(options, solver="portable", prefilter=prefilter, reasons=reasons)
    query = Query(dataset, Source("test.scenic", HEADER + text), how)
    return {
        r.frame: (type(r.verdict), r.verdict.correspondence)
        for r in query.results()
        if isinstance(r.verdict, Match | Unknown)
    }, query


@pytest.mark.parametrize("name", ["ahead", "offset", "figure 3", "facing field", "shared heading", "crowd"])
@pytest.mark.one_in(8)
def test_the_prefilter_keeps_to_scopes(dataset, name):
    scenario = compile_scenario(Source("test.scenic", HEADER + PROGRAMS[name]), STREET)
    rng = random.Random(name)
    scopes = ["Object", "Vehicle", *(each.name for each in scenario.objects), *(o.category for o in scenario.objects)]
    for _ in range(3):
        rules = {
            (rng.choice(scopes), rng.choice(["position", "heading"])): rng.choice([0.001, 0.1, 1.0]) for _ in range(3)
        }
        scoped = replace(EXACT, rules=tuple((*key, size) for key, size in sorted(rules.items())))
        options = MatchOptions(tolerance=scoped)
        with_it, without = (found(dataset, PROGRAMS[name], options, prefilter=each)[0] for each in (True, False))
        assert with_it == without, scoped


def cases():
    """Every program as it is and under half of the options; those that keep a solver busy only by request."""
    for row, options in enumerate(OPTIONS):
        for column, name in enumerate(PROGRAMS):
            if options != "default" and row % 2 != column % 2:
                continue
            busy = name in ("badly parked", "follow") or (name in ("nonlinear", "figure 6") and options != "default")
            yield pytest.param(name, options, marks=[pytest.mark.slow] * busy)


@pytest.mark.parametrize(("name", "options"), list(cases()))
@pytest.mark.one_in(96)
def test_the_prefilter_loses_nothing(dataset, name, options):
    text = PROGRAMS[name]
    with_it, query = found(dataset, text, OPTIONS[options], prefilter=True)
    without, _ = found(dataset, text, OPTIONS[options], prefilter=False)
    assert with_it == without
    assert with_it == found(dataset, text, OPTIONS[options], prefilter=True, reasons=False)[0]
    assert query.funnel.frames == dataset.manifest.total.frames
    assert query.funnel.candidates >= len(with_it)


def tied_cases():
    """Each program under some options; most random ones only by request."""
    for number, name in enumerate([*TIED, *RANDOM]):
        for options in ("default", "wide box", "radius"):
            rare = number >= len(TIED) + 4 or (number % 3 and options != "default")
            yield pytest.param(name, options, marks=[pytest.mark.slow] * bool(rare))


@pytest.mark.parametrize(("name", "options"), list(tied_cases()))
@pytest.mark.one_in(48)
def test_nothing_is_lost_between_objects_and_in_unions(tied, name, options):
    text = (TIED | RANDOM)[name]
    with_it, query = found(tied, text, OPTIONS[options], prefilter=True)
    assert with_it == found(tied, text, OPTIONS[options], prefilter=False)[0]
    assert with_it == found(tied, text, OPTIONS[options], prefilter=True, reasons=False)[0]
    assert query.funnel.frames == tied.manifest.total.frames


@pytest.mark.parametrize(
    "name", ["ahead of another", "beside another", "near another", "facing another", "either side"]
)
def test_pairs_and_unions_are_worth_having(tied, name):
    _, query = found(tied, TIED[name], MatchOptions(tolerance=EXACT), prefilter=True)
    idle = query.funnel.candidates - query.funnel.matches
    assert query.funnel.matches > 0
    assert idle <= max(3, query.funnel.matches / 2)


@pytest.mark.parametrize("name", ["ahead", "offset", "facing field", "requirement", "visible road", "picked lane"])
def test_the_prefilter_is_worth_having(dataset, name):
    _, query = found(dataset, PROGRAMS[name], MatchOptions(tolerance=EXACT), prefilter=True)
    idle = query.funnel.candidates - query.funnel.matches
    assert idle < (dataset.manifest.total.frames - query.funnel.matches) / 2


def test_every_step_is_named_after_the_program(dataset):
    text = "ego = new Car\nother = new Car ahead of ego by Range(4, 10)\nrequire (distance to other) < 9"
    scenario = compile_scenario(Source("test.scenic", HEADER + text), STREET)
    plan = make_plan(scenario, STREET, MatchOptions(tolerance=EXACT))
    names = [step.what for step in plan.steps]
    assert "other.class" in names
    assert "require (distance to other) < 9" in names
    assert all(step.span is not None for step in plan.steps)


def test_a_hostile_map_name_stays_a_string(dataset):
    scenario = compile_scenario(Source("test.scenic", HEADER + "ego = new Car"), STREET)
    plan = make_plan(scenario, STREET, MatchOptions(tolerance=EXACT))
    hostile = replace(plan, map="street'; DROP VIEW labels; --")
    with closing(dataset.connect()) as connection:
        whole = blocks(extents(dataset, connection), "street")
        assert (
            sum(len(run_prefilter(dataset, connection, plan, block)) for block in whole)
            == dataset.manifest.total.frames
        )
        for block in whole:
            assert len(run_prefilter(dataset, connection, hostile, replace(block, map=hostile.map))) == 0
        assert connection.execute("SELECT count(*) FROM labels").fetchall() == [(dataset.manifest.total.frames,)]


def test_a_field_that_is_not_the_direction_of_roads_is_not_taken_for_it(tmp_path):
    """The store keeps the direction of roads for each object; a curb may run otherwise."""
    slanted = MapFeature("slanted", "curb", LineString([(0.5, 30.0), (3.2, 40.0)]), {})
    features = [each for each in STREET.features if each.kind != "curb"] + [slanted]
    text = "ego = new Car on curb"
    scenario = compile_scenario(Source("test.scenic", HEADER + text), Network("street", features))
    rng = random.Random(4)
    scenes = [draw_scene(scenario, rng) for _ in range(5)]
    labels = [replace(label_of(scenario, scene, rng), frame=f"{n}", timestamp_us=n) for n, scene in enumerate(scenes)]
    assert all(abs(abs(label.ego.heading) - math.atan2(2.7, 10.0)) < 1e-9 for label in labels)
    recording = Recording("recording", "street", tuple(labels))
    write_dataset(tmp_path / "dataset", iter([recording]), {"street": features}, name="t")
    dataset = open_dataset(tmp_path / "dataset")
    with_it, without = (
        found(dataset, text, MatchOptions(tolerance=EXACT), prefilter=each)[0] for each in (True, False)
    )
    assert with_it == without
    assert len(with_it) == 5
