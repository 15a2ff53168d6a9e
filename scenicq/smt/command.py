"""Any solver that reads SMT-LIB 2 from its standard input, as a command line such as `z3 -in` or `dreal --in`.

Every problem gets a process of its own, in a process group of its own, which is killed with the timeout, on an
interrupt and when this process ends, however it ends.
"""

from __future__ import annotations

import contextlib
import shlex
import shutil
import subprocess
import threading
from collections.abc import Sequence
from types import TracebackType
from typing import IO, Self

from scenicq.errors import Diagnostic, SolverError
from scenicq.limits import LIMITS
from scenicq.processes import end_group, kill_after, kill_on_exit, limit_memory
from scenicq.refusals import refused_by_system
from scenicq.smt.answer import Answer, NoAnswer, Sat
from scenicq.smt.problem import Problem, holds
from scenicq.smt.smtlib import read_reply, to_smtlib

__all__ = ["SmtlibSolver"]


class SmtlibSolver:
    """A solver behind a command line; threads may share it."""

    def __init__(self, command: str, *, memory_mb: int | None = None) -> None:
        """Take a command line, in the quoting of a POSIX shell, that runs without a shell.

        Args:
            command: The command line.
            memory_mb: Address space of each process (Linux).

        Raises:
            SolverError: The command is not there or cannot be started.
        """
        self._command = command
        self._memory_mb = memory_mb
        try:
            self._words = shlex.split(command)
        except ValueError as error:
            raise SolverError(
                Diagnostic("option-invalid", f"solver command `{command}` cannot be read: {error}")
            ) from None
        if not self._words or shutil.which(self._words[0]) is None:
            raise self._missing("it is no program that can be found and run")

    @property
    def name(self) -> str:
        """The command line."""
        return self._command

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide a problem in a new process; see `Solver.check`."""
        with kill_on_exit(self._words) as (words, leash), self._spawn(words, leash) as process:
            text, expired = _converse(process, to_smtlib(problem, precision).encode(), timeout_s)
        if len(text) > LIMITS.command_reply_bytes:
            return NoAnswer("garbage")
        answer = read_reply(text.decode(errors="replace"), problem)
        if expired and answer == NoAnswer("garbage"):
            return NoAnswer("timeout")
        if answer == NoAnswer("garbage") and process.returncode:
            return NoAnswer("crash")
        if isinstance(answer, Sat) and not holds(problem, answer.witness, precision):
            return NoAnswer("precision")
        return answer

    def loads(self) -> bool:
        """The command is there; see `Solver.loads`."""
        return True

    def close(self) -> None:
        """Do nothing: no process outlives its problem."""

    def __enter__(self) -> Self:
        """Return the solver itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Do nothing."""

    def _spawn(self, words: Sequence[str], passed: Sequence[int] = ()) -> subprocess.Popen[bytes]:
        try:
            process = subprocess.Popen(  # noqa: S603 - the user chooses the command
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                pass_fds=passed,
            )
        except (OSError, ValueError) as error:
            if refused_by_system(error) is not None:
                raise
            raise self._missing(str(error)) from None
        if self._memory_mb is not None:
            with contextlib.suppress(OSError, ValueError):  # it has ended
                limit_memory(self._memory_mb * 2**20, process.pid)
        return process

    def _missing(self, reason: str) -> SolverError:
        hint = "known names are auto, dreal and portable; anything else is a command that reads SMT-LIB 2"
        message = f"solver command `{self._command}` cannot be started: {reason}"
        return SolverError(Diagnostic("solver-missing", message, hints=(hint,)))


def _converse(process: subprocess.Popen[bytes], script: bytes, timeout_s: float) -> tuple[bytes, bool]:
    """Write a script and read the reply; whether time ran out. The process has ended then, also on an interrupt."""
    assert process.stdin is not None
    assert process.stdout is not None
    writer = threading.Thread(target=_write, args=(process.stdin, script), daemon=True)
    try:
        with kill_after(process, timeout_s) as expired:
            writer.start()
            text = process.stdout.read(LIMITS.command_reply_bytes + 1)
            if len(text) > LIMITS.command_reply_bytes:
                end_group(process)
            process.wait()
    finally:
        end_group(process)
        if writer.ident is not None:
            writer.join()
    return text, expired.is_set()


def _write(stream: IO[bytes], script: bytes) -> None:
    try:
        stream.write(script)
        stream.close()
    except (OSError, ValueError):
        # the solver has ended before it read everything, or an interrupt has closed the stream meanwhile
        pass
