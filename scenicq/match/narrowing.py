"""Random numbers narrowed to where the label can be reached: interval analysis forth and back through a group.

What a label observes bounds the roots of the expressions; the bounds of what is random follow, whatever the expressions
are made of. Never too narrow. A road followed for 2 to 8 m to a car whose place is known leaves centimetres of the
range, and so one piece of the road instead of all that is within reach.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

from scenicq.forest.bounds import EVERYTHING, Box, Interval, add, multiply, scalar_bounds, vector_bounds
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    DirectionAt,
    Identity,
    Logic,
    LogicOp,
    Node,
    PointIn,
    Range,
    Rotate,
    Scale,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, leaves, postorder, transform
from scenicq.geometry.fields import VectorField
from scenicq.match.ladder import Item
from scenicq.match.options import Tolerance
from scenicq.match.spans import (
    angle_of,
    common,
    divide,
    empty,
    grown,
    near_turn,
    negative,
    rotate,
    subtract,
    turned,
)
from scenicq.match.sums import Form, form_of

__all__ = ["Narrower", "narrowed", "within"]

_PASSES = 8
_SLACK = 1e-6
"""Metres or radians by which bounds are grown, so that rounding loses nothing."""
_WORTH = 0.9
"""A pass that leaves more than this share of every range is the last."""
_MOST_WAYS, _FINE = 200.0, 0.01
"""Combinations of directions that can be gone through, and width of a range below which there will hardly be fewer."""
_MOST_AREA = 400.0
"""Square metres in which the directions of a field are looked up."""

_Bounds = Interval | Box | None


@dataclass(frozen=True, slots=True)
class Narrower:
    """What is left of a group.

    Attributes:
        items: Its constraints over narrower ranges.
        wide: A random number that leaves open which way a field points, and its range; None if there is none.
    """

    items: list[Item]
    wide: tuple[Identity, Interval] | None


def narrowed(items: Sequence[Item], tolerance: Tolerance) -> Narrower | Item:
    """The items over narrower ranges; or the item that cannot be satisfied.

    Args:
        items: The constraints of a group, conditioned; what they share is shared.
        tolerance: Per feature.
    """
    found = _Narrowing(items, tolerance)
    lost = found.run()
    if lost is not None:
        return lost
    return Narrower(within(items, found.ranges), found.wide())


def within(items: Sequence[Item], ranges: Mapping[Identity, Interval]) -> list[Item]:
    """The items with random numbers kept in narrower ranges."""

    def step(node: Node) -> Node:
        if isinstance(node, Range | TruncatedNormal) and node.identity in ranges:
            low, high = ranges[node.identity]
            return replace(node, low=Constant(low, span=node.low.span), high=Constant(high, span=node.high.span))
        return node

    memo: dict[int, Node] = {}
    return [(c, transform(node, step, memo), seen) for c, node, seen in items]


class _Narrowing:
    """Bounds of all nodes of a group."""

    def __init__(self, items: Sequence[Item], tolerance: Tolerance) -> None:
        self.items = items
        self.tolerance = tolerance
        self.nodes = [list(postorder((item[1],))) for item in items]
        self.known: dict[int, _Bounds] = {}
        self.ranges: dict[Identity, Interval] = {}
        self.counts: dict[int, int] = {}
        self.headings: dict[int, tuple[Box, Interval]] = {}

    def run(self) -> Item | None:
        """Narrow until little changes; the item that became impossible, if one did."""
        for _ in range(_PASSES):
            before = dict(self.ranges)
            for item, nodes in zip(self.items, self.nodes, strict=True):
                for node in nodes:
                    if not self._forward(node):
                        return item
                if not (self._compare(item) and self._solve(nodes)):
                    return item
                for node in reversed(nodes):
                    if not self._backward(node):
                        return item
            if all(
                identity in before and _width(limits) > _WORTH * _width(before[identity])
                for identity, limits in self.ranges.items()
            ):
                break
        return None

    def wide(self) -> tuple[Identity, Interval] | None:
        """The widest range among those that directions hang on which may differ much."""
        best: tuple[Identity, Interval] | None = None
        ways = 1.0
        for node in {id(node): node for nodes in self.nodes for node in nodes}.values():
            if isinstance(node, DirectionAt):
                ways *= self.counts.get(id(node), math.inf)
                for leaf in leaves(node.point):
                    limits = self.ranges.get(leaf.identity)
                    if limits is not None and _width(limits) > max(_FINE, _width(best[1]) if best else 0.0):
                        best = (leaf.identity, limits)
        if ways <= _MOST_WAYS:
            return None
        return best

    # --- bounds

    def _meet(self, node: Node, more: _Bounds) -> bool:
        """Cut a node's bounds; False if nothing is left."""
        own = self.known.get(id(node))
        if more is None:
            return True
        if own is None:
            self.known[id(node)] = more
            return not empty(more)
        if isinstance(own[0], tuple) != isinstance(more[0], tuple):
            return True
        cut: Interval | Box = common(cast(Box, own), cast(Box, more))
        self.known[id(node)] = cut
        return not empty(cut)

    def _scalar(self, node: Node) -> Interval:
        found = self.known.get(id(node))
        return EVERYTHING if found is None or isinstance(found[0], tuple) else cast(Interval, found)

    def _vector(self, node: Node) -> Box:
        found = self.known.get(id(node))
        return (EVERYTHING, EVERYTHING) if found is None or not isinstance(found[0], tuple) else cast(Box, found)

    def _forward(self, node: Node) -> bool:
        match node:
            case Range() | TruncatedNormal():
                own: _Bounds = self.ranges.get(node.identity) or scalar_bounds(node)
                if isinstance(node.low, Constant) and isinstance(node.high, Constant):
                    if not self._meet(node, own):
                        return False
                    self.ranges[node.identity] = self._scalar(node)
                return self._meet(node, own)
            case VectorOf():
                own = (self._scalar(node.x), self._scalar(node.y))
            case VectorSum():
                left, right = self._vector(node.left), self._vector(node.right)
                own = (add(left[0], right[0]), add(left[1], right[1]))
            case Scale():
                (x, y), factor = self._vector(node.vector), self._scalar(node.factor)
                own = (multiply(x, factor), multiply(y, factor))
            case Rotate():
                own = rotate(self._vector(node.vector), self._scalar(node.angle))
            case Coordinate():
                own = self._vector(node.vector)[node.axis]
            case Bearing():
                own = angle_of(self._vector(node.vector))
            case DirectionAt():
                own = self._direction(node)
            case Arithmetic():
                own = self._arithmetic(node)
            case Constant() if isinstance(node.value, tuple):
                own = vector_bounds(node)
            case Constant() if isinstance(node.value, float):
                own = (node.value, node.value)
            case PointIn():
                own = vector_bounds(node)
            case _:
                return True
        return self._meet(node, own)

    def _arithmetic(self, node: Arithmetic) -> _Bounds:
        args = [self._scalar(arg) for arg in node.args]
        match node.op:
            case ArithmeticOp.ADD:
                total = args[0]
                for arg in args[1:]:
                    total = add(total, arg)
                return total
            case ArithmeticOp.SUB:
                return subtract(args[0], args[1])
            case ArithmeticOp.NEG:
                return negative(args[0])
            case ArithmeticOp.MUL:
                return multiply(args[0], args[1])
            case ArithmeticOp.DIV:
                return divide(args[0], args[1])
            case ArithmeticOp.WRAP:
                return turned(args[0], (-math.pi, math.pi))
            case ArithmeticOp.ABS:
                low, high = args[0]
                return (max(low, -high, 0.0), max(-low, high))
            case _:
                return scalar_bounds(node)

    def _direction(self, node: DirectionAt) -> _Bounds:
        """The arc of the directions that a field has where its point can be; None if that is anywhere."""
        (x0, x1), (y0, y1) = box = grown(self._vector(node.point), _SLACK)
        if not isinstance(node.field, Constant) or not (x1 - x0) * (y1 - y0) <= _MOST_AREA:
            return None
        last = self.headings.get(id(node))
        if last is None or (last[1][0] < last[1][1] and last[0] != box):
            cells = cast(VectorField, node.field.value).cells((x0, y0, x1, y1))
            near = {
                cell.heading
                for cell in cells
                if cell.bounds[0] <= x1 and cell.bounds[2] >= x0 and cell.bounds[1] <= y1 and cell.bounds[3] >= y0
            }
            self.counts[id(node)] = len(near)
            # an empty arc is left to those who can say why
            last = self.headings[id(node)] = (box, (min(near), max(near)) if near else (-math.pi, math.pi))
        return last[1]

    # --- sums in which a random number occurs many times

    def _solve(self, nodes: list[Node]) -> bool:
        """Cut the ranges that an observed position is a sum of, each with all its occurrences taken together."""
        if not isinstance((self.known.get(id(nodes[-1])) or (0.0,))[0], tuple):
            return True
        forms: dict[int, Form] = {}
        for node in nodes:
            forms[id(node)] = form_of(node, [forms[id(child)] for child in children(node)], self.known, self.ranges)
        constant, terms = forms[id(nodes[-1])]
        for axis in (0, 1):
            own = self._vector(nodes[-1])[axis]
            parts = {identity: multiply(self.ranges[identity], by[axis]) for identity, by in terms.items()}
            for identity, by in terms.items():
                rest = subtract(own, constant[axis])
                for other, part in parts.items():
                    rest = rest if other is identity else subtract(rest, part)
                cut = common(self.ranges[identity], divide(rest, by[axis]))
                if empty(cut):
                    return False
                self.ranges[identity] = cut
        return True

    def _compare(self, item: Item) -> bool:
        constraint, node, seen = item
        if not isinstance(constraint, Comparison):
            return self._hold(node)
        tolerance = self.tolerance
        if isinstance(seen, tuple):
            if constraint.property != "position":
                return True
            x, y = seen
            a, b = tolerance.x, tolerance.y
            if a is None or b is None:
                a = b = tolerance.position
            a, b = a + _SLACK, b + _SLACK
            return self._meet(node, ((x - a, x + a), (y - b, y + b)))
        if isinstance(seen, bool) or not isinstance(seen, float):
            return True
        if constraint.property == "heading":
            allowed = tolerance.heading + _SLACK
            return self._meet(node, near_turn((seen - allowed, seen + allowed), self._scalar(node)))
        allowed = tolerance.other + _SLACK
        return self._meet(node, (seen - allowed, seen + allowed))

    def _hold(self, node: Node) -> bool:
        match node:
            case Logic() if node.op is LogicOp.AND:
                return all(self._hold(part) for part in node.args)
            case Compare():
                (a, b), (c, d) = self._scalar(node.left), self._scalar(node.right)
                less = node.op in (CompareOp.LT, CompareOp.LE, CompareOp.EQ)
                more = node.op in (CompareOp.GT, CompareOp.GE, CompareOp.EQ)
                fits = True
                if less:
                    fits = self._meet(node.left, (-math.inf, d)) and self._meet(node.right, (a, math.inf))
                if fits and more:
                    fits = self._meet(node.left, (c, math.inf)) and self._meet(node.right, (-math.inf, b))
                return fits
            case _:
                return True

    def _backward(self, node: Node) -> bool:
        match node:
            case VectorOf():
                x, y = self._vector(node)
                return self._meet(node.x, x) and self._meet(node.y, y)
            case VectorSum():
                own, left, right = self._vector(node), self._vector(node.left), self._vector(node.right)
                return self._meet(node.left, (subtract(own[0], right[0]), subtract(own[1], right[1]))) and self._meet(
                    node.right, (subtract(own[0], left[0]), subtract(own[1], left[1]))
                )
            case Scale():
                own, vector, factor = self._vector(node), self._vector(node.vector), self._scalar(node.factor)
                return (
                    self._meet(node.vector, (divide(own[0], factor), divide(own[1], factor)))
                    and self._meet(node.factor, divide(own[0], vector[0]))
                    and self._meet(node.factor, divide(own[1], vector[1]))
                )
            case Rotate():
                own, angle = self._vector(node), self._scalar(node.angle)
                if not self._meet(node.vector, rotate(own, negative(angle))):
                    return False
                before, after = angle_of(self._vector(node.vector)), angle_of(own)
                if before is None or after is None:
                    return True
                return self._meet(node.angle, near_turn(subtract(after, before), angle))
            case Coordinate():
                own = self._scalar(node)
                return self._meet(node.vector, (own, EVERYTHING) if node.axis == 0 else (EVERYTHING, own))
            case Arithmetic():
                return self._arithmetic_back(node)
            case Range() | TruncatedNormal():
                if node.identity not in self.ranges:
                    return True
                fits = self._meet(node, self.ranges[node.identity])
                self.ranges[node.identity] = self._scalar(node)
                return fits
            case _:
                return True

    def _arithmetic_back(self, node: Arithmetic) -> bool:
        own, args = self._scalar(node), [self._scalar(arg) for arg in node.args]
        match node.op:
            case ArithmeticOp.ADD:
                for number, arg in enumerate(node.args):
                    rest = own
                    for other in (*args[:number], *args[number + 1 :]):
                        rest = subtract(rest, other)
                    if not self._meet(arg, rest):
                        return False
                return True
            case ArithmeticOp.SUB:
                return self._meet(node.args[0], add(own, args[1])) and self._meet(node.args[1], subtract(args[0], own))
            case ArithmeticOp.NEG:
                return self._meet(node.args[0], negative(own))
            case ArithmeticOp.MUL:
                return self._meet(node.args[0], divide(own, args[1])) and self._meet(node.args[1], divide(own, args[0]))
            case ArithmeticOp.DIV:
                return self._meet(node.args[0], multiply(own, args[1]))
            case ArithmeticOp.WRAP:
                return self._meet(node.args[0], near_turn(own, args[0]))
            case ArithmeticOp.ABS:
                return self._meet(node.args[0], (-own[1], own[1]))
            case _:
                return True


def _width(limits: Interval) -> float:
    return limits[1] - limits[0]
