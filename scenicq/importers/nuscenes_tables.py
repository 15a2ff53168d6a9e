"""The tables of nuScenes, joined; what is unsound is reported and left out."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenicq.geometry.angles import normalize
from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.json_tables import read_list
from scenicq.importers.nuscenes_scenes import POSE_CHANNEL, Box, Instant, SceneContent
from scenicq.importers.report import Report

__all__ = ["Tables"]

_CHUNK = 1 << 20
_ZONE = re.compile(r"([+-])(\d\d)(\d\d)$")
"""At the end of a log's name, as in `n015-2018-07-24-11-22-45+0800`: hours and minutes ahead of UTC."""

_RAIN = re.compile(r"(?<!after )\brain")
"""Rain that falls; "after rain" the streets are only wet."""


@dataclass(frozen=True, slots=True)
class _Log:
    """A log: `ahead_s` is how far its clock is ahead of UTC, where its name says it."""

    location: str
    date: str | None
    ahead_s: int | None


@dataclass(frozen=True, slots=True)
class _Scene:
    name: str
    log: _Log
    params: Mapping[str, str | float | bool]
    place: str


@dataclass(frozen=True, slots=True)
class _Sample:
    token: str
    time: int
    place: str


class Tables:
    """The tables, joined; what is unsound is reported and left out."""

    def __init__(self, folder: Path, report: Report) -> None:
        self._folder = folder
        self._report = report
        logs = self._keyed("log", _log)
        self.scenes: dict[str, _Scene] = {}
        for token, row, place in self._rows("scene", "recording"):
            self._try("recording", place, lambda: self._add_scene(token, row, place, logs))  # noqa: B023
        self.locations = sorted({scene.log.location for scene in self.scenes.values()})
        self.samples: dict[str, tuple[str, _Sample]] = {}
        self.samples_of: defaultdict[str, list[_Sample]] = defaultdict(list)
        for token, row, place in self._rows("sample", "label"):
            self._try("label", place, lambda: self._add_sample(token, row, place))  # noqa: B023
        self.sensors: defaultdict[str, dict[str, str]] = defaultdict(dict)
        self.poses = self._read_sensor_files()
        self.classes = self._read_classes()
        self.boxes: defaultdict[str, list[Box]] = defaultdict(list)
        self._read_boxes()

    def scene(self, token: str) -> SceneContent:
        """All that belongs to a scene."""
        scene = self.scenes[token]
        samples = sorted(self.samples_of[token], key=lambda sample: (sample.time, sample.token))
        instants = tuple(
            Instant(
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
        return SceneContent(
            scene.name, scene.log.location, scene.log.ahead_s, tuple(scene.params.items()), instants, classes
        )

    def _add_scene(self, token: str, row: Record, place: str, logs: Mapping[str, _Log]) -> None:
        name = fields.text(row, "name")
        log: _Log = _found(logs, fields.text(row, "log_token"), "log")
        if any(scene.name == name for scene in self.scenes.values()):
            raise InvalidError(f"scene name `{name}` is used twice")
        self.scenes[token] = _Scene(name, log, _params(row.get("description"), log), place)

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
            if row.get("is_key_frame") is not True or str(row.get("sample_token")) not in self.samples:
                continue

            def add(row: Record = row) -> None:
                channel = _found(mounted, fields.text(row, "calibrated_sensor_token"), "calibrated_sensor")
                sample = fields.text(row, "sample_token")
                self.sensors[sample][channel] = fields.text(row, "filename")
                if channel == POSE_CHANNEL:
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
                self.boxes[sample].append(Box(token, track, x, y, heading, size, told))

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


def _has_escapes(path: Path) -> bool:
    """Whether a file may name a character by its number; only so can it have half of one."""
    try:
        with path.open("rb") as file:
            before = b""
            while chunk := file.read(_CHUNK):
                if b"\\u" in before + chunk:
                    return True
                before = chunk[-1:]
            return False
    except OSError:
        return True  # whoever reads it says so


def _log(row: Record) -> _Log:
    """What matters of a log."""
    zone = _ZONE.search(fields.optional_text(row, "logfile") or "")
    ahead = None
    if zone is not None:
        ahead = int(f"{zone[1]}1") * (int(zone[2]) * 3600 + int(zone[3]) * 60)
    return _Log(fields.text(row, "location"), fields.optional_text(row, "date_captured"), ahead)


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


def _params(description: object, log: _Log) -> dict[str, str | float | bool]:
    """Parameters of a scene: the words of its description are the only source of weather and daylight."""
    words = description if isinstance(description, str) else ""
    lower = words.lower()
    params: dict[str, str | float | bool] = {"location": log.location}
    if log.date:
        params["date"] = log.date
    if words:
        params |= {"description": words, "rain": _RAIN.search(lower) is not None, "night": "night" in lower}
    return params


def _found(table: Mapping[str, Any], token: object, name: str) -> Any:
    if not isinstance(token, str) or token not in table:
        raise InvalidError(f"{name} `{token}` is not there")
    return table[token]
