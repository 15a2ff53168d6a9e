"""The first screen of a report: the best frame of each run side by side, and one timeline a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from scenicq.report.runs import FrameRun
from scenicq.report.svg import element
from scenicq.report.templates import markup

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["TILES", "sheet_section", "tile", "timelines_section", "to_picture"]

TILES = 20
"""Runs that are pictured side by side at most."""
_ROWS = 100
"""Recordings that have a timeline at most."""
_KINDS = {"match": "match", "unknown": "unknown", "near": "near miss"}
_LEAST = 0.006
"""Share of a timeline's width that a run has at least, so that it is seen."""


def to_picture(runs: Sequence[FrameRun]) -> frozenset[int]:
    """Choose the runs to picture side by side, by number from 1: first one of each recording, then the next ones.

    Args:
        runs: All runs.
    """
    seen: Counter[str] = Counter()
    turns: list[tuple[int, int]] = []
    for number, run in enumerate(runs, 1):
        turns.append((seen[run.recording], number))
        seen[run.recording] += 1
    return frozenset(number for _, number in sorted(turns)[:TILES])


def tile(run: FrameRun, number: int, best: int, picture: str) -> Markup:
    """A small picture of a run's best frame, which links to the run.

    Args:
        run: The run.
        number: The run's number, from 1.
        best: Index of its best frame.
        picture: Markup of the small picture.
    """
    count = len(run.results)
    where = f"frame {run.first + best}" + (f" of {run.first}\N{EN DASH}{run.first + count - 1}" if count > 1 else "")
    return markup(
        "sheet", "tile", number=number, frame=best + 1, picture=picture, recording=run.recording, where=where,
        kind=run.kind, words=_KINDS[run.kind],
    )  # fmt: skip


def sheet_section(tiles: Sequence[Markup], runs: int) -> str:
    """All small pictures; nothing where there are none.

    Args:
        tiles: As `tile` gives them.
        runs: How many runs there are.
    """
    if not tiles:
        return ""
    told = "Each run is shown by the frame in which its objects are nearest to the ego."
    if runs > len(tiles):
        told += f" {runs - len(tiles):,} more runs are below."
    return markup("sheet", "sheet_section", tiles=tiles, told=told)


def timelines_section(runs: Sequence[FrameRun], *, over_time: bool = False) -> str:
    """Where in each recording the runs are; nothing where there are none.

    Args:
        runs: All runs.
        over_time: Whether each is an interval; these may share frames.
    """
    numbered = sorted(enumerate(runs, 1), key=lambda each: each[1].recording)
    groups = [(name, list(group)) for name, group in groupby(numbered, key=lambda each: each[1].recording)]
    if not groups:
        return ""
    rows = [_timeline(name, group, over_time=over_time) for name, group in groups[:_ROWS]]
    left = len(groups) - len(rows)
    return markup("sheet", "timelines_section", rows=rows, left=f"{left:,}" if left > 0 else "")


def _timeline(name: str, runs: Sequence[tuple[int, FrameRun]], *, over_time: bool) -> tuple[str, str, str]:
    """The name of a recording, where its runs are, and the same in words."""
    of = runs[0][1].of
    marks: list[str] = []
    for number, run in runs:
        frames = run.first if len(run.results) == 1 else f"{run.first}\N{EN DASH}{run.first + len(run.results) - 1}"
        told = f"{_KINDS[run.kind]}: {'frame' if len(run.results) == 1 else 'frames'} {frames}"
        wide = max(len(run.results), _LEAST * of)
        bar = element("rect", element("title", told), x=f"{min(run.first - 1, of - wide):.3f}", y=0,
                      width=f"{wide:.3f}", height=10, class_=run.kind)  # fmt: skip
        marks.append(element("a", bar, href=f"#run-{number}", aria_label=told))
    counts = Counter[str]()
    for _, run in runs:
        counts[run.kind] += len(run.results)
    said = ", ".join(
        f"{count:,} {_KINDS[kind] if count == 1 or kind == 'unknown' else _KINDS[kind] + 'es'}"
        for kind, count in counts.items()
    )
    if over_time:
        said = f"{len(runs):,} {'interval' if len(runs) == 1 else 'intervals'}"
    track = element("rect", class_="track", width=of, height=10)
    strip = element("svg", track, *marks, viewBox=f"0 0 {of} 10", preserveAspectRatio="none", class_="strip")
    return name, strip, f"{said} in {of:,} frame{'' if of == 1 else 's'}"
