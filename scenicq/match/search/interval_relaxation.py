"""Necessary conditions of groups, for many pairs of label objects at once: interval analysis over arrays.

What a group demands is relaxed to intervals, exact in what the label observes and generous in everything random, and
evaluated for all candidates of its roles together. A pair that fails is out before anything expensive looks at it; one
that passes has proven nothing. In the frame of an observed heading, "ahead of it by 3 to 6 m" stays a narrow strip.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias, assert_never, cast

import numpy as np

from scenicq.forest.bounds import EVERYTHING, vector_bounds
from scenicq.forest.groups import Comparison, Group
from scenicq.forest.nodes import (
    Arithmetic,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    Coordinate,
    DirectionAt,
    DiscAt,
    DiscreteRange,
    Distance,
    Encloses,
    Feature,
    Index,
    Intersects,
    Logic,
    LogicOp,
    Node,
    Norm,
    Normal,
    PointIn,
    Range,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Rotate,
    Scale,
    SectorAt,
    Select,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder
from scenicq.match.search.interval_arrays import (
    SLACK,
    Array,
    add,
    arithmetic,
    is_exact,
    is_point,
    largest,
    least,
    most,
    multiply,
    nearest,
    rotated,
)
from scenicq.match.tolerance import Tolerance

__all__ = ["Observed", "Steps", "possible", "steps_of"]

Observed = Callable[[int, str], Array | tuple[Array, Array] | None]
"""What is observed of an object: numbers or a pair of them for all its candidates; None where it is no number."""


@dataclass(frozen=True, slots=True)
class _Bool:
    can_hold: Array
    can_fail: Array


_OPEN = _Bool(True, True)
_PLANE = (EVERYTHING, EVERYTHING)


Steps: TypeAlias = tuple[tuple[Node, tuple[Node, ...]], ...]
"""What a group's constraints are made of: nodes with their children, which come before them."""


def steps_of(group: Group) -> Steps:
    """The steps in which a group's constraints are evaluated."""
    return tuple((node, children(node)) for node in postorder([item.expression for item in group.constraints]))


def possible(group: Group, steps: Steps, observed: Observed, tolerance: Tolerance) -> Array:
    """For which candidates of its roles a group may be satisfiable.

    Args:
        group: The group.
        steps: Those of the group.
        observed: Values of features, as arrays that broadcast against each other.
        tolerance: Per feature.

    Returns:
        A boolean or a boolean array of the broadcast shape; False only where no solution exists.
    """
    with np.errstate(all="ignore"):
        evaluation = _Evaluation(observed, steps)
        result: Array = True
        for item in group.constraints:
            if isinstance(item, Comparison):
                answer = _reachable(evaluation, item, tolerance)
            else:
                answer = cast(_Bool, evaluation.known[id(item.expression)]).can_hold
            result = answer if result is True else np.logical_and(result, answer)
    return result


def _reachable(evaluation: _Evaluation, item: Comparison, tolerance: Tolerance) -> Array:
    seen = evaluation.observed(item.object, item.property)
    if seen is None:
        return True
    value = evaluation.known[id(item.expression)]
    if value is None or isinstance(value, _Bool):
        return True
    margin = tolerance.of(item.object, item.property)
    if isinstance(seen, tuple):
        if item.property != "position" or not _is_pair(value):
            return True
        return evaluation.meets(item.expression, cast("tuple[Array, Array]", seen), margin.reach + SLACK)
    if _is_pair(value):
        return True
    low, high = value
    allowed = margin.size + SLACK
    if margin.kind != "arc":
        return (low - allowed <= seen) & (seen <= high + allowed)
    width = high - low + 2 * allowed
    return ~np.isfinite(width) | (np.mod(seen - low + allowed, math.tau) <= width)


def _is_pair(value: Any) -> bool:
    return isinstance(value, tuple) and isinstance(cast("tuple[object, object]", value)[0], tuple)


