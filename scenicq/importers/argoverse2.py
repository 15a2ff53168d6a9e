"""Argoverse 2 sensor logs in their official layout: `LOG/annotations.feather`, `LOG/map/log_map_archive_*.json`.

Cameras are those of `calibration/`, where an image is there, without distortion: the images have none.

Conventions of the source: boxes lie in the frame of the ego at their timestamp (x ahead, y left, origin in the middle
of the rear axle), quaternions are w, x, y, z of either sign, times are nanoseconds. The ego has no box and nothing has
a velocity: see `facts`.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenicq.importers.argoverse2_cameras import POSE, calibration_of, check_pose, nearest, views_of
from scenicq.importers.argoverse2_map import read_archive
from scenicq.importers.base import ClassNames, ImportOptions, OpenedSource, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing, take_map
from scenicq.importers.columnar import read_feather
from scenicq.importers.fields import InvalidError
from scenicq.importers.folders import first_files, readable
from scenicq.importers.layouts import ARGOVERSE2_FILES, argoverse2_logs
from scenicq.importers.motion import RigidTransform, pose_of_quaternion, velocities
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject, OutOfPlane

__all__ = ["Argoverse2", "archive_of"]

_EGO_SIZE_M = (2.0, 4.877, 1.473)
"""Width, length and height of the recording car, a Ford Fusion."""

_AXLE_TO_CENTRE_M = 1.42
"""How far the centre of the ego's box lies ahead of its rear axle."""

_REACH_US, _LONGEST_STEP_US = 250_000, 550_000
_BOXES, _POSES = ARGOVERSE2_FILES
_FOLDERS = ("calibration", "map", "sensors")
_FRAMES = 156
_EGO_CLASS = "EGO_VEHICLE"
_SIZE = ("width_m", "length_m", "height_m")
_BOX = {"timestamp_ns": "integer", "track_uuid": "text", "category": "text", **dict.fromkeys(_SIZE, "real"), **POSE}


class Argoverse2:
    """Importer of Argoverse 2 sensor logs."""

    name = "argoverse2"
    layout = "a folder of logs, each with `annotations.feather` and `city_SE3_egovehicle.feather`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is a log, or a folder of them, or one of the official folders above."""
        return bool(argoverse2_logs(path))

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open logs; each is read when it is its turn, so memory is that of the largest and of the maps.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        logs = argoverse2_logs(path)
        if not logs:
            raise missing(path, "no log with `annotations.feather`")
        beside = {folder for above in {log.parent for log in logs if log != path} for folder in above.iterdir()}
        bare = [folder for folder in beside - {*logs} if (folder / _POSES).is_file()]
        report.count_unread(f"log without {_BOXES}", len(bare))
        maps = read_maps(options.maps, report)
        for log in logs:
            if (file := archive_of(log / "map")) is not None:
                take_map(log.name, file, read_archive, maps, report)
        return by_file_source(
            f"argoverse2-{path.resolve().name}",
            maps,
            [
                RecordingFiles(
                    log.name, (*(log / name for name in ARGOVERSE2_FILES), *calibration_of(log)), path, log.name
                )
                for log in logs
            ],
            {**taxonomy("argoverse2"), **options.class_map},
            _read_log,
            frames=_FRAMES * len(logs),
            object_bytes=50,
            facts={
                "ego_size_m": dict(zip(("width", "length", "height"), _EGO_SIZE_M, strict=True)),
                "ego_centre_ahead_of_rear_axle_m": _AXLE_TO_CENTRE_M,
                "velocity": f"differences over up to {2 * _REACH_US / 1e6} s, none across {_LONGEST_STEP_US / 1e6} s",
                "intersections": "unions of lanes with `is_intersection` that touch",
                "groups_and_roads": "lanes beside each other",
            },
        )


@dataclass(frozen=True, slots=True)
class _Box:
    track: str
    category: str
    x: float
    y: float
    heading: float
    out_of_plane: OutOfPlane
    size: tuple[float, float, float]
    attributes: Mapping[str, str | float | bool]


def archive_of(folder: Path) -> Path | None:
    """The vector map of a folder: the first by name, None if there is none."""
    return next(iter(first_files(folder, "log_map_archive_*.json")), None)


