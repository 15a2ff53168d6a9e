"""What each step of the prefilter leaves is what running it leaves."""

from __future__ import annotations

from contextlib import closing

import pytest
from programs import HEADER

from scenicq.errors import Source
from scenicq.query.execution.run import Query
from scenicq.query.explain.prefilter_counts import prefilter_counts
from scenicq.query.prefilter.executor import blocks, extents, run_prefilter
from scenicq.query.prefilter.plan import Plan
from scenicq.store.dataset import Dataset


@pytest.fixture(scope="module")
def dataset(program_scenes) -> Dataset:
    """Scenes of every program."""
    return program_scenes


def sifted(dataset: Dataset, plan: Plan) -> list[int]:
    with closing(dataset.connect()) as connection:
        cut = blocks(extents(dataset, connection), plan.map)
        return [number for block in cut for number in run_prefilter(dataset, connection, plan, block).tolist()]


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
