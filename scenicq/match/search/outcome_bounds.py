"""Necessary conditions of one constraint, for all outcomes of a choice at once: interval analysis over arrays.

A lane of a thousand that must hold a car is one of those whose box does; a row of a table of outcomes that no value of
the other random variables can save is left out before anything is evaluated for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.bounds import EVERYTHING
from scenicq.forest.groups import Comparison
from scenicq.forest.kinds import kind_of
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
    Distance,
    Logic,
    LogicOp,
    Node,
    Norm,
    PointIn,
    Range,
    Rotate,
    Scale,
    Select,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Region
from scenicq.match.problem.conditioned import Item
from scenicq.match.search.interval_arrays import (
    add,
    arithmetic,
    largest,
    multiply,
    nearest,
    rotated,
)
from scenicq.match.search.outcome_tables import ChoiceTree, above_choices
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["possible_outcomes"]

_PLANE = (EVERYTHING, EVERYTHING)
_EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)


def possible_outcomes(
    item: Item, trees: Mapping[int, tuple[ChoiceTree, NDArray[np.intp], bool]], count: int, tolerance: Tolerance
) -> NDArray[np.bool_]:
    """For which outcomes a constraint may be satisfiable.

    Args:
        item: The constraint, conditioned.
        trees: The outermost choices in it, by the ids of their nodes, with the outcomes that are left, and whether
            these are those in question: of the others any may come out.
        count: How many outcomes are in question.
        tolerance: Per feature.

    Returns:
        One truth value for each; false only where no solution exists.
    """
    constraint, root, seen = item
    known: dict[int, Any] = {}
    with np.errstate(all="ignore"):
        for node, below in above_choices(root):
            if isinstance(node, Select):
                known[id(node)] = _chosen(*trees[id(node)])
            else:
                known[id(node)] = _value(node, [known[id(child)] for child in below])
        value, kind = known[id(root)], kind_of(root)
        near: Any = True
        if not isinstance(constraint, Comparison):
            near = value
        elif isinstance(seen, tuple) and constraint.property == "position":
            (x0, x1), (y0, y1) = value
            reach = tolerance.of(constraint.object, "position").reach + SLACK
            x, y = seen
            near = (x0 - reach <= x) & (x <= x1 + reach) & (y0 - reach <= y) & (y <= y1 + reach)
        elif isinstance(seen, float) and kind == "scalar":
            low, high = value
            margin = tolerance.of(constraint.object, constraint.property)
            allowed = margin.size + SLACK
            if margin.kind == "arc":
                width = high - low + 2 * allowed
                near = ~np.isfinite(width) | (np.mod(seen - low + allowed, math.tau) <= width)
            else:
                near = (low - allowed <= seen) & (seen <= high + allowed)
        return np.broadcast_to(np.asarray(near, dtype=bool), (count,))


def _chosen(tree: ChoiceTree, rows: NDArray[np.intp], each: bool) -> Any:
    """Bounds of what is chosen, for each outcome or for all together."""
    match tree.kind:
        case "scalar":
            low, high = tree.spans[rows].T
            return (low, high) if each else (low.min(), high.max())
        case "vector" | "region":
            west, south, east, north = tree.boxes[rows].T
            if not each:
                west, south, east, north = west.min(), south.min(), east.max(), north.max()
            return ((west, east), (south, north)) if tree.kind == "vector" else (west, south, east, north)
        case "boolean":
            return tree.truths[rows] if each else tree.truths[rows].any()
        case _:
            return None


def _value(node: Node, args: list[Any]) -> Any:
    """Bounds of a node from those of its children: a span, a box of two, a region's box, or whether it can hold."""
    if any(arg is None for arg in args):
        return _anything(node)
    match node:
        case Constant(value=float() as value):
            return (value, value)
        case Constant(value=tuple() as value):
            return tuple((part, part) for part in value)
        case Constant(value=value) if isinstance(value, Region):
            return region_bounds(value)
        case Constant(value=bool() as value):
            return value
        case Range():
            return (np.minimum(args[0][0], args[1][0]), np.maximum(args[0][1], args[1][1]))
        case TruncatedNormal():
            return (args[2][0], args[3][1])
        case PointIn():
            west, south, east, north = args[0]
            return ((west, east), (south, north))
        case Arithmetic(ArithmeticOp.DIV, (_, Constant(value=float() as divisor))) if divisor:
            return multiply(args[0], (1 / divisor, 1 / divisor))
        case Arithmetic() if all(kind_of(arg) == "scalar" for arg in node.args):
            return arithmetic(node.op, args)
        case Coordinate():
            return args[0][node.axis]
        case Norm():
            x, y = args[0]
            return (np.hypot(nearest(x), nearest(y)), np.hypot(largest(x), largest(y)))
        case Bearing() | DirectionAt():
            return (-math.pi, math.pi)
        case Distance():
            return _distance(args[0], args[1])
        case VectorOf():
            return (args[0], args[1])
        case VectorSum():
            (a, b), (c, d) = args
            return (add(a, c), add(b, d))
        case Scale():
            x, y = args[0]
            return (multiply(x, args[1]), multiply(y, args[1]))
        case Rotate():
            return rotated(args[0], args[1])
        case Logic() if node.op is not LogicOp.NOT:
            found = np.asarray(args[0])
            for part in args[1:]:
                found = found & part if node.op is LogicOp.AND else found | part
            return found
        case Compare() if kind_of(node.left) == "scalar" and kind_of(node.right) == "scalar":
            return _compared(node.op, *args)
        case Contains():
            west, south, east, north = args[0]
            (x0, x1), (y0, y1) = args[1]
            return (x0 <= east + SLACK) & (west <= x1 + SLACK) & (y0 <= north + SLACK) & (south <= y1 + SLACK)
        case _:
            return _anything(node)


def _anything(node: Node) -> Any:
    match kind_of(node):
        case "scalar":
            return EVERYTHING
        case "vector":
            return _PLANE
        case "region":
            return _EVERYWHERE
        case "boolean":
            return True
        case _:
            return None


def _compared(op: CompareOp, left: Any, right: Any) -> Any:
    (a, b), (c, d) = left, right
    match op:
        case CompareOp.LT | CompareOp.LE:
            return a <= d + SLACK
        case CompareOp.GT | CompareOp.GE:
            return b + SLACK >= c
        case CompareOp.EQ:
            return (a <= d + SLACK) & (b + SLACK >= c)
        case CompareOp.NE:
            return True


def _distance(region: Any, point: Any) -> Any:
    """Bounds of the distance of a point from something in a box."""
    west, south, east, north = region
    (x0, x1), (y0, y1) = point
    near = [np.maximum(0.0, np.maximum(a - q, p - b)) for p, q, a, b in ((x0, x1, west, east), (y0, y1, south, north))]
    far = [np.maximum(np.abs(q - a), np.abs(b - p)) for p, q, a, b in ((x0, x1, west, east), (y0, y1, south, north))]
    most = np.hypot(far[0], far[1])
    return (np.hypot(near[0], near[1]), np.where(np.isnan(most), np.inf, most))
