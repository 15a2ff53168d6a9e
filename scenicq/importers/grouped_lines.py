"""JSON lines of several files, grouped by recording in bounded memory.

Labels of one recording need not be together. A first pass notes where the lines of each recording lie, run by run of
neighbouring lines; whoever reads a recording jumps there. Files in which one cannot jump (gzip, Parquet) are first
unpacked into a scratch folder.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import re
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, cast

import pyarrow as pa
import pyarrow.parquet as pq

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.fields import InvalidError, parse_json
from scenicq.importers.report import Report
from scenicq.store.unpacked import RECORD_BYTES, Bound, check_claims, decoded_bytes, text_columns

__all__ = ["GroupedLines", "LineBounds", "Runs", "group_lines"]

Runs = tuple[int, ...]
"""Runs of neighbouring lines, four numbers each: file, number of the first line, its offset, offset of the end."""

_KEY = re.compile(rb'"recording"\s*:\s*"([^"\\]*)"')


@dataclass(frozen=True, slots=True)
class LineBounds:
    """What a file of lines may be.

    Attributes:
        longest: Bytes of a line; a label of a hundred thousand objects has a third of that.
        empty: Empty lines.
    """

    longest: int = 1 << 26
    empty: int = 1_000_000


@dataclass(frozen=True, slots=True)
class GroupedLines:
    """Where the lines of some recordings lie; can be pickled.

    Attributes:
        files: Files that one can jump in, with their names in messages.
        runs: Runs of lines, by recording.
    """

    files: tuple[tuple[Path, str], ...]
    runs: Mapping[str, Runs] = field(repr=False)

    def of(self, recordings: Sequence[str]) -> GroupedLines:
        """Select some recordings."""
        return GroupedLines(self.files, {name: self.runs[name] for name in recordings})

    def read(self, recording: str) -> Iterator[tuple[bytes, str]]:
        """The lines of a recording with their places, `file:line`, in the order of the files.

        Raises:
            DataError: `file-missing` for a file that has gone since.
        """
        runs = self.runs[recording]
        for first in range(0, len(runs), 4):
            number, line, start, end = runs[first : first + 4]
            path, name = self.files[number]
            try:
                with path.open("rb") as file:
                    file.seek(start)
                    content = file.read(end - start)
            except OSError as error:
                raise _unreadable(path, error) from error
            for count, text in enumerate(content.removesuffix(b"\n").split(b"\n")):
                yield text, f"{name}:{line + count}"


@dataclass(slots=True)
class _Found:
    runs: array[int] = field(default_factory=lambda: array("q"))
    digest: Any = field(default_factory=lambda: hashlib.blake2b(digest_size=16))
    size: int = 0


def group_lines(
    files: Sequence[Path], scratch: Path | None, report: Report, bounds: LineBounds | None = None
) -> tuple[GroupedLines, dict[str, tuple[int, str]], int]:
    """Note the places of all lines.

    Args:
        files: JSON lines, packed or not, or Parquet.
        scratch: Folder for what is unpacked; it must stay as long as lines are read.
        report: Takes what is unsound.
        bounds: What a file may be; more than sources have by default.

    Returns:
        The lines; number of bytes and digest of the content of each recording, by name; and the number of all lines.

    Raises:
        DataError: `file-missing` or `file-invalid`, for a file that cannot be read at all.
        ValueError: A file is packed, and there is no scratch folder.
    """
    found: dict[str, _Found] = {}
    readable: list[tuple[Path, str]] = []
    total = 0
    for number, path in enumerate(files):
        try:
            plain = _seekable(path, scratch, number, report)
            readable.append((plain, path.name))
            with plain.open("rb") as file:
                total += _note(number, file, path.name, found, report, bounds or LineBounds())
        except OSError as error:
            raise _unreadable(path, error) from error
    names = sorted(found)
    about = {name: (found[name].size, found[name].digest.hexdigest()) for name in names}
    return GroupedLines(tuple(readable), {name: tuple(found[name].runs) for name in names}), about, total


def _note(number: int, file: IO[bytes], name: str, found: dict[str, _Found], report: Report, bounds: LineBounds) -> int:
    total = offset = 0
    empty = 0
    for line, (content, length) in enumerate(_lines(file, bounds.longest), start=1):
        if content is None:
            message = f"{name}:{line}: a line of {length:,} bytes is no label"
            report.leave_out("label", "file-invalid", message)
        elif not content.strip():
            empty += 1
            if empty > bounds.empty:
                raise DataError(Diagnostic("file-invalid", f"{name} has more than {bounds.empty:,} empty lines"))
        else:
            total += 1
            recording = _recording(content, f"{name}:{line}", report)
            if recording is not None:
                entry = found.get(recording)
                if entry is None:
                    entry = found[recording] = _Found()
                runs = entry.runs
                if runs and runs[-4] == number and runs[-1] == offset:
                    runs[-1] = offset + len(content)
                else:
                    runs.extend((number, line, offset, offset + len(content)))
                entry.digest.update(content)
                entry.size += len(content)
        offset += length
    return total


def _lines(file: IO[bytes], longest: int) -> Iterator[tuple[bytes | None, int]]:
    """The lines of a file with their lengths; None in place of one that is too long, which is not kept in memory."""
    while content := file.readline(longest):
        length = len(content)
        if length < longest or content.endswith(b"\n"):
            yield content, length
            continue
        while more := file.readline(longest):
            length += len(more)
            if more.endswith(b"\n"):
                break
        yield None, length


def _recording(content: bytes, place: str, report: Report) -> str | None:
    # Parsing only to find one key would double the time of an ingest. A key that is there once can be found
    # without; whoever parses the line later compares it.
    if content.count(b'"recording"') == 1 and (found := _KEY.search(content)):
        try:
            return found[1].decode()
        except UnicodeDecodeError:
            pass
    try:
        fields = parse_json(content)
    except InvalidError as error:
        report.leave_out("label", "file-invalid", f"{place}: {error}")
        return None
    recording = cast(dict[str, object], fields).get("recording") if isinstance(fields, dict) else None
    if isinstance(recording, str):
        return recording
    report.leave_out("label", "record-invalid", f"{place}: `recording` is missing or is not a text")
    return None


def _unreadable(file: Path, error: OSError) -> DataError:
    return DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror or error}"))


def _seekable(file: Path, scratch: Path | None, number: int, report: Report) -> Path:
    if file.suffix not in (".gz", ".parquet"):
        return file
    if scratch is None:
        raise ValueError(f"{file} is packed, and there is no folder to unpack it")
    unpacked = scratch / f"labels-{number}.jsonl"
    with unpacked.open("wb") as lines:
        lines.writelines(_parquet_lines(file, report) if file.suffix == ".parquet" else _gzip_lines(file))
    return unpacked


def _gzip_lines(file: Path) -> Iterator[bytes]:
    bound = Bound(file)
    with gzip.open(file) as lines:
        try:
            while piece := lines.read(1 << 20):
                bound.add(len(piece))
                yield piece
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise DataError(Diagnostic("file-invalid", f"{file} is not a whole gzip file: {error}")) from error


def _parquet_lines(file: Path, report: Report) -> Iterator[bytes]:
    try:
        with pq.ParquetFile(file) as table:
            texts = text_columns(table)
            bound = Bound(file)
            check_claims(table, bound)
        with pq.ParquetFile(file, read_dictionary=texts) as table:
            row = 0
            for batch in table.iter_batches(batch_size=1024):
                bound.check(sum(decoded_bytes(column, RECORD_BYTES) for column in batch.columns))
                for column in batch.columns:
                    bound.add(decoded_bytes(column))
                for fields in batch.to_pylist(maps_as_pydicts="strict"):
                    row += 1
                    try:
                        yield json.dumps(fields).encode() + b"\n"
                    except TypeError as error:
                        report.leave_out("label", "record-invalid", f"{file.name}:{row}: {error}")
                        yield b"\n"
    except (pa.ArrowException, ValueError, OverflowError) as error:
        raise DataError(Diagnostic("file-invalid", f"{file} is not a Parquet file: {error}")) from error
