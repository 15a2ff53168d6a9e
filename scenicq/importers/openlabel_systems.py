"""Coordinate systems of OpenLABEL at an instant: parents by poses that are fixed or given for a frame.

`pose_wrt_parent` is the pose of a system in its parent, and `transform_src_to_dst` takes coordinates of `src` to those
of `dst`, which is the pose of `src` in `dst`: a transform from a parent to its child is read backwards.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.motion import RigidTransform, pose_of_matrix, pose_of_quaternion, pose_of_rotations

__all__ = ["CoordinateSystems", "first_vehicle"]

_IDENTITY = RigidTransform((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
_SEQUENCE = "ZYX"
"""The axes of Euler angles where none are named, each about the turned body."""


class CoordinateSystems:
    """The coordinate systems of a frame.

    Attributes:
        used: Names of systems to which a transform of this frame was applied.
        unknown: Transforms that name a system which the file does not have.
    """

    def __init__(self, systems: Record, transforms: Record) -> None:
        """Take the systems of the file, and the transforms of the frame, which come before poses of the file.

        Raises:
            InvalidError: A transform is not sound.
        """
        self.used: set[str] = set()
        self.unknown: list[str] = []
        self._systems = systems
        self._moving: defaultdict[str, dict[str, RigidTransform]] = defaultdict(dict)
        for key, value in transforms.items():
            entry = fields.record(value, f"transform `{key}`")
            source, target = fields.text(entry, "src"), fields.text(entry, "dst")
            if source not in systems or target not in systems:
                self.unknown.append(key)
                continue
            pose = _pose(fields.optional_record(entry, "transform_src_to_dst"))
            self._moving[source][target] = pose
            self._moving[target].setdefault(source, pose.inverse())

    def pose(self, name: str | None) -> RigidTransform:
        """A system, seen from the one without a parent.

        Raises:
            InvalidError: There is no such system, or it is its own ancestor, or its pose is not sound.
        """
        pose = _IDENTITY
        line = self._ancestors(name)
        while len(line) > 1:
            moving = self._moving.get(line[0], {})
            # A frame may give the pose in a grandparent at once.
            higher = next((place for place, other in enumerate(line) if place and other in moving), None)
            if higher is not None:
                step = moving[line[higher]]
                self.used |= {line[0], line[higher]}
            else:
                higher = 1
                step = _pose(fields.optional_record(fields.record(self._systems[line[0]], "it"), "pose_wrt_parent"))
            pose = step.compose(pose)
            line = line[higher:]
        return pose

    def _ancestors(self, name: str | None) -> list[str]:
        """A system, its parent, and so on."""
        line: list[str] = []
        if not self._systems:  # all is in one that nobody describes
            return line
        while name is not None:
            if name in line:
                raise InvalidError(f"coordinate system `{name}` is its own ancestor")
            if name not in self._systems:
                raise InvalidError(f"there is no coordinate system `{name}`")
            line.append(name)
            name = fields.optional_text(fields.record(self._systems[name], "a coordinate system"), "parent")
        return line


def first_vehicle(systems: Record) -> str | None:
    """The system of a vehicle, by its name."""
    return next((name for name in systems if name.lower().startswith(("vehicle", "ego"))), None)


def _pose(entry: Record) -> RigidTransform:
    if entry.get("matrix4x4") is not None:
        values = fields.vector(entry, "matrix4x4", 16)
        return pose_of_matrix([values[start : start + 4] for start in (0, 4, 8)])
    if not entry:
        return _IDENTITY
    origin = fields.vector(entry, "translation", 3) if entry.get("translation") is not None else (0.0, 0.0, 0.0)
    place = (origin[0], origin[1], origin[2])
    if entry.get("quaternion") is not None:
        x, y, z, w = fields.vector(entry, "quaternion", 4)
        return pose_of_quaternion(w, x, y, z, place)
    if entry.get("euler_angles") is not None:
        sequence = (fields.optional_text(entry, "sequence") or _SEQUENCE).upper()
        if len(sequence) != 3 or set(sequence) - set("XYZ"):
            raise InvalidError("`sequence` is not three of X, Y and Z")
        return pose_of_rotations(sequence, fields.vector(entry, "euler_angles", 3), place)
    return replace(_IDENTITY, origin=place)
