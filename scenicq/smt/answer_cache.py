"""A solver that does not ask the same question twice.

In a recording, whoever stands still is labelled alike in many frames, so that a group about it alone is the same
question each time.
"""

from __future__ import annotations

import hashlib
import pickle
import threading
from collections import OrderedDict
from collections.abc import Hashable

from scenicq.smt.answer import Answer, NoAnswer, Solver
from scenicq.smt.formula import Problem

__all__ = ["RememberingSolver"]

MOST = 20_000
"""Answers that are kept; the one unused for longest goes first."""


class RememberingSolver:
    """Passes each question on once; threads may share it.

    Attributes:
        asked: Questions so far.
        passed_on: Those that the solver had to decide.
    """

    def __init__(self, solver: Solver) -> None:
        """Nothing is known yet.

        Args:
            solver: Who decides.
        """
        self.asked = self.passed_on = 0
        self._solver = solver
        self._known: OrderedDict[Hashable, Answer] = OrderedDict()
        self._lock = threading.Lock()

    @property
    def name(self) -> str:
        """The name of the solver that decides."""
        return self._solver.name

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide a problem, or repeat what was found; what was unknown is tried again. See `Solver.check`."""
        key = (hashlib.blake2b(pickle.dumps(problem), digest_size=16).digest(), precision)
        with self._lock:
            self.asked += 1
            if (known := self._known.get(key)) is not None:
                self._known.move_to_end(key)
                return known
            self.passed_on += 1
        answer = self._solver.check(problem, precision=precision, timeout_s=timeout_s)
        if not isinstance(answer, NoAnswer):
            with self._lock:
                self._known[key] = answer
                while len(self._known) > MOST:
                    self._known.popitem(last=False)
        return answer
