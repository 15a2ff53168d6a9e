"""Whoever runs the pieces of a query: results and counts are those of one process, whatever happens to the others.

Each test of the contract is run over every executor; what is one executor's own comes after it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, parse_tolerance
from scenicq.match.verdict import Unknown
from scenicq.query.execution import dask_executor as dask
from scenicq.query.execution import executors
from scenicq.query.execution.executors import (
    Executor,
    Question,
    local_executor,
    ordered_results,
    processes,
    resumable,
    run_here,
    usual_pieces,
)
from scenicq.query.execution.pieces import partitions
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import record
from scenicq.query.execution.results import Funnel
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.prefilter import executor
from scenicq.store.dataset import Dataset, open_dataset

ROOT = Path(__file__).parents[2]
PROGRAM = ROOT / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic"
OPTIONS = QueryOptions(
    MatchOptions(tolerance=parse_tolerance("x=0.25,y=0.25,heading=5deg"), classes="coarse"), prefilter=False, every=True
)

needs_signals = pytest.mark.skipif(os.name != "posix", reason="signals")
Found = tuple[list[dict[str, Any]], Funnel]


@pytest.fixture(scope="module")
def dataset(crossroads: Path) -> Dataset:
    return open_dataset(crossroads)


def query(dataset: Dataset, **changes: Any) -> Query:
    return Query(dataset, read_program(PROGRAM), replace(OPTIONS, **changes))


@pytest.fixture(scope="module")
def undisturbed(dataset: Dataset) -> Found:
    one = query(dataset)
    return [record(result) for result in one.results()], one.funnel


def taken(found: Query, results: Iterator[Any], now_and_then: Any = lambda: None) -> Found:
    records = []
    with contextlib.closing(results):
        for result in results:
            records.append(record(result))
            now_and_then()
    return records, found.funnel


def kill_one() -> None:
    children = multiprocessing.active_children()
    if children:
        os.kill(random.choice(children).pid, signal.SIGKILL)


@pytest.fixture
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executor, "_FEWEST_FRAMES", 8)
    monkeypatch.setattr(executor, "_MOST_FRAMES", 16)


@needs_signals
@pytest.mark.usefixtures("small_batches")
@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.slow)])
def test_matching_processes_that_are_killed(dataset: Dataset, undisturbed: Found, kills: int) -> None:
    found, left = query(dataset, jobs=2), [kills]

    def kill() -> None:
        if left[0] and random.random() < 0.3:
            left[0] -= 1
            kill_one()

    assert taken(found, found.results(), kill) == undisturbed
    assert left == [0]
    assert multiprocessing.active_children() == []


@needs_signals
@pytest.mark.slow
def test_a_frame_that_kills_is_unknown_and_no_other(dataset: Dataset, scenarios: Path) -> None:
    program = read_program(scenarios / "02_crossing_cars.scenic")
    options = QueryOptions(MatchOptions(tolerance=EXACT, method="smt"), solver="sh -c 'kill -9 $PPID'", limit=None)
    alone = list(Query(dataset, program, replace(options, solver="portable")).results())
    found = list(Query(dataset, program, replace(options, jobs=2)).results())
    assert [result.frame for result in found] == [result.frame for result in alone] != []
    assert {result.verdict.reason for result in found if isinstance(result.verdict, Unknown)} == {"crash"}


def dask_children() -> list[Any]:
    psutil = pytest.importorskip("psutil")
    found = []
    for each in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            found += [each] if "spawn_main" in " ".join(each.cmdline()) else []
    return found


def on_dask(_: Path) -> Executor:
    pytest.importorskip("distributed", reason="scenicq[dask] is not installed")
    return dask.dask()


EXECUTORS: dict[str, Callable[[Path], Executor]] = {
    "here": lambda _: run_here,
    "processes": lambda _: processes(2),
    "dask": on_dask,
    "resumed": lambda folder: resumable(folder / "pieces", run_here),
    "resumed processes": lambda folder: resumable(folder / "pieces", processes(2)),
    "resumed dask": lambda folder: resumable(folder / "pieces", on_dask(folder)),
}
"""What makes each executor, given a folder of its own."""
ELSEWHERE = ("processes", "dask")
"""Executors that may lose a process."""


def every(*names: str, slow: str = "dask|resumed p") -> pytest.MarkDecorator:
    """The executors of which something holds; a cluster takes seconds to start."""
    chosen = [
        pytest.param(each, marks=pytest.mark.slow if re.search(slow, each) else ()) for each in names or EXECUTORS
    ]
    return pytest.mark.parametrize("name", chosen)


def nothing(_: object) -> None:
    """Shows nothing."""


@needs_signals
@every(slow="dask")
def test_the_pieces_are_the_whole(name: str, dataset: Dataset, undisturbed: Found, tmp_path: Path) -> None:
    executor, decided = EXECUTORS[name](tmp_path), []
    for _ in range(2 if "resumed" in name else 1):
        found, decided = query(dataset, jobs=2), []
        assert taken(found, ordered_results(found, executor, partitions(dataset, 6), decided.append)) == undisturbed
        assert sum(decided) == dataset.manifest.total.frames
    assert dask_children() == []


@every(slow="dask|processes")
def test_pieces_of_several_maps_come_as_the_query_finds_them(name: str, two_maps: Query, tmp_path: Path) -> None:
    whole = replace(two_maps, funnel=Funnel())
    expected = taken(whole, whole.results())
    for count in (1, 2, 100):
        found = replace(two_maps, funnel=Funnel())
        pieces = partitions(found.dataset, count)
        executor = EXECUTORS[name](tmp_path / str(count))
        assert taken(found, ordered_results(found, executor, pieces, nothing)) == expected


@pytest.fixture(scope="module")
def two_maps(tmp_path_factory: pytest.TempPathFactory) -> Query:
    folder = tmp_path_factory.mktemp("maps")
    ingest(ROOT / "sample_data" / "nuscenes_tiny", folder / "d")
    program = folder / "any.scenic"
    program.write_text("model scenic.domains.driving.model\nego = new Car on road\nother = new Car\n")
    return Query(open_dataset(folder / "d"), read_program(program), OPTIONS)


@every()
@pytest.mark.parametrize("limit", [1, pytest.param(7, marks=pytest.mark.slow)])
def test_a_limit_ends_where_it_ends_without_pieces(name: str, limit: int, dataset: Dataset, tmp_path: Path) -> None:
    whole = query(dataset, limit=limit)
    expected = [record(each) for each in whole.results()]
    assert whole.funnel.limited is not None
    found, executor = query(dataset, limit=limit), EXECUTORS[name](tmp_path)
    for _ in range(2 if "resumed" in name else 1):
        found = query(dataset, limit=limit)
        assert taken(found, ordered_results(found, executor, partitions(dataset, 6), nothing))[0] == expected
        assert found.funnel.limited is not None
        assert record(found.funnel.limited) == record(whole.funnel.limited)
    assert dask_children() == []


@every()
def test_nothing_is_begun_when_the_time_is_over_and_nothing_is_left(
    name: str, dataset: Dataset, undisturbed: Found, tmp_path: Path
) -> None:
    late, executor = query(dataset, jobs=2, until=1.0), EXECUTORS[name](tmp_path)
    assert taken(late, ordered_results(late, executor, usual_pieces(late, 6), nothing))[0] == []
    assert late.funnel.cut
    assert late.funnel.frames == 0
    assert not list(tmp_path.rglob("*"))
    assert dask_children() == []
    # a limit that is not reached changes nothing
    early = query(dataset, jobs=2, until=1e12)
    assert taken(early, ordered_results(early, executor, usual_pieces(early, 6), nothing)) == undisturbed


@every("resumed", "resumed processes", "resumed dask")
def test_whole_pieces_are_kept_and_a_later_run_does_the_others(
    name: str, dataset: Dataset, undisturbed: Found, tmp_path: Path
) -> None:
    first, executor = query(dataset), EXECUTORS[name](tmp_path)
    with contextlib.closing(ordered_results(first, executor, partitions(dataset, 6), nothing)) as results:
        some = [record(next(results)) for _ in range(60)]  # and then it is stopped
    assert some == undisturbed[0][:60]
    done = {path: path.stat().st_mtime_ns for path in (tmp_path / "pieces").iterdir()}
    assert 0 < len(done) < 6
    second = query(dataset)
    assert taken(second, ordered_results(second, executor, partitions(dataset, 6), nothing)) == undisturbed
    assert {path: path.stat().st_mtime_ns for path in done} == done


@needs_signals
@every(*ELSEWHERE, "resumed processes", "resumed dask")
@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.slow)])
def test_processes_that_are_killed(name: str, kills: int, dataset: Dataset, undisturbed: Found, tmp_path: Path) -> None:
    chance, killed = random.Random(0), 0
    for attempt in range(200):
        found = query(dataset, jobs=2)

        def kill(least: int = killed) -> None:
            nonlocal killed
            children = dask_children()
            if killed < min(kills, least + 5) and children and chance.random() < 0.2:
                killed += 1
                with contextlib.suppress(ProcessLookupError):
                    os.kill(chance.choice(children).pid, signal.SIGKILL)

        executor = EXECUTORS[name](tmp_path / str(attempt))
        assert taken(found, ordered_results(found, executor, partitions(dataset, 6), nothing), kill) == undisturbed
        if killed == kills:
            break
    assert killed == kills
    assert dask_children() == []


@needs_signals
@every(*ELSEWHERE, "resumed processes", "resumed dask")
@pytest.mark.slow
def test_a_frame_of_a_piece_that_kills_is_unknown_and_no_other(
    name: str, dataset: Dataset, scenarios: Path, tmp_path: Path
) -> None:
    program = read_program(scenarios / "02_crossing_cars.scenic")
    options = QueryOptions(MatchOptions(tolerance=EXACT, method="smt"), solver="sh -c 'kill -9 $PPID'", jobs=2)
    alone = [each.frame for each in Query(dataset, program, replace(options, solver="portable", jobs=1)).results()]
    killing = Query(dataset, program, options)
    found = list(ordered_results(killing, EXECUTORS[name](tmp_path), partitions(dataset, 2), nothing))
    assert [result.frame for result in found] == alone != []
    assert {result.verdict.reason for result in found if isinstance(result.verdict, Unknown)} == {"crash"}


@every()
def test_who_stops_taking_leaves_no_process_behind(name: str, dataset: Dataset, tmp_path: Path) -> None:
    found = query(dataset, jobs=2)
    with contextlib.closing(
        ordered_results(found, EXECUTORS[name](tmp_path), partitions(dataset, 6), nothing)
    ) as results:
        next(results)
    assert dask_children() == []


def test_as_many_processes_as_are_asked_for_or_pay(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "processes", lambda count: count)
    assert [local_executor(query(dataset, jobs=jobs)) for jobs in (1, None, 2, 5)] == [run_here, run_here, 2, 5]
    monkeypatch.setattr(executors, "PIECE_FRAMES", 20)
    monkeypatch.setattr(executors, "default_processes", lambda: 4)
    assert local_executor(query(dataset, jobs=None)) == 4


def test_another_dataset_under_the_same_path_is_noticed(dataset: Dataset, tmp_path: Path) -> None:
    asked = Question.of(query(dataset))
    ingest(ROOT / "sample_data" / "nuscenes_tiny", tmp_path / "d")
    with pytest.raises(DataError, match="has changed since the query began"):
        replace(asked, dataset=replace(asked.dataset, address=str(tmp_path / "d"))).query()
    assert asked.query().options.jobs == 1


@pytest.fixture
def needs_dask() -> None:
    pytest.importorskip("distributed", reason="scenicq[dask] is not installed")


@needs_signals
@pytest.mark.usefixtures("needs_dask")
def test_dask_gives_the_same_and_listens_on_the_loopback_only(dataset: Dataset, undisturbed: Found) -> None:
    psutil = pytest.importorskip("psutil")
    found, addresses = query(dataset, jobs=2), set()

    def look() -> None:
        if not addresses:
            processes = [psutil.Process(), *dask_children()]
            opened = [each for process in processes for each in process.net_connections("inet")]
            addresses.update(each.laddr.ip for each in opened if each.status == psutil.CONN_LISTEN)

    assert taken(found, ordered_results(found, dask.dask(), partitions(dataset, 6), nothing), look) == undisturbed
    assert addresses == {"127.0.0.1"}
    assert dask_children() == []


@pytest.mark.usefixtures("needs_dask")
@pytest.mark.slow
def test_no_scheduler_where_one_should_be(dataset: Dataset) -> None:
    patience = dask.DaskPatience(connect_s=1)
    with pytest.raises(DataError, match=r"no Dask scheduler answers at tcp://127.0.0.1:9") as error:
        list(dask.dask("tcp://127.0.0.1:9", patience)(query(dataset), (), lambda _: None))
    assert error.value.diagnostics[0].code == "engine-failed"


@pytest.mark.usefixtures("needs_dask")
def test_a_scheduler_without_workers_ends_in_a_bounded_time(dataset: Dataset) -> None:
    from distributed import LocalCluster

    patience = dask.DaskPatience(nobody_s=1, look_s=0.2)
    found = query(dataset)
    with LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as cluster:
        began = time.monotonic()
        with pytest.raises(DataError, match="no worker for 1 s") as error:
            list(dask.dask(cluster.scheduler_address, patience)(found, partitions(dataset, 6), lambda _: None))
        assert time.monotonic() - began < 60
    assert error.value.diagnostics[0].code == "engine-failed"


def test_a_scheduler_that_does_not_answer_ends_in_a_bounded_time() -> None:
    class Stuck:
        def scheduler_info(self, n_workers: int) -> None:
            time.sleep(5)

    with pytest.raises(DataError, match=r"has not answered for 0.1 s") as error:
        dask.count_workers(Stuck(), 0.1)
    assert error.value.diagnostics[0].code == "engine-failed"


def test_without_the_extra_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask, "find_spec", lambda _: None)
    with pytest.raises(DataError, match=r"pip install 'scenicq\[dask\]'"):
        dask.dask()


RESUMED = """
import sys
from scenicq.query.execution import executors
executors.PIECE_FRAMES = 20
from scenicq_cli.main import main
if __name__ == "__main__":
    main()
