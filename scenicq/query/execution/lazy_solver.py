"""A solver that is opened when the first question comes (most queries never ask one) and asked nothing twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # takes long to load
    from scenicq.smt.answer import Answer, SolverSession
    from scenicq.smt.answer_cache import RememberingSolver
    from scenicq.smt.formula import Problem

__all__ = ["LazySolver"]


class LazySolver:
    """A `Solver` by name, to be used in a `with` statement.

    Attributes:
        name: As `open_solver` takes it.
        calls: Questions asked so far.
    """

    def __init__(self, name: str) -> None:
        """Take the name; nothing is started."""
        self.name = name
        self.calls = 0
        self._session: SolverSession | None = None
        self._memory: RememberingSolver | None = None

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide one problem; see `Solver.check`.

        Raises:
            SolverError: The solver cannot be loaded or started.
        """
        if self._memory is None:
            from scenicq.smt.answer_cache import RememberingSolver  # noqa: PLC0415 - takes long to load
            from scenicq.smt.solver import open_solver  # noqa: PLC0415

            self._session = open_solver(self.name)
            self._memory = RememberingSolver(self._session)
        self.calls += 1
        return self._memory.check(problem, precision=precision, timeout_s=timeout_s)

    def __enter__(self) -> LazySolver:
        """Nothing is started yet."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the solver if it was opened."""
        if self._session is not None:
            self._session.close()
            self._session = self._memory = None
