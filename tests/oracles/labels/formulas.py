"""Problems of solvers by the names of their variables: whoever writes a test says `Var("x")` where he likes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

from scenicq.forest.evaluate import evaluate as evaluate_node
from scenicq.forest.nodes import Constant, Node, Range
from scenicq.forest.walk import postorder
from scenicq.smt import problem
from scenicq.smt.problem import Formula, Problem, Term, holds


@cache
def Var(name: str) -> Range:
    """The random number that a variable of this name is, whatever its range."""
    return Range(Constant(-math.inf), Constant(math.inf))


def Variable(name: str, low: float = -math.inf, high: float = math.inf) -> problem.Variable:
    """A variable of a problem."""
    return problem.Variable.of(name, low, high, Var(name).identity)


def free(root: Node, names: Mapping[str, float]) -> tuple[problem.Variable, ...]:
    """The variables of an expression, without an end to their range."""
    used = {node.identity for node in postorder((root,)) if isinstance(node, Range)}
    return tuple(Variable(name) for name in names if Var(name).identity in used)


def evaluate(formula: Formula, point: Mapping[str, float], slack: float = 0.0) -> bool:
    """Whether a formula holds at a point, each comparison weakened by the slack."""
    return holds(Problem(free(formula, point), formula), point, slack)


def value(term: Term, point: Mapping[str, float]) -> float:
    """The value of a term by the forest's own meaning; NaN where it is undefined."""
    found = evaluate_node(term, {Var(name).identity: number for name, number in point.items()})
    return found if isinstance(found, float) else math.nan
