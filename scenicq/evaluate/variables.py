"""Random variables in arrays: draws of them, and their densities."""

from __future__ import annotations

import math
import random
from statistics import NormalDist
from typing import Any, assert_never, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import CannotEvaluate
from scenicq.evaluate.expression_arrays import points_of
from scenicq.forest.columns import Array, CodedValues, Data, PlacedRegions, Vectors, distances
from scenicq.forest.draws import draw_point
from scenicq.forest.nodes import (
    DiscAt,
    DiscreteRange,
    Identity,
    Index,
    Leaf,
    Normal,
    PointIn,
    Range,
    RectangleAt,
    SectorAt,
    TruncatedNormal,
    Undefined,
)
from scenicq.geometry.areas import area
from scenicq.geometry.membership import contains_many
from scenicq.geometry.regions import SLACK, Region

__all__ = ["Draws", "density_of", "point_density"]

_NORMAL = NormalDist()


class Draws:
    """Random draws that are the same for all labels and in every run.

    Attributes:
        count: How many.
    """

    def __init__(self, count: int, seed: int = 0) -> None:
        """Take how many draws, and what they begin with."""
        self.count = count
        self._rng = np.random.default_rng(seed)
        self._shares: dict[Identity, NDArray[np.float64]] = {}
        self._points: dict[Identity, Vectors] = {}
        self._seed = seed

    def _share(self, leaf: Leaf) -> NDArray[np.float64]:
        """Uniform numbers for a variable, two rows of shape (1, draws)."""
        if leaf.identity not in self._shares:
            # one in each part of like size, so that few draws tell much
            parts = np.stack([self._rng.permutation(self.count) for _ in range(2)])
            self._shares[leaf.identity] = (parts + self._rng.random((2, self.count))) / self.count
        return self._shares[leaf.identity][:, None, :]

    def draw(self, leaf: Leaf, args: tuple[Data, ...]) -> Data:
        """Values of a variable.

        Args:
            leaf: The variable.
            args: Values of its distribution's parameters.

        Raises:
            CannotEvaluate: It cannot be drawn in arrays.
        """
        given: tuple[Any, ...] = args
        match leaf:
            case Range():
                return given[0] + (given[1] - given[0]) * self._share(leaf)[0]
            case Normal():
                return given[0] + given[1] * _normal_quantile(self._share(leaf)[0])
            case TruncatedNormal():
                mean, deviation, low, high = (_single(arg) for arg in given)
                below, above = (_NORMAL.cdf((end - mean) / deviation) for end in (low, high))
                shares = below + (above - below) * self._share(leaf)[0]
                return np.clip(mean + deviation * _normal_quantile(np.clip(shares, 1e-300, 1 - 1e-16)), low, high)
            case DiscreteRange():
                low, high = np.ceil(given[0]), np.floor(given[1])
                return np.minimum(low + np.floor((high - low + 1) * self._share(leaf)[0]), high)
            case Index():
                sums = np.cumsum(np.array(leaf.weights, dtype=np.float64))
                found = cast(Array, np.searchsorted(sums, self._share(leaf)[0] * sums[-1], side="right"))
                return np.minimum(found, len(sums) - 1).astype(np.float64)
            case PointIn():
                return self._point(leaf, given[0])
            case _:
                assert_never(leaf)

    def _point(self, leaf: PointIn, region: Data) -> Data:
        if not isinstance(region, PlacedRegions):
            if leaf.identity not in self._points:
                self._points[leaf.identity] = self._points_of(region)
            return self._points[leaf.identity]
        first, second = self._share(leaf)
        (x, y), numbers = region.center, region.numbers
        match region.node:
            case DiscAt():
                away, turn = numbers[0] * np.sqrt(first), math.tau * second
            case SectorAt():
                away, turn = numbers[0] * np.sqrt(first), numbers[1] + numbers[2] * (second - 0.5)
            case RectangleAt():
                right, ahead = numbers[1] * (first - 0.5), numbers[2] * (second - 0.5)
                sine, cosine = np.sin(numbers[0]), np.cos(numbers[0])
                return x + cosine * right - sine * ahead, y + sine * right + cosine * ahead
        return x - away * np.sin(turn), y + away * np.cos(turn)

    def _points_of(self, regions: Data) -> Vectors:
        """Points of whichever region each draw has chosen."""
        if not isinstance(regions, CodedValues) or any(size > 1 for size in regions.which.shape[:-1]):
            raise CannotEvaluate("a point of a region that depends on the label")
        x, y = np.empty((1, self.count)), np.empty((1, self.count))
        which = np.broadcast_to(regions.which, (1, self.count))
        for number in cast("list[int]", np.unique(which).tolist()):
            mine = which == number
            found: Vectors = self._points_in(cast(Region, regions.options[number]), int(mine.sum()))
            x[mine], y[mine] = found[0][0], found[1][0]
        return x, y

    def _points_in(self, region: Region, count: int) -> Vectors:
        rng = random.Random(self._seed)
        draw = draw_point(region)
        points = [draw(rng) for _ in range(count)]
        if any(isinstance(point, Undefined) for point in points):
            raise CannotEvaluate("a point of an empty region")
        xy = np.array(points, dtype=np.float64).T
        return xy[0][None], xy[1][None]


