"""Groups with fields at hidden points: which way each field points is chosen, and what is left is linear.

A car that follows a road through an intersection may turn at every step. All combinations are looked at together,
choice by choice, and after each choice the random numbers are narrowed; few combinations survive that. For each of
these the directions are known, so that the rest is a linear program with one map cell for each hidden point.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.bounds import Interval
from scenicq.forest.condition import condition
from scenicq.forest.nodes import Constant, DirectionAt, DiscreteRange, Identity, Index, Leaf, Node, Value
from scenicq.forest.walk import leaves
from scenicq.geometry.fields import VectorField
from scenicq.match.agreeing import agreed, joined
from scenicq.match.branches import Branches
from scenicq.match.ladder import Item, Maybe, No, Outcome, Yes
from scenicq.match.options import Tolerance
from scenicq.match.tape import Tape
from scenicq.match.ways import MARGIN, SAME, Way, solved, way_of

__all__ = ["decide_directions", "repaired"]

_MOST_AT_ONCE = 2000
"""Cases that are narrowed together."""
_MOST_CASES = 100_000
"""Cases of one part that are looked at."""
_MOST_WAYS = 256
"""Ways of one part that are put to the linear program."""
_FEW = 16
"""Cases of which all choices are looked at, to make those that are none."""
_FAR = 8.0
"""Metres: where a point may be farther about than this, a number that it hangs on is divided before directions are."""
_MOST_HALVES = 64
"""Ways of one part that are divided."""
_CLOSE = 0.05
"""How far from the answer of a solver a solution is looked for."""
_FINEST = 1e-5
"""Width of a range that is not divided any more."""


class _TooMany(Exception):
    """More cases than anyone would go through, or points that may be anywhere."""


def decide_directions(parts: Sequence[list[Item]], shared: Identity | None, tolerance: Tolerance) -> Outcome:
    """Decide a group with fields at hidden points, without a solver; `Maybe` where one is needed.

    Args:
        parts: The constraints, conditioned, in parts that share no random variable but one.
        shared: The random number that they share, if there are several parts.
        tolerance: Per feature.
    """
    first = parts[0][0][0]
    tapes = [Tape(part, tolerance) for part in parts]
    chosen: list[list[Branches]] = []
    limits: list[Interval] = []
    try:
        for tape in tapes:
            found = list(_chosen(tape, _start(tape, shared, limits)))
            if not found:
                return No(tape.items[0][0])
            chosen.append(found)
            limits = [] if shared is None else _joined(found, shared)
        if shared is not None and len(parts) > 1:
            # what a later part excludes of the shared number excludes ways of the earlier ones
            chosen = [_within(found, shared, limits) for found in chosen]
    except _TooMany:
        return Maybe(first, "nonlinear")
    ways = [_ways(found, shared) for found in chosen]
    if not all(ways):
        return No(first)
    if shared is None or len(ways) == 1:
        return _alone(ways[0], tolerance)
    found = agreed(ways, shared, tolerance, lambda way: _divided(way, shared))
    choices = [id(node) for tape in tapes for node in tape.choices]
    if isinstance(found, Maybe) and len(set(choices)) < len(choices):
        # fields that several parts ask for at one point have one direction there
        return decide_directions([[item for part in parts for item in part]], None, tolerance)
    return found


def _alone(ways: Sequence[Way], tolerance: Tolerance) -> Outcome:
    """What comes of the ways of one part; those that are vague are divided until a solution holds or none is left."""
    first = ways[0].case.tape.items[0][0]
    todo: deque[Way] = deque()
    for way in ways[:_MOST_WAYS]:
        found = solved(way, tolerance)
        if isinstance(found, Yes):
            return found
        if isinstance(found, Maybe):
            todo.append(way)
    if len(ways) > _MOST_WAYS:
        return Maybe(first, "nonlinear")
    for _ in range(_MOST_HALVES):
        if not todo:
            return No(first)
        less = None if todo[0].sharp else _divided(todo.popleft(), None)
        if less is None:
            break
        for way in less:
            found = solved(way, tolerance)
            if isinstance(found, Yes):
                return found
            if isinstance(found, Maybe):
                todo.append(way)
    return Maybe(first, "nonlinear")


def _divided(way: Way, shared: Identity | None) -> list[Way] | None:
    """What is left of a way in cells that cover too much over either half of its widest range."""
    case = way.case
    try:
        halves = [half.narrowed() for half in _halves(case, tuple(case.tape.leaves.values()))]
    except _TooMany:
        return None
    return _ways([_sharpened(half) for half in halves if half.size], shared)


def repaired(items: Sequence[Item], near: Mapping[Identity, Value], tolerance: Tolerance) -> Yes | None:
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
    memo: dict[int, Node] = {}
    tape = Tape([(c, condition(node, {}, given, memo), seen) for c, node, seen in items], tolerance)
    try:
        ways = _ways(list(_chosen(tape, Branches.around(tape, near, _CLOSE))), None)
    except _TooMany:
        return None
    found = _alone(ways, tolerance) if ways else None
    return Yes({**given, **found.values}) if isinstance(found, Yes) else None


def _joined(found: Sequence[Branches], shared: Identity) -> list[Interval]:
    """Where the shared number can be, intervals that meet as one."""
    ends = np.concatenate([cases.ranges[shared] for cases in found], axis=1).T.tolist()
    return joined([(low, high) for low, high in ends])


def _within(found: Sequence[Branches], shared: Identity, limits: Sequence[Interval]) -> list[Branches]:
    """The cases in which the shared number can be within some limits."""
    kept: list[Branches] = []
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


def _ways(found: Sequence[Branches], shared: Identity | None) -> list[Way]:
    """The cases as constraints, those first in which a linear program tells all."""
    ways = [way_of(cases, number, shared) for cases in found for number in range(cases.size)]
    return sorted((way for way in ways if way is not None), key=lambda way: not way.sharp)


def _start(tape: Tape, shared: Identity | None, limits: Sequence[Interval]) -> Branches:
    known = {shared: limits} if shared is not None and limits and shared in tape.leaves else {}
    return Branches.start(tape, known)


def _chosen(tape: Tape, start: Branches) -> Iterator[Branches]:
    """The cases of a part in which all directions are chosen and something is left.

    Raises:
        _TooMany: There are too many cases.
    """
    todo, seen = [start], 0
    while todo:
        cases = todo.pop()
        seen += cases.size
        if seen > _MOST_CASES:
            raise _TooMany
        cases = cases.narrowed()
        if not cases.size:
            continue
        left = [node for node in tape.choices if id(node) not in cases.chosen]
        if left:
            todo += _step(cases, left)
            continue
        cases = _sharpened(cases)
        if cases.size:
            yield cases


def _step(cases: Branches, left: Sequence[Index | DirectionAt]) -> list[Branches]:
    """The cases with more choices made: those that are none at once, else the next one in each way."""
    sizes = {id(node): float(_sizes(cases, node).max()) for node in left}
    ordered = sorted(left, key=lambda node: sizes[id(node)])
    sure: dict[int, NDArray[np.float64]] = {}
    best: tuple[int, Index | DirectionAt, NDArray[np.intp], NDArray[np.float64]] | None = None
    for node in ordered if cases.size <= _FEW else ordered[:1]:
        if sizes[id(node)] > _FAR:
            break
        owner, chosen = _options(cases, node)
        if len(owner) == cases.size and bool((np.diff(owner) == 1).all()):
            sure[id(node)] = chosen
        elif best is None or len(owner) < best[0]:
            best = (len(owner), node, owner, chosen)
    if sure:
        known = cases.take(np.arange(cases.size))
        known.chosen |= sure
        return [known]
    return _halves(cases, leaves(ordered[0])) if best is None else list(_split(cases, *best[1:]))


def _sizes(cases: Branches, node: Index | DirectionAt) -> NDArray[np.float64]:
    """The diagonals of the boxes in which the point of a field can be."""
    if isinstance(node, Index):
        return np.zeros(cases.size)
    place = cases.place(node)
    return np.hypot(*(place[:, 1] - place[:, 0]))


def _headings(cases: Branches, node: DirectionAt) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Pairs (case, heading): all that a field may have where its point can be."""
    place = cases.place(node)
    boxes = np.concatenate([place[:, 0] - MARGIN, place[:, 1] + MARGIN]).T
    return cast(VectorField, cast(Constant, node.field).value).headings(boxes)


