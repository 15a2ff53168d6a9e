"""What recordings show of the tracks that play roles, as columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.among import LabelElements
from scenicq.forest.columns import DEFINED, UNKNOWN, Column, column_of
from scenicq.forest.ego_frame import PLACE
from scenicq.forest.nodes import CLOCK, COURSE, GOING, LAST_LANE, PAST, RANK, TRACK, WHO, LaneCourse, Value
from scenicq.number_ranges import expand_ranges
from scenicq.store.classes import Granularity, class_truth
from scenicq.store.reader import LAST
from scenicq.store.track_block import TrackBlock
from scenicq.store.tracks import RecordingTracks, TrackKey

__all__ = ["FIXED", "MOVING", "WITH_COLUMNS", "Binding", "BoundSamples", "RoleSamples", "Samples", "is_moving"]

MOVING = WHO | {"position", "heading", "velocity", "speed", "angularSpeed", "acceleration", COURSE, GOING, LAST_LANE}
"""Properties that change from sample to sample: where they are not observed, nothing is known of them."""


def is_moving(name: str) -> bool:
    """Whether a property changes from sample to sample, or is one of a sample that is not kept."""
    return name in MOVING or name == CLOCK or name.startswith(PAST)


FIXED = frozenset({"width", "length", "height"})
"""Properties that are the same at each sample."""

_AT_ONCE = 200_000
"""Label objects in memory about which something is asked."""
_COLUMNS = {
    "heading": "heading", "width": "width", "length": "length", "height": "height",
    "angularSpeed": "yaw_rate", "acceleration": "acceleration",
}  # fmt: skip

WITH_COLUMNS = (MOVING - WHO) | _COLUMNS.keys()
"""Properties that the store has columns of."""

Binding = Mapping[int, TrackKey]
"""The track of each object of the scenario, by the object's index."""

Numbers = NDArray[np.float64]


class RoleSamples(Protocol):
    """Some samples, with the label object of each role."""

    def __len__(self) -> int:
        """The number of samples."""
        ...

    def observed(self, index: int, name: str) -> tuple[Numbers, ...] | list[Value] | None:
        """The values of a property of an object, nan where there is none: one column, or two of a vector.

        A list with None where there is none, for what is no number; None if no sample has it.
        """
        ...

    def courses(self, index: int, rules: LaneCourse) -> list[Value]:
        """The course of an object at each sample, with where on it it is; None where it is not observed."""
        ...


@dataclass(frozen=True, eq=False, slots=True)
class BoundSamples:
    """Samples of any recordings of a block, under any bindings.

    Attributes:
        block: The recordings.
        members: For each role, its member at each place; -1 where it is not observed.
        size: How many places there are.
        labels: The label of each place; None where somebody is observed at each.
        classes: How classes are compared.
    """

    block: TrackBlock
    members: Mapping[int, NDArray[np.int64]]
    size: int
    labels: NDArray[np.int64] | None = None
    classes: Granularity = "fine"

    def __len__(self) -> int:
        """The number of places."""
        return self.size

    def observed(self, index: int, name: str) -> tuple[Numbers, ...] | list[Value] | None:
        """See `RoleSamples`."""
        mine = self.members[index]
        if name in WHO:
            who = (self.block.id_ranks() if name == RANK else self.block.tracks(np.arange(self.block.size)))[mine]
            # where it is not there, nobody is it
            return (np.where(mine >= 0, who.astype(np.float64), -1.0 if name == TRACK else np.nan),)
        if name == CLOCK:
            labels = self._labels()
            seconds = (self.block.times_us - self.block.times_us[0]) / 1e6
            return (np.where(labels >= 0, seconds[labels], np.nan),)

        def said() -> list[Value]:
            codes, answers = self.block.said()
            values: list[Value] = [each.get(name) for each in answers]
            return [values[code] for code in codes[mine].tolist()]

        return _observed(name, lambda column: self.block.numbers(column)[mine], said)

    def courses(self, index: int, rules: LaneCourse) -> list[Value]:
        """See `RoleSamples`."""
        return [*self.block.courses(self.members[index], rules.network, rules.gap_s)]

    def seen(self, ego: int, index: int, name: str) -> tuple[Numbers, ...]:
        """`PLACE` or `DISTANCE` of an object, nan where it is not known.

        Args:
            ego: The object that is the labels' own ego.
            index: The other object.
            name: Which of both.
        """
        there = self.members[ego] >= 0
        columns = ("ego_right", "ego_ahead") if name == PLACE else ("ego_distance",)
        return tuple(np.where(there, self.block.numbers(column)[self.members[index]], np.nan) for column in columns)

    def at(self, chosen: NDArray[Any]) -> BoundSamples:
        """Some of the places, by their numbers or a truth value for each."""
        members = {index: mine[chosen] for index, mine in self.members.items()}
        size = int(chosen.sum()) if chosen.dtype == np.bool_ else len(chosen)
        labels = None if self.labels is None else self.labels[chosen]
        return BoundSamples(self.block, members, size, labels, self.classes)

    def elements(self, rules: LaneCourse | None) -> LabelElements:
        """All label objects of the label of each place, whether or not they play a role.

        Args:
            rules: How their courses are made, if anybody asks for any.
        """
        return label_elements(self.block, self._labels(), self.classes, rules)

    def pieces(self, rules: LaneCourse | None) -> list[tuple[int, int, LabelElements | None]]:
        """From where to where places have not too many label objects, and these, where all are one piece."""
        counts = np.cumsum(np.append(np.diff(self.block.object_starts), 0)[self._labels()] + 1)
        cuts = [0]
        while cuts[-1] < self.size:
            before = int(counts[cuts[-1] - 1]) if cuts[-1] else 0
            cuts.append(max(cuts[-1] + 1, int(np.searchsorted(counts, before + _AT_ONCE, side="right"))))
        if len(cuts) == 2:
            return [(0, self.size, self.elements(rules))]
        return [(first, end, None) for first, end in pairwise(cuts)]

    def _labels(self) -> NDArray[np.int64]:
        if self.labels is not None:
            return self.labels
        return np.max([np.where(mine >= 0, self.block.label_of[mine], -1) for mine in self.members.values()], 0)


