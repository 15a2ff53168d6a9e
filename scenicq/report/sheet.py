"""The first screen of a report: the best frame of each run side by side, and one timeline a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby

from scenicq.report.runs import FrameRun
from scenicq.report.svg import element, escape

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


def tile(run: FrameRun, number: int, best: int, picture: str) -> str:
    """A small picture of a run's best frame, which links to the run.

    Args:
        run: The run.
        number: The run's number, from 1.
        best: Index of its best frame.
        picture: Markup of the small picture.
    """
    count = len(run.results)
    where = f"frame {run.first + best}" + (f" of {run.first}\N{EN DASH}{run.first + count - 1}" if count > 1 else "")
    kind = "" if run.kind == "match" else element("span", _KINDS[run.kind], class_=f"badge {run.kind}")
    told = element("b", escape(run.recording)) + " " + element("span", where, class_="time") + " " + kind
    return element("a", picture, element("span", told, class_="told"), class_="tile", href=f"#run-{number}",
                   data_run=f"run-{number}", data_frame=best + 1)  # fmt: skip


def sheet_section(tiles: Sequence[str], runs: int) -> str:
    """All small pictures.

    Args:
        tiles: As `tile` gives them.
        runs: How many runs there are.
    """
    if not tiles:
        return ""
    told = "Each run is shown by the frame in which its objects are nearest to the ego."
    if runs > len(tiles):
        told += f" {runs - len(tiles):,} more runs are below."
    return element(
        "section",
        element("h2", "At a glance", id="sheet-title"),
        element("p", told, class_="hint"),
        element("div", *tiles, class_="sheet"),
        aria_labelledby="sheet-title",
    )


def timelines_section(runs: Sequence[FrameRun], *, over_time: bool = False) -> str:
    """Where in each recording the runs are.

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
    note = element("p", f"{left:,} more recordings are not shown here.", class_="hint") if left > 0 else ""
    return element(
        "section",
        element("h2", "Recordings", id="recordings-title"),
        element("ul", *rows, class_="recordings"),
        note,
        aria_labelledby="recordings-title",
    )


def _timeline(name: str, runs: Sequence[tuple[int, FrameRun]], *, over_time: bool) -> str:
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
    told = f"{said} in {of:,} frame{'' if of == 1 else 's'}"
    return element("li", element("b", escape(name)), strip, element("span", told, class_="time"))
