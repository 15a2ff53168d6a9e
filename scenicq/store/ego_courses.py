"""How far each label object is along and beside the ego's course: columns of `objects`, made when a dataset is written.

A measure is known up to two ends (`scenicq.geometry.driven_courses`), which are equal nearly always. A column has one
end, and two more have how much less and how much more it may be: 0 nearly everywhere, which takes no room in a file.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.driven_courses import GAP_S, NO_COURSE, measure, track_courses
from scenicq.geometry.network import Network
from scenicq.store.columns import MemberColumns

__all__ = ["course_columns"]

Numbers = NDArray[np.float64]


def course_columns(
    network: Network, times_us: NDArray[np.int64], egos: MemberColumns, objects: MemberColumns, ego: NDArray[np.int64]
) -> dict[str, Numbers]:
    """Measure the label objects of a recording along and beside the course of its ego.

    Args:
        network: The map.
        times_us: The times of the labels, in order, shape (m,).
        egos: Their egos.
        objects: The label objects.
        ego: The number of the ego of each, shape (n,).

    Returns:
        By name `ego_along` and `ego_beside` with what each may be less and more, shape (n,); nan where there is no end.
    """
    there = np.flatnonzero([bool(each) for each in egos.category])
    places = np.column_stack((egos.x, egos.y, egos.heading))[there]
    times_s = (times_us - times_us[:1]) / 1e6
    courses = dict(zip(there.tolist(), track_courses(network, times_s[there], places, GAP_S), strict=True))
    found = measure([courses.get(each, NO_COURSE) for each in ego.tolist()], np.column_stack((objects.x, objects.y)))
    columns: dict[str, Numbers] = {}
    for name, ends in (("ego_along", found.along), ("ego_beside", found.beside)):
        low, high = (np.where(np.isinf(end), np.nan, end) for end in ends)
        value = columns[name] = np.where(np.isnan(low), high, low)
        columns[f"{name}_less"] = value - low
        columns[f"{name}_more"] = high - value
    return columns
