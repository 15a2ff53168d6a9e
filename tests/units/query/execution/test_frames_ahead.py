"""Progress where other processes decide: every frame counts once, and before its block arrives."""

from __future__ import annotations

import numpy as np

from scenicq.errors import Source
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.frames_ahead import FramesAhead, telling
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset


def test_frames_count_once_whoever_tells_of_them():
    shown = []
    ahead = FramesAhead(shown.append)
    ahead.told((0, 50, 10))
    ahead.told((50, 90, 5))
    ahead.told((0, 50, 30))
    ahead.told((50, 90, 3))  # a block that is begun again
    assert sum(shown) == 35
    ahead.taken(40)
    ahead.taken(10)
    assert sum(shown) == 50
    ahead.taken(40)
    assert sum(shown) == 90


def test_a_process_tells_how_far_it_is():
    told = []
    missed = np.array([3, -1, 0, -1, -1, 2], dtype=np.int16)
    assert list(telling("abc", missed, (100, 106), told.append, every_s=-1.0)) == ["a", "b", "c"]
    assert told == [(100, 106, 2), (100, 106, 4), (100, 106, 5)]


def test_with_processes_all_frames_are_counted(crossroads):
    text = "model scenic.domains.driving.model\nego = new Car on road\nother = new Car on road\n"
    options = QueryOptions(match=MatchOptions(tolerance=parse_tolerance("position=0.25,heading=5deg")), jobs=2)
    query = Query(open_dataset(crossroads), Source("p.scenic", text), options)
    shown = []
    found = list(query.results(shown.append))
    assert sum(shown) == query.funnel.frames == 156
    assert len(found) == query.funnel.matches > 0
