"""Checks for signs of wrong units, or of a clock that was set back.

A sign is reported and counted as an assumption; the values stay as they are, and `--strict` does not fail.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from scenicq.importers.report import Report
from scenicq.store.columns import RecordingColumns
from scenicq.store.motion import track_numbers

__all__ = ["check_order", "check_recording", "radians"]

_FEWEST_TIMES, _SHORTEST_STEP_US, _LONGEST_STEP_US = 3, 1e3, 1e8
"""At least three labels, and the mean step between them in microseconds. Others suggest another unit."""

_LARGEST_ANGLE = 4 * math.pi
"""Radians: some sources count turns on, but hardly more than two."""

_NO_ANGLE = 1e9
"""A number this large is no angle in any unit. The reader of the field reports it."""

_SHORTEST_JUMP_M, _FASTEST_M_S = 5.0, 100.0
"""A step jumps if it is longer than so many metres (labels are not so inexact) and faster than so many m/s."""

_FEWEST_STEPS, _MOST_STEPS_BACK = 9, 0.1
"""Labels without numbers are checked only if there are so many steps, and at most this share goes back.

Otherwise they may be in no order at all.
"""


def radians(angle: float, report: Report) -> float:
    """Return an angle unchanged, and report it if it is too large for radians.

    Args:
        angle: As a source has it.
        report: Takes what is told.
    """
    if _LARGEST_ANGLE < abs(angle) < _NO_ANGLE:
        message = f"an angle of {angle:g} is taken for radians; angles in degrees are to be divided by 57.29578"
        report.assume("object", "angles in radians", message)
    return angle


def check_order(name: str, times_us: Sequence[int], report: Report, *, numbered: bool) -> None:
    """Report that the times of a recording go back.

    Args:
        name: The name of the recording.
        times_us: The times of its labels, as the source orders them.
        report: Takes what is told.
        numbered: Whether the source numbers its labels, which proves that their order is meant.
    """
    steps = [after - before for before, after in pairwise(times_us)]
    back = sum(step < 0 for step in steps)
    if back and (numbered or (len(steps) >= _FEWEST_STEPS and back <= _MOST_STEPS_BACK * len(steps))):
        place = next(number for number, step in enumerate(steps) if step < 0)
        message = (
            f"in recording `{name}` time goes back {back} times in {len(times_us)} labels, first by "
            f"{-steps[place] / 1e6:g} s after label {place + 1}; labels are put in order of time"
        )
        report.assume("recording", f"order of times in {name}", message)


def check_recording(columns: RecordingColumns, report: Report) -> None:
    """Report an implausible rate of labels, tracks that change their class, and tracks that jump.

    Args:
        columns: The columns of the recording.
        report: Takes what is told.
    """
    times = columns.times_us
    step_us = (max(times) - min(times)) / (len(times) - 1) if len(times) >= _FEWEST_TIMES else _SHORTEST_STEP_US
    if not _SHORTEST_STEP_US <= step_us <= _LONGEST_STEP_US:
        message = (
            f"recording `{columns.name}` has a label every {step_us / 1e6:.3g} s; its times may not be microseconds"
        )
        report.assume("recording", "times in microseconds", message)
    objects = columns.objects
    classes = Counter(zip(objects.track, objects.source_class, strict=True))
    kinds: defaultdict[str, list[tuple[str, int]]] = defaultdict(list)
    for (track, kind), count in classes.items():
        if track is not None:
            kinds[track].append((kind, count))
    for track, found in kinds.items():
        if len(found) > 1:
            listed = " and ".join(f"`{kind}` in {count} frames" for kind, count in sorted(found))
            message = f"track `{track}` of recording `{columns.name}` is {listed}"
            report.assume("track", "tracks that change their class", message)
    _check_jumps(columns, report)


def _check_jumps(columns: RecordingColumns, report: Report) -> None:
    """Report tracks that move over 5 m at over 100 m/s between two labels, each at its first such step."""
    objects = columns.objects
    track = track_numbers(objects.track)
    time_us = np.repeat(np.array(columns.times_us, dtype=np.int64), columns.object_counts)
    order = np.argsort(track, kind="stable")
    track, time_us, x, y = track[order], time_us[order], objects.x[order], objects.y[order]
    away_m, passed_s = np.hypot(np.diff(x), np.diff(y)), np.diff(time_us) / 1e6
    with np.errstate(divide="ignore", invalid="ignore"):
        jumps = (np.diff(track) == 0) & (away_m > _SHORTEST_JUMP_M) & (away_m / passed_s > _FASTEST_M_S)
    (places,) = np.nonzero(jumps)
    for place in places[np.unique(track[places], return_index=True)[1]].tolist():
        message = (
            f"track `{objects.track[int(order[place])]}` of recording `{columns.name}` is {away_m[place]:.0f} m away "
            f"{passed_s[place]:g} s later; what is derived from its motion is as absurd"
        )
        report.assume("track", "tracks that jump", message)
