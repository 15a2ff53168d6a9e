"""Many cases of one group at once: which way each field points in each, and where the random numbers can then be.

A case is a column. What a label observes bounds the roots of the expressions, and the bounds of what is random follow,
whatever the expressions are made of. The bounds are never too narrow: a case of which nothing is left has no solution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.forest.bounds import FloatInterval, scalar_bounds, vector_bounds
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import (
    Arithmetic,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    Coordinate,
    DirectionAt,
    DiscreteRange,
    Distance,
    Encloses,
    Identity,
    Intersects,
    Leaf,
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
    Undefined,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, conjuncts, is_leaf
from scenicq.limits import LIMITS
from scenicq.match.fields.constraint_network import ConstraintNetwork
from scenicq.match.fields.interval_domain import (
    HALF_TURNS,
    Enclosure,
    add,
    angle_of,
    common,
    cone,
    divide,
    everything,
    find_empty,
    lengths,
    negative,
    rotate,
    subtract,
    times,
    turning,
    turns_near,
    wrap_angles,
)
from scenicq.match.fields.interval_functions import PARTIAL, arguments_of, range_of
from scenicq.match.fields.region_bounds import distance_between, places_of
from scenicq.match.fields.region_conditions import RegionCondition, may_be
from scenicq.match.problem.conditioned import Item
from scenicq.match.tolerance import ROUNDING, SLACK

__all__ = ["BoxSet"]

_WORTH = 0.8
"""A pass that leaves more than this share of every range in every case is the last."""
_OFF: Enclosure = np.array([[-2 * ROUNDING], [2 * ROUNDING]])
"""Metres or radians that the evaluation of two sides may be off together."""


@dataclass(eq=False)
class BoxSet:
    """Cases.

    Attributes:
        network: What they are cases of.
        size: How many there are.
        ranges: Where each random number or point can be.
        chosen: For each choice that was made, by the node's id, the number of the option (n,), or of a field the range
            of headings (2, n).
        asked: By the id of a field's use, how large the box of its point was when its headings were last looked up.
    """

    network: ConstraintNetwork
    size: int
    ranges: dict[Identity, Enclosure]
    chosen: dict[int, NDArray[np.float64]] = field(default_factory=dict[int, "NDArray[np.float64]"])
    asked: dict[int, NDArray[np.float64]] = field(default_factory=dict[int, "NDArray[np.float64]"])
    _bounds: dict[int, Enclosure] = field(default_factory=dict[int, Enclosure])
    _turns: dict[int, Enclosure] = field(default_factory=dict[int, Enclosure])

    @classmethod
    def start(cls, network: ConstraintNetwork, ranges: Mapping[Identity, Sequence[FloatInterval]]) -> BoxSet:
        """One case for each of the intervals that some numbers are kept in, in order; else a single one."""
        size = len(next(iter(ranges.values()))) if ranges else 1
        known: dict[Identity, Enclosure] = {}
        for identity, leaf in network.leaves.items():
            if identity in ranges:
                known[identity] = np.array(ranges[identity], dtype=float).T.copy()
                continue
            limits = np.array(vector_bounds(leaf) if isinstance(leaf, PointIn) else scalar_bounds(leaf))[..., None]
            if not _is_known(leaf):
                # they were worked out by plain arithmetic
                limits = limits + np.array([[-SLACK], [SLACK]])
            known[identity] = np.repeat(limits, size, axis=-1)
        return cls(network, size, known)

    @classmethod
    def around(cls, network: ConstraintNetwork, near: Mapping[Identity, Value], reach: float) -> BoxSet:
        """One case, in which no random number or coordinate is farther than a reach from a value, if it has one."""
        found = cls.start(network, {})
        for identity, own in found.ranges.items():
            if identity not in near:
                continue
            value = np.array(near[identity], dtype=float).reshape(own.shape[:-2])[..., None, None]
            found.ranges[identity] = common(own, value + np.array([[-reach], [reach]]))
        return found

    def take(self, cases: NDArray[np.intp]) -> BoxSet:
        """Some of the cases, possibly several times."""
        look()
        return BoxSet(
            self.network,
            len(cases),
            {key: value[..., cases] for key, value in self.ranges.items()},
            {key: value[..., cases] for key, value in self.chosen.items()},
            {key: value[cases] for key, value in self.asked.items()},
            {key: value[..., cases] for key, value in self._bounds.items()},
            {key: value[..., cases] for key, value in self._turns.items()},
        )

    def place(self, node: DirectionAt) -> Enclosure:
        """Where the point of a field can be, (2, 2, n), after narrowing."""
        return self._vector(node.point)

    def value(self, node: Node) -> Enclosure:
        """The bounds of a number, (2, n), after narrowing."""
        return self._scalar(node)

    def those(self, wanted: NDArray[np.bool_]) -> BoxSet:
        """The cases that a mask (n,) names."""
        return self if wanted.all() else self.take(np.nonzero(wanted)[0])

    def narrowed(self) -> BoxSet:
        """The cases of which something is left, over narrower ranges."""
        branches = self
        for _ in range(LIMITS.narrowing_passes):
            # most cases that are none miss what the label observes from the start
            branches._upward()
            branches = branches.those(~branches._lost())
            if not branches.size:
                break
            before = dict(branches.ranges)
            branches._downward()
            left = ~branches._lost()
            small = all(
                bool((_width(after)[..., left] > _WORTH * _width(before[key])[..., left] - SLACK).all())
                for key, after in branches.ranges.items()
            )
            branches = branches.those(left)
            if small or not branches.size:
                break
        return branches

    def _upward(self) -> None:
        # overlaps of ends and of nothing are settled where they are met
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            for node in self.network.nodes:
                self._forward(node)
            for item in self.network.items:
                self._compare(item)

    def _downward(self) -> None:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            for node in reversed(self.network.nodes):
                self._backward(node)

    def _lost(self) -> NDArray[np.bool_]:
        lost = np.zeros(self.size, dtype=bool)
        for each in (*self.ranges.values(), *self._bounds.values()):
            lost |= find_empty(each)
        return lost

    # --- bounds

    def _scalar(self, node: Node) -> Enclosure:
        found = self._bounds.get(id(node))
        return everything(np.empty((2, self.size))) if found is None else found

    def _vector(self, node: Node) -> Enclosure:
        found = self._bounds.get(id(node))
        return everything(np.empty((2, 2, self.size))) if found is None else found

    def _meet(self, node: Node, more: Enclosure) -> None:
        own = self._bounds.get(id(node))
        if own is None:
            self._bounds[id(node)] = np.broadcast_to(more, (*more.shape[:-1], self.size))
        elif own.ndim == more.ndim:
            self._bounds[id(node)] = common(own, more)

    def _forward(self, node: Node) -> None:
        found = self._value(node)
        if found is not None:
            self._meet(node, found)

    def _value(self, node: Node) -> Enclosure | None:
        match node:
            case Constant(value=float() as number):
                return None if id(node) in self._bounds else np.full((2, self.size), number)
            case Constant(value=(float() as x, float() as y)):
                return np.array([[[x], [x]], [[y], [y]]]) if id(node) not in self._bounds else None
            case _ if is_leaf(node):
                if id(node) in self.chosen:
                    return np.stack([self.chosen[id(node)]] * 2)
                return self._support(cast(Leaf, node))
            case VectorOf():
                return np.stack([self._scalar(node.x), self._scalar(node.y)])
            case VectorSum():
                return add(self._vector(node.left), self._vector(node.right))
            case Scale():
                return times(self._vector(node.vector), self._scalar(node.factor))
            case Rotate():
                angle = self.network.headings.get(id(node.angle), self._scalar(node.angle))
                turn = self._turns.get(id(node)) if isinstance(node.angle, Constant) else None
                if turn is None:
                    turn = self._turns[id(node)] = turning(np.broadcast_to(angle, (2, self.size)))
                return rotate(self._vector(node.vector), turn)
            case Coordinate():
                return self._vector(node.vector)[node.axis]
            case Bearing():
                return wrap_angles(angle_of(self._vector(node.vector)))
            case Norm():
                return lengths(self._vector(node.vector))
            case Distance():
                return distance_between(node.region, self._vector(node.point))
            case DirectionAt():
                chosen = self.chosen.get(id(node))
                # one direction of a field is off by rounding from cell to cell
                return HALF_TURNS if chosen is None else chosen + _OFF
            case Arithmetic():
                return range_of(node.op, [self._scalar(arg) for arg in node.args])
            case Select():
                return self._select(node)
            case _:
                return None

    def _support(self, leaf: Leaf) -> Enclosure:
        """Where a random variable is, as far as it is known and its parameters allow."""
        own = self.ranges[leaf.identity]
        if isinstance(leaf, DiscreteRange):
            return np.stack([np.ceil(own[0] - ROUNDING), np.floor(own[1] + ROUNDING)])
        if not isinstance(leaf, Range | TruncatedNormal) or _is_known(leaf):
            return own
        low, high = [self._scalar(end) for end in (leaf.low, leaf.high)]
        if isinstance(leaf, Range):
            # the ends may come in either order
            low, high = np.minimum(low, high), np.maximum(low, high)
        return common(own, np.stack([low[0], high[1]]))

    def _select(self, node: Select) -> Enclosure | None:
        options = [self._bounds.get(id(option)) for option in node.options]
        known = [option for option in options if option is not None]
        chosen = self.chosen.get(id(node.index))
        if len({option.ndim for option in known}) != 1 or (chosen is None and len(known) < len(options)):
            return None
        stacked = np.stack([everything(known[0]) if option is None else option for option in options])
        if chosen is not None:
            return np.take_along_axis(stacked, chosen.astype(int).reshape((1,) * (stacked.ndim - 1) + (-1,)), axis=0)[0]
        return np.stack([stacked[..., 0, :].min(axis=0), stacked[..., 1, :].max(axis=0)], axis=-2)

    # --- what is observed and what is required

    def _compare(self, item: Item) -> None:
        constraint, node, seen = item
        if not isinstance(constraint, Comparison):
            for part, where in self._chosen_parts(node, conjuncts):
                self._hold(part, where)
            return
        margin = self.network.tolerance.of(constraint.object, constraint.property)
        for part, where in self._chosen_parts(node, lambda whole: (whole,)):
            if isinstance(part, Constant) and not margin.allows(part.value, seen, SLACK):
                self._refuse(where)
        if isinstance(seen, tuple) and constraint.property == "position":
            a, b = margin.size + SLACK, margin.y + SLACK
            off = np.array([[[-a], [a]], [[-b], [b]]])
            self._meet(node, np.array(seen, dtype=float)[:, None, None] + off)
        elif id(node) in self.network.headings:
            self._meet(node, turns_near(self.network.headings[id(node)], self._scalar(node)))
        elif isinstance(seen, float):
            allowed = margin.size + SLACK
            self._meet(node, np.array([[seen - allowed], [seen + allowed]]))

    def _chosen_parts(
        self, root: Node, split: Callable[[Node], Iterable[Node]]
    ) -> Iterator[tuple[Node, NDArray[np.bool_]]]:
        """What an expression, split, comes to as its choices have been made, and in which cases, (n,)."""
        todo = [(root, np.ones(self.size, dtype=bool))]
        while todo:
            whole, where = todo.pop()
            for part in split(whole):
                chosen = self.chosen.get(id(part.index)) if isinstance(part, Select) else None
                if isinstance(part, Select) and chosen is not None:
                    todo += [(option, where & (chosen == number)) for number, option in enumerate(part.options)]
                else:
                    yield part, where

    def _hold(self, node: Node, where: NDArray[np.bool_]) -> None:
        """Have a condition hold in some of the cases, (n,)."""
        match node:
            case Compare():
                left, right = self._scalar(node.left), self._scalar(node.right)
                if left.ndim > 2 or right.ndim > 2:
                    return
                # floating point makes the comparison, after which one side may be beyond the other by rounding
                left, right = left + _OFF, right + _OFF
                if node.op in (CompareOp.LT, CompareOp.LE, CompareOp.EQ):
                    self._order(node.left, left, node.right, right, where)
                if node.op in (CompareOp.GT, CompareOp.GE, CompareOp.EQ):
                    self._order(node.right, right, node.left, left, where)
            case Constant(value=False | Undefined()):
                self._refuse(where)
            case Contains() | Intersects() | Encloses():
                for point, place in places_of(node, self._vector, self._scalar):
                    self._meet(point, np.where(where, place, everything(place)))
                self._refuse_unless(node, True, where)
            case Logic(op=LogicOp.NOT, args=(Contains() | Intersects() | Encloses() as inner,)):
                self._refuse_unless(inner, False, where)
            case _:
                pass

    def _order(self, below: Node, low: Enclosure, above: Node, high: Enclosure, where: NDArray[np.bool_]) -> None:
        """Have one number be at most another one in some of the cases."""
        self._meet(below, np.stack([np.full(self.size, -np.inf), np.where(where, high[1], np.inf)]))
        self._meet(above, np.stack([np.where(where, low[0], -np.inf), np.full(self.size, np.inf)]))

    def _refuse_unless(self, node: RegionCondition, wanted: bool, where: NDArray[np.bool_]) -> None:
        """Have nothing left where a condition on regions is never what it should be."""
        possible = may_be(node, wanted, self._vector, self._scalar)
        if possible is not None:
            self._refuse(where & ~possible)

    def _refuse(self, where: NDArray[np.bool_]) -> None:
        """Have nothing left in some of the cases: no number is in no bounds, whatever the nodes are."""
        bounds = np.where(where, [[np.inf], [-np.inf]], [[-np.inf], [np.inf]])
        known = self._bounds.get(id(self.network))
        self._bounds[id(self.network)] = bounds if known is None else common(known, bounds)

    def _backward(self, node: Node) -> None:
        own = self._bounds.get(id(node))
        if own is None:
            return
        match node:
            case VectorOf():
                self._meet(node.x, own[0])
                self._meet(node.y, own[1])
            case VectorSum():
                left, right = self._vector(node.left), self._vector(node.right)
                self._meet(node.left, subtract(own, right))
                self._meet(node.right, subtract(own, left))
            case Scale():
                vector, factor = self._vector(node.vector), self._scalar(node.factor)
                self._meet(node.vector, divide(own, factor))
                for axis in (0, 1):
                    self._meet(node.factor, divide(own[axis], vector[axis]))
            case Rotate():
                sine, cosine = self._turns[id(node)]
                self._meet(node.vector, rotate(own, np.stack([negative(sine), cosine])))
                angle = self._scalar(node.angle)
                if (angle[0] != angle[1]).any():
                    turn = subtract(angle_of(own), angle_of(self._vector(node.vector)))
                    self._meet(node.angle, turns_near(turn, angle))
            case Coordinate():
                both = everything(np.empty((2, 2, self.size)))
                both[node.axis] = own
                self._meet(node.vector, both)
            case Norm():
                self._meet(node.vector, np.stack([[-own[1], own[1]]] * 2))
            case Bearing():
                self._meet(node.vector, cone(self._vector(node.vector), own))
            case Arithmetic():
                if node.op not in PARTIAL or id(node) in self.network.required:
                    args = [self._scalar(arg) for arg in node.args]
                    for arg, found in zip(node.args, arguments_of(node.op, own, args), strict=False):
                        self._meet(arg, found)
            case Select() if id(node.index) in self.chosen:
                for number, option in enumerate(node.options):
                    self._meet(option, np.where(self.chosen[id(node.index)] == number, own, everything(own)))
            case _ if is_leaf(node):
                identity = cast(Leaf, node).identity
                self.ranges[identity] = self._bounds[id(node)] = common(own, self.ranges[identity])
            case _:
                pass


def _is_known(leaf: Leaf) -> bool:
    """Whether the ends of what a random variable can be are numbers that the program has."""
    return not isinstance(leaf, PointIn) and all(isinstance(part, Constant) for part in children(leaf))


def _width(limits: Enclosure) -> NDArray[np.float64]:
    with np.errstate(over="ignore"):
        return limits[..., 1, :] - limits[..., 0, :]
