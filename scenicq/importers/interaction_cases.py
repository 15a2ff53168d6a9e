"""Rows of INTERACTION by case: from version 1.2 on, a file holds many short recordings, each with tracks of its own."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from scenicq.errors import DataError, Diagnostic

__all__ = ["Case", "Row", "cases_of", "columns_of", "rows_of"]

Row = Mapping[str, str | None]
_CASE = "case_id"
_LONGEST_LINE = 1 << 16


@dataclass(slots=True)
class Case:
    """Where the rows of a case lie in a file.

    Attributes:
        ranges: First and last byte (exclusive) of runs of rows.
        rows: How many there are.
    """

    ranges: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    rows: int = 0
    _digest: hashlib.blake2b = field(default_factory=lambda: hashlib.blake2b(digest_size=16))

    def add(self, start: int, line: bytes) -> None:
        """Take a row."""
        end = start + len(line)
        if self.ranges and self.ranges[-1][1] == start:
            self.ranges[-1] = self.ranges[-1][0], end
        else:
            self.ranges.append((start, end))
        self.rows += 1
        self._digest.update(line)

    @property
    def digest(self) -> str:
        """Changes with the rows."""
        return self._digest.hexdigest()

    @property
    def text(self) -> str:
        """The ranges as text."""
        return ",".join(f"{start}-{end}" for start, end in self.ranges)


def cases_of(file: Path) -> dict[str, Case]:
    """The cases of a file in order; a file that has none is one, called "".

    Raises:
        DataError: `file-missing`, `file-invalid`.
    """
    found: dict[str, Case] = {}
    try:
        with file.open("rb") as content:
            header = content.readline(_LONGEST_LINE)
            columns = _columns(header)
            place = columns.index(_CASE) if _CASE in columns else None
            start = len(header)
            while line := content.readline(_LONGEST_LINE):
                cells = line.split(b",", -1 if place is None else place + 1)
                name = "" if place is None or place >= len(cells) else _plain(cells[place])
                found.setdefault(name, Case()).add(start, line)
                start += len(line)
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror}")) from error
    return found


def rows_of(file: Path, ranges: str, needed: tuple[str, ...]) -> Iterator[tuple[int, Row]]:
    """The rows of a case, each with the byte at which its run begins and its number there.

    Args:
        file: The file.
        ranges: `Case.text`.
        needed: Columns that must be there.

    Raises:
        DataError: `file-missing`, `file-invalid`.
    """
    try:
        with file.open("rb") as content:
            columns = _columns(content.readline(_LONGEST_LINE))
            lacking = [name for name in needed if name not in columns]
            if lacking:
                listed = ", ".join(f"`{name}`" for name in lacking)
                raise DataError(Diagnostic("file-invalid", f"{file} lacks the columns {listed}"))
            for each in filter(None, ranges.split(",")):
                start, end = map(int, each.split("-"))
                content.seek(start)
                lines = content.read(end - start).decode().splitlines()
                yield from enumerate(csv.DictReader(lines, columns), start=1)
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(Diagnostic("file-invalid", f"{file} is not a CSV file: {error}")) from error
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror}")) from error


def columns_of(file: Path) -> list[str]:
    """The columns of a file.

    Raises:
        DataError: `file-missing`.
    """
    try:
        with file.open("rb") as content:
            return _columns(content.readline(_LONGEST_LINE))
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror}")) from error


def _columns(header: bytes) -> list[str]:
    text = header.decode(errors="replace").lstrip("\ufeff").strip()
    return [name.strip().strip('"') for name in text.split(",")]


def _plain(cell: bytes) -> str:
    """A case's name: the files write whole numbers as 1.0."""
    text = cell.decode(errors="replace").strip().strip('"')
    return text.removesuffix(".0") if text.removesuffix(".0").isdigit() else text
