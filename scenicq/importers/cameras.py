"""Make cameras on the map from calibrations: how a camera is mounted, and where the vehicle was at the image's time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scenicq.geometry.camera import Camera
from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.motion import Quaternion, pose_of_quaternion, unit_quaternion
from scenicq.store.camera_rows import camera_problem

__all__ = ["CAMERA_KEYS", "Mount", "Pose", "check_camera", "place_camera", "pose_of", "read_camera"]

Pose = tuple[Quaternion, tuple[float, float, float]]
"""A unit quaternion w, x, y, z and an origin in metres."""

CAMERA_KEYS = ("width", "height", "intrinsics", "position", "rotation")
"""The fields of a sensor of the interchange format that describe its camera."""


@dataclass(frozen=True, slots=True)
class Mount:
    """How a camera sits on a vehicle.

    Attributes:
        pose: Pose of the camera (x to the right, y down, z ahead) in the vehicle's frame.
        intrinsics: fx, fy, cx, cy, pixels.
    """

    pose: Pose
    intrinsics: tuple[float, float, float, float]


def pose_of(rotation: tuple[float, ...], origin: tuple[float, ...]) -> Pose:
    """Make a pose; the quaternion is scaled to length 1.

    Raises:
        InvalidError: The quaternion is far from length 1.
    """
    w, x, y, z = rotation
    a, b, c = origin
    return unit_quaternion(w, x, y, z), (a, b, c)


def place_camera(mount: Mount, vehicle: Pose, width: int, height: int) -> Camera:
    """Place the camera of a vehicle on the map.

    Args:
        mount: How the camera sits on the vehicle.
        vehicle: Pose of the vehicle in the frame of the map, when the image was taken.
        width: Width of the image, pixels.
        height: Height of the image, pixels.

    Raises:
        InvalidError: The values are not those of a camera.
    """
    (a, b, c, d), origin = vehicle
    (e, f, g, h), place = mount.pose
    turned = (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )
    position = pose_of_quaternion(a, b, c, d, origin).transform_point(place)
    return check_camera(Camera(width, height, mount.intrinsics, position, turned))


def check_camera(camera: Camera) -> Camera:
    """Check a camera, and return it.

    Raises:
        InvalidError: A value is not that of a camera.
    """
    if (problem := camera_problem(camera)) is not None:
        raise InvalidError(problem)
    return camera


def read_camera(sensor: Mapping[str, Any]) -> Camera | None:
    """Read the camera of a sensor of the interchange format; None if it has none of the fields.

    Raises:
        InvalidError: It has only some of the fields, or a value is not that of a camera.
    """
    if all(sensor.get(key) is None for key in CAMERA_KEYS):
        return None
    told: Record = dict(sensor)
    fx, fy, cx, cy = fields.vector(told, "intrinsics", 4)
    x, y, z = fields.vector(told, "position", 3)
    w, a, b, c = fields.vector(told, "rotation", 4)
    width, height = fields.integer(told, "width"), fields.integer(told, "height")
    return check_camera(Camera(width, height, (fx, fy, cx, cy), (x, y, z), (w, a, b, c)))
