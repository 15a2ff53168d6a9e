"""Headings as numbers: an angle and the same one with full turns more point the same way, but differ when compared."""

from __future__ import annotations

import math
from dataclasses import replace

from scenicq.forest import build
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Constant, DirectionAt, Feature, Node

__all__ = ["any_turn", "one_turn"]

_DEEPEST = 20


def one_turn(heading: Node) -> Node:
    """A heading as the number in (-pi, pi] that Scenic 3 reads it as."""
    low, high = scalar_bounds(heading)
    within = isinstance(heading, Feature | DirectionAt) or (-math.pi < low and high <= math.pi)
    return heading if within else build.arithmetic(ArithmeticOp.WRAP, heading, span=heading.span)


def any_turn(heading: Node) -> Node:
    """The same heading up to full turns, without what `one_turn` does to its parts; what is shared stays shared."""
    return _any_turn(heading, 0, {})


def _any_turn(heading: Node, depth: int, known: dict[int, Node]) -> Node:
    if id(heading) not in known:
        known[id(heading)] = _without_wraps(heading, depth, known)
    return known[id(heading)]


def _without_wraps(heading: Node, depth: int, known: dict[int, Node]) -> Node:
    if not isinstance(heading, Arithmetic) or depth > _DEEPEST:
        return heading
    match heading.op, heading.args:
        case ArithmeticOp.WRAP, (turned,):
            return _any_turn(turned, depth + 1, known)
        case ((ArithmeticOp.ADD | ArithmeticOp.SUB | ArithmeticOp.NEG), parts):
            plain = tuple(_any_turn(part, depth + 1, known) for part in parts)
        case ArithmeticOp.MUL, (turned, Constant(value=float() as times)) if times.is_integer():
            plain = (_any_turn(turned, depth + 1, known), heading.args[1])
        case ArithmeticOp.MUL, (Constant(value=float() as times), turned) if times.is_integer():
            plain = (heading.args[0], _any_turn(turned, depth + 1, known))
        case _:
            return heading
    same = all(one is other for one, other in zip(plain, heading.args, strict=True))
    return heading if same else replace(heading, args=plain)
