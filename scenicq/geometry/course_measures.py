"""Measures of how tracks go on: what an object has driven and will drive, and when others are where it was.

A measure lies between two numbers, which are equal where it is known. Metres, seconds, radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from shapely import STRtree

from scenicq.geometry.driven_courses import CoursePlace

__all__ = ["NEVER", "CourseMeasureName", "measure_courses"]

NEVER = 1e6
"""What stands for the time, or the deceleration, of what never comes, or cannot be had: it can be compared."""
_UNKNOWN = 1e12
"""Farther off than any measure."""

CourseMeasureName = Literal["jerk", "course_change", "post_encroachment_time"]
Ends = tuple[float, float]


def measure_courses(name: CourseMeasureName, courses: tuple[CoursePlace, ...], seconds: float) -> Ends:
    """The numbers between which a measure lies.

    Args:
        name: The measure.
        courses: Of the objects that it is about, with where on them they are.
        seconds: Of a course change, over how long.
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
    later = int(np.searchsorted(times, times[own.sample] + seconds - 1e-6))
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


_MEASURES: dict[CourseMeasureName, Callable[[tuple[CoursePlace, ...], float], Ends]] = {
    "jerk": _jerk,
    "course_change": _course_change,
    "post_encroachment_time": _post_encroachment_time,
}
