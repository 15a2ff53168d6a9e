"""What recordings show of the tracks that play roles, as columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.ego_frame import PLACE
from scenicq.forest.nodes import COURSE, LaneCourse, Value
from scenicq.store.track_block import TrackBlock
from scenicq.store.tracks import RecordingTracks, TrackKey

__all__ = ["FIXED", "MOVING", "WITH_COLUMNS", "Binding", "BoundSamples", "Observed", "Samples"]

MOVING = frozenset({"position", "heading", "velocity", "speed", "angularSpeed", "acceleration", COURSE})
"""Properties that change from sample to sample: where they are not observed, nothing is known of them."""

FIXED = frozenset({"width", "length", "height"})
"""Properties that are the same at each sample."""

_COLUMNS = {
    "heading": "heading", "width": "width", "length": "length", "height": "height",
    "angularSpeed": "yaw_rate", "acceleration": "acceleration",
}  # fmt: skip

WITH_COLUMNS = MOVING | _COLUMNS.keys()
"""Properties that the store has columns of."""

Binding = Mapping[int, TrackKey]
"""The track of each object of the scenario, by the object's index."""

Numbers = NDArray[np.float64]


class Observed(Protocol):
    """Some samples with who plays whom in each."""

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
        members: By object of the scenario, who plays it at each place; -1 where it is not observed.
        size: How many places there are.
    """

    block: TrackBlock
    members: Mapping[int, NDArray[np.int64]]
    size: int

    def __len__(self) -> int:
        """The number of places."""
        return self.size

    def observed(self, index: int, name: str) -> tuple[Numbers, ...] | list[Value] | None:
        """See `Observed`."""
        mine = self.members[index]

        def said() -> list[Value]:
            codes, answers = self.block.said()
            values: list[Value] = [each.get(name) for each in answers]
            return [values[code] for code in codes[mine].tolist()]

        return _observed(name, lambda column: self.block.numbers(column)[mine], said)

    def courses(self, index: int, rules: LaneCourse) -> list[Value]:
        """See `Observed`."""
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
        return BoundSamples(self.block, members, size)


@dataclass(eq=False, slots=True)
class Samples:
    """The samples of a stretch of a recording under a binding.

    Attributes:
        tracks: The recording.
        binding: Who plays whom.
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
        """See `Observed`."""
        track = self.binding[index]

        def said() -> list[Value]:
            return [each.get(name) for each in self.tracks.attributes(track)[self.first : self.end]]

        return _observed(name, lambda column: self.tracks.column(track, column)[self.first : self.end], said)

    def courses(self, index: int, rules: LaneCourse) -> list[Value]:
        """See `Observed`."""
        track = self.binding[index]
        return [self.tracks.course(track, sample, rules.network, rules.gap_s) for sample in range(self.first, self.end)]


def _observed(
    name: str, column: Callable[[str], Numbers], said: Callable[[], Sequence[Value]]
) -> tuple[Numbers, ...] | list[Value] | None:
    """The values of a property; arguments as `Observed.observed`.

    Args:
        name: Of the property.
        column: A column of the store by its name.
        said: The values that labels give beside the columns, None where there is none.
    """
    if name == "position":
        return column("x"), column("y")
    if name in ("velocity", "speed"):
        vx, vy = column("motion_vx"), column("motion_vy")
        return (np.hypot(vx, vy),) if name == "speed" else (vx, vy)
    if name in _COLUMNS:
        found = column(_COLUMNS[name])
        return None if name not in MOVING and np.isnan(found).all() else (found,)
    values = [*said()]
    if all(value is None for value in values):
        return None
    if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
        return (np.array([np.nan if value is None else value for value in values], dtype=np.float64),)
    return values
