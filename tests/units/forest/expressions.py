"""Random scalar and vector expressions with the values of their variables."""

from __future__ import annotations

import math

from hypothesis import strategies as st

from scenicq.forest import build
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Coordinate,
    Identity,
    Index,
    Node,
    Norm,
    PointIn,
    Range,
    Rotate,
    Scale,
    Select,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.geometry.regions import Rectangle

NUMBERS = st.floats(-10, 10, allow_nan=False)
SCALAR_OPS = [
    ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.MUL, ArithmeticOp.NEG, ArithmeticOp.ABS, ArithmeticOp.MIN,
    ArithmeticOp.MAX, ArithmeticOp.SIN, ArithmeticOp.COS, ArithmeticOp.ATAN2, ArithmeticOp.WRAP, ArithmeticOp.DIV,
    ArithmeticOp.SQRT, ArithmeticOp.ATAN,
]  # fmt: skip
UNARY = {ArithmeticOp.NEG, ArithmeticOp.ABS, ArithmeticOp.SIN, ArithmeticOp.COS, ArithmeticOp.WRAP, ArithmeticOp.SQRT,
         ArithmeticOp.ATAN}  # fmt: skip


@st.composite
def expressions(draw, *, affine: bool = False) -> tuple[Node, dict[Identity, Value]]:
    """A vector expression and values of its random variables in their supports."""
    values: dict[Identity, Value] = {}
    scalars: list[Node] = [build.constant(draw(NUMBERS))]
    vectors: list[Node] = [build.constant((draw(NUMBERS), draw(NUMBERS)))]
    for _ in range(draw(st.integers(1, 3))):
        low, high = sorted((draw(NUMBERS), draw(NUMBERS)))
        leaf = Range(build.constant(low), build.constant(high))
        values[leaf.identity] = low + draw(st.floats(0, 1)) * (high - low)
        scalars.append(leaf)
    region = Rectangle((draw(NUMBERS), draw(NUMBERS)), 0.0, 4.0, 6.0)
    point = PointIn(build.constant(region))
    values[point.identity] = (
        region.center[0] + draw(st.floats(-2, 2)), region.center[1] + draw(st.floats(-3, 3))
    )  # fmt: skip
    vectors.append(point)
    for _ in range(draw(st.integers(1, 8))):
        a, b = draw(st.sampled_from(scalars)), draw(st.sampled_from(scalars))
        u, v = draw(st.sampled_from(vectors)), draw(st.sampled_from(vectors))
        kind = draw(st.integers(0, 3 if affine else 8))
        known = build.constant(draw(NUMBERS))
        new = _affine(draw, kind, (a, b), (u, v), known) if affine else _node(draw, kind, (a, b), (u, v), values)
        (vectors if isinstance(new, VectorSum | VectorOf | Scale) else scalars).append(new)
    return VectorSum(vectors[-1], VectorOf(scalars[-1], scalars[-2])), values


def _affine(draw, kind: int, scalars: tuple[Node, Node], vectors: tuple[Node, Node], known: Node) -> Node:
    """A node that is affine in the random variables if its parts are."""
    a, b = scalars
    u, v = vectors
    match kind:
        case 0:
            return Arithmetic(draw(st.sampled_from([ArithmeticOp.ADD, ArithmeticOp.SUB])), (a, b))
        case 1:
            return Arithmetic(ArithmeticOp.MUL, (a, known))
        case 2:
            return VectorSum(u, Rotate(VectorOf(a, b), known))
        case _:
            return Scale(v, known)


def _node(
    draw, kind: int, scalars: tuple[Node, Node], vectors: tuple[Node, Node], values: dict[Identity, Value]
) -> Node:
    """Any node; a random choice notes its value."""
    a, b = scalars
    u, v = vectors
    op = draw(st.sampled_from(SCALAR_OPS))
    match kind:
        case 0:
            return Arithmetic(op, (a,) if op in UNARY else (a, b))
        case 1:
            return VectorSum(u, Rotate(v, a))
        case 2:
            return VectorOf(a, b)
        case 3:
            return Scale(u, a)
        case 4:
            return Norm(u)
        case 5:
            return Bearing(u)
        case 6:
            return Coordinate(u, draw(st.integers(0, 1)))
        case 7:
            return VectorSum(u, v)
        case _:
            return _pick(draw, a, b, values)


def _pick(draw, a: Node, b: Node, values: dict[Identity, Value]) -> Node:
    index = Index((1.0, 2.0))
    values[index.identity] = float(draw(st.integers(0, 1)))
    return Select(index, (a, b))


def near(a: float, b: float) -> bool:
    """Equal but for rounding."""
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-6)
