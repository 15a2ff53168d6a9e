"""Short names of frames and recordings: names are cut as far as they stay unique, and found by their beginnings.

A name may have parts with `/` between them, such as a recording and a time; each part may be cut short by itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenicq.errors import DataError, Diagnostic

if TYPE_CHECKING:
    import duckdb

__all__ = ["ShortNames", "find_frame", "find_recording", "name_shorteners"]

_SHORTEST = 6
_SHOWN = 5


def find_frame(connection: duckdb.DuckDBPyConnection, text: str) -> str:
    """Find the frame with a name, or with a name that begins so.

    Args:
        connection: A connection to the dataset.
        text: A name, or as much of it, or of each of its parts, as no other frame has.

    Raises:
        DataError: option-invalid: there is no such frame, or there are several.
    """
    pattern = "[^/]*/".join(re.escape(part) for part in text.split("/")) + ".*"
    rows = connection.execute(
        "SELECT frame FROM labels WHERE frame = ? OR regexp_full_match(frame, ?, 's') "
        "ORDER BY frame <> ?, frame LIMIT ?",
        [text, pattern, text, _SHOWN + 1],
    ).fetchall()
    found = [str(frame) for (frame,) in rows]
    if found and (found[0] == text or len(found) == 1):
        return found[0]
    if not found:
        hint = "`scenicq match SCENARIO DATASET --all` lists the frames"
        raise DataError(Diagnostic("option-invalid", f"the dataset has no frame `{text}`", hints=(hint,)))
    raise _ambiguous("frames", text, found)


def find_recording(recordings: Iterable[str], text: str) -> str | None:
    """Find the recording with a name, or with a name that begins so; None if there is none.

    Args:
        recordings: The names of all.
        text: A name, or as much of it as no other recording has.

    Raises:
        DataError: option-invalid: several begin so.
    """
    found = sorted(each for each in recordings if each.startswith(text))
    if text in found or len(found) < 2:
        return text if text in found else next(iter(found), None)
    raise _ambiguous("recordings", text, found)


def _ambiguous(what: str, text: str, found: Sequence[str]) -> DataError:
    hint = f"these begin so: {', '.join(found[:_SHOWN])}{', ...' if len(found) > _SHOWN else ''}"
    return DataError(Diagnostic("option-invalid", f"several {what} begin with `{text}`", hints=(hint,)))


@dataclass(frozen=True, slots=True)
class ShortNames:
    """Two functions that cut names: all names of a kind to one length, at which they are still unique.

    Attributes:
        frame: Cuts names of frames.
        recording: Cuts names of recordings.
    """

    frame: Callable[[str], str]
    recording: Callable[[str], str]


def name_shorteners(connection: duckdb.DuckDBPyConnection) -> ShortNames:
    """Make the functions that cut names so that `find_frame` and `find_recording` still find them.

    Names of frames that do not all have the same number of parts stay as they are.

    Args:
        connection: A connection to the dataset.
    """
    length = _shortest(connection, "recording")
    rows = connection.execute("SELECT DISTINCT len(string_split(frame, '/')) FROM labels").fetchall()
    if len(rows) != 1:
        return ShortNames(str, lambda recording: recording[:length])
    parts = [f"string_split(frame, '/')[{number}]" for number in range(1, rows[0][0] + 1)]
    lengths = [_shortest(connection, part) for part in parts]
    return ShortNames(
        lambda frame: "/".join(part[:length] for part, length in zip(frame.split("/"), lengths, strict=True)),
        lambda recording: recording[:length],
    )


def _shortest(connection: duckdb.DuckDBPyConnection, part: str) -> int:
    """The length to which all values of a part can be cut without two becoming one."""
    connection.execute(f"CREATE OR REPLACE TEMP TABLE part AS SELECT DISTINCT {part} AS name FROM labels")
    row = connection.execute("SELECT count(*), max(len(name)) FROM part").fetchone()
    assert row is not None
    count, longest = row
    low, high = min(_SHORTEST, longest), longest
    while low < high:
        middle = (low + high) // 2
        cut = connection.execute(f"SELECT count(DISTINCT name[:{middle}]) FROM part").fetchone()
        low, high = (low, middle) if cut == (count,) else (middle + 1, high)
    return high
