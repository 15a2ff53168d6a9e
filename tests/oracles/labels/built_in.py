"""The built-in solver asked about formulas: each variable as a random number, the constraint as a requirement.

The solver knows expressions of scenarios alone. An equation holds, as for the other solvers, within the precision.
"""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

from scenicq.budget import Exhausted, limited
from scenicq.forest import build
from scenicq.forest.groups import Condition
from scenicq.forest.nodes import ArithmeticOp, Compare, CompareOp, Leaf, Logic, LogicOp, Node, Normal, Range
from scenicq.forest.scenario import Requirement
from scenicq.match.decide.solver_step import ask
from scenicq.match.options import MatchOptions
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.tolerance import Tolerance
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.formula import (
    Conjunction,
    Disjunction,
    Num,
    Op,
    Operator,
    Problem,
    Relation,
    TermComparison,
    Var,
    Variable,
    postorder,
)

OPERATIONS = {
    Operator.ADD: ArithmeticOp.ADD, Operator.SUB: ArithmeticOp.SUB, Operator.MUL: ArithmeticOp.MUL,
    Operator.DIV: ArithmeticOp.DIV, Operator.NEG: ArithmeticOp.NEG, Operator.ABS: ArithmeticOp.ABS,
    Operator.MIN: ArithmeticOp.MIN, Operator.MAX: ArithmeticOp.MAX, Operator.SQRT: ArithmeticOp.SQRT,
    Operator.SIN: ArithmeticOp.SIN, Operator.COS: ArithmeticOp.COS, Operator.TAN: ArithmeticOp.TAN,
    Operator.ASIN: ArithmeticOp.ASIN, Operator.ACOS: ArithmeticOp.ACOS, Operator.ATAN: ArithmeticOp.ATAN,
    Operator.ATAN2: ArithmeticOp.ATAN2, Operator.POW: ArithmeticOp.POW, Operator.EXP: ArithmeticOp.EXP,
    Operator.LOG: ArithmeticOp.LOG,
}  # fmt: skip
RELATIONS = {Relation.LE: CompareOp.LE, Relation.LT: CompareOp.LT}
FOLDS = (Operator.ADD, Operator.MUL, Operator.MIN, Operator.MAX)


def leaf_of(variable: Variable) -> Leaf:
    """A random number that takes the values of a variable; where these have no end, more than those."""
    if math.isfinite(variable.low) and math.isfinite(variable.high):
        return Range(build.constant(variable.low), build.constant(variable.high))
    return Normal(build.constant(0.0), build.constant(1.0))


def items_of(problem: Problem, precision: float, leaves: dict[str, Leaf]) -> list[Item]:
    """The ranges and the constraint of a problem as requirements on random numbers."""
    parts = [_expression(problem, precision, leaves)]
    for variable in problem.variables:
        leaf = leaves[variable.name]
        if isinstance(leaf, Normal):
            ends = ((CompareOp.GE, variable.low), (CompareOp.LE, variable.high))
            parts += [Compare(op, leaf, build.constant(end)) for op, end in ends if math.isfinite(end)]
        elif variable.low > variable.high:
            parts.append(build.constant(False))
    return [(Condition(Requirement(part, None), part), part, None) for part in parts]


def _expression(problem: Problem, precision: float, leaves: dict[str, Leaf]) -> Node:
    made: dict[int, Node] = {}
    for node in postorder(problem.constraint):
        match node:
            case Var(name):
                made[id(node)] = leaves[name]
            case Num(value):
                made[id(node)] = build.constant(value)
            case Op(operator, args):
                parts = [made[id(arg)] for arg in args]
                made[id(node)] = _applied(operator, parts)
            case TermComparison(Relation.EQ, left, right):
                off = build.arithmetic(ArithmeticOp.SUB, made[id(left)], made[id(right)])
                off = build.arithmetic(ArithmeticOp.ABS, off)
                made[id(node)] = build.compare(CompareOp.LE, off, build.constant(precision))
            case TermComparison(relation, left, right):
                # as the other solvers do, of what is known rounding is left to the precision
                more = precision if isinstance(left, Num) and isinstance(right, Num) else 0.0
                above = build.arithmetic(ArithmeticOp.ADD, made[id(right)], build.constant(more))
                made[id(node)] = build.compare(RELATIONS[relation], made[id(left)], above if more else made[id(right)])
            case Conjunction(args) | Disjunction(args):
                op = LogicOp.AND if isinstance(node, Conjunction) else LogicOp.OR
                parts = [made[id(arg)] for arg in args]
                made[id(node)] = Logic(op, tuple(parts)) if parts else build.constant(op is LogicOp.AND)
    return made[id(problem.constraint)]


def _applied(operator: Operator, args: list[Node]) -> Node:
    if operator not in FOLDS:
        return build.arithmetic(OPERATIONS[operator], *args)
    found = args[0]
    for each in args[1:]:
        found = build.arithmetic(OPERATIONS[operator], found, each)
    return found


def check(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """Decide a problem; see `Solver.check`."""
    leaves = {variable.name: leaf_of(variable) for variable in problem.variables}
    options = MatchOptions(tolerance=Tolerance(), timeout_s=timeout_s)
    try:
        with limited(timeout_s):
            outcome = ask([items_of(problem, precision, leaves)], options, None)
    except Exhausted as error:
        return NoAnswer(error.reason)
    match outcome:
        case Satisfied(values):
            near_zero = {v.name: min(max(0.0, v.low), v.high) for v in problem.variables}
            found = {name: values.get(leaf.identity, near_zero[name]) for name, leaf in leaves.items()}
            return Sat({name: float(value) for name, value in found.items()})
        case Refuted():
            return Unsat()
        case _:
            return NoAnswer(outcome.reason)


class BuiltIn:
    """The built-in solver as one that is asked about formulas."""

    name = "portable"

    def loads(self) -> bool:
        """It is there."""
        return True

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide a problem; see `Solver.check`."""
        return check(problem, precision=precision, timeout_s=timeout_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None):
        pass
