"""Values of random variables as coordinates that a search can move: numbers as they are, points by their place.

Whatever the coordinates are, the value lies in the support of the variable: numbers are cut to the ends that they have
there, points go to the nearest of their region. So a search may step anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.columns import (
    DEFINED,
    UNDEFINED,
    Array,
    CodedValues,
    Column,
    ColumnPlaces,
    common_status,
    value_reader,
)
from scenicq.forest.nodes import DiscreteRange, Index, Leaf, Normal, PointIn, Range, TruncatedNormal, Undefined, Value
from scenicq.geometry.projection import nearest_points
from scenicq.geometry.regions import Region
from scenicq.match.fields.interval_domain import Enclosure

__all__ = ["HiddenValue"]


@dataclass(frozen=True, eq=False)
class HiddenValue:
    """A random variable with the coordinates that it has in a search.

    Attributes:
        leaf: The random variable.
        rows: Its rows in the array of all coordinates: one for a number, two for a point.
        low, high: Ends of each coordinate, (k, 1).
    """

    leaf: Leaf
    rows: slice
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @classmethod
    def within(cls, leaf: Leaf, first: int, limits: Enclosure) -> HiddenValue:
        """A variable that lies between the ends (2,) or corners (2, 2: axis, end); its coordinates begin at a row."""
        low, high = limits.reshape(-1, 2).T[..., None]
        return cls(leaf, slice(first, first + len(low)), low, high)

    @property
    def is_whole(self) -> bool:
        """Whether only whole numbers count."""
        return isinstance(self.leaf, Index | DiscreteRange)

    def draw(self, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Draw coordinates evenly between the ends, (k, count); an infinite end becomes one not far from zero."""
        low = np.where(np.isfinite(self.low), self.low, np.minimum(self.high, _FAR) - 2 * _FAR)
        high = np.where(np.isfinite(self.high), self.high, np.maximum(low, -_FAR) + 2 * _FAR)
        return low + rng.random((len(low), count)) * (high - low + self.is_whole) - 0.5 * self.is_whole

    def column(self, args: Sequence[Column], place: NDArray[np.float64]) -> Column:
        """The values at coordinates (k, n).

        Args:
            args: The parameters of its distribution.
            place: The coordinates.
        """
        if isinstance(self.leaf, PointIn):
            return self._points(args[0], np.clip(place, self.low, self.high))
        own = cast(NDArray[np.float64], np.round(place[0])) if self.is_whole else place[0]
        numbers = np.clip(own, self.low[0], self.high[0])
        status = np.full(1, DEFINED)
        match self.leaf:
            case Range() | TruncatedNormal() | DiscreteRange():
                ends = [cast(Array, arg.data) for arg in args[-2:]]
                numbers = np.clip(numbers, np.minimum(ends[0], ends[1]), np.maximum(ends[0], ends[1]))
                status = common_status(args)
            case Normal():
                status = common_status(args)
            case _:
                pass
        return Column(numbers, status)

    def _points(self, region: Column, place: NDArray[np.float64]) -> Column:
        """The points nearest to places (2, n) in a region, which may differ from draw to draw."""
        places = ColumnPlaces((region, Column((place[0], place[1]), np.full(1, DEFINED))))
        xy = np.full((places.count, 2), np.nan)
        near = (float(self.low[0, 0]), float(self.low[1, 0]), float(self.high[0, 0]), float(self.high[1, 0]))
        wanted = np.broadcast_to(place.T, xy.shape)
        if isinstance(region.data, CodedValues):
            which: NDArray[np.intp] = places.spread(region.data.which)[places.defined]
            options: list[int] = np.unique(which).tolist()
            for option in options:
                mine = places.defined[which == option]
                xy[mine] = _nearest(region.data.options[option], wanted[mine], near)
        else:
            read = value_reader(region.data, places.shape)
            for each in places.defined.tolist():
                xy[each] = _nearest(read(each), wanted[[each]], near)
        lost = np.isnan(xy[:, 0])
        return Column((xy[:, 0], xy[:, 1]), np.where(lost, UNDEFINED, DEFINED))


def _nearest(region: Value, xy: NDArray[np.float64], near: tuple[float, float, float, float]) -> NDArray[np.float64]:
    if region is None or isinstance(region, Undefined):
        return np.full(xy.shape, np.nan)
    return nearest_points(cast(Region, region), xy, near)


_FAR = 100.0
"""How far from zero an unbounded number is drawn, in its own unit."""
