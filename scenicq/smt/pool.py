"""Worker processes that run a solver: what they do to themselves harms one problem, never the caller.

A worker that crashes, hangs, is killed or talks nonsense is replaced, and its problem's answer is `NoAnswer`. Workers
start when they are first needed and import the solver themselves, because a library can change the rounding mode of the
process, print, or fail to load.
"""

from __future__ import annotations

import contextlib
import json
import pickle
import queue
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from scenicq.budget import leave_out, uncounted
from scenicq.errors import Diagnostic, SolverError
from scenicq.limits import LIMITS
from scenicq.processes import end_group, ended_after
from scenicq.smt.answer import Answer, NoAnswer, Sat
from scenicq.smt.evaluation import holds
from scenicq.smt.formula import Problem
from scenicq.smt.worker import Request, Setup, read_answer, seconds_of

__all__ = ["DREAL", "PORTABLE", "WorkerSolver"]

PORTABLE = "scenicq.smt.portable:check"
DREAL = "scenicq.smt.dreal:check"

GRACE_S = 0.5
"""Seconds that a worker has to answer after its timeout before it is killed."""
BUSY = 8.0
"""How many times the seconds of its work a worker may take by the wall: other work may hold the processor."""

_BOOTSTRAP = (
    "import os, pickle, sys\n"
    # whatever a module prints that is loaded from here on is no answer
    "answers = os.dup(1)\n"
    "os.dup2(2, 1)\n"
    "sys.path[:] = pickle.load(sys.stdin.buffer)\n"
    "from scenicq.smt.worker import serve\n"
    "serve(pickle.load(sys.stdin.buffer), sys.stdin.buffer, answers)\n"
)


