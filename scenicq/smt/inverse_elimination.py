"""Inverse trigonometric functions written as relations, for solvers whose own lose solutions.

The interval operator of dReal for `atan2` loses solutions where an argument is zero. An atom over `atan2(y, x)` becomes
one over a new angle t and a new length r with `x = r cos t` and `y = r sin t`; arc sine and arc cosine become the sine
and cosine of a new angle. At the origin, where `atan2` is undefined, and at the seam the relation allows more than the
function: no solution is lost, and a witness must be replayed.
"""

from __future__ import annotations

import math
from typing import cast

from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Compare, Logic, LogicOp, Node
from scenicq.forest.walk import children, postorder, rebuild
from scenicq.smt.problem import Formula, Problem, Term, Variable
from scenicq.smt.terms import apply, compare, conjunction, disjunction

__all__ = ["without_inverses"]

_ROUNDING = 1e-15
_RANGES = {
    ArithmeticOp.ATAN2: (-math.pi, math.pi),
    ArithmeticOp.ASIN: (-math.pi / 2, math.pi / 2),
    ArithmeticOp.ACOS: (0.0, math.pi),
}


def without_inverses(problem: Problem) -> Problem:
    """The problem without `atan2`, arc sine and arc cosine; it has more variables, whose names start with a space."""
    order = list(postorder((problem.constraint,)))
    if not any(isinstance(node, Arithmetic) and node.op in _RANGES for node in order):
        return problem
    variables = list(problem.variables)
    made: dict[int, Node] = {}
    relations: dict[int, dict[Formula, None]] = {}
    for node in order:
        match node:
            case Logic():
                connected = conjunction if node.op is LogicOp.AND else disjunction
                made[id(node)] = connected(cast(Formula, made[id(arg)]) for arg in node.args)
            case Arithmetic() | Compare():
                args = children(node)
                found = {atom: None for arg in args for atom in relations.get(id(arg), ())}
                new = tuple(made[id(arg)] for arg in args)
                if isinstance(node, Arithmetic) and node.op in _RANGES:
                    made[id(node)], atoms = _related(node.op, cast("tuple[Term, ...]", new), variables)
                    found.update(dict.fromkeys(atoms))
                else:
                    made[id(node)] = rebuild(node, new)
                if isinstance(node, Compare):
                    made[id(node)] = conjunction([cast(Compare, made[id(node)]), *found])
                elif found:
                    relations[id(node)] = found
            case _:
                made[id(node)] = node
    return Problem(tuple(variables), cast(Formula, made[id(problem.constraint)]))


def _related(op: ArithmeticOp, args: tuple[Term, ...], variables: list[Variable]) -> tuple[Term, list[Formula]]:
    """A new angle, and what relates it to the arguments; new variables are added to the list."""
    low, high = _RANGES[op]
    angle = _new(variables, low - _ROUNDING, high + _ROUNDING)
    sine, cosine = apply(ArithmeticOp.SIN, angle), apply(ArithmeticOp.COS, angle)
    if op is not ArithmeticOp.ATAN2:
        return angle, [compare("==", sine if op is ArithmeticOp.ASIN else cosine, args[0])]
    length = _new(variables, 0.0, math.inf)
    y, x = args
    return angle, [
        compare("==", apply(ArithmeticOp.MUL, length, each), side) for each, side in ((sine, y), (cosine, x))
    ]


def _new(variables: list[Variable], low: float, high: float) -> Term:
    variables.append(Variable.of(f" {len(variables)}", low, high))
    return variables[-1].leaf
