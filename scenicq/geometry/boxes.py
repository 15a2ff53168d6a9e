"""Boxes: the footprints of objects."""

from __future__ import annotations

from typing import cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from scenicq.geometry.angles import direction

__all__ = ["box_polygon", "box_polygons", "corners"]


def corners(x: float, y: float, heading: float, width: float, length: float) -> NDArray[np.float64]:
    """Corners of a box, shape (4, 2): front right, front left, back left, back right (counter-clockwise).

    Args:
        x: Centre, metres.
        y: Centre, metres.
        heading: Radians; the front looks along it.
        width: Metres across the heading.
        length: Metres along the heading.
    """
    ahead = np.array(direction(heading)) * (length / 2)
    right = np.array((np.cos(heading), np.sin(heading))) * (width / 2)
    center = np.array((x, y))
    return np.stack([center + ahead + right, center + ahead - right, center - ahead - right, center - ahead + right])


def box_polygons(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    heading: NDArray[np.float64],
    width: NDArray[np.float64],
    length: NDArray[np.float64],
) -> NDArray[np.object_]:
    """`box_polygon` of arrays (n,), which each have one number a box."""
    ahead = np.stack([-np.sin(heading), np.cos(heading)], axis=1) * (length / 2)[:, None]
    right = np.stack([np.cos(heading), np.sin(heading)], axis=1) * (width / 2)[:, None]
    sides = np.stack([ahead + right, ahead - right, -ahead - right, right - ahead], axis=1)
    return cast("NDArray[np.object_]", shapely.polygons(np.stack([x, y], axis=1)[:, None] + sides))


def box_polygon(x: float, y: float, heading: float, width: float, length: float) -> Polygon:
    """The box as a polygon; see `corners`."""
    return Polygon(corners(x, y, heading, width, length))