def _read_log(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    labels = _Log(place, classes, report).labels()
    return [(label, f"{place.name}/{_BOXES}") for label in labels]


class _Log:
    """One log; what is unsound is reported and left out."""

    def __init__(self, place: RecordingFiles, classes: ClassNames, report: Report) -> None:
        log = place.files[0].parent
        self._log = log
        self._folder = log.relative_to(place.root).as_posix()
        self._classes = classes
        self._report = report
        self._boxes: defaultdict[int, list[_Box]] = defaultdict(list)
        self._tracks: defaultdict[str, list[tuple[int, float, float]]] = defaultdict(list)
        self._known = load_specification("argoverse2")
        self._known.count_files(_files(log), report)
        rows = read_feather(
            log / _BOXES, _BOX, {"num_interior_pts": "integer"}, count=self._known.column_counter(_BOXES, report)
        )
        self._poses = self._read_poses({time for time in rows["timestamp_ns"] if time is not None})
        for number in range(len(rows["timestamp_ns"])):
            try:
                self._add({key: values[number] for key, values in rows.items()})
            except InvalidError as error:
                report.leave_out("object", "record-invalid", f"{log.name}/{_BOXES}:{number + 1}: {error}")

    def labels(self) -> list[Label]:
        times = sorted(self._poses)
        archive = archive_of(self._log / "map")
        parts = [] if archive is None else archive.stem.split("____")[1:]
        params: dict[str, str | float | bool] = {"location": parts[0].partition("_")[0]} if parts else {}
        images = self._images()
        views = views_of(self._log, times, images, self._report)
        places = [self._poses[time].transform_point((_AXLE_TO_CENTRE_M, 0.0, 0.0)) for time in times]
        centres = [(time // 1000, x, y) for time, (x, y, _) in zip(times, places, strict=True)]
        ego_moves = _moves(centres)
        moves = {
            (track, place[0]): move
            for track, places in self._tracks.items()
            for place, move in zip(places, _moves(places), strict=True)
        }
        return [
            Label(
                frame=f"{self._log.name}/{time}",
                recording=self._log.name,
                timestamp_us=time // 1000,
                map=self._log.name,
                ego=_ego(place, self._poses[time], move),
                objects=tuple(self._object(box, moves[box.track, time // 1000]) for box in self._boxes[time]),
                params=params,
                sensors=self._sensors(time, images),
                cameras=views[time],
            )
            for time, place, move in zip(times, places, ego_moves, strict=True)
        ]

    def _object(self, box: _Box, velocity: tuple[float, float] | None) -> LabelObject:
        return LabelObject(
            id=box.track,
            category=self._classes.category(box.category),
            source_class=box.category,
            x=box.x,
            y=box.y,
            heading=box.heading,
            width=box.size[0],
            length=box.size[1],
            height=box.size[2],
            velocity=velocity,
            track=box.track,
            attributes=box.attributes,
            out_of_plane=box.out_of_plane,
        )

    def _read_poses(self, wanted: set[int]) -> dict[int, RigidTransform]:
        rows = read_feather(
            self._log / _POSES,
            {"timestamp_ns": "integer", **POSE},
            count=self._known.column_counter(_POSES, self._report),
        )
        poses: dict[int, RigidTransform] = {}
        for number, time in enumerate(rows["timestamp_ns"]):
            if time in wanted and time not in poses:
                try:
                    poses[time] = _pose({key: values[number] for key, values in rows.items()})
                except InvalidError as error:
                    place = f"{self._log.name}/{_POSES}:{number + 1}"
                    self._report.leave_out("ego pose", "record-invalid", f"{place}: {error}")
        for time in sorted(wanted - set(poses)):
            message = f"{self._log.name}: annotations at {time} have no sound pose of the ego"
            self._report.leave_out("label", "record-invalid", message)
        return poses

    def _add(self, row: Mapping[str, Any]) -> None:
        time, track, category = row["timestamp_ns"], row["track_uuid"], row["category"]
        if category == _EGO_CLASS or (time is not None and time not in self._poses):
            return
        if time is None or not track or not category:
            raise InvalidError("`timestamp_ns`, `track_uuid` or `category` is missing")
        size = row["width_m"], row["length_m"], row["height_m"]
        if not all(value is not None and 0 < value < math.inf for value in size):
            raise InvalidError("its size is not positive")
        box = self._poses[time].compose(_pose(row))
        x, y, z = box.origin
        space = OutOfPlane(z, box.pitch, box.roll)
        points = row.get("num_interior_pts")
        attributes: dict[str, str | float | bool] = {} if points is None else {"num_interior_pts": points}
        self._boxes[time].append(_Box(track, category, x, y, box.heading, space, size, attributes))
        self._tracks[track].append((time // 1000, x, y))

    def _images(self) -> dict[str, list[tuple[int, str]]]:
        """Times and names of the images of each camera, where they are there."""
        found: dict[str, list[tuple[int, str]]] = {}
        for camera in sorted((self._log / "sensors" / "cameras").glob("*")):
            stems = [(file.stem, file.name) for file in camera.glob("*.jpg")]
            found[camera.name] = sorted((int(stem), name) for stem, name in stems if stem.isascii() and stem.isdigit())
        return found

    def _sensors(self, time: int, cameras: Mapping[str, list[tuple[int, str]]]) -> dict[str, str]:
        # A folder that is the log itself has no name of its own here.
        start = "" if self._folder == "." else f"{self._folder}/"
        sensors = {"lidar": f"{start}sensors/lidar/{time}.feather"}
        for camera, images in cameras.items():
            if images:
                sensors[camera] = f"{start}sensors/cameras/{camera}/{nearest(images, time)[1]}"
        return {readable(channel): readable(path) for channel, path in sorted(sensors.items())}


def _files(log: Path) -> Iterator[str]:
    """What is in a log's folders, as far as names tell kinds apart."""
    for entry in log.iterdir():
        if entry.name in _FOLDERS:
            yield from (f"{entry.name}/{each.name}" for each in entry.iterdir())
        else:
            yield entry.name


def _moves(places: Sequence[tuple[int, float, float]]) -> list[tuple[float, float] | None]:
    return velocities(places, reach_us=_REACH_US, longest_us=_LONGEST_STEP_US)


def _ego(place: tuple[float, float, float], pose: RigidTransform, velocity: tuple[float, float] | None) -> LabelObject:
    width, length, height = _EGO_SIZE_M
    return LabelObject(
        "ego", "Car", _EGO_CLASS, place[0], place[1], pose.heading, width, length, height, velocity,
        out_of_plane=OutOfPlane(place[2], pose.pitch, pose.roll),
    )  # fmt: skip


def _pose(row: Mapping[str, Any]) -> RigidTransform:
    check_pose(row)
    return pose_of_quaternion(row["qw"], row["qx"], row["qy"], row["qz"], (row["tx_m"], row["ty_m"], row["tz_m"]))
