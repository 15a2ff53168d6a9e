"""Advice where nothing, or hardly anything, matches: a few lines on standard error."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from scenicq.query.execution.run import Query

from .report import columns, count, printable

if TYPE_CHECKING:  # takes long to load
    from scenicq.query.explain.advice import ChangeForecast
    from scenicq.query.explain.changes import Change

__all__ = ["advise", "is_nearly_empty"]

_BUDGET_S = 1.0
_SCARCE = 1000
"""Frames of which at least one is expected to match."""
_LINES = 5


def is_nearly_empty(query: Query) -> bool:
    """Whether nothing matched, or less than one frame in a thousand."""
    return query.funnel.matches * _SCARCE < query.funnel.frames


def _number(outlook: ChangeForecast) -> str:
    about = "about " if outlook.sampled else ""
    if outlook.certain:
        return f"{about}{outlook.most:,}"
    return f"{about}{outlook.least:,} to {outlook.most:,}" if outlook.least else f"{about}at most {outlook.most:,}"


def advise(query: Query, *, asked: bool, near: bool = False) -> None:
    """Print what excludes most frames, and how many there would be with one change.

    Args:
        query: After its results were taken.
        asked: Whether the user asked for it, so that it may take its time.
        near: Whether what comes closest has been shown.
    """
    from scenicq.query.explain.advice import advice  # noqa: PLC0415 - takes long to load

    funnel = query.funnel
    # labels that had all their time have none left for what nobody asked for
    budget_s = math.inf if asked else 0.0 if funnel.reasons["timeout"] else _BUDGET_S
    found = advice(query, budget_s=budget_s, brief=not asked)
    lines = [f"{count(funnel.matches, 'match')} in {count(funnel.frames, 'frame')}"]
    if funnel.unknowns:
        lines[0] += f", {funnel.unknowns:,} unknown"
    if found.without_map:
        lines[0] += f"; {found.without_map:,} lie on maps that lack what the program needs"
    if found.first:
        what, frames = found.first[0]
        lines[0] += f"; {frames:,} fail first at `{printable(what)}`"
    none = "no single change leaves a frame" if found.complete else "no change that was tried leaves a frame"
    if found.outlooks:
        two = bool(found.outlooks[0].change.both)
        lines.append(f"{none}; with two there would be:" if two else "with one change there would be:")
        shown = found.outlooks if asked else found.outlooks[:_LINES]
        rows = [(_number(each), each.change.text, _place(each.change)) for each in shown]
        lines += columns(list(dict.fromkeys(rows)), right=frozenset({0}))
    else:
        lines.append(none)
    lines += [f"  = hint: {hint}" for hint in found.hints]
    if not asked:
        more = [] if near else ["`--near 3` shows the frames that come closest"]
        more += [] if found.complete else ["`--advise` tries all changes"]
        lines += [f"  = hint: {', '.join(more)}"] if more else []
    click.echo("\n".join(lines), err=True)


def _place(change: Change) -> str:
    """Where a change applies in the program, and what to write there."""
    told: list[str] = []
    for each in change.parts:
        span = each.span
        if span is not None and not (span.source.name.startswith("<") and span.source.name.endswith(".scenic>")):
            line = f"line {span.source.position(span.start)[0]}"
            told.append(f"{line}: `{each.written}`" if each.written else line)
    return ", ".join(dict.fromkeys(told))
