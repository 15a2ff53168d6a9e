"""Maps as rows: `regions` (everything), `lanes` and `links` (for queries), and back."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import shapely
from numpy.typing import NDArray

from scenicq.geometry.centerlines import centerlines
from scenicq.geometry.features import MapFeature, names
from scenicq.geometry.links import Link, links_of
from scenicq.geometry.map_traits import MapTraits, traits_of
from scenicq.store.manifest import MapGroup
from scenicq.store.place import StoreFile, open_parquet
from scenicq.store.schema import SCHEMAS, ArrowTable

__all__ = ["MapFiles", "lane_rows", "link_rows", "map_groups", "region_rows"]

_encode = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode


def region_rows(map_name: str, features: Sequence[MapFeature]) -> ArrowTable:
    """All elements of a map, in the order of the map."""
    return pa.table(
        {
            "map": [map_name] * len(features),
            "id": [feature.id for feature in features],
            "kind": [feature.kind for feature in features],
            "geometry": _wkb(np.array([feature.shape for feature in features], dtype=object)),
            "properties": [_encode(dict(feature.properties)) for feature in features],
        },
        schema=SCHEMAS["regions"],
    )


def lane_rows(map_name: str, features: Sequence[MapFeature]) -> ArrowTable:
    """The lanes of a map, in the order of the map."""
    lanes = [lane for lane in features if lane.kind == "lane"]
    return pa.table(
        {
            "map": [map_name] * len(lanes),
            "id": [lane.id for lane in lanes],
            "centerline": _wkb(_centerlines(lanes)),
            "left": [next(iter(names(lane, "left")), None) for lane in lanes],
            "right": [next(iter(names(lane, "right")), None) for lane in lanes],
            "predecessors": [names(lane, "predecessors") for lane in lanes],
            "successors": [names(lane, "successors") for lane in lanes],
        },
        schema=SCHEMAS["lanes"],
    )


def link_rows(map_name: str, features: Sequence[MapFeature]) -> ArrowTable:
    """How the elements of a map hang together."""
    found = list(links_of(features))
    columns = list(zip(*found, strict=True)) or [[] for _ in Link._fields]
    rows = dict(zip(Link._fields, columns, strict=True))
    return pa.table({"map": [map_name] * len(found), **rows}, schema=SCHEMAS["links"])


def map_groups(maps: Mapping[str, Sequence[MapFeature]]) -> tuple[MapGroup, ...]:
    """The maps by their traits, in order."""
    alike: dict[tuple[tuple[str, ...], bool], list[str]] = defaultdict(list)
    for name in sorted(maps):
        traits = traits_of(maps[name])
        alike[tuple(sorted(traits.kinds)), traits.directed].append(name)
    return tuple(MapGroup(*traits, tuple(names)) for traits, names in sorted(alike.items()))


@dataclass(frozen=True, slots=True)
class MapFiles:
    """The files of the maps of a dataset, of which only the row groups that hold a map are read for it.

    Attributes:
        files: Those of the table `regions`.
        groups: What the manifest says of maps.
    """

    files: Sequence[StoreFile]
    groups: Sequence[MapGroup] = ()
    _traits: dict[str, MapTraits] = field(default_factory=dict["str", MapTraits], repr=False)
    _groups: dict[int, _RowGroups] = field(default_factory=dict["int", "_RowGroups"], repr=False)

    def traits(self, map_name: str) -> MapTraits | None:
        """What is known of a map without reading it; None for nothing."""
        if not self._traits:
            for group in self.groups:
                traits = MapTraits(frozenset(group.kinds), group.directed)
                self._traits.update(dict.fromkeys(group.maps, traits))
        return self._traits.get(map_name)

    def count_alike(self, traits: MapTraits) -> int:
        """How many maps are known to have some traits."""
        groups = (each for each in self.groups if MapTraits(frozenset(each.kinds), each.directed) == traits)
        return sum(len(each.maps) for each in groups)

    def features(self, map_name: str) -> tuple[MapFeature, ...]:
        """The elements of one map, equal to those that were written."""
        features: list[MapFeature] = []
        for number, file in enumerate(self.files):
            known = self._groups.get(number)
            with open_parquet(file, **({} if known is None else {"metadata": known.metadata})) as parquet:
                if known is None:
                    known = self._groups[number] = _RowGroups.of(parquet.metadata)
                groups = known.groups_of(map_name)
                if not groups:
                    continue
                # threads take longer to start than they save
                table = parquet.read_row_groups(groups, use_threads=False)
            # those of a map are together
            maps = table["map"].to_pylist()
            first = maps.index(map_name) if map_name in maps else 0
            table = table.slice(first, maps.count(map_name))
            shapes = shapely.from_wkb(table["geometry"].to_pylist())
            ids, kinds, texts = (table[name].to_pylist() for name in ("id", "kind", "properties"))
            properties = map(_WrittenProperties, texts)
            features += [MapFeature(*each) for each in zip(ids, kinds, shapes, properties, strict=True)]
        return tuple(features)


@dataclass(frozen=True, slots=True)
class _RowGroups:
    """What the footer of a file of `regions` says, which is read once.

    Attributes:
        metadata: The footer, as pyarrow has it.
        ends: The least and the greatest name of a map in each row group; None where it is not said.
    """

    metadata: pq.FileMetaData
    ends: tuple[tuple[str, str] | None, ...]

    @classmethod
    def of(cls, metadata: pq.FileMetaData) -> _RowGroups:
        """What a footer says."""
        column = SCHEMAS["regions"].get_field_index("map")
        told = [metadata.row_group(group).column(column).statistics for group in range(metadata.num_row_groups)]
        return cls(metadata, tuple((each.min, each.max) if each and each.has_min_max else None for each in told))

    def groups_of(self, map_name: str) -> list[int]:
        """The row groups that may hold a map."""
        return [number for number, ends in enumerate(self.ends) if ends is None or ends[0] <= map_name <= ends[1]]


class _WrittenProperties(Mapping[str, Any]):
    """Properties of a map element as they are written, read when somebody asks for one: most are never asked for."""

    __slots__ = ("_found", "_text")

    def __init__(self, text: str) -> None:
        """Take the text, a JSON object."""
        self._text = text
        self._found: dict[str, Any] | None = None

    def __getitem__(self, key: str) -> Any:
        """One of them."""
        return self._read()[key]

    def get(self, key: str, default: Any = None) -> Any:
        """One of them, or what is given where there is none: most that are asked for are not there."""
        return self._read().get(key, default)

    def __iter__(self) -> Iterator[str]:
        """Their names."""
        return iter(self._read())

    def __len__(self) -> int:
        """How many there are."""
        return len(self._read())

    def __repr__(self) -> str:
        """As those of a dictionary."""
        return repr(self._read())

    def _read(self) -> dict[str, Any]:
        found = self._found
        if found is None:
            try:
                found = msgspec.json.decode(self._text, type=dict[str, Any])
            except msgspec.DecodeError:  # it knows no half of a surrogate, and is three times as fast
                found = cast("dict[str, Any]", json.loads(self._text))
            self._found = found
        return found


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
