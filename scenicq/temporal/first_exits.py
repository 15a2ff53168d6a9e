"""The first place of many at which something no longer holds, for many first places at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["FirstExits", "next_at"]

Places = NDArray[np.int64]
Numbers = NDArray[np.float64]


def next_at(holds: NDArray[np.bool_]) -> Places:
    """For each place the first one from there at which something holds; the number of places where none does."""
    n = len(holds)
    places = np.where(holds, np.arange(n), n)
    return np.minimum.accumulate(places[::-1])[::-1]


@dataclass(eq=False, slots=True)
class FirstExits:
    """Between which values of a number something goes on, at each place: the first place that a range is not within.

    The greatest lower and the least upper end of 1, 2, 4, ... places that follow each other are at hand, so that a
    search takes as many steps as the logarithm of the places.

    Attributes:
        low, high: The ends at each place, both included, shape (n,).
        variable: The number of the variable.
    """

    low: Numbers
    high: Numbers
    variable: int
    _low: Numbers = field(init=False)
    _high: Numbers = field(init=False)
    _first: NDArray[np.int64] = field(init=False)

    @classmethod
    def between(cls, borders: Numbers, stays: Sequence[NDArray[np.bool_]], variable: int) -> FirstExits:
        """Exits from the ranges between borders in which something goes on.

        Where these are no one range, it is the lowest one that is not bounded from both sides, else the lowest of all.

        Args:
            borders: In ascending order at each place, shape (k, n); each belongs to the range above.
            stays: For each of the k + 1 ranges, whether it goes on, shape (n,).
            variable: The number of the variable.
        """
        ends = np.vstack([np.full((1, borders.shape[1]), -np.inf), borders, np.full((1, borders.shape[1]), np.inf)])
        count = len(stays)
        # what is empty is not in the way
        held: NDArray[np.bool_] = np.stack([each | (ends[k] == ends[k + 1]) for k, each in enumerate(stays)])
        prefix = np.logical_and.accumulate(held, axis=0).sum(axis=0)
        suffix = np.logical_and.accumulate(held[::-1], axis=0).sum(axis=0)
        first = np.where(prefix > 0, 0, count - suffix)
        end = np.where(prefix > 0, prefix, count)
        # else the first range in which it goes on
        inner = (prefix == 0) & (suffix == 0)
        first[inner] = np.argmax(held, axis=0)[inner]
        end[inner] = first[inner] + np.any(held, axis=0)[inner]
        at: Places = np.arange(len(borders[0]))
        none = first >= end
        low = np.where(none, np.inf, ends[np.minimum(first, count), at])
        high = np.where(end == count, np.inf, np.nextafter(ends[end, at], -np.inf))
        return cls(low, np.where(none, -np.inf, high), variable)

    def __post_init__(self) -> None:
        """Make the levels, the last place of each beyond all."""
        size = 1 << len(self.low).bit_length()
        low, high = np.full(size, np.inf), np.full(size, -np.inf)
        low[: len(self.low)], high[: len(self.low)] = self.low, self.high
        lows, highs, first = [low], [high], [0]
        while size > 1:
            first.append(first[-1] + size)
            lows.append(lows[-1].reshape(-1, 2).max(axis=1))
            highs.append(highs[-1].reshape(-1, 2).min(axis=1))
            size //= 2
        self._low, self._high, self._first = np.concatenate(lows), np.concatenate(highs), np.array(first)

    def first(self, at: Places, low: Numbers, high: Numbers) -> Places:
        """The first places from some on that ranges are not within; the number of places where there is none.

        Args:
            at: First places, shape (m,).
            low: Lower ends of the ranges, shape (m, variables).
            high: Upper ends.
        """
        low, high = low[:, self.variable], high[:, self.variable]
        place, level = at.copy(), np.zeros(len(at), np.int64)

        def outside(which: NDArray[np.int64]) -> NDArray[np.bool_]:
            number = self._first[level[which]] + place[which]
            return (self._low[number] > low[which]) | (self._high[number] < high[which])

        left = np.arange(len(at))
        while len(left):
            left = left[~outside(left)]
            place[left] += 1
            even = left[place[left] % 2 == 0]
            place[even] //= 2
            level[even] += 1
        left = np.flatnonzero(level > 0)
        while len(left):
            level[left] -= 1
            place[left] *= 2
            inside = left[~outside(left)]
            place[inside] += 1
            left = left[level[left] > 0]
        return place
