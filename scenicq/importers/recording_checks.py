"""What no recording of sound units and one clock has: told and counted, taken as it is, no problem of its source."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from scenicq.importers.report import Report
from scenicq.store.columns import RecordingColumns
from scenicq.store.motion import track_numbers

__all__ = ["radians", "tell_order", "tell_recording"]

_FEWEST_TIMES, _SHORTEST_STEP_US, _LONGEST_STEP_US = 3, 1e3, 1e8
"""Labels more often than a thousand times a second, or less often than every 100 s, have times in another unit."""

_LARGEST_ANGLE = 4 * math.pi
"""Radians: some sources count turns on, but hardly more than two."""

_NO_ANGLE = 1e9
"""From here on a number is no angle in any unit; that is for the reader of the field to tell."""

_SHORTEST_JUMP_M, _FASTEST_M_S = 5.0, 100.0
"""Metres beyond which a step is no inaccuracy of labels, and a speed that nothing on a road has."""

_FEWEST_STEPS, _MOST_STEPS_BACK = 9, 0.1
"""Where nothing numbers labels, with fewer steps, or a larger share of them back, they may be in no order at all."""


def radians(angle: float, report: Report) -> float:
    """An angle as it is; one that is no angle in radians is told.

    Args:
        angle: As a source has it.
        report: Takes what is told.
    """
    if _LARGEST_ANGLE < abs(angle) < _NO_ANGLE:
        message = f"an angle of {angle:g} is taken for radians; angles in degrees are to be divided by 57.29578"
        report.assume("object", "angles in radians", message)
    return angle


def tell_order(name: str, times_us: Sequence[int], report: Report, *, numbered: bool) -> None:
    """Tell a clock that was set back.

    Args:
        name: The name of the recording.
        times_us: The times of its labels, as the source orders them.
        report: Takes what is told.
        numbered: Whether the source numbers its labels, so that their order is no accident.
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


def tell_recording(columns: RecordingColumns, report: Report) -> None:
    """Tell a rate that no recorder has, and tracks whose class changes or that jump.

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
    _tell_jumps(columns, report)


def _tell_jumps(columns: RecordingColumns, report: Report) -> None:
    """Tell tracks that are twice somewhere nothing gets from one place to the other in time."""
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
