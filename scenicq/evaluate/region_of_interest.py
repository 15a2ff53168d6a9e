"""The part of a map that a benchmark evaluates: what is near the drivable area."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from scenicq.evaluate.annotations import Annotations, Frames
from scenicq.evaluate.ego_poses import EgoPoses
from scenicq.importers.predictions import Predictions
from scenicq.number_ranges import expand_ranges
from scenicq.store.dataset import Dataset

__all__ = ["RegionOfInterest"]

Bools = NDArray[np.bool_]
Numbers = NDArray[np.int32]
Places = NDArray[np.int64]
Reals = NDArray[np.float64]

_KIND = "drivable"
_CELLS = 10
"""Cells to a metre."""
_CORNERS = [(ahead, left, up) for ahead in (1, -1) for left in (1, -1) for up in (1, -1)]


class RegionOfInterest:
    """The places of each map within a distance from its drivable area, and inside the box around that area.

    The benchmark of Argoverse 2 asks a grid with cells of 0.1 m, and so does this: a polygon whose corners are rounded
    to cells holds the cells of each row between its edges, rounded, and a cell counts whose distance from one of these
    is small enough. Distances between cells are exact.
    """

    def __init__(self, dataset: Dataset, frames: Frames, reach_m: float) -> None:
        """Take the drivable areas of a dataset's maps."""
        self._map = frames.map
        self._poses = EgoPoses(dataset, frames)
        self._areas = [_grid_of(dataset, name, reach_m) for name in frames.maps]

    def holds(self, boxes: Predictions | Annotations, frame: Numbers) -> Bools:
        """Whether a corner of each box lies in the region; always on maps without a drivable area.

        Boxes stand upright in the frame of their ego, which may be tilted.

        Args:
            boxes: Boxes on the map.
            frame: Number of the frame of each, shape (n,).
        """
        held = np.ones(len(frame), dtype=np.bool_)
        of_map = self._map[frame]
        for number, area in enumerate(self._areas):
            if area is None:
                continue
            mine = np.flatnonzero(of_map == number)
            held[mine] = False
            yaw = self._poses.heading_seen(frame[mine], boxes.heading[mine])
            for corner in _CORNERS:
                open_ = ~held[mine]
                mine, yaw = mine[open_], yaw[open_]
                a, b, c = (
                    sign * np.nan_to_num(side[mine]) / 2
                    for sign, side in zip(corner, (boxes.length, boxes.width, boxes.height), strict=True)
                )
                ahead, left = np.cos(yaw) * a - np.sin(yaw) * b, np.sin(yaw) * a + np.cos(yaw) * b
                dx, dy, _ = self._poses.turned(frame[mine], ahead, left, c)
                held[mine] = area.holds(boxes.x[mine] + dx, boxes.y[mine] + dy)
        return held


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """The cells of a drivable area, as runs that follow each other in their rows, and do not touch.

    Attributes:
        x, y: The corner of the first cell, metres.
        columns, rows: Size of the grid.
        first, last: Ends of each run, as cells numbered row by row in lines of `stride` cells, shape (runs,).
        stride: See `first`; a run and what is near it never reach the next row.
        reach: How far from them cells count.
    """

    x: int
    y: int
    columns: int
    rows: int
    first: Places
    last: Places
    stride: int
    reach: int

    def holds(self, x: Reals, y: Reals) -> Bools:
        """Whether places lie in the region, shape (n,)."""
        # toward zero, as the benchmark has it: less than one cell outside of the grid counts as the first
        column, row = ((x - self.x) * _CELLS).astype(np.int64), ((y - self.y) * _CELLS).astype(np.int64)
        held = np.zeros(len(x), dtype=np.bool_)
        left = np.flatnonzero((column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows))
        for away in sorted(range(-self.reach, self.reach + 1), key=abs):
            wide = math.isqrt(self.reach**2 - away**2)
            other = row[left] + away
            middle = other * self.stride + self.reach + column[left]
            run = np.searchsorted(self.first, middle + wide, side="right") - 1
            near = (other >= 0) & (run >= 0) & (self.last[np.maximum(run, 0)] >= middle - wide)
            held[left[near]] = True
            left = left[~near]
        return held


