"""Codes of values: what the encoder makes of a node's value, and how two of them compare.

A number's code is a term, a vector's a pair of terms, a truth value's a formula. What is no number and not known is a
`CodeChoice`; everything else (a string, a region) stands for itself. `Undefined` spreads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from scenicq.errors import CannotEvaluate
from scenicq.forest.nodes import ArithmeticOp, CompareOp, Constant, LogicOp, Node, RectangleAt, Undefined, Value
from scenicq.geometry.regions import Rectangle, Region
from scenicq.smt.problem import Formula, Term, is_formula, is_term
from scenicq.smt.region_membership import TermVector, index_equals
from scenicq.smt.terms import FALSE, TRUE, apply, compare, conjunction, disjunction, negation, number

__all__ = [
    "CodeChoice",
    "cases",
    "compare_codes",
    "connect",
    "constant_code",
    "equal",
    "equals_observed",
    "in_interval",
    "is_box",
    "known_region",
    "rotate_vector",
    "truth",
]


def constant_code(value: Value) -> object:
    """The code of a known value."""
    if isinstance(value, bool):
        return TRUE if value else FALSE
    if isinstance(value, float):
        return number(value)
    if isinstance(value, tuple):
        return (number(value[0]), number(value[1]))
    return value


@dataclass(frozen=True, slots=True)
class CodeChoice:
    """A value that is no number: one of several, each under its condition."""

    options: tuple[tuple[Formula, object], ...]


def equals_observed(code: object, observed: Value) -> Formula:
    """Whether a value that is no number is the one observed."""
    if isinstance(code, CodeChoice):
        return disjunction(conjunction([where, equals_observed(value, observed)]) for where, value in code.options)
    if is_formula(code):
        return FALSE if not isinstance(observed, bool) else code if observed else negation(code)
    return TRUE if not is_term(code) and code == observed else FALSE


def known_region(node: Node) -> Region:
    """The region that an expression is, if it is known.

    Raises:
        CannotEvaluate: It is random.
    """
    if not isinstance(node, Constant):
        raise CannotEvaluate("a measure of a region that is random itself")
    return cast(Region, node.value)


def is_box(node: Node) -> bool:
    """Whether an expression is a box, random or not."""
    return isinstance(node, RectangleAt) or (isinstance(node, Constant) and isinstance(node.value, Rectangle))


def truth(code: object) -> Formula:
    """A code as a condition: numbers other than 0 hold."""
    if is_formula(code):
        return code
    if isinstance(code, CodeChoice):
        return disjunction(conjunction([where, truth(value)]) for where, value in code.options)
    if isinstance(code, Undefined):
        return FALSE
    if is_term(code):
        return disjunction([compare("<", code, 0.0), compare("<", 0.0, code)])
    return TRUE if code else FALSE


def in_interval(term: Term, low: float, high: float) -> list[Formula]:
    """That a term lies in an interval."""
    return [compare("<=", low, term), compare("<=", term, high)]


def equal(left: Term, right: object) -> Formula:
    """That a term equals a number's code."""
    return FALSE if isinstance(right, Undefined) else compare("==", left, cast(Term, right))


def cases(index: Term | Formula, options: Sequence[Formula]) -> Formula:
    """That the option holds which an index picks."""
    return disjunction(conjunction([index_equals(index, number), option]) for number, option in enumerate(options))


def rotate_vector(vector: TermVector, angle: Term) -> TermVector:
    """A vector turned counter-clockwise."""
    x, y = vector
    c, s = apply(ArithmeticOp.COS, angle), apply(ArithmeticOp.SIN, angle)
    return (
        apply(ArithmeticOp.SUB, apply(ArithmeticOp.MUL, x, c), apply(ArithmeticOp.MUL, y, s)),
        apply(ArithmeticOp.ADD, apply(ArithmeticOp.MUL, x, s), apply(ArithmeticOp.MUL, y, c)),
    )


def compare_codes(op: CompareOp, left: object, right: object) -> Formula:
    """A comparison of two codes."""
    for choice, other, swapped in ((left, right, False), (right, left, True)):
        if isinstance(choice, CodeChoice):
            pairs = [(where, (other, value) if swapped else (value, other)) for where, value in choice.options]
            return disjunction(conjunction([where, compare_codes(op, *sides)]) for where, sides in pairs)
    if isinstance(left, Undefined) or isinstance(right, Undefined):
        return FALSE
    if not (is_term(left) and is_term(right)):
        if is_formula(left) or is_formula(right):
            alike = _alike(left, right)
            return alike if op is CompareOp.EQ else negation(alike)
        return TRUE if (left == right) == (op is CompareOp.EQ) else FALSE
    if op is CompareOp.NE:
        return negation(compare("==", left, right))
    return compare(op.value, left, right)


def _alike(left: object, right: object) -> Formula:
    """That two values are equal, of which one at least is a truth value; as a number it is 1 or 0."""
    if not is_formula(left):
        return _alike(right, left) if is_formula(right) else FALSE
    if is_formula(right):
        true, false = right, negation(right)
    elif is_term(right):
        true, false = compare("==", right, 1.0), compare("==", right, 0.0)
    else:
        return FALSE
    return disjunction([conjunction([left, true]), conjunction([negation(left), false])])


def connect(op: LogicOp, args: list[object]) -> object:
    """A connective of codes."""
    parts = [FALSE if isinstance(arg, Undefined) else truth(arg) for arg in args]
    if op is LogicOp.NOT:
        return FALSE if isinstance(args[0], Undefined) else negation(parts[0])
    return conjunction(parts) if op is LogicOp.AND else disjunction(parts)
