"""A small made-up crossing, against which a program is checked when no map is given.

It has at least one element of every kind, so that a program which picks from the map finds something to pick from.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from shapely import LineString
from shapely.affinity import rotate
from shapely.geometry import box, mapping

from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network

__all__ = ["street"]

_LANE = 3.5
_NEAR, _FAR = 10.0, 110.0
_ARMS = ("north", "west", "south", "east")


def _arm(number: int) -> Iterator[MapFeature]:
    """One road leading north from the crossing, turned into place; traffic keeps right."""
    name = _ARMS[number]

    def area(x0: float, x1: float, y0: float = _NEAR, y1: float = _FAR) -> Any:
        return rotate(box(x0, y0, x1, y1), 90 * number, origin=(0, 0))

    def line(x: float, y0: float, y1: float) -> Any:
        return rotate(LineString([(x, y0), (x, y1)]), 90 * number, origin=(0, 0))

    half = 2 * _LANE
    yield MapFeature(name, "road", area(-half, half), {"forward": f"{name}-out", "backward": f"{name}-in"})
    for way, side in (("out", 1), ("in", -1)):
        group, other = f"{name}-{way}", f"{name}-{'in' if way == 'out' else 'out'}"
        yield MapFeature(group, "lane_group", area(*sorted((0, side * half))), {"road": name, "opposite": other})
        for lane in (0, 1):
            middle = side * (lane + 0.5) * _LANE
            ends = (_NEAR, _FAR) if side > 0 else (_FAR, _NEAR)
            properties: dict[str, Any] = {
                "road": name,
                "group": group,
                "centerline": [list(mapping(line(middle, *ends))["coordinates"])],
                ("right" if lane == 0 else "left"): f"{group}-{1 - lane}",
            }
            yield MapFeature(f"{group}-{lane}", "lane", area(middle - _LANE / 2, middle + _LANE / 2), properties)
        inner, outer = sorted((side * half, side * (half + 1))), sorted((side * (half + 1), side * (half + 4)))
        yield MapFeature(f"{name}-shoulder-{way}", "shoulder", area(*inner), {})
        yield MapFeature(f"{name}-sidewalk-{way}", "sidewalk", area(*outer), {})
        yield MapFeature(f"{name}-curb-{way}", "curb", line(side * (half + 1), *ends), {})
    yield MapFeature(f"{name}-crossing", "crossing", area(-half, half, _NEAR + 1, _NEAR + 4), {"road": name})


def street() -> Network:
    """The road network of the crossing."""
    features = [feature for number in range(4) for feature in _arm(number)]
    middle = MapFeature("middle", "intersection", box(-_NEAR, -_NEAR, _NEAR, _NEAR), {"roads": list(_ARMS)})
    return Network("street", [*features, middle])
