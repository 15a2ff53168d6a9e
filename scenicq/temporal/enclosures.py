"""What conditions over time can be where of what is hidden in them only bounds are known.

A number or a point that depends on random variables, and on nothing that changes over time, is the same at all samples.
Bounds of it, however they are found, bound what conditions can be at each sample, for all samples at once
(`forest.intervals` over columns).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scenicq.forest.columns import DEFINED, UNDEFINED, Column
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.interval_ends import ARRAYS
from scenicq.forest.interval_values import FloatOrArray, Interval, IntervalValue, IntervalVector, Truth
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Feature, Index, Node
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.regions import SLACK
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.definedness import is_total
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN
from scenicq.temporal.truth import Truth as Truths

__all__ = ["Bounds", "certainly", "unchanging"]

Bounds = tuple[float, float]
"""The least and the greatest value of a number."""


def _hanging(conditions: Sequence[Node]) -> tuple[set[int], set[int]]:
    """The ids of the nodes that depend on random variables, and of those that depend on what changes over time."""
    hidden: set[int] = set()
    changing: set[int] = set()
    for node in postorder(tuple(conditions)):
        below = [id(child) for child in children(node)]
        if is_leaf(node) or any(each in hidden for each in below):
            hidden.add(id(node))
        if (isinstance(node, Feature) and node.current) or any(each in changing for each in below):
            changing.add(id(node))
    return hidden, changing


def unchanging(conditions: Sequence[Node]) -> list[Node]:
    """The outermost numbers and points that depend on random variables, and on nothing that changes over time.

    Args:
        conditions: Expanded conditions.
    """
    hidden, changing = _hanging(conditions)
    found: dict[int, Node] = {}
    seen: set[int] = set()
    stack = list(conditions)
    while stack:
        node = stack.pop()
        if id(node) not in hidden or id(node) in seen:
            continue
        seen.add(id(node))
        if id(node) not in changing and not isinstance(node, Index) and kind_of(node) in ("scalar", "vector"):
            found[id(node)] = node
        else:
            stack += children(node)
    return list(found.values())


def certainly(columns: AtomColumns, condition: Node, bounds: Mapping[int, Sequence[Bounds]]) -> Truths:
    """The value of a condition at each sample where it has only one, else unknown; shape (n,).

    Args:
        columns: What is observed.
        condition: An expanded condition.
        bounds: Between what some numbers, and both coordinates of some points, lie, by the ids of their nodes.
    """
    n = len(columns.samples)
    hidden, _ = _hanging([condition])
    given: dict[int, IntervalValue[FloatOrArray]] = {}
    lacking = np.zeros(n, np.bool_)
    # what has a value for some values of the variables only makes a condition false elsewhere
    always_there = True
    stack = [condition]
    seen: set[int] = set()
    while stack:
        node = stack.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if id(node) in bounds:
            parts = [Interval(low, high) for low, high in bounds[id(node)]]
            given[id(node)] = parts[0] if len(parts) == 1 else IntervalVector(*parts)
            always_there = always_there and all(map(is_total, postorder((node,))))
            continue
        if id(node) not in hidden and (column := columns.column(node)) is not None:
            lacking |= column.status == UNDEFINED
            if (value := _interval(column)) is not None:
                given[id(node)] = value
                continue
        always_there = always_there and is_total(node)
        stack += children(node)
    with np.errstate(all="ignore"):
        steps = steps_of(condition, known=given)
        found = interpret(steps, IntervalDomain(ARRAYS, slack=SLACK), given)[id(condition)]
    if not isinstance(found, Truth):
        return np.full(n, UNKNOWN)
    holds, fails = (np.broadcast_to(np.asarray(each, np.bool_), n) for each in found)
    known = np.where(holds & ~fails & ~lacking, TRUE, UNKNOWN) if always_there else np.full(n, UNKNOWN)
    return np.where(fails & ~holds, FALSE, known)


def _interval(column: Column) -> IntervalValue[FloatOrArray]:
    """A column as intervals: exact where there is a value."""
    defined = column.status == DEFINED
    match column.data:
        case (x, y):
            return IntervalVector(*(ARRAYS.known(np.where(defined, each, np.nan)) for each in (x, y)))
        case np.ndarray() as data if data.dtype == np.bool_:
            return Truth(data | ~defined, ~data | ~defined)
        case np.ndarray() as data:
            return ARRAYS.known(np.where(defined, data, np.nan))
        case _:
            return None
