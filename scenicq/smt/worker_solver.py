"""A solver in a worker process: what it does to itself harms one problem, never the caller.

A worker that crashes, hangs, is killed or talks nonsense is replaced, and its problem's answer is `NoAnswer`. It starts
when it is first needed and imports the solver itself, because a library can change the rounding mode of the process,
print, or fail to load.
"""

from __future__ import annotations

import contextlib
import json
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from scenicq.budget import leave_out, stop_clock
from scenicq.errors import Diagnostic, SolverError
from scenicq.limits import LIMITS
from scenicq.processes import end_group, kill_after
from scenicq.smt.answer import Answer, NoAnswer, Sat
from scenicq.smt.problem import Problem, holds
from scenicq.smt.worker import Request, Setup, read_answer, seconds_of

__all__ = ["WorkerSolver"]

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
    """A solver that runs in a process of its own; threads may share it, and wait for each other."""

    def __init__(self, kind: str, *, name: str = "", memory_mb: int | None = None) -> None:
        """Prepare the worker; it does not start yet.

        Args:
            kind: `module:function` of the check that it runs; the function takes what `Solver.check` takes.
            name: What the solver is called; by default the last part of the module.
            memory_mb: Address space of the worker (Linux); an interpreter takes about 50 by itself.
        """
        self._name = name or kind.partition(":")[0].rpartition(".")[2]
        self._setup = Setup(kind, memory_mb)
        self._process: subprocess.Popen[bytes] | None = None
        self._version = ""
        self._has_loaded = False
        self._lock = threading.Lock()

    @property
    def name(self) -> str:
        """What the solver is called in messages."""
        return self._name

    def start(self) -> str:
        """Start the worker unless it runs.

        Returns:
            The version that the solver's module gives as `VERSION`, or nothing.

        Raises:
            SolverError: The solver cannot be loaded.
        """
        if self._process is not None:
            if self._process.poll() is None:
                return self._version
            self.close()
        greeting: dict[str, str] = {}
        for _ in range(LIMITS.worker_starts):
            with stop_clock():
                greeting = self._spawn()
            if "ready" in greeting:
                self._version, self._has_loaded = greeting["ready"], True
                return self._version
            self.close()
            if "refused" in greeting:
                raise SolverError(Diagnostic("resources-exhausted", greeting["refused"]))
            if "failed" in greeting:
                break
        reason = greeting.get("failed", "the process ended while it loaded the solver")
        raise SolverError(Diagnostic("solver-missing", f"solver `{self._name}` does not load", label=reason))

    def loads(self) -> bool:
        """Start the worker; see `Solver.loads`."""
        with self._lock:
            self.start()
        return True

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide a problem; see `Solver.check`.

        Raises:
            SolverError: The solver cannot be loaded, and never could.
        """
        with self._lock:
            try:
                self.start()
            except SolverError:
                if self._has_loaded:
                    return NoAnswer("crash")
                raise
            answer = self._ask(Request(problem, precision, timeout_s, timeout_s + GRACE_S))
        if isinstance(answer, Sat) and not _replays(problem, answer, precision):
            return NoAnswer("precision")
        return answer

    def close(self) -> None:
        """Kill the process, if any, and close its pipes."""
        process, self._process = self._process, None
        if process is None:
            return
        end_group(process)
        process.wait()
        for pipe in _pipes(process):
            with contextlib.suppress(OSError):
                pipe.close()

    def __enter__(self) -> Self:
        """Return the solver itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End the worker."""
        self.close()

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

    def _ask(self, request: Request) -> Answer:
        """Have a problem decided by the worker, which runs."""
        timeout_s, began = request.timeout_s, time.perf_counter()
        line, expired = self._exchange(pickle.dumps(request), BUSY * request.deadline_s)
        waited = time.perf_counter() - began
        if not line.endswith(b"\n"):
            expired = expired or self._ended_by_alarm()
            self.close()
            leave_out(max(0.0, waited - timeout_s) if expired else 0.0)
            return NoAnswer("timeout" if expired else "garbage" if len(line) > LIMITS.worker_answer_bytes else "crash")
        took = seconds_of(line)
        leave_out(max(0.0, waited - took) if took is not None else 0.0)
        answer = read_answer(line)
        if isinstance(answer, NoAnswer) and answer.reason in ("garbage", "memory"):
            self.close()
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
        with kill_after(process, timeout_s) as expired, contextlib.suppress(OSError):
            requests.write(message)
            requests.flush()
            line = answers.readline(LIMITS.worker_answer_bytes + 1)
        return line, expired.is_set()


def _replays(problem: Problem, answer: Sat, precision: float) -> bool:
    named = all(variable.name in answer.witness for variable in problem.variables)
    return named and holds(problem, answer.witness, precision)


def _pipes(process: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes]]:
    assert process.stdin is not None
    assert process.stdout is not None
    return process.stdin, process.stdout
