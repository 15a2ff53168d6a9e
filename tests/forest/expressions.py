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
    Norm,
    PointIn,
    Range,
    Rotate,
    Scale,
    Select,
    VectorOf,
    VectorSum,
    Index,
    Node,
    Value,
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
        if affine:
            new = [
                lambda: Arithmetic(draw(st.sampled_from([ArithmeticOp.ADD, ArithmeticOp.SUB])), (a, b)),
                lambda: Arithmetic(ArithmeticOp.MUL, (a, known)),
                lambda: VectorSum(u, Rotate(VectorOf(a, b), known)),
                lambda: Scale(v, known),
            ][kind]()
        else:
            op = draw(st.sampled_from(SCALAR_OPS))
            new = [
                lambda: Arithmetic(op, (a,) if op in UNARY else (a, b)),
                lambda: VectorSum(u, Rotate(v, a)),
                lambda: VectorOf(a, b),
                lambda: Scale(u, a),
                lambda: Norm(u),
                lambda: Bearing(u),
                lambda: Coordinate(u, draw(st.integers(0, 1))),
                lambda: VectorSum(u, v),
                lambda: _pick(draw, a, b, values),
            ][kind]()
        (vectors if isinstance(new, VectorSum | VectorOf | Scale) else scalars).append(new)
    return VectorSum(vectors[-1], VectorOf(scalars[-1], scalars[-2])), values


def _pick(draw, a: Node, b: Node, values: dict[Identity, Value]) -> Node:
    index = Index((1.0, 2.0))
    values[index.identity] = float(draw(st.integers(0, 1)))
    return Select(index, (a, b))


def near(a: float, b: float) -> bool:
    """Equal but for rounding."""
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-6)
