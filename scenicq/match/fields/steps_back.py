"""Draws of a hidden point from which the way along fields leads to where an object is observed.

A point drawn anywhere hardly ever leads there: the way turns with every segment, and where lanes overlap with every
choice. Followed backwards from what is observed, step by step, few headings come into question at each step, those of
the lanes that can have led there. Such points are no more than draws: what comes of them is looked at forwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.columns import DEFINED, Column
from scenicq.forest.groups import Comparison
from scenicq.forest.interpret import Steps
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    DirectionAt,
    Node,
    PointIn,
    Rotate,
    Select,
    VectorSum,
)
from scenicq.forest.walk import is_leaf, leaves, postorder
from scenicq.geometry.angles import rotate_array
from scenicq.geometry.road_direction import ONE_HEADING, RoadDirection
from scenicq.match.problem.conditioned import Item

if TYPE_CHECKING:
    from scenicq.match.fields.trials import TrialDraws, TrialSpace

__all__ = ["StepsBack", "draw_back", "steps_back"]

_WAYS = 4
"""Ways back that are followed for each draw."""

_Indices = NDArray[np.intp]
_Numbers = NDArray[np.float64]


def draw_back(ways: Sequence[StepsBack], space: TrialSpace, draws: TrialDraws, rng: np.random.Generator) -> None:
    """Have points of most draws be such that a way from them leads to what is observed, of some two ways.

    Args:
        ways: The ways back.
        space: What draws are made of.
        draws: The draws.
        rng: Random numbers.

    Raises:
        CannotEvaluate: Geometry cannot tell.
    """
    pairs = [(one, other) for one, other in combinations(ways, 2) if one.leaf is other.leaf]
    parts = len(ways) + len(pairs) + 1
    count: int = draws.places.shape[1]
    mine = {id(way): np.arange(number, count, parts) for number, way in enumerate(ways)}
    drawn = {id(way): way.draw(space, draws, mine[id(way)], rng) for way in ways}
    for number, (one, other) in enumerate(pairs, len(ways)):
        _meet(
            one,
            other,
            space,
            draws,
            (drawn[id(one)], drawn[id(other)]),
            np.arange(number, count, parts),
        )


def _meet(
    one: StepsBack,
    other: StepsBack,
    space: TrialSpace,
    draws: TrialDraws,
    drawn: tuple[_Indices, _Indices],
    some: _Indices,
) -> None:
    """Have some draws be those in which the ways from two places come out closest to each other."""
    rows = space.hidden[one.leaf.identity].rows
    first, second = (draws.places[rows, each] for each in drawn)
    away = np.hypot(*(first[:, :, None] - second[:, None, :]))
    closest = np.argsort(away, axis=None, kind="stable")[: len(some)]
    left, right = (drawn[axis][each] for axis, each in enumerate(np.unravel_index(closest, away.shape)))
    some = some[: len(left)]
    own, uses = other.apart_from(one, space)
    places, shares = draws.places[:, left], draws.shares[:, left]
    places[own], shares[uses] = draws.places[own][:, right], draws.shares[uses][:, right]
    draws.places[:, some], draws.shares[:, some] = places, shares


@dataclass(frozen=True, eq=False)
class StepsBack:
    """The way back from an observed place to a hidden point.

    Attributes:
        leaf: The point.
        end: The place that is observed.
        seen: Where that is.
        beyond: The ids of the nodes that hang on the point.
        before: The steps in which the others are interpreted.
    """

    leaf: PointIn
    end: Node
    seen: tuple[float, float]
    beyond: frozenset[int]
    before: Steps

    def apart_from(self, other: StepsBack, space: TrialSpace) -> tuple[_Indices, _Indices]:
        """The coordinates, and the uses of fields, on which this way hangs and another does not."""
        theirs = {id(node) for node in postorder([other.end])}
        mine = [node for node in postorder([self.end]) if id(node) not in theirs]
        known = {leaf.identity for leaf in leaves(other.end)}
        numbers = [space.hidden[leaf.identity].rows for leaf in leaves(self.end) if leaf.identity not in known]
        rows = [row for each in numbers for row in range(each.start, each.stop)]
        uses = [space.use_of(node) for node in mine if isinstance(node, DirectionAt)]
        return np.array(rows, dtype=np.intp), np.array(uses, dtype=np.intp)

    def draw(self, space: TrialSpace, draws: TrialDraws, some: _Indices, rng: np.random.Generator) -> _Indices:
        """Have the point of draws be one from which the way leads to what is observed; of which there is one.

        Args:
            space: What draws are made of.
            draws: The draws.
            some: The numbers of those that are meant.
            rng: Random numbers.

        Raises:
            CannotEvaluate: Geometry cannot tell.
        """
        known, count = space.values(self.before, draws.take(some)), len(some)
        ends = np.tile(np.array(self.seen), (count, 1))
        todo = [(self.end, _Followed(np.arange(count), ends, draws.shares[:, some]))]
        begun: list[_Followed] = []
        while todo:
            node, ways = todo.pop()
            if node is self.leaf:
                begun.append(ways)
            elif isinstance(node, Select):
                option = _numbers(known[id(node.index)], count)[ways.draw]
                for number, each in enumerate(node.options):
                    if each is self.leaf or id(each) in self.beyond:
                        todo.append((each, ways.take(np.flatnonzero(option == number))))
            elif isinstance(node, VectorSum):
                step = _step_of(node, self.beyond)
                if step is None:
                    inner, other = _sides(node, self.beyond)
                    along = _vectors(known[id(other)], count)[ways.draw]
                    todo.append((inner, _Followed(ways.draw, ways.place - along, ways.shares)))
                else:
                    turn = sum((_numbers(known[id(each)], count)[ways.draw] for each in step.turns), np.zeros(1))
                    ahead = rotate_array(_vectors(known[id(step.ahead)], count)[ways.draw], turn)
                    back = _back(step.field, ways, ahead, space.use_of(step.direction))
                    todo.append((step.inner, back.take(np.sort(rng.permutation(len(back.draw))[: _WAYS * count]))))
        found: list[_Indices] = [some[:0]]
        for ways in begun:
            # one of the ways of each draw, the others do not matter
            order = rng.permutation(len(ways.draw))
            mine, first = np.unique(ways.draw[order], return_index=True)
            chosen = ways.take(order[first])
            draws.places[space.hidden[self.leaf.identity].rows, some[mine]] = chosen.place.T
            draws.shares[:, some[mine]] = chosen.shares
            found.append(some[mine])
        return np.concatenate(found)


@dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """Ways that were followed back so far, several of a draw perhaps.

    Attributes:
        draw: The number of the draw, (n,).
        place: How far each has come, (n, 2).
        shares: Which heading each use of a field takes, (uses, n).
    """

    draw: _Indices
    place: _Numbers
    shares: _Numbers

    def take(self, some: _Indices) -> _Followed:
        """Some of the ways, possibly several times."""
        return _Followed(self.draw[some], self.place[some], self.shares[:, some])


@dataclass(frozen=True, slots=True)
class _Step:
    """A step along a field from a place that is not known yet: which way, and how far."""

    inner: Node
    direction: DirectionAt
    field: RoadDirection
    ahead: Node
    turns: list[Node]


def steps_back(items: Sequence[Item], steps: Steps) -> list[StepsBack]:
    """The ways back that constraints have, if any.

    Args:
        items: The constraints, conditioned.
        steps: Those in which their expressions are interpreted.
    """
    found: list[StepsBack] = []
    for constraint, node, seen in items:
        if not (isinstance(constraint, Comparison) and constraint.property == "position" and isinstance(seen, tuple)):
            continue
        for leaf in leaves(node):
            if isinstance(leaf, PointIn):
                beyond = _hanging_on(leaf, steps)
                if _leads_back(node, leaf, beyond):
                    before = tuple([step for step in steps if id(step[0]) not in beyond])
                    found.append(StepsBack(leaf, node, seen, beyond, before))
    return found


def _hanging_on(leaf: PointIn, steps: Steps) -> frozenset[int]:
    """The ids of the nodes that hang on a point, itself too."""
    found: set[int] = set()
    for node, below in steps:
        if (is_leaf(node) and cast(PointIn, node).identity is leaf.identity) or any(
            id(each) in found for each in below
        ):
            found.add(id(node))
    return frozenset(found)


def _leads_back(end: Node, leaf: PointIn, beyond: frozenset[int]) -> bool:
    """Whether a place can be followed back to a point, by a step along a field at least."""
    todo, has_step = [end], False
    while todo:
        node = todo.pop()
        if node is leaf or id(node) not in beyond:
            continue
        if isinstance(node, Select) and id(node.index) not in beyond:
            todo += node.options
        elif isinstance(node, VectorSum):
            step = _step_of(node, beyond)
            inner, other = _sides(node, beyond)
            if step is None and id(other) in beyond:
                return False
            has_step = has_step or step is not None
            todo.append(inner if step is None else step.inner)
        else:
            return False
    return has_step


def _sides(node: VectorSum, beyond: frozenset[int]) -> tuple[Node, Node]:
    """The side that hangs on a point, and the other."""
    return (node.left, node.right) if id(node.left) in beyond else (node.right, node.left)


def _step_of(node: VectorSum, beyond: frozenset[int]) -> _Step | None:
    """A sum as a step along a field, if it is one."""
    for inner, other in ((node.left, node.right), (node.right, node.left)):
        if id(inner) not in beyond or not isinstance(other, Rotate) or id(other.vector) in beyond:
            continue
        terms = _terms(other.angle)
        ahead = [each for each in terms if isinstance(each, DirectionAt) and each.point is inner]
        turns = [each for each in terms if not any(each is one for one in ahead)]
        field = ahead[0].field if len(ahead) == 1 else None
        known = not any(id(each) in beyond for each in turns)
        if known and isinstance(field, Constant) and isinstance(field.value, RoadDirection):
            return _Step(inner, ahead[0], field.value, other.vector, turns)
    return None


def _terms(angle: Node) -> list[Node]:
    """What an angle is the sum of, up to whole turns."""
    found: list[Node] = []
    todo = [angle]
    while todo:
        node = todo.pop()
        if isinstance(node, Arithmetic) and node.op in (ArithmeticOp.ADD, ArithmeticOp.WRAP):
            todo += node.args
        else:
            found.append(node)
    return found


def _back(field: RoadDirection, ways: _Followed, ahead: _Numbers, use: int) -> _Followed:
    """All steps back from where ways have come, each with the share that picks the heading of the step."""
    owner, heading, back = field.steps_to(ways.place, ahead)
    allowed = field.values_many(back)
    number = np.array(
        [
            next((index for index, each in enumerate(values) if abs(each - one) <= ONE_HEADING), -1)
            for one, values in zip(heading.tolist(), allowed, strict=True)
        ],
        dtype=np.intp,
    )
    counts = np.array(list(map(len, allowed)), dtype=np.intp)
    real = np.flatnonzero(number >= 0)
    found = ways.take(owner[real])
    found.shares[use] = (number[real] + 0.5) / counts[real]
    return _Followed(found.draw, back[real], found.shares)


def _numbers(column: Column, count: int) -> _Numbers:
    """The numbers of a column; nan where it has none."""
    data = column.data if isinstance(column.data, np.ndarray) else np.full(1, np.nan)
    return np.broadcast_to(np.where(column.status == DEFINED, data, np.nan), (count,))


def _vectors(column: Column, count: int) -> _Numbers:
    """The vectors of a column, (n, 2); nan where it has none."""
    axes = column.data if isinstance(column.data, tuple) else (np.full(1, np.nan),) * 2
    return np.column_stack([_numbers(Column(axis, column.status), count) for axis in axes])
