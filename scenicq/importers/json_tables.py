"""Large JSON files that hold one list of objects, read block by block, each element with its line number."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from scenicq.errors import DataError, Diagnostic
from scenicq.garbage import without_collector

__all__ = ["ElementBlock", "Rows", "read_list"]

Rows: TypeAlias = "msgspec.json.Decoder[list[Any]]"
"""Decodes elements that are sound, as structs or what else msgspec has for objects."""

_CHUNK = 1 << 20
_LONGEST = 1 << 23
_TAIL = 1 << 16
"""How far from the end of a chunk the end of an element is looked for."""

_GAP = re.compile(r"[\s,]*")
_BETWEEN = re.compile(r"\}\s{0,99},\s{0,99}\{")

_decode = json.JSONDecoder().raw_decode


class ElementBlock:
    """Neighbouring elements of a list.

    Attributes:
        text: What they were read from, from the beginning of the first to the end of the last.
        rows: The elements as the decoder has them; None where they were not asked for, or not all are sound.
    """

    __slots__ = ("_elements", "_first", "_lines", "rows", "text")

    def __init__(
        self, text: str, first: int, *, elements: list[Any] | None = None, rows: list[Any] | None = None
    ) -> None:
        """Take a text, the line where it begins, and the elements in one form at least."""
        self.text = text
        self.rows = rows
        self._elements = elements
        self._first = first
        self._lines: list[int] = []

    @property
    def elements(self) -> list[Any]:
        """One or more elements as `json` decodes them; where there are rows, only when they are asked for."""
        if self._elements is None:
            self._elements = json.loads(f"[{self.text}]")
        return self._elements

    def line(self, number: int) -> int:
        """The line of the file where an element begins; found only when it is asked for, as few are."""
        if not self._lines:
            line, position = self._first, 0
            for _ in self.elements:
                line, position = _skip_gap(self.text, line, position)
                self._lines.append(line)
                _, end = _decode(self.text, position)
                line += self.text.count("\n", position, end)
                position = end
        return self._lines[number]


def read_list(path: Path, rows: Rows | None = None) -> Iterator[ElementBlock]:
    """The elements of a JSON list in order.

    Memory is that of a chunk of the file and of what it holds, or of one element.

    Args:
        path: The file.
        rows: Makes rows of sound elements, in a fraction of the time that `json` needs.

    Raises:
        DataError: `file-missing`, or `file-invalid` with file and line, after the elements before.
    """
    try:
        with path.open(encoding="utf-8") as file:
            buffer = file.read(_CHUNK).lstrip("\ufeff")
            start = len(buffer) - len(buffer.lstrip())
            line = 1 + buffer.count("\n", 0, start)
            if buffer[start : start + 1] != "[":
                raise _invalid(path, line, "does not begin with a list")
            position, untried = start + 1, True
            while True:
                line, position = _skip_gap(buffer, line, position)
                if buffer.startswith("]", position):
                    return
                block = _at_once(buffer, position, line, rows) if untried else None
                untried = False
                if block is None:
                    try:
                        element, end = _decode(buffer, position)
                    except RecursionError as error:
                        raise _invalid(path, line, "is nested too deeply") from error
                    except ValueError as error:
                        # Either the file is unsound here or the chunk ends inside of the element.
                        more = file.read(_CHUNK)
                        if not more or len(buffer) - position > _LONGEST:
                            raise _invalid(path, line, "is cut off or is not JSON here") from error
                        buffer, position, untried = buffer[position:] + more, 0, True
                        continue
                    block = ElementBlock(buffer[position:end], line, elements=[element])
                yield block
                line += block.text.count("\n")
                position += len(block.text)
    except UnicodeDecodeError as error:
        raise DataError(Diagnostic("file-invalid", f"{path} is not UTF-8 text")) from error
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from error


def _skip_gap(text: str, line: int, position: int) -> tuple[int, int]:
    gap = _GAP.match(text, position)
    end = gap.end() if gap else position
    return line + text.count("\n", position, end), end


def _at_once(buffer: str, position: int, line: int, rows: Rows | None) -> ElementBlock | None:
    """All elements but what may be cut off; None where they must be read one by one.

    Wherever the text is cut but between two elements of the list, it is left with an open string or bracket. So what
    is JSON here would have been read the same one by one.
    """
    ends = [between.start() + 1 for between in _BETWEEN.finditer(buffer, max(position, len(buffer) - _TAIL))]
    if not ends:
        return None
    text = buffer[position : ends[-1]]
    with without_collector():
        if rows is not None:
            with suppress(RecursionError, msgspec.DecodeError):
                return ElementBlock(text, line, rows=rows.decode(f"[{text}]"))
        with suppress(RecursionError, ValueError):
            return ElementBlock(text, line, elements=json.loads(f"[{text}]"))
    return None


def _invalid(path: Path, line: int, what: str) -> DataError:
    return DataError(Diagnostic("file-invalid", f"{path}:{line} {what}"))
