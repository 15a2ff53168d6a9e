"""Poses in space, in every notation that formats have, and velocities from the positions of a track.

A pose is a `RigidTransform`: it maps points of a body's frame to another frame, such as the map's. Lengths are in
metres, angles in radians.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scenicq.geometry.angles import heading_of, normalize
from scenicq.importers.fields import InvalidError

__all__ = [
    "Quaternion",
    "RigidTransform",
    "Vector",
    "heading_of_yaw",
    "pose_of_euler_angles",
    "pose_of_matrix",
    "pose_of_quaternion",
    "pose_of_rotations",
    "unit_quaternion",
    "velocities",
]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class RigidTransform:
    """The pose of a body: the transform from its frame to a reference frame.

    Attributes:
        x, y, z: The body's axes, unit vectors of the reference frame.
        origin: The body's origin in the reference frame, metres.
    """

    x: Vector
    y: Vector
    z: Vector
    origin: Vector

    def transform_point(self, point: Vector) -> Vector:
        """Map a point from the body's frame to the reference frame."""
        a, b, c = self.rotate(point)
        return a + self.origin[0], b + self.origin[1], c + self.origin[2]

    def rotate(self, vector: Vector) -> Vector:
        """Map a direction from the body's frame to the reference frame."""
        a, b, c = vector
        return (
            a * self.x[0] + b * self.y[0] + c * self.z[0],
            a * self.x[1] + b * self.y[1] + c * self.z[1],
            a * self.x[2] + b * self.y[2] + c * self.z[2],
        )

    def compose(self, inner: RigidTransform) -> RigidTransform:
        """The pose, in the reference frame, of what has the pose `inner` in this body's frame."""
        axes = self.rotate(inner.x), self.rotate(inner.y), self.rotate(inner.z)
        return RigidTransform(*axes, self.transform_point(inner.origin))

    def inverse(self) -> RigidTransform:
        """The pose of the reference frame in the body's frame."""
        x, y, z = zip(self.x, self.y, self.z, strict=True)
        a, b, c = RigidTransform(x, y, z, self.origin).rotate(self.origin)
        return RigidTransform(x, y, z, (-a, -b, -c))

    @property
    def pitch(self) -> float:
        """Rotation about the y axis, radians; the second of roll, pitch and heading."""
        return math.asin(max(-1.0, min(1.0, -self.x[2])))

    @property
    def roll(self) -> float:
        """Rotation about the x axis, radians; the first of roll, pitch and heading."""
        return math.atan2(self.y[2], self.z[2])

    @property
    def heading(self) -> float:
        """Heading of the x axis seen from above, radians in (-pi, pi]."""
        return heading_of(self.x[0], self.x[1])


def unit_quaternion(w: float, x: float, y: float, z: float) -> Quaternion:
    """Scale a quaternion w, x, y, z to length 1.

    Raises:
        InvalidError: The length is not between 0.5 and 2.
    """
    norm = math.hypot(w, x, y, z)
    if not 0.5 < norm < 2:
        raise InvalidError("the rotation is not a unit quaternion")
    return w / norm, x / norm, y / norm, z / norm


def pose_of_quaternion(w: float, x: float, y: float, z: float, origin: Vector) -> RigidTransform:
    """The pose of a unit quaternion and an origin; the quaternion's sign makes no difference.

    Raises:
        InvalidError: The length is not between 0.5 and 2.
    """
    w, x, y, z = unit_quaternion(w, x, y, z)
    return RigidTransform(
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
        origin,
    )


def heading_of_yaw(yaw: float) -> float:
    """The heading, in (-pi, pi], of an angle counter-clockwise from +x; both in radians."""
    return normalize(yaw - math.pi / 2)


def velocities(
    track: Sequence[tuple[int, float, float]], *, reach_us: int, longest_us: int
) -> list[tuple[float, float] | None]:
    """The velocity at each point of a track, metres per second, by central differences (one-sided at the ends).

    Args:
        track: Time in microseconds, x and y in metres; in order of time.
        reach_us: Time from a point to the ends of its difference, at most; the nearest points always count.
        longest_us: A gap longer than this splits the track. A point without neighbours has no velocity: None.
    """
    found: list[tuple[float, float] | None] = []
    for step in range(len(track)):
        first = _end_of_difference(track, step, -1, reach_us, longest_us)
        last = _end_of_difference(track, step, 1, reach_us, longest_us)
        seconds = (track[last][0] - track[first][0]) / 1e6
        if seconds <= 0:
            found.append(None)
        else:
            dx, dy = track[last][1] - track[first][1], track[last][2] - track[first][2]
            found.append((dx / seconds, dy / seconds))
    return found


def _end_of_difference(
    track: Sequence[tuple[int, float, float]], step: int, direction: int, reach_us: int, longest_us: int
) -> int:
    """The farthest point of a track, forwards (1) or backwards (-1), that a difference at a point may use."""
    end = step
    while 0 <= end + direction < len(track):
        if abs(track[end + direction][0] - track[end][0]) > longest_us:
            break
        if end != step and abs(track[end + direction][0] - track[step][0]) > reach_us:
            break
        end += direction
    return end


def pose_of_euler_angles(roll: float, pitch: float, yaw: float, origin: Vector) -> RigidTransform:
    """The pose of a body that is rotated about the reference frame's x, then y, then z axis; angles in radians."""
    cr, sr, cp, sp, cy, sy = *_cos_sin(roll), *_cos_sin(pitch), *_cos_sin(yaw)
    return RigidTransform(
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
        origin,
    )


def pose_of_rotations(axes: str, angles: Sequence[float], origin: Vector) -> RigidTransform:
    """The pose of a body that is rotated about its own axes, one after the other.

    Args:
        axes: The letters X, Y and Z in the order of the rotations.
        angles: The angle of each rotation, radians.
        origin: The body's origin, metres.
    """
    pose = RigidTransform((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), origin)
    for axis, angle in zip(axes, angles, strict=True):
        roll_pitch_yaw = {"X": (angle, 0.0, 0.0), "Y": (0.0, angle, 0.0), "Z": (0.0, 0.0, angle)}[axis]
        pose = pose.compose(pose_of_euler_angles(*roll_pitch_yaw, (0.0, 0.0, 0.0)))
    return pose


def pose_of_matrix(rows: Sequence[Sequence[float]]) -> RigidTransform:
    """The pose of a matrix with three or four rows: a rotation, and the origin in the last column.

    Raises:
        InvalidError: A column is too long or too short for a rotation.
    """
    columns = [(rows[0][i], rows[1][i], rows[2][i]) for i in range(4)]
    if any(not 0.9 < math.hypot(*column) < 1.1 for column in columns[:3]):
        raise InvalidError("the matrix is not a rotation")
    return RigidTransform(*columns)


def _cos_sin(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)
