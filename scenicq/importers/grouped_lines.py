"""JSON lines of several files, grouped by recording in bounded memory.

Labels of one recording need not be together. A first pass notes where each line of a recording lies (24 bytes a line);
a second one jumps there. Files in which one cannot jump (gzip, Parquet) are first written to an anonymous temporary
file, which the system removes whatever happens.
"""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import gzip
import json
import re
import tempfile
import zlib
from array import array
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, cast

import pyarrow as pa
import pyarrow.parquet as pq

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.fields import InvalidError, parse_json
from scenicq.importers.report import Report

__all__ = ["GroupedLines", "Line"]

Line = tuple[Any, str]
"""A parsed line and its place, `file:line`."""

_KEY = re.compile(rb'"recording"\s*:\s*"([^"\\]*)"')


class GroupedLines:
    """The lines of some files by recording; close it after use."""

    def __init__(self, files: Sequence[Path], report: Report) -> None:
        """Note the place of every line.

        Raises:
            DataError: `file-missing` or `file-invalid`, for a file that cannot be read at all.
        """
        self._names = [file.name for file in files]
        self._report = report
        self._places: dict[str, array[int]] = {}
        self._open = ExitStack()
        self.lines = 0
        with ExitStack() as opening:
            self._files = [opening.enter_context(_seekable(file, report)) for file in files]
            for number, file in enumerate(self._files):
                self._note(number, file)
            self._open = opening.pop_all()

    @property
    def recordings(self) -> list[str]:
        """Names of the recordings, sorted."""
        return sorted(self._places)

    def close(self) -> None:
        """Close the files."""
        self._open.close()

    def read(self, recording: str) -> Iterator[Line]:
        """The lines of a recording in the order of the files; those that are not JSON are reported and left out."""
        places = self._places[recording]
        for first in range(0, len(places), 3):
            number, offset, line = places[first : first + 3]
            file = self._files[number]
            file.seek(offset)
            place = f"{self._names[number]}:{line}"
            try:
                yield parse_json(file.readline()), place
            except InvalidError as error:
                self._report.left_out("label", "file-invalid", f"{place}: {error}")

    def _note(self, number: int, file: IO[bytes]) -> None:
        offset = 0
        for line, content in enumerate(file, start=1):
            if content.strip():
                recording = self._recording(content, f"{self._names[number]}:{line}")
                if recording is not None:
                    self._places.setdefault(recording, array("q")).extend((number, offset, line))
                self.lines += 1
            offset += len(content)

    def _recording(self, content: bytes, place: str) -> str | None:
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
            self._report.left_out("label", "file-invalid", f"{place}: {error}")
            return None
        recording = cast(dict[str, object], fields).get("recording") if isinstance(fields, dict) else None
        if isinstance(recording, str):
            return recording
        self._report.left_out("label", "record-invalid", f"{place}: `recording` is missing or is not a text")
        return None


def _seekable(file: Path, report: Report) -> IO[bytes]:
    try:
        if file.suffix == ".parquet":
            return _unpacked(_parquet_lines(file, report))
        if file.suffix == ".gz":
            return _unpacked(_gzip_lines(file))
        return file.open("rb")
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror or error}")) from error


def _unpacked(lines: Iterator[bytes]) -> IO[bytes]:
    unpacked = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
    try:
        unpacked.writelines(lines)
        unpacked.seek(0)
    except BaseException:
        unpacked.close()
        raise
    return unpacked


def _gzip_lines(file: Path) -> Iterator[bytes]:
    with gzip.open(file) as lines:
        try:
            yield from lines
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise DataError(Diagnostic("file-invalid", f"{file} is not a whole gzip file: {error}")) from error


def _parquet_lines(file: Path, report: Report) -> Iterator[bytes]:
    try:
        with pq.ParquetFile(file) as table:
            row = 0
            for batch in table.iter_batches(batch_size=1024):
                for fields in batch.to_pylist(maps_as_pydicts="strict"):
                    row += 1
                    try:
                        yield json.dumps(fields).encode() + b"\n"
                    except TypeError as error:
                        report.left_out("label", "record-invalid", f"{file.name}:{row}: {error}")
                        yield b"\n"
    except pa.ArrowInvalid as error:
        raise DataError(Diagnostic("file-invalid", f"{file} is not a Parquet file: {error}")) from error
