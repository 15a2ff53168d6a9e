"""A solver in a worker process: its questions survive whatever it does to itself."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from formulas import Variable

from scenicq.budget import limited, waiting
from scenicq.errors import SolverError
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.problem import Problem
from scenicq.smt.terms import TRUE
from scenicq.smt.worker import read_answer, write_answer
from scenicq.smt.worker_solver import WorkerSolver

HERE = str(Path(__file__).parent)


@pytest.fixture
def solver(monkeypatch: pytest.MonkeyPatch) -> Iterator[WorkerSolver]:
    monkeypatch.syspath_prepend(HERE)
    with WorkerSolver("fake_checks:behave") as opened:
        yield opened


def _asked(name: str) -> Problem:
    return Problem((Variable(name, 0.0, 1e9),), TRUE)


def _check(solver: WorkerSolver, name: str, timeout_s: float = 20.0) -> Answer:
    return solver.check(_asked(name), precision=1e-3, timeout_s=timeout_s)


@pytest.mark.parametrize(
    ("name", "reason"), [("crash", "crash"), ("exit", "crash"), ("raise", "crash"), ("odd", "garbage")]
)
def test_failures_are_answers(solver: WorkerSolver, name: str, reason: str) -> None:
    assert _check(solver, name) == NoAnswer(reason)
    assert _check(solver, "fine") == Unsat()


@pytest.mark.parametrize("name", ["hang", "spin"])
@pytest.mark.one_in(4)
@pytest.mark.slow
def test_hanging_workers_are_killed_and_replaced(solver: WorkerSolver, name: str) -> None:
    assert _check(solver, name, timeout_s=0.2) == NoAnswer("timeout")
    assert _check(solver, "fine") == Unsat()


def test_polite_timeouts_keep_the_worker(solver: WorkerSolver) -> None:
    before = _pid(solver)
    assert _check(solver, "polite", timeout_s=0.1) == NoAnswer("timeout")
    assert _pid(solver) == before


def test_output_of_a_library_goes_nowhere(solver: WorkerSolver, capfd: pytest.CaptureFixture[str]) -> None:
    assert _check(solver, "print") == Unsat()
    assert capfd.readouterr() == ("", "")


def test_garbage(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(HERE)
    with WorkerSolver("fake_checks:garble") as solver:
        assert _check(solver, "x") == NoAnswer("garbage")
        assert _check(solver, "x") == NoAnswer("garbage")


@pytest.mark.parametrize("name", ["lie", "forget"])
def test_witnesses_are_replayed(solver: WorkerSolver, name: str) -> None:
    problem = Problem((Variable(name, 0.0, 1.0),), TRUE)
    assert solver.check(problem, precision=1e-3, timeout_s=5.0) == NoAnswer("precision")


def _pid(solver: WorkerSolver) -> int:
    answer = _check(solver, "pid")
    assert isinstance(answer, Sat)
    return int(answer.witness["pid"])


def test_a_worker_killed_between_problems_is_replaced(solver: WorkerSolver) -> None:
    pid = _pid(solver)
    os.kill(pid, signal.SIGKILL)
    time.sleep(0.2)
    assert _pid(solver) != pid


def test_a_worker_killed_at_work_costs_one_problem(solver: WorkerSolver) -> None:
    pid = _pid(solver)
    threading.Timer(0.3, os.kill, (pid, signal.SIGKILL)).start()
    assert _check(solver, "hang") == NoAnswer("crash")
    assert _check(solver, "fine") == Unsat()


def test_memory_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    if sys.platform != "linux":
        pytest.skip("the limit exists on Linux")
    monkeypatch.syspath_prepend(HERE)
    with WorkerSolver("fake_checks:behave", memory_mb=600) as solver:
        assert _check(solver, "fine") == Unsat()
        assert _check(solver, "eat") == NoAnswer("memory")
        assert _check(solver, "fine") == Unsat()


def test_version_and_missing_modules(solver: WorkerSolver) -> None:
    assert solver.start() == "7.0"
    assert solver.name == "fake_checks"
    with WorkerSolver("no_such_module:check", name="ghost") as ghost, pytest.raises(SolverError) as caught:
        ghost.start()
    assert caught.value.diagnostics[0].code == "solver-missing"
    assert "no_such_module" in caught.value.diagnostics[0].label


def test_workers_ignore_interrupts(solver: WorkerSolver) -> None:
    pid = _pid(solver)
    os.kill(pid, signal.SIGINT)
    time.sleep(0.1)
    assert _pid(solver) == pid


def test_closing_ends_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(HERE)
    with WorkerSolver("fake_checks:behave") as solver:
        pid = _pid(solver)
    assert not _alive(pid)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    # a process that has ended but whose parent has not asked for it is dead enough
    try:
        state = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return not Path("/proc").is_dir()
    return state.rpartition(")")[2].split()[0] != "Z"


ORPHAN = """
import sys, threading, time
sys.path[:] = {path!r}
from formulas import Variable
from scenicq.smt.problem import Problem
from scenicq.smt.terms import TRUE
from scenicq.smt.worker_solver import WorkerSolver
solver = WorkerSolver("fake_checks:behave")
answer = solver.check(Problem((Variable("pid", 0.0, 1e9),), TRUE), precision=1.0, timeout_s=9.0)
print(int(answer.witness["pid"]), flush=True)
solver.check(Problem((Variable("{task}", 0.0, 1.0),), TRUE), precision=1.0, timeout_s=600.0)
"""


@pytest.mark.parametrize("task", ["hang", "spin"])
def test_workers_die_with_a_killed_parent(task: str) -> None:
    script = ORPHAN.format(path=[HERE, *sys.path], task=task)
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        time.sleep(0.3)
        parent.kill()
        parent.wait()
    deadline = time.monotonic() + 10.0
    while _alive(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _alive(pid)


def test_a_worker_loads_little() -> None:
    """A query pays for it once; the worker must not import what it does not need."""
    code = (
        "import sys, scenicq.smt.worker, scenicq.smt.inverse_elimination\n"
        "print(*({'numpy', 'shapely', 'duckdb', 'pyarrow'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("answer", [Sat({"x": 0.1}), Sat({}), Unsat(), NoAnswer("budget")])
def test_answers_cross_the_pipe(answer: Answer) -> None:
    assert read_answer(json.dumps(write_answer(answer)).encode()) == answer


@pytest.mark.parametrize("line", [b"", b"[]", b"7", b'{"sat": 3}', b'{"sat": {"x": "1"}}', b'{"unknown": 3}', b"\xff"])
def test_garbage_is_recognised(line: bytes) -> None:
    assert read_answer(line) == NoAnswer("garbage")


def test_a_worker_killed_at_its_start_is_started_anew(solver: WorkerSolver, monkeypatch: pytest.MonkeyPatch) -> None:
    spawned: list[int] = []
    spawn = WorkerSolver._spawn

    def unlucky(worker: WorkerSolver) -> dict[str, str]:
        greeting = spawn(worker)
        spawned.append(1)
        if len(spawned) in (1, 4, 5, 6):
            # as if it had been killed before it was ready
            return {}
        return greeting

    monkeypatch.setattr(WorkerSolver, "_spawn", unlucky)
    assert _check(solver, "fine") == Unsat()
    assert len(spawned) == 2
    assert _check(solver, "exit") == NoAnswer("crash")
    assert _check(solver, "fine") == Unsat()
    assert _check(solver, "exit") == NoAnswer("crash")
    # it has loaded before: what keeps it from starting is no fault of the solver's installation
    assert _check(solver, "fine") == NoAnswer("crash")
    assert _check(solver, "fine") == Unsat()


def test_a_solver_that_never_starts_is_missing(solver: WorkerSolver, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(WorkerSolver, "_spawn", lambda worker: {})
    with pytest.raises(SolverError):
        _check(solver, "fine")


def test_only_the_work_of_a_worker_counts(solver: WorkerSolver) -> None:
    with limited(5.0):
        with waiting(5.0):
            assert _check(solver, "slow") == Unsat()
        with waiting(5.0) as left_s:
            # it slept for 0.3 s
            assert left_s > 4.8
        with waiting(5.0):
            assert _check(solver, "spin", timeout_s=0.3) == NoAnswer("timeout")
        with waiting(5.0) as left_s:
            assert left_s < 4.75
