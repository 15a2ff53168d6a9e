"""A small made-up town, against which a program is checked when no map is given.

A crossing of four roads and, at the far end of the northern one, a junction of three. It has at least one element of
every kind, so that a program which picks from the map finds something to pick from.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from shapely import LineString
from shapely.affinity import rotate, translate
from shapely.geometry import box, mapping

from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network

__all__ = ["street"]

_LANE = 3.5
_NEAR, _FAR, _FARTHER = 10.0, 110.0, 60.0
_ARMS = ("north", "west", "south", "east")
_JUNCTION = (0.0, _FAR + _NEAR)
_ARC = 8
"""Segments of a turn."""


def _placed(shape: Any, number: int, center: tuple[float, float]) -> Any:
    """A shape that is drawn for an arm to the north, turned and moved into place."""
    return translate(rotate(shape, 90 * number, origin=(0, 0)), *center)


def _arm(
    name: str, number: int, center: tuple[float, float] = (0.0, 0.0), far: float = _FAR, lanes: int = 2
) -> Iterator[MapFeature]:
    """One road leading away from a crossing, north if its number is 0 and on counter-clockwise; traffic keeps right."""

    def area(x0: float, x1: float, y0: float = _NEAR, y1: float = far) -> Any:
        return _placed(box(x0, y0, x1, y1), number, center)

    def line(x: float, y0: float, y1: float) -> Any:
        return _placed(LineString([(x, y0), (x, y1)]), number, center)

    half = lanes * _LANE
    yield MapFeature(name, "road", area(-half, half), {"forward": f"{name}-out", "backward": f"{name}-in"})
    for way, side in (("out", 1), ("in", -1)):
        group, other = f"{name}-{way}", f"{name}-{'in' if way == 'out' else 'out'}"
        yield MapFeature(group, "lane_group", area(*sorted((0, side * half))), {"road": name, "opposite": other})
        ends = (_NEAR, far) if side > 0 else (far, _NEAR)
        for lane in range(lanes):
            middle = side * (lane + 0.5) * _LANE
            properties: dict[str, Any] = {
                "road": name,
                "group": group,
                "centerline": [list(mapping(line(middle, *ends))["coordinates"])],
            }
            if lanes == 2:
                properties["right" if lane == 0 else "left"] = f"{group}-{1 - lane}"
            yield MapFeature(f"{group}-{lane}", "lane", area(middle - _LANE / 2, middle + _LANE / 2), properties)
        inner, outer = sorted((side * half, side * (half + 1))), sorted((side * (half + 1), side * (half + 4)))
        yield MapFeature(f"{name}-shoulder-{way}", "shoulder", area(*inner), {})
        yield MapFeature(f"{name}-sidewalk-{way}", "sidewalk", area(*outer), {})
        yield MapFeature(f"{name}-curb-{way}", "curb", line(side * (half + 1), *ends), {})
    yield MapFeature(f"{name}-crossing", "crossing", area(-half, half, _NEAR + 1, _NEAR + 4), {"road": name})


def _ways(
    name: str, center: tuple[float, float], arms: Mapping[int, tuple[str, str, str]], lanes: int = 2
) -> Iterator[MapFeature]:
    """A crossing and the ways through it: straight on in either lane, to the right in the outer, left in the inner one.

    Args:
        name: The crossing's name.
        center: Where it is.
        arms: By the number of the arm: its road, the group of the lanes that lead here, that of those that lead away.
        lanes: How many lanes each way go through it.
    """
    turns = [*(("straight", 2, lane) for lane in range(lanes)), ("right", 1, lanes - 1), ("left", 3, 0)]
    roads = [road for road, _, _ in arms.values()]
    area = _placed(box(-_NEAR, -_NEAR, _NEAR, _NEAR), 0, center)
    yield MapFeature(name, "intersection", area, {"roads": roads, "signalized": len(arms) > 3})
    for number, (_, arriving, _) in arms.items():
        for turn, by, lane in turns:
            leaving = arms.get((number + by) % 4)
            if leaving is None:
                continue
            points = _curve(lane, by)
            middle = _placed(LineString(points), number, center)
            way = f"{name}-{arriving}-{turn}-{lane}"
            inside = _placed(box(-_NEAR, -_NEAR, _NEAR, _NEAR), 0, center)
            area = middle.buffer(_LANE / 2, cap_style="flat", quad_segs=4).intersection(inside)
            yield MapFeature(f"{way}-road", "road", area, {"forward": f"{way}-group", "intersection": name})
            yield MapFeature(f"{way}-group", "lane_group", area, {"road": f"{way}-road"})
            yield MapFeature(way, "lane", area, {
                "road": f"{way}-road", "group": f"{way}-group", "centerline": [list(mapping(middle)["coordinates"])],
                "predecessors": [f"{arriving}-{lane}"], "successors": [f"{leaving[2]}-{lane}"],
            })  # fmt: skip


def _curve(lane: int, by: int) -> list[tuple[float, float]]:
    """The way from the northern arm to the one that is some quarter turns on."""
    x = (lane + 0.5) * _LANE
    if by == 2:
        return [(-x, _NEAR), (-x, -_NEAR)]
    side = -1.0 if by == 1 else 1.0
    # a quarter of a circle around the corner between the two arms
    radius = _NEAR + side * x
    angles = [math.pi / 2 * step / _ARC for step in range(_ARC + 1)]
    return [(side * (_NEAR - radius * math.cos(a)), _NEAR - radius * math.sin(a)) for a in angles]


def street() -> Network:
    """The road network of the town."""
    features = [feature for number, name in enumerate(_ARMS) for feature in _arm(name, number)]
    features += _ways("middle", (0.0, 0.0), {n: (name, f"{name}-in", f"{name}-out") for n, name in enumerate(_ARMS)})
    ends = {"tee-west": 1, "tee-east": 3}
    for name, number in ends.items():
        features += _arm(name, number, _JUNCTION, _FARTHER, lanes=1)
    meeting = {number: (name, f"{name}-in", f"{name}-out") for name, number in ends.items()}
    features += _ways("tee", _JUNCTION, {**meeting, 2: ("north", "north-out", "north-in")}, lanes=1)
    return Network("street", features)
