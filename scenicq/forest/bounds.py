"""Bounds of expressions as plain numbers (outer bounds, never too narrow), upwards and down to random points.

Used to bound where a random point can lie, how often an angle can wrap, and which conditions are necessary. Bounds are
closed pairs of floats, an unknown end is infinite; those of a vector are a pair of pairs. Upwards they are the domain
of intervals with floats for ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias, cast

from scenicq.forest import build
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.interval_ends import FLOATS
from scenicq.forest.interval_values import Interval, IntervalValue, IntervalVector, can_hold
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.nodes import (
    ArithmeticOp,
    Constant,
    Identity,
    Node,
    Normal,
    PointIn,
    Rotate,
    Scale,
    TruncatedNormal,
    VectorSum,
)
from scenicq.forest.walk import transform

__all__ = [
    "Box", "FloatInterval", "leaf_boxes", "likely_bounds", "likely_normal", "may_hold", "point_boxes", "scalar_bounds",
    "vector_bounds",
]  # fmt: skip

FloatInterval: TypeAlias = tuple[float, float]
Box: TypeAlias = tuple[FloatInterval, FloatInterval]

_EVERYTHING: FloatInterval = (-math.inf, math.inf)
_PLANE: Box = (_EVERYTHING, _EVERYTHING)
_DOMAIN = IntervalDomain(FLOATS)
_DEVIATIONS = 6.0
"""Standard deviations from the mean within which a value is likely."""


def _pair(value: IntervalValue[float]) -> FloatInterval:
    return (value.low, value.high) if isinstance(value, Interval) else _EVERYTHING


def _box(value: IntervalValue[float]) -> Box:
    return (_pair(value.x), _pair(value.y)) if isinstance(value, IntervalVector) else _PLANE


def _vector(box: Box) -> IntervalVector[float]:
    (x0, x1), (y0, y1) = box
    return IntervalVector(FLOATS.between(x0, x1), FLOATS.between(y0, y1))


def scalar_bounds(node: Node, leaves: Mapping[Identity, Box] | None = None) -> FloatInterval:
    """Bounds of a scalar expression.

    Args:
        node: The expression; features in it are unbounded.
        leaves: Tighter boxes for some random points.
    """
    return _pair(_bounds(node, leaves))


def likely_normal(node: Normal) -> TruncatedNormal:
    """A normal variable within a few standard deviations of its mean; it is the same variable."""
    away = build.arithmetic(ArithmeticOp.MUL, node.deviation, build.constant(_DEVIATIONS))
    low = build.arithmetic(ArithmeticOp.SUB, node.mean, away)
    high = build.arithmetic(ArithmeticOp.ADD, node.mean, away)
    return TruncatedNormal(node.mean, node.deviation, low, high, identity=node.identity, span=node.span)


def likely_bounds(node: Node) -> FloatInterval:
    """Bounds of a scalar expression over likely values of its normal variables."""
    return scalar_bounds(transform(node, lambda each: likely_normal(each) if isinstance(each, Normal) else each))


def vector_bounds(node: Node, leaves: Mapping[Identity, Box] | None = None) -> Box:
    """Bounds of a vector expression, per coordinate; arguments as of `scalar_bounds`."""
    return _box(_bounds(node, leaves))


def may_hold(condition: Node) -> bool:
    """Whether a condition may hold for some values of its random variables; features in it are unbounded."""
    return bool(can_hold(_bounds(condition, None)))


def _bounds(node: Node, leaves: Mapping[Identity, Box] | None) -> IntervalValue[float]:
    domain = IntervalDomain(FLOATS, points=leaves) if leaves else _DOMAIN
    return interpret(steps_of(node), domain)[id(node)]


def point_boxes(root: Node, target: Box) -> dict[Identity, Box]:
    """Where each random point below a vector expression can lie if the expression's value lies in a box.

    Follows sums, scalings and rotations from the root down; other uses of a point bound nothing.
    """
    known = interpret(steps_of(root), _DOMAIN)
    boxes: dict[Identity, Box] = {}
    stack: list[tuple[Node, Box]] = [(root, target)]
    while stack:
        node, box = stack.pop()
        match node:
            case PointIn():
                boxes[node.identity] = _common(boxes.get(node.identity, _PLANE), box)
            case VectorSum():
                for one, other in ((node.left, node.right), (node.right, node.left)):
                    rest = _box(known[id(other)])
                    stack.append(
                        (one, cast(Box, tuple((b[0] - r[1], b[1] - r[0]) for b, r in zip(box, rest, strict=True))))
                    )
            case Rotate():
                low, high = _pair(known[id(node.angle)])
                stack.append((node.vector, _box(_DOMAIN.rotate(_vector(box), FLOATS.between(-high, -low)))))
            case Scale() if isinstance(node.factor, Constant) and node.factor.value:
                factor = cast(float, node.factor.value)
                by = FLOATS.between(factor, factor)
                x, y = _vector(box)
                stack.append((node.vector, (_pair(_DOMAIN.divide(x, by)), _pair(_DOMAIN.divide(y, by)))))
            case _:
                pass
    return boxes


def _common(a: Box, b: Box) -> Box:
    """The box that two boxes have in common; an empty one has an end before its start."""
    (ax, ay), (bx, by) = a, b
    return (max(ax[0], bx[0]), min(ax[1], bx[1])), (max(ay[0], by[0]), min(ay[1], by[1]))


def leaf_boxes(roots: list[tuple[Node, Box]]) -> dict[Identity, Box]:
    """`point_boxes` for several expressions, each of which lies in its box."""
    boxes: dict[Identity, Box] = {}
    for root, target in roots:
        for identity, box in point_boxes(root, target).items():
            boxes[identity] = _common(boxes.get(identity, _PLANE), box)
    return boxes
