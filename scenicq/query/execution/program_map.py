"""The map of a program: read where there is no dataset, and what the author is told about it where there is one.

A query uses the dataset's maps, on which the labels lie, whatever map the program names; then the remarks here say that
the program's map is not used, or what the dataset's maps lack. Without a dataset, the map is the one that the user
gives or that the program names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from scenicq.compiler.named_map import NamedMap, named_map
from scenicq.errors import DataError, Diagnostic, ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network
from scenicq.store.dataset import Dataset
from scenicq.store.manifest import Manifest

__all__ = [
    "about_dataset",
    "is_about_map",
    "map_remark",
    "misfit_remarks",
    "program_network",
    "program_remarks",
    "read_network",
]

_NAMED_MAPS = 4
"""Maps that one warning names."""
_SUFFIXES = (".xodr", ".geojson", ".json")
_HINT = "`--map FILE` gives a map to use instead"


def read_network(file: Path, cache: Path) -> Network:
    """Read the road network of a GeoJSON or OpenDRIVE map, which is called like the file.

    Args:
        file: The map.
        cache: Folder that keeps OpenDRIVE maps as Scenic's parser has converted them.

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
    """Read the road network of the map that a program names; None where it names none.

    Args:
        source: The program.
        folder: Folder of the program; nothing outside of it is read.
        version: Version of Scenic; inferred if None.
        cache: See `read_network`.

    Raises:
        ScenarioError: The text is not Scenic.
        DataError: The map is not there, lies outside of the folder, or cannot be read.
    """
    named = named_map(source, version)
    if named is None:
        return None
    try:
        return read_network(_find_map_file(named, folder), cache)
    except DataError as error:
        told = [
            each if each.span else replace(each, span=named.span, label="named here", hints=(*each.hints, _HINT))
            for each in error.diagnostics
        ]
        raise DataError(told) from error


def _find_map_file(named: NamedMap, folder: Path) -> Path:
    """The file of a map that a program names; it must lie in the program's folder, and be a map by its name."""
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


def is_about_map(error: ScenarioError) -> bool:
    """Whether an error may be due to the map alone, so that the program may be sound on another map.

    On a map without some elements, lists of these are empty, and requirements on them fail.
    """
    return {each.code for each in error.diagnostics} <= _OF_MAPS


_OF_MAPS = frozenset({"map-lacks", "runtime-error", "impossible-requirement"})


def about_dataset(error: ScenarioError, dataset: Dataset, map_name: str) -> ScenarioError:
    """Name the dataset in an error that says that its map lacks something; other errors stay as they are."""
    absent = not dataset.network(map_name).kinds
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


def misfit_remarks(lacking: Mapping[str, Diagnostic], manifest: Manifest) -> Iterator[Diagnostic]:
    """Warn of maps on which no frame can match; one warning for maps that lack the same.

    Args:
        lacking: What each map lacks, by its name.
        manifest: Manifest of the dataset; maps without frames are passed over.
    """
    frames = {name: counts.frames for name, counts in manifest.by_map.items()}
    grouped: dict[str, list[str]] = {}
    for name, told in lacking.items():
        if frames.get(name):
            grouped.setdefault(told.message.replace(f"`{name}`", ""), []).append(name)
    for alike in grouped.values():
        count = sum(frames[name] for name in alike)
        shown = ", ".join(f"`{name}`" for name in alike[:_NAMED_MAPS])
        told = lacking[alike[0]]
        message = (
            f"{count} frames on map {shown} cannot match: {told.message}"
            if len(alike) == 1
            else f"{count} frames on {len(alike)} maps ({shown}{', ...' if len(alike) > _NAMED_MAPS else ''}) "
            f"cannot match; on `{alike[0]}`: {told.message}"
        )
        yield replace(told, code="map-lacks", message=message, severity="warning")


def map_remark(source: Source, version: int | None, dataset: Dataset) -> Diagnostic | None:
    """Warn that a program names a map which the dataset does not have; None if it has it or none is named."""
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
    """Warn of the parts of a program that make no difference to whether a label matches.

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
