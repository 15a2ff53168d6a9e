"""Large JSON files that hold one list, read block by block, each element with its line number."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Generic, TypeVar

from msgspec import DecodeError, Raw, ValidationError
from msgspec.json import Decoder

from scenicq.errors import DataError, Diagnostic
from scenicq.garbage import pause_collector

__all__ = ["ElementBlock", "read_list"]

_CHUNK = 1 << 20
_LONGEST = 1 << 23
_TAIL = 1 << 16
"""Characters at the end of a chunk in which the end of the last whole element is sought."""

_GAP = re.compile(r"[\s,]*")
_BETWEEN = re.compile(r"\}\s{0,99},\s{0,99}\{")

_decode = json.JSONDecoder().raw_decode
_ELEMENTS = Decoder(list[Raw])
T = TypeVar("T")


class ElementBlock(Generic[T]):
    """Neighbouring elements of a list.

    Attributes:
        text: What they were read from, from the beginning of the first to the end of the last.
        rows: The elements, if all are what they must be; else each has to be looked at.
    """

    __slots__ = ("_elements", "_first", "_lines", "rows", "text")

    def __init__(self, text: str, first: int, rows: list[T] | None, *, alone: bool = False) -> None:
        """Take a text, the line where it begins, its elements, and whether it is one alone."""
        self.text = text
        self.rows = rows
        self._elements: Sequence[bytes | Raw] | None = [text.encode()] if alone else None
        self._first = first
        self._lines: list[int] = []

    @property
    def elements(self) -> Sequence[bytes | Raw]:
        """The text of each; of one that is alone it may be no JSON but what Python takes for such, as NaN."""
        if self._elements is None:
            self._elements = _ELEMENTS.decode(f"[{self.text}]")
        return self._elements

    def line(self, number: int) -> int:
        """The line of the file where an element begins; found only when it is asked for, as few are."""
        if not self._lines:
            text, line, before = self.text.encode(), self._first, 0
            for element in self.elements:
                start = text.index(element, before)
                line += text.count(b"\n", before, start)
                self._lines.append(line)
                line += bytes(element).count(b"\n")
                before = start + len(bytes(element))
        return self._lines[number]


def read_list(path: Path, rows: Decoder[list[T]]) -> Iterator[ElementBlock[T]]:
    """The elements of a JSON list in order.

    Memory is that of a chunk of the file and of what it holds, or of one element.

    Args:
        path: The file.
        rows: Decodes elements that are what they must be.

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
                block = _many(buffer, position, line, rows) if untried else None
                untried = False
                if block is None:
                    try:
                        _, end = _decode(buffer, position)
                    except RecursionError as error:
                        raise _invalid(path, line, "is nested too deeply") from error
                    except ValueError as error:
                        # Either the file is unsound here or the chunk ends inside of the element.
                        more = file.read(_CHUNK)
                        if not more or len(buffer) - position > _LONGEST:
                            raise _invalid(path, line, "is cut off or is not JSON here") from error
                        buffer, position, untried = buffer[position:] + more, 0, True
                        continue
                    block = ElementBlock[T](buffer[position:end], line, None, alone=True)
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


def _many(buffer: str, position: int, line: int, rows: Decoder[list[T]]) -> ElementBlock[T] | None:
    """All elements but what may be cut off; None where it is not known where they end.

    Wherever the text is cut but between two elements of the list, it is left with an open string or bracket, which is
    no JSON.
    """
    ends = [between.start() + 1 for between in _BETWEEN.finditer(buffer, max(position, len(buffer) - _TAIL))]
    if not ends:
        return None
    text = buffer[position : ends[-1]]
    try:
        try:
            with pause_collector():
                return ElementBlock(text, line, rows.decode(f"[{text}]"))
        except ValidationError:
            _ELEMENTS.decode(f"[{text}]")
            return ElementBlock[T](text, line, None)
    except (DecodeError, RecursionError):
        return None


def _invalid(path: Path, line: int, what: str) -> DataError:
    return DataError(Diagnostic("file-invalid", f"{path}:{line} {what}"))
