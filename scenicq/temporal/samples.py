"""What a recording shows of the tracks that play roles, as columns over its samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenicq.forest.nodes import Value
from scenicq.store.tracks import RecordingTracks, TrackKey

__all__ = ["FIXED", "MOVING", "Binding", "Samples"]

MOVING = frozenset({"position", "heading", "velocity", "speed", "angularSpeed", "acceleration"})
"""Properties that change from sample to sample: where they are not observed, nothing is known of them."""

FIXED = frozenset({"width", "length", "height"})
"""Properties that are the same at each sample."""

_COLUMNS = {
    "heading": "heading", "width": "width", "length": "length", "height": "height",
    "angularSpeed": "yaw_rate", "acceleration": "acceleration",
}  # fmt: skip

Binding = Mapping[int, TrackKey]
"""The track of each object of the scenario, by the object's index."""

Numbers = np.ndarray[tuple[int], np.dtype[np.float64]]


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

    def seconds(self) -> Numbers:
        """Time of each sample since the first of the recording."""
        return self.tracks.seconds[self.first : self.end]

    def present(self, index: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """At which samples an object is observed."""
        return ~np.isnan(self._column(index, "x"))

    def observed(self, index: int, name: str) -> tuple[Numbers, ...] | list[Value] | None:
        """The values of a property, nan where there is none: one column, or two of a vector.

        Of what is no number, a list with None where there is none; None if no sample has it.
        """
        if name == "position":
            return self._column(index, "x"), self._column(index, "y")
        if name in ("velocity", "speed"):
            vx, vy = self._column(index, "motion_vx"), self._column(index, "motion_vy")
            return (np.hypot(vx, vy),) if name == "speed" else (vx, vy)
        if name in _COLUMNS:
            found = self._column(index, _COLUMNS[name])
            return None if name not in MOVING and np.isnan(found).all() else (found,)
        said = self.tracks.attributes(self.binding[index])[self.first : self.end]
        values: list[Value] = [each.get(name) for each in said]
        if all(value is None for value in values):
            return None
        if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
            return (np.array([np.nan if value is None else value for value in values], dtype=np.float64),)
        return values

    def _column(self, index: int, name: str) -> Numbers:
        return self.tracks.column(self.binding[index], name)[self.first : self.end]
