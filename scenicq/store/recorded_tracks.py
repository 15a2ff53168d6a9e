"""Where the label objects of a recording are in all of its labels; courses are made of that.

Read when a course is asked for, a recording at a time; of those asked for last a few are kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.driven_courses import CoursePlace, lane_course, track_courses
from scenicq.geometry.network import Network
from scenicq.recent import Recent
from scenicq.store.motion import slopes
from scenicq.store.place import StoreFile
from scenicq.store.row_block import RowBlock

__all__ = ["EGO", "RecordedTracks", "RecordingCourses"]

_KEPT = 4
"""Recordings that are kept."""
_PLACE = ("x", "y", "heading", "width", "length", "acceleration")
"""What is read of each sample of a track; the acceleration for its slope."""
EGO = ("ego", "")
"""The track of the ego."""


@dataclass(eq=False)
class RecordingCourses:
    """One recording: the samples of each track, and the courses that have been asked for.

    Attributes:
        frames: The number of the sample of each frame.
        times_s: Seconds since the first sample, shape (n,).
        tracks: By track (of the ego `EGO`) the samples in which it is seen, in order, and what is known of it there, as
            `scenicq.geometry.driven_courses.TrackStretch` has it.
    """

    frames: dict[str, int]
    times_s: NDArray[np.float64]
    tracks: dict[tuple[str, str], tuple[NDArray[np.int64], NDArray[np.float64]]]
    _known: dict[tuple[tuple[str, str], int, float], dict[int, CoursePlace]] = field(
        default_factory=dict["tuple[tuple[str, str], int, float]", "dict[int, CoursePlace]"], repr=False
    )

    def course(self, network: Network, gap_s: float, track: tuple[str, str], sample: int) -> CoursePlace | None:
        """Find the course of a track, and its place on it at a sample; None if the track is not seen there.

        Args:
            network: The map.
            gap_s: Seconds without a label at which a course is cut.
            track: The track.
            sample: The number of the sample.
        """
        key = track, id(network), gap_s
        if key not in self._known:
            samples, places = self.tracks.get(track, (np.empty(0, np.int64), np.empty((0, len(_PLACE)))))
            made = track_courses(network, self.times_s[samples], places, gap_s)
            self._known[key] = dict(zip(samples.tolist(), made, strict=True))
        return self._known[key].get(sample)


class RecordedTracks:
    """The recordings of a dataset by name."""

    def __init__(self, files: Callable[[str], tuple[StoreFile, ...]]) -> None:
        """Take the function that names the files of a table, part by part; no file is opened yet."""
        self._files = files
        self._runs: dict[str, tuple[int, int, int]] | None = None
        self._open: tuple[int, RowBlock, RowBlock] | None = None
        self._kept: Recent[str, RecordingCourses] = Recent(_KEPT)

    def of(self, recording: str) -> RecordingCourses:
        """A recording by its name."""
        return self._kept.get(recording, lambda: self._read(recording))

    def rows(self, recording: str) -> tuple[int, int, int]:
        """The part that has a recording, and the rows of its labels there, the last left out."""
        if self._runs is None:
            self._runs = self._find_runs()
        return self._runs[recording]

    def course(
        self, network: Network, gap_s: float, recording: str, frame: str, track: tuple[str, str] | None,
        place: tuple[float, float, float | None],
    ) -> CoursePlace:  # fmt: skip
        """Find the course of a label object, and its place on it.

        Args:
            network: The map.
            gap_s: Seconds without a label at which a course is cut.
            recording: The recording.
            frame: The frame.
            track: The object's track; None if it has none, so that it is seen once.
            place: Its x, y and heading.
        """
        if track is not None:
            mine = self.of(recording)
            found = mine.course(network, gap_s, track, mine.frames[frame])
            if found is not None:
                return found
        return lane_course(network, *place)

    def _read(self, recording: str) -> RecordingCourses:
        part, first, end = self.rows(recording)
        labels, objects = self._opened(part)
        rows = labels.take(np.arange(first, end))
        start = int(rows["first_object"][0].as_py())
        counts = rows["object_count"].to_numpy().astype(np.int64)
        others = objects.take(np.arange(start, start + int(counts.sum())))
        times = rows["timestamp_us"].to_numpy().astype(np.int64)
        egos = np.column_stack([rows[f"ego_{name}"].to_numpy().astype(np.float64) for name in _PLACE])
        egos[:, -1] = slopes(times, egos[:, -1], ["ego"] * len(egos))
        # in place of an ego that is absent stands a mere point to look from, of no class
        there = np.flatnonzero([bool(each) for each in rows["ego_class"].to_pylist()])
        tracks: dict[tuple[str, str], tuple[NDArray[np.int64], NDArray[np.float64]]] = {EGO: (there, egos[there])}
        sample = np.repeat(np.arange(len(counts)), counts)
        names = np.array(others["track"].to_pylist(), dtype=object)
        named = np.flatnonzero(names != None)  # noqa: E711 - element by element
        places = np.column_stack([others[name].to_numpy().astype(np.float64) for name in _PLACE])
        places[:, -1] = slopes(times[sample], places[:, -1], names.tolist())
        if len(named):
            distinct, which = np.unique(names[named].astype(str), return_inverse=True)
            order = named[np.argsort(which, kind="stable")]
            ends = np.cumsum(np.bincount(which, minlength=len(distinct)))
            for name, mine in zip(distinct.tolist(), np.split(order, ends[:-1]), strict=True):
                tracks["track", name] = sample[mine], places[mine]
        frames = {name: number for number, name in enumerate(rows["frame"].to_pylist())}
        return RecordingCourses(frames, (times - times[0]) / 1e6, tracks)

    def _opened(self, part: int) -> tuple[RowBlock, RowBlock]:
        if self._open is None or self._open[0] != part:
            if self._open is not None:
                for file in self._open[1:]:
                    file.close()
            of_labels = ["frame", "timestamp_us", "object_count", "first_object", "ego_class"]
            labels = RowBlock(self._files("labels")[part], [*of_labels, *(f"ego_{name}" for name in _PLACE)])
            self._open = part, labels, RowBlock(self._files("objects")[part], ["track", *_PLACE])
        return self._open[1:]

    def _find_runs(self) -> dict[str, tuple[int, int, int]]:
        """The part that has each recording, and the rows of its labels there, the last left out."""
        found: dict[str, tuple[int, int, int]] = {}
        for part, file in enumerate(self._files("labels")):
            with RowBlock(file, ["recording"]) as rows:
                names = np.array(rows.take(np.arange(len(rows)))["recording"].to_pylist(), dtype=object)
            cuts = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist(), len(names)]
            for first, end in pairwise(cuts):
                if first < end:
                    found[names[first]] = part, first, end
        return found
