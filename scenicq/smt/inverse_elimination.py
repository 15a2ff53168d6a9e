"""Inverse trigonometric functions written as relations, for solvers whose own lose solutions.

The interval operator of dReal for `atan2` loses solutions where an argument is zero. An atom over `atan2(y, x)` becomes
one over a new angle t and a new length r with `x = r cos t` and `y = r sin t`; arc sine and arc cosine become the sine
and cosine of a new angle. At the origin, where `atan2` is undefined, and at the seam the relation allows more than the
function: no solution is lost, and a witness must be replayed.
"""

from __future__ import annotations

import math

from scenicq.smt.formula import (
    Conjunction,
    Disjunction,
    Formula,
    Op,
    Operator,
    Problem,
    Term,
    TermComparison,
    Var,
    Variable,
    compare,
    conjunction,
    disjunction,
    postorder,
)

__all__ = ["without_inverses"]

_ROUNDING = 1e-15
_RANGES = {
    Operator.ATAN2: (-math.pi, math.pi),
    Operator.ASIN: (-math.pi / 2, math.pi / 2),
    Operator.ACOS: (0.0, math.pi),
}


def without_inverses(problem: Problem) -> Problem:
    """The problem without `atan2`, arc sine and arc cosine; it has more variables, whose names start with a space."""
    order = postorder(problem.constraint)
    if not any(isinstance(node, Op) and node.op in _RANGES for node in order):
        return problem
    variables = list(problem.variables)
    terms: dict[int, Term] = {}
    relations: dict[int, dict[TermComparison, None]] = {}
    formulas: dict[int, Formula] = {}
    for node in order:
        match node:
            case Op(operator, args):
                found = {atom: None for arg in args for atom in relations.get(id(arg), ())}
                new = tuple(terms.get(id(arg), arg) for arg in args)
                if operator in _RANGES:
                    terms[id(node)], atoms = _related(operator, new, variables)
                    found.update(dict.fromkeys(atoms))
                else:
                    terms[id(node)] = Op(operator, new)
                if found:
                    relations[id(node)] = found
            case TermComparison(relation, left, right):
                found = {**relations.get(id(left), {}), **relations.get(id(right), {})}
                atom = TermComparison(relation, terms.get(id(left), left), terms.get(id(right), right))
                formulas[id(node)] = conjunction([atom, *found])
            case Conjunction(args):
                formulas[id(node)] = conjunction(formulas[id(arg)] for arg in args)
            case Disjunction(args):
                formulas[id(node)] = disjunction(formulas[id(arg)] for arg in args)
            case _:
                terms[id(node)] = node
    return Problem(tuple(variables), formulas[id(problem.constraint)])


def _related(
    operator: Operator, args: tuple[Term, ...], variables: list[Variable]
) -> tuple[Term, list[TermComparison]]:
    """A new angle, and what relates it to the arguments; new variables are added to the list."""
    low, high = _RANGES[operator]
    angle = Var(f" {len(variables)}")
    variables.append(Variable(angle.name, low - _ROUNDING, high + _ROUNDING))
    sine, cosine = Op(Operator.SIN, (angle,)), Op(Operator.COS, (angle,))
    if operator is Operator.ASIN:
        return angle, _equalities((sine, args[0]))
    if operator is Operator.ACOS:
        return angle, _equalities((cosine, args[0]))
    length = Var(f" {len(variables)}")
    variables.append(Variable(length.name, 0.0, math.inf))
    y, x = args
    return angle, _equalities((Op(Operator.MUL, (length, sine)), y), (Op(Operator.MUL, (length, cosine)), x))


def _equalities(*pairs: tuple[Term, Term]) -> list[TermComparison]:
    atoms = [compare("==", left, right) for left, right in pairs]
    return [atom for atom in atoms if isinstance(atom, TermComparison)]
