"""Cameras out of calibrations: how they are mounted, and where the vehicle was when the image was taken."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scenicq.geometry.camera import Camera
from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.motion import Quaternion, pose_of_quaternion, unit_quaternion
from scenicq.store.camera_rows import camera_problem

__all__ = ["CAMERA_KEYS", "Mount", "Pose", "camera_of", "place_camera", "pose_of", "sound_camera"]

Pose = tuple[Quaternion, tuple[float, float, float]]
"""A unit quaternion w, x, y, z and an origin in metres."""

CAMERA_KEYS = ("width", "height", "intrinsics", "position", "rotation")
"""What a sensor of the interchange format says of its camera."""


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
    """A pose, its quaternion made one of length 1.

    Raises:
        InvalidError: It is far from a unit quaternion.
    """
    w, x, y, z = rotation
    a, b, c = origin
    return unit_quaternion(w, x, y, z), (a, b, c)


def place_camera(mount: Mount, vehicle: Pose, width: int, height: int) -> Camera:
    """The camera of a vehicle.

    Args:
        mount: How it sits there.
        vehicle: Pose of the vehicle in the frame of the map, when the image was taken.
        width: Width of the image, pixels.
        height: The same.

    Raises:
        InvalidError: There can be no such camera.
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
    return sound_camera(Camera(width, height, mount.intrinsics, position, turned))


def sound_camera(camera: Camera) -> Camera:
    """The camera, if there can be such a one.

    Raises:
        InvalidError: There cannot.
    """
    if (problem := camera_problem(camera)) is not None:
        raise InvalidError(problem)
    return camera


def camera_of(sensor: Mapping[str, Any]) -> Camera | None:
    """The camera of a sensor of the interchange format; None where it says nothing of one.

    Raises:
        InvalidError: It says only a part, or what cannot be.
    """
    if all(sensor.get(key) is None for key in CAMERA_KEYS):
        return None
    told: Record = dict(sensor)
    fx, fy, cx, cy = fields.vector(told, "intrinsics", 4)
    x, y, z = fields.vector(told, "position", 3)
    w, a, b, c = fields.vector(told, "rotation", 4)
    width, height = fields.integer(told, "width"), fields.integer(told, "height")
    return sound_camera(Camera(width, height, (fx, fy, cx, cy), (x, y, z), (w, a, b, c)))
