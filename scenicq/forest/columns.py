"""Columns: the values of an expression, or of something observed, at many places at once.

A place is a label, a sample or a draw. A column has a value and a status for each place. Columns broadcast with one
another as arrays do, so a value that is the same along an axis is stored once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.compute import compute
from scenicq.forest.nodes import DiscAt, Node, RectangleAt, SectorAt, Undefined, Value
from scenicq.geometry.shape_distances import to_discs, to_rectangles, to_sectors

__all__ = [
    "DEFINED",
    "UNDEFINED",
    "UNKNOWN",
    "Array",
    "CodedValues",
    "Column",
    "ColumnPlaces",
    "Data",
    "PlacedRegions",
    "Vectors",
    "arrays_of",
    "column_of",
    "common_status",
    "constant_column",
    "distances",
    "pack_values",
    "truth_of",
    "value_reader",
]  # fmt: skip

Array: TypeAlias = NDArray[Any]
Vectors: TypeAlias = tuple[Array, Array]
"""The x and y coordinates of vectors."""
DEFINED, UNDEFINED, UNKNOWN = np.int8(0), np.int8(1), np.int8(2)
"""The status of a value at a place. A value that depends on others has the greatest status of these."""


@dataclass(frozen=True, slots=True, eq=False)
class CodedValues:
    """Values that are neither numbers nor vectors, as indices into a list.

    Attributes:
        which: Indices of options.
        options: The distinct values: texts, regions, vector fields, ...
    """

    which: NDArray[np.intp]
    options: tuple[Value, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedRegions:
    """Discs, sectors or rectangles, one at each place.

    Attributes:
        node: A node of the same kind as all of them.
        center: Their centres.
        numbers: Their other parameters, in the order of the node's children.
    """

    node: DiscAt | SectorAt | RectangleAt
    center: Vectors
    numbers: tuple[Array, ...]


Data: TypeAlias = "Array | Vectors | CodedValues | PlacedRegions"
"""Numbers or truth values, the coordinates of vectors, or other values; meaningless where nothing is defined."""


class Column(NamedTuple):
    """The values of an expression; all arrays broadcast to one shape.

    Attributes:
        data: The values.
        status: `DEFINED`, `UNDEFINED` or `UNKNOWN`.
    """

    data: Data
    status: NDArray[np.int8]


class ColumnPlaces:
    """The places at which several columns are evaluated together, flattened, with their common status."""

    def __init__(self, columns: Sequence[Column]) -> None:
        self.shape = np.broadcast_shapes(*(part.shape for each in columns for part in _parts(each)))
        self.count = math.prod(self.shape)
        self.status = self.spread(common_status(columns))
        self.defined = np.flatnonzero(self.status == DEFINED)

    def spread(self, values: Array) -> Array:
        """Broadcast an array to these places, and flatten it."""
        return np.broadcast_to(values, self.shape).ravel()

    def points(self, data: Data) -> NDArray[np.float64]:
        """The vectors at defined places, shape (n, 2)."""
        return np.column_stack([self.spread(axis)[self.defined] for axis in cast("tuple[Array, Array]", data)])

    def combinations(self, columns: Sequence[Column]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Places with every combination of arguments, and for each defined place the index of its combination."""
        code: Array = np.zeros(len(self.defined), dtype=np.intp)
        for column in columns:
            data = column.data
            if isinstance(data, CodedValues):
                code = code * len(data.options) + self.spread(data.which)[self.defined]
            elif any(part.size > 1 for part in _parts(column)[:-1]):
                return self.defined, np.arange(len(self.defined))
        _, first, number = np.unique(code, return_index=True, return_inverse=True)
        return self.defined[first], number


def column_of(values: Sequence[Value]) -> Column:
    """Make a column of values; None is unknown."""
    said = [UNKNOWN if value is None else UNDEFINED if isinstance(value, Undefined) else DEFINED for value in values]
    return Column(pack_values(values, said, np.arange(len(values))), np.array(said, dtype=np.int8))


def constant_column(value: Value) -> Column:
    """Make a column of shape (1,), with one value for all places."""
    status = np.full(1, UNDEFINED if isinstance(value, Undefined) else DEFINED)
    if isinstance(value, bool | float | int):
        return Column(np.array([value]), status)
    if isinstance(value, tuple):
        return Column((np.array([value[0]]), np.array([value[1]])), status)
    return Column(
        np.full(1, np.nan) if isinstance(value, Undefined) else CodedValues(np.zeros(1, np.intp), (value,)), status
    )


def truth_of(data: Data) -> Array:
    """Whether values count as true in Python."""
    if isinstance(data, np.ndarray):
        return data if data.dtype == np.bool_ else np.not_equal(data, 0)
    if isinstance(data, CodedValues):
        return np.array([bool(option) for option in data.options])[data.which]
    return np.ones(1, dtype=np.bool_)


def common_status(columns: Sequence[Column]) -> NDArray[np.int8]:
    """The status of a value that depends on all of some columns."""
    status = columns[0].status
    for column in columns[1:]:
        status = np.maximum(status, column.status)
    return status


def _parts(column: Column) -> tuple[Array, ...]:
    """The arrays of a column, the status last."""
    return *arrays_of(column.data), column.status


def arrays_of(data: Data) -> tuple[Array, ...]:
    """The arrays that values are made of."""
    if isinstance(data, PlacedRegions):
        return *data.center, *data.numbers
    return data if isinstance(data, tuple) else (data.which if isinstance(data, CodedValues) else data,)


def distances(shape: PlacedRegions, x: Array, y: Array) -> Array:
    """Distances in metres from points to regions."""
    dx, dy = x - shape.center[0], y - shape.center[1]
    match shape.node:
        case DiscAt():
            return to_discs(dx, dy, *shape.numbers)
        case SectorAt():
            return to_sectors(dx, dy, *shape.numbers)
        case RectangleAt():
            return to_rectangles(dx, dy, *shape.numbers)


def value_reader(data: Data, shape: tuple[int, ...]) -> Callable[[int], Value]:
    """A function that gives the value at a place, of all places flattened."""
    arrays = [np.broadcast_to(each, shape).ravel() for each in arrays_of(data)]
    if isinstance(data, PlacedRegions):
        node: Node = data.node

        def region(place: int) -> Value:
            x, y, *numbers = (float(each[place]) for each in arrays)
            return compute(node, ((x, y), *numbers))

        return region
    if isinstance(data, CodedValues):
        options = data.options
        return lambda place: options[int(arrays[0][place])]
    if isinstance(data, tuple):
        return lambda place: (float(arrays[0][place]), float(arrays[1][place]))
    kind = bool if data.dtype == np.bool_ else float
    return lambda place: kind(arrays[0][place])


def pack_values(values: Sequence[Value], said: Sequence[np.int8], code: NDArray[np.intp]) -> Data:
    """Make data of values by their indices: arrays if all defined ones are numbers, truth values or vectors."""
    there = [value for value, status in zip(values, said, strict=True) if status == DEFINED]
    if not there:
        return np.full(1, np.nan)
    if all(isinstance(value, bool) for value in there):
        return np.array([value is True for value in values])[code]
    if all(isinstance(value, float | int) and not isinstance(value, bool) for value in there):
        return np.array([value if isinstance(value, float | int) else np.nan for value in values], np.float64)[code]
    if all(isinstance(value, tuple) for value in there):
        pairs = [value if isinstance(value, tuple) else (np.nan, np.nan) for value in values]
        x, y = np.array(pairs, dtype=np.float64).T
        return x[code], y[code]
    return CodedValues(code, tuple(values))
