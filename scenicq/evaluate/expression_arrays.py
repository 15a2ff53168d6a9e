"""Evaluate expressions over many labels and many draws of their random variables at once.

A number is an array that broadcasts to (labels, draws): what depends on a label alone has shape (labels, 1), what is
drawn alike for all labels (1, draws). Undefined numbers are nan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import count

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import CannotEvaluate
from scenicq.forest.column_domain import ColumnDomain
from scenicq.forest.columns import DEFINED, UNDEFINED, UNKNOWN, Column, Data, Vectors
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.nodes import DirectionAt, Feature, Identity, Leaf, Node

__all__ = ["evaluate_arrays", "points_of"]

_MOST_POINTS = 300_000
"""The map is asked at no more points than this."""


def evaluate_arrays(
    roots: tuple[Node, ...],
    draw: Callable[[Leaf, tuple[Data, ...]], Data],
    observed: Mapping[tuple[int, str], Data],
    draws: int,
) -> list[Data]:
    """Evaluate expressions; a truth value is false where it is undefined.

    Where a field allows several headings, each draw has one of them.

    Args:
        roots: Expressions.
        draw: The values of a random variable, given those of its distribution's parameters.
        observed: The values of features referred to.
        draws: How many there are.

    Raises:
        CannotEvaluate: A feature has no value, geometry cannot decide, or a region has no value for some labels.
    """
    drawn: dict[Identity, Column] = {}
    fields = count()

    def seen(node: Feature) -> Column:
        if (node.object, node.property) not in observed:
            raise CannotEvaluate(f"`{node.property}` of an object has no value")
        return _column(observed[node.object, node.property])

    def value(leaf: Leaf, args: Sequence[Column]) -> Column:
        if leaf.identity not in drawn:
            drawn[leaf.identity] = _column(draw(leaf, tuple(map(_values, args))))
        return drawn[leaf.identity]

    def pick(node: DirectionAt, counts: NDArray[np.intp]) -> NDArray[np.intp]:
        return np.random.default_rng(next(fields)).permutation(draws) % np.maximum(counts, 1)

    with np.errstate(all="ignore"):
        known = interpret(steps_of(*roots), ColumnDomain(seen, value, pick, _MOST_POINTS))
        return [_values(known[id(root)]) for root in roots]


def _column(data: Data) -> Column:
    """What is nan is undefined."""
    axes = data if isinstance(data, tuple) else (data,)
    status = np.full(1, DEFINED)
    for axis in axes:
        if isinstance(axis, np.ndarray) and axis.dtype == np.float64 and (missing := np.isnan(axis)).any():
            status = np.maximum(status, np.where(missing, UNDEFINED, DEFINED))
    return Column(data, status)


def _values(column: Column) -> Data:
    data, status = column
    if np.equal(status, UNKNOWN).any():
        raise CannotEvaluate("what geometry cannot decide")
    missing = np.not_equal(status, DEFINED)
    if not missing.any():
        return data
    if isinstance(data, tuple):
        return np.where(missing, np.nan, data[0]), np.where(missing, np.nan, data[1])
    if isinstance(data, np.ndarray):
        return data & ~missing if data.dtype == np.bool_ else np.where(missing, np.nan, data)
    raise CannotEvaluate("a region without a value for some labels")


def points_of(point: Vectors) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    """The points of a pair of arrays, shape (n, 2), and the shape that they come in."""
    x, y = np.broadcast_arrays(*point)
    return np.column_stack((x.ravel(), y.ravel())).astype(np.float64), x.shape