def _grid_of(dataset: Dataset, name: str, reach_m: float) -> _Grid | None:
    if name not in dataset.manifest.maps:
        return None
    shapes = [feature.shape for feature in dataset.features(name) if feature.kind == _KIND]
    if not shapes:
        return None
    bounds = np.array([shape.bounds for shape in shapes])
    west, south = (math.floor(value) for value in bounds[:, :2].min(axis=0))
    east, north = (math.ceil(value) for value in bounds[:, 2:].max(axis=0))
    columns, rows = (east - west + 1) * _CELLS, (north - south + 1) * _CELLS
    reach = round(reach_m * _CELLS)
    stride = columns + 2 * reach + 1
    row, first, last = _runs(shapes, west, south, rows)
    # what lies outside of the grid is not drawn
    first, last = np.maximum(first, 0), np.minimum(last, columns - 1)
    drawn = (first <= last) & (row >= 0) & (row < rows)
    start = row[drawn] * stride + reach
    first, last = _merged(start + first[drawn], start + last[drawn])
    return _Grid(west, south, columns, rows, first, last, stride, reach) if len(first) else None


def _runs(shapes: Iterable[Any], x: int, y: int, rows: int) -> tuple[Places, Places, Places]:
    """The runs of cells of polygons: row, first and last of each; polygons with holes by their parity."""
    found: list[tuple[Places, Places, Places]] = []
    for polygon in shapely.get_parts(list(shapes)).tolist():
        rings = [polygon.exterior, *polygon.interiors]
        corners = [np.round((np.array(ring.coords)[:, :2] - (x, y)) * _CELLS).astype(np.int64) for ring in rings]
        a, b = np.concatenate([ring[:-1] for ring in corners]), np.concatenate([ring[1:] for ring in corners])
        low, high = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
        # an edge crosses the rows from its lower end to before its upper one, so each row is crossed an even number of
        # times; upper ends, and edges along a row, are runs of their own
        level = low == high
        found.append((low[level], np.minimum(a, b)[level, 0], np.maximum(a, b)[level, 0]))
        upper = np.where(a[:, 1] > b[:, 1], a[:, 0], b[:, 0])[~level]
        found.append((high[~level], upper, upper))
        a, b, low, high = a[~level], b[~level], low[~level], high[~level]
        edge = np.repeat(np.arange(len(a)), high - low)
        row = expand_ranges(low, high - low)
        # single precision, like the drawing that the benchmark uses: halves of a cell are common
        slope = (b[:, 0] - a[:, 0]).astype(np.float32) / (b[:, 1] - a[:, 1]).astype(np.float32)
        crossing = (row - a[edge, 1]).astype(np.float32) * slope[edge] + a[edge, 0].astype(np.float32)
        order = np.lexsort((crossing, row))
        row, crossing = row[order], crossing[order].astype(np.float64)
        first, last = np.floor(crossing[::2] + 0.5), np.ceil(crossing[1::2] - 0.5)
        found.append((row[::2], first.astype(np.int64), last.astype(np.int64)))
    row, first, last = (np.concatenate(each) for each in zip(*found, strict=True))
    return row, first, last


def _merged(first: Places, last: Places) -> tuple[Places, Places]:
    """Runs in order, those that overlap made one."""
    order = np.argsort(first, kind="stable")
    first, furthest = first[order], np.maximum.accumulate(last[order]) if len(last) else last
    new = np.append(True, first[1:] > furthest[:-1] + 1)[: len(first)]
    starts = np.flatnonzero(new)
    return first[starts], furthest[np.append(starts[1:] - 1, len(first) - 1)[: len(starts)]]
