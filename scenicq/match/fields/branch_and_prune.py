"""A group decided by boxes: narrowed until nothing is left, halved where something is, with trials for a witness.

What is empty has no solution, since enclosures are rounded outwards; a yes needs one witness, which is replayed. Boxes
are narrowed side by side, so that a thousand of them cost little more than one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from scenicq.budget import Exhausted, look
from scenicq.forest.walk import leaves
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.fields.constraint_network import ConstraintNetwork
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.fields.heading_propagation import branch, propagate
from scenicq.match.fields.witness_search import QUICK, THOROUGH, find_witness
from scenicq.match.problem.conditioned import Item, item_conjuncts
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided
from scenicq.match.tolerance import Tolerance

__all__ = ["branch_and_prune"]

_FIRST_TRIAL = 16
"""Boxes after which one that is left is searched for a witness; again after four times as many."""


def branch_and_prune(items: Sequence[Item], tolerance: Tolerance) -> Outcome:
    """Decide constraints without a solver; `Undecided` where that takes too many boxes.

    Args:
        items: The constraints, conditioned.
        tolerance: Per feature.
    """
    first = items[0][0]
    network = ConstraintNetwork(list(chain.from_iterable(map(item_conjuncts, items))), tolerance)
    try:
        start = propagate(BoxSet.start(network, {}))
        if not start.size:
            return Refuted(first)
        found = find_witness(start, THOROUGH) or _search(start)
    except Exhausted as error:
        return Undecided.by(first, error)
    if found is None:
        return Refuted(first)
    # which of several alternatives holds is a choice that the constraints do not know
    known = {leaf.identity for leaf in leaves(*(node for _, node, _ in items))}
    return Satisfied({identity: value for identity, value in found.values.items() if identity in known})


def _search(start: BoxSet) -> Satisfied | None:
    """A witness in some box; None if all of them are empty.

    Raises:
        Exhausted: There are too many boxes, or they get too small.
    """
    next_trial, seen = _FIRST_TRIAL, 0
    for cases in _boxes(start):
        seen += cases.size
        if seen >= next_trial:
            next_trial *= 4
            found = find_witness(cases.take(np.array([0])), QUICK)
            if found is not None:
                return found
    return None


def _boxes(start: BoxSet) -> Iterator[BoxSet]:
    """Boxes of which something is left, as they are met; what is left of each is halved then."""
    todo, seen = [start], 0
    while todo:
        look()
        for part in branch(todo.pop()):
            left = propagate(part)
            if left.size:
                seen += left.size
                if seen > LIMITS.pruned_boxes:
                    raise limit_exceeded("pruned_boxes")
                yield left
                todo.append(left)
