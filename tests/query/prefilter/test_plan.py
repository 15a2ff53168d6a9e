"""The prefilter loses nothing: with and without it the results are the same."""

from __future__ import annotations

import math
import multiprocessing
import random
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from drawing import draw_scene
from shapely.geometry import LineString

from scenicq.compiler.default_street import street
from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.results import record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.prefilter_counts import prefilter_counts
from scenicq.query.prefilter.executor import Extent, blocks, candidates, extents, hold, run_plan, run_prefilter
from scenicq.query.prefilter.plan import Plan, make_plan
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
def dataset(tmp_path_factory) -> Dataset:
    """Scenes of every program."""
    return dataset_of(PROGRAMS, tmp_path_factory.mktemp("plan"))


@pytest.fixture(scope="module")
def tied(tmp_path_factory) -> Dataset:
    """Scenes of the programs whose objects are tied to each other, and of random ones."""
    return dataset_of(TIED | RANDOM, tmp_path_factory.mktemp("tied"))


def found(dataset: Dataset, text: str, options: MatchOptions, *, prefilter: bool) -> tuple[dict, Query]:
    query = Query(
        dataset, Source("test.scenic", HEADER + text), QueryOptions(options, solver="portable", prefilter=prefilter)
    )
    return {
        r.frame: (type(r.verdict), r.verdict.correspondence)
        for r in query.results()
        if isinstance(r.verdict, Match | Unknown)
    }, query


@pytest.mark.parametrize("name", ["ahead", "offset", "figure 3", "facing field", "shared heading", "crowd"])
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
    """Every program under every option; those that keep a solver busy only by request."""
    for options in OPTIONS:
        for name in PROGRAMS:
            busy = name in ("badly parked", "follow") or (name in ("nonlinear", "figure 6") and options != "default")
            yield pytest.param(name, options, marks=[pytest.mark.slow] * busy)


@pytest.mark.parametrize(("name", "options"), list(cases()))
def test_the_prefilter_loses_nothing(dataset, name, options):
    text = PROGRAMS[name]
    with_it, query = found(dataset, text, OPTIONS[options], prefilter=True)
    without, _ = found(dataset, text, OPTIONS[options], prefilter=False)
    assert with_it == without
    assert query.funnel.frames == dataset.manifest.total.frames
    assert query.funnel.candidates >= len(with_it)


def tied_cases():
    """Each program under some options; most random ones only by request."""
    for number, name in enumerate([*TIED, *RANDOM]):
        for options in ("default", "wide box", "radius"):
            rare = number >= len(TIED) + 4 or (number % 3 and options != "default")
            yield pytest.param(name, options, marks=[pytest.mark.slow] * bool(rare))


@pytest.mark.parametrize(("name", "options"), list(tied_cases()))
def test_nothing_is_lost_between_objects_and_in_unions(tied, name, options):
    text = (TIED | RANDOM)[name]
    with_it, query = found(tied, text, OPTIONS[options], prefilter=True)
    assert with_it == found(tied, text, OPTIONS[options], prefilter=False)[0]
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


def sifted(dataset: Dataset, plan: Plan) -> list[int]:
    with closing(dataset.connect()) as connection:
        cut = blocks(extents(dataset, connection), plan.map)
        return [number for block in cut for number in run_prefilter(dataset, connection, plan, block).tolist()]


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


def test_the_steps_add_up_to_what_is_left(dataset):
    text = "ego = new Car\nother = new Car ahead of ego by Range(4, 10)\nrequire (distance to other) < 9"
    query = Query(dataset, Source("test.scenic", HEADER + text))
    (surveyed,) = prefilter_counts(query)
    left = surveyed.left
    assert left[0] == surveyed.estimated[0] == dataset.manifest.total.frames
    assert list(left) == sorted(left, reverse=True)
    missed = sifted(dataset, surveyed.plan)
    assert left[-1] == missed.count(-1)
    for number in range(len(surveyed.plan.steps)):
        assert left[number] - left[number + 1] == missed.count(number)


