"""Stretches of recordings under bindings, side by side: the starts of a block, and the samples that runs may come to.

A binding gives each object of the scenario a track. All runs of one binding that start in one common life of its tracks
make a stretch: from the first start to the last sample of that life.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenicq.store.classes import Granularity
from scenicq.store.track_block import TrackBlock
from scenicq.temporal.samples import BoundSamples

__all__ = ["StartTable", "Stretches", "Timeline", "TrackSpans", "stretches_of"]

Members = NDArray[np.int64]
_AT_ONCE = 400_000
"""Places in memory."""


@dataclass(frozen=True, slots=True)
class StartTable:
    """Labels of a block that match the initial scene, or may, each with one correspondence.

    Attributes:
        block: The recordings.
        members: For each role, its member at each start, shape (m,).
        sure: Whether it is a match, shape (m,).
        outcomes: With which outcome of the choices over time, by number, shape (m,).
    """

    block: TrackBlock
    members: Mapping[int, Members]
    sure: NDArray[np.bool_]
    outcomes: NDArray[np.int64]

    def __len__(self) -> int:
        """The number of starts."""
        return len(self.sure)

    @property
    def labels(self) -> Members:
        """The label of each start."""
        return self.block.label_of[next(iter(self.members.values()))]

    def chosen(self, which: NDArray[np.int64]) -> StartTable:
        """Some of them."""
        members = {index: mine[which] for index, mine in self.members.items()}
        return StartTable(self.block, members, self.sure[which], self.outcomes[which])

    @classmethod
    def joined(cls, parts: Sequence[StartTable]) -> StartTable:
        """Tables of one block one after the other."""
        members = {index: np.concatenate([part.members[index] for part in parts]) for index in parts[0].members}
        sure, outcomes = (np.concatenate([getattr(part, name) for part in parts]) for name in ("sure", "outcomes"))
        return cls(parts[0].block, members, sure, outcomes)


@dataclass(frozen=True, slots=True)
class Timeline:
    """The samples of some stretches, one stretch after the other, and where runs start.

    Attributes:
        bounds: Where each stretch begins, and where the last ends, shape (s + 1,).
        seconds: Time of each place since the first sample of its recording, shape (n,).
        starts: Places of the starts in order, shape (m,).
    """

    bounds: Members
    seconds: NDArray[np.float64]
    starts: Members

    def __len__(self) -> int:
        """The number of places."""
        return len(self.seconds)

    def heads(self) -> Members:
        """For each place the first one of its stretch."""
        return np.repeat(self.bounds[:-1], np.diff(self.bounds))

    def ends(self) -> Members:
        """For each start the last place of its stretch."""
        return self.bounds[np.searchsorted(self.bounds, self.starts, side="right")] - 1

    def apart(self) -> Iterator[tuple[slice, slice]]:
        """The places of each stretch, and which of the starts are its own."""
        firsts = np.searchsorted(self.starts, self.bounds)
        for number in range(len(self.bounds) - 1):
            yield (
                slice(int(self.bounds[number]), int(self.bounds[number + 1])),
                slice(int(firsts[number]), int(firsts[number + 1])),
            )


@dataclass(frozen=True, slots=True)
class Stretches(Timeline):
    """Stretches of recordings.

    Attributes:
        places: The samples, with the member of each role at each place.
        labels: The label of each place, shape (n,).
        numbers: The number of each start in its table.
    """

    places: BoundSamples
    labels: Members
    numbers: Members

    def some(self, chosen: NDArray[np.int64]) -> Stretches:
        """The stretches to which some places belong: all of theirs, in order."""
        which = np.unique(np.searchsorted(self.bounds, chosen, side="right") - 1)
        lengths = np.diff(self.bounds)
        before = np.zeros(len(self.labels) + 1, np.int64)
        before[1:] = np.cumsum(np.isin(np.repeat(np.arange(len(lengths)), lengths), which))
        mine = before[self.starts + 1] > before[self.starts]
        return Stretches(
            np.concatenate(([0], np.cumsum(lengths[which]))), self.seconds[chosen], before[self.starts[mine]],
            self.places.at(chosen), self.labels[chosen], self.numbers[mine],
        )  # fmt: skip

    def only(self, which: NDArray[np.bool_]) -> tuple[Stretches, NDArray[np.int64]]:
        """The stretches of some starts with these alone, and which places they have."""
        mine = replace(self, starts=self.starts[which], numbers=self.numbers[which])
        wanted = np.zeros(len(self.bounds) - 1, np.bool_)
        wanted[np.searchsorted(self.bounds, mine.starts, side="right") - 1] = True
        chosen = np.flatnonzero(np.repeat(wanted, np.diff(self.bounds)))
        return mine.some(chosen), chosen

    def beginning(self, number: int) -> Stretches:
        """The stretches with one start alone."""
        return replace(self, starts=self.starts[number : number + 1], numbers=self.numbers[number : number + 1])

    def alone(self, number: int) -> Stretches:
        """The stretch of one start, with this start alone."""
        place = int(np.searchsorted(self.bounds, int(self.starts[number]), side="right"))
        first, end = int(self.bounds[place - 1]), int(self.bounds[place])
        return self.beginning(number).some(np.arange(first, end))


def stretches_of(table: StartTable, gap_s: float, *, apart: bool, classes: Granularity = "fine") -> Iterator[Stretches]:
    """The stretches that starts make, so many at a time that they stay in memory.

    Args:
        table: Starts, sorted by binding, then by label; no two objects of one play the same track.
        gap_s: Seconds without a label after which a track's life ends.
        apart: Whether each start makes a stretch of its own.
        classes: How classes are compared.
    """
    if not len(table):
        return
    block, labels = table.block, table.labels
    tracks = {index: block.tracks(mine) for index, mine in table.members.items()}
    seen = TrackSpans(block, np.unique(np.concatenate([*tracks.values()])), gap_s)
    # who comes later is there at another label
    lives = {index: seen.life_ends(tracks[index], block.label_of[mine]) for index, mine in table.members.items()}
    ends = np.minimum.reduce(list(lives.values()))
    changes = np.full(len(table), apart)
    changes[0] = True
    for mine in (*tracks.values(), ends):
        changes[1:] |= mine[1:] != mine[:-1]
    heads = np.flatnonzero(changes)
    lengths = ends[heads] - labels[heads] + 1
    total = np.cumsum(lengths)
    first = 0
    while first < len(heads):
        last = max(first + 1, int(np.searchsorted(total, total[first] - lengths[first] + _AT_ONCE, side="right")))
        sizes = lengths[first:last]
        bounds = np.concatenate(([0], np.cumsum(sizes)))
        which = np.repeat(np.arange(len(sizes)), sizes)
        at: Members = labels[heads[first:last]][which] + np.arange(int(bounds[-1])) - bounds[which]
        members = {
            index: seen.members_of_life(mine[heads[first:last]][which], at, lives[index][heads[first:last]][which])
            for index, mine in tracks.items()
        }
        low, high = int(heads[first]), int(heads[last]) if last < len(heads) else len(table)
        mine = np.searchsorted(heads, np.arange(low, high), side="right") - 1 - first
        starts = bounds[mine] + labels[low:high] - labels[heads[first + mine]]
        recordings = np.array([run[0] for run in block.runs], dtype=np.int64)[block.recording_of[at]]
        seconds = (block.times_us[at] - block.times_us[recordings]) / 1e6
        places = BoundSamples(block, members, len(at), at, classes)
        yield Stretches(bounds, seconds, starts, places, at, np.arange(low, high))
        first = last


class TrackSpans:
    """Where some tracks are seen: a row for each, of the samples from its first to its last."""

    def __init__(self, block: TrackBlock, wanted: Members, gap_s: float) -> None:
        self._wanted, mates = wanted, block.mates(wanted)
        label = block.label_of[mates]
        row = np.searchsorted(wanted, block.tracks(mates))
        self._first, self._last = np.full(len(wanted), len(block)), np.full(len(wanted), -1)
        # label objects come in the order of labels, and behind them the egos of all
        self._first[row[::-1]] = label[::-1]
        self._last[row] = label
        sizes = np.maximum(self._last - self._first + 1, 0)
        # so that a label leads to its place in the row
        self._base = np.cumsum(sizes) - sizes - self._first
        self._table = np.full(int(sizes.sum()), -1, dtype=np.int64)
        self._table[self._base[row] + label] = mates
        there = np.flatnonzero(self._table >= 0)
        at = block.label_of[self._table[there]]
        of = np.repeat(np.arange(len(wanted)), sizes)[there]
        breaks = (of[1:] != of[:-1]) | (np.diff(block.times_us[at]) > round(gap_s * 1e6))
        lasts = np.append(np.flatnonzero(breaks), len(there) - 1)
        self._life = np.full(len(self._table), -1, dtype=np.int64)
        if len(there):
            lives = np.concatenate(([0], np.cumsum(breaks)))
            self._life[there] = at[lasts[lives]]

    def members(self, tracks: Members, labels: Members) -> Members:
        """Who is of a track at a label; -1 where nobody is."""
        row = np.searchsorted(self._wanted, tracks)
        within = (self._first[row] <= labels) & (labels <= self._last[row])
        found = np.full(len(labels), -1)
        found[within] = self._table[self._base[row[within]] + labels[within]]
        return found

    def members_of_life(self, tracks: Members, labels: Members, ends: Members) -> Members:
        """Who is of a track at a label, in its life that ends with another one; -1 where nobody is."""
        found = self.members(tracks, labels)
        there = np.flatnonzero(found >= 0)
        found[there[self.life_ends(tracks[there], labels[there]) != ends[there]]] = -1
        return found

    def life_ends(self, tracks: Members, labels: Members) -> Members:
        """The last label of the life of a track that is seen at a label."""
        return self._life[self._base[np.searchsorted(self._wanted, tracks)] + labels]
