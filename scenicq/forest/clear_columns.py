"""The domain of columns without what rounding may decide."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.column_domain import ColumnDomain
from scenicq.forest.columns import UNKNOWN, Column
from scenicq.forest.ego_frame import DISTANCE, PLACE, in_ego_frame
from scenicq.forest.interpret import OnMap
from scenicq.forest.nodes import (
    Among,
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    Feature,
    Logic,
    Node,
)
from scenicq.forest.walk import children, is_leaf, postorder

__all__ = ["ClearColumns", "QuickColumns", "quick_form"]

_CLOSE = 1e-9
"""How close numbers are, beside their size, that another order of operations may turn round."""
_OFF_BY = 1e3
"""How many times what is off by rounding may be multiplied or added to itself."""
_SMOOTH = frozenset({
    ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.NEG, ArithmeticOp.ABS, ArithmeticOp.MIN, ArithmeticOp.MAX,
    ArithmeticOp.SIN, ArithmeticOp.COS, ArithmeticOp.WRAP,
})  # fmt: skip
"""Operations that are off by no more than their arguments are, but for jumps."""


def _close(a: NDArray[np.float64], b: NDArray[np.float64] | float) -> NDArray[np.bool_]:
    """Where numbers are so close that rounding may decide."""
    with np.errstate(invalid="ignore"):
        return np.abs(a - b) <= _CLOSE * np.maximum(1.0, np.maximum(np.abs(a), np.abs(b)))


def _unclear(found: Column, where: NDArray[np.bool_]) -> Column:
    """What is not known at some places."""
    return Column(found.data, np.maximum(found.status, np.where(where, UNKNOWN, found.status)))


class ClearColumns(ColumnDomain):
    """Values at many places; comparisons of numbers that are very close to each other are unknown.

    NumPy rounds some functions otherwise than the functions of one number do: what is asked of one label and of many at
    once must be told alike.
    """

    __slots__ = ()

    def compare(self, op: CompareOp, left: Column, right: Column) -> Column:
        """A comparison; whole numbers may be equal."""
        found = ColumnDomain.compare(self, op, left, right)
        a, b = left.data, right.data
        if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)) or np.bool_ in (a.dtype, b.dtype):
            return found
        return _unclear(found, _close(a, b) & self._may_differ(a, b))

    def _may_differ(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where close numbers may be others by another order of operations."""
        return (a != b) | (a != np.rint(a))


class QuickColumns(ClearColumns):
    """Values at many places of what `quick_form` gives: angles are NumPy's."""

    __slots__ = ()

    def bearing(self, vector: Column) -> Column:
        """The heading of a vector; of one that is short or points backwards it is not known."""
        data = vector.data
        if not isinstance(data, tuple):
            return ColumnDomain.bearing(self, vector)
        x, y = data
        return _unclear(Column(np.arctan2(-x, y), vector.status), _close(x, 0.0) & (y <= _CLOSE))

    def arithmetic(self, op: ArithmeticOp, args: Sequence[Column]) -> Column:
        """An operation on numbers; an angle that is wrapped to half a turn or its negative is not known."""
        found = ColumnDomain.arithmetic(self, op, args)
        if op is not ArithmeticOp.WRAP or not isinstance(found.data, np.ndarray):
            return found
        return _unclear(found, _close(np.abs(found.data), math.pi))

    def _may_differ(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.ones(1, np.bool_)


def quick_form(root: Node, ego: int) -> Node | None:
    """A condition over what the store knows of places in the ego's frame, where it asks for angles; else None.

    Its comparisons are those of the condition but where numbers are close to each other (`QuickColumns`).

    Args:
        root: The condition.
        ego: The index of the ego.
    """
    if not any(isinstance(node, Bearing) for node in postorder((root,))):
        return None
    quick = in_ego_frame(root, ego)
    times: dict[int, float] = {}
    for node in postorder((quick,)):
        if is_leaf(node) or isinstance(node, OnMap | Among):
            return None
        if isinstance(node, Feature) and node.property in (PLACE, DISTANCE):
            times[id(node)] = 1.0
        elif isinstance(node, Bearing) or any(id(each) in times for each in children(node)):
            times[id(node)] = _times(node, times)
            if times[id(node)] > _OFF_BY:
                return None
    return quick


def _times(node: Node, times: Mapping[int, float]) -> float:
    """How many times a number may be off by rounding, given the same of what it is computed of; infinite if unknown."""
    below = [times.get(id(each), 0.0) for each in children(node)]
    match node:
        case Bearing() if not any(below):
            return 1.0
        case Compare() | Logic() | Coordinate():
            return max(below)
        case Arithmetic(
            op=ArithmeticOp.MUL, args=(Constant(value=float(factor)), _) | (_, Constant(value=float(factor)))
        ):
            return max(below) * max(1.0, abs(factor))
        case Arithmetic(op=ArithmeticOp.MUL, args=(one, other)) if _is_wave(one) or _is_wave(other):
            # of a sine and a length
            return sum(below)
        case Arithmetic(op=op) if op in _SMOOTH:
            return sum(below)
        case _:
            return math.inf


def _is_wave(node: Node) -> bool:
    return isinstance(node, Arithmetic) and node.op in (ArithmeticOp.SIN, ArithmeticOp.COS)
