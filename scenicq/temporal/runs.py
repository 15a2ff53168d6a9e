"""What became of runs of a dynamic program.

A run from sample i matches if it ends at j and everything holds on i..j. A program that says when it ends has one j for
each i; any other may end anywhere, and then j is the last sample up to which everything holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from scenicq.match.verdict import WitnessValue
from scenicq.temporal.truth import FALSE, UNKNOWN, Truth

__all__ = ["SLACK_S", "Detail", "Runs", "later_sample"]

SLACK_S = 1e-6
"""Seconds that floating point may be off."""

Detail = tuple[str, Mapping[str, WitnessValue]]
"""Why a run is unknown, and the values of random variables of conditions over time that prove a match."""

Places = NDArray[np.int64]


def later_sample(seconds: NDArray[np.float64], here: int, after_s: float) -> int:
    """The first sample so many seconds after one of a stretch, and at least the next one.

    Args:
        seconds: Times of the samples of the stretch, ascending.
        here: The number of the sample.
        after_s: Seconds.
    """
    return max(here + 1, int(np.searchsorted(seconds, float(seconds[here]) + after_s - SLACK_S)))


@dataclass(frozen=True, slots=True)
class Runs:
    """What became of runs, side by side; a start has several where other values of hidden numbers make others of it.

    Attributes:
        of: The number of the start of each, shape (m,).
        starts: First places.
        ends: Last places; of a run that is no match, how far it came.
        truth: Whether they match.
        broken: What keeps each from matching, as an array of `Span | None`; None where nothing does, and where it is
            cut off before a requirement is lost for good.
        cut_off: Whether the samples are over before the program ends.
        open_: Whether a later end is not excluded: of a match that what is unknown may let go on.
        undecided: Whether there are too many ways in which they may go on.
        details: What else is known of each, as an array of `Detail | None`.
        low, high: Between which values of each hidden number, both included, shape (m, variables).
    """

    of: NDArray[np.int64]
    starts: Places
    ends: Places
    truth: Truth
    broken: NDArray[np.object_]
    cut_off: NDArray[np.bool_]
    open_: NDArray[np.bool_]
    undecided: NDArray[np.bool_]
    details: NDArray[np.object_]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def __len__(self) -> int:
        """The number of runs."""
        return len(self.of)

    @classmethod
    def unknown(cls, starts: Places, ends: Places) -> Runs:
        """Runs of which nothing is known, one for each start."""
        m = len(starts)
        broken, details = np.full((2, m), None, dtype=object)
        a, b, c = np.zeros((3, m), np.bool_)
        none = np.empty((m, 0))
        return cls(np.arange(m), starts, ends, np.full(m, UNKNOWN), broken, a, b, c, details, none, none)

    @classmethod
    def lost(cls, starts: Places) -> Runs:
        """Runs that are no matches and come no further than their starts."""
        found = cls.unknown(starts, starts.copy())
        found.truth[:] = FALSE
        return found

    @staticmethod
    def joined(parts: Sequence[Runs]) -> Runs:
        """Some runs, then others, all of the same hidden numbers."""
        return Runs(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Runs)))

    def some(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> Runs:
        """Some of them."""
        return Runs(*(getattr(self, each.name)[which] for each in fields(self)))

    def at(self, numbers: NDArray[np.int64], places: Places) -> Runs:
        """The same among other starts and places, whatever the hidden numbers are.

        Args:
            numbers: The new number of each start.
            places: The new number of each place.
        """
        none = np.empty((len(self), 0))
        own, first, last = numbers[self.of], places[self.starts], places[self.ends]
        return replace(self, of=own, starts=first, ends=last, low=none, high=none)

    def with_detail(
        self, reason: str, witness: Mapping[str, WitnessValue] | None = None, truth: int | None = None
    ) -> Runs:
        """The same with why they are unknown, or the values that prove them, and another truth value if it is given."""
        details = np.full(len(self), None, dtype=object)
        details.fill((reason, witness or {}))
        values = self.truth if truth is None else np.full(len(self), truth, np.int8)
        return replace(self, details=details, truth=values)
