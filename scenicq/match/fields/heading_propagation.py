"""Which way fields point at hidden points: ranges of headings that narrow with the places, and are parted where not.

Where a point can be bounds the headings of its field, and these bound where the points are that hang on it. So on a
bend of many short segments few directions have to be tried: mostly they follow from one another. What does not follow
is parted, first into ranges of headings close to each other, at last into single ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import Exhausted
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Index, Leaf, Node, PointIn
from scenicq.forest.walk import leaves
from scenicq.geometry import shapes
from scenicq.geometry.fields import VectorField
from scenicq.geometry.occupancy import ElementAtPoint
from scenicq.geometry.proximity import meets_many
from scenicq.geometry.regions import Region
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.fields.cell_assignment import MARGIN, SAME
from scenicq.match.fields.contractor import BoxSet

__all__ = ["DirectedCases", "KnownCases", "bisect_cases", "branch", "propagate", "split_by_direction"]

_AT_ONCE = 256
"""Cases that are narrowed together: what one of them finds may make the others needless."""
_FAR = 60.0
"""Metres: where a point may be farther about than this, a number that it hangs on is divided before directions are."""
_WORTH = 0.8
"""A share of the range of headings, or of the place of a point, above which nothing is gained by looking again."""
_POINT = 1.5e-9
"""Radians that the headings of one direction may be apart, being rounded."""
_PIECES = 4
"""Ranges into which the headings of a bend are parted."""
_LONG = 1.0
"""Width of a range of numbers that is divided before directions are, where these are many."""


def split_by_direction(start: BoxSet, soon: float = math.inf) -> Iterator[BoxSet]:
    """The cases in which every field has one direction and something is left, those found first at once.

    Args:
        start: One case or more.
        soon: After how many cases an empty set says that it takes long, and again after four times as many.

    Raises:
        Exhausted: There are too many cases.
    """
    todo, seen = [start], 0
    while todo:
        cases = todo.pop()
        if seen <= soon < seen + cases.size:
            yield cases.take(np.arange(0))
            soon *= 4
        seen += cases.size
        if seen > LIMITS.heading_cases:
            raise limit_exceeded("heading_cases")
        cases = propagate(cases)
        if not cases.size:
            continue
        parts = _parted(cases)
        if parts is None:
            yield cases
        else:
            todo += parts


class DirectedCases:
    """What `split_by_direction` finds, looked for once, whoever goes through it and however often."""

    def __init__(self, start: BoxSet, soon: float) -> None:
        """Take what `split_by_direction` takes."""
        self._more = split_by_direction(start, soon)
        self._found: list[BoxSet] = []
        self._error: Exhausted | None = None

    def __iter__(self) -> Iterator[BoxSet]:
        """The cases; an empty set where those to come take long.

        Raises:
            Exhausted: There are too many cases.
        """
        number = 0
        while True:
            if number < len(self._found):
                number += 1
                yield self._found[number - 1]
                continue
            if self._error is not None:
                raise self._error
            try:
                cases = next(self._more)
            except StopIteration:
                return
            except Exhausted as error:
                self._error = error
                raise
            if cases.size:
                self._found.append(cases)
            else:
                yield cases


KnownCases: TypeAlias = dict[tuple[object, ...], DirectedCases]
"""Cases that were looked for already, by what they are cases of."""


def propagate(cases: BoxSet) -> BoxSet:
    """The cases of which something is left, narrowed until places and headings do not narrow each other any more."""
    for _ in range(LIMITS.heading_passes):
        cases = _placed(cases.narrowed())
        gained = False
        for node in cases.network.choices:
            if isinstance(node, DirectionAt) and cases.size:
                cases, less = _turned(cases, node)
                gained = gained or less
        if not gained or not cases.size:
            break
    return cases


def bisect_cases(cases: BoxSet, below: Sequence[Leaf]) -> list[BoxSet]:
    """The cases with the widest range of a number, or of a coordinate of a point, halved.

    Args:
        cases: The cases.
        below: The random variables that come into question.

    Raises:
        Exhausted: There is none.
    """
    found = _widest(cases, below)
    if found is None or found[0] <= LIMITS.heading_width:
        raise limit_exceeded("heading_width")
    return _halves(cases, *found[1:])


def branch(cases: BoxSet) -> Iterable[BoxSet]:
    """The cases in parts, each made when it is asked for: by a choice that is left to make, else by the widest range.

    Raises:
        Exhausted: They are too small for either.
    """
    parts = _parted(cases)
    return bisect_cases(cases, [*cases.network.leaves.values()]) if parts is None else parts


def _widest(cases: BoxSet, below: Sequence[Leaf]) -> tuple[float, Identity, int] | None:
    """The widest finite range, the random variable and the axis."""
    widest: tuple[float, Identity, int] | None = None
    for leaf in below:
        limits = cases.ranges[leaf.identity].reshape(-1, 2, cases.size)
        for axis, (low, high) in enumerate(limits):
            width = float((high - low).max())
            if not isinstance(leaf, Index) and width < math.inf and (widest is None or width > widest[0]):
                widest = width, leaf.identity, axis
    return widest


def _halves(cases: BoxSet, identity: Identity, axis: int) -> list[BoxSet]:
    """The cases over either half of a range."""
    found: list[BoxSet] = []
    half = max(_AT_ONCE // 2, 1)
    for first in range(0, cases.size, half):
        some = np.arange(first, min(first + half, cases.size))
        parts = cases.take(np.tile(some, 2))
        ends = parts.ranges[identity].reshape(-1, 2, parts.size)[axis]
        middle = ends.mean(axis=0)
        ends[1, : len(some)], ends[0, len(some) :] = middle[: len(some)], middle[len(some) :]
        found.append(parts)
    return found


def _placed(cases: BoxSet) -> BoxSet:
    """The cases in which random points can lie in their regions, of which narrowing knows the bounds alone."""
    for identity, leaf in cases.network.leaves.items():
        region = leaf.region.value if isinstance(leaf, PointIn) and isinstance(leaf.region, Constant) else None
        if not (isinstance(region, Region) and cases.size):
            continue
        place = cases.ranges[identity]
        size = np.hypot(*(place[:, 1] - place[:, 0]))
        before = cases.asked.get(id(identity), np.full(cases.size, np.inf))
        if not np.isfinite(size).all() or (size > _WORTH * before).all():
            continue
        boxes = np.concatenate([place[:, 0] - MARGIN, place[:, 1] + MARGIN]).T
        held = meets_many(region, shapes.boxes(boxes), np.zeros(cases.size))
        cases = cases.take(np.nonzero(held)[0])
        cases.asked[id(identity)] = size[held]
    return cases


def _turned(cases: BoxSet, node: DirectionAt) -> tuple[BoxSet, bool]:
    """The cases in which a field has a heading, its range the least that holds them all; whether that narrowed any."""
    size = _extent(cases, node)
    before = cases.asked.get(id(node), np.full(cases.size, np.inf))
    less = np.nonzero(size <= _WORTH * before)[0]
    if size.max() > _FAR or not len(less):
        return cases, False
    owner, heading = _headings(cases, node, less)
    known = cases.chosen.get(id(node), np.broadcast_to([[-np.inf], [np.inf]], (2, cases.size)))
    found = known.copy()
    found[0, less], found[1, less] = np.inf, -np.inf
    np.minimum.at(found[0], owner, heading)
    np.maximum.at(found[1], owner, heading)
    gained = bool((np.ptp(found, axis=0) < _WORTH * np.ptp(known, axis=0) - _POINT).any())
    cases = cases.take(np.arange(cases.size))
    cases.chosen[id(node)], cases.asked[id(node)] = found, np.where(size <= _WORTH * before, size, before)
    return cases.those(found[0] <= found[1]), gained


def _parted(cases: BoxSet) -> Iterable[BoxSet] | None:
    """The cases with one more choice made; None if there is none left to make."""
    for node in cases.network.choices:
        if isinstance(node, Index) and id(node) not in cases.chosen:
            count = len(node.weights)
            options = np.tile(np.arange(count, dtype=float), cases.size)
            return _split(cases, node, np.repeat(np.arange(cases.size), count), options)
    vague = [node for node in cases.network.choices if isinstance(node, DirectionAt) and _is_vague(cases, node)]
    if not vague:
        return None
    sizes = {id(node): float(_extent(cases, node).max()) for node in vague}
    node = min(vague, key=lambda node: sizes[id(node)])  # where least of the map comes into question
    if sizes[id(node)] > _FAR:
        return bisect_cases(cases, leaves(node))
    owner, ranges = _pieces(cases, node)
    if len(owner) > 2 * cases.size:
        # over less of the way that random numbers allow there are fewer directions
        found = _widest(cases, [leaf for leaf in leaves(node) if not isinstance(leaf, PointIn)])
        if found is not None and found[0] > _LONG:
            return _halves(cases, *found[1:])
    return _split(cases, node, owner, ranges)


def _is_vague(cases: BoxSet, node: DirectionAt) -> bool:
    known = cases.chosen.get(id(node))
    return known is None or bool((known[1] - known[0] > _POINT).any())


def _extent(cases: BoxSet, node: DirectionAt) -> NDArray[np.float64]:
    """The diagonals of the boxes in which the point of a field can be, (n,)."""
    place = cases.place(node)
    return np.hypot(*(place[:, 1] - place[:, 0]))


def _headings(cases: BoxSet, node: DirectionAt, some: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Pairs (case, heading) of some cases: all that a field may have where its point can be, if it is not excluded."""
    place = cases.place(node)[..., some]
    boxes = np.concatenate([place[:, 0] - MARGIN, place[:, 1] + MARGIN]).T
    owner, heading = cast(VectorField, cast(Constant, node.field).value).headings(boxes)
    owner = some[owner]
    low, high = cases.value(node)
    kept = (heading >= low[owner] - SAME) & (heading <= high[owner] + SAME)
    return owner[kept], heading[kept]


