"""Objects of an OpenLABEL frame: what the frame says of them, and what the file says of them for all frames."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from scenicq.importers import fields
from scenicq.importers.base import ClassNames
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.motion import pose_of_euler_angles, pose_of_quaternion
from scenicq.importers.openlabel_systems import CoordinateSystems
from scenicq.importers.recording_checks import radians
from scenicq.importers.report import Report
from scenicq.store.labels import LabelObject, OutOfPlane

__all__ = ["FrameContext", "objects_of"]

_EGO = frozenset({"ego", "egocar", "egovehicle", "egoobject", "host", "hostvehicle"})
_NO_OBJECT = "dontcare"
_SCALARS = ("boolean", "num", "text")


@dataclass(frozen=True, slots=True)
class FrameContext:
    """What the boxes of a frame need to become objects.

    Attributes:
        systems: Where they lie.
        classes: Classes of their types.
        report: Takes what is unsound.
        where: The frame, for messages.
    """

    systems: CoordinateSystems
    classes: ClassNames
    report: Report
    where: str


def objects_of(content: Record, frame: Record, number: int, boxes: FrameContext) -> list[LabelObject]:
    """The objects with a box, the ego among them as `ego`.

    Args:
        content: The file.
        frame: The frame.
        number: Its key.
        boxes: What boxes need.
    """
    known = fields.optional_record(content, "objects")
    named = fields.optional_record(frame, "objects")
    found: list[LabelObject] = []
    egos = 0
    for name in dict.fromkeys((*named, *known)):
        try:
            whole = fields.optional_record(known, name)
            if name not in named and not _lives(whole, number):
                continue
            own = fields.optional_record(fields.optional_record(named, name), "object_data")
            member = _object(name, whole, own, boxes)
        except InvalidError as error:
            boxes.report.leave_out("object", "record-invalid", f"{boxes.where}: object `{name}`: {error}")
            continue
        if member is not None and member.id == "ego":
            egos += 1
            if egos > 1:
                boxes.report.leave_out("object", "record-invalid", f"{boxes.where}: object `{name}` is a second ego")
                continue
        if member is not None:
            found.append(member)
    return found


def _lives(whole: Record, number: int) -> bool:
    """Whether an object is in a frame that does not list it: its intervals hold the frame, or it has no intervals."""
    intervals = fields.optional_items(whole, "frame_intervals")
    return not intervals or any(
        fields.integer(each, "frame_start") <= number <= fields.integer(each, "frame_end")
        for each in (fields.record(each, "an interval") for each in intervals)
    )


def _object(name: str, whole: Record, own: Record, boxes: FrameContext) -> LabelObject | None:
    """An object; None without a cuboid, which gives its place, and for the type DontCare."""
    static = fields.optional_record(whole, "object_data")
    # Some writers say in each frame what the object is.
    kind = next((text for each in (whole, own, static) if (text := fields.optional_text(each, "type"))), "unknown")
    called = next((text for each in (whole, own, static) if (text := fields.optional_text(each, "name"))), "")
    if _NO_OBJECT in (_plain(kind), _plain(called)):
        boxes.report.count_unread("objects/* of the type DontCare")
        return None
    cuboids = _elements(own, "cuboid") or _elements(static, "cuboid")
    if not cuboids:
        return None
    boxes.report.count_unread("objects/*/object_data/cuboid after the first", len(cuboids) - 1)
    cuboid = cuboids[0]
    is_ego = not _EGO.isdisjoint((_plain(kind), _plain(called), _plain(name)))
    system = fields.optional_text(cuboid, "coordinate_system") or fields.optional_text(whole, "coordinate_system")
    attributes = dict[str, str | float | bool]()
    for each in (static, own, fields.optional_record(cuboid, "attributes")):
        attributes.update(_attributes(each, boxes))
    return replace(
        _box(cuboid, system, boxes.systems, boxes.report),
        id="ego" if is_ego else name,
        category="Car" if is_ego else boxes.classes.category(kind),
        source_class=kind,
        track=None if is_ego else name,
        attributes=attributes,
    )


def _plain(text: str) -> str:
    return "".join(char for char in text.lower() if char.isalnum())


def _elements(data: Record, key: str) -> list[Record]:
    """The elements under a key. Some writers give a single element without a list."""
    if isinstance(data.get(key), dict):
        return [fields.record(data[key], f"`{key}`")]
    return [fields.record(each, f"`{key}`") for each in fields.optional_items(data, key)]


def _attributes(data: Record, boxes: FrameContext) -> Iterator[tuple[str, str | float | bool]]:
    for kind in _SCALARS:
        for each in _elements(data, kind):
            value: Any = each.get("val")
            name = fields.optional_text(each, "name")
            if name is not None and isinstance(value, str | float | bool | int) and _is_finite(value):
                yield name, value
            else:
                boxes.report.count_unread(f"objects/*/object_data/{kind} without a name or a finite value")


def _is_finite(value: str | float | bool) -> bool:
    return isinstance(value, str | bool) or abs(value) < math.inf


def _box(cuboid: Record, system: str | None, systems: CoordinateSystems, report: Report) -> LabelObject:
    count = len(fields.items(cuboid, "val"))
    values = fields.vector(cuboid, "val", 10 if count == 10 else 9)
    at = (values[0], values[1], values[2])
    if count == 10:
        x, y, z, w = values[3:7]
        own = pose_of_quaternion(w, x, y, z, at)
    else:
        roll, pitch, yaw = (radians(angle, report) for angle in values[3:6])
        own = pose_of_euler_angles(roll, pitch, yaw, at)
    length, *others = values[-3:]
    if min(values[-3:]) <= 0:
        raise InvalidError("its size is not positive")
    box = systems.pose(system).compose(own)
    # In the frame of a camera the box stands on its y axis.
    upright = abs(box.z[2]) >= abs(box.y[2])
    width, height = others if upright else reversed(others)
    return LabelObject(
        "", "", "", box.origin[0], box.origin[1], box.heading, width, length, height,
        out_of_plane=OutOfPlane(box.origin[2], box.pitch, box.roll if upright else None),
    )  # fmt: skip
