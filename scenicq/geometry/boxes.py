"""Boxes: the footprints of objects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from scenicq.geometry.angles import direction

__all__ = ["box_polygon", "corners"]


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


def box_polygon(x: float, y: float, heading: float, width: float, length: float) -> Polygon:
    """The box as a polygon; see `corners`."""
    return Polygon(corners(x, y, heading, width, length))
