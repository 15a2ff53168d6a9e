"""Regions of a map as conditions on the table `memberships`."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property

from scenicq.geometry import shapes
from scenicq.geometry.network import Network
from scenicq.geometry.regions import PolygonSet, PolylineSet, Region, UnionOf
from scenicq.limits import LIMITS
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.sql_ends import number
from scenicq.store.sql import sql_text

__all__ = ["RegionNames", "among_names", "near_region", "nearest_box", "region_ids"]

_WRITTEN_OUT = 8
"""Names that are written out."""


class RegionNames:
    """What the regions of a network are called in `memberships`.

    Attributes:
        kinds: The kinds of map element whose union a region is, by the region's identity.
        tables: The query of each table that conditions ask for. The table's name says what is in it.
    """

    def __init__(self, network: Network) -> None:
        """The names for one map."""
        self._network = network
        self.tables: dict[str, str] = {}
        self.kinds: dict[int, tuple[str, ...]] = {
            id(network.laneRegion): ("lane",),
            id(network.intersectionRegion): ("intersection",),
            id(network.crossingRegion): ("crossing",),
            id(network.sidewalkRegion): ("sidewalk",),
            id(network.shoulderRegion): ("shoulder",),
            id(network.drivableRegion): ("lane", "road", "intersection", "drivable"),
        }

    def table(self, columns: str, *rows: Sequence[str] | Sequence[float]) -> str:
        """The table of some names or numbers, which is made once for a connection.

        Args:
            columns: The names of its columns, `one` or `one, other`.
            rows: What is in each column, as many in each.
        """
        lists = [
            f"[{', '.join(sql_text(each) if isinstance(each, str) else repr(each) for each in column)}]"
            f"::{'DOUBLE' if column and isinstance(column[0], float) else 'VARCHAR'}[]"
            for column in rows
        ]
        query = f"SELECT {', '.join(f'unnest({each})' for each in lists)}"
        name = f"names_{hashlib.blake2b(query.encode(), digest_size=8).hexdigest()}"
        self.tables[f"{name}({columns})"] = query
        return name

    @cached_property
    def elements(self) -> dict[str, str]:
        """The name of the map element that each element's area is."""
        elements = {feature.id: feature.id for feature in self._network.features}
        for section in self._network.laneSections:
            # A lane that the map does not cut is its own only section, which the map has no name for.
            elements.setdefault(section.id, section.lane.id)
        return elements


def near_region(region: Region, names: RegionNames, reach: float) -> str | None:
    """A condition on the columns of `memberships` that some row of an object in the region meets.

    Args:
        region: The region.
        names: What the map's regions are called.
        reach: Metres that the object may be off; at most `MEMBERSHIP_RADIUS_M`.

    Returns:
        SQL; None if the region is not made of elements of the map.
    """
    found: list[str] = []
    todo = [region]
    while todo:
        match todo.pop():
            case PolygonSet() as area:
                chosen = _chosen(area, names)
                if chosen is None:
                    return None
                found.append(chosen)
            case UnionOf(parts=parts) if all(id(part) in names.kinds for part in parts):
                kinds = sorted({kind for part in parts for kind in names.kinds[id(part)]})
                found.append(f"kind IN ({', '.join(map(sql_text, kinds))})")
            case UnionOf(parts=parts):
                todo += reversed(parts)
            case _:
                return None
    within = f"distance <= {number(reach + SLACK)}"
    conditions = [f"({chosen} AND {within})" for chosen in found]
    return conditions[0] if len(found) == 1 else f"({' OR '.join(conditions)})"


def nearest_box(region: Region, names: RegionNames, x: str, y: str) -> str | None:
    """SQL of the distance in metres from a point to the nearest box around a piece of a region: none is nearer.

    Args:
        region: The region.
        names: Gets the table of boxes.
        x: SQL of the point's coordinate.
        y: The same.

    Returns:
        None if the region is not made of pieces, or has too many.
    """
    parts = region.parts if isinstance(region, UnionOf) else (region,)
    pieces = [piece for part in parts if isinstance(part, PolygonSet | PolylineSet) for piece in part.pieces]
    made = all(isinstance(part, PolygonSet | PolylineSet) for part in parts)
    if not made or not 0 < len(pieces) <= LIMITS.region_boxes:
        return None
    table = names.table("west, south, east, north", *zip(*map(shapes.bounds_of, pieces), strict=True))
    aside, ahead = (
        f"greatest({low} - {at}, {at} - {high}, 0)" for at, low, high in ((x, "west", "east"), (y, "south", "north"))
    )
    # `greatest` passes over what is null
    return f"(SELECT min(sqrt({aside} * {aside} + {ahead} * {ahead}) + 0 * ({x} + {y})) FROM {table})"


def region_ids(region: Region, names: RegionNames) -> tuple[str, ...] | None:
    """The regions of `memberships` that a region is made of; None if it is not made of elements of the map."""
    found: list[str] = []
    todo = [region]
    while todo:
        match todo.pop():
            case PolygonSet() as area if id(area) not in names.kinds:
                ids = _ids(area, names)
                if ids is None:
                    return None
                found += ids
            case UnionOf(parts=parts) if not any(id(part) in names.kinds for part in parts):
                todo += reversed(parts)
            case _:
                return None
    return tuple(found)


def _ids(area: PolygonSet, names: RegionNames) -> list[str] | None:
    known = area.ids and all(name in names.elements for name in area.ids)
    if not known or len(area.ids) > LIMITS.named_regions or len(area.ids) != len(area.polygons):
        return None
    return [names.elements[name] for name in area.ids]


def _chosen(area: PolygonSet, names: RegionNames) -> str | None:
    """The rows of `memberships` that are about an area of the map; None if it is not made of the map's elements."""
    if id(area) in names.kinds:
        return f"kind IN ({', '.join(map(sql_text, names.kinds[id(area)]))})"
    ids = _ids(area, names)
    return None if ids is None else f"region IN {among_names(ids, names)}"


def among_names(ids: Sequence[str], names: RegionNames) -> str:
    """Some names as the right side of `IN`: a table is hashed, a list is gone through for every row."""
    if len(ids) <= _WRITTEN_OUT:
        return f"({', '.join(map(sql_text, ids)) or 'NULL'})"
    return f"(FROM {names.table('region', ids)})"
