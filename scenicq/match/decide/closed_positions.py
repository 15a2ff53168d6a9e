"""Closed forms of positions and other vectors: a point of a region, a known place, an offset by ranges."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Identity, PointIn, Rotate, Value, VectorOf, VectorSum
from scenicq.match.decide.closed_form import FAILS, ClosedForm, GroupEvaluation, each_position
from scenicq.match.decide.compiled_expressions import CompiledExpressions
from scenicq.match.decide.range_forms import Columns, CompiledVector, FloatColumn, Lookup, Scalar, clip, cos_sin, spread
from scenicq.match.decide.region_tests import region_test
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import unlike
from scenicq.match.problem.map_lookups import XY, MapLookups
from scenicq.match.tolerance import SLACK, Margin

__all__ = ["known_vector", "offset", "point_in"]

_CLOSE = 1e-12
"""How close a length is to a bound, beside its size, where rounding may decide."""


def point_in(item: Comparison, node: PointIn, ego: int, chosen: Mapping[Identity, float]) -> ClosedForm | None:
    """A point of a region that is known once the label is.

    Args:
        item: The comparison of a position.
        node: Its expression.
        ego: Index of the object around which the radius is.
        chosen: The number of the option of each choice.
    """
    test, index = region_test(node.region, chosen), item.object
    if test is None:
        return None

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        position = get(index, "position")
        holds, fails = test.evaluate(get, position, lookups, options.tolerance.of(index, "position").reach + SLACK)
        places = each_position(position)
        if options.radius is not None:
            near, centres = options.radius - SLACK, each_position(get(ego, "position"))
            inside = [math.dist(place, centre) <= near for place, centre in zip(places, centres, strict=True)]
            holds = holds & (np.array(inside) if isinstance(get, Columns) else inside[0])
        if isinstance(get, Columns):
            return GroupEvaluation(
                cast(NDArray[np.bool_], holds).tolist(),
                cast(NDArray[np.bool_], fails).tolist(),
                {node.identity: cast("list[Value]", places)},
            )
        return GroupEvaluation(bool(holds), bool(fails), {node.identity: places[0]})

    return ClosedForm(item, evaluate, regions=test.regions, index=index)


def known_vector(item: Comparison) -> ClosedForm | None:
    """A vector that is known once the label is."""
    exact = CompiledExpressions({}).exact(item.expression)
    if exact is None:
        return None
    index, name = item.object, item.property

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        (x, y), (px, py) = cast(XY, exact(get)), cast(XY, get(index, name))
        return GroupEvaluation(*_close(x - px, y - py, options.tolerance.of(index, name)), {})

    def detail(get: Lookup, lookups: MapLookups) -> str:
        return unlike(name, cast(XY, exact(get)), cast(XY, get(index, name)))

    return ClosedForm(item, evaluate, detail=detail)


def _close(dx: float, dy: float, margin: Margin) -> tuple[bool, bool]:
    """Whether a position that is off by a vector is surely within tolerance, or surely not; of columns, each."""
    bounds = margin.sure, margin.reach + SLACK
    if isinstance(dx, float):
        off = math.hypot(dx, dy)
    else:
        off = cast(float, _lengths(cast(FloatColumn, dx), cast(FloatColumn, dy), bounds))
    return off <= bounds[0], (off > bounds[1]) & (off < math.inf)


def _lengths(dx: FloatColumn, dy: FloatColumn, bounds: tuple[float, ...]) -> FloatColumn:
    """The lengths of vectors; NumPy rounds otherwise than `math`, which is only a matter next to a bound."""
    found = np.hypot(dx, dy)
    for bound in bounds:
        close = np.flatnonzero(np.abs(found - bound) <= _CLOSE * (1 + bound))
        pairs = zip(dx[close].tolist(), dy[close].tolist(), strict=True)
        found[close] = [math.hypot(*pair) for pair in pairs]
    return found


def _apart(middle: XY, half: XY, turn: XY, margin: Margin) -> bool:
    """Whether a rectangle surely misses a box of tolerance: some side of either separates them; of columns, each.

    Args:
        middle: The rectangle's, from the box's, along the rectangle's sides.
        half: Half its sides; of unbounded ones nothing is said.
        turn: Cosine and sine of the angle from the box's sides to the rectangle's.
        margin: The box.
    """
    (u, v), (w, h), (c, s), across, along = middle, half, turn, margin.size + SLACK, margin.y + SLACK
    return (
        (abs(u) > w + abs(c) * across + abs(s) * along)
        | (abs(v) > h + abs(s) * across + abs(c) * along)
        | (abs(u * c - v * s) > abs(c) * w + abs(s) * h + across)
        | (abs(u * s + v * c) > abs(s) * w + abs(c) * h + along)
    )


def _composed(turns: Sequence[XY]) -> XY:
    """Cosine and sine of the sum of angles, from theirs; of columns, columns."""
    turn = (1.0, 0.0)
    for c, s in turns:
        turn = turn[0] * c - turn[1] * s, turn[1] * c + turn[0] * s
    return turn


def offset(item: Comparison) -> ClosedForm | None:
    """An offset by ranges in a frame that is known once the label is."""
    formulas = CompiledExpressions({})
    steps: list[tuple[CompiledVector | None, Scalar | None]] = []
    node = item.expression
    while not isinstance(node, VectorOf):
        match node:
            case VectorSum():
                sides = ((node.left, node.right), (node.right, node.left))
                known = next(((one, rest) for part, rest in sides if (one := formulas.exact(part))), None)
                if known is None:
                    return None
                steps.append((cast(CompiledVector, known[0]), None))
                node = known[1]
            case Rotate() if (angle := formulas.exact(node.angle)) is not None:
                steps.append((None, cast(Scalar, angle)))
                node = node.vector
            case _:
                return None
    x, y = formulas.form(node.x), formulas.form(node.y)
    if x is None or y is None or x.fields or y.fields or not (x.terms or y.terms) or set(x.terms) & set(y.terms):
        return None
    index, name = item.object, item.property

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        px, py = cast(XY, get(index, name))
        margin = options.tolerance.of(index, name)
        turns: list[XY] = []
        # into the frame of the offset
        for shift, angle in steps:
            if shift is not None:
                qx, qy = shift(get)
                px, py = px - qx, py - qy
            elif angle is not None:
                c, s = cos_sin(angle(get))
                px, py = px * c + py * s, py * c - px * s
                turns.append((c, s))
        # hundreds of candidates come here: most offsets have no known part to work out
        a = x.known(get) if x.parts else x.constant
        b = y.known(get) if y.parts else y.constant
        u, v = clip(px, a + x.low, a + x.high), clip(py, b + y.low, b + y.high)
        holds, fails = _close(u - px, v - py, margin)
        if margin.kind == "box" and holds is not True and fails is not True:
            middle = a + (x.low + x.high) / 2 - px, b + (y.low + y.high) / 2 - py
            fails |= _apart(middle, ((x.high - x.low) / 2, (y.high - y.low) / 2), _composed(turns), margin)
        if holds is False:
            return FAILS if fails is True else GroupEvaluation(holds, fails, {})
        return GroupEvaluation(holds, fails, spread(x, u - a) | spread(y, v - b))

    return ClosedForm(item, evaluate)
