"""Maps of a dataset looked at as data: shapes that a geometry library can take, and properties that can be read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import shapely

from scenicq.geometry.features import LINES, REFERENCES
from scenicq.store.schema import ArrowTable
from scenicq.store.validation import invalid
from scenicq.store.value_rules import json_object
from scenicq.store.wkb import FARTHEST_M, wkb_problem

__all__ = ["check_lanes", "check_regions", "properties_problem"]

_DEEPEST = 64
"""Nested lists and objects of properties."""


def check_regions(rows: ArrowTable, file: str, counts: Mapping[str, int]) -> None:
    """Check the elements of all maps.

    Args:
        rows: The table `regions`, whose columns are sound by themselves.
        file: What its file is called.
        counts: Elements of each map, by the manifest.

    Raises:
        DataError: dataset-invalid.
    """
    columns = (rows[name].to_pylist() for name in ("map", "id", "kind", "geometry", "properties"))
    found: dict[str, set[str]] = {}
    before = None
    for row, (name, key, kind, geometry, text) in enumerate(zip(*columns, strict=True)):
        if name != before and name in found:
            invalid(file, "the elements of a map are not together", row, "map")
        before = name
        if not kind or not key or key in found.setdefault(name, set()):
            invalid(file, "is empty, or occurs twice in the map", row, "id" if kind else "kind")
        found[name].add(key)
        if (problem := wkb_problem(geometry, lines=kind == "curb")) is not None:
            invalid(file, problem, row, "geometry")
        if (problem := properties_problem(kind, json_object(text))) is not None:
            invalid(file, problem, row, "properties")
    told = {name: len(keys) for name, keys in found.items()}
    if told != {name: count for name, count in counts.items() if count}:
        invalid(file, "has other maps or elements than the manifest says")
    shapes = np.asarray(shapely.from_wkb(rows["geometry"].to_pylist()), dtype=object)
    unsound = ~shapely.is_valid(shapes) | shapely.is_empty(shapes)
    if unsound.any():
        invalid(file, "is no valid shape", int(np.argmax(unsound)), "geometry")


def check_lanes(rows: ArrowTable, file: str) -> None:
    """Check the lanes of all maps.

    Raises:
        DataError: dataset-invalid.
    """
    for row, line in enumerate(rows["centerline"].to_pylist()):
        if line is not None and (problem := wkb_problem(line, lines=True)) is not None:
            invalid(file, problem, row, "centerline")


def properties_problem(kind: str, properties: Mapping[str, Any] | None) -> str | None:
    """What is wrong with the properties of an element of a map; None where nothing is.

    Args:
        kind: The element's kind.
        properties: What `json_object` makes of their text.
    """
    if properties is None:
        return "is no JSON object of finite numbers"
    for key in REFERENCES.get(kind, {}):
        if not _is_reference(properties.get(key)):
            return f"`{key}` is neither an id nor a list of ids"
    for key in LINES:
        if not _is_lines(properties.get(key) or []):
            return f"`{key}` is no list of lines on a map"
    return "is nested too deeply" if _is_deep(properties) else None


def _is_reference(value: Any) -> bool:
    if isinstance(value, list):
        return all(isinstance(item, str) for item in cast("list[Any]", value))
    return value is None or isinstance(value, str)


def _is_lines(value: Any) -> bool:
    """Whether a value is a list of lists of at least two places."""
    if not isinstance(value, list):
        return False
    lines = cast("list[Any]", value)
    if not all(isinstance(line, list) and len(cast("list[Any]", line)) > 1 for line in lines):
        return False
    places = [place for line in lines for place in line]
    if not all(isinstance(place, list) and len(cast("list[Any]", place)) >= 2 for place in places):
        return False
    numbers = [number for place in places for number in place]
    return all(type(number) in (int, float) and abs(number) <= FARTHEST_M for number in numbers)


def _is_deep(value: Any) -> bool:
    level = [value]
    for _ in range(_DEEPEST):
        inner: list[Any] = []
        for each in level:
            if isinstance(each, dict):
                inner += cast("dict[str, Any]", each).values()
            elif isinstance(each, list):
                inner += cast("list[Any]", each)
        level = inner
    return bool(level)
