"""Expressions over many labels and many draws of their random variables at once.

A number is an array that broadcasts to (labels, draws): what hangs on a label alone has shape (labels, 1), what is
drawn alike for all labels (1, draws). Undefined numbers are nan.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    Coordinate,
    DirectionAt,
    DiscAt,
    Feature,
    Identity,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Norm,
    RectangleAt,
    Rotate,
    Scale,
    SectorAt,
    Select,
    Undefined,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.membership import contains_many
from scenicq.geometry.regions import Region

__all__ = ["Array", "ArrayValue", "Pair", "RegionChoice", "RegionOf", "UncomputedError", "evaluate_arrays", "points_of"]

Array = NDArray[Any]
Pair: TypeAlias = tuple[Array, Array]


class UncomputedError(Exception):
    """What cannot be computed for many draws at once; the message says what."""


@dataclass(frozen=True, slots=True, eq=False)
class RegionOf:
    """A region whose parameters are arrays.

    Attributes:
        node: Its node.
        args: Values of the node's children.
    """

    node: Node
    args: tuple[ArrayValue, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RegionChoice:
    """One of several known regions.

    Attributes:
        which: Number of the region.
        options: The regions.
    """

    which: Array
    options: tuple[Region, ...]


ArrayValue: TypeAlias = "Array | Pair | Region | VectorField | RegionOf | RegionChoice | str | None"

_MOST_POINTS = 300_000
"""Points at which a map is asked for a direction at most."""

_UNARY: dict[ArithmeticOp, Callable[[Array], Array]] = {
    ArithmeticOp.NEG: np.negative,
    ArithmeticOp.ABS: np.abs,
    ArithmeticOp.SQRT: np.sqrt,
    ArithmeticOp.SIN: np.sin,
    ArithmeticOp.COS: np.cos,
    ArithmeticOp.TAN: np.tan,
    ArithmeticOp.ASIN: np.arcsin,
    ArithmeticOp.ACOS: np.arccos,
    ArithmeticOp.ATAN: np.arctan,
    ArithmeticOp.EXP: np.exp,
    ArithmeticOp.LOG: np.log,
    ArithmeticOp.FLOOR: np.floor,
    ArithmeticOp.CEIL: np.ceil,
    ArithmeticOp.WRAP: lambda angle: math.pi - np.mod(math.pi - angle, math.tau),
}
_BINARY: dict[ArithmeticOp, Callable[[Array, Array], Array]] = {
    ArithmeticOp.ADD: np.add,
    ArithmeticOp.SUB: np.subtract,
    ArithmeticOp.MUL: np.multiply,
    ArithmeticOp.DIV: np.divide,
    ArithmeticOp.FLOORDIV: np.floor_divide,
    ArithmeticOp.MOD: np.mod,
    ArithmeticOp.POW: np.power,
    ArithmeticOp.MIN: np.minimum,
    ArithmeticOp.MAX: np.maximum,
    ArithmeticOp.ATAN2: np.arctan2,
}
_ORDER: dict[CompareOp, Callable[[Array, Array], Array]] = {
    CompareOp.LT: np.less,
    CompareOp.LE: np.less_equal,
    CompareOp.GT: np.greater,
    CompareOp.GE: np.greater_equal,
    CompareOp.EQ: np.equal,
    CompareOp.NE: np.not_equal,
}


def evaluate_arrays(
    roots: tuple[Node, ...],
    draw: Callable[[Leaf, tuple[ArrayValue, ...]], ArrayValue],
    observed: Mapping[tuple[int, str], ArrayValue],
    draws: int,
) -> list[ArrayValue]:
    """The values of expressions.

    Args:
        roots: Expressions.
        draw: The values of a random variable, given those of its distribution's parameters.
        observed: The values of features referred to.
        draws: How many there are.

    Raises:
        UncomputedError: An expression has a part that cannot be computed so.
    """
    values: dict[int, ArrayValue] = {}
    drawn: dict[Identity, ArrayValue] = {}
    with np.errstate(all="ignore"):
        for node in postorder(roots):
            args = tuple(values[id(child)] for child in children(node))
            if is_leaf(node):
                leaf = cast(Leaf, node)
                if leaf.identity not in drawn:
                    drawn[leaf.identity] = draw(leaf, args)
                values[id(node)] = drawn[leaf.identity]
            elif isinstance(node, Feature):
                if (node.object, node.property) not in observed:
                    raise UncomputedError(f"`{node.property}` of an object has no value")
                values[id(node)] = observed[node.object, node.property]
            elif isinstance(node, DirectionAt):
                values[id(node)] = _direction(args[0], args[1], draws, len(values))
            else:
                values[id(node)] = _value(node, args)
    return [values[id(root)] for root in roots]


def _value(node: Node, args: tuple[ArrayValue, ...]) -> ArrayValue:
    given: tuple[Any, ...] = args
    match node:
        case Constant():
            return _constant(node)
        case Arithmetic():
            if node.op in _UNARY:
                return _UNARY[node.op](given[0])
            found = given[0]
            for other in given[1:]:
                found = _BINARY[node.op](found, other)
            return found
        case VectorOf():
            return given[0], given[1]
        case VectorSum():
            return given[0][0] + given[1][0], given[0][1] + given[1][1]
        case Scale():
            return given[0][0] * given[1], given[0][1] * given[1]
        case Rotate():
            (x, y), angle = given
            sine, cosine = np.sin(angle), np.cos(angle)
            return cosine * x - sine * y, sine * x + cosine * y
        case Coordinate():
            return given[0][node.axis]
        case Norm():
            return np.hypot(*given[0])
        case Bearing():
            return np.arctan2(-given[0][0], given[0][1])
        case Compare():
            if any(not isinstance(arg, np.ndarray) for arg in given):
                raise UncomputedError("a comparison of what are no numbers")
            return _ORDER[node.op](given[0], given[1])
        case Logic():
            if node.op is LogicOp.NOT:
                return ~given[0].astype(bool)
            join = np.logical_and if node.op is LogicOp.AND else np.logical_or
            found = given[0].astype(bool)
            for other in given[1:]:
                found = join(found, other)
            return found
        case Select():
            return _selected(given[0], given[1:])
        case Contains():
            return _contained(given[0], given[1])
        case DiscAt() | SectorAt() | RectangleAt():
            return RegionOf(node, args)
        case _:
            # where it matters what it is, the reason is told
            return RegionOf(node, args)


def _constant(node: Constant) -> ArrayValue:
    value = node.value
    if isinstance(value, Undefined):
        return np.full((1, 1), np.nan)
    if isinstance(value, bool | int | float):
        return np.full((1, 1), value)
    if isinstance(value, tuple):
        return np.full((1, 1), float(value[0])), np.full((1, 1), float(value[1]))
    return value


def _selected(index: Array, options: tuple[Any, ...]) -> ArrayValue:
    which = index.astype(np.int64)
    if all(isinstance(option, np.ndarray) for option in options):
        return _picked(which, options)
    if all(isinstance(option, tuple) for option in options):
        return tuple(_picked(which, [option[axis] for option in options]) for axis in (0, 1))  # type: ignore[return-value]
    if all(isinstance(option, str) for option in options):
        return np.array(options, dtype=object)[which]
    if any(isinstance(option, RegionOf | RegionChoice | VectorField | np.ndarray | tuple) for option in options):
        raise UncomputedError("a choice among what hangs on hidden values")
    return RegionChoice(which, options)


def _picked(which: Array, options: Any) -> Array:
    shape = np.broadcast_shapes(which.shape, *(option.shape for option in options))
    found = np.full(shape, np.nan)
    for number, option in enumerate(options):
        found = np.where(which == number, option, found)
    return found


def points_of(point: Pair) -> tuple[Array, tuple[int, ...]]:
    """The points of a pair of arrays, shape (n, 2), and the shape that they come in."""
    x, y = np.broadcast_arrays(*point)
    return np.column_stack((x.ravel(), y.ravel())).astype(np.float64), x.shape


def _direction(field: Any, point: Any, draws: int, number: int) -> Array:
    """Headings of a field; where it allows several, each draw has one of them, whichever the node's number says."""
    if isinstance(field, RegionOf | np.ndarray) or not hasattr(field, "values"):
        raise UncomputedError("a random vector field")
    xy, shape = points_of(point)
    if len(xy) > _MOST_POINTS:
        raise UncomputedError("directions at too many points")
    many = getattr(field, "values_many", None)
    sound = np.isfinite(xy).all(axis=1)
    at = xy[sound]
    headings = many(at) if many else [field.values(x, y) for x, y in at.tolist()]
    most = max(map(len, headings), default=1)
    if most <= 1:
        found = np.full(len(xy), np.nan)
        found[sound] = [each[0] if each else math.nan for each in headings]
        return found.reshape(shape)
    several = np.full((len(xy), most), np.nan)
    counts = np.ones(len(xy), dtype=np.int64)
    for row, each in zip(np.flatnonzero(sound).tolist(), headings, strict=True):
        several[row, : len(each)] = each
        counts[row] = max(len(each), 1)
    order = np.random.default_rng(number).permutation(draws)
    which = order % counts.reshape(shape)
    rows = np.arange(len(xy)).reshape(shape)
    return several[rows, which]


def _contained(region: Any, point: Any) -> Array:
    if isinstance(region, RegionChoice):
        raise UncomputedError("whether one of several regions holds a point")
    if isinstance(region, RegionOf):
        return _contained_in(region, point)
    xy, shape = points_of(point)
    return contains_many(region, xy).reshape(shape)


def _contained_in(region: RegionOf, point: Any) -> Array:
    args: tuple[Any, ...] = region.args
    if not isinstance(region.node, DiscAt | SectorAt | RectangleAt):
        raise UncomputedError("whether a combined region holds a point")
    dx, dy = point[0] - args[0][0], point[1] - args[0][1]
    if isinstance(region.node, DiscAt):
        return np.hypot(dx, dy) <= args[1]
    if isinstance(region.node, SectorAt):
        turn = np.arctan2(-dx, dy) - args[2]
        aside = np.abs(np.mod(turn + math.pi, math.tau) - math.pi)
        return (np.hypot(dx, dy) <= args[1]) & (aside <= args[3] / 2)
    sine, cosine = np.sin(args[1]), np.cos(args[1])
    right, ahead = cosine * dx + sine * dy, -sine * dx + cosine * dy
    return (np.abs(right) <= args[2] / 2) & (np.abs(ahead) <= args[3] / 2)
