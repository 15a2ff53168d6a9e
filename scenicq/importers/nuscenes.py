"""nuScenes in its official layout: `v1.0-*/*.json`, with `maps/expansion/*.json` where it is there.

Conventions of the source: metres in one frame a city; quaternions w, x, y, z; sizes are width, length, height; the pose
of the ego is that of the middle of its rear axle. The ego's box and velocities are not in the tables: see `facts`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.base import ImportOptions, OpenedSource, RecordingEntry, read_maps
from scenicq.importers.folders import readable
from scenicq.importers.layouts import is_nuscenes, nuscenes_folders
from scenicq.importers.nuscenes_scenes import AXLE_TO_CENTRE_M, EGO_SIZE_M, LONGEST_STEP_US, POSE_CHANNEL, SceneReader
from scenicq.importers.nuscenes_tables import Tables
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.store.classes import taxonomy

if TYPE_CHECKING:
    from scenicq.geometry.features import MapFeature

__all__ = ["NuScenes"]

_TABLES = "scene sample sample_annotation instance category attribute sample_data ego_pose calibrated_sensor sensor log"

_LEFT_HAND = "singapore-"
"""How the locations begin where traffic keeps to the left."""


class NuScenes:
    """Importer of nuScenes."""

    name = "nuscenes"
    layout = "a folder `v1.0-*` with `scene.json` and `sample_annotation.json`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is a folder of tables, or has exactly one."""
        return is_nuscenes(path)

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open a dataroot or one of its `v1.0-*` folders.

        All tables are read here; memory grows with the source, about 200 bytes an annotation.

        Raises:
            DataError: `file-missing` or `file-invalid`; with a strict report whatever is unsound.
        """
        folders = nuscenes_folders(path)
        if len(folders) != 1:
            message = f"{path} has {len(folders)} folders `v1.0-*` with tables, not one"
            hints = tuple(f"give {folder}" for folder in folders)
            raise DataError(Diagnostic("dataset-ambiguous" if folders else "file-missing", message, hints=hints))
        folder = folders[0]
        missing = [name for name in _TABLES.split() if not (folder / f"{name}.json").is_file()]
        if missing:
            raise DataError([Diagnostic("file-missing", f"{folder / name}.json is not there") for name in missing])
        load_specification("nuscenes").count_files(_files(path, folder), report)
        tables = Tables(folder, report)
        maps = _maps(folder.parent, tables.locations, options, report)
        classes = {**taxonomy("nuscenes"), **options.class_map}
        scenes = sorted(((tables.scene(token) for token in tables.scenes)), key=lambda scene: scene.name)
        by_name = {scene.name: scene for scene in scenes}
        return OpenedSource(
            name=readable(f"nuscenes-{folder.name}"),
            maps=maps,
            entries=tuple(RecordingEntry(scene.name, scene.weight, scene.digest()) for scene in scenes),
            reader=lambda names: SceneReader(tuple(by_name[name] for name in names), classes),
            frames=len(tables.samples),
            context=json.dumps(sorted(classes.items())),
            facts={
                "ego_size_m": dict(zip(("width", "length", "height"), EGO_SIZE_M, strict=True)),
                "ego_centre_ahead_of_rear_axle_m": AXLE_TO_CENTRE_M,
                "ego_pose": f"of the {POSE_CHANNEL} key frame, else of the one nearest in time",
                "time": "minutes since local midnight, where the name of the log has the time zone",
                "velocity": f"central differences over steps of at most {LONGEST_STEP_US / 1e6} s",
            },
        )


def _files(path: Path, folder: Path) -> Iterator[str]:
    """Tables, and what is beside their folder, where that is part of the source."""
    yield from (each.name for each in folder.iterdir())
    if path.resolve() != folder.resolve():
        maps = path / "maps"
        yield from (f"maps/{each.name}" for each in (maps.iterdir() if maps.is_dir() else ()))
        yield from (each.name for each in path.iterdir() if each != maps and not each.name.startswith("v1.0-"))


def _maps(
    dataroot: Path, locations: list[str], options: ImportOptions, report: Report
) -> dict[str, tuple[MapFeature, ...]]:
    maps = read_maps(options.maps, report)
    for location in locations:
        expansion = dataroot / "maps" / "expansion" / f"{location}.json"
        if location in maps or Path(location).name != location or not expansion.is_file():
            continue
        from scenicq.importers.nuscenes_map import read_expansion  # noqa: PLC0415 - slow to load, and for maps

        def tell(element: str, problem: str, file: str = expansion.name) -> None:
            report.leave_out("map element", "map-invalid", f"{file}: element `{element}`: {problem}")

        maps[location] = read_expansion(expansion, tell, report, left_hand=location.startswith(_LEFT_HAND))
    return maps
