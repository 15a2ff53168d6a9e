"""Cameras of an Argoverse 2 log: `calibration/`, and the pose of the ego when each image was taken."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from scenicq.errors import DataError
from scenicq.geometry.camera import Camera
from scenicq.importers.cameras import Mount, Pose, place_camera, pose_of
from scenicq.importers.columnar import read_feather
from scenicq.importers.fields import InvalidError
from scenicq.importers.folders import readable
from scenicq.importers.layouts import ARGOVERSE2_FILES
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification

__all__ = ["POSE", "Images", "calibration_of", "check_pose", "nearest", "views_of"]

POSE = {"qw": "real", "qx": "real", "qy": "real", "qz": "real", "tx_m": "real", "ty_m": "real", "tz_m": "real"}
"""The columns of a pose."""

Images = Mapping[str, list[tuple[int, str]]]
"""Times, in nanoseconds and in order, and names of the images of each camera."""

_FARTHEST_M = 1e7
_INTRINSICS, _MOUNTS = "intrinsics.feather", "egovehicle_SE3_sensor.feather"
_REALS, _SIZE = ("fx_px", "fy_px", "cx_px", "cy_px"), ("width_px", "height_px")
_SEEN = {"sensor_name": "text", **dict.fromkeys(_REALS, "real"), **dict.fromkeys(_SIZE, "integer")}


def views_of(log: Path, times: Sequence[int], images: Images, report: Report) -> dict[int, dict[str, Camera]]:
    """The cameras whose image is there, for each of some times.

    Args:
        log: Folder of the log.
        times: Nanoseconds.
        images: The images of each camera; the nearest in time counts.
        report: Takes what is unsound; a calibration that cannot be read counts as none.
    """

    def tell(problem: str) -> None:
        report.leave_out("camera", "record-invalid", f"{log.name}/{problem}")

    views: dict[int, dict[str, Camera]] = {time: {} for time in times}
    mounts = _mounts(calibration_of(log), tell, report) if any(images.values()) else {}
    near = {
        (time, name): nearest(shots, time)[0]
        for name, shots in images.items()
        if shots and name in mounts
        for time in times
    }
    vehicles = _vehicles(log, set(near.values()))
    for (time, name), taken in near.items():
        mount, size = mounts[name]
        if taken in vehicles:
            try:
                views[time][readable(name)] = place_camera(mount, vehicles[taken], *size)
            except InvalidError as error:
                tell(f"calibration: `{name}` at {taken}: {error}")
    return views


def nearest(images: list[tuple[int, str]], time: int) -> tuple[int, str]:
    """The image of a camera that is nearest to a time."""
    after = bisect_left(images, (time, ""))
    return min(images[max(0, after - 1) : after + 1], key=lambda image: abs(image[0] - time))


def calibration_of(log: Path) -> list[Path]:
    """The files of a log's calibration: none, or both."""
    files = [log / "calibration" / name for name in (_INTRINSICS, _MOUNTS)]
    return files if all(file.is_file() for file in files) else []


def check_pose(row: Mapping[str, Any]) -> None:
    """Refuse a row whose pose has a value that is missing or out of range.

    Raises:
        InvalidError: It has.
    """
    if any(row[name] is None or not abs(row[name]) < _FARTHEST_M for name in POSE):
        raise InvalidError("its pose is not finite")


def _read_pose(row: Mapping[str, Any]) -> Pose:
    check_pose(row)
    return pose_of((row["qw"], row["qx"], row["qy"], row["qz"]), (row["tx_m"], row["ty_m"], row["tz_m"]))


def _mounts(
    files: Sequence[Path], tell: Callable[[str], None], report: Report
) -> dict[str, tuple[Mount, tuple[int, int]]]:
    """How each camera is mounted and sees, and the size of its images; `files` as `calibration_of` gives them."""
    if not files:
        return {}
    try:
        seen = _by_sensor(_read(files[0], _SEEN, report))
        mounted = _by_sensor(_read(files[1], {"sensor_name": "text", **POSE}, report))
    except DataError as error:
        tell(f"calibration: {'; '.join(each.message for each in error.diagnostics)}")
        return {}
    found: dict[str, tuple[Mount, tuple[int, int]]] = {}
    for name in sorted(seen.keys() & mounted.keys()):
        row = seen[name]
        try:
            if any(row[key] is None for key in _SEEN):
                raise InvalidError("a value is missing")
            fx, fy, cx, cy = (row[key] for key in _REALS)
            found[name] = Mount(_read_pose(mounted[name]), (fx, fy, cx, cy)), (row[_SIZE[0]], row[_SIZE[1]])
        except InvalidError as error:
            tell(f"calibration: `{name}`: {error}")
    return found


def _read(file: Path, columns: Mapping[str, str], report: Report) -> dict[str, Any]:
    """Columns of a file of the calibration; what is not read is counted."""
    counter = load_specification("argoverse2").column_counter(f"calibration/{file.name}", report)
    return read_feather(file, columns, count=counter)


def _count_nothing(names: Sequence[str], rows: int) -> None:
    """What the table of poses has is counted where the poses of boxes are read."""


def _by_sensor(rows: Mapping[str, list[Any]]) -> dict[str, dict[str, Any]]:
    names = rows["sensor_name"]
    return {name: {key: values[row] for key, values in rows.items()} for row, name in enumerate(names) if name}


def _vehicles(log: Path, wanted: set[int]) -> dict[int, Pose]:
    """Poses of the ego at the times of images; those that are missing or unsound are left out."""
    if not wanted:
        return {}
    rows = read_feather(log / ARGOVERSE2_FILES[1], {"timestamp_ns": "integer", **POSE}, count=_count_nothing)
    found: dict[int, Pose] = {}
    for number, time in enumerate(rows["timestamp_ns"]):
        if time in wanted:
            with suppress(InvalidError):
                found[time] = _read_pose({key: values[number] for key, values in rows.items()})
    return found