def _options(cases: Branches, choice: Index | DirectionAt) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Pairs (case, option) of a choice, those of one case after those of the one before."""
    if isinstance(choice, DirectionAt):
        return _headings(cases, choice)
    count = len(choice.weights)
    return np.repeat(np.arange(cases.size), count), np.tile(np.arange(count, dtype=float), cases.size)


def _split(
    cases: Branches, choice: Index | DirectionAt, owner: NDArray[np.intp], chosen: NDArray[np.float64]
) -> Iterator[Branches]:
    """The cases once for each option of a choice."""
    for first in range(0, len(owner), _MOST_AT_ONCE):
        some = slice(first, first + _MOST_AT_ONCE)
        branches = cases.take(owner[some])
        branches.chosen[id(choice)] = chosen[some]
        yield branches


def _halves(cases: Branches, below: Sequence[Leaf]) -> list[Branches]:
    """The cases twice, with the widest range of a number, or of a coordinate of a point, halved.

    Raises:
        _TooMany: There is none.
    """
    widest, where = _FINEST, None
    for leaf in below:
        limits = cases.ranges[leaf.identity].reshape(-1, 2, cases.size)
        for axis, (low, high) in enumerate(limits):
            width = float((high - low).max())
            if not isinstance(leaf, Index) and widest < width < math.inf:
                widest, where = width, (leaf.identity, axis)
    if where is None:
        raise _TooMany
    identity, axis = where
    halves: list[Branches] = []
    for side in (0, 1):
        half = cases.take(np.arange(cases.size))
        ends = half.ranges[identity]
        middle = ends.reshape(-1, 2, cases.size)[axis].mean(axis=0)
        ends.reshape(-1, 2, cases.size)[axis, 1 - side] = middle
        halves.append(half)
    return halves


def _sharpened(cases: Branches) -> Branches:
    """The cases whose fields still point as chosen, now that little is left of the places."""
    for node in cases.tape.choices:
        if isinstance(node, DirectionAt) and cases.size:
            owner, heading = _headings(cases, node)
            same = np.abs(heading - cases.chosen[id(node)][owner]) <= SAME
            cases = cases.those(np.bincount(owner[same], minlength=cases.size) > 0)
    return cases
