"""Random numbers over random variables, by every operation on numbers and vectors."""

from __future__ import annotations

import random

from scenicq.forest import build
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Coordinate,
    Node,
    Norm,
    Rotate,
    Scale,
    VectorOf,
    VectorSum,
)

RATIONAL = (ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.MUL, ArithmeticOp.DIV, ArithmeticOp.NEG, ArithmeticOp.ABS)
OTHER = tuple(op for op in ArithmeticOp if op not in RATIONAL)
PAIRS = {
    ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.MUL, ArithmeticOp.DIV, ArithmeticOp.MIN, ArithmeticOp.MAX,
    ArithmeticOp.ATAN2, ArithmeticOp.FLOORDIV, ArithmeticOp.MOD,
}  # fmt: skip


def random_number(rng: random.Random, size: float) -> float:
    """A number that may be round, tiny, or of the size of the others."""
    match rng.randrange(6):
        case 0:
            return float(rng.choice((0, 1, -1, 2, 0.5, 3, -10)))
        case 1:
            return rng.uniform(-1, 1) * 10.0 ** rng.randrange(-20, 3)
        case _:
            return rng.uniform(-size, size)


def _scalar(rng: random.Random, scalars: list[Node], vectors: list[Node], ops: tuple[ArithmeticOp, ...]) -> Node:
    if rng.random() < 0.3:
        vector = rng.choice(vectors)
        return rng.choice([Norm(vector), Bearing(vector), Coordinate(vector, rng.randrange(2))])
    op = rng.choice(ops)
    if op is ArithmeticOp.POW:
        exponent = float(rng.choice((0, 1, 2, 3, 4, -1, -2, 0.5, 1.5, -0.7)))
        return Arithmetic(op, (rng.choice(scalars), build.constant(exponent)))
    return Arithmetic(op, tuple(rng.choice(scalars) for _ in range(2 if op in PAIRS else 1)))


def random_expression(rng: random.Random, leaves: list[Node], ops: tuple[ArithmeticOp, ...] = ()) -> Node:
    """A random number over the leaves, of which several operations may share parts; of any ones, if none are named."""
    scalars = [*leaves, build.constant(random_number(rng, 10.0))]
    vectors: list[Node] = [VectorOf(rng.choice(scalars), rng.choice(scalars)) for _ in range(2)]
    ops = ops or (RATIONAL if rng.random() < 0.5 else RATIONAL + OTHER)
    for _ in range(rng.randrange(1, 8)):
        u, v, a = rng.choice(vectors), rng.choice(vectors), rng.choice(scalars)
        if rng.random() < 0.6:
            scalars.append(_scalar(rng, scalars, vectors, ops))
        else:
            vectors.append(rng.choice([VectorSum(u, v), Scale(u, a), Rotate(u, a), VectorOf(a, rng.choice(scalars))]))
    return _scalar(rng, scalars[-3:], vectors[-2:], ops)
