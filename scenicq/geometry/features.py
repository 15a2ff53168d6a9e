"""Map features: what a map consists of before it becomes a network, and how the interchange GeoJSON spells them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry import shapes
from scenicq.geometry.shapes import Shape

__all__ = [
    "KNOWN_KINDS",
    "LINES",
    "REFERENCES",
    "MapFeature",
    "ProblemSink",
    "dangling",
    "farthest",
    "load_geojson",
    "names",
    "read_geojson",
    "region_name",
]

ProblemSink = Callable[[str, str], None]
"""Takes the id of a feature ("" if it has none) and what is wrong with it."""

ANY = "element"
"""What stands for a reference to an element of any kind."""
_ENDS = {"predecessor": ANY, "successor": ANY}

REFERENCES: dict[str, dict[str, str]] = {
    "lane": {
        "road": "road",
        "group": "lane_group",
        "left": "lane",
        "right": "lane",
        "predecessors": "lane",
        "successors": "lane",
        **_ENDS,
    },
    "lane_section": {"lane": "lane", "left": "lane_section", "right": "lane_section", **_ENDS},
    "lane_group": {"road": "road", "opposite": "lane_group", "sidewalk": "sidewalk", "shoulder": "shoulder", **_ENDS},
    "road": {"forward": "lane_group", "backward": "lane_group", "intersection": "intersection", **_ENDS},
    "road_section": {"road": "road", "forward": "lane_section", "backward": "lane_section", **_ENDS},
    "intersection": {"roads": "road", "incoming": "lane", "outgoing": "lane"},
    "sidewalk": {"road": "road", **_ENDS},
    "shoulder": {"road": "road", **_ENDS},
    "curb": {"group": "lane_group"},
}
"""Properties that refer to other features: kind -> property -> kind that it refers to."""

KNOWN_KINDS = frozenset({*REFERENCES, "crossing", "drivable"})
"""The kinds of elements that a network has as such."""

_TAKEN = frozenset({"walkableRegion"})
"""Regions of a network that are of no kind."""

LINES = ("centerline", "left_edge", "right_edge")
"""Properties that are lists of polylines."""


@dataclass(frozen=True, slots=True)
class MapFeature:
    """One element of a map.

    Attributes:
        id: Unique in its map.
        kind: `lane`, `lane_section`, `lane_group`, `road`, `road_section`, `intersection`, `crossing`, `sidewalk`,
            `shoulder`, `curb`, `drivable`, or any other, which becomes a region of that name.
        shape: Polygon or MultiPolygon (LineString or MultiLineString for `curb`), in metres of the map frame.
        properties: What else the map says, as the interchange format spells it.
    """

    id: str
    kind: str
    shape: Shape = field(repr=False)
    properties: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False)


def region_name(kind: str) -> str | None:
    """What programs call the region of a kind of elements that Scenic does not know; None where nothing can.

    Args:
        kind: `carpark_area` becomes `carparkAreaRegion`.
    """
    first, *others = re.split(r"[_\s-]+", kind)
    name = f"{first}{''.join(other[:1].upper() + other[1:] for other in others)}Region"
    return name if kind not in KNOWN_KINDS and first and name.isidentifier() and name not in _TAKEN else None


def names(feature: MapFeature, key: str) -> tuple[str, ...]:
    """The identifiers that a property refers to: none, one or a list of them."""
    value = feature.properties.get(key)
    if value is None or value == "":
        return ()
    if isinstance(value, str):
        return (value,)
    return tuple(str(item) for item in cast("Iterable[Any]", value) if item is not None)


def farthest(feature: MapFeature) -> float:
    """The largest coordinate of a feature's shape and lines, without its sign, in metres."""
    lines = [line for key in LINES for line in cast("list[list[list[float]]]", feature.properties.get(key) or [])]
    return max(
        (abs(each) for each in (*feature.shape.bounds, *(x for line in lines for xy in line for x in xy))), default=0.0
    )


def dangling(features: Iterable[MapFeature]) -> list[tuple[str, str]]:
    """References to features that are not there: (id of the feature, message)."""
    features = tuple(features)
    kinds = {feature.id: feature.kind for feature in features}
    found: list[tuple[str, str]] = []
    for feature in features:
        for key, kind in REFERENCES.get(feature.kind, {}).items():
            for name in names(feature, key) if key in feature.properties else ():
                also = (ANY, "lane_section") if kinds.get(name) == "lane" else (ANY,)
                if kinds.get(name) != kind and not (name in kinds and kind in also):
                    what = f"is a {kinds[name]}, not a {kind}" if name in kinds else "is not in the map"
                    found.append((feature.id, f"`{key}` of {feature.kind} `{feature.id}`: `{name}` {what}"))
    return found


