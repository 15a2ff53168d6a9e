"""What the specification of a format lists, and what becomes of each field and kind of element here.

A file of `specifications/` gives for each path `read`, `left out` or `meaningless`, perhaps with a note after a colon.
A path names the fields from the root down, with `*` for keys that the source makes up; members of a list have the path
of the list, fields of protocol buffers end in their number, and `files/` begins patterns of files and folders. What is
read without a path below it is read as a whole; ``as `PATH` `` in a note says that the fields are those of another
path. What is left out, and what no specification lists, is counted where it occurs. `README.md` shows the lists.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, cast
from xml.etree.ElementTree import Element

from scenicq.importers.protobuf import Message
from scenicq.importers.report import Report

__all__ = ["LEFT_OUT", "MEANINGLESS", "READ", "SPECIFICATIONS", "Specification", "specification"]

READ, LEFT_OUT, MEANINGLESS = "read", "left out", "meaningless"
SPECIFICATIONS = Path(__file__).with_name("specifications")
_ALIAS = re.compile("as `([^`]+)`")
_FILES = "files/"
_NOTHING: tuple[object, ...] = (None, "", [], {})
"""What says nothing of a field."""


class Specification:
    """The fields and kinds of elements of one format.

    Attributes:
        entries: For each path `read`, `left out` or `meaningless`, and a note or "".
    """

    def __init__(self, entries: Mapping[str, str]) -> None:
        """Take the entries as a file of `specifications/` has them."""
        self.entries: dict[str, tuple[str, str]] = {}
        self._by_number: dict[str, dict[int, str]] = {}
        self._below: dict[str, str] = {}
        self._silent: dict[str, frozenset[str]] = {}
        self._silent_numbers: dict[str, frozenset[int]] = {}
        for path, text in entries.items():
            status, _, note = text.partition(": ")
            self.entries[path] = status, note
            if (alias := _ALIAS.fullmatch(note)) is not None:
                self._below[path] = alias[1]
            self._below.setdefault(path.rpartition("/")[0], path.rpartition("/")[0])

    def fate(self, path: str) -> str:
        """`read`, `left out` or `meaningless`; what no specification lists is left out."""
        return self.entries.get(path, (LEFT_OUT, ""))[0]

    def count(self, path: str, report: Report, count: int = 1) -> bool:
        """Count an element that is left out; whether it is read.

        Args:
            path: Of the element.
            report: Takes the count.
            count: How many there are.
        """
        fate = self.fate(path)
        if fate == LEFT_OUT and count:
            report.not_read(path, count)
        return fate == READ

    def count_columns(self, table: str, columns: Iterable[str], report: Report, rows: int = 1) -> None:
        """Count the columns of a table that are left out, with its rows."""
        for column in columns:
            self.count(f"{table}/{column}" if table else column, report, rows)

    def column_counter(self, table: str, report: Report) -> Callable[[Iterable[str], int], None]:
        """What counts the columns of a table that are left out, from all names and how many rows it has."""
        return lambda columns, rows: self.count_columns(table, columns, report, rows)

    def count_rows(self, rows: Iterable[Mapping[str, Any]], report: Report, at: str) -> None:
        """Count the fields of records that are left out, those of records within them not.

        Args:
            rows: The records; what is null or empty in them says nothing.
            report: Takes the counts.
            at: Their path.
        """
        silent = self._without_count(at)
        for row in rows:
            if not silent.issuperset(row):
                for key in row:
                    if key not in silent and row[key] not in _NOTHING:
                        self.count(self._child(at, key), report, _members(row[key]))

    def count_files(self, names: Iterable[str], report: Report) -> None:
        """Count files and folders that are left out.

        Args:
            names: Of each, from the root of the source.
            report: Takes the counts.
        """
        patterns = [path.removeprefix(_FILES) for path in self.entries if path.startswith(_FILES)]
        for name in names:
            path = PurePosixPath(name)
            unlisted = str(path.with_name(f"*{path.suffix}")) if path.suffix else name
            pattern = next((pattern for pattern in patterns if fnmatchcase(name, pattern)), unlisted)
            self.count(f"{_FILES}{pattern}", report)

    def count_json(self, value: object, report: Report, at: str = "") -> None:
        """Count what is left out of a JSON value.

        Args:
            value: The value; what is null or empty says nothing.
            report: Takes the counts.
            at: Its path.
        """
        waiting: list[tuple[str, object]] = [(at, value)]
        while waiting:
            path, value = waiting.pop()
            if isinstance(value, list):
                waiting += [(path, each) for each in cast("list[object]", value) if isinstance(each, dict | list)]
            elif isinstance(value, dict):
                silent = self._without_count(path)
                for key, member in cast("dict[str, Any]", value).items():
                    if key in silent or member in _NOTHING:
                        continue
                    child = self._child(path, key)
                    if self.count(child, report, _members(member)) and (below := self._below.get(child)):
                        waiting.append((below, member))

    def count_xml(self, element: Element, report: Report, at: str = "") -> None:
        """Count what is left out of an XML element; attributes are below their element, with an `@`.

        Args:
            element: The element.
            report: Takes the counts.
            at: Its path.
        """
        waiting = [(at, element)]
        while waiting:
            path, element = waiting.pop()
            for name in element.attrib:
                self.count(f"{path}/@{name}" if path else f"@{name}", report)
            for child in element:
                inner = f"{path}/{child.tag}" if path else child.tag
                if self.count(inner, report) and (below := self._below.get(inner)):
                    waiting.append((below, child))

    def count_message(self, message: Message, report: Report, at: str = "") -> None:
        """Count the fields of a message of protocol buffers that are left out, those of messages within it not.

        Args:
            message: The message.
            report: Takes the counts.
            at: Its path.
        """
        if at not in self._by_number:
            named = {path.rpartition(":")[2]: path for path in self.entries if path.rpartition("/")[0] == at}
            self._by_number[at] = {int(number): path for number, path in named.items() if number.isdigit()}
            known = self._by_number[at].items()
            self._silent_numbers[at] = frozenset(number for number, path in known if self.fate(path) != LEFT_OUT)
        if not self._silent_numbers[at].issuperset(message):
            for number, values in message.items():
                self.count(self._by_number[at].get(number, self._child(at, str(number))), report, len(values))

    def _child(self, at: str, key: str) -> str:
        """The path of a field."""
        child, free = (f"{at}/{key}", f"{at}/*") if at else (key, "*")
        return free if child not in self.entries and free in self.entries else child

    def _without_count(self, at: str) -> frozenset[str]:
        """Names of the fields of a path with which there is nothing to do."""
        if at not in self._silent:
            children = [path for path in self.entries if path.rpartition("/")[0] == at and path not in self._below]
            self._silent[at] = frozenset(path.rpartition("/")[2] for path in children if self.fate(path) != LEFT_OUT)
        return self._silent[at]


def _members(value: object) -> int:
    """How many elements a field has: a list of objects has its members, all else is one."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return len(cast("list[object]", value))
    return 1


@cache
def specification(name: str) -> Specification:
    """That of a format of `specifications/`."""
    return Specification(json.loads(SPECIFICATIONS.joinpath(f"{name}.json").read_bytes()))
