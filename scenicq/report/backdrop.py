"""The map under a picture: areas by kind, and marks that point along the direction of traffic."""

# shapely has no type annotations.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from shapely import STRtree

from scenicq.geometry.angles import heading_of_array
from scenicq.geometry.network import Network
from scenicq.geometry.shapes import Bounds, Coordinates, Shape, array, line, tree_query
from scenicq.report.svg import Plane, area_path, element, line_path

__all__ = ["Backdrop"]

_KINDS = ("drivable", "road", "lane", "shoulder", "sidewalk", "intersection", "crossing")
"""Kinds with an area, from the bottom to the top; all others that are no lines lie below."""
_GROUPING = frozenset({"lane_group", "lane_section", "road_section"})
"""Kinds that only repeat the areas of others."""
_DETAIL = 0.05
"""Metres by which a simplified outline may be off."""
_APART = 12.0
"""Metres between marks of direction."""
_CLEAR = 2.5
"""Metres across the squares that have one mark at most: less than from one lane to the next."""
_MARK = np.array([(-0.55, -0.45), (0.0, 0.45), (0.55, -0.45)])
"""A mark: metres to the right and ahead."""


@dataclass(eq=False)
class Backdrop:
    """A map, made ready to be drawn piece by piece.

    Attributes:
        network: The map.
    """

    network: Network
    _drawn: dict[str, tuple[list[Shape], STRtree]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Sort the elements by kind."""
        found: dict[str, list[Shape]] = {}
        for feature in self.network.features:
            if feature.kind not in _GROUPING:
                found.setdefault(feature.kind, []).append(feature.shape)
        self._drawn = {}
        for kind, shapes in found.items():
            simple: list[Shape] = shapely.simplify(array(shapes), _DETAIL).tolist()
            self._drawn[kind] = (simple, STRtree(simple))

    @cached_property
    def _marks(self) -> Coordinates:
        """Position and heading of each mark, shape (n, 3)."""
        rows: list[Coordinates] = [np.empty((0, 3))]
        for lane in self.network.roadDirection.lanes:
            rows += map(_along, lane.centerline)
        found = np.concatenate(rows)
        # where lanes cross or part, marks over marks cannot be read
        _, first = np.unique(np.floor(found[:, :2] / _CLEAR), axis=0, return_index=True)
        return found[np.sort(first)]

    def draw(self, plane: Plane, bounds: Bounds) -> str:
        """The part of the map within bounds (metres), as one group.

        Args:
            plane: Where the picture lies on the map.
            bounds: What is drawn; all geometry is cut to it.
        """
        others = sorted(self._drawn.keys() - set(_KINDS))
        parts: list[str] = []
        for kind in (*others, *_KINDS):
            near = self._near(kind, bounds)
            if near:
                area, lines = area_path(near, plane), line_path(near, plane)
                shown = kind if kind in _KINDS or kind == "curb" else "area"
                parts += [element("path", class_=shown, d=area)] if area else []
                parts += [element("path", class_=f"{shown} line", d=lines)] if lines else []
        marks = self._marks_within(plane, bounds)
        parts += [element("path", class_="direction", d=marks)] if marks else []
        return element("g", *parts, class_="map")

    def _near(self, kind: str, bounds: Bounds) -> list[Shape]:
        if kind not in self._drawn:
            return []
        shapes, tree = self._drawn[kind]
        found = [shapes[index] for index in np.sort(tree_query(tree, shapely.box(*bounds))).tolist()]
        cut: list[Shape] = shapely.clip_by_rect(array(found), *bounds).tolist()
        return [shape for shape in cut if not shape.is_empty]

    def _marks_within(self, plane: Plane, bounds: Bounds) -> str:
        west, south, east, north = bounds
        x, y, heading = self._marks.T
        inside = self._marks[(x > west) & (x < east) & (y > south) & (y < north)]
        if not len(inside):
            return ""
        heading = inside[:, 2, None]
        right, ahead = _MARK.T
        corners = np.stack(
            [
                inside[:, 0, None] + right * np.cos(heading) - ahead * np.sin(heading),
                inside[:, 1, None] + right * np.sin(heading) + ahead * np.cos(heading),
            ],
            axis=2,
        )
        return line_path([line(each) for each in corners], plane)


def _along(line: Coordinates) -> Coordinates:
    """Marks along a polyline, evenly spaced, the first half a space from its start."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    ends = np.cumsum(lengths)
    if not len(ends) or ends[-1] < _APART / 3:
        return np.empty((0, 3))
    count = max(1, int(ends[-1] / _APART))
    away = (np.arange(count) + 0.5) * ends[-1] / count
    segment = np.minimum(np.searchsorted(ends, away), len(ends) - 1)
    share = (away - (ends - lengths)[segment]) / np.maximum(lengths[segment], 1e-9)
    at = line[:-1][segment] + share[:, None] * steps[segment]
    return np.column_stack([at, heading_of_array(steps[segment, 0], steps[segment, 1])])
