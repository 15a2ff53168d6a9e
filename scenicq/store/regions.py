"""Maps as rows: `regions` (everything) and `lanes` (for queries), and back."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray

from scenicq.geometry.centerlines import centerlines
from scenicq.geometry.features import MapFeature, names
from scenicq.store.place import StoreFile, open_parquet
from scenicq.store.schema import SCHEMAS, ArrowTable

__all__ = ["lane_rows", "read_features", "region_rows"]

_encode = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode


def region_rows(maps: Mapping[str, Sequence[MapFeature]]) -> ArrowTable:
    """All elements of all maps, by map name, in the order of the map."""
    features = [(name, feature) for name in sorted(maps) for feature in maps[name]]
    return pa.table(
        {
            "map": [name for name, _ in features],
            "id": [feature.id for _, feature in features],
            "kind": [feature.kind for _, feature in features],
            "geometry": _wkb(np.array([feature.shape for _, feature in features], dtype=object)),
            "properties": [_encode(dict(feature.properties)) for _, feature in features],
        },
        schema=SCHEMAS["regions"],
    )


def lane_rows(maps: Mapping[str, Sequence[MapFeature]]) -> ArrowTable:
    """The lanes of all maps, by map name, in the order of the map."""
    lanes = [(name, lane) for name in sorted(maps) for lane in maps[name] if lane.kind == "lane"]
    return pa.table(
        {
            "map": [name for name, _ in lanes],
            "id": [lane.id for _, lane in lanes],
            "centerline": _wkb(_centerlines([lane for _, lane in lanes])),
            "left": [next(iter(names(lane, "left")), None) for _, lane in lanes],
            "right": [next(iter(names(lane, "right")), None) for _, lane in lanes],
            "predecessors": [names(lane, "predecessors") for _, lane in lanes],
            "successors": [names(lane, "successors") for _, lane in lanes],
        },
        schema=SCHEMAS["lanes"],
    )


def read_features(files: Iterable[StoreFile], map_name: str) -> tuple[MapFeature, ...]:
    """The elements of one map, equal to those that were written."""
    features: list[MapFeature] = []
    for file in files:
        with open_parquet(file) as parquet:
            # threads take longer to start than they save
            table = parquet.read(use_threads=False)
        # those of a map are together
        maps = table["map"].to_pylist()
        first = maps.index(map_name) if map_name in maps else 0
        table = table.slice(first, maps.count(map_name))
        shapes = shapely.from_wkb(table["geometry"].to_pylist())
        ids, kinds, texts = (table[name].to_pylist() for name in ("id", "kind", "properties"))
        # as one text they take half the time
        every = json.loads(f"[{','.join(texts)}]")
        features += [MapFeature(*each) for each in zip(ids, kinds, shapes, every, strict=True)]
    return tuple(features)


def _wkb(shapes: NDArray[Any]) -> list[bytes | None]:
    return shapely.to_wkb(shapes).tolist()


def _centerlines(lanes: Sequence[MapFeature]) -> NDArray[Any]:
    """The centreline of each lane as a MultiLineString; None where there is none."""
    found = np.full(len(lanes), None, dtype=object)
    lines = [(place, line) for place, lane in enumerate(lanes) for line in centerlines(lane)]
    if lines:
        corners = np.concatenate([line for _, line in lines])
        line_of = np.repeat(np.arange(len(lines)), [len(line) for _, line in lines])
        parts = np.asarray(shapely.linestrings(corners, indices=line_of))
        owners, numbers = np.unique([place for place, _ in lines], return_inverse=True)
        found[owners] = shapely.multilinestrings(parts, indices=numbers)
    return found
