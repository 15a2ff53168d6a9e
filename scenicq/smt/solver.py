"""Choosing a solver by name: the entry point of this folder."""

from __future__ import annotations

import sys

from scenicq.errors import Diagnostic, SolverError
from scenicq.limits import LIMITS
from scenicq.smt.answer import Answer, NoAnswer, Sat, Solver, SolverSession, SolverStatus, Unsat
from scenicq.smt.command import SmtlibSolver
from scenicq.smt.formula import TRUE, Problem
from scenicq.smt.pool import DREAL, PORTABLE, WorkerSolver

__all__ = [
    "Answer",
    "NoAnswer",
    "Sat",
    "Solver",
    "SolverSession",
    "SolverStatus",
    "Unsat",
    "available",
    "open_solver",
]


def open_solver(name: str = "auto", *, jobs: int = 1, memory_mb: int | None = LIMITS.solver_memory_mb) -> SolverSession:
    """Open a solver, to be used in a `with` statement.

    Args:
        name: "auto" (dReal where it loads, else the portable solver), "dreal", "portable", or a command line that reads
            SMT-LIB 2 from its standard input, such as `z3 -in`.
        jobs: Worker processes at most; they start when needed.
        memory_mb: Address space of each solver process (Linux); None for no limit.

    Raises:
        SolverError: The solver cannot be loaded or started.
    """
    if name == "portable":
        return WorkerSolver(PORTABLE, jobs=jobs, memory_mb=memory_mb)
    if name not in ("auto", "dreal"):
        return SmtlibSolver(name, jobs=jobs, memory_mb=memory_mb)
    solver = WorkerSolver(DREAL, jobs=jobs, memory_mb=memory_mb)
    try:
        solver.start()
    except SolverError as error:
        solver.close()
        if name == "auto":
            return open_solver("portable", jobs=jobs, memory_mb=memory_mb)
        reason = error.diagnostics[0].label
        raise SolverError(
            Diagnostic("solver-missing", f"dReal does not load: {reason}", hints=_dreal_hints(reason))
        ) from None
    return solver


def available() -> list[SolverStatus]:
    """Whether dReal and the portable solver can be used here, each tried in a child process."""
    return [_status("dreal"), _status("portable")]


def _status(name: str) -> SolverStatus:
    kind = DREAL if name == "dreal" else PORTABLE
    with WorkerSolver(kind) as solver:
        try:
            version = solver.start()
            answer = solver.check(Problem((), TRUE), precision=1e-3, timeout_s=10.0)
        except SolverError as error:
            reason = error.diagnostics[0].label
            hints = _dreal_hints(reason) if name == "dreal" else ("reinstall scenicq",)
            return SolverStatus(name, ok=False, detail=reason, hint="; ".join(hints))
    if answer != Sat({}):
        return SolverStatus(name, ok=False, detail=f"a trivial problem is answered with {answer}", hint="reinstall it")
    return SolverStatus(name, ok=True, detail=version or "built in")


def _dreal_hints(reason: str) -> tuple[str, ...]:
    """What to do about a reason why dReal does not load."""
    if "No module named" in reason:
        if sys.version_info >= (3, 12):
            return ("dReal has packages for CPython up to 3.11: use an older interpreter, or `--solver portable`",)
        return ("`pip install dreal` installs it (Linux on x86-64)", "`--solver portable` works everywhere")
    hints: list[str] = []
    if "libibex" in reason:
        hints.append(
            "libibex 2.7.4 of dReal's own IBEX is found in /opt/libibex/2.7.4/lib; on Ubuntu it comes with "
            "`add-apt-repository ppa:dreal/dreal && apt-get install libibex-dev`"
        )
    if any(library in reason for library in ("libClp", "libCoin", "liblapack", "libblas", "libnlopt")):
        hints.append("`apt-get install libnlopt0 coinor-libclp1 liblapack3 libblas3` installs the other libraries")
    return (*hints, "`--solver portable` works everywhere")
