"""Recordings of one part of a dataset, read as columns over their label objects and egos.

The *members* of a block are numbered: its label objects in the order of the store, then the ego of each of its labels.
No member at all is -1, which every column answers with nan, so that a column of members gives a column of values.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.geometry.driven_courses import GAP_S, CoursePlace, StoredCourse, lane_course
from scenicq.geometry.network import Network
from scenicq.store.dataset import Dataset
from scenicq.store.reader import COURSE_COLUMNS, course_ends
from scenicq.store.row_block import RowBlock
from scenicq.store.tracks import TrackKey

__all__ = ["TrackBlock", "TrackReach", "in_order"]

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]
_LONG = 500
"""A recording with more labels than this is read only as far as `TrackReach` asks."""
_CODED = ("class", "attributes")
"""Text columns of objects and egos. They are read as indices into the distinct texts."""


def in_order(numbers: Integers) -> Integers:
    """A stable argsort of numbers that are not negative."""
    # sorting is faster than finding the order
    size = max(len(numbers), 1)
    return np.sort(numbers * size + np.arange(len(numbers))) % size


_LOOK_EVERY = 1_024
"""Courses between two looks at the clock."""


@dataclass(frozen=True, slots=True)
class TrackReach:
    """How much of a track is asked about.

    Attributes:
        after_s: Up to the first label so many seconds after an object that is asked about.
        gap_s: Seconds without a label after which a track's life ends; what is seen so long after that tells.
        gaps: Whether labels in which it is not seen are asked about: then all of a track that has some is.
    """

    after_s: float
    gap_s: float
    gaps: bool = False


class TrackBlock:
    """Some whole recordings of one part; a context manager.

    Label objects are members only where their tracks are asked about.

    Attributes:
        runs: The first and the last label of each recording, the last left out; labels are counted from that of
            `first_label`.
        first_label: Row of the first label in its part.
        times_us: The timestamp of each label, shape (n,).
        recording_of: The number of the recording of each label, -1 for labels of none.
        object_starts: Where the members that are objects of each label begin, and where the last one's end, shape
            (n + 1,).
        label_of: The label of each member, shape (m + n + 1,).
        recorded: The tracks of the dataset's recordings.
        object_count: How many members are label objects.
        size: How many members there are: m label objects and n egos.
    """

    def __init__(
        self, dataset: Dataset, part: int, runs: Sequence[tuple[int, int]], rows: Integers | None = None,
        reach: TrackReach | None = None,
    ) -> None:  # fmt: skip
        """Open the files and read what all columns are about.

        Args:
            dataset: The dataset.
            part: Number of the part.
            runs: Rows of the labels of each recording in their part, the last left out; in order.
            rows: Rows of label objects in their part, in order, whose tracks are asked about; None for all tracks.
            reach: How much of these tracks is asked about; None for all of it.
        """
        self.recorded = dataset.recorded
        self._labels = RowBlock(dataset.files("labels")[part], texts=[f"ego_{name}" for name in _CODED])
        self._objects = RowBlock(dataset.files("objects")[part], texts=[*_CODED, "track"])
        self.first_label, self._end = runs[0][0], runs[-1][1]
        self.runs = [(first - self.first_label, end - self.first_label) for first, end in runs]
        n = self._end - self.first_label
        self._label_rows: Integers = np.arange(self.first_label, self._end)
        self.times_us: Integers = self._labels.integers("timestamp_us", self._label_rows)
        counts = self._labels.integers("object_count", self._label_rows)
        first_object = int(self._labels.integers("first_object", self._label_rows[:1])[0])
        self._named: tuple[NDArray[np.int64], list[str]] | None = None
        starts: Integers = first_object + np.concatenate(([0], np.cumsum(counts)))
        self.recording_of: Integers = np.full(n, -1)
        for number, (first, end) in enumerate(self.runs):
            self.recording_of[first:end] = number
        self._rows: Integers = np.arange(first_object, int(starts[-1]))
        if rows is not None:
            self._rows = self._track_rows(starts, rows, reach)
        self.object_starts: Integers = np.searchsorted(self._rows, starts)
        self.object_count = len(self._rows)
        self.size = self.object_count + n
        self.label_of: Integers = np.concatenate(
            (np.repeat(np.arange(n), np.diff(self.object_starts)), np.arange(n), [-1])
        )
        self._numbers: dict[str, Numbers] = {}
        self._recording_names: dict[int, str] = {}
        self._said: tuple[NDArray[np.int64], list[Mapping[str, Any]]] | None = None
        self._categories: tuple[NDArray[np.int64], list[str]] | None = None
        self._tracks: Integers | None = None
        self._id_ranks: Integers | None = None

    def _track_rows(self, starts: Integers, rows: Integers, reach: TrackReach | None) -> Integers:
        """The rows of all label objects on the tracks that are asked about, within reach.

        Args:
            starts: The row with which the objects of each label begin, and behind the last one's.
            rows: Some rows in order.
            reach: How far that is.
        """
        first = int(starts[0])
        codes, names = self._objects.codes("track", np.arange(first, int(starts[-1])))
        asked = np.zeros(len(codes), np.bool_)
        asked[rows - first] = True
        chosen = asked.copy()
        bounds = starts[np.array(self.runs).ravel()] - first
        cuts = np.searchsorted(rows - first, bounds).reshape(-1, 2)
        wanted = np.zeros(len(names) + 1, np.bool_)
        for (low, high), (begin, end) in zip(cuts.tolist(), bounds.reshape(-1, 2).tolist(), strict=True):
            if low < high:
                mine = codes[rows[low:high] - first]
                wanted[mine] = True
                # the last code stands for no track name: each such object is alone on its track
                wanted[-1] = False
                chosen[begin:end] |= wanted[codes[begin:end]]
                wanted[mine] = False
        found = np.flatnonzero(chosen)
        if reach is not None:
            label = np.searchsorted(starts - first, found, side="right") - 1
            track = self.recording_of[label] * (len(names) + 1) + codes[found]
            found = found[self._within_reach(track, label, asked[found], reach)]
        self._named = codes[found].astype(np.int64), names
        return first + found

    def _within_reach(
        self, track: Integers, label: Integers, asked: NDArray[np.bool_], reach: TrackReach
    ) -> NDArray[np.bool_]:
        """Which of some label objects are within reach of those of their tracks that are asked about.

        Those between are, too, where a track would seem not to be seen for a while that does not end its life.

        Args:
            track: The number of the track of each.
            label: The label of each, in order.
            asked: Which are asked about.
            reach: How far.
        """
        lengths = np.array([end - first for first, end in self.runs])
        long = np.flatnonzero((lengths > _LONG)[self.recording_of[label]])
        found = np.ones(len(track), np.bool_)
        if not len(long):
            return found
        order = long[in_order(track[long])]
        places, own, time = np.arange(len(order)), asked[order], self.times_us[label[order]]
        heads = np.append(True, np.diff(track[order]) != 0)
        before = np.maximum.accumulate(np.where(own | heads, places, 0))
        lasts = np.append(heads[1:], True)
        after = np.minimum.accumulate(np.where(own | lasts, places, len(order))[::-1])[::-1]
        gap_us = round(reach.gap_s * 1e6)
        last = self.labels_after(np.arange(len(self)), reach.after_s)
        ends = np.append(self.times_us, np.iinfo(np.int64).max - gap_us)[last]
        end = ends[label[order][before]] + gap_us
        near = own[before] & ((time <= end) | (own[after] & (time[after] - end <= gap_us)))
        if reach.gaps:
            number = np.cumsum(heads) - 1
            unseen = ~heads & (np.diff(label[order], prepend=-1) > 1)
            near |= (np.bincount(number, unseen) > 0)[number]
        found[order] = near
        return found

    def labels_after(self, labels: Integers, time_s: float) -> Integers:
        """For each label, the first one of its recording at least `time_s` later; `len(self)` if there is none.

        Args:
            labels: The labels.
            time_s: The seconds, of which a millionth may be missing.
        """
        time_us, first_us = round(min(time_s, 1e6) * 1e6), int(self.times_us.min(initial=0))
        known = np.flatnonzero(self.recording_of >= 0)
        # whole numbers that grow from label to label
        whole = int(self.times_us.max(initial=0)) - first_us + time_us + 2
        time = self.times_us - first_us + self.recording_of * whole
        found = np.append(known, len(self))[np.searchsorted(time[known], time[labels] + time_us - 1)]
        other = np.append(self.recording_of, -1)[found] != self.recording_of[labels]
        return np.where(other, len(self), found)

    def __enter__(self) -> TrackBlock:
        """It is open."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the files."""
        self._labels.close()
        self._objects.close()

    def __len__(self) -> int:
        """The number of labels."""
        return len(self.times_us)

    def ego(self, labels: Integers) -> Integers:
        """The egos of labels."""
        return labels + self.object_count

    def present_ego(self, labels: Integers) -> Integers:
        """The egos of labels; nobody where a label has none."""
        codes, classes = self.categories()
        there = np.array([*map(bool, classes), False])[codes[self.ego(labels)]]
        return np.where(there, self.ego(labels), -1)

    def is_ego(self, member: int) -> bool:
        """Whether a member is the ego of its label."""
        return member >= self.object_count

    def are_egos(self, members: Integers) -> bool:
        """Whether members are egos of their labels, or nobody."""
        return bool(((members >= self.object_count) | (members < 0)).all())

    def members(self, rows: Integers) -> Integers:
        """The members in some rows of `objects`, which must be among those that were read."""
        return np.searchsorted(self._rows, rows)

    def numbers(self, name: str) -> Numbers:
        """A column of `objects` and that of the egos, by member; nan where there is no value."""
        if name not in self._numbers:
            objects, own = self._objects.numbers(name, self._rows), f"ego_{name}"
            there = own in self._labels
            egos = self._labels.numbers(own, self._label_rows) if there else np.full(len(self), np.nan)
            self._numbers[name] = np.concatenate((objects, egos, [np.nan]))
        return self._numbers[name]

    def said(self) -> tuple[NDArray[np.int64], list[Mapping[str, Any]]]:
        """For each member an index into the distinct attributes, and these."""
        if self._said is None:
            codes, texts = self._member_codes("attributes")
            self._said = np.append(codes, len(texts)).astype(np.int64), [*map(json.loads, texts), {}]
        return self._said

    def categories(self) -> tuple[NDArray[np.int64], list[str]]:
        """For each member the number of its class, and the classes."""
        if self._categories is None:
            self._categories = self._member_codes("class")
        return self._categories

    def _member_codes(self, name: str) -> tuple[NDArray[np.int64], list[str]]:
        """By member the number of its text, and the texts; null has the number behind the last."""
        objects, texts = self._objects.codes(name, self._rows)
        egos, own = self._labels.codes(f"ego_{name}", self._label_rows)
        both = list(dict.fromkeys((*texts, *own)))
        number = {text: place for place, text in enumerate(both)}
        parts = [
            np.array([*map(number.__getitem__, mine), len(both)])[codes]
            for codes, mine in ((objects, texts), (egos, own))
        ]
        return np.concatenate(parts), both

    def tracks(self, members: Integers) -> Integers:
        """The tracks of members, as numbers: equal for those of one track, unlike for those of two recordings."""
        if self._tracks is None:
            codes, names = self._names()
            recordings = self.recording_of[self.label_of[: self.object_count]]
            known = recordings * len(names) + codes
            # a label object without a track is one of its own, as is one of a recording that is not among these, such
            # as of another map; so is the ego of a recording
            alone = np.arange(self.object_count) + len(self.runs) * (len(names) + 1)
            objects = np.where((codes < len(names)) & (recordings >= 0), known, alone)
            # so is what a label without an ego has in its place, which is a mere point to look from
            there = (self.present_ego(np.arange(len(self))) >= 0) & (self.recording_of >= 0)
            nobody = int(alone[-1] + 1 if self.object_count else len(self.runs) * (len(names) + 1)) + np.arange(
                len(there)
            )
            egos = np.where(there, len(self.runs) * len(names) + self.recording_of, nobody)
            self._tracks = np.concatenate((objects, egos))
        return self._tracks[members]

    def tracked(self, members: Integers) -> bool:
        """Whether all these label objects have tracks with names."""
        return bool((self.tracks(members) < len(self.runs) * (len(self._names()[1]) + 1)).all())

    def ranks(self, members: Integers) -> Integers:
        """The rank of each member's track by name. All members have named tracks in one recording."""
        names = np.array(self._names()[1], dtype=object)
        order = np.empty(len(names) + 1, np.int64)
        order[np.argsort(names, kind="stable")] = np.arange(len(names))
        return order[self.tracks(members) % max(len(names), 1)]

    def id_ranks(self) -> Integers:
        """For each member the rank of its id among all ids of the block, as texts; shape (m + n + 1,)."""
        if self._id_ranks is None:
            names = np.array([*self._objects.texts("id", self._rows), "ego"], dtype=object)
            ranks = np.unique(names, return_inverse=True)[1].astype(np.int64)
            self._id_ranks = np.concatenate((ranks[:-1], np.full(len(self), ranks[-1]), [-1]))
        return self._id_ranks

    def mates(self, wanted: Integers) -> Integers:
        """The members of some tracks, in order; `wanted` are track numbers in order, each once."""
        every = self.tracks(np.arange(self.size))
        if not len(wanted):
            return np.empty(0, np.int64)
        among = np.zeros(int(max(every.max(initial=0), wanted[-1])) + 1, dtype=np.bool_)
        among[wanted] = True
        return np.flatnonzero(among[every])

    def key(self, member: int) -> TrackKey:
        """The track of a member by its name."""
        if self.is_ego(member):
            return ("ego", "")
        codes, names = self._names()
        if codes[member] < len(names):
            return ("track", names[int(codes[member])])
        return ("object", f"{self.frame(int(self.label_of[member]))}\n{self.id(member)}")

    def keys(self, members: Integers) -> list[TrackKey]:
        """The tracks of members by their names."""
        _, firsts, which = np.unique(self.tracks(members), return_index=True, return_inverse=True)
        known = [self.key(each) for each in members[firsts].tolist()]
        return [known[each] for each in which.tolist()]

    def courses(self, members: Integers, network: Network, gap_s: float) -> list[CoursePlace | None]:
        """Find the course of each member, and its place on it; None for nobody.

        Args:
            members: The members.
            network: The map.
            gap_s: Seconds without a label at which a course is cut.
        """
        found: list[CoursePlace | None] = [None] * len(members)
        labels = self.label_of[members]
        for place in np.argsort(self.recording_of[np.maximum(labels, 0)], kind="stable").tolist():
            if members[place] < 0:
                continue
            if place % _LOOK_EVERY == 0:
                look()
            member = int(members[place])
            make = partial(self._course, member, network, gap_s)
            if member < self.object_count or gap_s != GAP_S:
                found[place] = make()
            else:
                found[place] = StoredCourse(partial(self._on_ego_course, int(labels[place])), make)
        return found

    def _course(self, member: int, network: Network, gap_s: float) -> CoursePlace:
        """The course of a member, made of the samples of its track."""
        label = int(self.label_of[member])
        number, track = int(self.recording_of[label]), self.key(member)
        seen = None
        if track[0] != "object":
            courses = self.recorded.of(self.name(number))
            seen = courses.course(network, gap_s, track, label - self.runs[number][0])
        return seen or lane_course(network, *self._place(member))

    def _on_ego_course(self, label: int) -> Mapping[tuple[float, float], tuple[float, float, float, float]]:
        """Where the objects of a label are on its ego's course, by their places."""
        rows = slice(int(self.object_starts[label]), int(self.object_starts[label + 1]))
        x, y = (self.numbers(name)[rows].tolist() for name in ("x", "y"))
        ends = course_ends([self.numbers(name)[rows] for name in COURSE_COLUMNS])
        return dict(zip(zip(x, y, strict=True), ends, strict=True))

    def _place(self, member: int) -> tuple[float, float, float | None]:
        x, y, heading = (float(self.numbers(name)[member]) for name in ("x", "y", "heading"))
        return x, y, None if math.isnan(heading) else heading

    def _names(self) -> tuple[NDArray[np.int64], list[str]]:
        """By label object the number of its track's name, and the names."""
        if self._named is None:
            codes, names = self._objects.codes("track", self._rows)
            self._named = codes.astype(np.int64), names
        return self._named

    def id(self, member: int) -> str:
        """The id of a label object."""
        return self._objects.texts("id", self._rows[member : member + 1])[0]

    def ids(self) -> list[str]:
        """The id of each label object."""
        return self._objects.texts("id", self._rows)

    def track_names(self) -> list[str | None]:
        """The name of the track of each label object; None where it has none."""
        codes, names = self._names()
        named = [*names, None]
        return [named[min(code, len(names))] for code in codes.tolist()]

    def frame(self, label: int) -> str:
        """The name of a label's frame."""
        return self.frames(np.array([label]))[0]

    def frames(self, labels: Integers) -> list[str]:
        """The names of labels' frames."""
        return self._labels.texts("frame", self.first_label + labels)

    def name(self, recording: int) -> str:
        """The name of a recording."""
        if recording not in self._recording_names:
            first = np.array([self.first_label + self.runs[recording][0]])
            self._recording_names[recording] = self._labels.texts("recording", first)[0]
        return self._recording_names[recording]

    def seconds(self, label: int) -> float:
        """The time of a label since the first of its recording."""
        first, _ = self.runs[int(self.recording_of[label])]
        return float((self.times_us[label] - self.times_us[first]) / 1e6)