class _Evaluation:
    """Bounds of nodes for one set of candidates.

    Attributes:
        observed: What is observed.
        known: By the id of a node: a scalar's span, a vector's pair of spans, a `_Bool` for what is true or false,
            else a guess that is open.
    """

    def __init__(self, observed: Observed, steps: Steps) -> None:
        self.observed = observed
        self.known: dict[int, Any] = {}
        for node, below in steps:
            self.known[id(node)] = self._value(node, [self.known[id(child)] for child in below])

    def _value(self, node: Node, args: list[Any]) -> Any:
        match node:
            case Constant():
                if isinstance(node.value, bool):
                    return _Bool(node.value, not node.value)
                if isinstance(node.value, float):
                    return (node.value, node.value)
                if isinstance(node.value, tuple):
                    return tuple((part, part) for part in node.value)
                return None
            case Feature():
                seen = self.observed(node.object, node.property)
                if seen is None:
                    return _PLANE if node.kind == "vector" else EVERYTHING if node.kind == "scalar" else None
                if not isinstance(seen, tuple):
                    return (seen, seen)
                return tuple((part, part) for part in cast("tuple[Array, Array]", seen))
            case Arithmetic():
                usable = all(isinstance(arg, tuple) and not _is_pair(arg) for arg in args)
                return arithmetic(node.op, args) if usable else EVERYTHING
            case VectorOf() | VectorSum() | Scale() | Rotate() if None in args:
                return _PLANE
            case Coordinate() | Norm() if None in args:
                return EVERYTHING
            case VectorOf():
                return (args[0], args[1])
            case VectorSum():
                (a, b), (c, d) = args
                return (add(a, c), add(b, d))
            case Scale():
                x, y = args[0]
                return (multiply(x, args[1]), multiply(y, args[1]))
            case Rotate():
                return rotated(args[0], args[1])
            case Coordinate():
                return args[0][node.axis]
            case Norm():
                (x, y) = args[0]
                return (np.hypot(nearest(x), nearest(y)), np.hypot(largest(x), largest(y)))
            case Compare():
                return _compare(node.op, args)
            case Logic():
                return _logic(node.op, args)
            case Select():
                return _hull(args[1:])
            case Range() | DiscreteRange():
                return _hull(args) if all(isinstance(arg, tuple) for arg in args) else EVERYTHING
            case TruncatedNormal():
                low, high = args[2:]
                return (low[0], high[1])
            case Index():
                return (0.0, len(node.weights) - 1.0)
            case Normal():
                return EVERYTHING
            case Distance():
                return (0.0, math.inf)
            case Bearing() | DirectionAt():
                return (-math.pi, math.pi)
            case PointIn():
                return vector_bounds(node)
            case Contains() | Intersects() | Encloses():
                return _OPEN
            case DiscAt() | SectorAt() | RectangleAt() | RegionUnion() | RegionIntersection() | RegionDifference():
                return None
            case _:
                assert_never(node)

    def meets(self, root: Node, target: tuple[Array, Array], radius: float) -> Array:
        """Whether a vector can come within a radius of a target, in the frames that the expression goes through."""
        node = root
        x, y = target
        while True:
            match node:
                case VectorSum():
                    sides = ((node.left, node.right), (node.right, node.left))
                    exact = next(((one, other) for one, other in sides if is_point(self.known[id(one)])), None)
                    if exact is None:
                        break
                    (a, _), (b, _) = self.known[id(exact[0])]
                    x, y, node = x - a, y - b, exact[1]
                case Rotate() if is_exact(self.known[id(node.angle)]):
                    angle = self.known[id(node.angle)][0]
                    c, s = np.cos(angle), np.sin(angle)
                    x, y, node = x * c + y * s, y * c - x * s, node.vector
                case _:
                    break
        box = self.known[id(node)]
        if not _is_pair(box):
            return True
        (x0, x1), (y0, y1) = box
        return (x0 - radius <= x) & (x <= x1 + radius) & (y0 - radius <= y) & (y <= y1 + radius)


def _compare(op: CompareOp, args: list[Any]) -> _Bool:
    if not all(isinstance(arg, tuple) and not _is_pair(arg) for arg in args):
        return _OPEN
    (a, b), (c, d) = args
    below, above = np.asarray(a <= d + SLACK), np.asarray(b + SLACK >= c)
    surely_below, surely_above = np.asarray(b + SLACK < c), np.asarray(a > d + SLACK)
    match op:
        case CompareOp.LT | CompareOp.LE:
            return _Bool(below, ~surely_below)
        case CompareOp.GT | CompareOp.GE:
            return _Bool(above, ~surely_above)
        case CompareOp.EQ:
            return _Bool(below & above, True)
        case CompareOp.NE:
            return _Bool(True, below & above)


def _logic(op: LogicOp, args: list[Any]) -> _Bool:
    parts = [arg if isinstance(arg, _Bool) else _OPEN for arg in args]
    if op is LogicOp.NOT:
        return _Bool(parts[0].can_fail, parts[0].can_hold)
    hold, fail = parts[0].can_hold, parts[0].can_fail
    for part in parts[1:]:
        if op is LogicOp.AND:
            hold, fail = np.logical_and(hold, part.can_hold), np.logical_or(fail, part.can_fail)
        else:
            hold, fail = np.logical_or(hold, part.can_hold), np.logical_and(fail, part.can_fail)
    return _Bool(hold, fail)


def _hull(options: list[Any]) -> Any:
    if any(isinstance(option, _Bool) for option in options):
        return _OPEN
    if not options or not all(isinstance(option, tuple) for option in options):
        return None
    if all(_is_pair(option) for option in options):
        return tuple(
            (least([option[axis][0] for option in options]), most([option[axis][1] for option in options]))
            for axis in (0, 1)
        )
    if any(_is_pair(option) for option in options):
        return None
    return (least([option[0] for option in options]), most([option[1] for option in options]))
