"""The direction of traffic as it counts on the way, where a program follows it in steps.

A step of forward Euler may end beside a bend. `RoadDirection` has the direction of the nearest lane there; the original
implementation goes on towards heading 0, the value of its field off the road. Either is allowed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree

from scenicq.budget import look
from scenicq.geometry import shapes
from scenicq.geometry.angles import rotate_array
from scenicq.geometry.cells import convex_parts
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.road_direction import ONE_HEADING, RoadDirection, distinct_pairs
from scenicq.geometry.shapes import Bounds, Coordinates, Shape
from scenicq.limits import LIMITS

__all__ = ["OFF_ROAD", "FollowedDirection"]

OFF_ROAD = 0.0
"""The heading, besides that of the nearest lane, off everything that belongs to the road."""
_BESIDE = 0.05
"""Metres beside the road that count as on it, as in the original implementation."""
_TILE = 32.0
"""Metres: sides of the squares of which each is cut once."""

_Tile = tuple[int, int]


@dataclass(frozen=True, eq=False)
class FollowedDirection(RoadDirection):
    """A direction of traffic with the heading 0 besides off the road; see the module.

    Attributes:
        base: The direction of traffic itself.
        paved: What belongs to the road: polygons that may overlap.
    """

    base: RoadDirection = field(kw_only=True, repr=False)
    paved: tuple[Shape, ...] = field(kw_only=True, repr=False)

    def values(self, x: float, y: float) -> tuple[float, ...]:
        """The headings allowed at a point."""
        return self.values_many(np.array([(x, y)], dtype=float))[0]

    def values_many(self, xy: Coordinates) -> list[tuple[float, ...]]:
        """`values` for points of shape (n, 2)."""
        found = self.base.values_many(xy)
        off: list[int] = self._partly_off(np.concatenate([xy, xy], axis=1)).tolist()
        for index in off:
            found[index] = tuple(dict.fromkeys((OFF_ROAD, *found[index])))
        return found

    def headings(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (box, heading) that hold every heading somewhere in each of some boxes, see `VectorField`."""
        owner, heading = self.base.headings(boxes)
        off = self._partly_off(boxes)
        return distinct_pairs(np.concatenate([owner, off]), np.concatenate([heading, np.full(len(off), OFF_ROAD)]))

    def steps_to(
        self, xy: Coordinates, steps: Coordinates
    ) -> tuple[NDArray[np.intp], NDArray[np.float64], Coordinates]:
        """Where a step may have led to some places, see `RoadDirection`, also off the road."""
        place, heading, back = self.base.steps_to(xy, steps)
        off = xy - rotate_array(steps, np.full(len(xy), OFF_ROAD))
        free = self._partly_off(np.concatenate([off, off], axis=1))
        return (
            np.concatenate([place, free]),
            np.concatenate([heading, np.full(len(free), OFF_ROAD)]),
            np.concatenate([back, off[free]]),
        )

    def cells(self, bounds: Bounds) -> list[FieldCell]:
        """Convex cells that hold every (point, heading) within the bounds; those of lanes and tiles stay whole."""
        return [*self.base.cells(bounds), *self._off_cells(bounds)]

    def cells_of(self, heading: float, bounds: Bounds) -> list[FieldCell]:
        """Those of one heading, and perhaps others off the lanes."""
        off = self._off_cells(bounds) if abs(heading - OFF_ROAD) <= ONE_HEADING else []
        return [*self.base.cells_of(heading, bounds), *off]

    def _off_cells(self, bounds: Bounds) -> list[FieldCell]:
        return [cell for tile in _tiles(bounds) for cell in self._cells_in(tile)]

    def _partly_off(self, boxes: NDArray[np.float64]) -> NDArray[np.intp]:
        """Which of some boxes may hold a point off the road."""
        west, south, east, north = np.floor(boxes / _TILE).T
        large = (east - west + 1) * (north - south + 1) > LIMITS.off_road_tiles
        off = large.copy()
        small, left = np.nonzero(~large)[0], ~large
        # most boxes lie within one road or one intersection
        whole = shapes.boxes(boxes[small])
        held, within = shapes.tree_pairs(self._paved_tree, whole)
        inside = shapes.covers_many(self._paved[within], whole[held])
        left[small[held[inside]]] = False
        todo = np.nonzero(left)[0]
        if len(todo):
            rest = boxes[todo]
            free, _ = shapes.tree_pairs_within(self._free_tree(rest), shapes.boxes(rest), 0.0)
            off[todo[free]] = True
        return np.nonzero(off)[0]

    def _free_tree(self, boxes: NDArray[np.float64]) -> STRtree:
        """What was found off the road so far, at least in all tiles that some boxes meet."""
        ends = np.unique(np.floor(boxes / _TILE).astype(np.intp), axis=0)
        tiles = {
            (column, row)
            for west, south, east, north in ends.tolist()
            for column in range(west, east + 1)
            for row in range(south, north + 1)
        }
        if not tiles <= self._free.keys() or "tree" not in self._found:
            for tile in sorted(tiles):
                self._free_in(tile)
            self._found["tree"] = STRtree(shapes.array([part for parts in self._free.values() for part in parts]))
        return self._found["tree"]

    @cached_property
    def _found(self) -> dict[str, STRtree]:
        return {}

    @cached_property
    def _paved(self) -> NDArray[np.object_]:
        return shapes.prepare(self.paved)

    @cached_property
    def _paved_tree(self) -> STRtree:
        return STRtree(self._paved)

    @cached_property
    def _free(self) -> dict[_Tile, tuple[Shape, ...]]:
        """The parts off the road of each tile that was asked for."""
        return {}

    def _free_in(self, tile: _Tile) -> tuple[Shape, ...]:
        found = self._free.get(tile)
        if found is None:
            look()
            column, row = tile
            square = shapes.box(column * _TILE, row * _TILE, (column + 1) * _TILE, (row + 1) * _TILE)
            near: list[int] = np.sort(shapes.tree_within(self._paved_tree, square, _BESIDE)).tolist()
            road = shapes.band(shapes.union_all([self.paved[index] for index in near]), _BESIDE)
            rest = shapes.difference(square, road)
            found = self._free[tile] = shapes.polygonal_part(rest)
        return found

    @cached_property
    def _cells_by_tile(self) -> dict[_Tile, list[FieldCell]]:
        return {}

    def _cells_in(self, tile: _Tile) -> list[FieldCell]:
        found = self._cells_by_tile.get(tile)
        if found is None:
            parts = [part for area in self._free_in(tile) for part in convex_parts(area)]
            found = self._cells_by_tile[tile] = [FieldCell(part, OFF_ROAD) for part in parts]
        return found


def _tiles(bounds: Bounds) -> list[_Tile]:
    west, south, east, north = (math.floor(end / _TILE) for end in bounds)
    return [(column, row) for column in range(west, east + 1) for row in range(south, north + 1)]
