"""Bounds of expressions as SQL: interval analysis whose ends are columns.

A value is a few alternatives, each an interval (or a box) whose ends are numbers or SQL over the columns of the objects
that it speaks of. Only ever used for *necessary* conditions: every comparison is widened by `SLACK`, so that rounding
in the database cannot exclude what the matcher would accept, and what SQL cannot say is unbounded, which excludes
nothing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, cast

from scenicq.forest.bounds import vector_bounds
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    Constant,
    Coordinate,
    DiscreteRange,
    Distance,
    Feature,
    Index,
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
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.sql_interval import (
    EVERYTHING,
    OPEN,
    Box,
    Expr,
    Interval,
    Truth,
    add,
    all_of,
    angle,
    any_of,
    compare,
    difference,
    hull,
    is_exact,
    largest,
    magnitude,
    maximum,
    minimum,
    multiply,
    negate,
    norm,
    rotate,
)

__all__ = ["Bounds", "Columns", "Value"]

Value: TypeAlias = tuple[Interval, ...] | tuple[Box, ...]
"""Alternatives: the value lies in one of them."""

Columns = Mapping[tuple[int, str], str | tuple[str, str]]
"""The column of each (object, property) that has one; a pair for vectors."""

_MOST_ALTERNATIVES = 16
_MOST_TEXT = 6000
"""Characters of an end of an interval: what is longer is left unbounded."""
_PLANE: Box = (EVERYTHING, EVERYTHING)


def _is_box(alternative: Interval | Box) -> bool:
    return isinstance(alternative[0], tuple)


def _intervals(value: Value) -> tuple[Interval, ...]:
    return cast("tuple[Interval, ...]", value) if value and not _is_box(value[0]) else (EVERYTHING,)


def _boxes(value: Value) -> tuple[Box, ...]:
    return cast("tuple[Box, ...]", value) if value and _is_box(value[0]) else (_PLANE,)


def _few(found: Sequence[Interval]) -> tuple[Interval, ...]:
    """At most so many alternatives, none of them endless to read."""
    kept = list(dict.fromkeys(found))
    if len(kept) > _MOST_ALTERNATIVES:
        kept = [hull(kept)]
    return tuple(EVERYTHING if any(isinstance(end, str) and len(end) > _MOST_TEXT for end in one) else one
                 for one in kept)  # fmt: skip


def _few_boxes(found: Sequence[Box]) -> tuple[Box, ...]:
    kept = list(dict.fromkeys(found))
    if len(kept) > _MOST_ALTERNATIVES:
        kept = [(hull([x for x, _ in kept]), hull([y for _, y in kept]))]
    return tuple((_few((x,))[0], _few((y,))[0]) for x, y in kept)


@dataclass(slots=True)
class Bounds:
    """Bounds of the nodes of one scenario over the columns of some objects.

    Attributes:
        columns: The columns; a feature without one is unbounded.
    """

    columns: Columns
    _known: dict[int, Value] = field(default_factory=dict["int", "Value"])
    _truths: dict[int, Truth] = field(default_factory=dict["int", "Truth"])

    def value(self, root: Node) -> Value:
        """The alternatives of a scalar or vector expression."""
        for node in postorder((root,)):
            if id(node) not in self._known:
                self._known[id(node)] = self._value(node, [self._known[id(child)] for child in children(node)])
        return self._known[id(root)]

    def intervals(self, root: Node) -> tuple[Interval, ...]:
        """The alternatives of a scalar expression."""
        return _intervals(self.value(root))

    def boxes(self, root: Node) -> tuple[Box, ...]:
        """The alternatives of a vector expression."""
        return _boxes(self.value(root))

    def exact(self, root: Node) -> Expr | None:
        """A scalar expression that the columns determine, None if they do not."""
        found = self.intervals(root)
        return found[0][0] if len(found) == 1 and is_exact(found[0]) else None

    def exact_vector(self, root: Node) -> tuple[Expr, Expr] | None:
        """A vector expression that the columns determine, None if they do not."""
        found = self.boxes(root)
        (x, y) = found[0]
        return (x[0], y[0]) if len(found) == 1 and is_exact(x) and is_exact(y) else None

    def can_hold(self, root: Node) -> str | bool:
        """SQL that is true wherever a condition can hold; True if it always can."""
        for node in postorder((root,)):
            if isinstance(node, Compare):
                pairs = itertools.product(self.intervals(node.left), self.intervals(node.right))
                truths = [compare(node.op, left, right) for left, right in pairs]
                self._truths[id(node)] = (any_of([hold for hold, _ in truths]), any_of([fail for _, fail in truths]))
            elif isinstance(node, Logic):
                self._truths[id(node)] = _logic(node.op, [self._truths.get(id(arg), OPEN) for arg in node.args])
            elif isinstance(node, Constant) and isinstance(node.value, bool):
                self._truths[id(node)] = (node.value, not node.value)
        return self._truths.get(id(root), OPEN)[0]

    def _value(self, node: Node, args: list[Value]) -> Value:
        match node:
            case Constant():
                return _constant(node.value)
            case Feature():
                return self._feature(node)
            case Arithmetic():
                return _arithmetic(node.op, [_intervals(arg) for arg in args])
            case Range():
                return _few([hull(pair) for pair in itertools.product(_intervals(args[0]), _intervals(args[1]))])
            case DiscreteRange():
                return _numbers(_intervals(args[0]), _intervals(args[1]))
            case TruncatedNormal():
                return _few([(a[0], b[1]) for a, b in itertools.product(_intervals(args[2]), _intervals(args[3]))])
            case Index():
                return ((0.0, len(node.weights) - 1.0),)
            case PointIn():
                return (vector_bounds(node),)
            case Select():
                return _joined(args[1:])
            case Distance():
                return ((0.0, math.inf),)
            case _:
                return _vector(node, args)

    def _feature(self, node: Feature) -> Value:
        column = self.columns.get((node.object, node.property))
        if column is None:
            return (_PLANE,) if node.kind == "vector" else (EVERYTHING,)
        if isinstance(column, tuple):
            return (((column[0], column[0]), (column[1], column[1])),)
        return ((column, column),)


def _constant(value: object) -> Value:
    if isinstance(value, float):
        return ((value, value),)
    if isinstance(value, tuple):
        x, y = cast("tuple[float, float]", value)
        return (((x, x), (y, y)),)
    return (EVERYTHING,)


def _numbers(lows: Sequence[Interval], highs: Sequence[Interval]) -> Value:
    low, high = lows[0][0], highs[0][1]
    if len(lows) == len(highs) == 1 and isinstance(low, float) and isinstance(high, float):
        width = high - low
        if math.isfinite(width) and 0 <= width < _MOST_ALTERNATIVES:
            return tuple((float(n), float(n)) for n in range(math.ceil(low), math.floor(high) + 1))
    return _few([hull(pair) for pair in itertools.product(lows, highs)])


def _joined(options: list[Value]) -> Value:
    if options and all(option and _is_box(option[0]) for option in options):
        return _few_boxes([box for option in options for box in _boxes(option)])
    return _few([interval for option in options for interval in _intervals(option)])


def _vector(node: Node, args: list[Value]) -> Value:
    match node:
        case VectorOf():
            return _few_boxes(list(itertools.product(_intervals(args[0]), _intervals(args[1]))))
        case VectorSum():
            pairs = itertools.product(_boxes(args[0]), _boxes(args[1]))
            return _few_boxes([(add(a, c), add(b, d)) for (a, b), (c, d) in pairs])
        case Scale():
            pairs = itertools.product(_boxes(args[0]), _intervals(args[1]))
            return _few_boxes([(multiply(x, by), multiply(y, by)) for (x, y), by in pairs])
        case Rotate():
            pairs = itertools.product(_boxes(args[0]), _intervals(args[1]))
            return _few_boxes([rotate(box, by) for box, by in pairs])
        case Coordinate():
            return _few([box[node.axis] for box in _boxes(args[0])])
        case Norm():
            return _few([norm(box) for box in _boxes(args[0])])
        case Bearing():
            return _few([_bearing(box) for box in _boxes(args[0])])
        case _:
            return (EVERYTHING,)


def _bearing(box: Box) -> Interval:
    (x, _), (y, _) = box
    if not (is_exact(box[0]) and is_exact(box[1])) or isinstance(x, float) or isinstance(y, float):
        return (-math.pi, math.pi)
    low, high = angle(f"atan2(-({x}), {y})")
    # a vector of hardly any length has any direction
    short = f"abs({x}) + abs({y}) < {SLACK!r}"
    return (f"(CASE WHEN {short} THEN -pi() ELSE {low} END)", f"(CASE WHEN {short} THEN pi() ELSE {high} END)")


def _arithmetic(op: ArithmeticOp, args: list[tuple[Interval, ...]]) -> Value:
    if math.prod(map(len, args)) > _MOST_ALTERNATIVES**2:
        args = [(hull(arg),) for arg in args]
    return _few([_combined(op, chosen) for chosen in itertools.product(*args)])


def _combined(op: ArithmeticOp, args: tuple[Interval, ...]) -> Interval:
    first = args[0]
    match op:
        case ArithmeticOp.ADD:
            total = first
            for other in args[1:]:
                total = add(total, other)
            return total
        case ArithmeticOp.SUB:
            return difference(first, args[1])
        case ArithmeticOp.NEG:
            return negate(first)
        case ArithmeticOp.MUL:
            return multiply(first, args[1])
        case ArithmeticOp.DIV if isinstance(args[1][0], float) and is_exact(args[1]) and args[1][0]:
            return multiply(first, (1 / args[1][0], 1 / args[1][0]))
        case ArithmeticOp.ABS:
            return (magnitude(first), largest(first))
        case ArithmeticOp.MIN:
            return (minimum([low for low, _ in args]), minimum([high for _, high in args]))
        case ArithmeticOp.MAX:
            return (maximum([low for low, _ in args]), maximum([high for _, high in args]))
        case ArithmeticOp.SIN | ArithmeticOp.COS if is_exact(first) and isinstance(first[0], str):
            value = f"{op.value}({first[0]})"
            return (value, value)
        case ArithmeticOp.SIN | ArithmeticOp.COS:
            return (-1.0, 1.0)
        case ArithmeticOp.WRAP if is_exact(first) and isinstance(first[0], str):
            return angle(first[0])
        case ArithmeticOp.WRAP if isinstance(first[0], float) and isinstance(first[1], float):
            inside = -math.pi + SLACK < first[0] and first[1] < math.pi - SLACK
            return first if inside else (-math.pi, math.pi)
        case ArithmeticOp.WRAP | ArithmeticOp.ATAN2:
            return (-math.pi, math.pi)
        case _:
            return EVERYTHING


def _logic(op: LogicOp, args: list[Truth]) -> Truth:
    if op is LogicOp.NOT:
        return (args[0][1], args[0][0])
    holds, fails = [hold for hold, _ in args], [fail for _, fail in args]
    return (all_of(holds), any_of(fails)) if op is LogicOp.AND else (any_of(holds), all_of(fails))