"""


@needs_signals
@pytest.mark.timeout(1800)
@pytest.mark.slow
@pytest.mark.parametrize(("jobs", "kills"), [(1, 2), (1, 8), (2, 8)])
def test_a_resumed_run_that_is_killed(crossroads: Path, tmp_path: Path, run: Any, kills: int, jobs: int) -> None:
    given = ["match", PROGRAM, crossroads, "--tolerance", "heading=5deg,position=0.3", "--classes", "coarse", "--all"]
    given += ["--no-prefilter"]
    assert run(*given, "-o", tmp_path / "undisturbed.jsonl").exit_code == 0
    (tmp_path / "program.py").write_text(RESUMED)
    command = [sys.executable, tmp_path / "program.py", *given, "-o", tmp_path / "found.jsonl", "--resume"]
    command += ["--jobs", str(jobs)]

    def start() -> subprocess.Popen[bytes]:
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        return subprocess.Popen([str(word) for word in command], env=environment, stderr=subprocess.DEVNULL)

    began = time.monotonic()
    assert start().wait() == 0
    whole_s = time.monotonic() - began
    expected = (tmp_path / "undisturbed.jsonl").read_bytes()
    assert (tmp_path / "found.jsonl").read_bytes() == expected
    chance = random.Random(kills)
    for _ in range(kills):
        (tmp_path / "found.jsonl").unlink(missing_ok=True)
        process = start()
        time.sleep(chance.uniform(0.3, 1.0) * whole_s)
        process.kill()
        process.wait()
        if (tmp_path / "found.jsonl").exists():
            assert (tmp_path / "found.jsonl").read_bytes() == expected
    assert start().wait() == 0
    assert (tmp_path / "found.jsonl").read_bytes() == expected
    assert sorted(path.name for path in tmp_path.iterdir()) == ["found.jsonl", "program.py", "undisturbed.jsonl"]
