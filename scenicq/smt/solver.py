"""Choosing a solver by name: the entry point of this folder, which knows those outside of this library alone."""

from __future__ import annotations

import sys

from scenicq.errors import Diagnostic, SolverError
from scenicq.limits import LIMITS
from scenicq.smt.answer import Answer, NoAnswer, Sat, Solver, SolverSession, SolverStatus, Unsat
from scenicq.smt.command import SmtlibSolver
from scenicq.smt.problem import Problem
from scenicq.smt.terms import TRUE
from scenicq.smt.worker_solver import WorkerSolver

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


PORTABLE = "portable"
"""The name of the built-in solver, which works on expressions and not on formulas: the matcher has it."""
DREAL = "scenicq.smt.dreal:check"


def open_solver(name: str = "auto", *, memory_mb: int | None = LIMITS.solver_memory_mb) -> SolverSession | None:
    """Open a solver, to be used in a `with` statement.

    Args:
        name: "auto" (dReal where it loads, else the built-in solver), "dreal", "portable" (the built-in one), or a
            command line that reads SMT-LIB 2 from its standard input, such as `z3 -in`.
        memory_mb: Address space of each solver process (Linux); None for no limit.

    Returns:
        The solver; None for the built-in one.

    Raises:
        SolverError: The solver cannot be loaded or started.
    """
    if name == PORTABLE:
        return None
    if name not in ("auto", "dreal"):
        return SmtlibSolver(name, memory_mb=memory_mb)
    solver = WorkerSolver(DREAL, memory_mb=memory_mb)
    try:
        solver.start()
    except SolverError as error:
        solver.close()
        if name == "auto":
            return None
        reason = error.diagnostics[0].label
        raise SolverError(
            Diagnostic("solver-missing", f"dReal does not load: {reason}", hints=_dreal_hints(reason))
        ) from None
    return solver


def available() -> list[SolverStatus]:
    """Whether dReal can be used here, tried in a child process, and the built-in solver, which always can."""
    return [_status_of_dreal(), SolverStatus(PORTABLE, ok=True, detail="built in")]


def _status_of_dreal() -> SolverStatus:
    with WorkerSolver(DREAL) as solver:
        try:
            version = solver.start()
            answer = solver.check(Problem((), TRUE), precision=1e-3, timeout_s=10.0)
        except SolverError as error:
            reason = error.diagnostics[0].label
            return SolverStatus("dreal", ok=False, detail=reason, hint="; ".join(_dreal_hints(reason)))
    if answer != Sat({}):
        said = f"a trivial problem is answered with {answer}"
        return SolverStatus("dreal", ok=False, detail=said, hint="reinstall it")
    return SolverStatus("dreal", ok=True, detail=version)


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
