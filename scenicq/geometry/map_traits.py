"""What can be known of a map without reading it: all that many a program asks of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenicq.geometry.centerlines import centerlines
from scenicq.geometry.features import MapFeature
from scenicq.geometry.road_direction import DirectedLane, RoadDirection

__all__ = ["MapTraits", "traits_of"]


@dataclass(frozen=True, slots=True)
class MapTraits:
    """What a map has at all.

    Attributes:
        kinds: The kinds of its elements.
        directed: Whether traffic has a direction anywhere.
    """

    kinds: frozenset[str] = frozenset()
    directed: bool = False


def traits_of(features: Sequence[MapFeature]) -> MapTraits:
    """The traits of a map, given its elements."""
    lines = (each for each in features if each.kind in ("lane", "shoulder"))
    directed = any(not RoadDirection((DirectedLane(each.shape, centerlines(each)),)).is_nowhere for each in lines)
    return MapTraits(frozenset(each.kind for each in features), directed)
