"""Interval analysis: what values an expression can have at most (outer bounds, never too narrow).

Used to bound where a random point can lie, how often an angle can wrap, and which conditions are necessary. Intervals
are closed pairs; an unknown end is infinite. A vector's bounds are a pair of intervals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias, cast

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Constant,
    Coordinate,
    DirectionAt,
    DiscreteRange,
    Distance,
    Feature,
    Identity,
    Index,
    Node,
    Norm,
    PointIn,
    Range,
    Rotate,
    Scale,
    Select,
    TruncatedNormal,
    Undefined,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Region

__all__ = [
    "EVERYTHING",
    "Box",
    "Interval",
    "add",
    "divide",
    "leaf_boxes",
    "multiply",
    "point_boxes",
    "scalar_bounds",
    "vector_bounds",
]

Interval: TypeAlias = tuple[float, float]
Box: TypeAlias = tuple[Interval, Interval]

EVERYTHING: Interval = (-math.inf, math.inf)
_PLANE: Box = (EVERYTHING, EVERYTHING)
_Bounds: TypeAlias = Interval | Box | None


def add(a: Interval, b: Interval) -> Interval:
    """The sum."""
    return (a[0] + b[0], a[1] + b[1])


def _product(a: float, b: float) -> float:
    return 0.0 if a == 0 or b == 0 else a * b


def multiply(a: Interval, b: Interval) -> Interval:
    """The product; nothing times an infinite end is nothing."""
    ends = [_product(x, y) for x in a for y in b]
    return (min(ends), max(ends))


def _quotient(a: float, b: float) -> float:
    return 0.0 if a == 0 or math.isinf(b) else a / b


def divide(a: Interval, b: Interval) -> Interval:
    """The quotient by an interval without 0; not by way of 1 / b, which is infinite for the tiniest numbers."""
    ends = [_quotient(x, y) for x in a for y in b]
    return (min(ends), max(ends))


def _hull(parts: list[Interval]) -> Interval:
    return (min(low for low, _ in parts), max(high for _, high in parts))


def _common(a: Box, b: Box) -> Box:
    """The box that two boxes have in common; an empty one has an end before its start."""
    (ax, ay), (bx, by) = a, b
    return (max(ax[0], bx[0]), min(ax[1], bx[1])), (max(ay[0], by[0]), min(ay[1], by[1]))


def _largest(a: Interval) -> float:
    return max(abs(a[0]), abs(a[1]))


def _arithmetic(op: ArithmeticOp, args: list[Interval]) -> Interval:
    first = args[0]
    match op:
        case ArithmeticOp.ADD:
            total = first
            for other in args[1:]:
                total = add(total, other)
            return total
        case ArithmeticOp.SUB:
            return (first[0] - args[1][1], first[1] - args[1][0])
        case ArithmeticOp.MUL:
            return multiply(first, args[1])
        case ArithmeticOp.DIV if args[1][0] > 0 or args[1][1] < 0:
            return divide(first, args[1])
        case ArithmeticOp.NEG:
            return (-first[1], -first[0])
        case ArithmeticOp.ABS:
            low = 0.0 if first[0] <= 0 <= first[1] else min(abs(first[0]), abs(first[1]))
            return (low, _largest(first))
        case ArithmeticOp.MIN:
            return (min(a[0] for a in args), min(a[1] for a in args))
        case ArithmeticOp.MAX:
            return (max(a[0] for a in args), max(a[1] for a in args))
        case ArithmeticOp.FLOOR | ArithmeticOp.CEIL:
            below, above = 1.0 * (op is ArithmeticOp.FLOOR), 1.0 * (op is ArithmeticOp.CEIL)
            return (first[0] - below, first[1] + above)
        case ArithmeticOp.SQRT:
            return (math.sqrt(max(0.0, first[0])), math.sqrt(max(0.0, first[1])))
        case ArithmeticOp.SIN | ArithmeticOp.COS:
            return (-1.0, 1.0)
        case ArithmeticOp.ASIN | ArithmeticOp.ATAN:
            return (-math.pi / 2, math.pi / 2)
        case ArithmeticOp.ACOS:
            return (0.0, math.pi)
        case ArithmeticOp.ATAN2:
            return (-math.pi, math.pi)
        case ArithmeticOp.WRAP:
            return first if -math.pi < first[0] and first[1] <= math.pi else (-math.pi, math.pi)
        case _:
            return EVERYTHING


def _rotated(box: Box, angle: Interval) -> Box:
    (x0, x1), (y0, y1) = box
    if angle[0] == angle[1]:
        c, s = math.cos(angle[0]), math.sin(angle[0])
        x = add(multiply((x0, x1), (c, c)), multiply((y0, y1), (-s, -s)))
        y = add(multiply((x0, x1), (s, s)), multiply((y0, y1), (c, c)))
        return (x, y)
    reach = math.hypot(_largest((x0, x1)), _largest((y0, y1)))
    return ((-reach, reach), (-reach, reach))


def _of_leaf(node: Node, args: list[_Bounds], leaves: Mapping[Identity, _Bounds]) -> _Bounds:
    match node:
        case Range() | DiscreteRange():
            own: _Bounds = _hull(cast("list[Interval]", args))
        case TruncatedNormal():
            own = (cast(Interval, args[2])[0], cast(Interval, args[3])[1])
        case Index():
            own = (0.0, len(node.weights) - 1.0)
        case PointIn():
            own = _PLANE
            if isinstance(node.region, Constant):
                west, south, east, north = region_bounds(cast(Region, node.region.value))
                own = ((west, east), (south, north))
            given = leaves.get(node.identity)
            return own if given is None else _common(own, cast(Box, given))
        case _:
            own = EVERYTHING
    return own


def _bounds(root: Node, leaves: Mapping[Identity, _Bounds]) -> dict[int, _Bounds]:
    found: dict[int, _Bounds] = {}
    for node in postorder((root,)):
        args = [found[id(child)] for child in children(node)]
        given = cast("list[Interval]", args)
        value: _Bounds = None
        match node:
            case Constant():
                if isinstance(node.value, bool):
                    value = None
                elif isinstance(node.value, float):
                    value = (node.value, node.value)
                elif isinstance(node.value, tuple):
                    x, y = node.value
                    value = ((x, x), (y, y))
                elif isinstance(node.value, Undefined):
                    value = EVERYTHING
            case Feature():
                value = _PLANE if node.kind == "vector" else EVERYTHING
            case Arithmetic():
                value = _arithmetic(node.op, [(0.0, 1.0) if arg is None else cast(Interval, arg) for arg in args])
            case Coordinate():
                value = cast(Box, args[0])[node.axis]
            case Norm():
                (x, y) = cast(Box, args[0])
                near = [0.0 if a[0] <= 0 <= a[1] else min(abs(a[0]), abs(a[1])) for a in (x, y)]
                value = (math.hypot(*near), math.hypot(_largest(x), _largest(y)))
            case Bearing() | DirectionAt():
                value = (-math.pi, math.pi)
            case Distance():
                value = (0.0, math.inf)
            case VectorOf():
                value = (given[0], given[1])
            case VectorSum():
                left, right = cast("list[Box]", args)
                value = (add(left[0], right[0]), add(left[1], right[1]))
            case Scale():
                x, y = cast(Box, args[0])
                value = (multiply(x, given[1]), multiply(y, given[1]))
            case Rotate():
                value = _rotated(cast(Box, args[0]), given[1])
            case Select():
                options = args[1:]
                if all(option is not None for option in options):
                    value = _join(options)
            case _:
                value = _of_leaf(node, args, leaves)
        found[id(node)] = value
    return found


def _join(options: list[_Bounds]) -> _Bounds:
    if isinstance(cast("tuple[object, ...]", options[0])[0], tuple):
        boxes = cast("list[Box]", options)
        return (_hull([box[0] for box in boxes]), _hull([box[1] for box in boxes]))
    return _hull(cast("list[Interval]", options))


def scalar_bounds(node: Node, leaves: Mapping[Identity, Box] | None = None) -> Interval:
    """Bounds of a scalar expression.

    Args:
        node: The expression; features in it are unbounded.
        leaves: Tighter boxes for some random points.
    """
    found = _bounds(node, leaves or {})[id(node)]
    return EVERYTHING if found is None else cast(Interval, found)


def vector_bounds(node: Node, leaves: Mapping[Identity, Box] | None = None) -> Box:
    """Bounds of a vector expression, per coordinate; arguments as of `scalar_bounds`."""
    found = _bounds(node, leaves or {})[id(node)]
    return _PLANE if found is None else cast(Box, found)


def point_boxes(root: Node, target: Box) -> dict[Identity, Box]:
    """Where each random point below a vector expression can lie if the expression's value lies in a box.

    Follows sums, scalings and rotations from the root down; other uses of a point bound nothing.
    """
    known = _bounds(root, {})
    boxes: dict[Identity, Box] = {}
    stack: list[tuple[Node, Box]] = [(root, target)]
    while stack:
        node, box = stack.pop()
        match node:
            case PointIn():
                old = boxes.get(node.identity, _PLANE)
                boxes[node.identity] = _common(old, box)
            case VectorSum():
                for one, other in ((node.left, node.right), (node.right, node.left)):
                    rest = cast(Box, known[id(other)] or _PLANE)
                    stack.append(
                        (one, cast(Box, tuple((b[0] - r[1], b[1] - r[0]) for b, r in zip(box, rest, strict=True))))
                    )
            case Rotate():
                low, high = cast(Interval, known[id(node.angle)] or EVERYTHING)
                stack.append((node.vector, _rotated(box, (-high, -low))))
            case Scale() if isinstance(node.factor, Constant) and node.factor.value:
                factor = cast(float, node.factor.value)
                stack.append((node.vector, (divide(box[0], (factor, factor)), divide(box[1], (factor, factor)))))
            case _:
                pass
    return boxes


def leaf_boxes(roots: list[tuple[Node, Box]]) -> dict[Identity, Box]:
    """The same for several expressions and boxes that hold together."""
    boxes: dict[Identity, Box] = {}
    for root, target in roots:
        for identity, box in point_boxes(root, target).items():
            old = boxes.get(identity, _PLANE)
            boxes[identity] = _common(old, box)
    return boxes
