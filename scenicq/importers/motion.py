"""What tracks and poses have in common in every format: velocity from positions, poses in space."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scenicq.geometry.angles import heading_of, normalize
from scenicq.importers.fields import InvalidError

__all__ = [
    "Quaternion",
    "Rigid",
    "Vector",
    "euler",
    "heading_of_yaw",
    "matrix",
    "quaternion",
    "turns",
    "unit_quaternion",
    "velocities",
]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Rigid:
    """A pose in space: the frame of a body as seen from another frame.

    Attributes:
        x, y, z: Unit vectors of the body's axes.
        origin: The body's origin, metres.
    """

    x: Vector
    y: Vector
    z: Vector
    origin: Vector

    def place(self, point: Vector) -> Vector:
        """A point of the body's frame, seen from the other frame."""
        a, b, c = self.turn(point)
        return a + self.origin[0], b + self.origin[1], c + self.origin[2]

    def turn(self, vector: Vector) -> Vector:
        """A direction of the body's frame, seen from the other frame."""
        a, b, c = vector
        return (
            a * self.x[0] + b * self.y[0] + c * self.z[0],
            a * self.x[1] + b * self.y[1] + c * self.z[1],
            a * self.x[2] + b * self.y[2] + c * self.z[2],
        )

    def then(self, inner: Rigid) -> Rigid:
        """The frame `inner`, given in this body's frame, seen from the other frame."""
        return Rigid(self.turn(inner.x), self.turn(inner.y), self.turn(inner.z), self.place(inner.origin))

    def inverse(self) -> Rigid:
        """The other frame, seen from the body."""
        x, y, z = zip(self.x, self.y, self.z, strict=True)
        a, b, c = Rigid(x, y, z, self.origin).turn(self.origin)
        return Rigid(x, y, z, (-a, -b, -c))

    @property
    def pitch(self) -> float:
        """Turn about the y axis, radians, after which comes the heading's."""
        return math.asin(max(-1.0, min(1.0, -self.x[2])))

    @property
    def roll(self) -> float:
        """Turn about the x axis, radians, before the pitch."""
        return math.atan2(self.y[2], self.z[2])

    @property
    def heading(self) -> float:
        """Heading in (-pi, pi] of the x axis, seen from above."""
        return heading_of(self.x[0], self.x[1])


def unit_quaternion(w: float, x: float, y: float, z: float) -> Quaternion:
    """A quaternion w, x, y, z, made one of length 1.

    Raises:
        InvalidError: It is far from a unit quaternion.
    """
    norm = math.hypot(w, x, y, z)
    if not 0.5 < norm < 2:
        raise InvalidError("the rotation is not a unit quaternion")
    return w / norm, x / norm, y / norm, z / norm


def quaternion(w: float, x: float, y: float, z: float, origin: Vector) -> Rigid:
    """The pose of a unit quaternion, of either sign, and an origin.

    Raises:
        InvalidError: It is far from a unit quaternion.
    """
    w, x, y, z = unit_quaternion(w, x, y, z)
    return Rigid(
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
        origin,
    )


def heading_of_yaw(yaw: float) -> float:
    """The heading in (-pi, pi] of an angle that a source counts counter-clockwise from +x, radians."""
    return normalize(yaw - math.pi / 2)


def velocities(
    track: Sequence[tuple[int, float, float]], *, reach_us: int, longest_us: int
) -> list[tuple[float, float] | None]:
    """Velocity at each point of a track by differences of positions: central, at the ends one-sided.

    Args:
        track: Microseconds and position in metres, in order of time.
        reach_us: How far from a point the others of its difference may be; always at least its neighbours.
        longest_us: A gap longer than this separates; a point alone has no velocity.
    """
    found: list[tuple[float, float] | None] = []
    for step in range(len(track)):
        first = _reach(track, step, -1, reach_us, longest_us)
        last = _reach(track, step, 1, reach_us, longest_us)
        seconds = (track[last][0] - track[first][0]) / 1e6
        if seconds <= 0:
            found.append(None)
        else:
            dx, dy = track[last][1] - track[first][1], track[last][2] - track[first][2]
            found.append((dx / seconds, dy / seconds))
    return found


def _reach(track: Sequence[tuple[int, float, float]], step: int, way: int, reach_us: int, longest_us: int) -> int:
    here = step
    while 0 <= here + way < len(track):
        if abs(track[here + way][0] - track[here][0]) > longest_us:
            break
        if here != step and abs(track[here + way][0] - track[step][0]) > reach_us:
            break
        here += way
    return here


def euler(roll: float, pitch: float, yaw: float, origin: Vector) -> Rigid:
    """The pose of a body turned about its x, then y, then z axis, each fixed, by angles in radians."""
    cr, sr, cp, sp, cy, sy = *_turn(roll), *_turn(pitch), *_turn(yaw)
    return Rigid(
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
        origin,
    )


def turns(axes: str, angles: Sequence[float], origin: Vector) -> Rigid:
    """The pose of a body turned about its own axes, one after the other.

    Args:
        axes: Letters X, Y and Z.
        angles: For each letter, radians.
        origin: The body's origin, metres.
    """
    pose = Rigid((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), origin)
    for axis, angle in zip(axes, angles, strict=True):
        about = {"X": (angle, 0.0, 0.0), "Y": (0.0, angle, 0.0), "Z": (0.0, 0.0, angle)}[axis]
        pose = pose.then(euler(*about, (0.0, 0.0, 0.0)))
    return pose


def matrix(rows: Sequence[Sequence[float]]) -> Rigid:
    """The pose of a matrix of three or four rows whose last column is the origin.

    Raises:
        InvalidError: It is no rotation.
    """
    columns = [(rows[0][i], rows[1][i], rows[2][i]) for i in range(4)]
    if any(not 0.9 < math.hypot(*column) < 1.1 for column in columns[:3]):
        raise InvalidError("the matrix is not a rotation")
    return Rigid(*columns)


def _turn(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)
