"""How far draws of the random variables are from what a label observes and what is required, as numbers to lessen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.columns import DEFINED, Column, PlacedRegions, distances, truth_of
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Compare, CompareOp, Contains, Logic, LogicOp, Node, Select, Value
from scenicq.geometry.angles import normalize_array
from scenicq.match.problem.conditioned import Item
from scenicq.match.tolerance import Margin, Tolerance

__all__ = ["Residuals", "residuals_of"]

_METRES_A_RADIAN = 5.0
"""How much a wrong heading counts beside a wrong place."""
_INSIDE = 0.5
"""The share of the tolerance within which nothing is to be lessened."""
_BROKEN = 1.0
"""What a condition counts that does not hold, where nothing says by how much."""
_STRICT = 1e-6
"""By how much a strict condition should hold at least."""

_Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Residuals:
    """What is missing of some draws.

    Attributes:
        each: Signed differences that should vanish, (k, n).
        missing: By how much a draw misses all together, (n,); zero where all holds, infinite where there is no value.
    """

    each: _Numbers
    missing: _Numbers


def residuals_of(items: Sequence[Item], known: Mapping[int, Column], tolerance: Tolerance, count: int) -> Residuals:
    """What is missing of draws.

    Args:
        items: The constraints, conditioned.
        known: The value of each node, by its id.
        tolerance: Per feature.
        count: How many draws there are.
    """
    rows: list[_Numbers] = []
    missing = np.zeros(count)
    for constraint, node, seen in items:
        column = known[id(node)]
        if isinstance(constraint, Comparison):
            off, beyond = _off(column, seen, tolerance.of(constraint.object, constraint.property))
            beyond = np.where(np.equal(column.status, DEFINED) & np.isfinite(beyond), beyond, np.inf)
        else:
            beyond = _violation(node, known)
            off = [beyond]
        rows += [np.broadcast_to(each, (count,)) for each in off]
        missing = missing + beyond
    return Residuals(np.stack(rows), np.broadcast_to(missing, (count,)))


def _off(column: Column, seen: Value, margin: Margin) -> tuple[list[_Numbers], _Numbers]:
    """The differences from what a label observes, and by how much they are beyond the tolerance."""
    data = column.data
    if isinstance(data, tuple) and isinstance(seen, tuple):
        dx, dy = data[0] - seen[0], data[1] - seen[1]
        if margin.kind == "box":
            beyond = np.maximum(np.abs(dx) - margin.size, 0) + np.maximum(np.abs(dy) - margin.y, 0)
            return [_lessened(dx, margin.size), _lessened(dy, margin.y)], beyond
        away = np.hypot(dx, dy)
        share = np.maximum(1 - _INSIDE * margin.size / np.maximum(away, 1e-12), 0)
        return [dx * share, dy * share], np.maximum(away - margin.size, 0)
    if isinstance(data, np.ndarray) and isinstance(seen, float):
        arc = margin.kind == "arc"
        turned = normalize_array(data - seen) if arc else data - seen
        weight = _METRES_A_RADIAN if arc else 1.0
        return [_lessened(turned, margin.size) * weight], np.maximum(np.abs(turned) - margin.size, 0) * weight
    return [np.zeros(1)], np.zeros(1)


def _lessened(off: _Numbers, size: float) -> _Numbers:
    return np.sign(off) * np.maximum(np.abs(off) - _INSIDE * size, 0)


def _violation(root: Node, known: Mapping[int, Column]) -> _Numbers:
    """By how much a condition fails; zero where it holds, infinite where it has no value."""
    done: dict[tuple[int, bool], _Numbers] = {}
    todo = [(root, True)]
    while todo:
        node, wanted = todo[-1]
        below = [(arg, wanted != (node.op is LogicOp.NOT)) for arg in node.args] if isinstance(node, Logic) else []
        if isinstance(node, Select):
            below = [(option, wanted) for option in node.options]
        missing = [each for each in below if (id(each[0]), each[1]) not in done]
        if missing:
            todo += missing
            continue
        parts = [done[id(part), sign] for part, sign in below]
        if isinstance(node, Select):
            done[id(node), wanted] = _selected(node, parts, known)
        elif isinstance(node, Logic):
            # all parts of a conjunction count, of a disjunction the best
            every = (node.op is LogicOp.AND) is wanted
            done[id(node), wanted] = reduce(np.add if every else np.minimum, parts)
        else:
            done[id(node), wanted] = _simple_violation(node, wanted, known)
        todo.pop()
    return done[id(root), True]


def _selected(node: Select, parts: Sequence[_Numbers], known: Mapping[int, Column]) -> _Numbers:
    """By how much the option fails that is taken."""
    index = known[id(node.index)]
    number = np.where(np.equal(index.status, DEFINED), cast(_Numbers, index.data), 0).astype(np.intp)
    found = np.select([number == option for option in range(len(parts))], list(parts), np.inf)
    return np.where(np.equal(index.status, DEFINED), found, np.inf)


def _simple_violation(node: Node, wanted: bool, known: Mapping[int, Column]) -> _Numbers:
    column = known[id(node)]
    holds = np.equal(truth_of(column.data), wanted)
    found = np.where(holds, 0.0, _measure(node, wanted, known))
    return np.where(np.equal(column.status, DEFINED), found, np.inf)


def _measure(node: Node, wanted: bool, known: Mapping[int, Column]) -> _Numbers:
    """By how much a condition fails where it fails."""
    if isinstance(node, Compare) and node.op is not CompareOp.NE:
        left, right = known[id(node.left)].data, known[id(node.right)].data
        if isinstance(left, np.ndarray) and isinstance(right, np.ndarray) and (wanted or node.op is not CompareOp.EQ):
            return np.abs(left.astype(float) - right.astype(float)) + _STRICT
    if isinstance(node, Contains) and wanted:
        region, point = known[id(node.region)].data, known[id(node.point)].data
        if isinstance(region, PlacedRegions) and isinstance(point, tuple):
            return cast(_Numbers, distances(region, *point)) + _STRICT
    return np.full(1, _BROKEN)
