"""What became of runs of a dynamic program.

A run from sample i matches if it ends at j and everything holds on i..j. A program that says when it ends has one j for
each i; any other may end anywhere, and then j is the last sample up to which everything holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import Span
from scenicq.temporal.truth import FALSE, UNKNOWN, Truth

__all__ = ["SLACK_S", "Run", "Runs"]

SLACK_S = 1e-6
"""Seconds that floating point may be off."""

Places = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Run:
    """What became of the run from one sample.

    Attributes:
        start: The sample.
        end: The last sample; of a run that is no match, how far it came.
        truth: Whether it matches.
        broken: What keeps it from matching, in the program; None where nothing does, and where it is cut off before
            a requirement is lost for good.
        cut_off: Whether the samples are over before the program ends.
        open_: Whether a later end is not excluded: of a match that what is unknown may let go on.
        undecided: Whether it is unknown because there are too many ways in which it may go on.
    """

    start: int
    end: int
    truth: int
    broken: Span | None = None
    cut_off: bool = False
    open_: bool = False
    undecided: bool = False


@dataclass(frozen=True, slots=True)
class Runs:
    """What became of runs, side by side; see `Run`.

    Attributes:
        ends: Last places, shape (m,).
        truth: Whether they match.
        broken: What keeps each from matching, as an array of `Span | None`.
        cut_off: Whether the samples are over before the program ends.
        open_: Whether a later end is not excluded.
        undecided: Whether there are too many ways in which they may go on.
    """

    ends: Places
    truth: Truth
    broken: NDArray[np.object_]
    cut_off: NDArray[np.bool_]
    open_: NDArray[np.bool_]
    undecided: NDArray[np.bool_]

    @classmethod
    def unknown(cls, ends: Places) -> Runs:
        """Runs of which nothing is known, with their ends."""
        n = len(ends)
        return cls(ends, np.full(n, UNKNOWN), np.full(n, None, dtype=object), *np.zeros((3, n), np.bool_))

    @classmethod
    def lost(cls, ends: Places) -> Runs:
        """Runs that are no matches, with their ends."""
        found = cls.unknown(ends)
        found.truth[:] = FALSE
        return found

    @staticmethod
    def joined(parts: Sequence[Runs]) -> Runs:
        """Some runs, then others."""
        return Runs(*(np.concatenate([getattr(part, name) for part in parts]) for name in Runs.__slots__))

    def some(self, which: NDArray[np.int64]) -> Runs:
        """Some of them, by their numbers."""
        return Runs(*(getattr(self, name)[which] for name in Runs.__slots__))

    def put(self, number: int, run: Run) -> None:
        """Write down what became of one of them, by its number."""
        self.ends[number], self.truth[number], self.broken[number] = run.end, run.truth, run.broken
        self.cut_off[number], self.open_[number], self.undecided[number] = run.cut_off, run.open_, run.undecided

    def replace(self, which: NDArray[np.int64], found: Runs) -> None:
        """Write down what became of some of them, by their numbers."""
        for name in Runs.__slots__:
            getattr(self, name)[which] = getattr(found, name)

    def run(self, number: int, start: int) -> Run:
        """One of them, by its number, with the place of its start."""
        return Run(
            start, int(self.ends[number]), int(self.truth[number]), self.broken[number],
            bool(self.cut_off[number]), bool(self.open_[number]), bool(self.undecided[number]),
        )  # fmt: skip
