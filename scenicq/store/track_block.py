"""Recordings of one part side by side: columns over all label objects, and where each track is seen.

The *members* of a block are numbered: its label objects in the order of the store, then the ego of each of its labels.
No member at all is -1, which every column answers with nan, so that a column of members gives a column of values.
"""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.store.dataset import Dataset
from scenicq.store.place import StoreFile, open_parquet
from scenicq.store.schema import ArrowTable
from scenicq.store.tracks import TrackKey

__all__ = ["TrackBlock"]

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]
_CODED = ("class", "attributes")
"""Columns of texts, of objects and egos, that are read as numbers of distinct ones."""


class _Columns:
    """Columns of some rows of a file, each read when it is asked for."""

    def __init__(self, file: StoreFile, texts: Sequence[str]) -> None:
        # few distinct texts, which the file has as a dictionary
        self._file = open_parquet(file, read_dictionary=[*texts])
        metadata = self._file.metadata
        sizes = [metadata.row_group(group).num_rows for group in range(self._file.num_row_groups)]
        self._starts = np.cumsum([0, *sizes])

    def close(self) -> None:
        self._file.close()

    def read(self, names: Sequence[str], first: int, end: int) -> ArrowTable:
        """Columns of the rows from `first` to `end`, the end left out."""
        low = int(np.searchsorted(self._starts, first, side="right")) - 1
        high = max(low + 1, int(np.searchsorted(self._starts, end)))
        groups = range(max(low, 0), min(high, len(self._starts) - 1))
        found = self._file.read_row_groups([*groups], columns=[*names], use_threads=False)
        return found.slice(first - int(self._starts[max(low, 0)]), end - first)


