"""KITTI tracking in its official layout: `label_02/*.txt`, with `oxts/*.txt` and `calib/*.txt` where they are there.

Conventions of the source: boxes lie in the frame of the rectified camera (x right, y down, z ahead; `rotation_y` turns
about y), at 10 Hz. The map frame is east and north of the first pose of the inertial unit; there is no map. The ego is
where that unit is, and as fast as it says; it has no size. Without `oxts` the ego stays at the origin, and nothing has
a velocity. What is not read is counted (`specifications/kitti.json`).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.angles import rotate
from scenicq.importers.base import ClassNames, ImportOptions, OpenedSource, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing
from scenicq.importers.fields import NO_MAP, InvalidError
from scenicq.importers.layouts import kitti_files
from scenicq.importers.motion import RigidTransform, pose_of_euler_angles, pose_of_matrix, velocities
from scenicq.importers.recording_checks import radians
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject

__all__ = ["Kitti"]

_LABELS = "label_02"
_STEP_US = 100_000
_REACH_US, _LONGEST_STEP_US = 250_000, 550_000
_MATRICES = (("R_rect", "R0_rect"), ("Tr_velo_cam", "Tr_velo_to_cam"), ("Tr_imu_velo", "Tr_imu_to_velo"))
"""The rectified camera, the scanner in the camera, the inertial unit in the scanner: both spellings are in use."""

_LABEL = (
    "frame", "track_id", "type", "truncated", "occluded", "alpha", *["bbox"] * 4, *["dimensions"] * 3,
    *["location"] * 3, "rotation_y", "score",
)  # fmt: skip
_OXTS = (
    "lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu", *["acceleration"] * 6,
    *["turn_rate"] * 6, *["accuracy"] * 2, *["status"] * 5,
)  # fmt: skip
"""What the columns of the files say."""
_FORWARD, _LEFTWARD = _OXTS.index("vf"), _OXTS.index("vl")

_EARTH_M = 6378137.0
_LARGEST_BYTES = 256 << 20
_FORWARD_CAMERA = RigidTransform((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
"""A camera that looks ahead from the inertial unit, whose x is ahead, y left and z up."""


class Kitti:
    """Importer of KITTI tracking sequences."""

    name = "kitti"
    layout = "a folder `label_02` with `*.txt`, perhaps in `training`"

    def recognises(self, path: Path) -> bool:
        """Whether the path has the labels."""
        return bool(kitti_files(path))

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open sequences; each is a recording.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = kitti_files(path)
        if not files:
            raise missing(path, "no `label_02/*.txt`")
        maps = read_maps(options.maps, report)
        return by_file_source(
            f"kitti-{path.resolve().name}",
            maps,
            [_place(file, path, next(iter(maps), NO_MAP)) for file in files],
            {**taxonomy("kitti"), **options.class_map},
            _read_sequence,
            frames=0,
            object_bytes=120,
            facts={
                "ego": "at the inertial unit, without a size; at the origin where `oxts` is missing",
                "velocity": "of the ego that of the inertial unit, unless it is 0 throughout; of others differences "
                f"over up to {2 * _REACH_US / 1e6} s, none without `oxts`",
                "time": "steps of 0.1 s from 0",
            },
        )


def _place(file: Path, root: Path, map_name: str) -> RecordingFiles:
    base = file.parent.parent
    others = (base / "oxts" / file.name, base / "calib" / file.name)
    return RecordingFiles(file.stem, (file, *(other for other in others if other.is_file())), root, map_name)


def _read_sequence(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    file = place.files[0]
    load_specification("kitti").count_files((each.name for each in file.parent.parent.iterdir()), report)
    extra = {path.parent.name: path for path in place.files[1:]}
    camera = _FORWARD_CAMERA
    if "calib" in extra:
        camera = _camera(extra["calib"], report)
    else:
        report.keep("recording", "file-missing", f"{file.name}: no `calib`; the camera looks ahead from the ego")
    poses = _poses(extra["oxts"], report) if "oxts" in extra else None
    if poses is None:
        report.keep("recording", "file-missing", f"{file.name}: no `oxts`; the ego stays at the origin")
    by_frame: defaultdict[int, list[LabelObject]] = defaultdict(list)
    for number, row in enumerate(_rows(file), start=1):
        where = f"{file.name}:{number}"
        try:
            frame = int(row[0]) if row and row[0].isdigit() else -1
            if frame < 0 or frame > 1_000_000:
                raise InvalidError("the frame is not a number")
            if len(row) > 2 and row[2] == "DontCare":
                report.count_unread(f"{_LABELS}/DontCare")
                continue
            _count_columns(_LABELS, _LABEL, len(row), report)
            if poses is not None and frame >= len(poses):
                raise InvalidError(f"frame {frame} has no pose")
            ego = RigidTransform((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
            by_frame[frame].append(
                _object(row, (poses[frame].place if poses else ego).compose(camera), classes, report)
            )
        except InvalidError as error:
            report.leave_out("object", "record-invalid", f"{where}: {error}")
    return _labels(place, by_frame, poses)


def _count_columns(table: str, names: Sequence[str], count: int, report: Report) -> None:
    """Count what is not read of a row of some columns; columns that the specification does not name have a number."""
    there = (*dict.fromkeys(names[:count]), *(f"column {number + 1}" for number in range(len(names), count)))
    load_specification("kitti").count_columns(table, there, report)


@dataclass(frozen=True, slots=True)
class _Pose:
    """The inertial unit at a frame: where it is, and its velocity, which has been 0 where nobody wrote it."""

    place: RigidTransform
    velocity: tuple[float, float]


def _labels(
    place: RecordingFiles, by_frame: dict[int, list[LabelObject]], poses: list[_Pose] | None
) -> list[tuple[Label, str]]:
    tracks: defaultdict[str, list[tuple[int, float, float]]] = defaultdict(list)
    for frame in sorted(by_frame) if poses else ():
        for member in by_frame[frame]:
            tracks[member.id].append((frame * _STEP_US, member.x, member.y))
    if poses:
        tracks["ego"] = [(frame * _STEP_US, *pose.place.origin[:2]) for frame, pose in enumerate(poses)]
    moves = {
        (name, at[0]): move
        for name, track in tracks.items()
        for at, move in zip(track, velocities(track, reach_us=_REACH_US, longest_us=_LONGEST_STEP_US), strict=True)
    }
    if poses and any(pose.velocity != (0.0, 0.0) for pose in poses):
        moves |= {("ego", frame * _STEP_US): pose.velocity for frame, pose in enumerate(poses)}
    made: list[tuple[Label, str]] = []
    for frame in range(len(poses)) if poses else sorted(by_frame):
        time = frame * _STEP_US
        at = poses[frame].place if poses else None
        x, y, heading = (*at.origin[:2], at.heading) if at else (0.0, 0.0, -math.pi / 2)
        ego = LabelObject("ego", "Car", "", x, y, heading, velocity=moves.get(("ego", time)))
        objects = tuple(_moving(member, moves.get((member.id, time))) for member in by_frame.get(frame, ()))
        sensors = {"image_02": f"{_prefix(place)}image_02/{place.name}/{frame:06d}.png"}
        made.append(
            (Label(f"{place.name}/{frame:06d}", place.name, time, place.map, ego, objects, {}, sensors), place.name)
        )
    return made


def _prefix(place: RecordingFiles) -> str:
    relative = place.files[0].parent.parent.relative_to(place.root).as_posix()
    return "" if relative == "." else f"{relative}/"


def _moving(member: LabelObject, velocity: tuple[float, float] | None) -> LabelObject:
    return LabelObject(
        member.id,
        member.category,
        member.source_class,
        member.x,
        member.y,
        member.heading,
        member.width,
        member.length,
        member.height,
        velocity,
        member.track,
        member.attributes,
    )


def _object(row: list[str], camera: RigidTransform, classes: ClassNames, report: Report) -> LabelObject:
    if len(row) < 17:
        raise InvalidError(f"the row has {len(row)} columns, not 17")
    height, width, length, x, y, z, turn = _numbers(row[10:17])
    if min(height, width, length) <= 0:
        raise InvalidError("its size is not positive")
    at = camera.transform_point((x, y - height / 2, z))
    radians(turn, report)
    ahead = camera.rotate((math.cos(turn), 0.0, -math.sin(turn)))
    attributes: dict[str, str | float | bool] = {"truncated": float(_numbers(row[3:4])[0]), "occluded": row[4]}
    heading = RigidTransform(ahead, ahead, ahead, at).heading
    name = row[1]
    return LabelObject(
        name, classes.category(row[2]), row[2], at[0], at[1], heading, width, length, height, None, name, attributes
    )


def _camera(file: Path, report: Report) -> RigidTransform:
    """The rectified camera, seen from the inertial unit."""
    spellings = {other: names[0] for names in _MATRICES for other in names}
    found: dict[str, list[float]] = {}
    try:
        for row in _rows(file):
            name = row[0].rstrip(":") if row else ""
            if len(row) in (10, 13):
                found[name] = _numbers(row[1:])
            if name:
                load_specification("kitti").count(f"calib/{spellings.get(name, name)}", report)
        steps = [_rows_of(next(found[name] for name in names if name in found)) for names in _MATRICES]
        rectified, velodyne, unit = (pose_of_matrix(step) for step in steps)
        return rectified.compose(velodyne).compose(unit).inverse()
    except InvalidError as error:
        raise DataError(Diagnostic("file-invalid", f"{file}: no sound calibration: {error}")) from error
    except StopIteration:
        lacking = [" or ".join(f"`{name}`" for name in names) for names in _MATRICES if found.keys().isdisjoint(names)]
        message = f"{file}: no sound calibration: there is no {lacking[0]}"
        raise DataError(Diagnostic("file-invalid", message)) from None


def _rows_of(values: list[float]) -> list[list[float]]:
    width = len(values) // 3
    return [
        [*values[start : start + 3], values[start + 3] if width == 4 else 0.0] for start in range(0, len(values), width)
    ]


def _poses(file: Path, report: Report) -> list[_Pose]:
    """The inertial unit by frame, metres east and north of the first."""
    found: list[_Pose] = []
    first: tuple[float, float] | None = None
    scale = 1.0
    for number, row in enumerate(_rows(file), start=1):
        try:
            latitude, longitude, altitude, roll, pitch, yaw = _numbers(row[:6])
            if abs(latitude) > 89:
                raise InvalidError("the latitude is out of range")
            forward, left = _numbers([row[_FORWARD], row[_LEFTWARD]]) if len(row) > _LEFTWARD else (0.0, 0.0)
        except (InvalidError, ValueError) as error:
            raise DataError(Diagnostic("file-invalid", f"{file}:{number}: no sound pose: {error}")) from error
        _count_columns("oxts", _OXTS, len(row), report)
        if first is None:
            scale = math.cos(math.radians(latitude))
        east = scale * _EARTH_M * math.radians(longitude)
        north = scale * _EARTH_M * math.log(math.tan(math.radians(90 + latitude) / 2))
        first = first or (east, north)
        place = pose_of_euler_angles(roll, pitch, yaw, (east - first[0], north - first[1], altitude))
        found.append(_Pose(place, rotate(-left, forward, place.heading)))
    return found


def _rows(file: Path) -> list[list[str]]:
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise DataError(Diagnostic("file-invalid", f"{file} is too large"))
        return [line.split() for line in file.read_text(encoding="utf-8-sig").splitlines()]
    except UnicodeDecodeError as error:
        raise DataError(Diagnostic("file-invalid", f"{file} is not text")) from error
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror}")) from error


def _numbers(texts: list[str]) -> list[float]:
    try:
        numbers = [float(text) for text in texts]
    except ValueError as error:
        raise InvalidError("a column is not a number") from error
    if any(not abs(value) < 1e9 for value in numbers):
        raise InvalidError("a column is not finite")
    return numbers
