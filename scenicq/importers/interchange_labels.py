"""The lines of a recording of an interchange folder, as columns; what is unsound is told and left out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import Any, cast

import numpy as np
from msgspec import UNSET, Raw, Struct, UnsetType
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.geometry.camera import Camera
from scenicq.importers import fields
from scenicq.importers.base import ClassNames
from scenicq.importers.cameras import read_camera
from scenicq.importers.ego_choice import middle
from scenicq.importers.fields import NO_MAP, InvalidError, whole
from scenicq.importers.recording_checks import radians
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.importers.typed_rows import (
    ABSENT,
    FullText,
    Length,
    NoJsonError,
    RowError,
    RowType,
    Words,
    plain_values,
)
from scenicq.store.columns import MemberColumns, RecordingColumns, to_json

__all__ = ["LabelLines"]

_UNKNOWN = (math.nan, math.nan)


class _Member(Struct, kw_only=True, gc=False, forbid_unknown_fields=True):
    """What an ego and an object have: metres and radians."""

    position: tuple[float, float]
    heading: float | UnsetType | None = UNSET
    yaw: float | UnsetType | None = UNSET
    width: Length | None = None
    length: Length | None = None
    height: Length | None = None
    velocity: tuple[float, float] | None = None
    track: Words | None = None
    attributes: dict[str, Raw] | None = None
    z: float | None = None
    pitch: float | None = None
    roll: float | None = None


class _Object(_Member, kw_only=True, rename={"category": "class"}):
    id: FullText
    category: FullText


class _Ego(_Member, kw_only=True, rename={"category": "class"}):
    id: Raw = ABSENT
    category: Words | None = None


class _Line(Struct, kw_only=True, forbid_unknown_fields=True):
    """A label: objects and what is free to have any names are looked at one by one."""

    id: FullText
    recording: str
    timestamp_us: int | float
    objects: list[Raw]
    ego: Raw = ABSENT
    map: FullText | None = None
    params: dict[str, Raw] | None = None
    sensors: dict[str, Raw] | None = None


_KNOWN = load_specification("interchange")
_LINE = RowType(_Line, _KNOWN, "labels")
_OTHER = {"heading": "yaw", "yaw": "heading"}
_EGOS = {angle: RowType(_Ego, _KNOWN, "labels/ego", unread=other) for angle, other in _OTHER.items()}
_OBJECTS = {angle: RowType(_Object, _KNOWN, "labels/objects", unread=other) for angle, other in _OTHER.items()}


class _Members:
    """Egos or objects, one after the other."""

    def __init__(self, angle: str) -> None:
        self._angle = angle
        self._entries: list[_Member] = []
        self._ids: list[str] = []
        self._categories: list[str] = []
        self._names: list[str] = []
        self._attributes: list[str | None] = []

    def add(self, entry: _Member, id: str, category: str, name: str, attributes: str | None) -> None:
        """One more: its id, class, class name of the source, and attributes as JSON."""
        self._entries.append(entry)
        self._ids.append(id)
        self._categories.append(category)
        self._names.append(name)
        self._attributes.append(attributes)

    def columns(self, report: Report) -> MemberColumns:
        """All of them."""
        entries = self._entries
        xy, vxy = _vectors([entry.position for entry in entries]), _vectors([entry.velocity for entry in entries])
        angles = _reals([getattr(entry, self._angle) for entry in entries])
        for angle in angles[np.abs(angles) > math.pi].tolist():
            radians(angle, report)
        turn = -math.pi / 2 if self._angle == "yaw" else 0.0
        return MemberColumns(
            id=self._ids,
            category=self._categories,
            source_class=self._names,
            x=xy[0],
            y=xy[1],
            heading=normalize_array(angles + turn),
            width=_reals([entry.width for entry in entries]),
            length=_reals([entry.length for entry in entries]),
            height=_reals([entry.height for entry in entries]),
            vx=vxy[0],
            vy=vxy[1],
            track=[entry.track or None for entry in entries],
            attributes=self._attributes,
            z=_reals([entry.z for entry in entries]),
            pitch=normalize_array(_reals([entry.pitch for entry in entries])),
            roll=normalize_array(_reals([entry.roll for entry in entries])),
        )


class LabelLines:
    """The lines of one recording, each read as it comes.

    Attributes:
        times_us, places, maps: Those of the labels that are sound in themselves; places are in the source.
    """

    def __init__(self, recording: str, classes: ClassNames, angle: str, report: Report) -> None:
        """Start without labels; `angle` is the field that is read, `heading` or `yaw`."""
        self.times_us: list[int] = []
        self.places: list[str] = []
        self.maps: list[str] = []
        self._recording = recording
        self._classes = classes
        self._angle = angle
        self._report = report
        self._frames: list[str] = []
        self._params: list[str | None] = []
        self._egos = _Members(angle)
        self._objects = _Members(angle)
        self._counts: list[int] = []
        self._files: list[int] = []
        self._sensors: list[tuple[str, str, Camera | None]] = []

    def columns(self) -> RecordingColumns:
        """The labels in the order in which they came; the map is that of the first."""
        return RecordingColumns(
            name=self._recording,
            map=self.maps[0] if self.maps else "",
            frames=self._frames,
            times_us=self.times_us,
            params=self._params,
            egos=self._egos.columns(self._report),
            objects=self._objects.columns(self._report),
            object_counts=np.array(self._counts, dtype=np.int64),
            sensor_counts=np.array(self._files, dtype=np.int64),
            channels=[channel for channel, _, _ in self._sensors],
            paths=[path for _, path, _ in self._sensors],
            cameras=[camera for _, _, camera in self._sensors],
        )

    def add(self, text: bytes, place: str) -> None:
        """Take a line; what is unsound of it is told with its place, and left out."""
        try:
            if not text.isascii():
                text.decode()
            line = _LINE.decode(text, self._report)
        except (UnicodeDecodeError, NoJsonError) as error:
            why = error if isinstance(error, NoJsonError) else f"not JSON: {error}"
            self._report.leave_out("label", "file-invalid", f"{place}: {why}")
            return
        except RowError as error:
            name = "" if error.name is None else f"label `{error.name}`: "
            self._report.leave_out("label", "record-invalid", f"{place}: {name}{error}")
            return
        try:
            self._add(line, place)
        except InvalidError as error:
            self._report.leave_out("label", "record-invalid", f"{place}: label `{line.id}`: {error}")

    def _add(self, line: _Line, place: str) -> None:
        if line.recording != self._recording:
            raise InvalidError("`recording` is ambiguous")
        time = whole(line.timestamp_us, "timestamp_us")
        objects = list(self._sound_objects(line, place))
        ego, category, attributes = self._ego(line, [entry for entry, _ in objects], place)
        params = plain_values(line.params, "params", self._telling(f"{place}: label `{line.id}`"))
        sensors = list(self._sensor_files(line, place))
        self._frames.append(line.id)
        self.times_us.append(time)
        self.places.append(place)
        self.maps.append(NO_MAP if line.map is None else line.map)
        self._params.append(to_json(params))
        self._egos.add(ego, "ego", category, ego.category or "", attributes)
        for entry, told in objects:
            self._objects.add(entry, entry.id, self._classes.category(entry.category), entry.category, told)
        self._counts.append(len(objects))
        self._files.append(len(sensors))
        self._sensors += sensors

    def _ego(self, line: _Line, objects: Sequence[_Object], place: str) -> tuple[_Ego, str, str | None]:
        """The ego with its class and attributes; a point to look from, which has none, where the source says null."""
        if line.ego is ABSENT:
            raise InvalidError("`ego` is missing")
        if bytes(line.ego) == b"null":
            if not objects:
                raise InvalidError("there is neither an ego nor an object")
            x, y = middle([entry.position for entry in objects])
            ego = _Ego(position=(x, y), heading=None, yaw=None)
            return ego, "", None
        try:
            ego = _EGOS[self._angle].decode(line.ego, self._report)
            self._check_angles(ego, "ego")
            attributes = self._attributes(ego, f"{place}: ego of label `{line.id}`")
        except InvalidError as error:
            raise InvalidError(f"ego: {error}") from error
        return ego, self._classes.category(ego.category) if ego.category else "Car", attributes

    def _sound_objects(self, line: _Line, place: str) -> Iterator[tuple[_Object, str | None]]:
        """Objects with their attributes."""
        for number, raw in enumerate(line.objects):
            name = None
            try:
                entry = _OBJECTS[self._angle].decode(raw, self._report)
                name = entry.id
                self._check_angles(entry, "objects")
                attributes = None
                if entry.attributes:
                    attributes = self._attributes(entry, f"{place}: object `{name}` of label `{line.id}`")
                yield entry, attributes
            except InvalidError as error:
                name = error.name if isinstance(error, RowError) else name
                what = f"object number {number}" if name is None else f"object `{name}`"
                message = f"{place}: {what} of label `{line.id}`: {error}"
                self._report.leave_out("object", "record-invalid", message)

    def _check_angles(self, entry: _Member, at: str) -> None:
        if getattr(entry, other := _OTHER[self._angle]) is not ABSENT:
            self._report.count_unread(f"labels/{at}/{other}")
        # null says that it is not known; a key that is missing is more likely misspelt
        if getattr(entry, self._angle) is UNSET:
            raise InvalidError(f"`{self._angle}` is missing")

    def _attributes(self, entry: _Member, where: str) -> str | None:
        """The attributes of an ego or object as JSON."""
        return to_json(plain_values(entry.attributes, "attributes", self._telling(where)))

    def _sensor_files(self, line: _Line, place: str) -> Iterator[tuple[str, str, Camera | None]]:
        """Channel, path and camera of each; a camera that cannot be is left out, not its file."""
        for channel, raw in (line.sensors or {}).items():
            sensor = fields.parse_json(bytes(raw))
            if not isinstance(sensor, dict):
                yield channel, fields.text({channel: sensor}, channel), None
                continue
            record = cast("dict[str, Any]", sensor)
            _KNOWN.count_rows((record,), self._report, "labels/sensors/*")
            path, camera = fields.text(record, "path"), None
            try:
                camera = read_camera(record)
            except InvalidError as error:
                message = f"{place}: camera `{channel}` of label `{line.id}`: {error}"
                self._report.leave_out("camera", "record-invalid", message)
            yield channel, path, camera

    def _telling(self, where: str) -> Callable[[str], None]:
        return lambda problem: self._report.leave_out("attribute", "record-invalid", f"{where}: {problem}")


def _reals(values: list[float | None]) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)  # None becomes nan


def _vectors(values: Sequence[tuple[float, float] | None]) -> NDArray[np.float64]:
    """X and y, shape (2, n); nan for None."""
    flat = chain.from_iterable([_UNKNOWN if value is None else value for value in values])
    return np.ascontiguousarray(np.fromiter(flat, np.float64, 2 * len(values)).reshape(-1, 2).T)
