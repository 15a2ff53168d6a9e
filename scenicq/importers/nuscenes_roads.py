"""What lies beside what in a map expansion of nuScenes, which names no neighbours, no roads and no groups of lanes.

Lanes are beside each other where a step sideways from one leads into the other. A road block holds the lanes of one
direction of its road segment; the lane connectors inside an intersection become roads of their own, as in Scenic.
"""

# shapely carries no type annotations
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from scenicq.geometry import shapes
from scenicq.geometry.features import MapFeature

__all__ = ["link_roads"]

_SAMPLES = np.linspace(0.1, 0.9, 9)
"""Where along a lane a step sideways is tried, as shares of its length."""

_REACH_M = 10.0
_GAP_M = 1.0
"""How far beside each other two lanes may lie, or overlap."""

_PARALLEL = np.cos(np.radians(30))


def link_roads(features: Sequence[MapFeature], segment_of: Mapping[str, str], *, left_hand: bool) -> list[MapFeature]:
    """The features with neighbours, groups, roads and intersections linked to each other.

    Args:
        features: Elements of one map; lanes have the property `layer`.
        segment_of: The road segment of each road block.
        left_hand: Whether traffic keeps to the left; each lane then says so.
    """
    known = {feature.id: dict(feature.properties) for feature in features}
    lanes = [each for each in features if each.kind == "lane" and each.properties.get("centerline")]
    plain = [lane for lane in lanes if lane.properties["layer"] == "lane"]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for lane, other in _beside(plain, sign).items():
            known[lane][side] = other
    blocks = [each for each in features if each.kind == "lane_group"]
    for lane, block in _holders(plain, blocks).items():
        known[lane]["group"] = block
    _link_blocks(plain, segment_of, known)
    crossings = _holders(
        [lane for lane in lanes if lane.properties["layer"] == "lane_connector"],
        [each for each in features if each.kind == "intersection"],
    )
    by_id = {feature.id: feature for feature in features}
    made = [part for lane, crossing in crossings.items() for part in _road_inside(by_id[lane], crossing)]
    for lane in crossings:
        known[lane]["group"] = f"{lane}_group"
    for crossing, roads in _meeting(crossings, known).items():
        known[crossing]["roads"] = roads
    if left_hand:
        for lane in lanes:
            known[lane.id]["traffic"] = "left"
    return [*(replace(feature, properties=known[feature.id]) for feature in features), *made]


def _beside(lanes: Sequence[MapFeature], sign: float) -> dict[str, str]:
    """The neighbour of each lane on one side (1 left, -1 right of travel), whichever way it runs."""
    if not lanes:
        return {}
    areas = np.array([lane.shape for lane in lanes])
    lines: list[Any] = [shapely.linestrings(lane.properties["centerline"][0]) for lane in lanes]
    owner = np.repeat(np.arange(len(lanes)), len(_SAMPLES))
    start = np.concatenate([_points(line, _SAMPLES * line.length) for line in lines])
    travel = np.concatenate([_directions(line, _SAMPLES * line.length) for line in lines])
    aside = np.column_stack((-travel[:, 1], travel[:, 0])) * sign
    rays: Any = shapely.linestrings(np.stack((start, start + _REACH_M * aside), axis=1))
    own_m = shapely.length(shapes.pair_intersections(rays, areas[owner]))
    ray, other = shapely.STRtree(areas).query(rays, predicate="intersects")
    kept = owner[ray] != other
    ray, other = ray[kept], other[kept]
    away_m = shapely.distance(shapely.points(start[ray]), shapes.pair_intersections(rays[ray], areas[other]))
    # Lanes that fork or merge overlap: they are not beside each other there.
    near = np.abs(away_m - own_m[ray]) <= _GAP_M
    votes: defaultdict[int, Counter[int]] = defaultdict(Counter)
    for number, ahead, distance in zip(ray[near].tolist(), other[near].tolist(), away_m[near].tolist(), strict=True):
        line = lines[ahead]
        at = shapely.line_locate_point(line, shapely.Point(start[number] + distance * aside[number]))
        if abs(float(_directions(line, np.array([at]))[0] @ travel[number])) >= _PARALLEL:
            votes[int(owner[number])][ahead] += 1
    found = {lane: max(counts.items(), key=lambda item: (item[1], -item[0])) for lane, counts in votes.items()}
    return {lanes[lane].id: lanes[best].id for lane, (best, count) in found.items() if 2 * count >= len(_SAMPLES)}


