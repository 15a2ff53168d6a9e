"""What the lists of specifications say of each field is so: read, left out and counted, or meaningless.

The oracle takes one field after the other out of a source that has them all, and looks at what comes in.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from full_sources import FORMATS, LISTS, Document, drop, entries, full, parents
from label_rows import labels_of

from scenicq.errors import DataError, Diagnostic
from scenicq.importers import opendrive, opendrive_worker
from scenicq.importers.base import ImportOptions
from scenicq.importers.registry import importers
from scenicq.importers.report import Report

INSTEAD = {"crs": {"properties": {"name": "EPSG:4326"}}, "junction/connection/@type": "virtual"}
"""What tells something only by its value."""

UNASKED = {
    "interchange": {"labels/ego/yaw", "labels/objects/yaw"},
    "openlabel": {"objects/* of the type DontCare"},
}
"""What is left out because of what another field says."""

CASES = [(format_, name) for format_, source in FORMATS.items() for name in source.lists]


def take_in(format_: str, document: Document, folder: Path) -> tuple[str, str, Mapping[str, int]]:
    """All that comes of a source as text, what is told of it but counts of what is not read, and those."""
    folder /= "s"
    folder.mkdir(parents=True)
    document = copy.deepcopy(document)
    FORMATS[format_].write(document, folder)
    report = Report()
    try:
        maps = opendrive.convert_maps({file.stem: file for file in folder.glob("*.xodr")}, folder, report)
        source = importers()[FORMATS[format_].importer].read(folder, ImportOptions(maps=maps, scratch=folder), report)
        maps = [
            (name, feature, feature.shape.wkt, feature.properties)
            for name in source.maps
            for feature in source.maps[name]
        ]
        recordings = [labels_of(each) for each in source.recordings(report)]
        told = str((maps, recordings, source.name, source.facts))
    except DataError as error:
        told = str(error)
    counts = {entry.name: entry.count for entry in report.counts if entry.code == "not-read"}
    others = [entry for entry in report.counts if entry.code != "not-read"]
    return told.replace(str(folder), ""), str(others).replace(str(folder), ""), counts


@pytest.fixture
def opendrive_parsed_here(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Scenic's parser in this process, which loads it once, or no parser at all."""

    def convert(path: Path, cache: Path) -> Path:
        try:
            network = opendrive_worker.Network.fromFile(str(path), useCache=False, writeCache=False)
        except Exception as error:
            raise DataError(Diagnostic("file-invalid", opendrive_worker.explain(error, str(path)))) from None
        directions = opendrive_worker.Directions(ElementTree.parse(path).getroot())
        return write(opendrive_worker.features_of(network, directions), cache)

    def write(features: list[dict[str, Any]], cache: Path) -> Path:
        made = cache / "town.geojson"
        made.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
        return made

    return lambda parsed: monkeypatch.setattr(
        opendrive, "convert_xodr", convert if parsed else lambda _, cache: write([], cache)
    )


@pytest.mark.parametrize(("format_", "name"), CASES)
def test_what_is_left_out_is_counted_and_nothing_else(
    format_: str, name: str, tmp_path: Path, opendrive_parsed_here: Callable[[bool], None]
) -> None:
    opendrive_parsed_here(False)
    *_, counts = take_in(format_, full(format_), tmp_path / "s")
    listed = {
        path for each in FORMATS[format_].lists for path, fate in entries(each).items() if fate.startswith("left")
    }
    listed |= UNASKED.get(format_, set())
    found = {path.partition("/")[0] if path.startswith("way_of_no_lanelet") else path for path in counts}
    assert found == listed


