"""Regions of a map as conditions on the table `memberships`."""

from __future__ import annotations

from dataclasses import dataclass

from scenicq.geometry.network import Network
from scenicq.geometry.regions import PolygonSet, Region, UnionOf
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.sql_ends import number
from scenicq.store.sql import sql_text

__all__ = ["RegionNames", "near_region"]

_FEW_IDS, _MOST_IDS = 4, 2000
"""Regions named one by one in a condition: as a list, and at most."""


@dataclass(frozen=True, slots=True)
class RegionNames:
    """What the regions of a network are called in `memberships`.

    Attributes:
        kinds: The kinds of map element whose union a region is, by the region's identity.
        elements: The name of the map element that each element's area is.
    """

    kinds: dict[int, tuple[str, ...]]
    elements: dict[str, str]

    @classmethod
    def of(cls, network: Network) -> RegionNames:
        """The names for one map."""
        kinds = {
            id(network.laneRegion): ("lane",),
            id(network.intersectionRegion): ("intersection",),
            id(network.crossingRegion): ("crossing",),
            id(network.sidewalkRegion): ("sidewalk",),
            id(network.shoulderRegion): ("shoulder",),
            id(network.drivableRegion): ("lane", "road", "intersection", "drivable"),
        }
        elements = {feature.id: feature.id for feature in network.features}
        for section in network.laneSections:
            # A lane that the map does not cut is its own only section, which the map has no name for.
            elements.setdefault(section.id, section.lane.id)
        return cls(kinds, elements)


def near_region(region: Region, names: RegionNames, reach: float) -> str | None:
    """A condition on the columns of `memberships` that some row of an object in the region meets.

    Args:
        region: The region.
        names: What the map's regions are called.
        reach: Metres that the object may be off; at most `MEMBERSHIP_RADIUS_M`.

    Returns:
        SQL; None if the region is not made of elements of the map.
    """
    match region:
        case PolygonSet():
            known = region.ids and all(name in names.elements for name in region.ids)
            if id(region) in names.kinds:
                wanted = ", ".join(map(sql_text, names.kinds[id(region)]))
                chosen = f"kind IN ({wanted})"
            elif known and len(region.ids) <= _MOST_IDS and len(region.ids) == len(region.polygons):
                ids = ", ".join(sql_text(names.elements[name]) for name in region.ids)
                # a subquery is hashed, a list is gone through for every row
                chosen = f"region IN (SELECT unnest([{ids}]))" if len(region.ids) > _FEW_IDS else f"region IN ({ids})"
            else:
                return None
            return f"({chosen} AND distance <= {number(reach + SLACK)})"
        case UnionOf() if all(id(part) in names.kinds for part in region.parts):
            kinds = sorted({kind for part in region.parts for kind in names.kinds[id(part)]})
            return f"(kind IN ({', '.join(map(sql_text, kinds))}) AND distance <= {number(reach + SLACK)})"
        case UnionOf():
            parts = [near_region(part, names, reach) for part in region.parts]
            if any(part is None for part in parts):
                return None
            return "(" + " OR ".join(part for part in parts if part is not None) + ")"
        case _:
            return None
