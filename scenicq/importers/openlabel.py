"""ASAM OpenLABEL 1.0 JSON with cuboids: a file is a recording, a frame of it a label. There is no map.

A cuboid lies in a coordinate system; systems have parents, by poses that are fixed or given for a frame. The map frame
is the one without a parent. The ego is an object whose key or name is `ego`, or else a system of a vehicle, at its
origin; files that have neither have no ego: see `ego_choice`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from scenicq.errors import DataError, Diagnostic
from scenicq.importers import fields
from scenicq.importers.base import ClassNames, OpenedSource, Options, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing
from scenicq.importers.ego_choice import Moment, ego_facts, with_egos
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.layouts import openlabel_files
from scenicq.importers.motion import Rigid, euler, matrix, quaternion
from scenicq.importers.report import Report
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject

__all__ = ["OpenLabel"]

_MAP = "none"
_STEP_US = 100_000
_LARGEST_BYTES = 1 << 30
_PSEUDO = ("DontCare", "Egocar", "EgoCar", "ego_vehicle")
_IDENTITY = Rigid((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


class OpenLabel:
    """Importer of ASAM OpenLABEL."""

    name = "openlabel"
    layout = "`*.json` files that begin with `openlabel`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is such a file or a folder of them."""
        return bool(openlabel_files(path))

    def read(self, path: Path, options: Options, report: Report) -> OpenedSource:
        """Open files.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = openlabel_files(path)
        if not files:
            raise missing(path, "no `*.json` of OpenLABEL")
        maps = read_maps(options.maps, report)
        choice = () if options.ego is None else (options.ego,)
        map_name = next(iter(maps), _MAP)
        return by_file_source(
            f"openlabel-{path.resolve().stem}",
            maps,
            [RecordingFiles(file.stem, (file,), path, map_name, choice) for file in files],
            {**taxonomy("scenic"), **taxonomy("openlabel"), **options.class_map},
            _read_file,
            frames=0,
            object_bytes=400,
            facts={
                **{key: f"{value}, where a file has none" for key, value in ego_facts(options.ego).items()},
                "time": "of the frame, else steps of 0.1 s",
            },
        )


def _read_file(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    file = place.files[0]
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise InvalidError("it is too large")
        whole = fields.record(fields.parse_json(file.read_bytes()), "the file")
        content = fields.record(whole.get("openlabel"), "`openlabel`")
        systems = fields.optional_record(content, "coordinate_systems")
        objects = fields.optional_record(content, "objects")
        frames = fields.record(content.get("frames"), "`frames`")
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror}")) from error
    except InvalidError as error:
        raise DataError(Diagnostic("file-invalid", f"{file}: {error}")) from error
    made: list[tuple[Label, str]] = []
    lacking: list[Moment] = []
    for key in sorted(frames, key=lambda key: (len(key), key)):
        where = f"{file.name}: frame `{key}`"
        try:
            if not (key.isascii() and key.isdigit() and len(key) < 10):
                raise InvalidError("its key is not a number")
            frame = fields.record(frames[key], "it")
            properties = fields.optional_record(frame, "frame_properties")
            world = _World(systems, fields.optional_record(properties, "transforms"))
            members = _objects(frame, objects, world, classes, report, where)
            time = _time(properties.get("timestamp"), int(key))
            ego = next((each for each in members if each.id == "ego"), None) or world.ego()
        except InvalidError as error:
            report.left_out("label", "record-invalid", f"{where}: {error}")
            continue
        others = tuple(each for each in members if each is not ego)
        name = f"{place.name}/{key}"
        if ego is None:
            lacking.append(Moment(name, time, others))
        else:
            made.append((Label(name, place.name, time, place.map, ego, others), where))
    choice = next(iter(place.options), None)
    return made + (with_egos(lacking, choice, place.name, place.map, file.name, report) if lacking else [])


class _World:
    """Coordinate systems at an instant."""

    def __init__(self, systems: Record, transforms: Record) -> None:
        self._systems = systems
        self._moving: dict[tuple[str, str], Record] = {}
        for value in transforms.values():
            entry = fields.record(value, "a transform")
            self._moving[fields.text(entry, "src"), fields.text(entry, "dst")] = fields.optional_record(
                entry, "transform_src_to_dst"
            )

    def pose(self, name: str | None) -> Rigid:
        """A system, seen from the one without a parent."""
        pose, seen = _IDENTITY, set[str]()
        while name is not None and name in self._systems:
            if name in seen:
                raise InvalidError(f"coordinate system `{name}` is its own ancestor")
            seen.add(name)
            system = fields.record(self._systems[name], "a coordinate system")
            parent = fields.optional_text(system, "parent")
            if parent is None:
                break
            given = self._moving.get((name, parent)) or fields.optional_record(system, "pose_wrt_parent")
            pose = _pose(given).then(pose)
            name = parent
        return pose

    def ego(self) -> LabelObject | None:
        """The vehicle that a coordinate system belongs to."""
        name = next((name for name in self._systems if name.startswith("vehicle")), None)
        if name is None:
            return None
        pose = self.pose(name)
        return LabelObject("ego", "Car", "", pose.origin[0], pose.origin[1], pose.heading)


def _pose(entry: Record) -> Rigid:
    if entry.get("matrix4x4") is not None:
        values = fields.vector(entry, "matrix4x4", 16)
        return matrix([values[start : start + 4] for start in (0, 4, 8)])
    if not entry:
        return _IDENTITY
    origin = fields.vector(entry, "translation", 3) if entry.get("translation") is not None else (0.0, 0.0, 0.0)
    place = (origin[0], origin[1], origin[2])
    if entry.get("quaternion") is not None:
        x, y, z, w = fields.vector(entry, "quaternion", 4)
        return quaternion(w, x, y, z, place)
    if entry.get("euler_angles") is not None:
        roll, pitch, yaw = fields.vector(entry, "euler_angles", 3)
        return euler(roll, pitch, yaw, place)
    return replace(_IDENTITY, origin=place)


def _objects(
    frame: Record, objects: Record, world: _World, classes: ClassNames, report: Report, where: str
) -> list[LabelObject]:
    found: list[LabelObject] = []
    for name, value in fields.optional_record(frame, "objects").items():
        try:
            known = fields.optional_record(objects, name)
            kind = fields.optional_text(known, "type") or "unknown"
            own = fields.optional_text(known, "name")
            if kind in _PSEUDO or own in _PSEUDO:
                continue
            data = fields.optional_record(fields.record(value, "it"), "object_data")
            cuboids = fields.optional_items(data, "cuboid")
            if cuboids:  # an object that a frame only names, or that has a box in an image, has no place
                played = "ego" if own == "ego" else name
                found.append(_object(played, kind, fields.record(cuboids[0], "the cuboid"), world, classes))
        except InvalidError as error:
            report.left_out("object", "record-invalid", f"{where}: object `{name}`: {error}")
    return found


def _object(name: str, kind: str, cuboid: Mapping[str, Any], world: _World, classes: ClassNames) -> LabelObject:
    count = len(fields.items(cuboid, "val"))
    values = fields.vector(cuboid, "val", 10 if count == 10 else 9)
    at = (values[0], values[1], values[2])
    if count == 10:
        x, y, z, w = values[3:7]
        own = quaternion(w, x, y, z, at)
    else:
        own = euler(values[3], values[4], values[5], at)
    length, *others = values[-3:]
    if min(values[-3:]) <= 0:
        raise InvalidError("its size is not positive")
    box = world.pose(fields.optional_text(cuboid, "coordinate_system")).then(own)
    # In the frame of a camera the box stands on its y axis.
    width, height = others if abs(box.z[2]) >= abs(box.y[2]) else reversed(others)
    is_ego = name == "ego"
    return LabelObject(
        id=name,
        category="Car" if is_ego else classes.category(kind),
        source_class=kind,
        x=box.origin[0],
        y=box.origin[1],
        heading=box.heading,
        width=width,
        length=length,
        height=height,
        track=None if is_ego else name,
    )


def _time(stamp: object, number: int) -> int:
    """Microseconds of a timestamp: seconds as a number or a text, or a date."""
    if isinstance(stamp, str):
        try:
            seconds = float(stamp)
        except ValueError:
            try:
                date = datetime.fromisoformat(stamp)
                # A date without a zone must not mean another instant on another machine.
                seconds = (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
            except (ValueError, OverflowError, OSError) as error:
                raise InvalidError("`timestamp` is neither a number nor a date") from error
    elif isinstance(stamp, int | float) and not isinstance(stamp, bool):
        seconds = float(stamp) if abs(stamp) < 1e15 else math.inf
    else:
        return number * _STEP_US
    if not abs(seconds) < 1e12:
        raise InvalidError("`timestamp` is out of range")
    return round(seconds * 1e6)
