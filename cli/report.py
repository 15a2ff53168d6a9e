"""Text for people on standard error: diagnostics, counts, moments, aligned columns."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import click

from scenicq.errors import Diagnostic, Span, printable, render

__all__ = ["as_json", "columns", "count", "is_date", "moment", "printable", "show", "show_few"]

_FEW = 5
"""Diagnostics of one code shown at most, where there may be many."""


_FIRST_US, _LAST_US = 946_684_800_000_000, 4_102_444_800_000_000
"""Start of the years 2000 and 2100: no label was recorded before, or will be after."""


def show(diagnostics: Iterable[Diagnostic]) -> None:
    """Print diagnostics on standard error, with the headline in colour."""
    for diagnostic in diagnostics:
        headline, _, rest = printable(render(diagnostic)).partition("\n")
        kind, colon, message = headline.partition(":")
        colour = "red" if diagnostic.severity == "error" else "yellow"
        text = click.style(kind, fg=colour, bold=True) + click.style(colon + message, bold=True)
        click.echo(f"{text}\n{rest}" if rest else text, err=True)
        _name_page(diagnostic.code)


def _name_page(code: str) -> None:
    """Say to a person, once a command, where a code is explained."""
    context = click.get_current_context(silent=True)
    if context is not None and sys.stderr.isatty() and not context.meta.setdefault(_name_page.__qualname__, False):
        context.meta[_name_page.__qualname__] = True
        click.echo(click.style(f"(`scenicq codes {code}` says more)", dim=True), err=True)


def show_few(diagnostics: Iterable[Diagnostic]) -> None:
    """Print at most a handful of diagnostics of each code, then how many more there are."""
    seen: Counter[str] = Counter()
    for diagnostic in diagnostics:
        seen[diagnostic.code] += 1
        if seen[diagnostic.code] <= _FEW:
            show([diagnostic])
    for code, number in seen.items():
        if number > _FEW:
            click.echo(f"and {number - _FEW} more of [{code}]", err=True)


def count(number: int, what: str) -> str:
    """`1 frame`, `2 frames`, `12,345 frames`."""
    return f"{number:,} {what}{'' if number == 1 else 'es' if what.endswith('ch') else 's'}"


def moment(timestamp_us: int) -> str:
    """A timestamp as date and time (UTC), or as seconds where it is that of a clock without a date."""
    if not is_date(timestamp_us):
        return f"{timestamp_us / 1e6:.2f} s"
    time = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=timestamp_us)
    return time.strftime("%Y-%m-%d %H:%M:%S.%f")[:-4]


def is_date(timestamp_us: int) -> bool:
    """Whether a timestamp tells when something was recorded: Argoverse's clock starts in 1980, others at 0."""
    return _FIRST_US <= timestamp_us < _LAST_US


def columns(rows: Sequence[Sequence[str]], *, right: frozenset[int] = frozenset(), indent: str = "  ") -> list[str]:
    """Rows of cells as lines with aligned columns.

    Args:
        rows: The cells; all rows have as many.
        right: Indices of the columns that are aligned to the right.
        indent: What every line starts with.
    """
    rows = [[printable(cell).replace("\n", "\\n") for cell in row] for row in rows]
    widths = [max(len(row[number]) for row in rows) for number in range(len(rows[0]))] if rows else []
    return [
        indent
        + "  ".join(
            cell.rjust(width) if number in right else cell.ljust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _place(span: Span | None) -> dict[str, Any]:
    if span is None:
        return dict.fromkeys(("file", "line", "column", "end_line", "end_column"))
    line, column = span.source.position(span.start)
    end_line, end_column = span.source.position(span.end)
    return {
        "file": span.source.name,
        "line": line,
        "column": column,
        "end_line": end_line,
        "end_column": end_column,
    }


def as_json(diagnostic: Diagnostic) -> dict[str, Any]:
    """A diagnostic as plain values: lines and columns count from 1, the end is exclusive."""
    return {
        "code": diagnostic.code,
        "message": diagnostic.message,
        "severity": diagnostic.severity,
        **_place(diagnostic.span),
        "label": diagnostic.label,
        "notes": [{"text": note.text, **_place(note.span)} for note in diagnostic.notes],
        "hints": list(diagnostic.hints),
    }
