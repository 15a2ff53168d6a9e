"""INTERACTION: `recorded_trackfiles/SCENE/vehicle_tracks_*.csv` and `pedestrian_tracks_*.csv`, `maps/SCENE.osm`.

Conventions of the source: metres, `psi_rad` counter-clockwise from +x, 10 Hz. There is no ego: see `ego_choice`. People
have neither heading nor size, so none is observed.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.base import ClassNames, OpenedSource, Options, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing, take_map
from scenicq.importers.ego_choice import Moment, ego_facts, with_egos
from scenicq.importers.fields import InvalidError
from scenicq.importers.lanelet2_map import read_lanelets
from scenicq.importers.layouts import interaction_files
from scenicq.importers.motion import heading_of_yaw
from scenicq.importers.report import Report
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject

__all__ = ["Interaction"]

_COLUMNS = ("track_id", "frame_id", "timestamp_ms", "agent_type", "x", "y", "vx", "vy")
_LARGEST_ROWS = 20_000_000


class Interaction:
    """Importer of INTERACTION."""

    name = "interaction"
    layout = "`vehicle_tracks_*.csv`, perhaps in `recorded_trackfiles/SCENE`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is the dataset, a scene's folder or one above."""
        return bool(interaction_files(path))

    def read(self, path: Path, options: Options, report: Report) -> OpenedSource:
        """Open track files; each is a recording.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = interaction_files(path)
        if not files:
            raise missing(path, "no `vehicle_tracks_*.csv`")
        maps = read_maps(options.maps, report)
        choice = () if options.ego is None else (options.ego,)
        places: list[RecordingFiles] = []
        for file in files:
            scene = file.resolve().parent.name
            if (map_file := _map_file(file, scene)) is not None:
                take_map(scene, map_file, read_lanelets, maps, report)
            number = file.stem.removeprefix("vehicle_tracks_")
            walkers = file.with_name(f"pedestrian_tracks_{number}.csv")
            both = (file, walkers) if walkers.is_file() else (file,)
            places.append(RecordingFiles(f"{scene}/{number}", both, path, scene, choice))
        return by_file_source(
            f"interaction-{path.resolve().name}",
            maps,
            places,
            {**taxonomy("interaction"), **options.class_map},
            _read_tracks,
            frames=0,
            object_bytes=90,
            facts={**ego_facts(options.ego), "people": "neither heading nor size in the source"},
        )


def _map_file(file: Path, scene: str) -> Path | None:
    folders = list(file.resolve().parents)[:3]
    found = [folder / "maps" / f"{scene}.osm" for folder in folders]
    return next((candidate for candidate in found if candidate.is_file()), None)


def _read_tracks(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    times: dict[int, int] = {}
    members: dict[int, list[LabelObject]] = {}
    for file in place.files:
        for number, row in _rows(file):
            try:
                frame, time = _integer(row, "frame_id"), _integer(row, "timestamp_ms")
                if times.setdefault(frame, time) != time:
                    raise InvalidError(f"frame {frame} has another time than before")
                members.setdefault(frame, []).append(_object(row, classes))
            except InvalidError as error:
                report.left_out("object", "record-invalid", f"{file.name}:{number}: {error}")
    moments = [Moment(f"{place.name}/{frame}", times[frame] * 1000, tuple(members[frame])) for frame in sorted(members)]
    choice = next(iter(place.options), None)
    return with_egos(moments, choice, place.name, place.map, place.name, report)


def _rows(file: Path) -> Iterator[tuple[int, Mapping[str, str | None]]]:
    try:
        with file.open(encoding="utf-8", newline="") as lines:
            reader = csv.DictReader(lines)
            lacking = [name for name in _COLUMNS if name not in (reader.fieldnames or ())]
            if lacking:
                listed = ", ".join(f"`{name}`" for name in lacking)
                raise DataError(Diagnostic("file-invalid", f"{file} lacks the columns {listed}"))
            for number, row in enumerate(reader, start=2):
                if number > _LARGEST_ROWS:
                    raise DataError(Diagnostic("file-invalid", f"{file} has too many rows"))
                yield number, row
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(Diagnostic("file-invalid", f"{file} is not a CSV file: {error}")) from error
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror}")) from error


def _object(row: Mapping[str, str | None], classes: ClassNames) -> LabelObject:
    name, kind = row.get("track_id") or "", row.get("agent_type") or ""
    if not name or not kind:
        raise InvalidError("`track_id` or `agent_type` is missing")
    x, y, vx, vy = (_number(row, key) for key in ("x", "y", "vx", "vy"))
    yaw = _number(row, "psi_rad") if row.get("psi_rad") else None
    length = _number(row, "length") if row.get("length") else None
    width = _number(row, "width") if row.get("width") else None
    if any(size is not None and size <= 0 for size in (length, width)):
        raise InvalidError("its size is not positive")
    return LabelObject(
        id=name,
        category=classes.category(kind),
        source_class=kind,
        x=x,
        y=y,
        heading=None if yaw is None else heading_of_yaw(math.remainder(yaw, 2 * math.pi)),
        width=width,
        length=length,
        velocity=(vx, vy),
        track=name,
    )


def _number(row: Mapping[str, str | None], key: str) -> float:
    try:
        value = float(row.get(key) or "")
    except ValueError as error:
        raise InvalidError(f"`{key}` is not a number") from error
    if not abs(value) < 1e9:
        raise InvalidError(f"`{key}` is not finite")
    return value


def _integer(row: Mapping[str, str | None], key: str) -> int:
    value = _number(row, key)
    if value != int(value) or value < 0:
        raise InvalidError(f"`{key}` is not a whole number")
    return int(value)
