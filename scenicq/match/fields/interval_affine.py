"""Sums in which a random number occurs many times: an enclosure plus random numbers times enclosures.

A position that is reached in steps along a field is such a sum once the directions are chosen. Solved as a whole it
leaves of the length of the way what only that sum allows; bounds of its single terms would forget that they are of one
number.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Identity,
    Node,
    Normal,
    Range,
    Rotate,
    Scale,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)
from scenicq.match.fields.interval_domain import Enclosure, common, divide, negative, projected, rotate, subtract, times

__all__ = ["IntervalAffine", "cut_ranges", "interval_affine_of"]

IntervalAffine: TypeAlias = tuple[Enclosure | None, dict[Identity, Enclosure]]
"""What is not random (None if that is anything), and the factors of what is. Of one shape: intervals or boxes."""


def interval_affine_of(
    node: Node,
    forms: Mapping[int, IntervalAffine],
    bounds: Mapping[int, Enclosure],
    turns: Mapping[int, Enclosure],
) -> IntervalAffine:
    """The form of a node.

    Args:
        node: The node.
        forms: The forms of its children, by id.
        bounds: Bounds of nodes, by id.
        turns: Sine and cosine of the angles of rotations, by the id of the rotation.
    """
    own = bounds.get(id(node))
    if own is None:
        return None, {}
    match node:
        case Range() | Normal() | TruncatedNormal():
            return np.zeros_like(own), {node.identity: np.ones_like(own)}
        case VectorOf():
            return _side_by_side(forms[id(node.x)], forms[id(node.y)])
        case VectorSum():
            return _plus(forms[id(node.left)], forms[id(node.right)])
        case Rotate():
            constant, terms = forms[id(node.vector)]
            if constant is not None and terms:
                turn = turns[id(node)]
                return rotate(constant, turn), {key: rotate(by, turn) for key, by in terms.items()}
        case Scale() if not forms[id(node.factor)][1]:
            return _times(forms[id(node.vector)], bounds.get(id(node.factor)))
        case Arithmetic():
            found = _arithmetic(node, [forms[id(arg)] for arg in node.args], [bounds.get(id(arg)) for arg in node.args])
            if found is not None:
                return found
        case _:
            pass
    return own, {}


def _arithmetic(node: Arithmetic, args: list[IntervalAffine], limits: list[Enclosure | None]) -> IntervalAffine | None:
    match node.op:
        case ArithmeticOp.ADD:
            total = args[0]
            for arg in args[1:]:
                total = _plus(total, arg)
            return total
        case ArithmeticOp.SUB:
            return _plus(args[0], _negative(args[1]))
        case ArithmeticOp.NEG:
            return _negative(args[0])
        case ArithmeticOp.MUL if not args[1][1]:
            return _times(args[0], limits[1])
        case ArithmeticOp.MUL if not args[0][1]:
            return _times(args[1], limits[0])
        case ArithmeticOp.DIV if not args[1][1] and limits[1] is not None:
            return _times(args[0], divide(np.ones_like(limits[1]), limits[1]))
        case _:
            return None


def _side_by_side(one: IntervalAffine, other: IntervalAffine) -> IntervalAffine:
    (x, across), (y, along) = one, other
    if x is None or y is None:
        return None, {}
    nothing = np.zeros_like(x)
    keys = {**across, **along}
    return np.stack([x, y]), {key: np.stack([across.get(key, nothing), along.get(key, nothing)]) for key in keys}


def _plus(one: IntervalAffine, other: IntervalAffine) -> IntervalAffine:
    if one[0] is None or other[0] is None:
        return None, {}
    terms = dict(one[1])
    for key, by in other[1].items():
        terms[key] = terms[key] + by if key in terms else by
    return one[0] + other[0], terms


def _negative(form: IntervalAffine) -> IntervalAffine:
    constant, terms = form
    return None if constant is None else negative(constant), {key: negative(by) for key, by in terms.items()}


def _times(form: IntervalAffine, factor: Enclosure | None) -> IntervalAffine:
    constant, terms = form
    if constant is None or factor is None:
        return None, {}
    return times(constant, factor), {key: times(by, factor) for key, by in terms.items()}


def cut_ranges(form: IntervalAffine, value: Enclosure, ranges: dict[Identity, Enclosure]) -> None:
    """Cut the ranges of random numbers to where a form can have a value.

    A box is looked at along its axes and, for each number, across the direction in which that number moves it: there
    the others are seen alone.

    Args:
        form: The form.
        value: The bounds of its value.
        ranges: Of the random numbers; changed in place.
    """
    constant, terms = form
    if constant is None or not terms:
        return
    rest = subtract(value, constant)
    if rest.ndim == 2:
        _cut(rest, terms, ranges)
        return
    for along in _directions(terms):
        _cut(projected(rest, along), {key: projected(by, along) for key, by in terms.items()}, ranges)


def _directions(terms: Mapping[Identity, Enclosure]) -> list[NDArray[np.float64]]:
    count = next(iter(terms.values())).shape[-1]
    found = [np.repeat([[1.0], [0.0]], count, axis=1), np.repeat([[0.0], [1.0]], count, axis=1)]
    for by in terms.values():
        x, y = by.mean(axis=1)
        length = np.hypot(x, y)
        flat = ~(length > 0.0)
        safe = np.where(flat, 1.0, length)
        found.append(np.stack([np.where(flat, 1.0, -y / safe), np.where(flat, 0.0, x / safe)]))
    return found


def _cut(rest: Enclosure, terms: Mapping[Identity, Enclosure], ranges: dict[Identity, Enclosure]) -> None:
    parts = {key: times(ranges[key], by) for key, by in terms.items()}
    for key, by in terms.items():
        own = rest
        for other, part in parts.items():
            own = own if other is key else subtract(own, part)
        ranges[key] = common(ranges[key], divide(own, by))
        parts[key] = times(ranges[key], by)
