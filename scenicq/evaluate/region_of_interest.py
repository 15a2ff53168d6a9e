"""The part of a map that a benchmark evaluates: near the drivable area."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from scenicq.evaluate.annotations import Annotations, Frames
from scenicq.importers.predictions import Predictions
from scenicq.store.dataset import Dataset

__all__ = ["RegionOfInterest"]

Bools = NDArray[np.bool_]
Numbers = NDArray[np.int32]

_KIND = "drivable"
_CELL_M = 0.1
_ARC = 64
"""Segments of a quarter circle around a corner of the area."""


class RegionOfInterest:
    """The places of each map within a distance from its drivable area, and inside the box around that area.

    The benchmark of Argoverse 2 asks a grid with cells of 0.1 m, in which every cell counts that the area touches; here
    it is the area itself, half a cell wider.
    """

    def __init__(self, dataset: Dataset, frames: Frames, reach_m: float) -> None:
        """Take the drivable areas of a dataset's maps."""
        self._map = frames.map
        self._areas: list[Any] = [_near(dataset, name, reach_m) for name in frames.maps]

    def holds(self, boxes: Predictions | Annotations, frame: Numbers) -> Bools:
        """Whether a corner of each box lies in the region; always on maps without a drivable area.

        Args:
            boxes: Boxes on the map.
            frame: Number of the frame of each, shape (n,).
        """
        held = np.ones(len(frame), dtype=np.bool_)
        of_map = self._map[frame]
        sine, cosine = np.sin(boxes.heading), np.cos(boxes.heading)
        for number, area in enumerate(self._areas):
            if area is None:
                continue
            mine = np.flatnonzero(of_map == number)
            held[mine] = False
            for ahead, right in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
                mine = mine[~held[mine]]
                a, r = ahead * boxes.length[mine] / 2, right * boxes.width[mine] / 2
                x = boxes.x[mine] - sine[mine] * a + cosine[mine] * r
                y = boxes.y[mine] + cosine[mine] * a + sine[mine] * r
                held[mine] = shapely.contains_xy(area, x, y)
        return held


def _near(dataset: Dataset, name: str, reach_m: float) -> Any:
    if name not in dataset.manifest.maps:
        return None
    shapes = [feature.shape for feature in dataset.features(name) if feature.kind == _KIND]
    if not shapes:
        return None
    area = shapely.union_all(shapes)
    west, south, east, north = area.bounds
    around = shapely.box(math.floor(west), math.floor(south), math.ceil(east) + 1, math.ceil(north) + 1)
    near = shapely.intersection(shapely.buffer(area, reach_m + _CELL_M / 2, quad_segs=_ARC), around)
    shapely.prepare(near)
    return near
