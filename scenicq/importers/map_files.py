"""Maps of a source as features: read from GeoJSON, and kept as far as a dataset can hold them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from scenicq.geometry.features import (
    KNOWN_KINDS,
    LINES,
    REFERENCES,
    MapFeature,
    ProblemSink,
    dangling,
    farthest,
    load_geojson,
    names,
    read_geojson,
    region_name,
)
from scenicq.importers.fields import InvalidError, check_characters
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.store.map_validation import properties_problem
from scenicq.store.value_rules import LONGEST_NAME, json_object
from scenicq.store.wkb import FARTHEST_M

__all__ = ["on_the_map", "read_geojson_maps"]


def on_the_map(maps: Mapping[str, Sequence[MapFeature]], report: Report) -> dict[str, tuple[MapFeature, ...]]:
    """The elements of maps that are at a place where maps can be.

    Args:
        maps: The maps of a source.
        report: Takes what is left out.
    """
    kept: dict[str, tuple[MapFeature, ...]] = {}
    for name, features in maps.items():
        unsound = {feature.id: problem for feature in features if (problem := _element_problem(feature))}
        for each in sorted(unsound):
            message = f"map `{name}`: element `{each}` {unsound[each]}"
            report.leave_out("map element", "map-invalid", message)
        kept[name] = tuple(feature for feature in features if feature.id not in unsound)
        if not features:
            message = f"map `{name}` has no elements; its labels are kept without a road network"
            report.assume("map", "no elements", message)
        for kind, count in Counter(feature.kind for feature in kept[name]).items():
            if kind not in KNOWN_KINDS and region_name(kind) is None:
                report.count_unread(f"map elements of the kind `{kind}`, which no program can name", count)
    return kept


def _element_problem(feature: MapFeature) -> str | None:
    """What an element of a map has that no dataset may have."""
    if not farthest(feature) <= FARTHEST_M:
        return "is at no place on a map"
    # the centreline is numbers by now, and most of what there is
    properties = {key: value for key, value in feature.properties.items() if key != "centerline"}
    if problem := properties_problem(feature.kind, json_object(json.dumps(properties))):
        return f"has unsound properties: {problem}"
    texts = [feature.id, feature.kind]
    for key in REFERENCES.get(feature.kind, {}):
        texts += names(feature, key) if key in feature.properties else ()
    return f"has a name of more than {LONGEST_NAME} characters" if max(map(len, texts)) > LONGEST_NAME else None


def read_geojson_maps(files: Mapping[str, Path], report: Report) -> dict[str, tuple[MapFeature, ...]]:
    """Read GeoJSON maps.

    Args:
        files: File of each map.
        report: Takes what is unsound.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    maps: dict[str, tuple[MapFeature, ...]] = {}
    for name in sorted(files):
        problems: list[tuple[str, str]] = []
        document = load_geojson(files[name])
        features = read_geojson(document, _collector(problems), name=str(files[name]))
        load_specification("geojson").count_json(document, report)
        references = set(dangling(features)) if problems else set[tuple[str, str]]()
        for problem in problems:
            message = f"{files[name].name}: element `{problem[0]}`: {problem[1]}"
            tell = report.keep if problem in references else report.leave_out
            tell("map element", "map-invalid", message)
        if not _storable(features):
            features = tuple(_storable_of(features, files[name].name, report))
        maps[name] = features
    return maps


def _collector(problems: list[tuple[str, str]]) -> ProblemSink:
    return lambda id, problem: problems.append((id, problem))


def _storable(features: Sequence[MapFeature]) -> bool:
    try:
        check_characters([_texts(feature) for feature in features])
    except InvalidError:
        return False
    return True


def _storable_of(features: Sequence[MapFeature], file: str, report: Report) -> Iterator[MapFeature]:
    """Keep the elements whose texts can be stored, and report the others."""
    for feature in features:
        try:
            check_characters(_texts(feature))
        except InvalidError as error:
            report.leave_out("map element", "map-invalid", f"{file}: element {feature.id!a}: {error}")
        else:
            yield feature


def _texts(feature: MapFeature) -> list[object]:
    # lines are numbers by now, and most of what there is
    properties = {key: value for key, value in feature.properties.items() if key not in LINES}
    return [feature.id, feature.kind, properties]
