"""What the specification of a format lists, and what becomes of each field and kind of element here.

A file of `specifications/` gives for each path `read`, `left out` or `meaningless`, perhaps with a note after a colon.
A path names the fields from the root down, with `*` for keys that the source makes up; members of a list have the path
of the list. What is read without a path below it is read as a whole; ``as `PATH` `` in a note says that the fields are
those of another path. What is left out, and what no specification lists, is counted where it occurs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, cast
from xml.etree.ElementTree import Element

from scenicq.importers.protobuf import Message
from scenicq.importers.report import Report

__all__ = ["LEFT_OUT", "MEANINGLESS", "READ", "SPECIFICATIONS", "Specification", "specification"]

READ, LEFT_OUT, MEANINGLESS = "read", "left out", "meaningless"
SPECIFICATIONS = Path(__file__).with_name("specifications")
_ALIAS = re.compile("as `([^`]+)`")


class Specification:
    """The fields and kinds of elements of one format.

    Attributes:
        entries: For each path `read`, `left out` or `meaningless`, and a note or "".
    """

    def __init__(self, entries: Mapping[str, str]) -> None:
        """Take the entries as a file of `specifications/` has them."""
        self.entries: dict[str, tuple[str, str]] = {}
        self._by_number: dict[str, str] = {}
        self._below: dict[str, str] = {}
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
                for key, member in cast("dict[str, Any]", value).items():
                    if member in (None, "", [], {}):
                        continue
                    child = f"{path}/{key}" if path else key
                    if child not in self.entries and (free := f"{path}/*" if path else "*") in self.entries:
                        child = free
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

    def count_message(self, message: Message, report: Report, at: str) -> None:
        """Count the fields of a message of protocol buffers that are left out, those of messages within it not.

        Args:
            message: The message.
            report: Takes the counts.
            at: Its path, which ends where the numbers of its fields begin.
        """
        for number, values in message.items():
            self.count(self._named(at, number), report, len(values))

    def _named(self, at: str, number: int) -> str:
        """The path of a field by its number: paths of such formats name fields as in `map_features:8`."""
        if not self._by_number:
            for path in self.entries:
                above, _, field = path.rpartition("/")
                self._by_number[f"{above}/{field.rpartition(':')[2]}"] = path
        return self._by_number.get(f"{at}/{number}", f"{at}/{number}")


def _members(value: object) -> int:
    """How many elements a field has: a list of objects has its members, all else is one."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return len(cast("list[object]", value))
    return 1


@cache
def specification(name: str) -> Specification:
    """That of a format of `specifications/`."""
    return Specification(json.loads(SPECIFICATIONS.joinpath(f"{name}.json").read_bytes()))
