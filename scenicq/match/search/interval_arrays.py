"""Interval arithmetic over arrays: the bounds of an operation for many candidates at once.

A span is a pair of lower and upper bounds, floats or arrays that broadcast. Where both ends are the same object the
value is known, and stays known through what is done with it.

For `outcome_bounds`, where the options of a choice are columns. Where fields are chosen case by case and bounds go down
to the random variables again, see `interval_domain`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from scenicq.forest.bounds import EVERYTHING
from scenicq.forest.nodes import ArithmeticOp
from scenicq.match.tolerance import SLACK

__all__ = [
    "Array", "Span", "add", "arithmetic", "is_exact", "is_point", "largest", "least", "most", "multiply",
    "nearest", "rotated",
]  # fmt: skip

Array: TypeAlias = Any
"""A float, or an array of floats that broadcasts with the others."""
Span: TypeAlias = tuple[Array, Array]
"""Lower and upper bounds."""


def is_exact(span: Any) -> bool:
    """Whether a span is one known number for each candidate."""
    return span[0] is span[1]


def is_point(box: Any) -> bool:
    """Whether a box is one known point for each candidate."""
    return is_exact(box[0]) and is_exact(box[1])


def add(a: Span, b: Span) -> Span:
    """The sum of two spans."""
    if is_exact(a) and is_exact(b):
        total = a[0] + b[0]
        return (total, total)
    return (a[0] + b[0], a[1] + b[1])


def _product(a: Array, b: Array) -> Array:
    result = a * b
    # zero times an infinite bound is zero
    return np.where(np.isnan(result), 0.0, result)


def multiply(a: Span, b: Span) -> Span:
    """The product of two spans."""
    if is_exact(a) and is_exact(b):
        total = a[0] * b[0]
        return (total, total)
    for one, other in ((a, b), (b, a)):
        factor = other[0]
        if other[0] is other[1] and isinstance(factor, float) and factor and math.isfinite(factor):
            low, high = one[0] * factor, one[1] * factor
            return (low, high) if factor > 0 else (high, low)
    ends = [_product(x, y) for x in a for y in b]
    return (least(ends), most(ends))


def least(parts: Sequence[Array]) -> Array:
    """The least of arrays, entry by entry."""
    found = parts[0]
    for part in parts[1:]:
        found = np.minimum(found, part)
    return found


def most(parts: Sequence[Array]) -> Array:
    """The greatest of arrays, entry by entry."""
    found = parts[0]
    for part in parts[1:]:
        found = np.maximum(found, part)
    return found


def nearest(a: Span) -> Array:
    """The least distance of a span from zero."""
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, np.minimum(np.abs(a[0]), np.abs(a[1])))


def largest(a: Span) -> Array:
    """The greatest distance of a span from zero."""
    return np.maximum(np.abs(a[0]), np.abs(a[1]))


def rotated(box: Any, angle: Span) -> tuple[Span, Span]:
    """A box around what a box turns to."""
    x, y = box
    if not is_exact(angle):
        reach = np.hypot(largest(x), largest(y))
        return ((-reach, reach), (-reach, reach))
    c, s = np.cos(angle[0]), np.sin(angle[0])
    if is_point(box):
        across, along = x[0] * c - y[0] * s, x[0] * s + y[0] * c
        return ((across, across), (along, along))
    return (add(multiply(x, (c, c)), multiply(y, (-s, -s))), add(multiply(x, (s, s)), multiply(y, (c, c))))


_EXACT: Mapping[ArithmeticOp, Callable[..., Array]] = {
    ArithmeticOp.SIN: np.sin,
    ArithmeticOp.COS: np.cos,
    ArithmeticOp.ABS: np.abs,
    ArithmeticOp.SQRT: np.sqrt,
    ArithmeticOp.DIV: np.divide,
}


def arithmetic(op: ArithmeticOp, args: list[Span]) -> Span:
    """The span of an operation; everything where nothing is known of it."""
    first = args[0]
    if op in _EXACT and all(is_exact(arg) for arg in args):
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
                total = add(total, other)
            return total
        case ArithmeticOp.SUB:
            second = args[1]
            if is_exact(first) and is_exact(second):
                value = first[0] - second[0]
                return (value, value)
            return (first[0] - second[1], first[1] - second[0])
        case ArithmeticOp.NEG:
            return multiply(first, (-1.0, -1.0)) if not is_exact(first) else ((value := -first[0]), value)
        case ArithmeticOp.MUL:
            return multiply(first, args[1])
        case ArithmeticOp.ABS:
            return (nearest(first), largest(first))
        case ArithmeticOp.MIN:
            return (least([arg[0] for arg in args]), least([arg[1] for arg in args]))
        case ArithmeticOp.MAX:
            return (most([arg[0] for arg in args]), most([arg[1] for arg in args]))
        case ArithmeticOp.WRAP:
            # whole turns change nothing for what is compared modulo them; beyond half a turn nothing is known
            inside = (first[0] > -math.pi + SLACK) & (first[1] < math.pi - SLACK)
            if is_exact(first):
                value = np.remainder(first[0] + math.pi, math.tau) - math.pi
                seam = np.abs(np.abs(value) - math.pi) < SLACK
                return (np.where(seam, -math.pi, value), np.where(seam, math.pi, value))
            return (np.where(inside, first[0], -math.pi), np.where(inside, first[1], math.pi))
        case ArithmeticOp.SIN | ArithmeticOp.COS:
            return (-1.0, 1.0)
        case ArithmeticOp.ATAN2:
            return (-math.pi, math.pi)
        case _:
            return EVERYTHING