def _pieces(cases: BoxSet, node: DirectionAt) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Pairs (case, range of headings), the ranges (2, m): the directions that a field may have in parts."""
    owner, heading = _headings(cases, node, np.arange(cases.size))
    order = np.lexsort((heading, owner))
    owner, heading = owner[order], heading[order]
    first = np.diff(owner, prepend=-1) > 0
    gap = np.diff(heading, prepend=-np.inf)
    gap[first] = np.inf
    apart = gap > _POINT
    if not isinstance(cast(Constant, node.field).value, ElementAtPoint):
        # a number of an option is near no other; headings are parted evenly
        low, high = np.full(cases.size, np.inf), np.full(cases.size, -np.inf)
        np.minimum.at(low, owner, heading)
        np.maximum.at(high, owner, heading)
        bins = np.floor((heading - low[owner]) * (_PIECES / (high - low + SAME)[owner]))
        even = np.diff(bins, prepend=-1.0) != 0
        apart &= first | even
    starts = np.nonzero(apart)[0]
    ends = np.append(starts[1:], len(heading))[: len(starts)] - 1
    return owner[starts], np.stack([heading[starts], heading[ends]])


def _split(cases: BoxSet, choice: Node, owner: NDArray[np.intp], options: NDArray[np.float64]) -> Iterator[BoxSet]:
    """The cases once for each option of a choice; the last axis of the options goes with the owners."""
    for first in range(0, len(owner), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        branches = cases.take(owner[some])
        branches.chosen[id(choice)] = options[..., some]
        yield branches
