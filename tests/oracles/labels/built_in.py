"""The built-in solver as one that is asked about problems: the constraint is a requirement.

The solver knows expressions of scenarios alone. An equation holds, as for the other solvers, within the precision.
"""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

from scenicq.budget import Exhausted, limited
from scenicq.forest import build
from scenicq.forest.groups import Condition
from scenicq.forest.nodes import ArithmeticOp, Compare, CompareOp, Constant, Leaf, Node, Normal, Range
from scenicq.forest.scenario import Requirement
from scenicq.forest.walk import transform
from scenicq.match.decide.solver_step import ask
from scenicq.match.options import MatchOptions
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.tolerance import Tolerance
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.problem import Problem, Variable


def leaf_of(variable: Variable) -> Leaf:
    """A random number that takes the values of a variable; where these have no end, more than those."""
    if math.isfinite(variable.low) and math.isfinite(variable.high):
        return variable.leaf
    return Normal(build.constant(0.0), build.constant(1.0), identity=variable.leaf.identity)


def items_of(problem: Problem, precision: float) -> list[Item]:
    """The ranges and the constraint of a problem as requirements on random numbers."""
    leaves = {variable.leaf.identity: leaf_of(variable) for variable in problem.variables}

    def meant(node: Node) -> Node:
        match node:
            case Range():
                return leaves[node.identity]
            case Compare(CompareOp.EQ, left, right):
                off = build.arithmetic(ArithmeticOp.ABS, build.arithmetic(ArithmeticOp.SUB, left, right))
                return build.compare(CompareOp.LE, off, build.constant(precision))
            case Compare(op, Constant(value=left), Constant(value=right)):
                # as the other solvers do, of what is known rounding is left to the precision
                return build.compare(op, build.constant(left), build.constant(right + precision))
            case _:
                return node

    parts = [transform(problem.constraint, meant)]
    for variable in problem.variables:
        leaf = leaves[variable.leaf.identity]
        if isinstance(leaf, Normal):
            ends = ((CompareOp.GE, variable.low), (CompareOp.LE, variable.high))
            parts += [Compare(op, leaf, build.constant(end)) for op, end in ends if math.isfinite(end)]
        elif variable.low > variable.high:
            parts.append(build.constant(False))
    return [(Condition(Requirement(part, None), part), part, None) for part in parts]


def check(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """Decide a problem; see `Solver.check`."""
    options = MatchOptions(tolerance=Tolerance(), timeout_s=timeout_s)
    try:
        with limited(timeout_s):
            outcome = ask([items_of(problem, precision)], options, None)
    except Exhausted as error:
        return NoAnswer(error.reason)
    match outcome:
        case Satisfied(values):
            near_zero = {v.name: min(max(0.0, v.low), v.high) for v in problem.variables}
            return Sat({v.name: float(values.get(v.leaf.identity, near_zero[v.name])) for v in problem.variables})
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
