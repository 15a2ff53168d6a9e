"""The precedence of operators, with Scenic's own among Python's.

From loose to tight: `if ... else` and lambdas; `until`; `implies`; `or`; `and`; `not`; comparisons; `|`,
`visible from`, `can see`, `intersects`; `^`, `offset along`; `&`, `relative to`, `offset by`; shifts, `at`; the
operators that start with words, such as `distance to`; sums; products, `@`, `deg`; signs; `**`. An operator that starts
with words takes a sum as its last operand, so that `distance to x < 10` compares the distance.
"""

from __future__ import annotations

__all__ = [
    "ALONG", "AND", "AT", "COMPARISON", "IMPLIES", "NOT", "OR", "POWER", "PREFIX", "PRODUCT", "PYTHON", "RELATIVE",
    "SIGN", "UNION", "UNTIL",
]  # fmt: skip

UNTIL, IMPLIES, OR, AND, NOT, COMPARISON, UNION, ALONG, RELATIVE, AT, PREFIX, SUM, PRODUCT, SIGN, POWER = range(1, 16)

PYTHON: dict[str, int] = {
    "or": OR, "and": AND, "==": COMPARISON, "!=": COMPARISON, "<": COMPARISON, "<=": COMPARISON, ">": COMPARISON,
    ">=": COMPARISON, "in": COMPARISON, "is": COMPARISON, "not": COMPARISON, "|": UNION, "^": ALONG, "&": RELATIVE,
    "<<": AT, ">>": AT, "+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT, "//": PRODUCT, "%": PRODUCT, "**": POWER,
}  # fmt: skip
"""The levels of Python's operators; those of Scenic's stand in `phrases`."""