@pytest.mark.parametrize(
    ("format_", "name"),
    [pytest.param(*case, marks=pytest.mark.slow if case[0] == "opendrive" else ()) for case in CASES],
)
@pytest.mark.one_in(16)
def test_each_field_is_what_the_list_says(
    format_: str, name: str, tmp_path: Path, opendrive_parsed_here: Callable[[bool], None]
) -> None:
    if format_ == "opendrive":
        pytest.importorskip("scenic", reason="Scenic is not installed")
    opendrive_parsed_here(True)
    listed = entries(name)
    document = full(format_)
    *whole, counts = take_in(format_, document, tmp_path / "whole")
    wrong: list[str] = []
    for number, (path, fate) in enumerate(listed.items()):
        below = [at for at in listed if at.startswith(f"{path}/")]
        inner = [listed[at] for at in below if not any(other.startswith(f"{at}/") for other in below)]
        if inner and not any(other.startswith("read") for other in inner):
            continue
        changed = copy.deepcopy(document)
        if path in UNASKED.get(format_, ()):
            changed["interchange"]["dataset.json"]["angle"] = "yaw"
        if path in INSTEAD:
            for owner, key in parents(changed[name], path.split("/")):
                owner[key] = INSTEAD[path]
        elif not drop(changed, name, path):
            wrong.append(f"{path}: is not in the source")
            continue
        *found, left = take_in(format_, changed, tmp_path / str(number))
        # what is left out may be told besides
        same = found[0] == whole[0] if fate.startswith("left") else found == whole
        if fate.startswith("read") == same:
            wrong.append(f"{path}: {fate}, but dropping it changes {'nothing' if same else 'what comes in'}")
        if fate.startswith("left") and path.partition("/")[0] not in getattr(FORMATS[format_], "positional", ()):
            lost = {key for key in counts if key not in left}
            if not any(key == path or key.startswith(f"{path}/") for key in lost):
                wrong.append(f"{path}: it is counted although it is not there")
        if fate.startswith("mean") and left != counts:
            wrong.append(f"{path}: {fate}, but counted: {counts.items() ^ left.items()}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("told", [False, True])
def test_a_scenario_of_waymo_without_an_intersection_is_told(told: bool, tmp_path: Path) -> None:
    document = full("waymo")
    if told:
        drop(document, "waymo", "map_features:8/lane:3/interpolating:3")
    _, others, _ = take_in("waymo", document, tmp_path)
    assert ("no intersections" in others) == told


def test_lanes_of_both_directions_are_counted(tmp_path: Path) -> None:
    document = full("interaction")
    lanelets = document["lanelet2"]["relation"]["lanelet"]
    for each in lanelets[:3]:
        each["tag"] = each["tag"] | {"one_way": "no"}
    lanelets[0]["tag"]["subtype"] = "crosswalk"  # an area has no direction
    *_, counts = take_in("interaction", document, tmp_path)
    assert counts['relation/lanelet/tag/one_way="no": the other direction'] == 2


def test_links_to_lanes_that_are_not_there_are_counted(tmp_path: Path) -> None:
    document = full("nuscenes")
    lane = document["nuscenes-map"]["lane"][0]["token"]
    document["nuscenes-map"]["connectivity"][lane] = {"incoming": ["gone"], "outgoing": ["gone", "far"]}
    *_, counts = take_in("nuscenes", document, tmp_path)
    assert counts["connectivity/*/incoming of lanes that are not there"] == 1
    assert counts["connectivity/*/outgoing of lanes that are not there"] == 2


def page() -> str:
    """The lists as tables: a row for each element, with its fields by what becomes of them."""
    text = PAGE_BEGIN
    for file in sorted(LISTS.glob("*.json")):
        rows: dict[str, dict[str, list[str]]] = {}
        for path, fate in entries(file.stem).items():
            owner, _, name = path.rpartition("/")
            kind, _, note = fate.partition(": ")
            cell = f"`{name}` ({note})" if note else f"`{name}`"
            rows.setdefault(owner, {}).setdefault(kind, []).append(cell.replace("|", "\\|"))
        text += f"\n## {file.stem}\n\n| where | {' | '.join(FATES.values())} |\n|---|---|---|---|\n"
        for owner, cells in rows.items():
            shown = " | ".join(", ".join(cells.get(kind, ())) for kind in FATES)
            text += f"| {f'`{owner}`' if owner else ''} | {shown} |\n"
    return text


FATES = {"read": "read", "left out": "left out and counted", "meaningless": "means nothing here"}
PAGE_BEGIN = """# What is read of each format

Every field and every kind of element that the specification of a format lists, as `specifications/*.json` have it
(`make golden` writes this page from them; `tests/units/importers/test_specifications.py` takes each field out of a
source that has them all, and looks at what comes in). What no list has is counted, too: `scenicq ingest` tells all
counts. A path names the fields from the root down; `*` stands for keys that the source makes up, a number after a colon
is a field's of protocol buffers, `files/` begins names of files and folders.
"""


def test_the_page_shows_the_lists(request: pytest.FixtureRequest) -> None:
    readme = LISTS.parent / "README.md"
    if request.config.getoption("--update-golden"):
        readme.write_text(page(), encoding="utf-8")
    assert readme.read_text(encoding="utf-8") == page(), "`make golden` writes it again"
