"""Draws of a hidden point from which the way along fields leads to where an object is observed.

A point drawn anywhere hardly ever leads there: the way turns with every segment, and where lanes overlap with every
choice. Followed backwards from what is observed, step by step, few headings come into question at each step, those of
the lanes that can have led there. Such points are no more than draws: what comes of them is looked at forwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
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

__all__ = ["DrawsBack", "StepsBack", "steps_back"]

_WAYS = 4
"""Ways back that are followed for each draw."""
_FOLLOWED = 64
"""Draws that two ways are looked for in at once."""

_Indices = NDArray[np.intp]
_Numbers = NDArray[np.float64]


class DrawsBack:
    """Draws of a search, whose points are such that a way from them leads to what is observed, of some two ways."""

    def __init__(
        self,
        ways: Sequence[StepsBack],
        space: TrialSpace,
        anywhere: Callable[[int], TrialDraws],
        rng: np.random.Generator,
    ) -> None:
        """Take what is drawn.

        Args:
            ways: The ways back.
            space: What draws are made of.
            anywhere: Makes so many draws that lie anywhere.
            rng: Random numbers.
        """
        self._led: dict[int, int] = {}
        self._ways = ways
        pairs = [(one, other) for one, other in combinations(ways, 2) if one.leaf is other.leaf]
        self._parts = [
            *(_Alone(way, space, rng, self._followed) for way in ways),
            *(_Together(one, other, space, anywhere, self._followed) for one, other in pairs),
        ]
        self._space = space
        self._rng = rng

    @property
    def lead_nowhere(self) -> bool:
        """Whether there is a place to which none of the draws so far leads: more of them would hardly do."""
        return any(way.is_whole and not self._led.get(id(way), 1) for way in self._ways)

    def _followed(self, way: StepsBack, draws: TrialDraws) -> _Followed:
        """The ways back of draws, in which everything else is as it is drawn."""
        found = way.followed(self._space, draws, self._rng, _WAYS * draws.places.shape[1])
        self._led[id(way)] = self._led.get(id(way), 0) + len(found.draw)
        return found

    def put_into(self, draws: TrialDraws) -> None:
        """Have points of most draws be such ones.

        Raises:
            CannotEvaluate: Geometry cannot tell.
        """
        count: int = draws.places.shape[1]
        for number, part in enumerate(self._parts):
            part.put_into(draws, np.arange(number, count, len(self._parts) + 1))


@dataclass(frozen=True, eq=False)
class _Alone:
    """Points from which one way leads to what is observed."""

    way: StepsBack
    space: TrialSpace
    rng: np.random.Generator
    follow: Callable[[StepsBack, TrialDraws], _Followed]

    def put_into(self, draws: TrialDraws, some: _Indices) -> None:
        """Have points of some draws be such ones; of which there are any."""
        found = self.follow(self.way, draws.take(some))
        # one of the ways of each draw, the others do not matter
        order = self.rng.permutation(len(found.draw))
        mine, first = np.unique(found.draw[order], return_index=True)
        chosen = found.take(order[first])
        draws.places[self.space.hidden[self.way.leaf.identity].rows, some[mine]] = chosen.place.T
        draws.shares[:, some[mine]] = chosen.shares


class _Together:
    """Points from which two ways lead to what is observed: where they come out closest to each other.

    Many ways are followed at once, and the pairs of them taken one after the other.
    """

    def __init__(
        self,
        one: StepsBack,
        other: StepsBack,
        space: TrialSpace,
        anywhere: Callable[[int], TrialDraws],
        follow: Callable[[StepsBack, TrialDraws], _Followed],
    ) -> None:
        self.one = one
        self.other = other
        self.space = space
        self.anywhere = anywhere
        self.follow = follow
        self.own, self.uses = other.apart_from(one, space)
        self.left: TrialDraws | None = None

    def put_into(self, draws: TrialDraws, some: _Indices) -> None:
        """Have some draws be such ones."""
        if self.left is None or not self.left.places.shape[1]:
            self.left = self._closest()
        count = self.left.places.shape[1]
        some = some[:count]
        chosen = self.left.take(np.arange(len(some)))
        self.left = self.left.take(np.arange(len(some), count))
        draws.places[:, some], draws.shares[:, some] = chosen.places, chosen.shares

    def _closest(self) -> TrialDraws:
        """Draws that two ways make, those first that come out closest."""
        many = self.anywhere(_FOLLOWED)
        first, second = self.follow(self.one, many), self.follow(self.other, many)
        away = np.hypot(*(first.place[:, None] - second.place[None]).transpose(2, 0, 1))
        if not away.size:
            return many.take(np.arange(0))
        # of one way only the closest other one
        closest = away.argmin(axis=1)
        left = np.argsort(away[np.arange(len(closest)), closest], kind="stable")
        right = closest[left]
        found = many.take(first.draw[left])
        found.places[self.space.hidden[self.one.leaf.identity].rows] = first.place[left].T
        found.places[self.own] = many.places[self.own][:, second.draw[right]]
        found.shares[:] = first.shares[:, left]
        found.shares[self.uses] = second.shares[self.uses][:, right]
        return found


@dataclass(frozen=True, eq=False)
class StepsBack:
    """The way back from an observed place to a hidden point.

    Attributes:
        leaf: The point.
        end: The place that is observed.
        seen: Where that is.
        beyond: The ids of the nodes that hang on the point.
        before: The steps in which the others are interpreted.
        is_whole: Whether the place hangs on the point whatever choices come out as.
    """

    leaf: PointIn
    end: Node
    seen: tuple[float, float]
    beyond: frozenset[int]
    before: Steps
    is_whole: bool

    def apart_from(self, other: StepsBack, space: TrialSpace) -> tuple[_Indices, _Indices]:
        """The coordinates, and the uses of fields, on which this way hangs and another does not."""
        theirs = {id(node) for node in postorder([other.end])}
        mine = [node for node in postorder([self.end]) if id(node) not in theirs]
        known = {leaf.identity for leaf in leaves(other.end)}
        numbers = [space.hidden[leaf.identity].rows for leaf in leaves(self.end) if leaf.identity not in known]
        rows = [row for each in numbers for row in range(each.start, each.stop)]
        uses = [space.use_of(node) for node in mine if isinstance(node, DirectionAt)]
        return np.array(rows, dtype=np.intp), np.array(uses, dtype=np.intp)

    def followed(self, space: TrialSpace, draws: TrialDraws, rng: np.random.Generator, most: int) -> _Followed:
        """The ways back of draws, in which everything else is as it is drawn.

        Args:
            space: What draws are made of.
            draws: The draws.
            rng: Random numbers.
            most: How many ways are followed.

        Raises:
            CannotEvaluate: Geometry cannot tell.
        """
        count: int = draws.places.shape[1]
        known = space.values(self.before, draws)
        start = _Followed(np.arange(count), np.tile(np.array(self.seen), (count, 1)), draws.shares)
        todo = [(self.end, start)]
        begun = [start.take(np.arange(0))]
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
                    todo.append((step.inner, back.take(np.sort(rng.permutation(len(back.draw))[:most]))))
        return reduce(_Followed.beside, begun)


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

    def beside(self, other: _Followed) -> _Followed:
        """These ways and others."""
        return _Followed(
            np.concatenate([self.draw, other.draw]),
            np.concatenate([self.place, other.place]),
            np.concatenate([self.shares, other.shares], axis=1),
        )


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
                    options = [
                        each for below in postorder([node]) if isinstance(below, Select) for each in below.options
                    ]
                    is_whole = all(id(each) in beyond for each in options)
                    found.append(StepsBack(leaf, node, seen, beyond, before, is_whole))
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
