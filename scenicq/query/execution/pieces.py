"""Running a query piece by piece: the pieces of a dataset, their files, and putting them together.

A piece is a run of recordings in the order of a query, so the pieces of a dataset are the same for everybody who
asks for the same number. Each finished piece is one file, written under a temporary name and renamed; whoever runs
again does what is missing. Any launcher will do: a loop, xargs, an array of cluster jobs.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby, pairwise
from operator import itemgetter
from typing import Any

import msgspec
from msgspec import Struct

from scenicq.errors import DataError, Diagnostic
from scenicq.query.execution.records import Record, SummaryRecord, decode_record, json_text
from scenicq.query.execution.result_summary import ResultCount, ResultSummary, join_summaries, refuse_newer
from scenicq.query.execution.results import Funnel
from scenicq.query.execution.run import Query, QueryOptions, RecordingRange
from scenicq.query.execution.skipped_frames import summarize
from scenicq.store.atomic_files import whole_file
from scenicq.store.dataset import Dataset
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

__all__ = ["DatasetPiece", "GatheredPieces", "find_finished", "fingerprint", "gather", "partitions", "write_piece"]


@dataclass(frozen=True, slots=True)
class DatasetPiece:
    """One piece of a dataset.

    Attributes:
        number: From 0.
        count: How many pieces there are.
        recordings: Its recordings of each map.
    """

    number: int
    count: int
    recordings: Mapping[str, RecordingRange]

    @property
    def frames(self) -> int:
        """How many frames it holds."""
        return sum(stretch.frames for stretch in self.recordings.values())


def partitions(dataset: Dataset, count: int) -> tuple[DatasetPiece, ...]:
    """At most `count` pieces of about the same number of frames; fewer where the dataset has fewer recordings.

    One after the other they hold the frames in the order in which a query finds them: map by map.
    """
    with contextlib.closing(dataset.connect()) as connection:
        rows = connection.execute("SELECT map, recording, count(*) FROM labels GROUP BY ALL").fetchall()
    runs: list[tuple[str, str, int]] = sorted(rows)
    total = sum(frames for *_, frames in runs)
    cuts = [0]
    seen = 0
    for number, (*_, frames) in enumerate(runs, 1):
        seen += frames
        if seen * count >= total * len(cuts) or number == len(runs):
            cuts.append(number)
    pieces = [runs[low:high] for low, high in pairwise(cuts) if high > low]
    return tuple(DatasetPiece(number, len(pieces), _ranges(piece)) for number, piece in enumerate(pieces))


def _ranges(runs: Sequence[tuple[str, str, int]]) -> dict[str, RecordingRange]:
    found: dict[str, RecordingRange] = {}
    for name, group in groupby(runs, key=itemgetter(0)):
        inside = list(group)
        found[name] = RecordingRange(inside[0][1], inside[-1][1], sum(frames for *_, frames in inside))
    return found


def fingerprint(dataset: Dataset, program: str, options: QueryOptions) -> str:
    """A name for the question: pieces of another program, dataset or other options never mix."""
    tables = {name: [part.sha256 for part in parts] for name, parts in dataset.manifest.tables.items()}
    asked = asdict(options)
    asked["match"]["enforce"] = sorted(asked["match"]["enforce"])
    asked["match"]["ignore_params"] = sorted(asked["match"]["ignore_params"])
    if options.selects:
        # of the matches that are shown, which is seen to afterwards
        asked["limit"] = None
    for name in ("jobs", "prefilter", "strict", "until", "where", "sort", "timelines"):
        asked.pop(name)
    if "record" in program:
        # versions before have left out what is recorded
        asked["recorded"] = True
    if options.timelines and re.search(r"\b(behavior|monitor|scenario)\b", program):
        # and what roles do from when to when
        asked["timelines"] = True
    text = json.dumps([tables, program, asked], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _name(question: str, number: int, count: int) -> str:
    return f"{question}-{number:05}-of-{count:05}.jsonl"


def find_finished(folder: AnyPath, question: str, pieces: Iterable[DatasetPiece]) -> frozenset[int]:
    """The numbers of the pieces that are finished."""
    there = {path.name for path in _files(folder)}
    return frozenset(each.number for each in pieces if _name(question, each.number, each.count) in there)


def _files(folder: AnyPath) -> list[AnyPath]:
    """The files of finished pieces, by name; elsewhere all of them cost one request, or few."""
    return sorted(folder.glob("*-of-*.jsonl"), key=lambda path: path.name)


def write_piece(
    folder: AnyPath, question: str, piece: DatasetPiece, records: Iterable[Record], query: Query
) -> AnyPath:
    """Write a finished piece: one line a record, the funnel and the summary last.

    Args:
        folder: Where the pieces are, made if need be; here or elsewhere.
        question: Its `fingerprint`.
        piece: Which piece.
        records: Its results, in order.
        query: The query of the piece; its counts are complete once the records are taken.

    Raises:
        DataError: target-unwritable.
    """
    target = folder / _name(question, piece.number, piece.count)
    try:
        with target_of(folder).made_folder(), whole_file(target) as file:
            counted = ResultCount()
            for each in counted.counted(records):
                file.write((json_text(each) + "\n").encode())
            counts = {name: getattr(query.funnel, name) for name in (*_COUNTS, *_LATER)}
            summary = msgspec.to_builtins(summarize(query, counted))
            file.write((json.dumps({"funnel": counts, "summary": summary}) + "\n").encode())
    except OSError as error:
        raise DataError(Diagnostic("target-unwritable", f"{target} cannot be written: {error.strerror}")) from None
    return target


_COUNTS = ("frames", "candidates", "with_roles", "matches", "unknowns", "excluded", "reasons", "over_time", "broken")
_LATER = ("unrecorded",)
"""Counts that older versions have not written."""


@dataclass(frozen=True, slots=True)
class GatheredPieces:
    """The pieces of one question, put together.

    Attributes:
        question: Its fingerprint.
        files: Their files, in order.
        funnel: Their counts, added up.
        summary: What they say of themselves; None where one says nothing, as those of older versions.
    """

    question: str
    files: tuple[AnyPath, ...]
    funnel: Funnel
    summary: ResultSummary | None

    def records(self) -> Iterator[Record]:
        """The results in the order of the dataset, one piece in memory at a time."""
        for path in self.files:
            yield from _piece(path).records


class _Counts(Struct, frozen=True):
    """The last line of a piece."""

    funnel: dict[str, int | dict[str, int]]
    summary: ResultSummary | None = None


@dataclass(frozen=True, slots=True)
class _Piece:
    records: list[Record]
    funnel: Funnel
    summary: ResultSummary | None


def _piece(path: AnyPath) -> _Piece:
    """The results in a file, and what was counted."""
    try:
        *lines, last = path.read_bytes().splitlines() or [b""]
        refuse_newer(str(path), last)
        counts = msgspec.json.decode(last, type=_Counts)
        there = (*_COUNTS, *(name for name in _LATER if name in counts.funnel))
        funnel = Funnel(**{name: _counted(counts.funnel[name]) for name in there})
        records = [each for line in lines if not isinstance(each := decode_record(line), SummaryRecord)]
        return _Piece(records, funnel, counts.summary)
    except (OSError, KeyError, RecursionError, msgspec.DecodeError):
        raise DataError(Diagnostic("store-damaged", f"{path} is not a complete piece of a result",
                                   hints=("delete it and run its shard again",))) from None  # fmt: skip


def _counted(value: int | dict[str, int]) -> Any:
    return Counter(value) if isinstance(value, dict) else value


def gather(folder: AnyPath, question: str | None = None, *, only: int | None = None) -> GatheredPieces:
    """Put the pieces in a folder together.

    Args:
        folder: Where the pieces are.
        question: Which question's; there must be only one if not given.
        only: The number of a single piece, from 0; all of them by default.

    Raises:
        DataError: file-missing, naming the pieces that are missing; file-invalid for pieces of several questions;
            results-version for those that a newer program wrote.
    """
    found = _files(folder)
    questions = sorted({path.name.rsplit("-", 3)[0] for path in found})
    if question is None and len(questions) > 1:
        raise DataError(Diagnostic("file-invalid", f"{folder} holds pieces of {len(questions)} different questions",
                                   hints=("gather each from a folder of its own",)))  # fmt: skip
    chosen = question or next(iter(questions), "")
    found = [path for path in found if path.name.startswith(f"{chosen}-{'' if only is None else f'{only:05}-'}")]
    if not found:
        raise DataError(Diagnostic("file-missing", f"{folder} holds no piece of a result",
                                   hints=("run `scenicq match ... --shard i/n -o` with this folder",)))  # fmt: skip
    counts = {int(path.stem.rsplit("-", 1)[1]) for path in found}
    count = max(counts)
    there = {path.name for path in found}
    missing = [str(n + 1) for n in range(count) if _name(chosen, n, count) not in there]
    if only is None and (missing or len(counts) > 1):
        shown = ", ".join(missing[:10]) + (" ..." if len(missing) > 10 else "")
        raise DataError(Diagnostic("file-missing", f"{len(missing)} of {count} pieces are missing: {shown}",
                                   hints=("run their shards again",)))  # fmt: skip
    total = Funnel()
    summaries: list[ResultSummary | None] = []
    for path in found:
        piece = _piece(path)
        total.add(piece.funnel)
        summaries.append(piece.summary)
    known = [each for each in summaries if each is not None]
    return GatheredPieces(chosen, tuple(found), total, join_summaries(known) if len(known) == len(summaries) else None)
