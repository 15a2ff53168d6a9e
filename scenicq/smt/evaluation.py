"""Plain floating point evaluation of formulas: how a witness is tested.

A *margin* says by how much a formula holds (positive) or fails (negative): the least over a conjunction, the greatest
over a disjunction. With a slack of d a formula counts as true where its margin is at least -d, which is how a
delta-complete procedure weakens a formula.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from scenicq.smt.formula import Formula, Node, Operator, Problem, flatten
from scenicq.smt.operators import operate

__all__ = ["Evaluator", "evaluate", "holds"]

TINY = 5e-324
"""The least positive double: the margin by which `x < x` fails."""


class Evaluator:
    """A term or formula ready to be evaluated at many points."""

    def __init__(self, root: Node) -> None:
        """Flatten the node once."""
        self._rows = flatten(root)
        self._steps = [(kind, _OPERATORS.get(kind), children) for kind, _, children in self._rows]
        self._leaves = [
            (index, text if kind == "var" else None, float(text) if kind == "num" else 0.0)
            for index, (kind, text, _) in enumerate(self._rows)
            if kind in ("var", "num")
        ]

    def __call__(self, values: Mapping[str, float]) -> float:
        """Value of a term (NaN where undefined) or margin of a formula.

        Raises:
            KeyError: A variable has no value.
        """
        results = [0.0] * len(self._rows)
        for index, name, number in self._leaves:
            results[index] = number if name is None else values[name]
        for index, (kind, operator, children) in enumerate(self._steps):
            if operator is not None:
                results[index] = operate(operator, [results[child] for child in children])
            elif kind == "and":
                results[index] = min((results[child] for child in children), default=math.inf)
            elif kind == "or":
                results[index] = max((results[child] for child in children), default=-math.inf)
            elif kind not in ("var", "num"):
                results[index] = _margin(kind, results[children[0]], results[children[1]])
        return results[-1]


_OPERATORS = {operator.value: operator for operator in Operator}


def _margin(relation: str, left: float, right: float) -> float:
    gap = right - left
    if math.isnan(gap):
        return -math.inf
    if relation == "==":
        return -abs(gap)
    return -TINY if gap == 0 and relation == "<" else gap


def evaluate(formula: Formula, values: Mapping[str, float], slack: float = 0.0) -> bool:
    """Whether a formula holds at a point, each atom weakened by the slack (in the unit of the atom's sides).

    Raises:
        KeyError: A variable has no value.
    """
    return Evaluator(formula)(values) >= -slack


def holds(problem: Problem, values: Mapping[str, float], slack: float = 0.0) -> bool:
    """Whether a point lies in the ranges of the variables and satisfies the constraint, each within the slack."""
    for variable in problem.variables:
        value = values.get(variable.name, math.nan)
        if not variable.low - slack <= value <= variable.high + slack:
            return False
    return evaluate(problem.constraint, values, slack)
