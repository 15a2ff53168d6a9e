"""Who is meant by the names in the correspondences of results, among the rows of labels."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from scenicq.match.verdict import Match
from scenicq.query.execution.results import Result
from scenicq.store.dataset import Dataset
from scenicq.store.track_block import TrackBlock

__all__ = ["Members", "fill_by_recording"]


def fill_by_recording(
    results: Iterable[Result], fill: Callable[[str, list[Result]], Iterable[Result]]
) -> Iterator[Result]:
    """Fill in the results of each recording with a match together; other results stay as they are.

    Args:
        results: The results, those of one recording together.
        fill: Gets a recording with its results, and gives them filled.
    """
    for recording, several in groupby(results, lambda each: each.recording):
        mine = list(several)
        yield from fill(recording, mine) if any(isinstance(each.verdict, Match) for each in mine) else mine


class Members:
    """Who is meant by the names in correspondences.

    Attributes:
        block: The labels.
        numbers: The number of each frame's label, by the frame's name.
    """

    def __init__(self, block: TrackBlock) -> None:
        """Take the labels."""
        self.block = block
        self.numbers = {name: number for number, name in enumerate(block.frames(np.arange(len(block))))}
        self._ids = block.ids()
        self._tracks = block.tracks(np.arange(block.size))
        self._named = block.track_names()
        self._mates: dict[int, NDArray[np.int64]] = {}

    @classmethod
    @contextmanager
    def of_recording(cls, dataset: Dataset, recording: str) -> Generator[Members]:
        """The members of a recording's labels, which are open in the block."""
        part, first, end = dataset.recorded.rows(recording)
        with TrackBlock(dataset, part, [(first, end)]) as block:
            yield cls(block)

    def at(self, name: str, label: int, _end: int) -> NDArray[np.int64]:
        """The label object of an id in a label, shape (1,)."""
        if name == "ego":
            return self.block.present_ego(np.array([label]))
        return np.array([self._find(label, lambda member: self._ids[member] == name)])

    def along(self, name: str, first: int, end: int) -> NDArray[np.int64]:
        """The label objects of a track in labels; the end left out."""
        if name == "ego":
            return self.block.present_ego(np.arange(first, end))
        named, ids = self._named, self._ids

        def is_it(member: int) -> bool:
            return (ids[member] if named[member] is None else named[member]) == name

        # who comes later is looked for where he comes
        found_at = (self._find(label, is_it) for label in range(first, end))
        at_first = next((member for member in found_at if member >= 0), -1)
        found = np.full(end - first, -1)
        if at_first < 0:
            return found
        track = int(self._tracks[at_first])
        if track not in self._mates:
            self._mates[track] = np.flatnonzero(self._tracks[: self.block.object_count] == track)
        mates = self._mates[track]
        labels = self.block.label_of[mates]
        mine = (labels >= first) & (labels < end)
        found[labels[mine] - first] = mates[mine]
        return found

    def _find(self, label: int, is_it: Callable[[int], bool]) -> int:
        low, high = self.block.object_starts[label : label + 2].tolist()
        return next((member for member in range(low, high) if is_it(member)), -1)
