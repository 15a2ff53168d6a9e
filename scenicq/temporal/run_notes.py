"""What is seen of runs on their way, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Notes"]

Places = NDArray[np.int64]
_NEVER = np.iinfo(np.int64).max


@dataclass(slots=True)
class Notes:
    """What is seen of runs on their way; places are -1 where there is none.

    Attributes:
        sure: The last place at which they may end as a match, if the program says when it ends; else, where they surely
            match if they end there.
        possible: The last one at which they may match if they end there.
        failed: The last one at which they may end without being one.
        first_match: The first one at which they may end as a match.
        cause: What keeps them from matching there, by its number; -1 for nothing.
        first_cause: What keeps those from matching that end with their first sample.
        situation: The number of the situation in which they were seen last.
        going: Whether they may still be going where the samples are over.
        undecided: Whether there were too many ways in which they may go on.
    """

    sure: Places
    possible: Places
    failed: Places
    first_match: Places
    cause: NDArray[np.int64]
    first_cause: NDArray[np.int64]
    situation: NDArray[np.int64]
    going: NDArray[np.bool_]
    undecided: NDArray[np.bool_]

    @classmethod
    def nothing(cls, size: int) -> Notes:
        """Nothing seen."""
        a, b, c, d, e, f = (np.full(size, -1) for _ in range(6))
        return cls(a, b, c, np.full(size, _NEVER), d, e, f, np.zeros(size, np.bool_), np.zeros(size, np.bool_))

    def columns(self) -> list[NDArray[Any]]:
        """All that is seen."""
        return [getattr(self, each.name) for each in fields(self)]

    def some(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> Notes:
        """Those of some runs."""
        return Notes(*(each[which] for each in self.columns()))

    def put(self, which: NDArray[np.int64], seen: Notes) -> None:
        """Write down those of some runs."""
        for mine, new in zip(self.columns(), seen.columns(), strict=True):
            mine[which] = new

    @staticmethod
    def joined(parts: Sequence[Notes]) -> Notes:
        """Those of some runs, then of others."""
        return Notes(*(np.concatenate(each) for each in zip(*(part.columns() for part in parts), strict=True)))

    def then(self, later: Notes) -> Notes:
        """What is seen on two parts of a way, one after the other."""
        return Notes(
            np.maximum(self.sure, later.sure), np.maximum(self.possible, later.possible),
            np.maximum(self.failed, later.failed), np.minimum(self.first_match, later.first_match),
            np.where(later.failed >= 0, later.cause, self.cause),
            np.where(self.situation >= 0, self.first_cause, later.first_cause),
            np.where(later.situation >= 0, later.situation, self.situation),
            self.going | later.going, self.undecided | later.undecided,
        )  # fmt: skip
