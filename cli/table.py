"""Results as a table for people: one result a row, columns aligned a block at a time, as wide as the terminal."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import IO, BinaryIO, cast

import click
from msgspec import UNSET

from scenicq.query.execution.recorded_columns import show_cell
from scenicq.query.execution.records import CauseRecord, CellRecord, IntervalRecord, Record, SeriesRecord
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.results import ModeRecord
from scenicq.store.frame_names import ShortNames

from .report import columns, moment, printable

__all__ = ["Table", "TextStream", "table_lines"]

_INTERVAL_HEAD = ("RECORDING", "START", "SECONDS", "VERDICT", "OBJECTS", "FRAMES")
_HEAD = ("FRAME", "RECORDING", "TIME", "VERDICT", "OBJECTS", "SENSOR")
_VERDICT, _OBJECTS, _LAST = 3, 4, 5
"""Columns of either table; the last names sensors of a frame, or frames of an interval."""
_BLOCK = 100
"""Rows that are aligned together."""
_COLOURS = {"match": "green", "unknown": "yellow"}
_DATE = len("2018-09-18 ")
_SHORTEST_ID = 6
_NARROWEST = 12
_MODES_SHOWN = 6
"""What a role does one after the other that a row names."""
_FROM = " from "

Row = tuple[str, ...]


class TextStream:
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
        """Whether this is a terminal, so that colours make sense."""
        return self._sink.isatty()


class Table:
    """Aligned columns for a terminal; a block of rows at a time."""

    def __init__(
        self, text: TextStream, shorten: Callable[[], ShortNames] | None = None, *, over_time: bool = False
    ) -> None:
        """Take where to write.

        Args:
            text: The stream; on a terminal the table fits its width.
            shorten: Gives what cuts names short; asked only where the table does not fit.
            over_time: Whether the results are intervals.
        """
        self._text, self._over_time = text, over_time
        self._width = shutil.get_terminal_size().columns if text.isatty() else None
        self._shorten = shorten
        self._short: ShortNames | None = None
        self._rows: list[Row] = []

    def write(self, record: Record) -> None:
        """Add a row."""
        self._rows.append(_cells(record))
        if len(self._rows) >= _BLOCK:
            self.finish()

    def stop(self) -> None:
        """The rows that are held back stay there."""

    def finish(self, summary: ResultSummary | None = None) -> None:
        """Write the rows that are held back; the summary is not of the table: standard error has it for people."""
        if not self._rows:
            return
        lines = columns([_INTERVAL_HEAD if self._over_time else _HEAD, *self._rows], indent="")
        if self._width is not None and max(map(len, lines)) > self._width:
            if self._short is None:
                self._short = self._shorten() if self._shorten is not None else ShortNames(str, str)
            lines = table_lines(self._rows, self._width, self._short, over_time=self._over_time)
        verdicts = iter(self._rows)
        colour = None
        for number, line in enumerate(lines):
            if number and not line.startswith(" "):
                colour = _COLOURS.get(next(verdicts)[_VERDICT].partition(":")[0])
            click.echo(click.style(line, fg=colour, bold=number == 0 or None), file=cast("IO[str]", self._text))
        self._rows.clear()


def table_lines(rows: list[Row], width: int, short: ShortNames, *, over_time: bool = False) -> list[str]:
    """Lay rows out as lines of a table of at most a width, the head first; no word is broken.

    Names are cut to what tells them apart; what all rows share, or other columns say, is left out; long cells go on
    below.

    Args:
        rows: The cells, as many as the head has.
        width: Columns of the terminal.
        short: Cuts names short.
        over_time: Whether the rows are intervals.
    """
    head: list[str] = [*(_INTERVAL_HEAD if over_time else _HEAD)]
    time, recording = (1, 0) if over_time else (2, 1)
    kept = [column for column in range(len(head)) if over_time or column != _LAST]
    table = [list(row) for row in rows]
    dates = {row[time][:_DATE] for row in table}
    if (
        not _fits(head, table, kept, width)
        and len(dates) == 1
        and all(row[time][_DATE - 1 :][:1] == " " for row in table)
    ):
        head[time] = dates.pop().strip()
        for row in table:
            row[time] = row[time][_DATE:]
    if not _fits(head, table, kept, width):
        for row in table:
            if over_time:
                number, _, first = row[_LAST].partition(_FROM)
                row[_LAST] = f"{number}{_FROM}{short.frame(first)}"
            else:
                row[0] = short.frame(row[0])
    if not _fits(head, table, kept, width):
        if not over_time and all(row[0].startswith(f"{row[recording]}/") for row in rows):
            kept.remove(recording)
        for row in table:
            row[recording] = short.recording(row[recording])
    if not _fits(head, table, kept, width):
        ids = _cut([part.partition("=")[2] for row in rows for part in row[_OBJECTS].split()])
        for row in table:
            row[_OBJECTS] = _with_ids(row[_OBJECTS], ids)
    if over_time and not _fits(head, table, kept, width) and _narrowest(table, kept) > width:
        for row in table:
            row[_LAST] = row[_LAST].partition(_FROM)[0]
    for dispensable in (_LAST, time) if over_time else (time, recording):
        if dispensable in kept and not _fits(head, table, kept, width) and _narrowest(table, kept) > width:
            kept.remove(dispensable)
    return _wrapped([head, *table], kept, width)


def _fits(head: Sequence[str], table: Sequence[Sequence[str]], kept: list[int], width: int) -> bool:
    """Whether rows fit without breaking long cells."""
    widths = [max(len(printable(row[column])) for row in (head, *table)) for column in kept]
    return sum(widths) + 2 * (len(kept) - 1) <= width


def _cut(ids: list[str]) -> dict[str, str]:
    """Ids by their beginnings, as long as needed to tell them apart."""
    distinct = set(ids)
    length = min(_SHORTEST_ID, max(map(len, distinct), default=0))
    while len({each[:length] for each in distinct}) < len(distinct):
        length += 1
    return {each: each[:length] for each in distinct}


def _with_ids(objects: str, ids: Mapping[str, str]) -> str:
    parts = [part.partition("=") for part in objects.split()]
    return " ".join(f"{role}={ids[label]}" if equals else role for role, equals, label in parts)


def _longest_word(table: Sequence[Sequence[str]], column: int) -> int:
    return max(len(word) for row in table for word in (row[column].split() or [""]))


def _narrowest(table: Sequence[Sequence[str]], kept: list[int]) -> int:
    """The least width at which no word is broken, with some room for long cells."""
    widths = [
        max(_NARROWEST, _longest_word(table, column))
        if column in (_VERDICT, _OBJECTS)
        else max(len(row[column]) for row in table)
        for column in kept
    ]
    return sum(widths) + 2 * (len(kept) - 1)


def _wrapped(table: Sequence[Sequence[str]], kept: list[int], width: int) -> list[str]:
    widths = {column: max(len(printable(row[column])) for row in table) for column in kept}
    room = width - sum(widths[column] for column in kept if column not in (_VERDICT, _OBJECTS)) - 2 * (len(kept) - 1)
    least = _longest_word(table, _VERDICT)
    if widths[_VERDICT] + widths[_OBJECTS] > room:
        wanted = max(least, room - widths[_OBJECTS], room // 2)
        widths[_VERDICT] = min(widths[_VERDICT], wanted)
        widths[_OBJECTS] = max(_longest_word(table, _OBJECTS), room - widths[_VERDICT])
    lines: list[str] = []
    for row in table:
        texts = {column: printable(row[column]) for column in kept}
        cells = [
            textwrap.wrap(texts[column], widths[column], break_long_words=False, break_on_hyphens=False) or [""]
            for column in kept
        ]
        for number in range(max(map(len, cells))):
            parts = [
                (cell[number] if number < len(cell) else "").ljust(widths[column])
                for cell, column in zip(cells, kept, strict=True)
            ]
            lines.append("  ".join(parts).rstrip())
    return lines


def _cells(record: Record) -> Row:
    cause = record.cause or CauseRecord()
    near = cause.what in ("tolerance", "program", "--min-duration")
    density = None if record.log_density is UNSET else record.log_density
    if density is not None:
        why = f"{density:.2f}"
    elif record.log_density is not UNSET and record.verdict == "match":
        why = f"no density ({record.no_density})"
    else:
        why = cause.reason or (cause.detail if near else cause.what) or _recorded(record)
    objects = [f"{role}={label}" for role, label in record.correspondence.items() if (role, label) != ("ego", "ego")]
    verdict = f"{record.verdict}: {why}" if why else record.verdict
    if isinstance(record, IntervalRecord):
        return (
            record.recording,
            moment(record.start_us),
            f"{(record.end_us - record.start_us) / 1e6:.1f}",
            verdict if record.timeline is UNSET else _with_modes(verdict, _modes(record.timeline)),
            " ".join(objects) or "-",
            f"{record.frames.count}{_FROM}{record.frames.first}",
        )
    sensors = sorted(record.sensors.items(), key=lambda item: (not item[0].startswith("CAM_FRONT"), item))
    return (
        record.frame,
        record.recording,
        moment(record.timestamp_us),
        verdict,
        " ".join(objects) or "-",
        sensors[0][1] if sensors else "-",
    )


def _with_modes(verdict: str, modes: str) -> str:
    """A verdict and what roles do."""
    return f"{verdict}{',' if ':' in verdict else ':'} {modes}" if modes else verdict


def _modes(modes: Sequence[ModeRecord]) -> str:
    """What roles do, in short: `lead: FollowLaneBehavior(8) 3.2 s, take SetBrakeAction(1) 0.8 s`."""
    told: dict[str, list[str]] = {}
    for each in modes:
        if each.kind != "behavior":
            continue
        what = each.mode[-1].what if each.mode else "?"
        told.setdefault(each.of, []).append(f"{what} {(each.end_us - each.start_us) / 1e6:.1f} s")
    parts = [
        f"{of}: {', '.join([*several[:_MODES_SHOWN], *(['...'] if len(several) > _MODES_SHOWN else [])])}"
        for of, several in told.items()
    ]
    return "; ".join(parts)


def _recorded(record: Record) -> str:
    """The recorded values of a match, in short; over an interval from the least to the greatest."""
    return ", ".join(f"{name} {_short(value)}" for name, value in (record.recorded or {}).items())


def _short(value: CellRecord | SeriesRecord) -> str:
    match value:
        case SeriesRecord(minimum=int() | float() as least, maximum=int() | float() as most):
            return f"{show_cell(least)} to {show_cell(most)}"
        case SeriesRecord():
            return f"{show_cell(value.first)} ... {show_cell(value.last)}"
        case _:
            return show_cell(value)
