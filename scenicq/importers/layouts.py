"""Where the files of each format lie: what tells formats apart, without loading what reads them.

Each function gives what it finds, nothing for a source of another format; a folder may be one that holds sources.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from scenicq.importers import fields
from scenicq.importers.fields import InvalidError
from scenicq.importers.folders import first_files, read_bytes

__all__ = [
    "ARGOVERSE2_FILES",
    "INTERACTION_PARTS",
    "argoverse2_logs",
    "argoverse2_scenarios",
    "commonroad_files",
    "interaction_files",
    "is_interchange",
    "is_nuscenes",
    "kitti_files",
    "nuscenes_folders",
    "openlabel_files",
    "waymo_files",
]

ARGOVERSE2_FILES = ("annotations.feather", "city_SE3_egovehicle.feather")
"""What every log of Argoverse 2 has: the boxes, and the poses of the ego."""

INTERACTION_PARTS = ("train", "val", "obs")
"""The ends of names of files in which INTERACTION has all cases of a scene."""

_HEAD = 4096


def argoverse2_logs(path: Path) -> list[Path]:
    """Folders of logs at or up to three levels below a path, such as `sensor/val/LOG`, by name."""
    if _is_log(path):
        return [path]
    for above in ("*", "*/*", "sensor/*/*"):
        pattern = f"{above}/{ARGOVERSE2_FILES[0]}"
        if found := [file.parent for file in path.glob(pattern) if _is_log(file.parent)]:
            return sorted(found, key=lambda folder: (folder.name, folder))
    return []


def argoverse2_scenarios(path: Path) -> list[Path]:
    """Files of the motion forecasting dataset of Argoverse 2."""
    return first_files(path, "scenario_*.parquet", "*/scenario_*.parquet", "*/*/scenario_*.parquet")


def commonroad_files(path: Path) -> list[Path]:
    """XML files that are CommonRoad's."""
    found = [path] if path.suffix == ".xml" else sorted(path.glob("*.xml"))
    return [file for file in found if file.is_file() and _root_name(file) == "commonRoad"]


def interaction_files(path: Path) -> list[Path]:
    """Tracks of INTERACTION."""
    name = "vehicle_tracks_*.csv"
    if found := first_files(path, name, f"*/{name}", f"recorded_trackfiles/*/{name}"):
        return found
    # The challenge of version 1.2 has all cases of a scene in one file.
    patterns = [f"{above}*_{part}.csv" for above in ("", "*/") for part in INTERACTION_PARTS]
    found = {file for pattern in patterns for file in first_files(path, pattern)}
    return sorted(file for file in found if b"case_id,track_id,frame_id" in _head(file))


def is_interchange(path: Path) -> bool:
    """Whether `dataset.json` has the key `interchange`."""
    try:
        return "interchange" in fields.record(fields.parse_json(read_bytes(path / "dataset.json")), "it")
    except (OSError, InvalidError):
        return False


def is_nuscenes(path: Path) -> bool:
    """Whether the path is a folder of tables of nuScenes, or has exactly one."""
    return len(nuscenes_folders(path)) == 1


def nuscenes_folders(path: Path) -> list[Path]:
    """Folders with tables of nuScenes."""
    folders = [path] if path.name.startswith("v1.0-") else sorted(path.glob("v1.0-*"))
    return [f for f in folders if (f / "scene.json").is_file() or (f / "sample_annotation.json").is_file()]


def kitti_files(path: Path) -> list[Path]:
    """Labels of KITTI tracking."""
    for folder in (path, path / "training"):
        if found := sorted(file for file in folder.glob("label_02/*.txt") if file.is_file()):
            return found
    return []


def openlabel_files(path: Path) -> list[Path]:
    """JSON files that begin with OpenLABEL's key."""
    found = [path] if path.suffix == ".json" else sorted(path.glob("*.json"))
    return [file for file in found if file.is_file() and b'"openlabel"' in _head(file)]


def waymo_files(path: Path) -> list[Path]:
    """Files of the Waymo Open Motion Dataset."""
    if path.is_file():
        return [path] if ".tfrecord" in path.name else []
    return sorted(file for file in path.glob("*.tfrecord*") if file.is_file())


def _is_log(path: Path) -> bool:
    return all((path / name).is_file() for name in ARGOVERSE2_FILES)


def _head(file: Path) -> bytes:
    """How a file begins; nothing where it cannot be read."""
    try:
        with file.open("rb") as content:
            return content.read(_HEAD)
    except OSError:
        return b""


def _root_name(file: Path) -> str:
    """The name of the root element of XML, as far as the beginning of a file tells; "" if it cannot be told."""
    found: list[str] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        found.append(name)

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    with suppress(expat.ExpatError, ValueError, LookupError):
        parser.Parse(_head(file), False)
    return found[0] if found else ""
