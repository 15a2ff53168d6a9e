"""A solver that is opened when the first question comes, as most queries never ask one."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # takes long to load
    from scenicq.smt.answer import Answer, SolverSession
    from scenicq.smt.problem import Problem

__all__ = ["LazySolver"]


class LazySolver:
    """A `Solver` by name, to be used in a `with` statement.

    Attributes:
        name: As `open_solver` takes it.
    """

    def __init__(self, name: str) -> None:
        """Take the name; nothing is started."""
        self.name = name
        self._is_opened = False
        self._session: SolverSession | None = None

    def loads(self) -> bool:
        """Whether there is a solver besides the built-in one, which is opened now; see `Solver.loads`."""
        if not self._is_opened:
            from scenicq.smt.solver import open_solver  # noqa: PLC0415 - takes long to load

            self._session = open_solver(self.name)
            self._is_opened = True
        return self._session is not None

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide one problem, if the solver loads; see `Solver.check`."""
        self.loads()
        assert self._session is not None, "the built-in solver is asked nothing here"
        return self._session.check(problem, precision=precision, timeout_s=timeout_s)

    def __enter__(self) -> LazySolver:
        """Nothing is started yet."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the solver if it was opened."""
        if self._session is not None:
            self._session.close()
        self._session, self._is_opened = None, False
