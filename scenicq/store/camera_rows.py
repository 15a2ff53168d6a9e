"""Cameras in the table `sensors`: to rows and back, and what makes one unsound."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scenicq.geometry.camera import Camera
from scenicq.store.schema import ArrowTable
from scenicq.store.wkb import FARTHEST_M

__all__ = ["CAMERA_COLUMNS", "LARGEST_IMAGE", "camera_columns", "camera_problem", "cameras_of"]

CAMERA_COLUMNS = ["image_width", "image_height", "intrinsics", "camera_pose"]
"""Columns of `sensors` that say how a camera sees."""

LARGEST_IMAGE = 1 << 16
"""Pixels of an image from side to side, and of a focal length, at most."""


def camera_columns(cameras: Sequence[Camera | None]) -> dict[str, list[Any]]:
    """Make the columns of some sensor files, with or without cameras."""
    return {
        "image_width": [None if each is None else each.width for each in cameras],
        "image_height": [None if each is None else each.height for each in cameras],
        "intrinsics": [[] if each is None else each.intrinsics for each in cameras],
        "camera_pose": [[] if each is None else (*each.position, *each.rotation) for each in cameras],
    }


def cameras_of(rows: ArrowTable) -> list[Camera | None]:
    """The camera of each row; none where the table has no such columns."""
    if CAMERA_COLUMNS[0] not in rows.column_names or rows[CAMERA_COLUMNS[0]].null_count == len(rows):
        return [None] * len(rows)
    columns = zip(*(rows[name].to_pylist() for name in CAMERA_COLUMNS), strict=True)
    return [
        None if width is None else Camera(width, height, tuple(seen), tuple(pose[:3]), tuple(pose[3:]))
        for width, height, seen, pose in columns
    ]


def camera_problem(camera: Camera) -> str | None:
    """What is wrong with the values of a camera, all of which are finite; None if nothing is."""
    if not (0 < camera.width <= LARGEST_IMAGE and 0 < camera.height <= LARGEST_IMAGE):
        return f"the image is not between 1 and {LARGEST_IMAGE} pixels wide and high"
    fx, fy, cx, cy = camera.intrinsics
    if not (0 < fx <= LARGEST_IMAGE and 0 < fy <= LARGEST_IMAGE and max(abs(cx), abs(cy)) <= LARGEST_IMAGE):
        return f"the intrinsics are not between 0 and {LARGEST_IMAGE} pixels"
    if max(map(abs, camera.position)) > FARTHEST_M:
        return "the position is no place on a map"
    if not 0.25 < sum(value * value for value in camera.rotation) < 4:
        return "the rotation is not a unit quaternion"
    return None
