"""The precedence of operators, with Scenic's own among Python's.

From loose to tight: `if ... else` and lambdas; `until`; `implies`; `or`; `and`; `not`; comparisons; `|`,
`visible from`, `can see`, `intersects`; `^`, `offset along`; `&`, `relative to`, `offset by`; shifts, `at`; the
operators that start with words, such as `distance to`; sums; products, `@`, `deg`; signs; `**`. An operator that starts
with words takes a sum as its last operand, so that `distance to x < 10` compares the distance.
"""

from __future__ import annotations

__all__ = [
    "ALONG", "AND", "AT", "COMPARISON", "DEPENDENT", "IMPLIES", "LEVELS", "NOT", "OR", "POWER", "PREFIX", "PRODUCT",
    "RELATIVE", "SIGN", "SUM", "UNION", "UNTIL",
]  # fmt: skip

UNTIL, IMPLIES, OR, AND, NOT, COMPARISON, UNION, ALONG, RELATIVE, AT, PREFIX, SUM, PRODUCT, SIGN, POWER = range(1, 16)

LEVELS: dict[str, int] = {
    "until": UNTIL, "implies": IMPLIES, "or": OR, "and": AND, "==": COMPARISON, "!=": COMPARISON, "<": COMPARISON,
    "<=": COMPARISON, ">": COMPARISON, ">=": COMPARISON, "in": COMPARISON, "is": COMPARISON, "not": COMPARISON,
    "|": UNION, "visible": UNION, "can": UNION, "intersects": UNION, "^": ALONG, "offset": RELATIVE, "&": RELATIVE,
    "relative": RELATIVE, "<<": AT, ">>": AT, "at": AT, "+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT, "//": PRODUCT,
    "%": PRODUCT, "@": PRODUCT, "deg": PRODUCT, "**": POWER,
}  # fmt: skip
DEPENDENT: dict[str, tuple[str, ...]] = {
    "not": ("in", "visible"), "visible": ("from",), "can": ("see",), "offset": ("by", "along"), "relative": ("to",),
}  # fmt: skip
