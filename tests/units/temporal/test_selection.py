"""Intervals that are reported against the definition: the longest, then whatever overlaps none before it; the rest."""

import random

import numpy as np
import pytest
from interval_definition import random_trace, recording_of

from scenicq.errors import Source
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions
from scenicq.temporal.selection import choose_intervals


def expected(intervals: list[tuple[int, int, int, float]], least: float) -> list[tuple[int, int]]:
    """The intervals (start, end, truth, seconds) that are kept."""
    kept: list[tuple[int, int]] = []
    for start, end, truth, lasting in sorted(intervals, key=lambda each: (-each[2], -each[3], each[0])):
        if truth > 0 and lasting >= least - 1e-6 and all(end < a or b < start for a, b in kept):
            kept.append((start, end))
    return sorted(kept)


def test_the_longest_of_overlapping_intervals_are_kept():
    draw = random.Random(1)
    compared = 0
    for _ in range(400):
        times = np.cumsum([draw.choice([1, 2, 5]) for _ in range(80)]) / 10
        first = draw.randint(0, 40)
        found = []
        for _ in range(draw.randint(0, 12)):
            start = first + draw.randint(0, 20)
            end = start + draw.randint(0, 8)
            found.append((start, end, draw.choice([0, 1, 2]), float(times[end] - times[start])))
        starts, ends, truth, lasting = (np.array([each[k] for each in found], dtype=np.float64) for k in range(4))
        starts, ends = starts.astype(np.int64), ends.astype(np.int64)
        kept = choose_intervals(starts, ends, truth.astype(np.int8), lasting, "longest", 0.3)
        assert list(zip(starts[kept].tolist(), ends[kept].tolist(), strict=True)) == expected(found, 0.3)
        compared += len(kept)
    assert compared > 500


TEXT = """ego = new Object at (Range(-999, 999), Range(-999, 999)), facing 0
a = new Object at (Range(-999, 999), Range(-999, 999)), facing 0
require always (distance from ego to a) < 5
terminate when a.position.x > ego.position.x
"""


@pytest.mark.parametrize("least", [None, 1.0])
def test_what_is_not_told_is_counted(tmp_path, least):
    draw = random.Random(5)
    traces = {f"r{number:02}": random_trace(draw, gaps=True) for number in range(12)}
    write_dataset(tmp_path / "d", [recording_of(*each) for each in traces.items()], {}, name="d")

    def found(*, every: bool, proofs: bool) -> tuple[Query, list[Result]]:
        options = QueryOptions(every=every, proofs=proofs, time=IntervalOptions(min_duration_s=least))
        query = Query(open_dataset(tmp_path / "d"), Source("p.scenic", TEXT), options)
        return query, list(query.results())

    whole, everything = found(every=True, proofs=True)
    query, told = found(every=False, proofs=False)
    assert {each.verdict.correspondence["a"] for each in everything if isinstance(each.verdict, Match)}
    assert dict(query.funnel.broken) == dict(whole.funnel.broken) != {}
    assert query.funnel.over_time == whole.funnel.over_time
    told_of = [(each.frame, each.interval, dict(each.verdict.correspondence)) for each in told]
    assert told_of == [
        (each.frame, each.interval, dict(each.verdict.correspondence))
        for each in everything
        if not isinstance(each.verdict, NoMatch)
    ]
