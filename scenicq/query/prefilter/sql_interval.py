"""Intervals whose ends are numbers or SQL, and the SQL of what can be asked of them.

An interval holds a value that is known only between its ends; one with the same text at both ends is exactly that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from scenicq.forest.nodes import CompareOp
from scenicq.match.tolerance import SLACK

__all__ = [
    "EVERYTHING", "OPEN", "Box", "Expr", "Interval", "Truth", "add", "all_of", "angle", "any_of", "between",
    "compare", "difference", "hull", "is_exact", "largest", "less", "magnitude", "maximum", "minimum", "modulo_turn",
    "multiply", "negate", "norm", "number", "rotate",
]  # fmt: skip

Expr: TypeAlias = float | str
"""A number, or SQL of one."""
Interval: TypeAlias = tuple[Expr, Expr]
Box: TypeAlias = tuple[Interval, Interval]
"""An interval in x and one in y."""
Condition: TypeAlias = str | bool
Truth: TypeAlias = tuple[Condition, Condition]
"""Where a condition can hold, and where it can fail."""

EVERYTHING: Interval = (-math.inf, math.inf)
OPEN: Truth = (True, True)


def number(value: Expr) -> str:
    """SQL of a value; a number reads back as the same double."""
    return value if isinstance(value, str) else f"({value!r}::DOUBLE)"


def is_exact(interval: Interval) -> bool:
    """Whether the columns determine the value."""
    low, high = interval
    return low == high and not (isinstance(low, float) and math.isinf(low))


def _infinite(value: Expr) -> bool:
    return isinstance(value, float) and math.isinf(value)


def _plus(a: Expr, b: Expr, infinite: float) -> Expr:
    if _infinite(a) or _infinite(b):
        return infinite
    if isinstance(a, float) and isinstance(b, float):
        return a + b
    if a == 0.0 or b == 0.0:
        return b if a == 0.0 else a
    return f"({number(a)} + {number(b)})"


def _minus(value: Expr) -> Expr:
    return -value if isinstance(value, float) else f"(-{value})"


def add(a: Interval, b: Interval) -> Interval:
    """The sum."""
    return (_plus(a[0], b[0], -math.inf), _plus(a[1], b[1], math.inf))


def negate(a: Interval) -> Interval:
    """The negative."""
    return (_minus(a[1]), _minus(a[0]))


def difference(a: Interval, b: Interval) -> Interval:
    """The difference."""
    return add(a, negate(b))


def minimum(values: Sequence[Expr]) -> Expr:
    """The least of some values."""
    numbers = [value for value in values if isinstance(value, float)]
    return _extreme(values, min(numbers, default=math.inf), "least", -math.inf)


def maximum(values: Sequence[Expr]) -> Expr:
    """The greatest of some values."""
    numbers = [value for value in values if isinstance(value, float)]
    return _extreme(values, max(numbers, default=-math.inf), "greatest", math.inf)


def _extreme(values: Sequence[Expr], best: float, name: str, endless: float) -> Expr:
    texts = list(dict.fromkeys(value for value in values if isinstance(value, str)))
    if not texts or best == endless:
        return best
    parts: list[Expr] = [*texts] if best == -endless else [best, *texts]
    if len(parts) == 1:
        return parts[0]
    # the functions skip what is null, but of what a label lacks nothing is known
    return f"(CASE WHEN ({' + '.join(texts)}) IS NOT NULL THEN {name}({', '.join(map(number, parts))}) END)"


def hull(parts: Sequence[Interval]) -> Interval:
    """The smallest interval around some."""
    return (minimum([low for low, _ in parts]), maximum([high for _, high in parts]))


def _times(a: Expr, b: Expr) -> Expr:
    if a == 0.0 or b == 0.0:
        return 0.0
    if isinstance(a, float) and isinstance(b, float):
        return a * b
    if a == 1.0 or b == 1.0:
        return b if a == 1.0 else a
    return f"({number(a)} * {number(b)})"


def multiply(a: Interval, b: Interval) -> Interval:
    """The product."""
    if is_exact(a) and is_exact(b):
        value = _times(a[0], b[0])
        return (value, value)
    ends = (*a, *b)
    if any(isinstance(end, str) for end in ends) and any(map(_infinite, ends)):
        return EVERYTHING
    products = [_times(x, y) for x in a for y in b]
    return (minimum(products), maximum(products))


def magnitude(a: Interval) -> Expr:
    """The least absolute value."""
    low, high = a
    if isinstance(low, float) and isinstance(high, float):
        return 0.0 if low <= 0 <= high else min(abs(low), abs(high))
    if is_exact(a):
        return f"abs({low})"
    return maximum([0.0, low, _minus(high)])


def largest(a: Interval) -> Expr:
    """The greatest absolute value."""
    low, high = a
    if isinstance(low, float) and isinstance(high, float):
        return max(abs(low), abs(high))
    if is_exact(a):
        return f"abs({low})"
    return maximum([_minus(low), high])


def _hypot(x: Expr, y: Expr) -> Expr:
    if _infinite(x) or _infinite(y):
        return math.inf
    if isinstance(x, float) and isinstance(y, float):
        return math.hypot(x, y)
    return f"sqrt({number(x)} * {number(x)} + {number(y)} * {number(y)})"


def norm(box: Box) -> Interval:
    """The length of a vector."""
    x, y = box
    return (_hypot(magnitude(x), magnitude(y)), _hypot(largest(x), largest(y)))


def rotate(box: Box, by: Interval) -> Box:
    """A vector turned counter-clockwise."""
    x, y = box
    if not is_exact(by):
        reach = _hypot(largest(x), largest(y))
        return ((_minus(reach), reach), (_minus(reach), reach))
    turn = by[0]
    cos: Expr = math.cos(turn) if isinstance(turn, float) else f"cos({turn})"
    sin: Expr = math.sin(turn) if isinstance(turn, float) else f"sin({turn})"
    c, s = (cos, cos), (sin, sin)
    return (difference(multiply(x, c), multiply(y, s)), add(multiply(x, s), multiply(y, c)))


def modulo_turn(text: str) -> str:
    """An angle taken modulo a full turn, in [0, 2 pi)."""
    return f"({text} - 2 * pi() * floor(({text}) / (2 * pi())))"


def angle(text: str) -> Interval:
    """An angle normalised to [-pi, pi]; at the seam, where rounding decides, it is anything."""
    inner = f"({text} - 2 * pi() * round(({text}) / (2 * pi())))"
    seam = f"abs({inner}) > pi() - {SLACK!r}"
    return (f"(CASE WHEN {seam} THEN -pi() ELSE {inner} END)", f"(CASE WHEN {seam} THEN pi() ELSE {inner} END)")


def less(a: Expr, b: Expr) -> Condition:
    """Whether a value is at most another, with slack."""
    if isinstance(a, float) and isinstance(b, float):
        return a <= b + SLACK
    if a == -math.inf or b == math.inf:
        return True
    if a == math.inf or b == -math.inf:
        return False
    return f"{number(a)} <= {number(b + SLACK if isinstance(b, float) else f'({b} + {SLACK!r})')}"


def between(value: Expr, limits: Interval, reach: float) -> Condition:
    """Whether a value lies in an interval or within a reach of it."""
    low, high = limits
    return all_of([less(_plus(low, -reach, -math.inf), value), less(value, _plus(high, reach, math.inf))])


def compare(op: CompareOp, left: Interval, right: Interval) -> Truth:
    """Where a comparison can hold, and where it can fail."""
    below, above = less(left[0], right[1]), less(right[0], left[1])
    match op:
        case CompareOp.LT | CompareOp.LE:
            return (below, above)
        case CompareOp.GT | CompareOp.GE:
            return (above, below)
        case CompareOp.EQ:
            return (all_of([below, above]), True)
        case CompareOp.NE:
            return (True, all_of([below, above]))


def all_of(parts: Sequence[Condition]) -> Condition:
    """Whether all hold."""
    if any(part is False for part in parts):
        return False
    texts = list(dict.fromkeys(part for part in parts if isinstance(part, str)))
    return f"({' AND '.join(texts)})" if len(texts) > 1 else texts[0] if texts else True


def any_of(parts: Sequence[Condition]) -> Condition:
    """Whether one holds."""
    if any(part is True for part in parts):
        return True
    texts = list(dict.fromkeys(part for part in parts if isinstance(part, str)))
    return f"({' OR '.join(texts)})" if len(texts) > 1 else texts[0] if texts else False