class TrackBlock:
    """Some whole recordings of one part; a context manager.

    Attributes:
        runs: The first and the last label of each recording, the last left out; labels are counted from that of
            `first_label`.
        first_label: Row of the first label in its part.
        times_us: Of each label, shape (n,).
        recording_of: The number of the recording of each label, -1 for labels of none.
        object_starts: Where the objects of each label begin, and where the last one's end, shape (n + 1,).
        label_of: The label of each member, shape (m + n + 1,).
        size: How many members there are: m label objects and n egos.
    """

    def __init__(self, dataset: Dataset, part: int, runs: Sequence[tuple[int, int]]) -> None:
        """Open the files and read what all columns are about.

        Args:
            dataset: The dataset.
            part: Number of the part.
            runs: Rows of the labels of each recording in their part, the last left out; in order.
        """
        self._labels = _Columns(dataset.files("labels")[part], [f"ego_{name}" for name in _CODED])
        self._objects = _Columns(dataset.files("objects")[part], [*_CODED, "track"])
        self.first_label, self._end = runs[0][0], runs[-1][1]
        self.runs = [(first - self.first_label, end - self.first_label) for first, end in runs]
        n = self._end - self.first_label
        columns = self._labels.read(["timestamp_us", "object_count", "first_object"], self.first_label, self._end)
        self.times_us: Integers = columns["timestamp_us"].to_numpy().astype(np.int64)
        counts = columns["object_count"].to_numpy().astype(np.int64)
        self._first_object = int(columns["first_object"][0].as_py())
        self.object_starts: Integers = np.concatenate(([0], np.cumsum(counts)))
        self._m = int(self.object_starts[-1])
        self.size = self._m + n
        self.label_of: Integers = np.concatenate((np.repeat(np.arange(n), counts), np.arange(n), [-1]))
        self.recording_of: Integers = np.full(n, -1)
        for number, (first, end) in enumerate(self.runs):
            self.recording_of[first:end] = number
        self._numbers: dict[str, Numbers] = {}
        self._said: tuple[NDArray[np.int64], list[Mapping[str, Any]]] | None = None
        self._categories: tuple[NDArray[np.int64], list[str]] | None = None
        self._texts: dict[str, Any] = {}
        self._tracks: Integers | None = None
        self._named: tuple[NDArray[np.int64], list[str]] | None = None

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
        return labels + self._m

    def is_ego(self, member: int) -> bool:
        """Whether a member is the ego of its label."""
        return member >= self._m

    def row(self, member: int) -> int:
        """The row of a label object in its part."""
        return self._first_object + member

    def members(self, rows: Integers) -> Integers:
        """The label objects that are in some rows of their part."""
        return rows - self._first_object

    def numbers(self, name: str) -> Numbers:
        """A column of `objects` and that of the egos, by member; nan where there is no value."""
        if name not in self._numbers:
            objects, egos = self._pair(name)
            self._numbers[name] = np.concatenate((_reals(objects), _reals(egos), [np.nan]))
        return self._numbers[name]

    def said(self) -> tuple[NDArray[np.int64], list[Mapping[str, Any]]]:
        """What labels say beside the columns: by member the number of one of the distinct answers, and these."""
        if self._said is None:
            objects, egos = self._pair("attributes")
            codes, texts = _codes(pa.chunked_array([*objects.chunks, *egos.chunks]))
            self._said = np.append(codes, len(texts)).astype(np.int64), [*map(json.loads, texts), {}]
        return self._said

    def categories(self) -> tuple[NDArray[np.int64], list[str]]:
        """By member the number of its class, and the classes."""
        if self._categories is None:
            objects, egos = self._pair("class")
            self._categories = _codes(pa.chunked_array([*objects.chunks, *egos.chunks]))
        return self._categories

    def tracks(self, members: Integers) -> Integers:
        """The tracks of members, as numbers: equal for those of one track, unlike for those of two recordings."""
        if self._tracks is None:
            codes, names = self._names()
            recordings = self.recording_of[self.label_of[: self._m]]
            known = recordings * len(names) + codes
            # a label object without a track is one of its own; so is the ego of a recording
            alone = np.arange(self._m) + len(self.runs) * (len(names) + 1)
            objects = np.where(codes < len(names), known, alone)
            # so is what a label without an ego has in its place, which is a mere point to look from
            codes, classes = self.categories()
            there = np.array([*map(bool, classes), False])[codes[self._m :]]
            nobody = int(alone[-1] + 1 if self._m else len(self.runs) * (len(names) + 1)) + np.arange(len(there))
            egos = np.where(there, len(self.runs) * len(names) + self.recording_of, nobody)
            self._tracks = np.concatenate((objects, egos))
        return self._tracks[members]

    def tracked(self, members: Integers) -> bool:
        """Whether all these label objects have tracks with names."""
        return bool((self.tracks(members) < len(self.runs) * (len(self._names()[1]) + 1)).all())

    def ranks(self, members: Integers) -> Integers:
        """The order of the tracks of members of one recording by name; all of them have one."""
        names = np.array(self._names()[1], dtype=object)
        order = np.empty(len(names) + 1, np.int64)
        order[np.argsort(names, kind="stable")] = np.arange(len(names))
        return order[self.tracks(members) % max(len(names), 1)]

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

    def _names(self) -> tuple[NDArray[np.int64], list[str]]:
        """By label object the number of its track's name, and the names."""
        if self._named is None:
            self._named = _codes(self._objects_column("track"))
        return self._named

    def id(self, member: int) -> str:
        """The id of a label object."""
        return self._text("id")[member].as_py()

    def frame(self, label: int) -> str:
        """The name of a label's frame."""
        return self._label_text("frame")[label].as_py()

    def name(self, recording: int) -> str:
        """The name of a recording."""
        return self._label_text("recording")[self.runs[recording][0]].as_py()

    def seconds(self, label: int) -> float:
        """The time of a label since the first of its recording."""
        first, _ = self.runs[int(self.recording_of[label])]
        return float((self.times_us[label] - self.times_us[first]) / 1e6)

    def _text(self, name: str) -> Any:
        if name not in self._texts:
            self._texts[name] = self._objects_column(name)
        return self._texts[name]

    def _label_text(self, name: str) -> Any:
        if name not in self._texts:
            self._texts[name] = self._labels.read([name], self.first_label, self._end)[name]
        return self._texts[name]

    def _objects_column(self, name: str) -> Any:
        return self._objects.read([name], self._first_object, self._first_object + self._m)[name]

    def _pair(self, name: str) -> tuple[Any, Any]:
        egos = self._labels.read([f"ego_{name}"], self.first_label, self._end)[f"ego_{name}"]
        return self._objects_column(name), egos


def _codes(column: Any) -> tuple[NDArray[np.int64], list[str]]:
    """Numbers of distinct texts, and these; null has the number behind the last."""
    encoded = column if pa.types.is_dictionary(column.type) else column.dictionary_encode()
    encoded = encoded.unify_dictionaries().combine_chunks()
    if isinstance(encoded, pa.ChunkedArray):
        encoded = encoded.chunk(0) if encoded.num_chunks else pa.array([], pa.string()).dictionary_encode()
    texts: list[str] = encoded.dictionary.to_pylist()
    return encoded.indices.fill_null(len(texts)).to_numpy(zero_copy_only=False).astype(np.int64), texts


def _reals(column: Any) -> Numbers:
    """Null becomes nan."""
    return column.to_numpy().astype(np.float64, copy=False)
