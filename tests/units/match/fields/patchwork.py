"""A field of tiles, and cars beside hidden points of it in one column, of which arithmetic knows where it can be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from comparisons import between, c

from scenicq.forest import build
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Constant, DirectionAt, Rotate, VectorOf, VectorSum
from scenicq.geometry.cell_guards import NearestSegment
from scenicq.geometry.fields import FieldCell

SIDE = 4.0
"""Metres."""
HEADINGS = (0.2, 0.9, 1.7, -0.7)
"""Of tiles: none is along an axis."""


@dataclass(frozen=True, eq=False)
class Patchwork:
    """Tiles in rows from the origin; over more than one of them it gives cells of four tiles, which cover too much."""

    tiles: np.ndarray
    name: str = "patchwork"

    def near(self, west, south, east, north, side=SIDE):
        """The squares of a side that meet a box: their corners."""
        columns, rows = (int(count * SIDE / side) for count in self.tiles.shape)
        return [
            (column * side, row * side)
            for column in range(columns)
            for row in range(rows)
            if column * side <= east and west <= (column + 1) * side
            if row * side <= north and south <= (row + 1) * side
        ]

    def at(self, x, y):
        return float(self.tiles[int(x / SIDE), int(y / SIDE)])

    def values(self, x, y):
        return tuple(dict.fromkeys(self.at(*corner) for corner in self.near(x, y, x, y)))

    def values_many(self, xy):
        return [self.values(*each) for each in xy.tolist()]

    def cells(self, bounds):
        west, south, east, north = bounds
        side = SIDE if max(east - west, north - south) < SIDE else 2 * SIDE
        found = []
        for x, y in self.near(*bounds, side):
            square = np.array([(x, y), (x + side, y), (x + side, y + side), (x, y + side)])
            inside = self.near(x + 0.1, y + 0.1, x + side - 0.1, y + side - 0.1)
            for heading in sorted({self.at(*each) for each in inside}):
                own = middles(each for each in inside if self.at(*each) == heading)
                rivals = middles(each for each in inside if self.at(*each) != heading)
                found.append(FieldCell(square, heading, (NearestSegment(own, rivals),) if len(rivals) else ()))
        return found

    def headings(self, boxes):
        pairs = [
            (number, heading)
            for number, each in enumerate(boxes.tolist())
            for heading in {self.at(*corner) for corner in self.near(*each)}
        ]
        return np.array([owner for owner, _ in pairs], dtype=np.intp), np.array([heading for _, heading in pairs])


def middles(corners):
    """The middles of tiles as segments of no length: a point lies in the tile whose middle is nearest."""
    return np.array([(x + SIDE / 2, y + SIDE / 2) * 2 for x, y in corners])


def patchwork(rng, count):
    """A field of so many tiles a side."""
    return Patchwork(np.array([[rng.choice(HEADINGS) for _ in range(count)] for _ in range(count)]))


@dataclass(frozen=True)
class Beside:
    """A car that is a few metres ahead of a hidden point, and faces about as the field does there.

    Attributes:
        field: The field.
        offset: The x coordinate of the point, less a number.
        number: Its number in the scenario.
        far: How far ahead it is at most, in metres.
    """

    field: Patchwork
    offset: float
    number: int
    far: float = 3.0

    def items(self, shared, seen):
        """What it compares with an observed (x, y, heading)."""
        point = VectorOf(build.add(shared, c(self.offset)), between(0.0, SIDE * len(self.field.tiles)))
        heading = DirectionAt(Constant(self.field), point)
        place = VectorSum(point, Rotate(VectorOf(c(0.0), between(1.0, self.far)), heading))
        facing = build.add(heading, between(-0.1, 0.1))
        return [
            (Comparison(self.number, "position", place, None), place, seen[:2]),
            (Comparison(self.number, "heading", facing, None), facing, seen[2]),
        ]

    def seen(self, value, rng):
        """What may be observed of it where the number has a value."""
        x, y, ahead = value + self.offset, rng.uniform(0.0, SIDE * len(self.field.tiles)), rng.uniform(1.0, self.far)
        heading = self.field.at(x, y)
        return x - ahead * math.sin(heading), y + ahead * math.cos(heading), heading + rng.uniform(-0.1, 0.1)

    def allowed(self, seen, slack):
        """The intervals of the number for which something may be observed, all limits being off by a slack."""
        x, y, facing = seen
        found = []
        for corner in self.field.near(-math.inf, -math.inf, math.inf, math.inf):
            heading = self.field.at(*corner)
            if abs(facing - heading) > 0.1 + slack:
                continue
            low, high = 1.0 - slack, self.far + slack
            for start, along, least in ((x, math.sin(heading), corner[0]), (y, -math.cos(heading), corner[1])):
                ends = sorted(((least - slack - start) / along, (least + SIDE + slack - start) / along))
                low, high = max(low, ends[0]), min(high, ends[1])
            if low <= high:
                ends = sorted(x + ahead * math.sin(heading) - self.offset for ahead in (low, high))
                found.append((ends[0] - max(slack, 0.0), ends[1] + max(slack, 0.0)))
        return found
