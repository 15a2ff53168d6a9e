"""Moments of recordings as people name them, and the intervals that they lie in."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import closing

import numpy as np

from scenicq.errors import DataError, Diagnostic
from scenicq.match.verdict import Match
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.store.dataset import Dataset
from scenicq.store.frame_names import find_recording
from scenicq.store.labels import Label

__all__ = ["Moment", "frame_time", "intervals_around", "named_frame", "named_moment"]

Moment = tuple[str, int | float | None]
"""A recording, and a timestamp in microseconds, or seconds from where it begins as a float; None for all of it."""

_ROUNDED_S = 0.05
"""Seconds are shown to a tenth."""


def named_moment(dataset: Dataset, text: str) -> Moment | None:
    """The recording, or the moment in one, that a text names as `RECORDING`, `RECORDING@TIMESTAMP` or `RECORDING@3.5s`.

    Returns:
        None where it names no recording, as where it is the name of a frame.
    """
    recordings = dataset.manifest.by_recording
    begun, at, time = text.rpartition("@")
    if at and text not in recordings and (name := find_recording(recordings, begun)) is not None:
        if time.isdecimal():
            return name, int(time)
        if re.fullmatch(r"\d+(\.\d+)? ?s", time, re.ASCII):
            return name, float(time.removesuffix("s"))
    name = find_recording(recordings, text)
    return None if name is None else (name, None)


def frame_time(name: str, times_us: Sequence[int], moment: int | float) -> int:
    """The timestamp of the frame at a moment: at a timestamp, or nearest to some seconds.

    Args:
        name: The recording's.
        times_us: The timestamps of its frames, in order.
        moment: A timestamp in microseconds, or, as a float, the seconds from where the recording begins, to half the
            time between two frames.

    Raises:
        DataError: option-invalid: there is no frame.
    """
    seconds = (np.array(times_us) - times_us[0]) / 1e6
    if isinstance(moment, int):
        if moment in times_us:
            return moment
        told = str(moment)
    else:
        place = int(np.argmin(abs(seconds - moment)))
        apart = np.diff(seconds)
        if abs(float(seconds[place]) - moment) <= (float(np.median(apart)) / 2 if len(apart) else 0.0) + _ROUNDED_S:
            return times_us[place]
        told = f"{moment:g} s"
    frames = ", ".join(f"{time} ({second:.1f} s)" for time, second in zip(times_us[:3], seconds.tolist(), strict=False))
    hint = f"its {len(times_us):,} frames are at {frames} ... to {float(seconds[-1]):.1f} s"
    raise DataError(Diagnostic("option-invalid", f"{name} has no frame at {told}", hints=(hint,)))


def named_frame(dataset: Dataset, text: str) -> Label:
    """The frame that a text names by its own name, or by a moment of its recording.

    Raises:
        DataError: option-invalid: there is none.
    """
    moment = named_moment(dataset, text) if "@" in text else None
    if moment is None or moment[1] is None:
        return dataset.label(text)
    recording, time = moment[0], moment[1]
    with closing(dataset.connect()) as connection:
        rows: list[tuple[int, str]] = connection.execute(
            "SELECT timestamp_us, frame FROM labels WHERE recording = ? ORDER BY ALL", [recording]
        ).fetchall()
    time_us = frame_time(recording, [each for each, _ in rows], time)
    return dataset.label(next(frame for each, frame in rows if each == time_us))


def intervals_around(query: Query, label: Label) -> list[Result]:
    """The intervals in which a frame lies: those that match first, then those that begin with it, then the earliest.

    Args:
        query: A query over time.
        label: The frame.

    Raises:
        ScenarioError: The program does not fit the map of the frame.
    """
    world = query.compiled_map(label.map)
    alone = query.alone(label.recording, label.map, world, query.options)
    found = [
        each
        for each in alone.results()
        if each.interval is not None and each.timestamp_us <= label.timestamp_us <= each.interval.end_us
    ]
    return sorted(
        found,
        key=lambda each: (
            not isinstance(each.verdict, Match), each.timestamp_us != label.timestamp_us, each.timestamp_us,
        ),
    )  # fmt: skip
