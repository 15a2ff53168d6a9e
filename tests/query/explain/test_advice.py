"""Advice for queries that find hardly anything: its numbers are those that the changed program has."""

from __future__ import annotations

import pytest

from scenicq.errors import Source
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain import advice as advice_module
from scenicq.query.explain import prefilter_counts
from scenicq.query.explain.advice import advice
from scenicq.store.dataset import open_dataset

TEXT = """model scenic.domains.driving.model
roadway = network.laneRegion.union(network.intersectionRegion)
ego = new Car on roadway
walker = new Pedestrian on sidewalk, facing Range(0, 360) deg
require (distance to walker) < 2
"""


@pytest.fixture(scope="module")
def dataset(crossroads):
    return open_dataset(crossroads)


def taken(dataset, text, tolerance="position=0.25,heading=5deg"):
    options = QueryOptions(match=MatchOptions(tolerance=parse_tolerance(tolerance)), solver="portable")
    query = Query(dataset, Source("p.scenic", text), options)
    list(query.results())
    return query


def test_each_number_is_that_of_the_changed_program(dataset):
    query = taken(dataset, TEXT)
    assert query.funnel.matches == 0
    found = advice(query)
    assert found.complete
    assert found.first[0] == query.funnel.excluded.most_common(1)[0]
    told = {each.change.told: each for each in found.outlooks}
    without = told["without `require (distance to walker) < 2`"]
    assert without.certain
    assert not without.sampled
    assert without.least == taken(dataset, TEXT.replace("require (distance to walker) < 2\n", "")).funnel.matches > 0
    for change, outlook in told.items():
        if change.startswith("--tolerance "):
            assert outlook.least == taken(dataset, TEXT, change.removeprefix("--tolerance ")).funnel.matches
    assert [each.least for each in found.outlooks] == sorted((each.least for each in found.outlooks), reverse=True)


def test_a_feature_is_a_change_too(dataset):
    text = TEXT.replace("< 2", "< 30").replace("facing Range(0, 360) deg", "facing Range(1, 2) deg")
    told = {each.change.told: each.least for each in advice(taken(dataset, text)).outlooks}
    loose = taken(dataset, text, "position=0.25,heading=5deg,walker.heading=180deg")
    assert told["`walker.heading` not compared"] == loose.funnel.matches > 0


def test_a_wider_class_is_a_change_too(dataset):
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Bus on road, facing Range(0, 360) deg\n"
    told = {each.change.told: each.least for each in advice(taken(dataset, text)).outlooks}
    assert told["`other` as `Vehicle`"] == taken(dataset, text.replace("Bus", "Vehicle")).funnel.matches > 0


def test_a_parameter_is_a_change_too(dataset):
    plain = TEXT.replace("< 2", "< 30")
    text = plain.replace("ego =", "param weather = 'foggy'\nego =")
    told = {each.change.told: each.least for each in advice(taken(dataset, text)).outlooks}
    assert told["--ignore-params weather"] == taken(dataset, plain).funnel.matches > 0


def test_large_datasets_are_sampled(dataset, monkeypatch):
    monkeypatch.setattr(advice_module, "_MOST_FRAMES", 10)
    query = taken(dataset, TEXT)
    assert not any(each.sampled for each in advice(query).outlooks)  # where the sample is all there is
    monkeypatch.setattr(prefilter_counts, "_SPOT_FRAMES", 10)
    found = advice(query)
    assert found.outlooks
    assert all(each.sampled for each in found.outlooks)


def test_brief_advice_is_bounded_by_work_and_says_no_more_than_all_of_it(dataset):
    query = taken(dataset, TEXT)
    brief, full = advice(query, brief=True), advice(query)
    assert not brief.complete
    known = {each.change.told: each for each in full.outlooks}
    for each in brief.outlooks:
        assert each.least <= known[each.change.told].least <= each.most


def test_without_time_one_change_is_tried(dataset):
    query = taken(dataset, TEXT)
    found = advice(query, budget_s=0.0)
    assert not found.complete
    assert len(found.outlooks) <= 1


def test_the_command_advises_where_nothing_matches_and_when_asked(run, crossroads, scenarios, tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(TEXT)
    done = run("match", file, crossroads, "--advise")
    assert (done.exit_code, done.stdout) == (1, "")
    assert done.stderr.startswith("0 matches in 156 frames; ")
    assert "without `require (distance to walker) < 2`" in done.stderr
    assert "line 5" in done.stderr
    assert run("match", file, crossroads).stderr.startswith("0 matches in 156 frames; ")
    assert run("match", file, crossroads, "--quiet").stderr == ""
    crossing = scenarios / "02_crossing_cars.scenic"
    assert run("match", crossing, crossroads).stderr == ""
    asked = run("match", crossing, crossroads, "--advise")
    assert asked.exit_code == 0
    assert asked.stderr.startswith("5 matches in 156 frames; ")
