"""The tables of nuScenes, joined; what is unsound is reported and left out.

What is not read is counted (`specifications/nuscenes.json`).
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from scenicq.geometry.camera import Camera
from scenicq.importers import fields
from scenicq.importers import nuscenes_rows as tables
from scenicq.importers.cameras import Mount, Pose, place_camera
from scenicq.importers.cameras import pose_of as vehicle_pose
from scenicq.importers.fields import InvalidError, whole
from scenicq.importers.json_tables import ElementBlock, read_list
from scenicq.importers.nuscenes_boxes import Boxes, BoxReader, headings, join_boxes, norms_of, vectors
from scenicq.importers.nuscenes_scenes import POSE_CHANNEL, Instant, SceneContent
from scenicq.importers.recording_checks import check_order
from scenicq.importers.report import Report
from scenicq.importers.typed_rows import ABSENT, RowError, RowType

__all__ = ["Tables"]

R = TypeVar("R", bound=tables.TableRow)
V = TypeVar("V")

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

    def __init__(self, file: str, block: ElementBlock[Any], number: int) -> None:
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
        logs = self._keyed(tables.LOGS, _log)
        self.scenes: dict[str, _Scene] = {}
        for scene, place in self._rows(tables.SCENES, "recording"):
            self._try("recording", place, lambda: self._add_scene(scene, logs), f"scene `{scene.token}`")  # noqa: B023
        self.locations = sorted({each.log.location for each in self.scenes.values()})
        self.samples: dict[str, tuple[str, _Sample]] = {}
        self.samples_of: defaultdict[str, list[_Sample]] = defaultdict(list)
        for sample, place in self._rows(tables.SAMPLES, "label"):
            self._try("label", place, lambda: self._add_sample(sample, place), f"sample `{sample.token}`")  # noqa: B023
        self.sensors: defaultdict[str, dict[str, tuple[str, Camera | None]]] = defaultdict(dict)
        self.poses = self._read_sensor_files()
        names = self._keyed(tables.CATEGORIES, lambda row: row.name)
        self._classes = self._keyed(tables.INSTANCES, lambda row: _found(names, row.category_token, "category"))
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

    def _add_scene(self, row: tables.SceneRow, logs: Mapping[str, _Log]) -> None:
        log = _found(logs, row.log_token, "log")
        if any(scene.name == row.name for scene in self.scenes.values()):
            raise InvalidError(f"scene name `{row.name}` is used twice")
        self.scenes[row.token] = _Scene(row.name, log, _params(row.description, log))

    def _add_sample(self, row: tables.SampleRow, place: _Place) -> None:
        sample = _Sample(row.token, self._time(row), str(place))
        _found(self.scenes, row.scene_token, "scene")
        if row.token in self.samples:
            raise InvalidError(f"sample `{row.token}` is there twice")
        self.samples[row.token] = (row.scene_token, sample)
        self.samples_of[row.scene_token].append(sample)

    def _time(self, row: tables.SampleRow) -> int:
        """Microseconds; some datasets in this layout have shares of one."""
        if isinstance(row.timestamp, float) and not row.timestamp.is_integer() and abs(row.timestamp) <= _LARGEST_TIME:
            message = "times are no whole numbers of microseconds; they are rounded"
            self._report.assume("sample", "rounded times", message)
            return round(row.timestamp)
        return whole(row.timestamp, "timestamp")

    def _read_sensor_files(self) -> dict[str, tuple[float, float, float, float]]:
        """Fill in the files of each sample; the result is x, y, heading and z of its ego."""
        channels = self._keyed(tables.SENSORS, lambda row: row.channel)
        mounted: dict[str, _Mounted] = {}
        for row, place in self._rows(tables.MOUNTED_SENSORS, "record"):
            name = f"calibrated_sensor `{row.token}`"
            of = self._try("record", place, lambda row=row: _found(channels, row.sensor_token, "sensor"), name)
            if of is not None:
                mounted[row.token] = _Mounted(of, self._try("camera", place, lambda row=row: _mount(row), name))
        pose_of: dict[str, str] = {}
        nearest: dict[str, tuple[float, str, str]] = {}
        images: defaultdict[str, list[_Image]] = defaultdict(list)
        sweeps = strays = 0
        for row, place in self._rows(tables.SENSOR_FILES, "sensor file"):
            is_sweep = row.is_key_frame is not True
            if is_sweep or row.sample_token not in self.samples:
                sweeps += is_sweep
                strays += not is_sweep
                continue

            def add(row: tables.SensorFile = row, sample: str = row.sample_token) -> None:
                sensor = _found(
                    mounted, _present(row.calibrated_sensor_token, "calibrated_sensor_token"), "calibrated_sensor"
                )
                self.sensors[sample][sensor.channel] = _present(row.filename, "filename"), None
                if sensor.channel == POSE_CHANNEL:
                    pose_of[sample] = _present(row.ego_pose_token, "ego_pose_token")
                elif sample not in pose_of:
                    away = abs(tables.moment(row.timestamp) - self.samples[sample][1].time)
                    other = (away, sensor.channel, _present(row.ego_pose_token, "ego_pose_token"))
                    nearest[sample] = min(other, nearest.get(sample, other))
                width, height = (pixels if type(pixels) is int else 0 for pixels in (row.width, row.height))
                if sensor.mount is not None and width > 0 and height > 0:
                    token = _present(row.ego_pose_token, "ego_pose_token")
                    images[token].append(_Image(sample, sensor, width, height))

            self._try("sensor file", place, add, f"sample_data `{row.token}`")
        self._report.count_unread("sample_data/sweeps", sweeps)
        self._report.count_unread("sample_data of samples that are not there", strays)
        for sample, (_, _, token) in nearest.items():
            if sample not in pose_of:
                pose_of[sample] = token
                message = (
                    f"no sound key frame of {POSE_CHANNEL}: the ego is where it was at the key frame nearest in time"
                )
                self._report.assume("sample", "ego pose", message)
        wanted = {*pose_of.values(), *images}
        rows: list[tables.EgoPose] = []
        for row, place in self._rows(tables.EGO_POSES, "ego pose"):
            if row.token not in wanted:
                continue
            name = f"ego_pose `{row.token}`"
            vehicle = self._try("ego pose", place, lambda row=row: vehicle_pose(row.rotation, row.translation), name)
            if vehicle is not None:
                rows.append(row)
                for image in images.get(row.token, ()):
                    self._try("camera", place, lambda image=image, vehicle=vehicle: self._add_camera(image, vehicle))
        turns = [row.rotation for row in rows]
        turned: list[float] = headings(vectors(turns, 4), norms_of(turns)).tolist()
        poses = {row.token: (*row.translation[:2], heading, row.translation[2])
                 for row, heading in zip(rows, turned, strict=True)}  # fmt: skip
        return {sample: poses[token] for sample, token in pose_of.items() if token in poses}

    def _add_camera(self, image: _Image, vehicle: Pose) -> None:
        channel, mount = image.sensor.channel, image.sensor.mount
        if mount is not None:
            camera = place_camera(mount, vehicle, image.width, image.height)
            self.sensors[image.sample][channel] = self.sensors[image.sample][channel][0], camera

    def _read_boxes(self) -> None:
        attributes = self._keyed(tables.ATTRIBUTES, lambda row: row.name)
        visible: dict[str, str] = {}
        if (self._folder / "visibility.json").is_file():
            visible = self._keyed(tables.VISIBILITIES, lambda row: row.level)
        sample_numbers = {token: number for number, token in enumerate(self.samples)}
        track_numbers = {token: number for number, token in enumerate(sorted(self._classes))}
        reader = BoxReader(sample_numbers, track_numbers, attributes, visible)
        path = self._folder / "sample_annotation.json"
        self._boxes = join_boxes(
            [self._boxes_in(reader, path.name, block) for block in read_list(path, tables.ANNOTATIONS.many)]
        )
        self._tracks: list[tuple[str, str]] = [(token, self._classes[token]) for token in track_numbers]
        # Boxes by scene, then by sample; those of one sample as they come.
        counts: list[int] = np.bincount(self._boxes.samples, minlength=len(self.samples)).tolist()
        self._boxes_of: dict[str, int] = dict(zip(self.samples, counts, strict=True))
        rank = np.empty(len(self.samples), dtype=np.int64)
        self._first_box: dict[str, int] = {}
        ranked = first = 0
        for scene in self.scenes:
            check_order(
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

    def _boxes_in(self, reader: BoxReader, file: str, block: ElementBlock[tables.Annotation]) -> Boxes:
        rows, numbers = self._rows_of(tables.ANNOTATIONS, block, file, "object")

        def tell(number: int, problem: str) -> None:
            place = _Place(file, block, numbers[number])
            message = f"{place}: annotation `{rows[number].token}`: {problem}"
            self._report.leave_out("object", "record-invalid", message)

        return reader.boxes(rows, tell)

    def _keyed(self, table: RowType[R], value: Callable[[R], V]) -> dict[str, V]:
        values: dict[str, V] = {}
        for row, place in self._rows(table, "record"):
            made = self._try("record", place, lambda row=row: value(row), f"{table.at} `{row.token}`")
            if made is not None:
                values[row.token] = made
        return values

    def _rows(self, table: RowType[R], what: str) -> Iterator[tuple[R, _Place]]:
        """Each row with its place."""
        path = self._folder / f"{table.at}.json"
        for block in read_list(path, table.many):
            for row, number in zip(*self._rows_of(table, block, path.name, what), strict=True):
                yield row, _Place(path.name, block, number)

    def _rows_of(
        self, table: RowType[R], block: ElementBlock[R], file: str, what: str
    ) -> tuple[Sequence[R], Sequence[int]]:
        """The rows of a block that are what they must be, with their numbers."""
        if block.rows is not None:
            return block.rows, range(len(block.rows))
        rows: list[R] = []
        numbers: list[int] = []
        for number, element in enumerate(block.elements):
            try:
                rows.append(table.decode(element, self._report))
                numbers.append(number)
            except InvalidError as error:
                name = f"{table.at} `{error.name}`: " if isinstance(error, RowError) and error.name else ""
                name = name.replace("sample_annotation", "annotation")
                self._report.leave_out(what, "record-invalid", f"{_Place(file, block, number)}: {name}{error}")
        return rows, numbers

    def _try(self, what: str, place: _Place, make: Callable[[], V], name: str = "") -> V | None:
        try:
            return make()
        except InvalidError as error:
            of = f"{name}: " if name else ""
            self._report.leave_out(what, "record-invalid", f"{place}: {of}{error}")
            return None


def _present(value: str | None, key: str) -> str:
    """A field that not every row needs.

    Raises:
        InvalidError: It is missing.
    """
    if not value:
        raise InvalidError(f"`{key}` is missing")
    return value


def _found(table: Mapping[str, V], token: str, name: str) -> V:
    """What a table has for a token.

    Raises:
        InvalidError: Nothing.
    """
    if token not in table:
        raise InvalidError(f"{name} `{token}` is not there")
    return table[token]


def _log(row: tables.LogRow) -> _Log:
    """What matters of a log."""
    zone = _ZONE.search(row.logfile or "")
    ahead = None
    if zone is not None:
        ahead = int(f"{zone[1]}1") * (int(zone[2]) * 3600 + int(zone[3]) * 60)
    return _Log(row.location, row.date_captured or None, ahead)


def _mount(row: tables.MountedSensorRow) -> Mount | None:
    """How a sensor sees, where it is a camera."""
    raws = {"translation": row.translation, "rotation": row.rotation, "camera_intrinsic": row.camera_intrinsic}
    told = {name: fields.parse_json(bytes(raw)) for name, raw in raws.items() if raw is not ABSENT}
    if not told.get("camera_intrinsic"):
        return None
    rows = [fields.vector({"camera_intrinsic": line}, "camera_intrinsic", 3) for line in
            fields.items(told, "camera_intrinsic")]  # fmt: skip
    if len(rows) != 3:
        raise InvalidError("`camera_intrinsic` has not three rows")
    pose = vehicle_pose(fields.vector(told, "rotation", 4), fields.vector(told, "translation", 3))
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