def _points(line: Any, along: NDArray[np.float64]) -> NDArray[np.float64]:
    return shapely.get_coordinates(shapely.line_interpolate_point(line, along))


def _directions(line: Any, along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors of travel at some lengths along a line."""
    step = min(0.5, line.length / 4)
    ahead = _points(line, np.minimum(along + step, line.length)) - _points(line, np.maximum(along - step, 0.0))
    norms = np.hypot(*ahead.T)[:, None]
    return ahead / np.where(norms > 0, norms, 1.0)


def _holders(lanes: Sequence[MapFeature], areas: Sequence[MapFeature]) -> dict[str, str]:
    """For each lane the area with most of it, if that is more than half."""
    if not lanes or not areas:
        return {}
    inner, outer = np.array([lane.shape for lane in lanes]), np.array([area.shape for area in areas])
    inside, around = shapely.STRtree(outer).query(inner, predicate="intersects")
    shares = shapes.shared_areas(inner[inside], outer[around]) / shapely.area(inner[inside])
    best: dict[str, tuple[float, str]] = {}
    for lane, area, share in zip(inside.tolist(), around.tolist(), shares.tolist(), strict=True):
        name = lanes[lane].id
        best[name] = max(best.get(name, (0.5, "")), (share, areas[area].id))
    return {name: area for name, (_, area) in best.items() if area}


def _link_blocks(lanes: Iterable[MapFeature], segment_of: Mapping[str, str], known: dict[str, dict[str, Any]]) -> None:
    """Say which blocks are the two directions of a road."""
    travel: dict[str, NDArray[np.float64]] = {}
    for lane in lanes:
        block = known[lane.id].get("group")
        if block is not None:
            line = lane.properties["centerline"][0]
            travel[block] = travel.get(block, np.zeros(2)) + np.subtract(line[-1], line[0])
    sides: dict[str, tuple[list[str], list[str]]] = {}
    for block, ahead in travel.items():
        segment = segment_of.get(block)
        if segment not in known:
            continue
        forward, backward = sides.setdefault(segment, ([], []))
        known[block]["road"] = segment
        (forward if not forward or float(ahead @ travel[forward[0]]) >= 0 else backward).append(block)
    for segment, (forward, backward) in sides.items():
        known[segment] |= {"forward": forward, "backward": backward}
        for here, there in ((forward, backward), (backward, forward)):
            for block in here if there else ():
                known[block]["opposite"] = there[0]


def _road_inside(lane: MapFeature, crossing: str) -> Iterator[MapFeature]:
    group, road = f"{lane.id}_group", f"{lane.id}_road"
    yield MapFeature(group, "lane_group", lane.shape, {"road": road})
    yield MapFeature(road, "road", lane.shape, {"forward": [group], "backward": [], "intersection": crossing})


def _meeting(crossings: Mapping[str, str], known: Mapping[str, Mapping[str, Any]]) -> dict[str, list[str]]:
    """The roads that meet at each intersection: those from which its connectors come, and to which they lead."""
    found: defaultdict[str, dict[str, None]] = defaultdict(dict)
    for connector, crossing in crossings.items():
        for key in ("predecessors", "successors"):
            for lane in known[connector].get(key) or ():
                road = known.get(known.get(lane, {}).get("group") or "", {}).get("road")
                if road is not None:
                    found[crossing][road] = None
    return {crossing: list(roads) for crossing, roads in found.items()}
