"""Whoever decides blocks: the results are the same, and other processes are started only where it takes long."""

from __future__ import annotations

import multiprocessing

import pytest
from made_up import TIED
from programs import HEADER

from scenicq.errors import Source
from scenicq.query.execution.records import record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset


@pytest.fixture(scope="module")
def dataset(program_scenes) -> Dataset:
    """Scenes of every program."""
    return program_scenes


@pytest.mark.parametrize("jobs", [1, 2, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.one_in(2)
def test_small_blocks_and_processes_give_the_same(dataset, jobs, monkeypatch):
    monkeypatch.setattr("scenicq.query.execution.block_executor.default_processes", lambda: 2)
    monkeypatch.setattr("scenicq.query.execution.block_executor._PAYS_S", 0.0)
    monkeypatch.setattr("scenicq.query.prefilter.executor._FEWEST_FRAMES", 20)
    monkeypatch.setattr("scenicq.query.prefilter.executor._MOST_FRAMES", 40)
    source = Source("test.scenic", HEADER + TIED["ahead of another"])
    whole = Query(dataset, source, QueryOptions(every=True, solver="portable"))
    expected = [record(result) for result in whole.results()]
    assert [row.frame for row in expected] == [label.frame for label in dataset.labels()]
    assert len(whole.blocks("street")) > 3
    query = Query(dataset, source, QueryOptions(every=True, solver="portable", jobs=jobs))
    assert [record(result) for result in query.results()] == expected
    assert query.funnel == whole.funnel


@pytest.mark.parametrize("pays", [True, False])
@pytest.mark.one_in(2)
@pytest.mark.slow
def test_processes_are_started_once_it_is_clear_that_it_takes_long(dataset, pays, monkeypatch):
    monkeypatch.setattr("scenicq.query.prefilter.executor._FEWEST_FRAMES", 20)
    monkeypatch.setattr("scenicq.query.execution.block_executor.default_processes", lambda: 2)
    monkeypatch.setattr("scenicq.query.execution.block_executor._PAYS_S", 0.0 if pays else 3600.0)
    query = Query(dataset, Source("test.scenic", HEADER + TIED["near another"]), QueryOptions(every=True, jobs=None))
    processes = []
    for _ in query.results():
        processes.append(len(multiprocessing.active_children()))
    assert processes[0] == 0
    assert max(processes) == (2 if pays else 0)
    assert len(processes) == dataset.manifest.total.frames
