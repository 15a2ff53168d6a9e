"""OpenDRIVE maps (`.xodr`) through Scenic's own parser, which the extra `scenicq[opendrive]` installs.

The parser runs in a child process on a copy of the map, so that neither its caches nor its faults reach the user: it
reads no crossings and drops lanes of many types, which is told, and fails on some maps. What it gives is kept by the
map's content in a folder of the caller's.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from xml.etree.ElementTree import Element

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.importers.xml_tree import read_xml
from scenicq.store.atomic_files import whole_file, write_whole

__all__ = ["SUFFIX", "convert_maps", "convert_xodr", "kept_files"]

SUFFIX = ".xodr"
_WORKER = Path(__file__).with_name("opendrive_worker.py")
_TIMEOUT_S = 600.0
_LARGEST_BYTES = 256 << 20
_MISSING, _FAILED = 3, 4
_SIDES = ("left", "right")
_FOR_VEHICLES = frozenset(
    {"HOV", "bus", "taxi", "bidirectional", "mwyEntry", "mwyExit", "slipLane", "shared", "roadWorks"}
)
_INSTALL = "`pip install 'scenicq[opendrive]'` installs Scenic, whose parser reads OpenDRIVE"


def convert_maps(files: Mapping[str, Path], cache: Path, report: Report) -> dict[str, Path]:
    """The files with GeoJSON in place of each OpenDRIVE map.

    Args:
        files: File of each map.
        cache: Folder for what the parser gives.
        report: Takes what the parser is known not to read.

    Raises:
        DataError: See `convert_xodr`.
    """
    found: dict[str, Path] = {}
    for name, file in files.items():
        found[name] = file
        if file.suffix.lower() == SUFFIX:
            found[name] = convert_xodr(file, cache)
            _tell_left_out(file, report)
    return found


def _tell_left_out(file: Path, report: Report) -> None:
    """Count what the map has and Scenic's parser does not read; crossings and lanes are told."""
    root = read_xml(file)
    for lost in _dangling(root):
        report.keep("map element", "map-invalid", f"{file.name}: {lost}")
    known = load_specification("opendrive")
    known.count_xml(root, report)
    if any(each.get("type") == "crosswalk" for each in root.iter("object")):
        message = f"{file.name}: Scenic's parser reads no crossings; the map has some"
        report.leave_out("map element", "map-lacks", message)
    lanes = Counter(
        lane.get("type") or "" for side in _SIDES for lanes in root.iter(side) for lane in lanes.iter("lane")
    )
    for kind, count in sorted(lanes.items()):
        if not known.count(f"lane/@type/{kind}", report, count) and kind in _FOR_VEHICLES:
            message = f"{file.name}: Scenic's parser takes lanes of the type `{kind}` for no road; the map has {count}"
            report.leave_out("map element", "map-lacks", message)
    both = sum(lane.get("direction") == "both" for lane in root.iter("lane"))
    report.count_unread('lane/@direction="both"', both)


def convert_xodr(path: Path, cache: Path, *, python: str = sys.executable, timeout_s: float = _TIMEOUT_S) -> Path:
    """The map as interchange GeoJSON.

    Args:
        path: The `.xodr` file; nothing is written beside it.
        cache: Folder that keeps results; made where it is not there.
        python: The Python that has Scenic.
        timeout_s: Seconds for Scenic's parser.

    Raises:
        DataError: `file-missing`; `file-invalid` where Scenic's parser gives up; `option-invalid` where Scenic is not
            installed; `target-unwritable` for the cache.
    """
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise DataError(Diagnostic("file-invalid", f"map {path} is too large"))
        content = path.read_bytes()
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"map {path} cannot be read: {error.strerror}")) from error
    kept, digest = kept_files(content, cache)
    if _is_whole(kept, digest):
        return kept
    try:
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="scenicq-") as folder:
            copy, made = Path(folder) / "map.xodr", Path(folder) / "map.geojson"
            copy.write_bytes(content)
            _run(path, [python, "-I", str(_WORKER), str(copy), str(made)], Path(folder), timeout_s)
            if not made.is_file():
                raise DataError(Diagnostic("file-invalid", f"map {path}: Scenic's parser gave nothing"))
            with made.open("rb") as result, whole_file(kept) as file:
                shutil.copyfileobj(result, file)
            write_whole(digest, _digest(kept))
    except OSError as error:
        message = f"the map cache {cache} cannot be written: {error.strerror or error}"
        raise DataError(Diagnostic("target-unwritable", message)) from error
    return kept


def _dangling(root: Element) -> Iterator[str]:
    """References to roads and junctions that are not there."""
    roads = {road.get("id") for road in root.iter("road")}
    junctions = {junction.get("id") for junction in root.iter("junction")}
    for junction in root.iter("junction"):
        for connection in junction.iter("connection"):
            for key in ("incomingRoad", "connectingRoad"):
                if (name := connection.get(key)) not in roads:
                    yield f"junction `{junction.get('id')}`: there is no {key} `{name}`"
    for road in root.iter("road"):
        for way in ("predecessor", "successor"):
            link = road.find(f"link/{way}")
            if link is not None:
                name, kind = link.get("elementId"), link.get("elementType")
                if name not in (junctions if kind == "junction" else roads):
                    yield f"road `{road.get('id')}`: its {way} is {kind} `{name}`, which is not there"


def kept_files(content: bytes, cache: Path) -> tuple[Path, Path]:
    """Where a cache keeps what the parser gives for a map, and that file's SHA-256 as text."""
    worker = hashlib.sha256(_WORKER.read_bytes()).digest()
    key = hashlib.sha256(worker + content).hexdigest()
    return cache / f"{key}.geojson", cache / f"{key}.sha256"


def _is_whole(kept: Path, digest: Path) -> bool:
    """Whether a file of the cache is as it was written; one that is not is made anew."""
    try:
        return digest.read_text(encoding="utf-8") == _digest(kept)
    except (OSError, UnicodeDecodeError):
        return False


def _digest(file: Path) -> str:
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _run(path: Path, command: list[str], folder: Path, timeout_s: float) -> None:
    try:
        done = subprocess.run(  # noqa: S603 - our own script on our own copy
            command, cwd=folder, capture_output=True, timeout=timeout_s, check=False, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired as error:
        message = f"map {path}: Scenic's parser takes longer than {timeout_s:g} s"
        raise DataError(Diagnostic("file-invalid", message)) from error
    if done.returncode == _MISSING:
        message = f"map {path} is OpenDRIVE, and Scenic is not installed"
        raise DataError(Diagnostic("option-invalid", message, hints=(_INSTALL,)))
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        why = lines[-1][:500] if done.returncode == _FAILED and lines else f"it ended with code {done.returncode}"
        with suppress(DataError):  # it need not be XML
            why = "; ".join([why, *list(_dangling(read_xml(path)))[:3]])
        hint = "Scenic 3.1.1 fails on some maps; a GeoJSON map can be given in its place"
        raise DataError(Diagnostic("file-invalid", f"map {path}: Scenic's parser cannot read it: {why}", hints=(hint,)))
