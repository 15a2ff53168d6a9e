"""The tables of nuScenes, joined; what is unsound is reported and left out.

What is not read is counted (`specifications/nuscenes.json`).
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenicq.geometry.camera import Camera
from scenicq.importers import fields
from scenicq.importers.cameras import Mount, Pose, posed
from scenicq.importers.cameras import pose_of as vehicle_pose
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.json_tables import ElementBlock, Rows, read_list
from scenicq.importers.nuscenes_boxes import Box, Boxes, BoxReader, found, joined, of_rows, pose
from scenicq.importers.nuscenes_rows import ANNOTATIONS, EGO_POSES, SENSOR_FILES, moment
from scenicq.importers.nuscenes_scenes import POSE_CHANNEL, Instant, SceneContent
from scenicq.importers.recording_checks import tell_order
from scenicq.importers.report import Report
from scenicq.importers.specification import specification

__all__ = ["Tables"]

_LARGEST_TIME = 1 << 62
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


@dataclass(frozen=True, slots=True)
class _Sample:
    token: str
    time: int
    place: str


@dataclass(frozen=True, slots=True)
class _Mounted:
    """A sensor on a vehicle; what is no camera, or not calibrated, has no mount."""

    channel: str
    mount: Mount | None


@dataclass(frozen=True, slots=True)
class _Image:
    sample: str
    sensor: _Mounted
    width: int
    height: int


class _Place:
    """File and line of a row, found out only for messages."""

    __slots__ = ("_block", "_file", "_number")

    def __init__(self, file: str, block: ElementBlock, number: int) -> None:
        self._file = file
        self._block = block
        self._number = number

    def __str__(self) -> str:
        return f"{self._file}:{self._block.line(self._number)}"


class Tables:
    """The tables, joined; what is unsound is reported and left out."""

    def __init__(self, folder: Path, report: Report) -> None:
        self._folder = folder
        self._report = report
        logs = self._keyed("log", _log)
        self.scenes: dict[str, _Scene] = {}
        for token, row, place in self._rows("scene", "recording"):
            self._try("recording", place, lambda: self._add_scene(token, row, logs))  # noqa: B023
        self.locations = sorted({scene.log.location for scene in self.scenes.values()})
        self.samples: dict[str, tuple[str, _Sample]] = {}
        self.samples_of: defaultdict[str, list[_Sample]] = defaultdict(list)
        for token, row, place in self._rows("sample", "label"):
            self._try("label", place, lambda: self._add_sample(token, row, place))  # noqa: B023
        self.sensors: defaultdict[str, dict[str, tuple[str, Camera | None]]] = defaultdict(dict)
        self.poses = self._read_sensor_files()
        self._classes: dict[str, str] = self._read_classes()
        self._read_boxes()

    def scene(self, token: str) -> SceneContent:
        """All that belongs to a scene."""
        scene = self.scenes[token]
        instants = tuple(
            Instant(
                sample.token,
                sample.time,
                sample.place,
                self.poses.get(sample.token),
                tuple((channel, *file) for channel, file in sorted(self.sensors[sample.token].items())),
                self._boxes_of[sample.token],
            )
            for sample in self.samples_of[token]
        )
        start = self._first_box[token]
        boxes = self._boxes.take(self._order[start : start + sum(instant.boxes for instant in instants)])
        used, numbers = np.unique(boxes.tracks, return_inverse=True)
        of_used: list[int] = used.tolist()
        tracks = tuple([self._tracks[number] for number in of_used])
        params = tuple(scene.params.items())
        return SceneContent(
            scene.name, scene.log.location, scene.log.ahead_s, params, instants, replace(boxes, tracks=numbers), tracks
        )

    def _add_scene(self, token: str, row: Record, logs: Mapping[str, _Log]) -> None:
        name = fields.text(row, "name")
        log: _Log = found(logs, fields.text(row, "log_token"), "log")
        if any(scene.name == name for scene in self.scenes.values()):
            raise InvalidError(f"scene name `{name}` is used twice")
        self.scenes[token] = _Scene(name, log, _params(row.get("description"), log))

    def _add_sample(self, token: str, row: Record, place: _Place) -> None:
        scene = fields.text(row, "scene_token")
        sample = _Sample(token, self._time(row), str(place))
        found(self.scenes, scene, "scene")
        if token in self.samples:
            raise InvalidError(f"sample `{token}` is there twice")
        self.samples[token] = (scene, sample)
        self.samples_of[scene].append(sample)

    def _time(self, row: Record) -> int:
        """Microseconds; some datasets in this layout have shares of one."""
        try:
            return fields.integer(row, "timestamp")
        except InvalidError:
            if not isinstance(row.get("timestamp"), float):
                raise
            time = round(fields.number(row, "timestamp"))
            if abs(time) > _LARGEST_TIME:
                raise
            message = "times are no whole numbers of microseconds; they are rounded"
            self._report.assumed("sample", "rounded times", message)
            return time

    def _read_sensor_files(self) -> dict[str, tuple[float, float, float, float]]:
        """Fill in the files of each sample; the result is x, y, heading and z of its ego."""
        channels = self._keyed("sensor", lambda row: fields.text(row, "channel"))
        mounted: dict[str, _Mounted] = {}
        for token, row, place in self._rows("calibrated_sensor", "record"):
            name = f"calibrated_sensor `{token}`"
            of = self._try(
                "record", place, lambda row=row: found(channels, fields.text(row, "sensor_token"), "sensor"), name
            )
            if of is not None:
                mounted[token] = _Mounted(of, self._try("camera", place, lambda row=row: _mount(row), name))
        pose_of: dict[str, str] = {}
        nearest: dict[str, tuple[float, str, str]] = {}
        images: defaultdict[str, list[_Image]] = defaultdict(list)
        sweeps = strays = 0
        for token, row, place in self._rows("sample_data", "sensor file", SENSOR_FILES):
            is_sweep = row.get("is_key_frame") is not True
            if is_sweep or str(row.get("sample_token")) not in self.samples:
                sweeps += is_sweep
                strays += not is_sweep
                continue

            def add(row: Record = row) -> None:
                sensor: _Mounted = found(mounted, fields.text(row, "calibrated_sensor_token"), "calibrated_sensor")
                sample, size = fields.text(row, "sample_token"), [row.get(key) for key in ("width", "height")]
                self.sensors[sample][sensor.channel] = fields.text(row, "filename"), None
                if sensor.channel == POSE_CHANNEL:
                    pose_of[sample] = fields.text(row, "ego_pose_token")
                elif sample not in pose_of:
                    away = abs(moment(row.get("timestamp")) - self.samples[sample][1].time)
                    other = (away, sensor.channel, fields.text(row, "ego_pose_token"))
                    nearest[sample] = min(other, nearest.get(sample, other))
                width, height = (pixels if type(pixels) is int else 0 for pixels in size)
                if sensor.mount is not None and width > 0 and height > 0:
                    images[fields.text(row, "ego_pose_token")].append(_Image(sample, sensor, width, height))

            self._try("sensor file", place, add, f"sample_data `{token}`")
        self._report.not_read("sample_data/sweeps", sweeps)
        self._report.not_read("sample_data of samples that are not there", strays)
        for sample, (_, _, token) in nearest.items():
            if sample not in pose_of:
                pose_of[sample] = token
                message = (
                    f"no sound key frame of {POSE_CHANNEL}: the ego is where it was at the key frame nearest in time"
                )
                self._report.assumed("sample", "ego pose", message)
        wanted = {*pose_of.values(), *images}
        poses: dict[str, tuple[float, float, float, float]] = {}
        for token, row, place in self._rows("ego_pose", "ego pose", EGO_POSES):
            if token not in wanted:
                continue
            made = self._try("ego pose", place, lambda row=row: pose(row), f"ego_pose `{token}`")
            if made is not None:
                poses[token] = made
                vehicle = vehicle_pose(tuple(row["rotation"]), tuple(row["translation"]))
                for image in images.get(token, ()):
                    self._try("camera", place, lambda image=image, vehicle=vehicle: self._add_camera(image, vehicle))
        return {sample: poses[token] for sample, token in pose_of.items() if token in poses}

    def _add_camera(self, image: _Image, vehicle: Pose) -> None:
        channel, mount = image.sensor.channel, image.sensor.mount
        if mount is not None:
            camera = posed(mount, vehicle, image.width, image.height)
            self.sensors[image.sample][channel] = self.sensors[image.sample][channel][0], camera

    def _read_classes(self) -> dict[str, str]:
        """Class name of each instance."""
        names = self._keyed("category", lambda row: fields.text(row, "name"))
        return self._keyed("instance", lambda row: found(names, fields.text(row, "category_token"), "category"))

    def _read_boxes(self) -> None:
        attributes = self._keyed("attribute", lambda row: fields.text(row, "name"))
        visible: dict[str, str] = {}
        if (self._folder / "visibility.json").is_file():
            visible = self._keyed("visibility", lambda row: fields.text(row, "level"))
        sample_numbers = {token: number for number, token in enumerate(self.samples)}
        track_numbers = {token: number for number, token in enumerate(sorted(self._classes))}
        reader = BoxReader(sample_numbers, track_numbers, attributes, visible)
        path = self._folder / "sample_annotation.json"
        self._boxes = joined([self._boxes_in(reader, path.name, block) for block in read_list(path, ANNOTATIONS)])
        self._tracks: list[tuple[str, str]] = [(token, self._classes[token]) for token in track_numbers]
        # Boxes by scene, then by sample; those of one sample as they come.
        counts: list[int] = np.bincount(self._boxes.samples, minlength=len(self.samples)).tolist()
        self._boxes_of: dict[str, int] = dict(zip(self.samples, counts, strict=True))
        rank = np.empty(len(self.samples), dtype=np.int64)
        self._first_box: dict[str, int] = {}
        ranked = first = 0
        for scene in self.scenes:
            tell_order(
                self.scenes[scene].name,
                [sample.time for sample in self.samples_of[scene]],
                self._report,
                numbered=False,
            )
            self.samples_of[scene].sort(key=lambda sample: (sample.time, sample.token))
            self._first_box[scene] = first
            for sample in self.samples_of[scene]:
                rank[sample_numbers[sample.token]] = ranked
                ranked += 1
                first += self._boxes_of[sample.token]
        self._order = np.argsort(rank[self._boxes.samples], kind="stable")

    def _boxes_in(self, reader: BoxReader, file: str, block: ElementBlock) -> Boxes:
        boxes = reader.columns(block.rows) if block.rows is not None else None
        if boxes is not None:
            return boxes
        rows: list[Box] = []
        for token, row, place in self._rows_in(block, file, "object"):
            box = self._try("object", place, lambda: reader.row(token, row), f"annotation `{token}`")  # noqa: B023
            if box is not None:
                rows.append(box)
        return of_rows(rows)

    def _keyed(self, table: str, value: Callable[[Record], Any]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for token, row, place in self._rows(table, "record"):
            made = self._try("record", place, lambda row=row: value(row), f"{table} `{token}`")
            if made is not None:
                values[token] = made
        return values

    def _rows(self, table: str, what: str, decoder: Rows | None = None) -> Iterator[tuple[str, Record, _Place]]:
        """Token, fields and place of each row."""
        path = self._folder / f"{table}.json"
        for block in read_list(path, decoder):
            yield from self._rows_in(block, path.name, what, block.rows)

    def _rows_in(
        self, block: ElementBlock, file: str, what: str, decoded: list[Any] | None = None
    ) -> Iterator[tuple[str, Record, _Place]]:
        # only where a character is named by its number can there be half of one
        escapes = decoded is None and "\\u" in block.text
        known = specification("nuscenes")
        for number, element in enumerate(block.elements if decoded is None else decoded):
            place = _Place(file, block, number)
            try:
                row = element if decoded is not None else fields.record(element, "it")
                if escapes:
                    fields.check_characters(row)
                token = fields.text(row, "token")
            except InvalidError as error:
                self._report.left_out(what, "record-invalid", f"{place}: {error}")
            else:
                if decoded is None:
                    known.count_rows((row,), self._report, file.removesuffix(".json"))
                yield token, row, place

    def _try(self, what: str, place: _Place, make: Callable[[], Any], name: str = "") -> Any:
        try:
            return make()
        except InvalidError as error:
            of = f"{name}: " if name else ""
            self._report.left_out(what, "record-invalid", f"{place}: {of}{error}")
            return None


def _log(row: Record) -> _Log:
    """What matters of a log."""
    zone = _ZONE.search(fields.optional_text(row, "logfile") or "")
    ahead = None
    if zone is not None:
        ahead = int(f"{zone[1]}1") * (int(zone[2]) * 3600 + int(zone[3]) * 60)
    return _Log(fields.text(row, "location"), fields.optional_text(row, "date_captured"), ahead)


def _mount(row: Record) -> Mount | None:
    """How a sensor sees, where it is a camera."""
    matrix = row.get("camera_intrinsic")
    if not matrix:
        return None
    rows = [fields.vector({"camera_intrinsic": line}, "camera_intrinsic", 3) for line in
            fields.items(row, "camera_intrinsic")]  # fmt: skip
    if len(rows) != 3:
        raise InvalidError("`camera_intrinsic` has not three rows")
    pose = vehicle_pose(fields.vector(row, "rotation", 4), fields.vector(row, "translation", 3))
    return Mount(pose, (rows[0][0], rows[1][1], rows[0][2], rows[1][2]))


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
