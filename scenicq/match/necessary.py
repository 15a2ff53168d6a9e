"""Necessary conditions of groups, for many pairs of label objects at once: interval analysis over arrays.

What a group demands is relaxed to intervals, exact in what the label observes and generous in everything random, and
evaluated for all candidates of its roles together. A pair that fails is out before anything expensive looks at it; one
that passes has proven nothing. In the frame of an observed heading, "ahead of it by 3 to 6 m" stays a narrow strip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, assert_never, cast

import numpy as np

from scenicq.forest.bounds import EVERYTHING, scalar_bounds, vector_bounds
from scenicq.forest.groups import Comparison, Group
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
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
from scenicq.match.options import Tolerance

__all__ = ["Observed", "possible"]

Array: TypeAlias = Any
"""A float, or an array of floats that broadcasts with the others."""
Span: TypeAlias = tuple[Array, Array]
"""Lower and upper bounds."""
Observed = Callable[[int, str], Array | tuple[Array, Array] | None]
"""What is observed of an object: numbers or a pair of them for all its candidates; None where it is no number."""

_SLACK = 1e-6
"""Metres or radians by which rounding may put a value outside of its interval."""


@dataclass(frozen=True, slots=True)
class _Bool:
    can_hold: Array
    can_fail: Array


_OPEN = _Bool(True, True)
_PLANE = (EVERYTHING, EVERYTHING)


def possible(group: Group, observed: Observed, tolerance: Tolerance) -> Array:
    """For which candidates of its roles a group may be satisfiable.

    Args:
        group: The group.
        observed: Values of features, as arrays that broadcast against each other.
        tolerance: Per feature.

    Returns:
        A boolean or a boolean array of the broadcast shape; False only where no solution exists.
    """
    with np.errstate(all="ignore"):
        evaluation = _Evaluation(observed)
        result: Array = True
        for item in group.constraints:
            if isinstance(item, Comparison):
                result = np.logical_and(result, _reachable(evaluation, item, tolerance))
            else:
                result = np.logical_and(result, cast(_Bool, evaluation.value(item.expression)).can_hold)
    return result


def _reachable(evaluation: _Evaluation, item: Comparison, tolerance: Tolerance) -> Array:
    seen = evaluation.observed(item.object, item.property)
    if seen is None:
        return True
    value = evaluation.value(item.expression)
    if value is None or isinstance(value, _Bool):
        return True
    if isinstance(seen, tuple):
        if item.property != "position" or not _is_pair(value):
            return True
        return evaluation.meets(item.expression, cast("tuple[Array, Array]", seen), tolerance.reach + _SLACK)
    if _is_pair(value):
        return True
    low, high = value
    if item.property != "heading":
        return (low - tolerance.other - _SLACK <= seen) & (seen <= high + tolerance.other + _SLACK)
    allowed = tolerance.heading + _SLACK
    width = high - low + 2 * allowed
    return ~np.isfinite(width) | (np.mod(seen - low + allowed, math.tau) <= width)


def _is_pair(value: Any) -> bool:
    return isinstance(value, tuple) and isinstance(cast("tuple[object, object]", value)[0], tuple)


class _Evaluation:
    """Bounds of nodes for one set of candidates."""

    def __init__(self, observed: Observed) -> None:
        self.observed = observed
        self.known: dict[int, Any] = {}

    def value(self, root: Node) -> Any:
        """A scalar's span, a vector's pair of spans, a `_Bool` for what is true or false, else a guess that is open."""
        for node in postorder((root,)):
            if id(node) not in self.known:
                self.known[id(node)] = self._value(node, [self.known[id(child)] for child in children(node)])
        return self.known[id(root)]

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
                return _arithmetic(node.op, args) if usable else EVERYTHING
            case VectorOf() | VectorSum() | Scale() | Rotate() if None in args:
                return _PLANE
            case Coordinate() | Norm() if None in args:
                return EVERYTHING
            case VectorOf():
                return (args[0], args[1])
            case VectorSum():
                (a, b), (c, d) = args
                return (_add(a, c), _add(b, d))
            case Scale():
                x, y = args[0]
                return (_multiply(x, args[1]), _multiply(y, args[1]))
            case Rotate():
                return _rotated(args[0], args[1])
            case Coordinate():
                return args[0][node.axis]
            case Norm():
                (x, y) = args[0]
                return (np.hypot(_nearest(x), _nearest(y)), np.hypot(_largest(x), _largest(y)))
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
            case Normal() | Distance() | Bearing() | DirectionAt():
                return scalar_bounds(node)
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
        self.value(root)
        node = root
        x, y = target
        while True:
            match node:
                case VectorSum():
                    sides = ((node.left, node.right), (node.right, node.left))
                    exact = next(((one, other) for one, other in sides if _point(self.value(one))), None)
                    if exact is None:
                        break
                    (a, _), (b, _) = self.value(exact[0])
                    x, y, node = x - a, y - b, exact[1]
                case Rotate() if _exact(self.value(node.angle)):
                    angle = self.value(node.angle)[0]
                    c, s = np.cos(angle), np.sin(angle)
                    x, y, node = x * c + y * s, y * c - x * s, node.vector
                case _:
                    break
        box = self.value(node)
        if not _is_pair(box):
            return True
        (x0, x1), (y0, y1) = box
        return (x0 - radius <= x) & (x <= x1 + radius) & (y0 - radius <= y) & (y <= y1 + radius)


def _exact(span: Any) -> bool:
    return span[0] is span[1]


def _point(box: Any) -> bool:
    return _exact(box[0]) and _exact(box[1])


def _add(a: Span, b: Span) -> Span:
    if _exact(a) and _exact(b):
        total = a[0] + b[0]
        return (total, total)
    return (a[0] + b[0], a[1] + b[1])


def _product(a: Array, b: Array) -> Array:
    result = a * b
    # zero times an infinite bound is zero
    return np.where(np.isnan(result), 0.0, result)


def _multiply(a: Span, b: Span) -> Span:
    if _exact(a) and _exact(b):
        total = a[0] * b[0]
        return (total, total)
    ends = [_product(x, y) for x in a for y in b]
    return (_least(ends), _most(ends))


def _least(parts: Sequence[Array]) -> Array:
    found = parts[0]
    for part in parts[1:]:
        found = np.minimum(found, part)
    return found


def _most(parts: Sequence[Array]) -> Array:
    found = parts[0]
    for part in parts[1:]:
        found = np.maximum(found, part)
    return found


def _nearest(a: Span) -> Array:
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, np.minimum(np.abs(a[0]), np.abs(a[1])))


def _largest(a: Span) -> Array:
    return np.maximum(np.abs(a[0]), np.abs(a[1]))


def _rotated(box: Any, angle: Span) -> tuple[Span, Span]:
    x, y = box
    if not _exact(angle):
        reach = np.hypot(_largest(x), _largest(y))
        return ((-reach, reach), (-reach, reach))
    c, s = np.cos(angle[0]), np.sin(angle[0])
    if _point(box):
        across, along = x[0] * c - y[0] * s, x[0] * s + y[0] * c
        return ((across, across), (along, along))
    return (_add(_multiply(x, (c, c)), _multiply(y, (-s, -s))), _add(_multiply(x, (s, s)), _multiply(y, (c, c))))


_EXACT: Mapping[ArithmeticOp, Callable[..., Array]] = {
    ArithmeticOp.SIN: np.sin,
    ArithmeticOp.COS: np.cos,
    ArithmeticOp.ABS: np.abs,
    ArithmeticOp.SQRT: np.sqrt,
    ArithmeticOp.DIV: np.divide,
}


def _arithmetic(op: ArithmeticOp, args: list[Span]) -> Span:
    first = args[0]
    if op in _EXACT and all(_exact(arg) for arg in args):
        value = _EXACT[op](*(arg[0] for arg in args))
        # where there is no value nothing is said about it
        defined = np.isfinite(value)
        return (
            (value, value) if np.all(defined) else (np.where(defined, value, -np.inf), np.where(defined, value, np.inf))
        )
    match op:
        case ArithmeticOp.ADD:
            total = first
            for other in args[1:]:
                total = _add(total, other)
            return total
        case ArithmeticOp.SUB:
            second = args[1]
            if _exact(first) and _exact(second):
                value = first[0] - second[0]
                return (value, value)
            return (first[0] - second[1], first[1] - second[0])
        case ArithmeticOp.NEG:
            return _multiply(first, (-1.0, -1.0)) if not _exact(first) else ((value := -first[0]), value)
        case ArithmeticOp.MUL:
            return _multiply(first, args[1])
        case ArithmeticOp.ABS:
            return (_nearest(first), _largest(first))
        case ArithmeticOp.MIN:
            return (_least([arg[0] for arg in args]), _least([arg[1] for arg in args]))
        case ArithmeticOp.MAX:
            return (_most([arg[0] for arg in args]), _most([arg[1] for arg in args]))
        case ArithmeticOp.WRAP:
            # whole turns change nothing for what is compared modulo them; beyond half a turn nothing is known
            inside = (first[0] > -math.pi + _SLACK) & (first[1] < math.pi - _SLACK)
            if _exact(first):
                value = np.remainder(first[0] + math.pi, math.tau) - math.pi
                seam = np.abs(np.abs(value) - math.pi) < _SLACK
                return (np.where(seam, -math.pi, value), np.where(seam, math.pi, value))
            return (np.where(inside, first[0], -math.pi), np.where(inside, first[1], math.pi))
        case ArithmeticOp.SIN | ArithmeticOp.COS:
            return (-1.0, 1.0)
        case ArithmeticOp.ATAN2:
            return (-math.pi, math.pi)
        case _:
            return EVERYTHING


def _compare(op: CompareOp, args: list[Any]) -> _Bool:
    if not all(isinstance(arg, tuple) and not _is_pair(arg) for arg in args):
        return _OPEN
    (a, b), (c, d) = args
    below, above = np.asarray(a <= d + _SLACK), np.asarray(b + _SLACK >= c)
    surely_below, surely_above = np.asarray(b + _SLACK < c), np.asarray(a > d + _SLACK)
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
            (_least([option[axis][0] for option in options]), _most([option[axis][1] for option in options]))
            for axis in (0, 1)
        )
    if any(_is_pair(option) for option in options):
        return None
    return (_least([option[0] for option in options]), _most([option[1] for option in options]))
