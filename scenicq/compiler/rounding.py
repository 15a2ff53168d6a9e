"""`int`, `round` and `sorted` of random numbers, exactly, in terms of floor and ceiling, least and greatest."""

from __future__ import annotations

from collections.abc import Sequence

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import (
    ArithmeticOp,
    Constant,
    DiscreteRange,
    Feature,
    Index,
    Node,
    Normal,
    Range,
    Select,
    TruncatedNormal,
)
from scenicq.forest.walk import children
from scenicq.limits import LIMITS

__all__ = ["round_number", "sort_numbers", "truncate_number"]


def sort_numbers(values: Sequence[Node], span: Span) -> list[Node]:
    """Numbers from the least to the greatest."""
    found = list(values)
    for last in range(len(found) - 1, 0, -1):
        for number in range(last):
            pair = found[number], found[number + 1]
            found[number] = build.arithmetic(ArithmeticOp.MIN, *pair, span=span)
            found[number + 1] = build.arithmetic(ArithmeticOp.MAX, *pair, span=span)
    return found


def truncate_number(value: Node, span: Span) -> Node:
    """A number without its fraction."""
    if _is_whole(value):
        return value
    zero = build.constant(0.0, span)
    below = build.arithmetic(ArithmeticOp.FLOOR, value, span=span)
    above = build.arithmetic(ArithmeticOp.CEIL, value, span=span)
    return build.add(
        build.arithmetic(ArithmeticOp.MAX, below, zero, span=span),
        build.arithmetic(ArithmeticOp.MIN, above, zero, span=span),
        span,
    )


def round_number(value: Node, digits: int, span: Span) -> Node:
    """A number to a number of decimals; the one in the middle between two goes to the even one, as in Python."""
    if not digits and _is_whole(value):
        return value
    if digits:
        factor = build.constant(10.0**digits, span)
        scaled = build.arithmetic(ArithmeticOp.MUL, value, factor, span=span)
        return build.arithmetic(ArithmeticOp.DIV, round_number(scaled, 0, span), factor, span=span)
    half = build.arithmetic(ArithmeticOp.ADD, value, build.constant(0.5, span), span=span)
    up = build.arithmetic(ArithmeticOp.FLOOR, half, span=span)
    if _never_between(value):
        return up
    # (2 x - 1) / 4 is whole only in the middle below an odd number: there the even one is one less
    quarter = build.minus(
        build.arithmetic(ArithmeticOp.MUL, value, build.constant(0.5, span), span=span),
        build.constant(0.25, span),
        span,
    )
    above = build.arithmetic(ArithmeticOp.CEIL, quarter, span=span)
    odd = build.minus(above, build.arithmetic(ArithmeticOp.FLOOR, quarter, span=span), span)
    return build.add(up, build.minus(odd, build.constant(1.0, span), span), span)


def _is_whole(value: Node) -> bool:
    """Whether a number is certainly whole, as that of a truth value is."""
    options = value.options if isinstance(value, Select) else (value,)
    return all(
        isinstance(each, Constant) and isinstance(each.value, float) and each.value.is_integer() for each in options
    )


def _never_between(value: Node) -> bool:
    """Whether a number certainly lies in the middle between two whole ones with probability 0 only."""
    found: list[Node] = [value]
    for node in found:
        if len(found) > LIMITS.rounded_nodes:
            return False
        found += children(node)
    continuous = any(isinstance(node, Range | Normal | TruncatedNormal) for node in found)
    return continuous and not any(isinstance(node, Feature | DiscreteRange | Index) for node in found)
