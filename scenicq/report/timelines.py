"""Intervals in a report: their frames as a run, and under the slider a timeline of what held when."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from scenicq.query.execution.interval_frames import frames_of, verdict_at
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.explain.bands import Band, bands_of
from scenicq.query.explain.interval_explanation import placed
from scenicq.report.runs import FrameRun
from scenicq.report.svg import element, escape

__all__ = ["interval_runs"]

_WORDS = ("false", "unknown", "true")


def interval_runs(query: Query, results: Iterable[Result], numbers: dict[str, tuple[int, int]]) -> Iterator[FrameRun]:
    """A run for each interval, whose frames have the label objects of the roles.

    Args:
        query: The query.
        results: Of intervals.
        numbers: As `scenicq.report.runs.frame_numbers` gives them.
    """
    for result in results:
        frames = tuple(
            Result(label.frame, label.recording, label.timestamp_us, verdict_at(label, result), label.sensors)
            for label, _ in frames_of(query.dataset, result)
        )
        number, count = numbers[result.frame]
        yield FrameRun(result.recording, frames, number, count, _timeline(query, result))


def _timeline(query: Query, result: Result) -> str:
    """The bands of an interval as a picture; nothing for a program about one instant."""
    scenario, tracks, interval = placed(query, result)
    if scenario.dynamics is None:
        return ""
    return _drawn(bands_of(scenario, tracks, interval))


def _drawn(bands: tuple[Band, ...]) -> str:
    rows: list[str] = []
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
        told = element("b" if band.is_requirement else "span", escape(band.what))
        rows.append(element("li", told, strip))
    return element("ul", *rows, class_="timeline", aria_label="Timeline") if rows else ""


def _pieces(values: tuple[int, ...]) -> Iterator[tuple[int, int, int]]:
    """Runs of one value: where they begin, how long they are, the value."""
    start = 0
    for place in range(1, len(values) + 1):
        if place == len(values) or values[place] != values[start]:
            yield start, place - start, values[start]
            start = place


def _summary(values: tuple[int, ...]) -> str:
    return ", ".join(f"{_WORDS[value]} for {length}" for _, length, value in _pieces(values))
