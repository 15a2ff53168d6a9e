"""Blocks: every frame is in one, and what is run on several together is what is run on each."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import pytest
from programs import HEADER

from scenicq.errors import Source
from scenicq.match.options import MatchOptions
from scenicq.match.problem.observation import observe
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.prefilter.executor import Extent, blocks, hold, run_plan, run_prefilter
from scenicq.query.prefilter.survivors import candidates
from scenicq.store.dataset import Dataset


@pytest.fixture(scope="module")
def dataset(program_scenes) -> Dataset:
    """Scenes of every program."""
    return program_scenes


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
    where = {
        "street": [Extent(0, 0, frames, ("recording", "recording"), frames), Extent(1, 10, 9_000, ("s", "t"), 8_990)]
    }
    for least in (1, 2, 7):
        cut = blocks(where, "street", least=least)
        rows = [(block.part, row) for block in cut for row in range(block.first, block.end)]
        assert rows == [(0, row) for row in range(frames)] + [(1, row) for row in range(10, 9_000)]
    assert len(blocks(where, "street", least=100)) <= 6
    assert {block.part for block in blocks(where, "street", ("a", "recording"))} == {0}
    assert blocks(where, "elsewhere") == []


def test_what_matters_of_label_objects_is_read(dataset):
    text = "ego = new Car on road\nother = new Car ahead of ego by Range(4, 10)"
    (plan,) = Query(dataset, Source("test.scenic", HEADER + text)).plans()
    (block,) = Query(dataset, Source("test.scenic", HEADER + text)).blocks(plan.map)
    with closing(dataset.connect()) as connection:
        run_prefilter(dataset, connection, plan, block)
        whole = list(candidates(connection, plan, motion=True))
        for observed in ({"heading"}, {"heading", "width", "speed"}, {"heading", "viewAngle"}):
            for one, other in zip(whole, candidates(connection, plan, motion=True, observed=observed), strict=True):
                assert (one.label.frame, one.label.sensors) == (other.label.frame, other.label.sensors)
                assert one.among == other.among
                for here, there in zip(
                    (one.label.ego, *one.label.objects), (other.label.ego, *other.label.objects), strict=True
                ):
                    assert (here.id, here.category, here.x, here.y) == (there.id, there.category, there.x, there.y)
                    known, read = observe(here), observe(there)
                    assert {name: known[name] for name in observed & known.keys()} == {
                        name: read[name] for name in observed & read.keys()
                    }
                    assert "length" not in read
        assert any("length" in observe(each) for candidate in whole for each in candidate.label.objects)


class Watched:
    """A connection that notes what it is asked."""

    def __init__(self, connection):
        self.connection, self.asked = connection, []

    def execute(self, sql):
        self.asked.append(sql)
        return self.connection.execute(sql)

    def __getattr__(self, name):
        return getattr(self.connection, name)


def test_of_frames_whose_columns_exclude_them_nothing_else_is_asked(dataset):
    text = "ego = new Car on road, facing 90 deg relative to roadDirection\nnew Car ahead of ego by 5"
    query = Query(dataset, Source("test.scenic", HEADER + text))
    (plan,) = query.plans()
    (whole,) = query.blocks(plan.map)
    with closing(dataset.connect(views=False)) as connection:
        missed = run_prefilter(dataset, connection, plan, whole)
        out = missed >= 0
        assert out.any()
        for row in (int(out.argmax()), int(out.argmin())):
            watched = Watched(connection)
            alone = run_prefilter(dataset, watched, plan, replace(whole, first=row, end=row + 1))
            assert alone.tolist() == [missed[row]]
            assert (len(watched.asked) == 1) is bool(out[row])
