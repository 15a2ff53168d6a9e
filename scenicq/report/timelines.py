"""Intervals in a report: their frames as a run, and under the slider a timeline of what roles did and what held."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from scenicq.query.execution.interval_frames import frames_of, verdict_at
from scenicq.query.execution.recorded_columns import show_cell
from scenicq.query.execution.results import CarriedValue, ModeRecord, RecordedCell, Result
from scenicq.query.execution.run import Query
from scenicq.query.explain.bands import Band, bands_of, conditions_over
from scenicq.query.explain.interval_explanation import locate_interval
from scenicq.report.runs import FrameRun
from scenicq.report.svg import element, escape
from scenicq.report.templates import markup

if TYPE_CHECKING:
    pass

__all__ = ["interval_runs"]

_Lane = tuple[str, Sequence[tuple[str, str]], str]
"""Whose lane it is, what is done with the class of its colour, and the lane."""
_COLOURS = 8
"""Colours that tell modes apart; more begin anew."""
_WORDS = ("false", "unknown", "true")


def interval_runs(query: Query, results: Iterable[Result], numbers: dict[str, tuple[int, int]]) -> Iterator[FrameRun]:
    """Make a run for each interval; its frames have the label objects of the roles.

    Args:
        query: The query.
        results: Intervals.
        numbers: As `scenicq.report.runs.frame_numbers` gives them.
    """
    for result in query.with_timelines([*results]):
        frames = tuple(
            Result(
                label.frame, label.recording, label.timestamp_us, verdict_at(label, result), label.sensors,
                recorded=_at_sample(result.recorded or {}, place),
            )
            for place, (label, _) in enumerate(frames_of(query.dataset, result))
        )  # fmt: skip
        number, count = numbers[result.frame]
        yield FrameRun(result.recording, frames, number, count, _timeline(query, result))


def _at_sample(recorded: Mapping[str, CarriedValue], place: int) -> Mapping[str, CarriedValue]:
    """The recorded values at a sample, and those of the whole interval."""
    return {
        name: CarriedValue((each.values[place],), series=False) if each.series else each
        for name, each in recorded.items()
    }


def _timeline(query: Query, result: Result) -> str:
    """What roles do in an interval, and its bands, as a picture; and curves of what the program records."""
    curves = [_curve(name, each.values) for name, each in (result.recorded or {}).items() if each.series]
    scenario, tracks, interval = locate_interval(query, result)
    bands = () if scenario.dynamics is None else bands_of(scenario, conditions_over(scenario, tracks, interval))
    times_us = tracks.times_us[interval.start : interval.end + 1].tolist()
    return _drawn(bands, [*_lanes(result.timeline or (), times_us)], [*filter(None, curves)])


def _lanes(modes: Sequence[ModeRecord], times_us: Sequence[int]) -> Iterator[_Lane]:
    """A lane for each role, monitor and scenario, coloured by what is done, with what that is and when."""
    lanes: dict[tuple[str, str], list[ModeRecord]] = {}
    for each in modes:
        lanes.setdefault((each.kind, each.of), []).append(each)
    at = {time: place for place, time in enumerate(times_us)}
    for (kind, of), mine in lanes.items():
        # of a scenario one colour will do
        places = [each.mode[-1].place if each.mode else "" for each in mine]
        colours = {place: number % _COLOURS for number, place in enumerate(dict.fromkeys(places))}
        strips: list[str] = []
        told: dict[str, list[str]] = {}
        for each, place in zip(mine, places, strict=True):
            span = f"{(each.start_us - times_us[0]) / 1e6:.1f}-{(each.end_us - times_us[0]) / 1e6:.1f} s"
            what = each.mode[-1].what if each.mode else "not known"
            told.setdefault(place, [what]).append(span)
            where = " in ".join(f"{one.what} ({one.place})" for one in reversed(each.mode))
            strips.append(
                element("rect", element("title", escape(f"{where or what}: {span}")), x=at[each.start_us], y=0,
                        width=each.frames, height=10, class_=f"chip c{colours[place]}" if each.mode else "unknown")
            )  # fmt: skip
        strips.append(element("line", class_="now", x1=0.5, x2=0.5, y1=0, y2=10))
        texts = {place: f"{what} {', '.join(spans)}" for place, (what, *spans) in told.items()}
        strip = element("svg", *strips, class_="strip lane", role="img", viewBox=f"0 0 {len(times_us)} 10",
                        preserveAspectRatio="none", aria_label=f"{of}: {'; '.join(texts.values())}")  # fmt: skip
        keys = [(text, f"chip c{colours[place]}" if place else "") for place, text in texts.items()]
        yield of if kind == "behavior" else f"{kind} {of}", keys, strip


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


def _drawn(bands: tuple[Band, ...], lanes: Sequence[_Lane], curves: Sequence[tuple[str, str]]) -> str:
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
    return markup("sheet", "timeline", lanes=lanes, bands=rows, curves=curves) if lanes or rows or curves else ""


def _pieces(values: tuple[int, ...]) -> Iterator[tuple[int, int, int]]:
    """Runs of one value: where they begin, how long they are, the value."""
    start = 0
    for place in range(1, len(values) + 1):
        if place == len(values) or values[place] != values[start]:
            yield start, place - start, values[start]
            start = place


def _summary(values: tuple[int, ...]) -> str:
    return ", ".join(f"{_WORDS[value]} for {length}" for _, length, value in _pieces(values))