def _single(values: Array) -> float:
    if values.size != 1:
        raise CannotEvaluate("a truncated normal with random parameters")
    return float(values.ravel()[0])


def _normal_quantile(shares: Array) -> Array:
    return np.array([_NORMAL.inv_cdf(share) for share in shares.ravel().tolist()]).reshape(shares.shape)


def density_of(leaf: Leaf, args: tuple[Data, ...], value: Array) -> Array:
    """The density of a random number at some values.

    Args:
        leaf: A variable with a density over numbers.
        args: Values of its distribution's parameters.
        value: Where.
    """
    given: tuple[Any, ...] = args
    with np.errstate(all="ignore"):
        match leaf:
            case Range():
                low, high = np.minimum(given[0], given[1]), np.maximum(given[0], given[1])
                return np.where((low <= value) & (value <= high), 1 / (high - low), 0.0)
            case Normal():
                return np.exp(-(((value - given[0]) / given[1]) ** 2) / 2) / (given[1] * math.sqrt(math.tau))
            case TruncatedNormal():
                mean, deviation, low, high = (_single(arg) for arg in given)
                mass = _NORMAL.cdf((high - mean) / deviation) - _NORMAL.cdf((low - mean) / deviation)
                bell = np.exp(-(((value - mean) / deviation) ** 2) / 2) / (deviation * math.sqrt(math.tau) * mass)
                return np.where((low <= value) & (value <= high), bell, 0.0)
            case _:
                raise CannotEvaluate("a variable without a density")


def point_density(region: Data, point: Vectors) -> Array:
    """The density of a uniform point of a region at some places.

    Raises:
        CannotEvaluate: The region has no area of its own, such as a line, or depends on what is hidden.
    """
    if isinstance(region, PlacedRegions):
        return np.where(distances(region, *point) <= SLACK, 1 / _area(region), 0.0)
    only = region.options[0] if isinstance(region, CodedValues) and len(region.options) == 1 else None
    if not isinstance(only, Region):
        raise CannotEvaluate("a random point in something that is not a region")
    measured = area(only)
    if not measured:
        raise CannotEvaluate("a point of a region without an area")
    xy, shape = points_of(point)
    return contains_many(only, xy).reshape(shape) / measured


def _area(region: PlacedRegions) -> Array:
    """Square metres."""
    numbers = region.numbers
    match region.node:
        case DiscAt():
            return math.pi * numbers[0] ** 2
        case SectorAt():
            return np.minimum(numbers[2], math.tau) * numbers[0] ** 2 / 2
        case RectangleAt():
            return numbers[1] * numbers[2]