def test_blocks_that_are_held_together_are_sifted_as_each_alone(dataset):
    text = "ego = new Car on road\nother = new Car ahead of ego by Range(4, 10)\nrequire (distance to other) < 9"
    query = Query(dataset, Source("test.scenic", HEADER + text))
    (plan,) = query.plans()
    (whole,) = query.blocks(plan.map)
    cut = [replace(whole, first=first, end=min(first + 7, whole.end)) for first in range(0, whole.end, 14)]
    with closing(dataset.connect()) as connection:
        missed = [number for block in cut for number in run_prefilter(dataset, connection, plan, block).tolist()]
        frames = [
            each.label.frame
            for block in cut
            if (run_prefilter(dataset, connection, plan, block) < 0).any()
            for each in candidates(connection, plan)
        ]
    with closing(dataset.connect(threads=1, views=False)) as connection:
        assert hold(dataset, connection, cut) == len(missed)
        for _ in range(2):  # as often as one likes
            assert run_plan(connection, plan).tolist() == missed
            assert [each.label.frame for each in candidates(connection, plan)] == frames
    assert frames


@pytest.mark.parametrize(("options", "read"), [(MatchOptions(), False), (MatchOptions(ego="any"), True)])
def test_objects_that_can_play_no_role_are_not_read(dataset, options, read):
    query = Query(dataset, Source("test.scenic", HEADER + "ego = new Car on road"), QueryOptions(options))
    (plan,) = query.plans()
    (block,) = query.blocks(plan.map)
    with closing(dataset.connect()) as connection:
        run_prefilter(dataset, connection, plan, block)
        labels = [each.label for each in candidates(connection, plan)]
    assert labels
    assert any(label.objects for label in labels) is read
    matching = {each.frame for each in query.results()}
    assert matching
    without = Query(dataset, query.source, QueryOptions(options, prefilter=False))
    assert matching == {each.frame for each in without.results()}


def test_blocks_cover_every_frame_once(dataset):
    frames = dataset.manifest.total.frames
    where = {"street": [Extent(0, 0, frames, ("recording", "recording")), Extent(1, 10, 9_000, ("s", "t"))]}
    for least in (1, 2, 7):
        cut = blocks(where, "street", least=least)
        rows = [(block.part, row) for block in cut for row in range(block.first, block.end)]
        assert rows == [(0, row) for row in range(frames)] + [(1, row) for row in range(10, 9_000)]
    assert len(blocks(where, "street", least=100)) <= 6
    assert {block.part for block in blocks(where, "street", ("a", "recording"))} == {0}
    assert blocks(where, "elsewhere") == []


@pytest.mark.parametrize("jobs", [1, 2, None])
def test_small_blocks_and_processes_give_the_same(dataset, jobs, monkeypatch):
    monkeypatch.setattr("scenicq.query.execution.block_executor.as_many_as_pay", lambda: 2)
    monkeypatch.setattr("scenicq.query.execution.block_executor._PAYS_S", 0.0)
    monkeypatch.setattr("scenicq.query.prefilter.executor._FEWEST_FRAMES", 20)
    monkeypatch.setattr("scenicq.query.prefilter.executor._MOST_FRAMES", 40)
    source = Source("test.scenic", HEADER + TIED["ahead of another"])
    whole = Query(dataset, source, QueryOptions(every=True, solver="portable"))
    expected = [record(result) for result in whole.results()]
    assert [row["frame"] for row in expected] == [label.frame for label in dataset.labels()]
    assert len(whole.blocks("street")) > 3
    query = Query(dataset, source, QueryOptions(every=True, solver="portable", jobs=jobs))
    assert [record(result) for result in query.results()] == expected
    assert query.funnel == whole.funnel


@pytest.mark.parametrize("pays", [True, False])
def test_processes_are_started_once_it_is_clear_that_it_takes_long(dataset, pays, monkeypatch):
    monkeypatch.setattr("scenicq.query.prefilter.executor._FEWEST_FRAMES", 20)
    monkeypatch.setattr("scenicq.query.execution.block_executor.as_many_as_pay", lambda: 2)
    monkeypatch.setattr("scenicq.query.execution.block_executor._PAYS_S", 0.0 if pays else 3600.0)
    query = Query(dataset, Source("test.scenic", HEADER + TIED["near another"]), QueryOptions(every=True, jobs=None))
    processes = []
    for _ in query.results():
        processes.append(len(multiprocessing.active_children()))
    assert processes[0] == 0
    assert max(processes) == (2 if pays else 0)
    assert len(processes) == dataset.manifest.total.frames


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
