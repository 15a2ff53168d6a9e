"""Results as a table for people: one line a frame, columns aligned a block at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import IO, Any, BinaryIO, cast

import click

from .report import columns, moment

__all__ = ["Table", "Text"]

_INTERVAL_HEAD = ("RECORDING", "START", "SECONDS", "VERDICT", "OBJECTS", "FRAMES")
_HEAD = ("FRAME", "RECORDING", "TIME", "VERDICT", "OBJECTS", "SENSOR")
_BLOCK = 100
"""Rows that are aligned together."""
_COLOURS = {"match": "green", "unknown": "yellow"}


class Text:
    """Text as UTF-8 on a stream that somebody else closes."""

    def __init__(self, sink: BinaryIO) -> None:
        """Take the stream."""
        self._sink = sink

    def write(self, text: str) -> None:
        """Write text; what is no Unicode is escaped."""
        self._sink.write(text.encode(errors="backslashreplace"))

    def flush(self) -> None:
        """Hand everything on."""
        self._sink.flush()

    def isatty(self) -> bool:
        """Whether somebody looks at it, and so colours make sense."""
        return self._sink.isatty()


class Table:
    """Aligned columns for a terminal; a block of rows at a time."""

    def __init__(self, text: Text, *, over_time: bool = False) -> None:
        """Take where to write, and whether the results are intervals."""
        self._text = text
        self._head = _INTERVAL_HEAD if over_time else _HEAD
        self._rows: list[tuple[str, ...]] = []

    def write(self, record: Mapping[str, Any]) -> None:
        """Add a row."""
        self._rows = self._rows or [self._head]
        self._rows.append(_cells(record))
        if len(self._rows) > _BLOCK:
            self.finish()

    def finish(self) -> None:
        """Write the rows that are held back."""
        for row, line in zip(self._rows, columns(self._rows, indent=""), strict=True):
            colour = _COLOURS.get(row[3].partition(":")[0])
            click.echo(click.style(line, fg=colour, bold=row is self._head or None), file=cast("IO[str]", self._text))
        self._rows.clear()


def _cells(record: Mapping[str, Any]) -> tuple[str, ...]:
    cause = record.get("cause", {})
    near = cause.get("what") == "tolerance"
    why = cause.get("reason") or cause.get("detail" if near else "what", "")
    objects = [f"{role}={label}" for role, label in record["correspondence"].items() if (role, label) != ("ego", "ego")]
    verdict = f"{record['verdict']}: {why}" if why else record["verdict"]
    if "frames" in record:
        frames = record["frames"]
        return (
            record["recording"],
            moment(record["start_us"]),
            f"{(record['end_us'] - record['start_us']) / 1e6:.1f}",
            verdict,
            " ".join(objects) or "-",
            f"{frames['count']} from {frames['first']}",
        )
    sensors = sorted(record["sensors"].items(), key=lambda item: (not item[0].startswith("CAM_FRONT"), item))
    return (
        record["frame"],
        record["recording"],
        moment(record["timestamp_us"]),
        verdict,
        " ".join(objects) or "-",
        sensors[0][1] if sensors else "-",
    )
