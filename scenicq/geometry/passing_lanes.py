"""Which of several areas hold each place of the plane, all that overlap there, such as ways through an intersection."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree

from scenicq.geometry import shapes
from scenicq.geometry.network import TOLERANCE
from scenicq.geometry.regions import SLACK
from scenicq.geometry.shapes import Shape

__all__ = ["HeldPart", "areas_at", "areas_everywhere"]

HeldPart = tuple[Shape, tuple[int, ...]]
"""A part of the plane, and the numbers of the areas that count there."""
_FAR = 1000.0
"""Metres around all areas within which a place has a nearest one."""
_STEP = 0.5
"""Metres between places of a border that tell to which area others are nearest."""
_LEAST = 1e-9
"""Square metres below which a part is none."""


def areas_at(areas: Sequence[Shape], x: float, y: float) -> list[int]:
    """The areas that hold a point, else those within the map's tolerance, else the nearest; none of none."""
    here = shapes.point(x, y)
    away = [shapes.distance(area, here) for area in areas]
    for limit in (SLACK, TOLERANCE):
        found = [number for number, distance in enumerate(away) if distance <= limit]
        if found:
            return found
    return [int(np.argmin(away))] if away else []


def areas_everywhere(areas: Sequence[Shape]) -> list[list[HeldPart]]:
    """The plane about some areas in parts with the same `areas_at`, to half a metre where the nearest of them counts.

    Those of a later list count where the earlier have none.
    """
    wider = [shapes.band(area, TOLERANCE) for area in areas]
    return [_parts(areas), _parts(wider), _nearest(wider)]


def _parts(areas: Sequence[Shape]) -> list[HeldPart]:
    tree = STRtree(shapes.array(areas))
    whole = shapes.box(*_grown(areas, 1.0))
    faces = [face for face in shapes.divide_polygon(whole, areas) if face.area > _LEAST]
    middles = shapes.points(np.array([shapes.inner_point(face) for face in faces]))
    held: list[list[int]] = [[] for _ in faces]
    face_numbers, area_numbers = shapes.tree_pairs_within(tree, middles, 0.0)
    pairs: list[tuple[int, int]] = list(zip(face_numbers.tolist(), area_numbers.tolist(), strict=True))
    for face, area in pairs:
        held[face].append(area)
    return [(face, tuple(sorted(each))) for face, each in zip(faces, held, strict=True) if each]


def _nearest(areas: Sequence[Shape]) -> list[HeldPart]:
    """Around areas, to which of them places are nearest."""
    tree, together = STRtree(shapes.array(areas)), shapes.union_all(areas)
    border = shapes.places_along(together, _STEP)
    cells = shapes.voronoi_cells(border, _grown(areas, _FAR))
    place, area, _ = shapes.tree_nearest(tree, shapes.points(border))
    first: NDArray[np.intp] = np.full(len(border), len(areas), dtype=np.intp)
    np.minimum.at(first, place, area)
    found: list[HeldPart] = []
    for number in np.unique(first).tolist():
        own = shapes.union_all([cells[each] for each in np.flatnonzero(first == number).tolist()])
        found += [(part, (number,)) for part in shapes.polygonal_part(shapes.difference(own, together))]
    return found


def _grown(areas: Sequence[Shape], by: float) -> shapes.Bounds:
    west, south, east, north = shapes.total_bounds(areas)
    return west - by, south - by, east + by, north + by
