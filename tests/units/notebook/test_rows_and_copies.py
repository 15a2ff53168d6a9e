"""Results are plain rows for pandas, Polars and `asdict`; results and datasets are copied and pickled."""

import copy
import dataclasses
import json
import os
import pickle

import msgspec
import pytest

import scenicq
from scenicq.query.execution.records import json_text
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.result_tables import read_row
from scenicq.store.read_lock import Reading, nobody_reads

PROGRAM = "ego = new Car; new Car"


@pytest.fixture(scope="module")
def matches(crossroads):
    found = scenicq.open(crossroads).match(PROGRAM)
    assert len(found) > 1
    return found


def test_a_result_is_a_plain_row(matches):
    row = dataclasses.asdict(matches[0])
    told = matches[0].record
    assert row["roles"] == told["correspondence"]
    assert json.loads(json.dumps(row["witness"])) == told["witness"]
    assert {name: row[name] for name in ("frame", "recording", "timestamp_us", "verdict")} == {
        name: told[name] for name in ("frame", "recording", "timestamp_us", "verdict")
    }
    assert dataclasses.astuple(matches[0])[0] == told["frame"]


@pytest.mark.parametrize("package", ["pandas", "polars"])
def test_results_make_a_data_frame(matches, package):
    frame = pytest.importorskip(package).DataFrame(matches)
    assert frame.shape == (len(matches), len(dataclasses.fields(matches[0])))
    assert list(frame["frame"]) == [each.frame for each in matches]
    assert list(frame["verdict"]) == ["match"] * len(matches)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_results_are_copied(matches, copied):
    row = copied(matches[1])
    assert (row, row.record, repr(row)) == (matches[1], matches[1].record, repr(matches[1]))
    assert str(row.explain()) == str(matches[1].explain())
    every = copied(matches)
    assert [each.record for each in every] == [each.record for each in matches]
    assert every.to_arrow().equals(matches.to_arrow())
    assert str(every.explain(row.frame)) == str(row.explain())


def test_results_that_were_not_looked_for_are_found_by_the_copy(crossroads, matches):
    late = pickle.loads(pickle.dumps(scenicq.open(crossroads).match(PROGRAM)))
    assert [each.record for each in late] == [each.record for each in matches]


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
@pytest.mark.parametrize("part", ["opened", "dataset", "place", "lock"])
def test_a_copy_of_a_dataset_closes_nothing_but_its_own(crossroads, tmp_path, copied, part):
    opened = scenicq.open(crossroads)
    value = {"opened": opened, "dataset": opened.dataset, "place": opened.dataset.place, "lock": Reading(crossroads)}[
        part
    ]
    other = copied(value)
    ended = {
        "opened": lambda each: each.dataset.release(),
        "dataset": lambda each: each.release(),
        "place": lambda each: each.release(),
        "lock": lambda each: each.end(),
    }[part]
    ended(value)
    # a file of the user's that may get the number of what was closed
    with (tmp_path / "mine").open("w") as mine:
        ended(other)
        del other, value
        mine.write("kept")
        mine.flush()
        os.fstat(mine.fileno())
    assert (tmp_path / "mine").read_text() == "kept"


def test_a_copy_reads_under_a_lock_of_its_own(tmp_path):
    lock = Reading(tmp_path)
    other = copy.deepcopy(lock)
    lock.end()
    with nobody_reads(tmp_path) as free:
        assert not free
    other.end()
    with nobody_reads(tmp_path) as free:
        assert free


def test_intervals_are_rows_and_tables_too(crossroads, run, scenarios):
    program = scenarios.parent / "over_time" / "02_cut_in.scenic"
    found = scenicq.open(crossroads).match(program)
    lines = [json.loads(line) for line in run("match", program, crossroads, "--format", "jsonl").stdout.splitlines()]
    assert msgspec.convert(lines[-1].pop("summary"), ResultSummary) == found.summary
    assert [each.record for each in found] == lines
    assert [(each.frame, each.timestamp_us, each.end_us, each.frames) for each in found] == [
        (line["frames"]["first"], line["start_us"], line["end_us"], line["frames"]["count"]) for line in lines
    ]
    assert [json.loads(json_text(read_row(row, lines[0]["dataset"]))) for row in found.to_arrow().to_pylist()] == lines
    told = run("explain", program, crossroads, f"{lines[0]['recording']}@{lines[0]['start_us']}").stdout
    assert str(found[0].explain()).strip() == told.strip()
