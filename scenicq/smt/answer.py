"""What a solver is and what it answers. Outcomes are values: a timeout is an answer, not an exception."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from scenicq.smt.problem import Problem

__all__ = ["Answer", "NoAnswer", "Sat", "Solver", "SolverSession", "SolverStatus", "Unsat"]


@dataclass(frozen=True, slots=True)
class Sat:
    """The problem has a solution.

    Attributes:
        witness: A value for each variable; the constraint holds there in plain floating point evaluation with a slack
            of at most the precision that was asked for.
    """

    witness: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Unsat:
    """The problem is proven to have no solution."""


@dataclass(frozen=True, slots=True)
class NoAnswer:
    """The solver did not decide.

    Attributes:
        reason: "timeout", "crash", "budget", "memory", "garbage", "precision" (a witness that does not replay) or
            "unsupported: ..." with what the solver cannot express.
    """

    reason: str


Answer = Sat | Unsat | NoAnswer


@dataclass(frozen=True, slots=True)
class SolverStatus:
    """Whether a solver can be used here.

    Attributes:
        name: As `open_solver` takes it.
        ok: Whether it loads and answers.
        detail: Its version, or exactly what is missing.
        hint: A command or statement that helps; empty where `ok`.
    """

    name: str
    ok: bool
    detail: str
    hint: str = ""


class Solver(Protocol):
    """Decides problems. Implementations keep one contract, tested for all of them alike."""

    @property
    def name(self) -> str:
        """What the solver is called in messages."""
        ...

    def loads(self) -> bool:
        """Whether there is anybody to ask; where not, the built-in solver decides, which this folder does not know.

        Raises:
            SolverError: What was asked for by name cannot be loaded or started.
        """
        ...

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide one problem.

        Args:
            problem: What to decide.
            precision: The slack that a witness may need (δ), in the unit of each atom.
            timeout_s: Seconds after which the answer is `Unknown("timeout")`: of the processor where the solver runs in
                a worker of ours, else of the wall.
        """
        ...


class SolverSession(Solver, Protocol):
    """A solver with resources, to be used in a `with` statement; threads may share it."""

    def close(self) -> None:
        """Give all resources back; the solver cannot be used afterwards."""
        ...

    def __enter__(self) -> Self:
        """Return the solver itself."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close the solver."""
        ...
