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
    """The first sample at least `after_s` seconds later than sample `here`; never `here` itself.

    Args:
        seconds: Times of the samples of a stretch, ascending.
        here: The number of a sample.
        after_s: Seconds.
    """
    return max(here + 1, int(np.searchsorted(seconds, float(seconds[here]) + after_s - SLACK_S)))


@dataclass(frozen=True, slots=True)
class Runs:
    """What became of m runs, side by side.

    One start has several runs if hidden random variables split it: each run then holds for one range of their values.
    A *place* is the number of a sample among all that are followed at once.

    Attributes:
        owner: The number of the start of each run, shape (m,).
        starts: The place of the first sample.
        ends: The place of the last sample; of a run that does not match, the last one that it reached.
        truth: Whether the run matches.
        broken: What keeps it from matching, as an array of `Span | None`; None if nothing does, or if the samples end
            before a requirement is lost for good.
        cut_off: Whether the samples end before the program does.
        open_: Whether the run matches, and unknown samples after its end could make the match longer.
        undecided: Whether it was given up, because it branched more often than a limit allows.
        details: What else is known of it, as an array of `Detail | None`.
        low, high: The range of each hidden variable, both ends included, shape (m, variables).
    """

    owner: NDArray[np.int64]
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
        return len(self.owner)

    @classmethod
    def unknown(cls, starts: Places, ends: Places) -> Runs:
        """Runs about which nothing is known, one for each start."""
        m = len(starts)
        broken, details = np.full((2, m), None, dtype=object)
        a, b, c = np.zeros((3, m), np.bool_)
        none = np.empty((m, 0))
        return cls(np.arange(m), starts, ends, np.full(m, UNKNOWN), broken, a, b, c, details, none, none)

    @classmethod
    def failed_at_start(cls, starts: Places) -> Runs:
        """Runs that do not match and come no further than their starts."""
        found = cls.unknown(starts, starts.copy())
        found.truth[:] = FALSE
        return found

    @staticmethod
    def joined(parts: Sequence[Runs]) -> Runs:
        """All runs of the parts, one part after the other; their hidden variables must be the same."""
        return Runs(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Runs)))

    def some(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> Runs:
        """The runs at these indices, or under this mask."""
        return Runs(*(getattr(self, each.name)[which] for each in fields(self)))

    def renumbered(self, numbers: NDArray[np.int64], places: Places) -> Runs:
        """These runs with starts and places numbered anew, and without the ranges of hidden variables.

        Args:
            numbers: The new number of each start.
            places: The new number of each place.
        """
        none = np.empty((len(self), 0))
        own, first, last = numbers[self.owner], places[self.starts], places[self.ends]
        return replace(self, owner=own, starts=first, ends=last, low=none, high=none)

    def with_detail(
        self, reason: str, witness: Mapping[str, WitnessValue] | None = None, truth: int | None = None
    ) -> Runs:
        """These runs with the reason why they are unknown, or the values that prove them, and perhaps another truth."""
        details = np.full(len(self), None, dtype=object)
        details.fill((reason, witness or {}))
        values = self.truth if truth is None else np.full(len(self), truth, np.int8)
        return replace(self, details=details, truth=values)
