"""Who is meant by the names in the correspondences of results, among the rows of labels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scenicq.store.track_block import TrackBlock

__all__ = ["Members"]


class Members:
    """Who is meant by the names in correspondences."""

    def __init__(self, block: TrackBlock) -> None:
        """Take the labels."""
        self._block = block
        self._ids = block.ids()
        self._tracks = block.tracks(np.arange(block.size))
        self._named = block.track_names()
        self._mates: dict[int, NDArray[np.int64]] = {}

    def at(self, name: str, label: int, _end: int) -> NDArray[np.int64]:
        """The label object of an id in a label, shape (1,)."""
        if name == "ego":
            return self._block.present_ego(np.array([label]))
        return np.array([self._find(label, lambda member: self._ids[member] == name)])

    def along(self, name: str, first: int, end: int) -> NDArray[np.int64]:
        """The label objects of a track in labels; the end left out."""
        if name == "ego":
            return self._block.present_ego(np.arange(first, end))
        named, ids = self._named, self._ids
        at_first = self._find(first, lambda member: (ids[member] if named[member] is None else named[member]) == name)
        found = np.full(end - first, -1)
        if at_first < 0:
            return found
        track = int(self._tracks[at_first])
        if track not in self._mates:
            self._mates[track] = np.flatnonzero(self._tracks[: self._block.object_count] == track)
        mates = self._mates[track]
        labels = self._block.label_of[mates]
        mine = (labels >= first) & (labels < end)
        found[labels[mine] - first] = mates[mine]
        return found

    def _find(self, label: int, is_it: Callable[[int], bool]) -> int:
        low, high = self._block.object_starts[label : label + 2].tolist()
        return next((member for member in range(low, high) if is_it(member)), -1)
