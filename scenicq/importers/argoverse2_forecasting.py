"""Argoverse 2 motion forecasting: `ID/scenario_ID.parquet` with `ID/log_map_archive_ID.json`.

The ego is the track `AV`. Nothing has a size, so none is observed; headings and velocities are the source's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.argoverse2 import archive_of
from scenicq.importers.argoverse2_map import read_archive
from scenicq.importers.base import ClassNames, ImportOptions, OpenedSource, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing, take_map
from scenicq.importers.columnar import read_parquet
from scenicq.importers.fields import InvalidError
from scenicq.importers.layouts import argoverse2_scenarios
from scenicq.importers.motion import heading_of_yaw
from scenicq.importers.recording_checks import radians
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject

__all__ = ["Argoverse2Forecasting"]

_EGO_TRACK = "AV"
_STEP_US = 100_000
_STEPS = 110
_REALS = ("position_x", "position_y", "heading", "velocity_x", "velocity_y")
_COLUMNS = {"track_id": "text", "object_type": "text", "timestep": "integer", **dict.fromkeys(_REALS, "real")}
_OPTIONAL = {"city": "text"}
_TABLE = "scenario_*.parquet"


class Argoverse2Forecasting:
    """Importer of Argoverse 2 motion forecasting scenarios."""

    name = "argoverse2-forecasting"
    layout = "folders with `scenario_*.parquet`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is a scenario's folder, or one that holds them at up to two levels."""
        return bool(argoverse2_scenarios(path))

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open scenarios; each is a recording.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = argoverse2_scenarios(path)
        if not files:
            raise missing(path, "no `scenario_*.parquet`")
        maps = read_maps(options.maps, report)
        for file in files:
            if (archive := archive_of(file.parent)) is not None:
                take_map(_name(file), archive, read_archive, maps, report)
        return by_file_source(
            f"argoverse2-forecasting-{path.resolve().name}",
            maps,
            [RecordingFiles(_name(file), (file,), path, _name(file)) for file in files],
            {**taxonomy("argoverse2"), **options.class_map},
            _read_scenario,
            frames=_STEPS * len(files),
            object_bytes=40,
            facts={"time": "steps of 0.1 s from 0", "sizes": "none in the source"},
        )


def _name(file: Path) -> str:
    return file.stem.removeprefix("scenario_")


def _read_scenario(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    file = place.files[0]
    known = load_specification("argoverse2-forecasting")
    known.count_files((each.name for each in file.parent.iterdir()), report)
    rows = read_parquet(file, _COLUMNS, _OPTIONAL, count=known.column_counter(_TABLE, report))
    steps: dict[int, list[LabelObject]] = {}
    for number in range(len(rows["track_id"])):
        try:
            row = {key: values[number] for key, values in rows.items()}
            if row["timestep"] is None:
                raise InvalidError("`timestep` is missing")
            steps.setdefault(row["timestep"], []).append(_object(row, classes, report))
        except InvalidError as error:
            report.leave_out("object", "record-invalid", f"{file.name}:{number + 1}: {error}")
    if not steps:
        raise DataError(Diagnostic("file-invalid", f"{file} has no sound row"))
    params: dict[str, str | float | bool] = {"location": city} if (city := _only(rows, "city")) else {}
    made: list[tuple[Label, str]] = []
    for step in sorted(steps):
        ego = next((member for member in steps[step] if member.id == "ego"), None)
        if ego is None:
            report.leave_out("label", "record-invalid", f"{file.name}: step {step} has no track `{_EGO_TRACK}`")
            continue
        others = tuple(member for member in steps[step] if member is not ego)
        made.append(
            (Label(f"{place.name}/{step}", place.name, step * _STEP_US, place.map, ego, others, params), file.name)
        )
    return made


def _only(rows: Mapping[str, list[Any]], key: str) -> str:
    return next((str(value) for value in rows.get(key, ()) if value), "")


def _object(row: Mapping[str, Any], classes: ClassNames, report: Report) -> LabelObject:
    track, kind = row["track_id"], row["object_type"]
    if not track or not kind:
        raise InvalidError("`track_id` or `object_type` is missing")
    if any(row[name] is None or not abs(row[name]) < 1e7 for name in _REALS):
        raise InvalidError(f"track `{track}` has a value that is missing or not finite")
    is_ego = track == _EGO_TRACK
    return LabelObject(
        id="ego" if is_ego else track,
        category="Car" if is_ego else classes.category(kind),
        source_class="AV" if is_ego else kind,
        x=row["position_x"],
        y=row["position_y"],
        heading=heading_of_yaw(math.remainder(radians(row["heading"], report), 2 * math.pi)),
        velocity=(row["velocity_x"], row["velocity_y"]),
        track=track,
    )
