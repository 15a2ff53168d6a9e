"""nuScenes in its official layout: `v1.0-*/*.json`, with `maps/expansion/*.json` where it is there.

Conventions of the source: metres in one frame a city; quaternions w, x, y, z; sizes are width, length, height; the pose
of the ego is that of the middle of its rear axle. The ego's box and velocities are not in the tables: see `facts`.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.angles import normalize
from scenicq.geometry.features import MapFeature
from scenicq.importers import fields
from scenicq.importers.base import ClassNames, Entry, Labels, Options, Source, read_maps
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.json_tables import read_list
from scenicq.importers.nuscenes_map import read_expansion
from scenicq.importers.report import Report
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject, Recording

__all__ = ["NuScenes", "SceneReader"]

_TABLES = "scene sample sample_annotation instance category attribute sample_data ego_pose calibrated_sensor sensor log"
_EGO_SIZE_M = (1.730, 4.084, 1.562)
"""Width, length and height of the recording car, a Renault Zoe."""

_AXLE_TO_CENTRE_M = 1.0
"""How far the centre of the ego's box lies ahead of its rear axle."""

_LONGEST_STEP_US = 1_500_000
"""Over longer gaps than this a difference of positions says little about velocity."""

_POSE_CHANNEL = "LIDAR_TOP"


class NuScenes:
    """Importer of nuScenes."""

    name = "nuscenes"
    layout = "a folder `v1.0-*` with `scene.json` and `sample_annotation.json`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is a folder of tables, or has exactly one."""
        return len(_table_folders(path)) == 1

    def read(self, path: Path, options: Options, report: Report) -> Source:
        """Open a dataroot or one of its `v1.0-*` folders.

        All tables but the annotations are read here; memory grows with the source, about 1 kB an annotation.

        Raises:
            DataError: `file-missing` or `file-invalid`; with a strict report whatever is unsound.
        """
        folders = _table_folders(path)
        if len(folders) != 1:
            message = f"{path} has {len(folders)} folders `v1.0-*` with tables, not one"
            hints = tuple(f"give {folder}" for folder in folders)
            raise DataError(Diagnostic("dataset-ambiguous" if folders else "file-missing", message, hints=hints))
        folder = folders[0]
        missing = [name for name in _TABLES.split() if not (folder / f"{name}.json").is_file()]
        if missing:
            raise DataError([Diagnostic("file-missing", f"{folder / name}.json is not there") for name in missing])
        tables = _Tables(folder, report)
        maps = _maps(folder.parent, tables.locations, options, report)
        classes = {**taxonomy("nuscenes"), **options.class_map}
        scenes = sorted(((tables.scene(token) for token in tables.scenes)), key=lambda scene: scene.name)
        by_name = {scene.name: scene for scene in scenes}
        return Source(
            name=f"nuscenes-{folder.name}",
            maps=maps,
            entries=tuple(Entry(scene.name, scene.weight, scene.digest()) for scene in scenes),
            reader=lambda names: SceneReader(tuple(by_name[name] for name in names), classes),
            frames=len(tables.samples),
            context=json.dumps(sorted(classes.items())),
            facts={
                "ego_size_m": dict(zip(("width", "length", "height"), _EGO_SIZE_M, strict=True)),
                "ego_centre_ahead_of_rear_axle_m": _AXLE_TO_CENTRE_M,
                "ego_pose": f"of the {_POSE_CHANNEL} key frame",
                "velocity": f"central differences over steps of at most {_LONGEST_STEP_US / 1e6} s",
            },
        )


@dataclass(frozen=True, slots=True)
class _Scene:
    name: str
    location: str
    params: Mapping[str, str | float | bool]
    place: str


@dataclass(frozen=True, slots=True)
class _Sample:
    token: str
    time: int
    place: str


@dataclass(frozen=True, slots=True)
class _Box:
    """An annotation: position, heading, size; what it belongs to."""

    token: str
    track: str
    x: float
    y: float
    heading: float
    size: tuple[float, ...]
    attributes: Mapping[str, str | float | bool]