def read_geojson(
    source: str | Path | Mapping[str, Any], on_problem: ProblemSink, *, name: str = "the map"
) -> tuple[MapFeature, ...]:
    """Read the map features of an interchange GeoJSON file.

    Args:
        source: The file, or what `json` made of it.
        name: What the map is called in messages, where no file says it.
        on_problem: Called for each unsound feature, which is left out, and for each dangling reference, which is kept.

    Raises:
        DataError: `file-missing` or `file-invalid`: there is no feature collection at all.
    """
    where, document = (name, source) if isinstance(source, Mapping) else (str(source), load_geojson(Path(source)))
    collection = _object(document).get("features")
    if not isinstance(collection, list):
        raise DataError(Diagnostic("file-invalid", f"{where}: not a GeoJSON feature collection"))
    if _is_in_degrees(_object(document).get("crs")):
        message = f"{where}: its `crs` says that its coordinates are degrees; maps are in metres"
        hint = "`ogr2ogr -t_srs EPSG:326ZZ projected.geojson FILE` projects it (ZZ: the UTM zone of the labels)"
        raise DataError(Diagnostic("file-invalid", message, hints=(hint,)))
    found: dict[str, MapFeature] = {}
    entries = cast("list[Any]", collection)
    known = shapes.plain_polygons([_object(entry).get("geometry") for entry in entries])
    for number, entry in enumerate(entries):
        try:
            feature = _feature(entry, known[number])
        except _UnsoundError as unsound:
            on_problem(unsound.id, f"feature {number + 1}: {unsound}")
            continue
        if feature.id in found:
            on_problem(feature.id, f"feature {number + 1}: the id is used before; this feature is left out")
        else:
            found[feature.id] = feature
    features = tuple(found.values())
    for identifier, message in dangling(features):
        on_problem(identifier, message)
    return features


def _is_in_degrees(crs: Any) -> bool:
    """Whether a `crs` names coordinates of the globe."""
    name = str(_object(_object(crs).get("properties")).get("name", "")).upper()
    return name.endswith(("CRS84", "CRS83", ":4326", ":4979", ":4258")) or name in ("WGS84", "WGS 84")


class _UnsoundError(Exception):
    def __init__(self, identifier: str, message: str) -> None:
        super().__init__(message)
        self.id = identifier


def load_geojson(path: Path) -> Mapping[str, Any]:
    """The object of a file; an empty one where it is none.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    try:
        return _object(json.loads(path.read_text(encoding="utf-8-sig")))
    except FileNotFoundError as error:
        raise DataError(Diagnostic("file-missing", f"{path}: no such file")) from error
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(Diagnostic("file-invalid", f"{path}: not readable as JSON ({error})")) from error


def _feature(entry: Any, known: Shape | None) -> MapFeature:
    properties = _object(_object(entry).get("properties"))
    if not properties:
        raise _UnsoundError("", "it has no properties")
    identifier, kind = properties.get("id"), properties.get("kind")
    if not isinstance(identifier, str | int) or isinstance(identifier, bool) or identifier == "":
        raise _UnsoundError("", "it has no id")
    identifier = str(identifier)
    if not isinstance(kind, str) or not kind:
        raise _UnsoundError(identifier, "it has no kind")
    shape = known
    if shape is None or kind == "curb":
        shape = _shape(identifier, kind, _object(entry).get("geometry"))
    rest = {key: value for key, value in properties.items() if key not in ("id", "kind")}
    for key in LINES:
        if key in rest:
            rest[key] = _polylines(identifier, key, rest[key])
    for key in REFERENCES.get(kind, {}):
        if not _is_reference(rest.get(key)):
            raise _UnsoundError(identifier, f"`{key}` is neither an id nor a list of ids")
    return MapFeature(identifier, kind, shape, rest)


def _object(value: Any) -> Mapping[str, Any]:
    """A JSON object, or an empty one in place of anything else."""
    return cast("Mapping[str, Any]", value) if isinstance(value, dict | Mapping) else {}


def _is_reference(value: Any) -> bool:
    if isinstance(value, list):
        return all(isinstance(item, str) for item in cast("list[Any]", value))
    return value is None or isinstance(value, str)


def _shape(identifier: str, kind: str, geometry: Any) -> Shape:
    allowed = ("LineString", "MultiLineString") if kind == "curb" else ("Polygon", "MultiPolygon")
    found = _object(geometry).get("type")
    if found not in allowed:
        raise _UnsoundError(identifier, f"a {kind} is a {' or '.join(allowed)}, this is {found or 'no geometry'}")
    try:
        shape = shapes.from_geojson(cast("dict[str, Any]", geometry))
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError) as error:
        raise _UnsoundError(identifier, f"its geometry cannot be read ({error})") from error
    if shape.is_empty:
        raise _UnsoundError(identifier, "its geometry is empty")
    if not shapes.is_finite(shape):
        raise _UnsoundError(identifier, "a coordinate is not finite")
    reason = shapes.invalid_reason(shape)
    if reason is not None:
        raise _UnsoundError(identifier, f"its geometry is not valid: {reason}")
    return shape


def _polylines(identifier: str, key: str, value: Any) -> list[list[list[float]]]:
    """Polylines of at least two finite points; a single polyline is taken for a list of one."""
    try:
        single = bool(value) and isinstance(value[0][0], int | float)
        lines = cast("list[list[list[Any]]]", [value] if single else value or [])
        result = [[[float(x) for x in place[:2]] for place in line] for line in lines]
    except (TypeError, ValueError, OverflowError, LookupError) as error:
        raise _UnsoundError(identifier, f"`{key}` is not a list of polylines") from error
    if any(len(line) < 2 or any(len(place) != 2 for place in line) for line in result):
        raise _UnsoundError(identifier, f"`{key}` has a polyline of less than two points")
    if not all(math.isfinite(value) for line in result for place in line for value in place):
        raise _UnsoundError(identifier, f"`{key}` has a coordinate that is not finite")
    return result
