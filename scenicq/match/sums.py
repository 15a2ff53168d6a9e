"""Sums in which a random number occurs many times: a vector as a box plus random numbers times boxes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias, cast

from scenicq.forest.bounds import EVERYTHING, Box, Interval, add, multiply
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Identity,
    Node,
    Range,
    Rotate,
    Scale,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)
from scenicq.match.spans import divide, rotate

__all__ = ["Form", "form_of"]

Form: TypeAlias = tuple[Box, dict[Identity, Box]]
"""The part that is not random, and the factors of what is. A number is the same in both coordinates."""
_ZERO: Box = ((0.0, 0.0), (0.0, 0.0))


def form_of(
    node: Node, args: list[Form], known: Mapping[int, Interval | Box | None], ranges: Mapping[Identity, Interval]
) -> Form:
    """The form of a node, given those of its children.

    Args:
        node: The node.
        args: The forms of its children.
        known: Bounds of nodes, by their ids.
        ranges: Bounds of the random numbers.
    """

    def scalar(of: Node) -> Interval:
        found = known.get(id(of))
        return EVERYTHING if found is None or isinstance(found[0], tuple) else cast(Interval, found)

    match node:
        case Range() | TruncatedNormal() if node.identity in ranges:
            return _ZERO, {node.identity: ((1.0, 1.0), (1.0, 1.0))}
        case VectorOf():
            x, y = args
            terms = {key: (by[0], (0.0, 0.0)) for key, by in x[1].items()}
            for key, by in y[1].items():
                terms[key] = (terms[key][0] if key in terms else (0.0, 0.0), by[1])
            return (x[0][0], y[0][1]), terms
        case VectorSum():
            return _plus(args[0], args[1])
        case Rotate():
            angle = scalar(node.angle)
            return rotate(args[0][0], angle), {key: rotate(by, angle) for key, by in args[0][1].items()}
        case Scale() if not args[1][1]:
            return _times(args[0], scalar(node.factor))
        case Arithmetic() if node.op is ArithmeticOp.ADD:
            total = args[0]
            for arg in args[1:]:
                total = _plus(total, arg)
            return total
        case Arithmetic() if node.op is ArithmeticOp.SUB:
            return _plus(args[0], _times(args[1], (-1.0, -1.0)))
        case Arithmetic() if node.op is ArithmeticOp.NEG:
            return _times(args[0], (-1.0, -1.0))
        case Arithmetic() if node.op is ArithmeticOp.MUL and not args[1][1]:
            return _times(args[0], scalar(node.args[1]))
        case Arithmetic() if node.op is ArithmeticOp.MUL and not args[0][1]:
            return _times(args[1], scalar(node.args[0]))
        case Arithmetic() if node.op is ArithmeticOp.DIV and not args[1][1]:
            return _times(args[0], divide((1.0, 1.0), scalar(node.args[1])))
        case _:
            own = known.get(id(node)) or EVERYTHING
            return (cast(Box, own) if isinstance(own[0], tuple) else cast(Box, (own, own))), {}


def _plus(one: Form, other: Form) -> Form:
    """The sum."""
    terms = dict(one[1])
    for key, (x, y) in other[1].items():
        a, b = terms.get(key, _ZERO)
        terms[key] = (add(a, x), add(b, y))
    (a, b), (x, y) = one[0], other[0]
    return (add(a, x), add(b, y)), terms


def _times(form: Form, factor: Interval) -> Form:
    """The multiple by a number that is known within bounds."""
    (x, y), terms = form
    scaled = {key: (multiply(a, factor), multiply(b, factor)) for key, (a, b) in terms.items()}
    return (multiply(x, factor), multiply(y, factor)), scaled
