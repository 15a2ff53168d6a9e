"""Measures of the field: when boxes touch if nothing changes, and how tracks go on.

A measure of tracks lies between two numbers, which are equal where it is known. Metres, seconds, radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree

from scenicq.geometry.driven_courses import CoursePlace

__all__ = [
    "NEVER",
    "OF_TRACKS",
    "STANDING_MPS",
    "MeasureName",
    "MovingBoxes",
    "measure_tracks",
    "time_to_collision",
]

NEVER = 1e6
"""What stands for the time, or the deceleration, of what never comes, or cannot be had: it can be compared."""
STANDING_MPS = 1e-6
"""Below this, something counts as not moving."""
_UNKNOWN = 1e12
"""Farther off than any measure."""

MeasureName = Literal["jerk", "course_change", "post_encroachment_time", "time_to_collision"]
Ends = tuple[float, float]
Numbers = NDArray[np.float64]


class MovingBoxes(NamedTuple):
    """Boxes with their velocities, arrays that broadcast with each other."""

    position: tuple[Numbers, Numbers]
    heading: Numbers
    velocity: tuple[Numbers, Numbers]
    width: Numbers
    length: Numbers


def time_to_collision(one: MovingBoxes, other: MovingBoxes) -> Numbers:
    """Seconds until boxes touch if they keep their velocities and do not turn; 0 where they do, `NEVER` for never."""
    begin, end = np.array(-np.inf), np.array(np.inf)
    # they touch while their shadows on the directions of all their sides do
    for own, far in ((one, other), (other, one)):
        turned = far.heading - own.heading
        cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
        right, ahead = (np.cos(own.heading), np.sin(own.heading)), (-np.sin(own.heading), np.cos(own.heading))
        for (x, y), mine, near, side in ((right, own.width, far.width, far.length),
                                         (ahead, own.length, far.length, far.width)):  # fmt: skip
            reach = (mine + near * cos + side * sin) / 2
            away, speed = (
                (b[0] - a[0]) * x + (b[1] - a[1]) * y
                for a, b in ((one.position, other.position), (one.velocity, other.velocity))
            )
            moves, meets = np.abs(speed) > STANDING_MPS, np.abs(away) <= reach
            divisor = np.where(moves, speed, 1.0)
            middle, half = -away / divisor, reach / np.abs(divisor)
            begin = np.maximum(begin, np.where(moves, middle - half, np.where(meets, -np.inf, np.inf)))
            end = np.minimum(end, np.where(moves, middle + half, np.inf))
    return np.where((begin <= end) & (end >= 0), np.clip(begin, 0.0, NEVER), NEVER)


def measure_tracks(name: MeasureName, courses: tuple[CoursePlace, ...], seconds: float) -> Ends:
    """The numbers between which a measure lies.

    Args:
        name: The measure.
        courses: The courses of the objects that it is about, with where on them they are.
        seconds: How long a course change takes.
    """
    return _MEASURES[name](courses, seconds)


def _jerk(courses: tuple[CoursePlace, ...], _seconds: float) -> Ends:
    """The slope of the acceleration along the heading, m/s³."""
    (own,) = courses
    value = math.nan if own.stretch is None else float(own.stretch.jerks[own.sample])
    return (-_UNKNOWN, _UNKNOWN) if math.isnan(value) else (value, value)


def _course_change(courses: tuple[CoursePlace, ...], seconds: float) -> Ends:
    """How far the course turns to the left in the next seconds; unknown where the track ends before."""
    (own,) = courses
    unknown = -_UNKNOWN, _UNKNOWN
    if own.stretch is None:
        return unknown
    times = own.stretch.times_s
    later = int(np.count_nonzero(times < times[own.sample] + seconds - 1e-6))
    if later >= len(times):
        return unknown
    directions = own.stretch.directions
    change = float(directions[later] - directions[own.sample]) if len(directions) else 0.0
    return change, change


def _post_encroachment_time(courses: tuple[CoursePlace, ...], _seconds: float) -> Ends:
    """The least time between samples in which the one box and the other cover a common place."""
    one, other = (each.stretch for each in courses)
    if one is None or other is None:
        return 0.0, NEVER
    if one is other:
        return 0.0, 0.0
    boxes, known = zip(*((each.boxes, each.is_boxed) for each in (one, other)), strict=True)
    low, high = 0.0, NEVER
    if len(boxes[0]) and len(boxes[1]):
        first, second = STRtree(boxes[1]).query(boxes[0], predicate="intersects")
        apart = np.abs(one.times_s[known[0]][first] - other.times_s[known[1]][second])
        high = min(float(apart.min(initial=NEVER)), NEVER)
    # a box that is not known might be anywhere
    return (high if known[0].all() and known[1].all() else low), high


_MEASURES: dict[MeasureName, Callable[[tuple[CoursePlace, ...], float], Ends]] = {
    "jerk": _jerk,
    "course_change": _course_change,
    "post_encroachment_time": _post_encroachment_time,
}
OF_TRACKS = frozenset(_MEASURES)
"""The measures that are asked of tracks, and are known up to two ends."""
