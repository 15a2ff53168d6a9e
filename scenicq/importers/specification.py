"""What becomes of each field that a format's specification lists; what is left out is counted where it occurs.

A file of `specifications/` says of each path whether it is `read`, `left out` or `meaningless` (it says nothing of a
scene, so nobody misses it), perhaps with a note after a colon. What no file lists is left out.

A path names the fields from the root down:

- `*` stands for keys that the source makes up.
- Members of a list have the path of the list.
- Fields of protocol buffers end in their number, after a colon.
- `files/` begins patterns of files and folders.

What is read and has no path below it is read as a whole. The note ``as `PATH` `` says that the fields below are those
of another path. `README.md` shows all lists.
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

__all__ = ["LEFT_OUT", "MEANINGLESS", "READ", "SPECIFICATIONS", "Specification", "load_specification"]

READ, LEFT_OUT, MEANINGLESS = "read", "left out", "meaningless"
SPECIFICATIONS = Path(__file__).with_name("specifications")
_ALIAS = re.compile("as `([^`]+)`")
_FILES = "files/"
_EMPTY: tuple[object, ...] = (None, "", [], {})
"""Values that count as if the field were not there."""


class Specification:
    """The fields and kinds of elements of one format.

    Attributes:
        entries: Status and note of each path: `read`, `left out` or `meaningless`, and a text that may be empty.
    """

    def __init__(self, entries: Mapping[str, str]) -> None:
        """Take the entries of a file of `specifications/`: `STATUS` or `STATUS: NOTE` by path."""
        self.entries: dict[str, tuple[str, str]] = {}
        self._by_number: dict[str, dict[int, str]] = {}
        # where the fields of a path are listed: below itself, or below the path that its note names
        self._fields_at: dict[str, str] = {}
        self._uncounted: dict[str, frozenset[str]] = {}
        self._uncounted_numbers: dict[str, frozenset[int]] = {}
        for path, text in entries.items():
            status, _, note = text.partition(": ")
            self.entries[path] = status, note
            if (alias := _ALIAS.fullmatch(note)) is not None:
                self._fields_at[path] = alias[1]
            parent = path.rpartition("/")[0]
            self._fields_at.setdefault(parent, parent)

    def status(self, path: str) -> str:
        """`read`, `left out` or `meaningless`; what is not listed is left out."""
        return self.entries.get(path, (LEFT_OUT, ""))[0]

    def count(self, path: str, report: Report, count: int = 1) -> bool:
        """Count elements if they are left out, and say whether they are read.

        Args:
            path: The path of the elements.
            report: Adds up the counts.
            count: The number of elements.
        """
        status = self.status(path)
        if status == LEFT_OUT and count:
            report.count_unread(path, count)
        return status == READ

    def count_columns(self, table: str, columns: Iterable[str], report: Report, rows: int = 1) -> None:
        """Count each column of a table that is left out, once for each row."""
        for column in columns:
            self.count(f"{table}/{column}" if table else column, report, rows)

    def column_counter(self, table: str, report: Report) -> Callable[[Iterable[str], int], None]:
        """A function that counts the columns left out of a table, from the names of all and the number of rows."""
        return lambda columns, rows: self.count_columns(table, columns, report, rows)

    def count_rows(self, rows: Iterable[Mapping[str, Any]], report: Report, at: str) -> None:
        """Count the fields of records that are left out, but no fields of records within them.

        Args:
            rows: The records; fields that are null or empty are not counted.
            report: Adds up the counts.
            at: The path of the records.
        """
        uncounted = self._uncounted_names(at)
        for row in rows:
            if not uncounted.issuperset(row):
                for key in row:
                    if key not in uncounted and row[key] not in _EMPTY:
                        self.count(self._child(at, key), report, _element_count(row[key]))

    def count_files(self, names: Iterable[str], report: Report) -> None:
        """Count files and folders that are left out.

        Args:
            names: Their paths in the source.
            report: Adds up the counts.
        """
        patterns = [path.removeprefix(_FILES) for path in self.entries if path.startswith(_FILES)]
        for name in names:
            path = PurePosixPath(name)
            # files that nothing lists are counted together by their suffix
            by_suffix = str(path.with_name(f"*{path.suffix}")) if path.suffix else name
            pattern = next((pattern for pattern in patterns if fnmatchcase(name, pattern)), by_suffix)
            self.count(f"{_FILES}{pattern}", report)

    def count_json(self, value: object, report: Report, at: str = "") -> None:
        """Count the fields of a JSON value that are left out, at every depth.

        Args:
            value: The value; fields that are null or empty are not counted.
            report: Adds up the counts.
            at: The path of the value.
        """
        waiting: list[tuple[str, object]] = [(at, value)]
        while waiting:
            path, value = waiting.pop()
            if isinstance(value, list):
                waiting += [(path, each) for each in cast("list[object]", value) if isinstance(each, dict | list)]
            elif isinstance(value, dict):
                uncounted = self._uncounted_names(path)
                for key, member in cast("dict[str, Any]", value).items():
                    if key in uncounted or member in _EMPTY:
                        continue
                    child = self._child(path, key)
                    if self.count(child, report, _element_count(member)) and (below := self._fields_at.get(child)):
                        waiting.append((below, member))

    def count_xml(self, element: Element, report: Report, at: str = "") -> None:
        """Count what is left out of an XML element, at every depth; attributes are fields that begin with `@`.

        Args:
            element: The element.
            report: Adds up the counts.
            at: The path of the element.
        """
        waiting = [(at, element)]
        while waiting:
            path, element = waiting.pop()
            for name in element.attrib:
                self.count(f"{path}/@{name}" if path else f"@{name}", report)
            for child in element:
                inner = f"{path}/{child.tag}" if path else child.tag
                if self.count(inner, report) and (below := self._fields_at.get(inner)):
                    waiting.append((below, child))

    def count_message(self, message: Message, report: Report, at: str = "") -> None:
        """Count the fields of a message of protocol buffers that are left out, but no fields of messages within it.

        Args:
            message: The message, values by field numbers.
            report: Adds up the counts.
            at: The path of the message.
        """
        if at not in self._by_number:
            numbered = {path.rpartition(":")[2]: path for path in self._children(at)}
            self._by_number[at] = {int(number): path for number, path in numbered.items() if number.isdigit()}
            known = self._by_number[at].items()
            self._uncounted_numbers[at] = frozenset(number for number, path in known if self.status(path) != LEFT_OUT)
        if not self._uncounted_numbers[at].issuperset(message):
            for number, values in message.items():
                self.count(self._by_number[at].get(number, self._child(at, str(number))), report, len(values))

    def _child(self, at: str, key: str) -> str:
        """The path of a field; with `*` where that is listed and the field is not."""
        child, wildcard = (f"{at}/{key}", f"{at}/*") if at else (key, "*")
        return wildcard if child not in self.entries and wildcard in self.entries else child

    def _children(self, at: str) -> list[str]:
        """The paths listed directly below a path."""
        return [path for path in self.entries if path.rpartition("/")[0] == at]

    def _uncounted_names(self, at: str) -> frozenset[str]:
        """The fields below a path that count nothing: neither are they left out, nor has one fields of its own."""
        if at not in self._uncounted:
            leaves = [path for path in self._children(at) if path not in self._fields_at]
            self._uncounted[at] = frozenset(path.rpartition("/")[2] for path in leaves if self.status(path) != LEFT_OUT)
        return self._uncounted[at]


def _element_count(value: object) -> int:
    """How many elements a field counts as: a list of objects as its members, everything else as one."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return len(cast("list[object]", value))
    return 1


@cache
def load_specification(name: str) -> Specification:
    """Load the specification of a format from `specifications/`."""
    return Specification(json.loads(SPECIFICATIONS.joinpath(f"{name}.json").read_bytes()))