class WorkerSolver:
    """A solver that runs in worker processes; threads may share it."""

    def __init__(self, kind: str = PORTABLE, *, name: str = "", jobs: int = 1, memory_mb: int | None = None) -> None:
        """Prepare workers; none starts yet.

        Args:
            kind: `module:function` of the check that the workers run; the function takes what `Solver.check` takes.
            name: What the solver is called; by default the last part of the module.
            jobs: Worker processes at most.
            memory_mb: Address space of each worker (Linux); an interpreter takes about 50 by itself.
        """
        self._name = name or kind.partition(":")[0].rpartition(".")[2]
        self._workers = [_Worker(Setup(kind, memory_mb), self._name) for _ in range(max(1, jobs))]
        self._idle: queue.LifoQueue[_Worker] = queue.LifoQueue()
        for worker in self._workers:
            self._idle.put(worker)

    @property
    def name(self) -> str:
        """What the solver is called in messages."""
        return self._name

    def start(self) -> str:
        """Start one worker now.

        Returns:
            The version that the solver's module gives as `VERSION`, or nothing.

        Raises:
            SolverError: The solver cannot be loaded.
        """
        worker = self._idle.get()
        try:
            return worker.start()
        finally:
            self._idle.put(worker)

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide a problem in an idle worker; see `Solver.check`.

        Raises:
            SolverError: The solver cannot be loaded.
        """
        worker = self._idle.get()
        try:
            answer = worker.ask(problem, precision, timeout_s)
        finally:
            self._idle.put(worker)
        if isinstance(answer, Sat) and not _replays(problem, answer, precision):
            return NoAnswer("precision")
        return answer

    def check_many(self, problems: Sequence[Problem], *, precision: float, timeout_s: float) -> list[Answer]:
        """Decide problems, as many at once as there are workers; the answers come in the problems' order."""
        if not problems:
            return []
        with ThreadPoolExecutor(min(len(self._workers), len(problems))) as threads:
            asked = [
                threads.submit(self.check, problem, precision=precision, timeout_s=timeout_s) for problem in problems
            ]
            return [future.result() for future in asked]

    def close(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.stop()

    def __enter__(self) -> Self:
        """Return the solver itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End all workers."""
        self.close()


def _replays(problem: Problem, answer: Sat, precision: float) -> bool:
    named = all(variable.name in answer.witness for variable in problem.variables)
    return named and holds(problem, answer.witness, precision)


class _Worker:
    """One process and its pipes."""

    def __init__(self, setup: Setup, name: str) -> None:
        self._setup = setup
        self._name = name
        self._process: subprocess.Popen[bytes] | None = None
        self._version = ""
        self._loads = False

    def start(self) -> str:
        """Start the process unless it runs; the version of what it loaded.

        Raises:
            SolverError: The solver cannot be loaded.
        """
        if self._process is not None:
            if self._process.poll() is None:
                return self._version
            self.stop()
        greeting: dict[str, str] = {}
        for _ in range(LIMITS.worker_starts):
            with uncounted():
                greeting = self._spawn()
            if "ready" in greeting:
                self._version, self._loads = greeting["ready"], True
                return self._version
            self.stop()
            if "refused" in greeting:
                raise SolverError(Diagnostic("resources-exhausted", greeting["refused"]))
            if "failed" in greeting:
                break
        reason = greeting.get("failed", "the process ended while it loaded the solver")
        raise SolverError(Diagnostic("solver-missing", f"solver `{self._name}` does not load", label=reason))

    def _spawn(self) -> dict[str, str]:
        """Start the process; what it says of its start, nothing if it ends before."""
        package = str(Path(__file__).parents[2])
        path = [package, *(entry or str(Path.cwd()) for entry in sys.path)]
        self._process = subprocess.Popen(  # noqa: S603
            # -S and -I: the search path comes by message, which halves the time of the start
            [sys.executable, "-I", "-S", "-c", _BOOTSTRAP],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        line, _ = self._exchange(pickle.dumps(path) + pickle.dumps(self._setup), LIMITS.worker_start_s)
        try:
            return json.loads(line)
        except ValueError:
            return {}

    def ask(self, problem: Problem, precision: float, timeout_s: float) -> Answer:
        """Have a problem decided.

        Raises:
            SolverError: The solver cannot be loaded, and never could.
        """
        try:
            self.start()
        except SolverError:
            if self._loads:
                return NoAnswer("crash")
            raise
        request = Request(problem, precision, timeout_s, timeout_s + GRACE_S)
        began = time.perf_counter()
        line, expired = self._exchange(pickle.dumps(request), BUSY * (timeout_s + GRACE_S))
        waited = time.perf_counter() - began
        if not line.endswith(b"\n"):
            expired = expired or self._ended_by_alarm()
            self.stop()
            leave_out(max(0.0, waited - timeout_s) if expired else 0.0)
            return NoAnswer("timeout" if expired else "garbage" if len(line) > LIMITS.worker_answer_bytes else "crash")
        took = seconds_of(line)
        leave_out(max(0.0, waited - took) if took is not None else 0.0)
        answer = read_answer(line)
        if isinstance(answer, NoAnswer) and answer.reason in ("garbage", "memory"):
            self.stop()
        return answer

    def _ended_by_alarm(self) -> bool:
        """Whether the process ended itself because its work took too long."""
        process = self._process
        assert process is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GRACE_S)
        return hasattr(signal, "SIGPROF") and process.returncode == -signal.SIGPROF

    def _exchange(self, message: bytes, timeout_s: float) -> tuple[bytes, bool]:
        """Send a message and read one line; the process is killed if that takes too long."""
        process = self._process
        assert process is not None
        requests, answers = _pipes(process)
        line = b""
        # a process that has ended neither reads nor writes
        with ended_after(process, timeout_s) as expired, contextlib.suppress(OSError):
            requests.write(message)
            requests.flush()
            line = answers.readline(LIMITS.worker_answer_bytes + 1)
        return line, expired.is_set()

    def stop(self) -> None:
        """Kill the process, if any, and close its pipes."""
        process, self._process = self._process, None
        if process is None:
            return
        end_group(process)
        process.wait()
        for pipe in _pipes(process):
            with contextlib.suppress(OSError):
                pipe.close()


def _pipes(process: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes]]:
    assert process.stdin is not None
    assert process.stdout is not None
    return process.stdin, process.stdout
