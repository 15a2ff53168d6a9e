"""Pinhole cameras: boxes of space as lines of an image."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Camera", "box_corners", "box_edges", "quaternion_matrix"]

Reals = NDArray[np.float64]

_NEAREST_M = 0.1
"""What is nearer than this to the plane of the camera is not seen."""
_EDGES = np.array([(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)])


class Camera(NamedTuple):
    """A camera at the moment of an image, without distortion.

    Attributes:
        width, height: Of the image, pixels.
        intrinsics: Focal lengths fx, fy and principal point cx, cy, pixels.
        position: x, y, z of the lens, metres, frame of the map.
        rotation: Unit quaternion w, x, y, z that turns the camera's frame (x right in the image, y down, z ahead) into
            that of the map.
    """

    width: int
    height: int
    intrinsics: tuple[float, float, float, float]
    position: tuple[float, float, float]
    rotation: tuple[float, float, float, float]


def quaternion_matrix(rotation: tuple[float, float, float, float]) -> Reals:
    """The matrix, shape (3, 3), of a quaternion w, x, y, z, which need not have length 1."""
    w, x, y, z = (value / math.hypot(*rotation) for value in rotation)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def box_corners(
    center: tuple[float, float, float], size: tuple[float, float, float], heading: float, pitch: float, roll: float
) -> Reals:
    """Corners of a box in the frame of the map, shape (8, 3): the four of the floor, then those above them.

    The first two of each four are the box's front.

    Args:
        center: Metres.
        size: Width, length and height, metres.
        heading: Radians, 0 along +y, counter-clockwise.
        pitch: Radians about the box's axis to the left.
        roll: Radians about its axis ahead.
    """
    width, length, height = size
    sp, cp, sr, cr = math.sin(pitch), math.cos(pitch), math.sin(roll), math.cos(roll)
    # x ahead, y to the left, z up: turned about x, then y, then z by the angle from +x
    sy, cy = math.sin(heading + math.pi / 2), math.cos(heading + math.pi / 2)
    axes = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    floor = [(1, -1), (1, 1), (-1, 1), (-1, -1)]
    local = np.array([(a * length / 2, b * width / 2, c * height / 2) for c in (-1, 1) for a, b in floor])
    return np.asarray(center) + local @ axes.T


def box_edges(camera: Camera, corners: Reals) -> Reals:
    """The edges of a box as an image shows them.

    Args:
        camera: The camera.
        corners: Of the box, as `box_corners` gives them.

    Returns:
        Ends of the lines in pixels, shape (n, 2, 2), n at most 12: parts that lie behind the camera are cut off, and
        there are none where the box lies outside of the image.
    """
    seen = (corners - np.asarray(camera.position)) @ quaternion_matrix(camera.rotation)
    first, last = seen[_EDGES[:, 0]], seen[_EDGES[:, 1]]
    ahead = (first[:, 2] > _NEAREST_M) | (last[:, 2] > _NEAREST_M)
    first, last = first[ahead], last[ahead]
    first, last = _cut(first, last), _cut(last, first)
    fx, fy, cx, cy = camera.intrinsics
    lines = np.stack([first, last], axis=1)
    pixels = lines[:, :, :2] / lines[:, :, 2:] * (fx, fy) + (cx, cy)
    if len(pixels):
        low, high = pixels.min(axis=(0, 1)), pixels.max(axis=(0, 1))
        if (high < 0).any() or (low > (camera.width, camera.height)).any():
            return np.empty((0, 2, 2))
    return pixels


def _cut(ends: Reals, others: Reals) -> Reals:
    """The ends of lines, moved towards the other ends as far as they are behind the camera."""
    span = others[:, 2] - ends[:, 2]
    share = np.divide(_NEAREST_M - ends[:, 2], span, out=np.zeros(len(ends)), where=span != 0)
    return ends + np.where(ends[:, 2] < _NEAREST_M, share, 0.0)[:, None] * (others - ends)
