"""Ends of intervals that are numbers or SQL over columns, and the SQL of what can be asked of them.

What is null, because a label lacks it, stays null whatever is computed of it; a number that SQL cannot say is nan, of
which the least and the greatest are endless.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

from scenicq.forest.interval_ends import FLOATS, Ends
from scenicq.forest.interval_values import FloatOrArray, Interval
from scenicq.geometry.angles import azimuth
from scenicq.match.tolerance import SLACK

__all__ = [
    "SQL", "Expr", "SqlTruth", "all_of", "any_of", "between", "columns_of", "difference", "less", "number",
    "renamed_tables", "within_turn",
]  # fmt: skip

Expr: TypeAlias = float | str
"""A number, or SQL of one."""
SqlTruth: TypeAlias = str | bool
"""SQL of a condition, or whether it always holds."""


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


def difference(a: Expr, b: Expr) -> Expr:
    """A number less another."""
    return SQL.plus(a, SQL.negative(b))


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


def within_turn(own: str, alternatives: Sequence[Interval[Expr]], width: float, directions: str = "") -> SqlTruth:
    """Whether an angle lies in one of some intervals, or within a width of it, modulo a full turn; with slack.

    Args:
        own: The angle.
        alternatives: The intervals.
        width: In radians.
        directions: A list of angles, one of which is added to the intervals.
    """
    width += SLACK
    spans: list[tuple[Expr, Expr]] = []
    for low, high, _ in alternatives:
        span = difference(high, low)
        if (isinstance(span, float) and span + 2 * width >= math.tau) or math.inf in (high, span):
            return True
        spans.append((SQL.plus(low, -width), SQL.plus(span, 2 * width)))

    def holds(turned: str) -> SqlTruth:
        # from where each span starts
        angles = [(number(difference(turned, start)), span) for start, span in spans]
        return any_of([SQL.at_most(f"({a} - 2 * pi() * floor(({a}) / (2 * pi())))", span) for a, span in angles])

    if not directions:
        return holds(own)
    one, each = holds(f"{own} - {directions}[1]"), holds(f"{own} - d")
    if not isinstance(each, str):
        return each
    # most places have one direction, for which arithmetic takes a fraction of what a function of lists does
    return f"CASE WHEN len({directions}) = 1 THEN {one} ELSE len(list_filter({directions}, lambda d: {each})) > 0 END"


_COLUMN = re.compile(r"'(?:[^']|'')*'|\b([a-z]\w*)\.(\w+)")
"""A text, which is passed over, or a column of a table."""


def columns_of(alias: str, conditions: Iterable[SqlTruth]) -> list[str]:
    """The columns of a table that conditions use."""
    found = (part for each in conditions if isinstance(each, str) for part in _COLUMN.finditer(each))
    return sorted({part[2] for part in found if part[1] == alias})


def renamed_tables(condition: str, aliases: Mapping[str, str]) -> str:
    """A condition over other tables, by the aliases that it has."""

    def replaced(part: re.Match[str]) -> str:
        return f"{aliases[part[1]]}.{part[2]}" if part[1] in aliases else part[0]

    return _COLUMN.sub(replaced, condition)