class _Tables:
    """The tables, joined; what is unsound is reported and left out."""

    def __init__(self, folder: Path, report: Report) -> None:
        self._folder = folder
        self._report = report
        logs = self._keyed("log", _log)
        self.scenes: dict[str, _Scene] = {}
        for token, row, place in self._rows("scene", "recording"):
            self._try("recording", place, lambda: self._add_scene(token, row, place, logs))  # noqa: B023
        self.locations = sorted({scene.location for scene in self.scenes.values()})
        self.samples: dict[str, tuple[str, _Sample]] = {}
        self.samples_of: defaultdict[str, list[_Sample]] = defaultdict(list)
        for token, row, place in self._rows("sample", "label"):
            self._try("label", place, lambda: self._add_sample(token, row, place))  # noqa: B023
        self.sensors: defaultdict[str, dict[str, str]] = defaultdict(dict)
        self.poses = self._read_sensor_files()
        self.classes = self._read_classes()
        self.boxes: defaultdict[str, list[_Box]] = defaultdict(list)
        self._read_boxes()

    def scene(self, token: str) -> _SceneContent:
        """All that belongs to a scene."""
        scene = self.scenes[token]
        samples = sorted(self.samples_of[token], key=lambda sample: (sample.time, sample.token))
        instants = tuple(
            _Instant(
                sample.token,
                sample.time,
                sample.place,
                self.poses.get(sample.token),
                tuple(sorted(self.sensors[sample.token].items())),
                tuple(self.boxes.pop(sample.token, ())),
            )
            for sample in samples
        )
        tracks = sorted({box.track for instant in instants for box in instant.boxes})
        classes = tuple((track, self.classes[track]) for track in tracks)
        return _SceneContent(scene.name, scene.location, tuple(scene.params.items()), instants, classes)

    def _add_scene(self, token: str, row: Record, place: str, logs: Mapping[str, tuple[str, str | None]]) -> None:
        name = fields.text(row, "name")
        location, date = _found(logs, fields.text(row, "log_token"), "log")
        if any(scene.name == name for scene in self.scenes.values()):
            raise InvalidError(f"scene name `{name}` is used twice")
        self.scenes[token] = _Scene(name, location, _params(row.get("description"), location, date), place)

    def _add_sample(self, token: str, row: Record, place: str) -> None:
        scene = fields.text(row, "scene_token")
        sample = _Sample(token, fields.integer(row, "timestamp"), place)
        _found(self.scenes, scene, "scene")
        if token in self.samples:
            raise InvalidError(f"sample `{token}` is there twice")
        self.samples[token] = (scene, sample)
        self.samples_of[scene].append(sample)

    def _read_sensor_files(self) -> dict[str, tuple[float, float, float]]:
        """Fill in the files of each sample; the result is position and heading of its ego."""
        channels = self._keyed("sensor", lambda row: fields.text(row, "channel"))
        mounted = self._keyed(
            "calibrated_sensor", lambda row: _found(channels, fields.text(row, "sensor_token"), "sensor")
        )
        pose_of: dict[str, str] = {}
        for token, row, place in self._rows("sample_data", "sensor file"):
            if row.get("is_key_frame") is not True or row.get("sample_token") not in self.samples:
                continue

            def add(row: Record = row) -> None:
                channel = _found(mounted, fields.text(row, "calibrated_sensor_token"), "calibrated_sensor")
                sample = fields.text(row, "sample_token")
                self.sensors[sample][channel] = fields.text(row, "filename")
                if channel == _POSE_CHANNEL:
                    pose_of[sample] = fields.text(row, "ego_pose_token")

            self._try("sensor file", f"{place}: sample_data `{token}`", add)
        wanted = set(pose_of.values())
        poses = {
            token: pose
            for token, row, place in self._rows("ego_pose", "ego pose")
            if token in wanted
            and (pose := self._try("ego pose", f"{place}: ego_pose `{token}`", lambda row=row: _pose(row)))
        }
        return {sample: poses[pose] for sample, pose in pose_of.items() if pose in poses}

    def _read_classes(self) -> dict[str, str]:
        """Class name of each instance."""
        names = self._keyed("category", lambda row: fields.text(row, "name"))
        return self._keyed("instance", lambda row: _found(names, fields.text(row, "category_token"), "category"))

    def _read_boxes(self) -> None:
        attributes = self._keyed("attribute", lambda row: fields.text(row, "name"))
        visible: dict[str, str] = {}
        if (self._folder / "visibility.json").is_file():
            visible = self._keyed("visibility", lambda row: fields.text(row, "level"))
        for token, row, place in self._rows("sample_annotation", "object"):

            def add(token: str = token, row: Record = row) -> None:
                sample = fields.text(row, "sample_token")
                _found(self.samples, sample, "sample")
                track = fields.text(row, "instance_token")
                _found(self.classes, track, "instance")
                x, y, heading = _pose(row)
                size = fields.vector(row, "size", 3)
                if min(size) <= 0:
                    raise InvalidError("`size` is not positive")
                told = _attributes(row, attributes, visible)
                self.boxes[sample].append(_Box(token, track, x, y, heading, size, told))

            self._try("object", f"{place}: annotation `{token}`", add)

    def _keyed(self, table: str, value: Callable[[Record], Any]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for token, row, place in self._rows(table, "record"):
            made = self._try("record", f"{place}: {table} `{token}`", lambda row=row: value(row))
            if made is not None:
                found[token] = made
        return found

    def _rows(self, table: str, what: str) -> Iterator[tuple[str, Record, str]]:
        """Token, fields and place of each row."""
        path = self._folder / f"{table}.json"
        escapes = _has_escapes(path)
        for element, line in read_list(path):
            place = f"{path.name}:{line}"
            try:
                row = fields.record(element, "it")
                if escapes:
                    fields.check_characters(row)
                token = fields.text(row, "token")
            except InvalidError as error:
                self._report.left_out(what, "record-invalid", f"{place}: {error}")
            else:
                yield token, row, place

    def _try(self, what: str, place: str, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except InvalidError as error:
            self._report.left_out(what, "record-invalid", f"{place}: {error}")
            return None


@dataclass(frozen=True, slots=True)
class _Instant:
    """A sample with all that belongs to it; `pose` is that of the ego: x, y, heading."""

    token: str
    time: int
    place: str
    pose: tuple[float, float, float] | None
    sensors: tuple[tuple[str, str], ...]
    boxes: tuple[_Box, ...]


@dataclass(frozen=True, slots=True)
class _SceneContent:
    """A scene with all that belongs to it.

    Attributes:
        instants: In order of time.
        classes: Class name of each track.
    """

    name: str
    location: str
    params: tuple[tuple[str, str | float | bool], ...]
    instants: tuple[_Instant, ...]
    classes: tuple[tuple[str, str], ...]

    @property
    def weight(self) -> int:
        return sum(len(instant.boxes) for instant in self.instants)

    def digest(self) -> str:
        return hashlib.blake2b(repr(self).encode(errors="backslashreplace"), digest_size=16).hexdigest()


@dataclass(frozen=True, slots=True)
class SceneReader:
    """Reads some scenes, which it holds.

    Attributes:
        scenes: In order of their names.
        classes: Class of the tree for each class name.
    """

    scenes: tuple[_SceneContent, ...] = field(repr=False)
    classes: Mapping[str, str]

    def recordings(self, labels: Labels, report: Report) -> Iterator[Recording]:
        """The recordings in order of their names."""
        classes = ClassNames(self.classes, report)
        for scene in self.scenes:
            for instant in scene.instants:
                if instant.pose is None:
                    message = f"{instant.place}: sample `{instant.token}` has no sound {_POSE_CHANNEL} pose"
                    report.left_out("label", "record-invalid", message)
            found = labels.recording(scene.name, list(_labels(scene, classes)))
            if found is not None:
                yield found


def _labels(scene: _SceneContent, classes: ClassNames) -> Iterator[tuple[Label, str]]:
    posed = [(instant, instant.pose) for instant in scene.instants if instant.pose is not None]
    centres = [
        (instant.time, x - _AXLE_TO_CENTRE_M * math.sin(heading), y + _AXLE_TO_CENTRE_M * math.cos(heading))
        for instant, (x, y, heading) in posed
    ]
    tracks: defaultdict[str, list[tuple[int, float, float]]] = defaultdict(list)
    step: dict[str, int] = {}
    for instant, _ in posed:
        for box in instant.boxes:
            step[box.token] = len(tracks[box.track])
            tracks[box.track].append((instant.time, box.x, box.y))
    width, length, height = _EGO_SIZE_M
    names, params = dict(scene.classes), dict(scene.params)
    for number, (instant, pose) in enumerate(posed):
        _, x, y = centres[number]
        ego = LabelObject(
            id="ego",
            category="Car",
            source_class="vehicle.ego",
            x=x,
            y=y,
            heading=pose[2],
            width=width,
            length=length,
            height=height,
            velocity=_velocity(centres, number),
        )
        objects = tuple(
            LabelObject(
                id=box.token,
                category=classes.category(names[box.track]),
                source_class=names[box.track],
                x=box.x,
                y=box.y,
                heading=box.heading,
                width=box.size[0],
                length=box.size[1],
                height=box.size[2],
                velocity=_velocity(tracks[box.track], step[box.token]),
                track=box.track,
                attributes=box.attributes,
            )
            for box in instant.boxes
        )
        sensors = dict(instant.sensors)
        label = Label(instant.token, scene.name, instant.time, scene.location, ego, objects, params, sensors)
        yield label, instant.place


def _velocity(track: list[tuple[int, float, float]], step: int) -> tuple[float, float] | None:
    """Central difference, at the ends of a track one-sided; None where there is no neighbour close enough in time."""
    here = track[step]
    before = track[step - 1] if step > 0 and here[0] - track[step - 1][0] <= _LONGEST_STEP_US else here
    after = track[step + 1] if step + 1 < len(track) and track[step + 1][0] - here[0] <= _LONGEST_STEP_US else here
    seconds = (after[0] - before[0]) / 1e6
    return None if seconds <= 0 else ((after[1] - before[1]) / seconds, (after[2] - before[2]) / seconds)


def _has_escapes(path: Path) -> bool:
    """Whether a file may name a character by its number; only so can it have half of one."""
    try:
        with path.open("rb") as file:
            return any(b"\\u" in line for line in file)
    except OSError:
        return True  # whoever reads it says so


def _log(row: Record) -> tuple[str, str | None]:
    """Location and date."""
    return fields.text(row, "location"), fields.optional_text(row, "date_captured")


def _pose(row: Record) -> tuple[float, float, float]:
    """Position and heading of `translation` and `rotation`."""
    x, y, _ = fields.vector(row, "translation", 3)
    a, b, c, d = fields.vector(row, "rotation", 4)
    norm = math.hypot(a, b, c, d)
    if not 0.5 < norm < 2:
        raise InvalidError("`rotation` is not a unit quaternion")
    a, b, c, d = a / norm, b / norm, c / norm, d / norm
    yaw = math.atan2(2 * (a * d + b * c), 1 - 2 * (c * c + d * d))
    return x, y, normalize(yaw - math.pi / 2)


def _attributes(row: Record, names: Mapping[str, str], visible: Mapping[str, str]) -> dict[str, str | float | bool]:
    """What else an annotation says: `vehicle.parked` becomes `vehicle: parked`; tokens may be empty."""
    told: dict[str, str | float | bool] = {}
    for token in fields.optional_items(row, "attribute_tokens"):
        group, _, value = _found(names, token, "attribute").rpartition(".")
        told[group or "attribute"] = value
    if (level := fields.optional_text(row, "visibility_token")) is not None:
        told["visibility"] = visible.get(level, level)
    for key in ("num_lidar_pts", "num_radar_pts"):
        if row.get(key) is not None:
            told[key] = fields.integer(row, key)
    return told


def _params(description: object, location: str, date: str | None) -> dict[str, str | float | bool]:
    """Parameters of a scene: the words of its description are the only source of weather and time of day."""
    words = description if isinstance(description, str) else ""
    lower = words.lower()
    params: dict[str, str | float | bool] = {"location": location}
    if date:
        params["date"] = date
    if words:
        params |= {"description": words, "rain": "rain" in lower, "night": "night" in lower}
    return params


def _found(table: Mapping[str, Any], token: object, name: str) -> Any:
    if not isinstance(token, str) or token not in table:
        raise InvalidError(f"{name} `{token}` is not there")
    return table[token]


def _table_folders(path: Path) -> list[Path]:
    folders = [path] if path.name.startswith("v1.0-") else sorted(path.glob("v1.0-*"))
    return [f for f in folders if (f / "scene.json").is_file() or (f / "sample_annotation.json").is_file()]


def _maps(dataroot: Path, locations: list[str], options: Options, report: Report) -> dict[str, tuple[MapFeature, ...]]:
    maps = read_maps(options.maps, report)
    for location in locations:
        expansion = dataroot / "maps" / "expansion" / f"{location}.json"
        if location in maps or Path(location).name != location or not expansion.is_file():
            continue

        def tell(element: str, problem: str, file: str = expansion.name) -> None:
            report.left_out("map element", "map-invalid", f"{file}: element `{element}`: {problem}")

        maps[location] = read_expansion(expansion, tell)
    return maps
