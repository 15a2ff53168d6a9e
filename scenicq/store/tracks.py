"""A recording by track: the values of each label object over all samples, as columns."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.geometry.driven_courses import CoursePlace
from scenicq.geometry.network import Network
from scenicq.store.dataset import Dataset
from scenicq.store.reader import LAST, MOTION_COLUMNS
from scenicq.store.recorded_tracks import RecordedTracks
from scenicq.store.row_block import RowBlock
from scenicq.store.schema import ArrowTable

__all__ = ["RecordingTracks", "TrackKey", "TrackReader"]

TrackKey: TypeAlias = tuple[str, str]
"""("ego", ""), ("track", its name), or ("object", frame and id) for a label object without a track."""

_NUMBERS = ("x", "y", "heading", "width", "length", "height", *MOTION_COLUMNS[:-1], LAST)
Numbers = NDArray[np.float64]


@dataclass(eq=False)
class RecordingTracks:
    """One recording by track.

    Attributes:
        name: The recording's name.
        frames: Names of its frames, in order of time.
        times_us: Their timestamps, shape (n,).
        labels, objects: Their rows of the tables.
        recorded: What has the courses of tracks.
    """

    name: str
    frames: list[str]
    times_us: NDArray[np.int64]
    labels: ArrowTable = field(repr=False)
    objects: ArrowTable = field(repr=False)
    recorded: RecordedTracks = field(repr=False)

    def __post_init__(self) -> None:
        """Find the rows of each track."""
        self.seconds: Numbers = (self.times_us - (self.times_us[0] if len(self.times_us) else 0)) / 1e6
        counts = self.labels["object_count"].to_numpy().astype(np.int64)
        self._sample = np.repeat(np.arange(len(counts)), counts)
        self._rows: dict[TrackKey, list[int]] = {}
        tracks, ids = self.objects["track"].to_pylist(), self.objects["id"].to_pylist()
        for row, (track, id_, sample) in enumerate(zip(tracks, ids, self._sample.tolist(), strict=True)):
            key = ("object", f"{self.frames[sample]}\n{id_}") if track is None else ("track", track)
            self._rows.setdefault(key, []).append(row)
        self._numbers: dict[str, Numbers] = {}
        self._columns: dict[tuple[TrackKey, str], Numbers] = {}
        self._said: dict[TrackKey, list[Mapping[str, Any]]] = {}

    def __len__(self) -> int:
        """The number of samples."""
        return len(self.frames)

    def key(self, name: str) -> TrackKey:
        """The track with a name, or the label object with that id that has no track."""
        found = ("track", name)
        if found in self._rows:
            return found
        return next((key for key in self._rows if key[0] == "object" and key[1].endswith(f"\n{name}")), found)

    def column(self, track: TrackKey, name: str) -> Numbers:
        """The values of a column of `objects` over all samples, shape (n,); nan where there is none."""
        key = track, name
        if key not in self._columns:
            if track[0] == "ego":
                # in place of an ego that is absent stands a mere point to look from, of no class
                there = np.array([bool(each) for each in self.labels["ego_class"].to_pylist()], dtype=np.bool_)
                self._columns[key] = np.where(there, _reals(self.labels[f"ego_{name}"]), np.nan)
            else:
                if name not in self._numbers:
                    self._numbers[name] = _reals(self.objects[name])
                rows = self._rows.get(track, [])
                values = np.full(len(self.frames), np.nan)
                values[self._sample[rows]] = self._numbers[name][rows]
                self._columns[key] = values
        return self._columns[key]

    def course(self, track: TrackKey, sample: int, network: Network, gap_s: float) -> CoursePlace | None:
        """Find the course of a track, and its place on it at a sample; None if the track is not seen there.

        Args:
            track: The track.
            sample: The sample.
            network: The map.
            gap_s: Seconds without a label at which a course is cut.
        """
        x, y, heading = (float(self.column(track, name)[sample]) for name in ("x", "y", "heading"))
        if np.isnan(x):
            return None
        named = None if track[0] == "object" else track
        place = x, y, None if np.isnan(heading) else heading
        return self.recorded.course(network, gap_s, self.name, self.frames[sample], named, place)

    def attributes(self, track: TrackKey) -> list[Mapping[str, Any]]:
        """The attributes at each sample; empty where the track is not observed."""
        if track not in self._said:
            said: list[Mapping[str, Any]] = [{}] * len(self.frames)
            texts = self.labels["ego_attributes"] if track[0] == "ego" else self.objects["attributes"]
            rows = range(len(self.frames)) if track[0] == "ego" else self._rows.get(track, [])
            for row in rows:
                text = texts[row].as_py()
                said[row if track[0] == "ego" else int(self._sample[row])] = {} if text is None else json.loads(text)
            self._said[track] = said
        return self._said[track]


class TrackReader:
    """Reads recordings of one part of a dataset, one after the other; a context manager."""

    def __init__(self, dataset: Dataset, part: int) -> None:
        """Open the files.

        Args:
            dataset: The dataset.
            part: Number of the part.
        """
        self._recorded = dataset.recorded
        prefixed = [f"ego_{name}" for name in (*_NUMBERS, "attributes")]
        self._labels = RowBlock(
            dataset.files("labels")[part],
            ["frame", "recording", "timestamp_us", "object_count", "first_object", "ego_class", *prefixed],
        )
        self._objects = RowBlock(dataset.files("objects")[part], ["id", "track", "attributes", *_NUMBERS])

    def __enter__(self) -> TrackReader:
        """Nothing is read yet."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the files."""
        self._labels.close()
        self._objects.close()

    def names(self, rows: Sequence[int]) -> list[str]:
        """The recordings of some rows of `labels`, in order."""
        return self._labels.take(np.array(rows, dtype=np.int64))["recording"].to_pylist()

    def read(self, first: int, end: int) -> RecordingTracks:
        """The recording whose labels are in some rows, the end left out."""
        labels = self._labels.take(np.arange(first, end))
        start = labels["first_object"][0].as_py()
        count = int(labels["object_count"].to_numpy().astype(np.int64).sum())
        return RecordingTracks(
            labels["recording"][0].as_py(),
            labels["frame"].to_pylist(),
            labels["timestamp_us"].to_numpy().astype(np.int64),
            labels,
            self._objects.take(np.arange(start, start + count)),
            self._recorded,
        )


def _reals(column: pa.ChunkedArray) -> Numbers:
    """Null becomes nan."""
    return column.to_numpy().astype(np.float64)