def label_elements(
    block: TrackBlock, labels: NDArray[np.int64], classes: Granularity, rules: LaneCourse | None
) -> LabelElements:
    """The label objects of some labels, place by place, the egos that are there among them.

    Args:
        block: Has all of them.
        labels: The label of each place, -1 where it is not known.
        classes: How classes are compared.
        rules: How courses are made, if anybody asks for any.
    """
    counts = np.where(labels >= 0, np.diff(block.object_starts)[labels], 0)
    place = np.repeat(np.arange(len(labels)), counts)
    objects = expand_ranges(block.object_starts[labels], counts)
    egos = np.where(labels >= 0, block.present_ego(labels), -1)
    with_ego = np.flatnonzero(egos >= 0)
    members = np.concatenate((objects, egos[with_ego]))
    place = np.concatenate((place, with_ego))
    order = np.argsort(place, kind="stable")
    members, place = members[order], place[order]
    codes, names = block.categories()

    @cache
    def belongs(category: str) -> NDArray[np.int8]:
        truths = [*(class_truth(category, name, classes) for name in names), 0]
        return np.array(truths, dtype=np.int8)[codes[members]]

    rows = BoundSamples(block, {0: members}, len(members))

    @cache
    def observed(name: str) -> Column:
        found = rows.courses(0, rules) if name == COURSE and rules is not None else rows.observed(0, name)
        if found is None:
            return Column(np.full(1, np.nan), np.full(1, UNKNOWN))
        if isinstance(found, list):
            return column_of(found)
        status = np.where(np.isnan(found[0]), UNKNOWN, DEFINED)
        return Column((found[0], found[1]) if len(found) == 2 else found[0], status)

    ids = block.tracks(members).astype(np.float64)
    return LabelElements(place.astype(np.intp), labels >= 0, ids, belongs, observed)


@dataclass(eq=False, slots=True)
class Samples:
    """The samples of a stretch of a recording under a binding.

    Attributes:
        tracks: The recording.
        binding: The track of each role.
        first, end: Samples of the stretch, the end left out.
    """

    tracks: RecordingTracks
    binding: Binding
    first: int
    end: int

    def __len__(self) -> int:
        """The number of samples."""
        return self.end - self.first

    def observed(self, index: int, name: str) -> tuple[Numbers, ...] | list[Value] | None:
        """See `RoleSamples`."""
        track = self.binding[index]
        if name == CLOCK:
            return (self.tracks.seconds[self.first : self.end],)

        def said() -> list[Value]:
            return [each.get(name) for each in self.tracks.attributes(track)[self.first : self.end]]

        return _observed(name, lambda column: self.tracks.column(track, column)[self.first : self.end], said)

    def courses(self, index: int, rules: LaneCourse) -> list[Value]:
        """See `RoleSamples`."""
        track = self.binding[index]
        return [self.tracks.course(track, sample, rules.network, rules.gap_s) for sample in range(self.first, self.end)]


def _observed(
    name: str, column: Callable[[str], Numbers], said: Callable[[], Sequence[Value]]
) -> tuple[Numbers, ...] | list[Value] | None:
    """The values of a property; arguments as `RoleSamples.observed`.

    Args:
        name: Name of the property.
        column: A column of the store by its name.
        said: The values that labels give beside the columns, None where there is none.
    """
    if name == "position":
        return column("x"), column("y")
    if name in ("velocity", "speed"):
        vx, vy = column("motion_vx"), column("motion_vy")
        return (np.hypot(vx, vy),) if name == "speed" else (vx, vy)
    if name == GOING:
        return (column("heading"),)
    if name == LAST_LANE:
        return (column(LAST),)
    if name in _COLUMNS:
        found = column(_COLUMNS[name])
        return None if name not in MOVING and np.isnan(found).all() else (found,)
    values = [*said()]
    if all(value is None for value in values):
        return None
    if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
        return (np.array([np.nan if value is None else value for value in values], dtype=np.float64),)
    return values
