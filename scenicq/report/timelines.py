"""Intervals in a report: their frames as a run, and under the slider a timeline of what held when."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from scenicq.query.execution.interval_frames import frames_of, verdict_at
from scenicq.query.execution.recorded_columns import show_cell
from scenicq.query.execution.results import Recorded, RecordedCell, Result
from scenicq.query.execution.run import Query
from scenicq.query.explain.bands import Band, bands_of, conditions_over
from scenicq.query.explain.interval_explanation import placed
from scenicq.report.runs import FrameRun
from scenicq.report.svg import element, escape
from scenicq.report.templates import markup

if TYPE_CHECKING:
    pass

__all__ = ["interval_runs"]

_WORDS = ("false", "unknown", "true")


def interval_runs(query: Query, results: Iterable[Result], numbers: dict[str, tuple[int, int]]) -> Iterator[FrameRun]:
    """Make a run for each interval; its frames have the label objects of the roles.

    Args:
        query: The query.
        results: Intervals.
        numbers: As `scenicq.report.runs.frame_numbers` gives them.
    """
    for result in results:
        frames = tuple(
            Result(
                label.frame, label.recording, label.timestamp_us, verdict_at(label, result), label.sensors,
                recorded=_at_sample(result.recorded or {}, place),
            )
            for place, (label, _) in enumerate(frames_of(query.dataset, result))
        )  # fmt: skip
        number, count = numbers[result.frame]
        yield FrameRun(result.recording, frames, number, count, _timeline(query, result))


def _at_sample(recorded: Mapping[str, Recorded], place: int) -> Mapping[str, Recorded]:
    """The recorded values at a sample, and those of the whole interval."""
    return {
        name: Recorded((each.values[place],), series=False) if each.series else each for name, each in recorded.items()
    }


def _timeline(query: Query, result: Result) -> str:
    """The bands of an interval as a picture, and curves of what the program records."""
    curves = [_curve(name, each.values) for name, each in (result.recorded or {}).items() if each.series]
    scenario, tracks, interval = placed(query, result)
    bands = () if scenario.dynamics is None else bands_of(scenario, conditions_over(scenario, tracks, interval))
    return _drawn(bands, [*filter(None, curves)])


def _curve(name: str, values: Sequence[RecordedCell]) -> tuple[str, str] | None:
    """Numbers over the samples in words and drawn, with gaps where there are none; None of what has no numbers."""
    numbers = [None if each is None or isinstance(each, str | tuple) else float(each) for each in values]
    known = [each for each in numbers if each is not None]
    if not known:
        return None
    least, most = min(known), max(known)
    height = (most - least) or 1.0
    points = [
        None if each is None else (n + 0.5, 9.0 - 8.0 * (each - least) / height) for n, each in enumerate(numbers)
    ]
    lines: list[str] = []
    for there, group in groupby(points, key=lambda each: each is not None):
        some = [each for each in group if each is not None]
        if there:
            # of one sample a short line
            (first, y), (last, _) = some[0], some[-1]
            some = [(first - 0.5, y), (last + 0.5, y)] if len(some) == 1 else some
            lines.append(element("polyline", points=" ".join(f"{x:g},{y:.3g}" for x, y in some), class_="curve"))
    told = f"{name}: {show_cell(least)} to {show_cell(most)}"
    lines.append(element("line", class_="now", x1=0.5, x2=0.5, y1=0, y2=10))
    strip = element("svg", element("title", escape(told)), *lines, class_="strip curves", role="img",
                    viewBox=f"0 0 {len(values)} 10", preserveAspectRatio="none", aria_label=told)  # fmt: skip
    return told, strip


def _drawn(bands: tuple[Band, ...], curves: Sequence[tuple[str, str]]) -> str:
    rows: list[tuple[str, bool, str]] = []
    for band in bands:
        count = len(band.values)
        strips = [
            element("rect", element("title", escape(f"{band.what}: {_WORDS[value]} at {length} of {count} samples")),
                    x=place, y=0, width=length, height=10, class_=f"band {_WORDS[value]}")
            for place, length, value in _pieces(band.values)
        ]  # fmt: skip
        # the script moves it with the slider
        strips.append(element("line", class_="now", x1=0.5, x2=0.5, y1=0, y2=10))
        strip = element("svg", *strips, class_="strip", role="img", viewBox=f"0 0 {count} 10",
                        preserveAspectRatio="none", aria_label=_summary(band.values))  # fmt: skip
        rows.append((band.what, band.is_requirement, strip))
    return markup("sheet", "timeline", bands=rows, curves=curves) if rows or curves else ""


def _pieces(values: tuple[int, ...]) -> Iterator[tuple[int, int, int]]:
    """Runs of one value: where they begin, how long they are, the value."""
    start = 0
    for place in range(1, len(values) + 1):
        if place == len(values) or values[place] != values[start]:
            yield start, place - start, values[start]
            start = place


def _summary(values: tuple[int, ...]) -> str:
    return ", ".join(f"{_WORDS[value]} for {length}" for _, length, value in _pieces(values))
