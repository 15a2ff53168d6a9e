"""What the map says of the places where the objects of labels are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from scenicq.geometry.membership import contains_many
from scenicq.geometry.regions import Region
from scenicq.geometry.road_direction import RoadDirection

__all__ = ["XY", "MapLookups"]

XY = tuple[float, float]
"""A place in metres."""


@dataclass(eq=False, slots=True)
class MapLookups:
    """What the map says of places, looked up for many of them together.

    Attributes:
        directions: The headings that each field allows, by place.
        inside: Whether a place lies in each region.
    """

    directions: dict[RoadDirection, dict[XY, tuple[float, ...]]] = field(
        default_factory=dict["RoadDirection", "dict[XY, tuple[float, ...]]"]
    )
    inside: dict[int, tuple[Region, dict[XY, bool]]] = field(
        default_factory=dict["int", "tuple[Region, dict[XY, bool]]"]
    )

    def look_up(self, fields: Iterable[RoadDirection], regions: Iterable[Region], places: Iterable[XY]) -> None:
        """Look up places in fields and regions."""
        wanted = list(dict.fromkeys(places))
        if not wanted:
            return
        xy = np.array(wanted)
        for one in fields:
            self.directions.setdefault(one, {}).update(zip(wanted, one.values_many(xy), strict=True))
        for region in regions:
            found = contains_many(region, xy).tolist()
            self.inside.setdefault(id(region), (region, {}))[1].update(zip(wanted, found, strict=True))

    def allowed(self, one: RoadDirection, places: Sequence[XY]) -> list[tuple[float, ...]]:
        """The headings that a field allows at places."""
        known = self.directions.setdefault(one, {})
        self.look_up((one,), (), [place for place in places if place not in known])
        return [known[place] for place in places]

    def within(self, region: Region, places: Sequence[XY]) -> list[bool]:
        """Which places lie in a region."""
        known = self.inside.setdefault(id(region), (region, {}))[1]
        self.look_up((), (region,), [place for place in places if place not in known])
        return [known[place] for place in places]
