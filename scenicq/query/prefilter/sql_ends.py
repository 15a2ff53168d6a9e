"""Ends of intervals that are numbers or SQL over columns, and the SQL of what can be asked of them.

What is null, because a label lacks it, stays null whatever is computed of it; a number that SQL cannot say is nan, of
which the least and the greatest are endless.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from scenicq.forest.interval_ends import FLOATS, Ends
from scenicq.forest.interval_values import FloatOrArray, Interval
from scenicq.geometry.angles import azimuth
from scenicq.match.tolerance import SLACK

__all__ = ["SQL", "Expr", "all_of", "any_of", "between", "less", "modulo_turn", "number"]

Expr: TypeAlias = float | str
"""A number, or SQL of one."""
SqlTruth: TypeAlias = str | bool


def number(value: Expr) -> str:
    """SQL of a value; a number reads back as the same double."""
    if isinstance(value, str):
        return value
    return f"({value!r}::DOUBLE)" if math.isfinite(value) else f"('{value!r}'::DOUBLE)"


def _infinite(value: Expr) -> bool:
    return isinstance(value, float) and math.isinf(value)


class _Sql:
    """Ends that are numbers or SQL; truth values are SQL or known."""

    def number(self, value: float) -> Expr:
        return value

    def between(self, low: Expr, high: Expr) -> Interval[Expr]:
        return Interval(low, high, low == high and not _infinite(low))

    def known(self, value: Expr) -> Interval[Expr]:
        if isinstance(value, str) or math.isfinite(value):
            return Interval(value, value, True)
        return Interval(-math.inf, math.inf)

    def plus(self, a: Expr, b: Expr) -> Expr:
        if isinstance(a, float) and isinstance(b, float):
            return a + b
        if _infinite(a) or b == 0.0:
            return a
        if _infinite(b) or a == 0.0:
            return b
        return f"({number(a)} + {number(b)})"

    def negative(self, a: Expr) -> Expr:
        return -a if isinstance(a, float) else f"(-{a})"

    def times(self, a: Expr, b: Expr) -> Expr:
        if a == 0.0 or b == 0.0:
            return 0.0
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        if _infinite(a) or _infinite(b):
            return math.nan
        if a == 1.0 or b == 1.0:
            return b if a == 1.0 else a
        return f"({number(a)} * {number(b)})"

    def divided(self, a: Expr, b: Expr) -> Expr:
        if isinstance(b, str):
            return math.nan
        return 0.0 if math.isinf(b) else math.nan if b == 0.0 else self.times(a, 1 / b)

    def least(self, parts: Sequence[Expr]) -> Expr:
        numbers = [part for part in parts if isinstance(part, float)]
        return _extreme(parts, -math.inf if any(map(math.isnan, numbers)) else min(numbers, default=math.inf), "least")

    def most(self, parts: Sequence[Expr]) -> Expr:
        numbers = [part for part in parts if isinstance(part, float)]
        best = math.inf if any(map(math.isnan, numbers)) else max(numbers, default=-math.inf)
        return _extreme(parts, best, "greatest")

    def magnitude(self, a: Expr) -> Expr:
        return abs(a) if isinstance(a, float) else f"abs({a})"

    def hypot(self, a: Expr, b: Expr) -> Expr:
        if isinstance(a, float) and isinstance(b, float):
            return math.hypot(a, b)
        if _infinite(a) or _infinite(b):
            return math.inf
        return f"sqrt({number(a)} * {number(a)} + {number(b)} * {number(b)})"

    def root(self, a: Expr) -> Expr:
        if isinstance(a, float):
            return math.sqrt(a) if a >= 0 else math.nan
        return f"(CASE WHEN {a} >= 0 THEN sqrt({a}) END)"

    def sine(self, a: Expr) -> Expr:
        return math.sin(a) if isinstance(a, float) else f"sin({a})"

    def cosine(self, a: Expr) -> Expr:
        return math.cos(a) if isinstance(a, float) else f"cos({a})"

    def heading(self, x: Expr, y: Expr) -> Expr:
        if isinstance(x, float) and isinstance(y, float):
            return azimuth(x, y)
        return f"atan2(-{number(x)}, {number(y)})"

    def turned(self, a: Expr) -> Expr:
        return FLOATS.turned(a) if isinstance(a, float) else f"({a} - 2 * pi() * round(({a}) / (2 * pi())))"

    def at_most(self, a: Expr, b: Expr) -> SqlTruth:
        if isinstance(a, float) and isinstance(b, float):
            return a <= b
        if a == -math.inf or b == math.inf:
            return True
        if a == math.inf or b == -math.inf:
            return False
        return f"{number(a)} <= {number(b)}"

    def both(self, a: SqlTruth, b: SqlTruth) -> SqlTruth:
        return all_of((a, b))

    def either(self, a: SqlTruth, b: SqlTruth) -> SqlTruth:
        return any_of((a, b))

    def negation(self, a: SqlTruth) -> SqlTruth:
        return f"NOT ({a})" if isinstance(a, str) else not a

    def where(self, condition: SqlTruth, a: Expr, b: Expr) -> Expr:
        if not isinstance(condition, str):
            return a if condition else b
        return a if a == b else f"(CASE WHEN {condition} THEN {number(a)} ELSE {number(b)} END)"


SQL: Ends[Expr] = _Sql()


def _extreme(values: Sequence[Expr], best: float, name: str) -> Expr:
    """The least or the greatest of values, of which the best number is known."""
    texts = list(dict.fromkeys(value for value in values if isinstance(value, str)))
    worst = math.inf if name == "least" else -math.inf
    if not texts or best == -worst:
        return best
    parts: list[Expr] = [*texts] if best == worst else [best, *texts]
    if len(parts) == 1:
        return parts[0]
    # the functions skip what is null, but of what a label lacks nothing is known
    return f"(CASE WHEN ({' + '.join(texts)}) IS NOT NULL THEN {name}({', '.join(map(number, parts))}) END)"


def modulo_turn(text: str) -> str:
    """An angle taken modulo a full turn, in [0, 2 pi)."""
    return f"({text} - 2 * pi() * floor(({text}) / (2 * pi())))"


def less(a: Expr, b: Expr) -> SqlTruth:
    """Whether a value is at most another, with slack."""
    return SQL.at_most(a, SQL.plus(b, SLACK))


def between(value: Expr, limits: Interval[Expr], reach: float) -> SqlTruth:
    """Whether a value lies in an interval or within a reach of it."""
    return all_of([less(SQL.plus(limits.low, -reach), value), less(value, SQL.plus(limits.high, reach))])


def all_of(parts: Sequence[FloatOrArray]) -> SqlTruth:
    """Whether all hold."""
    if any(part is False for part in parts):
        return False
    texts = list(dict.fromkeys(part for part in parts if isinstance(part, str)))
    return f"({' AND '.join(texts)})" if len(texts) > 1 else texts[0] if texts else True


def any_of(parts: Sequence[FloatOrArray]) -> SqlTruth:
    """Whether one holds."""
    if any(part is True for part in parts):
        return True
    texts = list(dict.fromkeys(part for part in parts if isinstance(part, str)))
    return f"({' OR '.join(texts)})" if len(texts) > 1 else texts[0] if texts else False
