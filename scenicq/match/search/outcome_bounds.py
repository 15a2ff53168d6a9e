"""Necessary conditions of one constraint, for all outcomes of a choice at once: interval analysis over arrays.

A lane of a thousand that must hold a car is one of those whose box does; a row of a table of outcomes that no value of
the other random variables can save is left out before anything is evaluated for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.groups import Comparison
from scenicq.forest.interpret import interpret
from scenicq.forest.interval_ends import ARRAYS
from scenicq.forest.interval_values import FloatOrArray, Interval, IntervalValue, IntervalVector, Truth, can_hold
from scenicq.forest.intervals import IntervalDomain
from scenicq.match.problem.conditioned import Item
from scenicq.match.search.interval_relaxation import within_margin
from scenicq.match.search.outcome_tables import ChoiceTree, above_choices
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["possible_outcomes"]

_DOMAIN = IntervalDomain(ARRAYS, slack=SLACK)


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
    chosen = {key: _chosen(*tree) for key, tree in trees.items()}
    with np.errstate(all="ignore"):
        value = interpret(tuple(above_choices(root)), _DOMAIN, chosen)[id(root)]
        near: FloatOrArray = can_hold(value)
        if isinstance(constraint, Comparison):
            margin = tolerance.of(constraint.object, constraint.property)
            known = isinstance(seen, float) or (isinstance(seen, tuple) and constraint.property == "position")
            near = within_margin(value, seen if known else None, margin)
        return np.broadcast_to(np.array(near, dtype=np.bool_), (count,))


def _chosen(tree: ChoiceTree, rows: NDArray[np.intp], each: bool) -> IntervalValue[FloatOrArray]:
    """Bounds of what is chosen, for each outcome or for all together."""
    match tree.kind:
        case "scalar":
            low, high = tree.spans[rows].T
            return _span(low, high, each)
        case "vector" | "region":
            west, south, east, north = tree.boxes[rows].T
            return IntervalVector(_span(west, east, each), _span(south, north, each))
        case "boolean":
            return Truth(tree.truths[rows] if each else tree.truths[rows].any(), True)
        case _:
            return None


def _span(low: FloatOrArray, high: FloatOrArray, each: bool) -> Interval[FloatOrArray]:
    return Interval(low, high) if each else Interval(cast(float, low.min()), cast(float, high.max()))
