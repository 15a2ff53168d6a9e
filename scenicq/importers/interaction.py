"""INTERACTION: `recorded_trackfiles/SCENE/vehicle_tracks_*.csv` and `pedestrian_tracks_*.csv`, `maps/SCENE.osm`.

From version 1.2 on rows have a `case_id`, and each case is a recording; `SCENE_train.csv` holds all of a scene.

Conventions of the source: metres, `psi_rad` counter-clockwise from +x, 10 Hz. There is no ego: see `ego_choice`. People
have neither heading nor size, so none is observed.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from scenicq.errors import DataError
from scenicq.importers.base import ClassNames, ImportOptions, OpenedSource, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing, take_map
from scenicq.importers.ego_choice import Moment, ego_facts, with_egos
from scenicq.importers.fields import InvalidError
from scenicq.importers.interaction_cases import Case, Row, cases_of, columns_of, rows_of
from scenicq.importers.lanelet2_map import read_lanelets
from scenicq.importers.layouts import INTERACTION_PARTS, interaction_files
from scenicq.importers.motion import heading_of_yaw
from scenicq.importers.recording_checks import radians
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject

__all__ = ["Interaction"]

_COLUMNS = ("track_id", "frame_id", "timestamp_ms", "agent_type", "x", "y", "vx", "vy")


class Interaction:
    """Importer of INTERACTION."""

    name = "interaction"
    layout = "`vehicle_tracks_*.csv`, perhaps in `recorded_trackfiles/SCENE`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is the dataset, a scene's folder or one above."""
        return bool(interaction_files(path))

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open track files; each is a recording.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = interaction_files(path)
        if not files:
            raise missing(path, "no `vehicle_tracks_*.csv`")
        maps = read_maps(options.maps, report)
        choice = "" if options.ego is None else options.ego
        places: list[RecordingFiles] = []
        for file in files:
            scene, number = _scene(file)
            if (map_file := _map_file(file, scene)) is not None:
                take_map(scene, map_file, read_lanelets, maps, report)
            try:
                places += _places(file, path, scene, f"{scene}/{number}", choice, report)
            except DataError as error:
                for diagnostic in error.diagnostics:
                    report.leave_out("recording", diagnostic.code, diagnostic.message)
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


def _scene(file: Path) -> tuple[str, str]:
    """Names of the scene and of the file in it."""
    scene, _, part = file.stem.rpartition("_")
    if part in INTERACTION_PARTS:
        return scene, part
    return file.resolve().parent.name, file.stem.removeprefix("vehicle_tracks_")


def _places(file: Path, root: Path, scene: str, name: str, choice: str, report: Report) -> Iterator[RecordingFiles]:
    """The recordings of a file, with the people of another."""
    walkers = file.with_name(file.name.replace("vehicle_tracks_", "pedestrian_tracks_"))
    both = (file, walkers) if walkers != file and walkers.is_file() else (file,)
    cases = [cases_of(each) for each in both]
    for each, found in zip(both, cases, strict=True):
        rows = sum(case.rows for case in found.values())
        load_specification("interaction").count_columns("", columns_of(each), report, rows)
    for case in dict.fromkeys(case for found in cases for case in found):
        found = [each.get(case, Case()) for each in cases]
        yield RecordingFiles(
            f"{name}/{case}" if case else name,
            both,
            root,
            scene,
            (choice, *(each.text for each in found)),
            sum(each.rows for each in found),
            "".join(each.digest for each in found) + choice,
        )


def _map_file(file: Path, scene: str) -> Path | None:
    folders = list(file.resolve().parents)[:3]
    found = [folder / "maps" / f"{scene}.osm" for folder in folders]
    return next((candidate for candidate in found if candidate.is_file()), None)


def _read_tracks(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    times: dict[int, int] = {}
    members: dict[int, list[LabelObject]] = {}
    choice, *ranges = place.options
    for file, text in zip(place.files, ranges, strict=True):
        for number, row in rows_of(file, text, _COLUMNS):
            try:
                frame, time = _integer(row, "frame_id"), _integer(row, "timestamp_ms")
                if times.setdefault(frame, time) != time:
                    raise InvalidError(f"frame {frame} has another time than before")
                members.setdefault(frame, []).append(_object(row, classes, report))
            except InvalidError as error:
                report.leave_out("object", "record-invalid", f"{file.name}: {place.name}: row {number}: {error}")
    told = _apart(members, place.name, report)
    moments = [Moment(f"{place.name}/{frame}", times[frame] * 1000, tuple(told[frame])) for frame in sorted(members)]
    return with_egos(moments, choice or None, place.name, place.map, place.name, report)


def _apart(members: dict[int, list[LabelObject]], name: str, report: Report) -> dict[int, list[LabelObject]]:
    """The objects of each frame; of those that share an id at one time, people are numbered by themselves."""
    shared: set[str] = set()
    for found in members.values():
        kinds = {(each.id, each.source_class) for each in found}
        shared |= {key for key, count in Counter(key for key, _ in kinds).items() if count > 1}
    if not shared:
        return members
    report.assume(
        "recording", "people numbered apart",
        f"{name}: track {min(shared)} is a vehicle and a person at one time; such people are called `P` and the number",
    )  # fmt: skip
    return {
        frame: [
            replace(each, id=f"P{each.id}", track=f"P{each.id}")
            if each.id in shared and each.source_class.startswith("pedestrian")
            else each
            for each in found
        ]
        for frame, found in members.items()
    }


def _object(row: Row, classes: ClassNames, report: Report) -> LabelObject:
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
        heading=None if yaw is None else heading_of_yaw(math.remainder(radians(yaw, report), 2 * math.pi)),
        width=width,
        length=length,
        velocity=(vx, vy),
        track=name,
    )


def _number(row: Row, key: str) -> float:
    try:
        value = float(row.get(key) or "")
    except ValueError as error:
        raise InvalidError(f"`{key}` is not a number") from error
    if not abs(value) < 1e9:
        raise InvalidError(f"`{key}` is not finite")
    return value


def _integer(row: Row, key: str) -> int:
    value = _number(row, key)
    if value != int(value) or value < 0:
        raise InvalidError(f"`{key}` is not a whole number")
    return int(value)
