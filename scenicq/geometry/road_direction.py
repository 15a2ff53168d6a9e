"""The direction of traffic as a vector field (`roadDirection` of Scenic's driving domain).

At a point it is the direction of the nearest segment of the centreline of the lane that holds it. Where lanes overlap,
each gives a direction of its own: Scenic takes that of the first in its lists. On a shoulder it is the shoulder's. Off
all of these, the nearest lane within 20 m counts. What ties within a nanometre is all allowed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from shapely import LineString

from scenicq.geometry import shapes
from scenicq.geometry.cell_guards import OutsidePolygon
from scenicq.geometry.directed_areas import ONE_HEADING, TIE, AreaPairs, DirectedAreas, DirectedLane, distinct_pairs
from scenicq.geometry.direction_surroundings import OffLanes
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.shapes import Bounds, Coordinates, Shape

__all__ = ["ONE_HEADING", "DeferredDirection", "DirectedLane", "RoadDirection", "along_lines", "distinct_pairs"]

REACH = 20.0
"""Metres within which a point off all lanes takes the direction of the nearest one."""
_BESIDE = 0.01
"""Metres beside a polyline that count as on it."""
_CHUNK = 20_000
_WIDE = 3.0
"""Metres beside a centreline up to which most places of its lane lie."""


@dataclass(frozen=True, eq=False)
class RoadDirection:
    """The direction of traffic on some lanes; see the module.

    Attributes:
        lanes: The lanes; those without a segment have no direction and are passed over.
        name: What messages call the field.
        beside: What counts where no lane is.
        taken: Where that does not count either.
        elsewhere: Polylines whose nearest segment counts where there is none of both; if there are none, the nearest
            lane does.
        farthest: Metres within which it does.
        order: Gives the numbers of the lanes in the order in which they count where they overlap; asked once.
    """

    lanes: tuple[DirectedLane, ...] = field(repr=False)
    name: str = "roadDirection"
    beside: tuple[DirectedLane, ...] = field(default=(), repr=False, kw_only=True)
    taken: tuple[Shape, ...] = field(default=(), repr=False, kw_only=True)
    elsewhere: tuple[Coordinates, ...] = field(default=(), repr=False, kw_only=True)
    farthest: float = field(default=REACH, kw_only=True)
    order: Callable[[], Sequence[int]] | None = field(default=None, repr=False, kw_only=True)

    @property
    def is_nowhere(self) -> bool:
        """Whether nothing has a direction."""
        return not any(len(DirectedAreas((lane,))) for lane in (*self.lanes, *self.beside)) and not self.elsewhere

    @property
    def has_beside(self) -> bool:
        """Whether anything counts where no lane is."""
        return bool(self.beside)

    @property
    def reach(self) -> tuple[Sequence[Shape], float] | None:
        """The lanes that have a direction, and how far around them there is a heading, in metres."""
        return None if len(self._elsewhere) else ([area for area, _ in self._lanes.directed], self.farthest)

    def values(self, x: float, y: float) -> tuple[float, ...]:
        """The headings allowed at a point, in (-pi, pi], Scenic's first; none where the field is undefined."""
        # most places, one at a time: a third of the time
        alone = self._lanes.alone(x, y)
        return self._values(np.array([(x, y)], dtype=float))[0] if alone is None else alone

    def values_many(self, xy: Coordinates) -> list[tuple[float, ...]]:
        """`values` for points of shape (n, 2)."""
        return [value for start in range(0, len(xy), _CHUNK) for value in self._values(xy[start : start + _CHUNK])]

    def forward(self, line: LineString) -> LineString:
        """The line, turned around if most of it runs against the traffic beside it."""
        corners = shapes.coordinates(line)
        along, middle = corners[1:] - corners[:-1], (corners[1:] + corners[:-1]) / 2
        agreement = 0.0
        for (dx, dy), headings in zip(along.tolist(), self.values_many(middle), strict=True):
            if len(headings) == 1:
                agreement += dy * math.cos(headings[0]) - dx * math.sin(headings[0])
        return line if agreement >= 0 else line.reverse()

    def headings(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (box, heading) that hold every heading somewhere in each of some boxes, see `VectorField`."""
        found = [(np.empty(0, dtype=np.intp), np.empty(0))]
        for start in range(0, len(boxes), _CHUNK):
            owner, heading = self._headings(boxes[start : start + _CHUNK])
            found.append((owner + start, heading))
        return np.concatenate([owner for owner, _ in found]), np.concatenate([heading for _, heading in found])

    def steps_to(
        self, xy: Coordinates, steps: Coordinates
    ) -> tuple[NDArray[np.intp], NDArray[np.float64], Coordinates]:
        """Where a step along a lane may have led to some places, see `DirectedAreas`; not all of these lead there."""
        return self._lanes.steps_to(xy, steps, _WIDE)

    def cells(self, bounds: Bounds) -> list[FieldCell]:
        """Convex cells that hold every (point, heading) within the bounds; those of lanes stay whole."""
        return self._cells_near(bounds, None)

    def cells_of(self, heading: float, bounds: Bounds) -> list[FieldCell]:
        """Those of one heading, and perhaps others off the lanes: cells of other segments need not be made."""
        return self._cells_near(bounds, heading)

    def _cells_near(self, bounds: Bounds, heading: float | None) -> list[FieldCell]:
        box = shapes.box(*bounds)
        found: list[FieldCell] = []
        for lane in np.sort(shapes.tree_query(self._lanes.tree, box)).tolist():
            found += self._lanes.cells(lane, bounds, heading)
        numbers: list[int] = np.sort(shapes.tree_query(self._beside.tree, box)).tolist()
        for number in numbers:
            for cell in self._beside.cells(number, bounds, heading):
                part = FieldCell(cell.polygon, cell.heading, (*cell.guards, *self._off_lanes(number))).part(bounds)
                found += [part] if part is not None else []
        return found + self._surroundings.cells(bounds)

    def _off_lanes(self, number: int) -> tuple[OutsidePolygon, ...]:
        """The lanes that meet one of what is beside them, where it does not count."""
        if number not in self._met:
            own = self._beside.directed[number][0]
            meeting: list[int] = np.sort(shapes.tree_within(self._lanes.tree, own, 0.0)).tolist()
            self._met[number] = tuple(OutsidePolygon(self._lanes.directed[lane][0]) for lane in meeting)
        return self._met[number]

    @cached_property
    def _met(self) -> dict[int, tuple[OutsidePolygon, ...]]:
        return {}

    @cached_property
    def _lanes(self) -> DirectedAreas:
        return DirectedAreas(
            self.lanes if self.order is None else tuple([self.lanes[number] for number in self.order()])
        )

    @cached_property
    def _beside(self) -> DirectedAreas:
        return DirectedAreas(self.beside, self.taken)

    @cached_property
    def _elsewhere(self) -> DirectedAreas:
        """The line that counts elsewhere, with an area that nothing asks for."""
        area = shapes.box(0.0, 0.0, 1.0, 1.0)
        return DirectedAreas((DirectedLane(area, self.elsewhere),) if self.elsewhere else ())

    def first(self, x: float, y: float) -> float | None:
        """The heading of the first of the nearest segments of the first area that counts at a point, as in Scenic."""
        heading = self._pairs(np.array([(x, y)], dtype=float))[1]
        return float(heading[0]) if len(heading) else None

    def _values(self, xy: Coordinates) -> list[tuple[float, ...]]:
        owner, heading = self._pairs(xy)
        order = np.argsort(owner, kind="stable")
        values: list[float] = heading[order].tolist()
        ends: list[int] = np.searchsorted(owner[order], np.arange(len(xy) + 1)).tolist()
        return [tuple(dict.fromkeys(values[first:end])) for first, end in pairwise(ends)]

    def _pairs(self, xy: Coordinates) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (point, heading), for each point in the order of areas and their segments."""
        owners, headings = [np.empty(0, dtype=np.intp)], [np.empty(0)]
        left = np.arange(len(xy))
        for areas in (self._lanes, self._beside):
            point, area = areas.within(xy[left], np.full(len(left), TIE))
            owner, heading = areas.headings_of(xy[left], (point, area))
            owners.append(left[owner])
            headings.append(heading)
            left = left[np.bincount(point, minlength=len(left)) == 0]
        areas, pairs = self._off_all(xy[left], np.zeros(len(left)))
        owner, heading = areas.headings_of(xy[left], pairs)
        return np.concatenate([*owners, left[owner]]), np.concatenate([*headings, heading])

    def _off_all(self, xy: Coordinates, radius: NDArray[np.float64]) -> tuple[DirectedAreas, AreaPairs]:
        """What counts at points off lanes and what is beside them, or within a radius (n,) of such points."""
        if len(self._elsewhere):
            return self._elsewhere, (np.arange(len(xy)), np.zeros(len(xy), dtype=np.intp))
        return self._lanes, self._lanes.nearest(xy, self.farthest, radius)

    def _headings(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        middle = (boxes[:, :2] + boxes[:, 2:]) / 2
        radius = np.hypot(*(boxes[:, 2:] - boxes[:, :2]).T) / 2 + TIE
        # inside of a lane only those that reach in can count, elsewhere those that may be the nearest
        pairs = self._lanes.within(middle, radius)
        left = np.nonzero(~self._lanes.covering(boxes, pairs))[0]
        found = [self._lanes.headings_around(middle, pairs, radius)]
        if len(left) and len(self._beside):
            pairs = self._beside.within(middle[left], radius[left])
            owner, heading = self._beside.headings_around(middle[left], pairs, radius[left])
            found.append((left[owner], heading))
            left = left[~self._beside.covering(boxes[left], pairs)]
        if len(left):
            areas, pairs = self._off_all(middle[left], radius[left])
            owner, heading = areas.headings_around(middle[left], pairs, radius[left])
            found.append((left[owner], heading))
        if len(found) == 1:
            return found[0]
        return distinct_pairs(np.concatenate([each for each, _ in found]), np.concatenate([each for _, each in found]))

    @cached_property
    def _surroundings(self) -> OffLanes:
        return OffLanes(self._lanes, self._beside, self._elsewhere, self.farthest)


class DeferredDirection(RoadDirection):
    """A direction of traffic whose lanes are read when somebody asks for them."""

    def __init__(
        self,
        name: str,
        make: Callable[[], RoadDirection],
        *,
        nowhere: bool | None,
        has_beside: bool,
        farthest: float = REACH,
    ) -> None:
        """Take what can be said before.

        Args:
            name: What messages call the field.
            make: What makes it.
            nowhere: Whether nothing has a direction; None where that must be read, too.
            has_beside: Whether anything counts where no lane is.
            farthest: As of `RoadDirection`.
        """
        vars(self).update(name=name, farthest=farthest, _make=make, _nowhere=nowhere, _has_beside=has_beside)

    @cached_property
    def _made(self) -> RoadDirection:
        return vars(self)["_make"]()

    @property
    def is_nowhere(self) -> bool:
        """Whether nothing has a direction."""
        nowhere: bool | None = vars(self)["_nowhere"]
        return self._made.is_nowhere if nowhere is None else nowhere

    @property
    def has_beside(self) -> bool:
        """Whether anything counts where no lane is."""
        return vars(self)["_has_beside"]

    @property
    def lanes(self) -> tuple[DirectedLane, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The lanes."""
        return self._made.lanes

    @property
    def beside(self) -> tuple[DirectedLane, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """What counts where no lane is."""
        return self._made.beside

    @property
    def taken(self) -> tuple[Shape, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Where that does not count either."""
        return self._made.taken

    @property
    def elsewhere(self) -> tuple[Coordinates, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """What counts where there is none of both."""
        return self._made.elsewhere

    @property
    def order(self) -> Callable[[], Sequence[int]] | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Gives the order in which lanes count."""
        return self._made.order


def along_lines(lines: Sequence[Shape], name: str) -> RoadDirection:
    """The field that follows polylines: at a point the direction of the nearest segment."""
    parts = shapes.simple_parts(lines)
    bands = tuple(DirectedLane(shapes.band(part, _BESIDE), (shapes.coordinates(part),)) for part in parts)
    return RoadDirection(bands, name=name)
