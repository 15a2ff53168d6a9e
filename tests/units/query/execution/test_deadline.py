"""A run that is stopped by its deadline gives what it has decided, and can be gone on with."""

from __future__ import annotations

import json
import math
import re
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import duckdb
import pytest

from scenicq import budget
from scenicq.budget import DeadlineError
from scenicq.match.options import MatchOptions
from scenicq.query.execution.pieces import fingerprint
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.execution.sql_deadline import SqlWatch, sql_deadline
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.in_memory import connect_in_memory

PROGRAM = Path(__file__).parents[4] / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic"
OPTIONS = QueryOptions(MatchOptions(classes="coarse"), prefilter=False, every=True)


@pytest.fixture(scope="module")
def dataset(crossroads: Path) -> Dataset:
    return open_dataset(crossroads)


class Clock:
    """A clock that goes on by a second whenever somebody looks whether the time is over."""

    def __init__(self) -> None:
        """Begin at 0."""
        self.now = 0

    def monotonic(self) -> float:
        self.now += 1
        return float(self.now)

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(budget, "time", found)
    return found


def query(dataset: Dataset, **changes: Any) -> Query:
    return Query(dataset, read_program(PROGRAM), replace(OPTIONS, **changes))


def records(found: Query) -> list[dict[str, Any]]:
    return [record(result) for result in found.results()]


def test_what_is_decided_in_time_is_out_and_the_rest_is_not_counted(dataset: Dataset, clock: Clock) -> None:
    whole = query(dataset, until=math.inf)
    every = records(whole)
    cut = query(dataset, until=clock.now * 1.5)
    some = records(cut)
    assert 0 < len(some) < len(every)
    assert some == every[: len(some)]
    assert cut.funnel.frames == len(some)
    assert (whole.funnel.cut, cut.funnel.cut) == (False, True)


@pytest.mark.parametrize("jobs", [1, 2])
def test_nothing_is_begun_when_the_time_is_over(dataset: Dataset, jobs: int) -> None:
    late = query(dataset, until=1.0, jobs=jobs)
    assert records(late) == []
    assert late.funnel.cut
    assert late.funnel.frames == 0


def test_a_deadline_does_not_make_another_question(dataset: Dataset) -> None:
    text = PROGRAM.read_text(encoding="utf-8")
    assert fingerprint(dataset, text, OPTIONS) == fingerprint(dataset, text, replace(OPTIONS, until=5.0))


def test_the_command_says_that_it_stopped_and_goes_on(run: Any, crossroads: Path, tmp_path: Path) -> None:
    words = ("match", PROGRAM, crossroads, "--classes", "coarse", "-o", tmp_path / "found.jsonl", "--resume")
    stopped = run(*words, "--deadline", "1e-9")
    assert stopped.exit_code == 3
    assert "warning[deadline-passed]" in stopped.stderr
    assert "goes on from here" in stopped.stderr
    said = json.loads((tmp_path / "found.jsonl").read_text(encoding="utf-8"))
    assert said.keys() == {"summary"}
    assert [each["why"] for each in said["summary"]["skipped"]] == ["deadline"]
    assert run(*words).exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["found.jsonl"]


def test_a_shard_is_kept_whole_or_not_at_all(run: Any, crossroads: Path, tmp_path: Path) -> None:
    found = run("match", PROGRAM, crossroads, "--shard", "1/2", "-o", tmp_path, "--deadline", "1e-9")
    assert found.exit_code == 3
    assert "error[deadline-passed]" in found.stderr
    assert not list(tmp_path.glob("*-of-*"))


def test_a_clock_that_is_set_ends_nothing_and_delays_nothing() -> None:
    """Nothing that limits time reads the clock of the wall."""
    root = Path(__file__).parents[4]
    for file in (file for folder in ("scenicq", "cli") for file in (root / folder).rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        assert not re.search(r"\btime\.time\(|from time import (.*\b)?time\b", text), file


def test_sql_is_interrupted_when_the_time_is_over() -> None:
    """A statement that takes for ever ends soon after, and so does every one that begins later."""
    slow = "SELECT count(*) FROM range(100000000) a, range(100000000) b WHERE a.range * b.range % 7 = 3"
    with closing(connect_in_memory()) as connection:
        until = time.monotonic() + 0.2
        with SqlWatch(connection, until):
            with pytest.raises(DeadlineError), sql_deadline(until):
                connection.execute(slow).fetchall()
            assert time.monotonic() >= until
            with pytest.raises(duckdb.InterruptException):
                connection.execute(slow).fetchall()
        assert connection.execute("SELECT 7").fetchall() == [(7,)]


def test_an_interrupt_before_is_none_of_the_deadline() -> None:
    with pytest.raises(duckdb.InterruptException), sql_deadline(time.monotonic() + 60):
        raise duckdb.InterruptException


def test_a_prefilter_that_takes_for_ever_is_cut(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    program = replace(read_program(PROGRAM), name="slow.scenic")
    late = Query(dataset, program, QueryOptions(MatchOptions(classes="coarse"), until=time.monotonic() + 2))
    slow = "(SELECT count(*) FROM range(100000000) a, range(100000000) b WHERE a.range * b.range % 7 = f)"

    def slowed(name: str) -> Any:
        planned = Query.planned_map(late, name)
        return replace(planned, plan=replace(planned.plan, columns=f"SELECT f, missed + 0 * {slow} AS missed FROM "
                                             f"({planned.plan.columns})"))  # fmt: skip

    assert slowed(dataset.maps[0]).plan.stages
    monkeypatch.setattr(late, "planned_map", slowed)
    assert records(late) == []
    assert (late.funnel.cut, late.funnel.frames) == (True, 0)
