"""Maps that are no dataset's: given by the user, or named by a program.

A query uses the dataset's maps, on which the labels lie, whatever map the program names. Where there is no dataset, the
map that the program names is used.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from scenicq.compiler.named_map import NamedMap, named_map
from scenicq.errors import DataError, Diagnostic, ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network
from scenicq.store.dataset import Dataset

__all__ = ["about_dataset", "map_remark", "program_network", "program_remarks", "read_network"]

_SUFFIXES = (".xodr", ".geojson", ".json")
_HINT = "`--map FILE` gives a map to use instead"


def read_network(file: Path, cache: Path) -> Network:
    """The road network of a GeoJSON or OpenDRIVE map, called like the file.

    Args:
        file: The map.
        cache: Folder that keeps what Scenic's parser makes of OpenDRIVE maps.

    Raises:
        DataError: The map cannot be read; see `scenicq.importers.opendrive.convert_xodr`.
    """
    from scenicq.importers.base import read_maps  # noqa: PLC0415 - these take long to load
    from scenicq.importers.opendrive import convert_maps  # noqa: PLC0415
    from scenicq.importers.report import Report  # noqa: PLC0415

    report = Report()
    files = convert_maps({file.stem: file}, cache, report)
    return Network(file.stem, read_maps(files, report)[file.stem])


def program_network(source: Source, folder: Path, version: int | None, cache: Path) -> Network | None:
    """The road network of the map that a program names; None where it names none.

    Args:
        source: The program.
        folder: Of the program; nothing outside of it is read.
        version: Of Scenic; inferred if None.
        cache: See `read_network`.

    Raises:
        ScenarioError: The text is not Scenic.
        DataError: The map is not there, lies outside of the folder, or cannot be read.
    """
    named = named_map(source, version)
    if named is None:
        return None
    try:
        return read_network(_inside(named, folder), cache)
    except DataError as error:
        told = [
            each if each.span else replace(each, span=named.span, label="named here", hints=(*each.hints, _HINT))
            for each in error.diagnostics
        ]
        raise DataError(told) from error


def _inside(named: NamedMap, folder: Path) -> Path:
    try:
        file = (folder / named.file).resolve()
        there = file.is_file()
    except (OSError, ValueError):
        file, there = folder, False
    if there and not file.is_relative_to(folder.resolve()):
        message = f"the map `{named.file}` lies outside of the program's folder, and nothing else is read"
        raise DataError(Diagnostic("file-missing", message))
    if not there:
        raise DataError(Diagnostic("file-missing", f"the map `{named.file}` is not there"))
    if file.suffix.lower() not in _SUFFIXES:
        message = f"the map `{named.file}` is neither OpenDRIVE nor GeoJSON: it ends in none of {', '.join(_SUFFIXES)}"
        raise DataError(Diagnostic("file-invalid", message))
    return file


def about_dataset(error: ScenarioError, dataset: Dataset, map_name: str) -> ScenarioError:
    """The error with the dataset in it, where a map lacks what the program needs; any other as it is."""
    absent = not dataset.features(map_name)
    told: list[Diagnostic] = []
    for each in error.diagnostics:
        if each.code != "map-lacks":
            told.append(each)
        elif absent:
            # Sources without any map name none.
            map_, option = ("map", "FILE") if map_name == "none" else (f"map `{map_name}`", f"{map_name}=FILE")
            message = f"dataset {dataset.name} has no {map_}, and the program needs one"
            hint = f"`scenicq ingest SOURCE DATASET --map {option}` makes a dataset with a map"
            free = "`in everywhere, facing Range(0, 360) deg` places what needs no map"
            hints = (hint, *each.hints) if each.notes else (hint, free)
            told.append(replace(each, message=message, label=each.label if each.notes else "needs a map", hints=hints))
        else:
            where = f"dataset {dataset.name}" if map_name in each.message else f"map `{map_name}` of {dataset.name}"
            told.append(replace(each, message=f"{each.message} ({where})"))
    return ScenarioError(told)


def map_remark(source: Source, version: int | None, dataset: Dataset) -> Diagnostic | None:
    """A warning where a program names a map that the dataset does not have; None where all is well."""
    named = named_map(source, version)
    if named is None:
        return None
    # A program may be written on another system than the one where it is read.
    file = named.file.replace("\\", "/").rpartition("/")[2]
    if file.rpartition(".")[0] in dataset.maps or file in dataset.maps:
        return None
    maps = ", ".join(f"`{name}`" for name in dataset.maps) or "none"
    message = f"the program names the map `{file}`; {dataset.name} has its own, and they are used: {maps}"
    hint = f"`scenicq ingest SOURCE DATASET --map NAME={file}` makes a dataset with that map"
    return Diagnostic("map-lacks", message, named.span, hints=(hint,), severity="warning")


def program_remarks(scenario: Scenario) -> list[Diagnostic]:
    """What the author should know: parts that say nothing about whether a label matches.

    Args:
        scenario: The scenario.
    """
    soft = [
        Diagnostic(
            "soft-requirement",
            "this requirement excludes nothing",
            span,
            "holds only with a probability",
            hints=("a scene that breaks it is still possible: write `require` for a condition that must hold",),
            severity="warning",
        )
        for span in (requirement.span for requirement in scenario.soft)
    ]
    return [*scenario.warnings, *scenario.ignored, *soft]
