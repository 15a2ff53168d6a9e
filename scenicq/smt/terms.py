"""Making terms and formulas (`problem`): constants are folded, negations go into comparisons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import reduce
from typing import cast

from scenicq.budget import look
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Compare, CompareOp, Constant, Logic, LogicOp, Range
from scenicq.forest.scalars import arithmetic
from scenicq.forest.scalars import compare as compare_numbers
from scenicq.forest.walk import postorder
from scenicq.smt.problem import Formula, Term

__all__ = ["FALSE", "TRUE", "apply", "compare", "conjunction", "disjunction", "is_known", "negation", "number", "parts"]

TRUE = Constant(True)
FALSE = Constant(False)

ROUNDING = 1e-12
"""Relative error below which a comparison of numbers that fails is left to the solver's precision."""
_NEUTRAL = {
    ArithmeticOp.ADD: 0.0, ArithmeticOp.SUB: 0.0, ArithmeticOp.MUL: 1.0, ArithmeticOp.DIV: 1.0, ArithmeticOp.POW: 1.0,
}  # fmt: skip
"""Second arguments that change nothing."""
_COMMUTE = (ArithmeticOp.ADD, ArithmeticOp.MUL)
_FOLDED = (*_COMMUTE, ArithmeticOp.MIN, ArithmeticOp.MAX)


def number(value: float) -> Constant:
    """A known number."""
    assert math.isfinite(value), value
    return Constant(float(value))


def apply(op: ArithmeticOp, *arguments: Term | float) -> Term:
    """Apply an operation, two arguments at a time where there are more, folding constants and neutral elements.

    Folding computes in binary64, one rounding for each application. What is undefined stays unfolded.
    """
    args = [number(each) if isinstance(each, int | float) else each for each in arguments]
    known = [arg for arg in args if isinstance(arg, Constant)]
    if len(args) > 2:
        others = [arg for arg in args if not isinstance(arg, Constant)]
        return _apply_in_turn(op, [*others, _apply_in_turn(op, known)] if known and others else args)
    if len(known) == len(args):
        value = arithmetic(op, [cast(float, arg.value) for arg in known])
        return Constant(value) if isinstance(value, float) else Arithmetic(op, tuple(args))
    if known and op in _COMMUTE:
        args.sort(key=lambda arg: isinstance(arg, Constant))
    first, last = args[0], args[-1]
    if isinstance(last, Constant):
        if last.value == _NEUTRAL.get(op):
            return first
        if op is ArithmeticOp.MUL and last.value == 0 and isinstance(first, Range):
            return Constant(0.0)
    if op is ArithmeticOp.NEG and isinstance(last, Arithmetic) and last.op is ArithmeticOp.NEG:
        return cast(Term, last.args[0])
    return first if op in _FOLDED and len(args) == 1 else Arithmetic(op, tuple(args))


def _apply_in_turn(op: ArithmeticOp, args: Sequence[Term]) -> Term:
    return reduce(lambda one, other: apply(op, one, other), args)


def compare(relation: str, left: Term | float, right: Term | float) -> Formula:
    """Compare two terms by one of `<=`, `<`, `==`, `>=`, `>`.

    A comparison of numbers becomes `TRUE` or `FALSE`, unless it fails by no more than rounding: then it stays, so that
    the solver's precision decides.
    """
    if relation in (">=", ">"):
        return compare("<" + relation[1:], right, left)
    sides = [number(side) if isinstance(side, int | float) else side for side in (left, right)]
    atom = Compare(CompareOp(relation), *sides)
    numbers = [cast(float, side.value) for side in sides if isinstance(side, Constant)]
    if len(numbers) < 2:
        return atom
    low, high = numbers
    if compare_numbers(atom.op, low, high):
        return TRUE
    return atom if abs(low - high) <= ROUNDING * max(1.0, abs(low), abs(high)) else FALSE


def conjunction(formulas: Iterable[Formula]) -> Formula:
    """All of the formulas: `TRUE` of none, `FALSE` if one is, nested conjunctions merged."""
    return _connected(LogicOp.AND, formulas)


def disjunction(formulas: Iterable[Formula]) -> Formula:
    """At least one of the formulas: `FALSE` of none, `TRUE` if one is, nested disjunctions merged."""
    return _connected(LogicOp.OR, formulas)


def _connected(op: LogicOp, formulas: Iterable[Formula]) -> Formula:
    decisive = op is LogicOp.OR
    merged: dict[int, Formula] = {}
    for formula in formulas:
        look()
        merged.update((id(member), member) for member in parts(op, formula))
    members = [member for member in merged.values() if not is_known(member, not decisive)]
    if any(is_known(member, decisive) for member in members):
        return TRUE if decisive else FALSE
    if len(members) > 1:
        return Logic(op, tuple(members))
    return members[0] if members else FALSE if decisive else TRUE


def is_known(formula: Formula, value: bool) -> bool:
    """Whether a formula is this truth value."""
    return isinstance(formula, Constant) and formula.value is value


def parts(op: LogicOp, formula: Formula) -> tuple[Formula, ...]:
    """What a conjunction or disjunction is made of; anything else alone."""
    if isinstance(formula, Logic) and formula.op is op:
        return cast("tuple[Formula, ...]", formula.args)
    return (formula,)


def negation(formula: Formula) -> Formula:
    """The opposite; where a term is undefined, a comparison and its opposite both fail."""
    opposite: dict[int, Formula] = {}
    for node in postorder((formula,)):
        match node:
            case Constant(value=bool() as value):
                opposite[id(node)] = FALSE if value else TRUE
            case Compare():
                left, right = cast(Term, node.left), cast(Term, node.right)
                above = compare("<=" if node.op is CompareOp.LT else "<", right, left)
                below = [compare("<", left, right)] if node.op is CompareOp.EQ else []
                opposite[id(node)] = disjunction([*below, above])
            case Logic():
                dual = LogicOp.OR if node.op is LogicOp.AND else LogicOp.AND
                opposite[id(node)] = _connected(dual, (opposite[id(arg)] for arg in node.args))
            case _:
                pass
    return opposite[id(formula)]
