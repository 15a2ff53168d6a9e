"""Centrelines of lanes, and the direction of traffic along them: all that positions are looked up in at ingest."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, cast

import numpy as np

from scenicq.geometry.features import MapFeature
from scenicq.geometry.road_direction import DirectedLane, RoadDirection
from scenicq.geometry.shapes import Coordinates

__all__ = ["centerlines", "direction_along", "has_centerline", "lane_direction", "road_direction"]


def centerlines(feature: MapFeature) -> tuple[Coordinates, ...]:
    """The polylines of a feature's centreline, in the direction of travel, shape (n, 2) each."""
    lines = cast("list[list[list[float]]]", feature.properties.get("centerline") or [])
    return tuple(np.array(line, dtype=float)[:, :2] for line in lines if len(line) > 1)


def has_centerline(feature: MapFeature) -> bool:
    """Whether the map gives a feature a centreline."""
    return any(len(line) > 1 for line in cast("list[list[Any]]", feature.properties.get("centerline") or []))


def lane_direction(features: Iterable[MapFeature]) -> RoadDirection:
    """The direction of traffic on the lanes of a map alone.

    Args:
        features: Of those with the same id the first counts.
    """
    return RoadDirection(_directed(features, "lane"))


def road_direction(features: Iterable[MapFeature], ahead: Callable[[], Iterable[str]] | None = None) -> RoadDirection:
    """The direction of traffic: that of the lanes, and of shoulders off roads and intersections, if these have one.

    Args:
        features: Of those with the same id the first counts.
        ahead: Gives the ids of lanes that come before the others, in this order; asked when a direction is.
    """
    features = tuple(features)
    lanes, beside = _of_kind(features, "lane"), _directed(features, "shoulder")
    taken = tuple(each.shape for each in features if each.kind in ("intersection", "road"))

    def order() -> list[int]:
        ranks = {id_: rank for rank, id_ in enumerate(dict.fromkeys(() if ahead is None else ahead()))}
        return sorted(range(len(lanes)), key=lambda number: ranks.get(lanes[number].id, len(ranks)))

    directed = tuple(DirectedLane(each.shape, centerlines(each)) for each in lanes)
    return RoadDirection(directed, beside=beside, taken=taken if beside else (), order=None if ahead is None else order)


def _of_kind(features: Iterable[MapFeature], kind: str) -> list[MapFeature]:
    kept: dict[str, MapFeature] = {}
    for feature in features:
        kept.setdefault(feature.id, feature)
    return [each for each in kept.values() if each.kind == kind]


def _directed(features: Iterable[MapFeature], kind: str) -> tuple[DirectedLane, ...]:
    return tuple(DirectedLane(each.shape, centerlines(each)) for each in _of_kind(features, kind))


def direction_along(features: Iterable[MapFeature], kind: str) -> RoadDirection | None:
    """The direction of the centrelines of all elements of a kind; None unless the map gives them for all.

    Scenic's sidewalks and shoulders have such a direction.
    """
    own = [feature for feature in features if feature.kind == kind]
    lines = [centerlines(feature) for feature in own]
    if not own or not all(lines):
        return None
    directed = tuple(DirectedLane(each.shape, along) for each, along in zip(own, lines, strict=True))
    return RoadDirection(directed, kind)
