"""The last lane of a track: where a car turns around, its heading fits a lane that crosses its own."""

from __future__ import annotations

import pytest
from turning_cars import BEFORE, IN, INSIDE, TURNING, U, dataset_of

from scenicq.errors import Source
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.rebuild import rebuild


@pytest.mark.parametrize(
    ("path", "step_s", "last"),
    [
        ([BEFORE, TURNING], 0.5, [None, IN]),
        ([INSIDE, TURNING], 0.5, [None, U]),
        # the lane on the way is the last one, once it is the only one that leads its way
        ([BEFORE, (3, 3, 0), TURNING], 0.5, [None, None, U]),
        ([BEFORE, TURNING, TURNING, INSIDE], 0.5, [None, IN, IN, None]),
        # where nothing leads its way, what goes on from the last lane is its own
        ([BEFORE, (0, 5, 0)], 0.5, [None, IN]),
        # nothing is known across a gap, nor of a lane across which somebody drives
        ([BEFORE, TURNING], 1.6, [None, None]),
        ([(2, -3, 90), TURNING], 0.5, [None, None]),
        # who turns across in it still is in it
        ([BEFORE, (2, -2, 90), TURNING], 0.5, [None, None, IN]),
        # a lane that does not lead there
        ([(-2, -3, 180), TURNING], 0.5, [None, None]),
        # without a heading the only lane is that of the track, and all lanes are its own
        ([(2, -3, None), TURNING], 0.5, [None, IN]),
        ([BEFORE, (0, 5, None)], 0.5, [None, None]),
        # off all lanes it keeps the last
        ([BEFORE, (30, 20, 0), TURNING], 0.5, [None, None, IN]),
    ],
)
def test_the_last_lane_is_kept_where_a_lane_that_does_not_lead_the_way_continues_it(tmp_path, path, step_s, last):
    dataset = dataset_of(tmp_path, path, step_s)
    with dataset.connect() as connection:
        found = connection.sql("SELECT id, last_lane FROM objects ORDER BY timestamp_us, id").fetchall()
        assert found == [each for value in last for each in (("a", value), ("b", None))]
        egos = connection.sql("SELECT ego_last_lane FROM labels ORDER BY timestamp_us").fetchall()
    assert [value for (value,) in egos] == last
    assert [label.objects[1].last_lane for label in dataset.labels()] == last


LANES = "model scenic.domains.driving.model\nego = new Car in everywhere, facing Range(-180, 180) deg\n"


@pytest.mark.parametrize("how", [{}, {"proofs": False}, {"prefilter": False}])
def test_a_lane_that_continues_the_last_one_is_its_own(tmp_path, how):
    dataset = dataset_of(tmp_path, [BEFORE, TURNING, (0, 5, 0)])
    found = {
        name: {each.frame for each in Query(dataset, Source("p.scenic", text), QueryOptions(**how)).results()
               if isinstance(each.verdict, Match)}
        for name in ("in", "u", "cross")
        for text in (f"{LANES}require ego.lane is network.elements['{name}']\n",)
    }  # fmt: skip
    assert found == {"in": {"0"}, "u": {"1", "2"}, "cross": {"1"}}


def test_it_is_computed_anew_and_verified(tmp_path):
    dataset = dataset_of(tmp_path, [BEFORE, TURNING])
    before = {path.name: path.read_bytes() for path in (tmp_path / "d").rglob("*.parquet")}
    dataset.verify()
    rebuild(dataset)
    assert {path.name: path.read_bytes() for path in (tmp_path / "d").rglob("*.parquet")} == before
