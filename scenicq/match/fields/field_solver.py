"""Groups with fields at hidden points: which way each field points is chosen, and what is left is linear.

A car that follows a road through an intersection may turn at every step. All combinations are looked at together,
choice by choice, and after each choice the random numbers are narrowed; few combinations survive that. For each of
these the directions are known, so that the rest is a linear program with one map cell for each hidden point.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from scenicq.budget import Exhausted, Trials, look
from scenicq.forest.bounds import FloatInterval
from scenicq.forest.groups import Constraint
from scenicq.forest.nodes import DiscreteRange, Identity, Index, Value
from scenicq.forest.walk import leaves
from scenicq.limits import LIMITS
from scenicq.match.fields.cell_assignment import HeadingAssignment, assignment_of, solve_cells
from scenicq.match.fields.constraint_network import ConstraintNetwork
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.fields.heading_propagation import (
    DirectedCases,
    KnownCases,
    bisect_cases,
    propagate,
    split_by_direction,
)
from scenicq.match.fields.shared_variable import find_shared_value, join_intervals
from scenicq.match.fields.witness_search import THOROUGH, find_witness
from scenicq.match.problem.conditioned import Item, condition_items
from scenicq.match.problem.outcome import Outcome, Patience, Refuted, Satisfied, SearchSteps, Undecided, finish
from scenicq.match.tolerance import Tolerance

__all__ = ["repair_solution", "search_directions"]

_MANY_CASES = 128
"""Cases of one part after which more draws look for a witness than before, and again after four times so many."""
_TRIALS = 400.0
"""Trials of each of these searches, a share of which it may take."""
_CLOSE = 0.05
"""How far from the answer of a solver a solution is looked for."""


def search_directions(
    parts: Sequence[list[Item]], shared: Identity | None, tolerance: Tolerance, known: KnownCases | None = None
) -> SearchSteps:
    """Decide a group with fields at hidden points, without a solver; `Undecided` where one is needed.

    Args:
        parts: The constraints, conditioned, in parts that share no random variable but one.
        shared: The random number that all of them share, if there are several parts.
        tolerance: Per feature.
        known: Cases that were looked for already, extended: several groups of a label have the same parts.
    """
    first = parts[0][0][0]
    start = BoxSet.start(ConstraintNetwork([item for part in parts for item in part], tolerance), {}).narrowed()
    if not start.size and len(parts) == 1:
        return Refuted(first)
    witness = find_witness(start) if start.size else None
    if witness is not None:
        return witness
    if shared is None or len(parts) == 1:
        return (yield from _alone(start, first, tolerance))
    chosen: list[list[BoxSet]] = []
    limits: list[FloatInterval] = []
    try:
        for part in parts:
            left: list[BoxSet] = []
            for cases in _directed(part, tolerance, shared, limits, {} if known is None else known):
                if cases.size:
                    left.append(cases)
                else:
                    yield Patience.LIKELY
            if not left:
                return Refuted(part[0][0])
            chosen.append(left)
            limits = _joined(left, shared)
        # what a later part excludes of the shared number excludes ways of the earlier ones
        chosen = [_within(found, shared, limits) for found in chosen]
    except Exhausted as error:
        doubt = Undecided.by(first, error)
        yield Patience.ALL
        return _searched(start) or doubt
    ways = [_ways(found, shared) for found in chosen]
    if not all(ways):
        return Refuted(first)
    found = find_shared_value(ways, shared, tolerance, lambda way: _divided(way, shared))
    choices = [id(node) for left in chosen for node in left[0].network.choices]
    if isinstance(found, Undecided) and len(set(choices)) < len(choices):
        # fields that several parts ask for at one point have one direction there
        return (yield from _alone(start, first, tolerance))
    return found


def _directed(
    part: list[Item], tolerance: Tolerance, shared: Identity, limits: list[FloatInterval], known: KnownCases
) -> DirectedCases:
    """The cases of a part in which the number that parts share is within limits."""
    key = (*[(id(constraint), id(node), id(seen)) for constraint, node, seen in part], shared, *limits)
    if key not in known:
        start = BoxSet.start(ConstraintNetwork(part, tolerance), {shared: limits} if limits else {})
        known[key] = DirectedCases(start, _MANY_CASES)
    return known[key]


def _one_by_one(found: Iterator[BoxSet]) -> Iterator[HeadingAssignment | None]:
    """The ways of cases, as the cases are found; None where that takes long."""
    for cases in found:
        if not cases.size:
            yield None
        ways = (assignment_of(cases, number, None) for number in range(cases.size))
        yield from (way for way in ways if way is not None)


def _alone(start: BoxSet, first: Constraint, tolerance: Tolerance) -> SearchSteps:
    """What comes of the ways of one part; those that are vague are divided until a solution holds or none is left."""
    todo: deque[HeadingAssignment] = deque()
    doubt, searched = Undecided(first, "nonlinear"), 0
    try:
        for number, way in enumerate(_one_by_one(split_by_direction(start, _MANY_CASES))):
            if way is None:
                yield Patience.ALL if searched else Patience.LIKELY
                found = _searched(start, searched)
                searched += 1
            else:
                found = solve_cells(way, tolerance)
            if isinstance(found, Satisfied):
                return found
            if number == LIMITS.field_ways:
                break
            if isinstance(found, Undecided) and way is not None:
                todo.append(way)
        else:
            found = _halved(todo, first, tolerance)
            if not isinstance(found, Undecided):
                return found
    except Exhausted as error:
        doubt = Undecided.by(first, error)
    yield Patience.ALL
    return doubt if searched else _searched(start) or doubt


def _halved(todo: deque[HeadingAssignment], first: Constraint, tolerance: Tolerance) -> Outcome:
    """What comes of vague ways, divided."""
    doubt = Undecided(first, "nonlinear")
    for _ in range(LIMITS.field_halvings):
        if not todo:
            return Refuted(first)
        less = _divided(todo.popleft(), None) if todo[0].vague else None
        if less is None:
            break
        for way in less:
            found = solve_cells(way, tolerance)
            if isinstance(found, Satisfied):
                return found
            if isinstance(found, Undecided):
                todo.append(way)
    return doubt


def _searched(start: BoxSet, seed: int = 0) -> Satisfied | None:
    """A witness of one part by more draws than at first; what it costs is little beside the cases before."""
    look()
    narrowed = start.narrowed()
    with Trials(_TRIALS):
        return find_witness(narrowed, THOROUGH, seed=seed) if narrowed.size else None


def _divided(way: HeadingAssignment, shared: Identity | None) -> list[HeadingAssignment] | None:
    """What is left of a way in cells that cover too much over either half of the widest range that matters there."""
    try:
        halves = [propagate(half) for half in bisect_cases(way.case, leaves(*way.vague))]
    except Exhausted:
        return None
    return _ways([half for half in halves if half.size], shared)


def repair_solution(items: Sequence[Item], near: Mapping[Identity, Value], tolerance: Tolerance) -> Satisfied | None:
    """A solution close to values that miss one by little, such as the far side of a border; None if none is found.

    Args:
        items: The constraints, conditioned.
        near: The values; those of discrete variables are kept. What did not matter to a solver may be missing.
        tolerance: Per feature.
    """
    known = leaves(*(node for _, node, _ in items))
    discrete = [leaf.identity for leaf in known if isinstance(leaf, Index | DiscreteRange)]
    given = {identity: near[identity] for identity in discrete if identity in near}
    if len(given) < len(set(discrete)):
        return None
    network = ConstraintNetwork(condition_items(items, given), tolerance)
    found = finish(_alone(BoxSet.around(network, near, _CLOSE), items[0][0], tolerance))
    return Satisfied({**given, **found.values}) if isinstance(found, Satisfied) else None


def _joined(found: Sequence[BoxSet], shared: Identity) -> list[FloatInterval]:
    """Where the shared number can be, intervals that meet as one."""
    ends = np.concatenate([cases.ranges[shared] for cases in found], axis=1).T.tolist()
    return join_intervals([(low, high) for low, high in ends])


def _within(found: Sequence[BoxSet], shared: Identity, limits: Sequence[FloatInterval]) -> list[BoxSet]:
    """The cases in which the shared number can be within some limits."""
    kept: list[BoxSet] = []
    for cases in found:
        for low, high in limits:
            own = cases.ranges[shared]
            near = cases.those((own[0] <= high) & (own[1] >= low))
            if near.size:
                near = near.take(np.arange(near.size))
                near.ranges[shared] = np.stack(
                    [np.maximum(near.ranges[shared][0], low), np.minimum(near.ranges[shared][1], high)]
                )
                near = near.narrowed()
            if near.size:
                kept.append(near)
    return kept


def _ways(found: Sequence[BoxSet], shared: Identity | None) -> list[HeadingAssignment]:
    """The cases as constraints, those first in which a linear program tells all."""
    ways = [assignment_of(cases, number, shared) for cases in found for number in range(cases.size)]
    return sorted((way for way in ways if way is not None), key=lambda way: bool(way.vague))
