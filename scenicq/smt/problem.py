"""Problems: what solvers are asked, in a part of the forest's language.

A variable is a `Range`, a term is made of variables and numbers by `Arithmetic`, a formula of comparisons of terms
(`<=`, `<`, `==`) by `and` and `or`: negations have gone into the comparisons. A comparison with an undefined side does
not hold. Build with `terms`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeGuard, cast

from scenicq.forest.nodes import (
    Arithmetic,
    Compare,
    CompareOp,
    Constant,
    Identity,
    Logic,
    Node,
    Range,
    Undefined,
    Value,
)
from scenicq.forest.scalars import arithmetic, compare, connect
from scenicq.forest.walk import children, postorder

__all__ = ["Formula", "Problem", "Term", "Variable", "holds", "is_formula", "is_term"]

Term = Constant | Range | Arithmetic
Formula = Constant | Compare | Logic


def is_term(code: object) -> TypeGuard[Term]:
    """Whether something is a term."""
    return isinstance(code, Range | Arithmetic) or (isinstance(code, Constant) and isinstance(code.value, float))


def is_formula(code: object) -> TypeGuard[Formula]:
    """Whether something is a formula."""
    return isinstance(code, Compare | Logic) or (isinstance(code, Constant) and isinstance(code.value, bool))


@dataclass(frozen=True, slots=True)
class Variable:
    """A real variable of a problem.

    Attributes:
        name: Its name in that problem.
        leaf: The random number that it is in the constraint; the closed range may have infinite ends.
    """

    name: str
    leaf: Range

    @classmethod
    def of(cls, name: str, low: float, high: float, identity: Identity | None = None) -> Variable:
        """A variable with a closed range, which is a new random number unless it is told which."""
        ends = Constant(float(low)), Constant(float(high))
        return cls(name, Range(*ends) if identity is None else Range(*ends, identity=identity))

    @property
    def low(self) -> float:
        """The least value."""
        return cast(float, cast(Constant, self.leaf.low).value)

    @property
    def high(self) -> float:
        """The greatest value."""
        return cast(float, cast(Constant, self.leaf.high).value)


@dataclass(frozen=True, slots=True)
class Problem:
    """Are there values of the variables, within their ranges, that satisfy the constraint?

    Attributes:
        variables: Every variable that the constraint uses; the names differ.
        constraint: A formula.
    """

    variables: tuple[Variable, ...]
    constraint: Formula

    def __post_init__(self) -> None:
        """Refuse two variables of one name."""
        names = {variable.name for variable in self.variables}
        assert len(names) == len(self.variables), "two variables of one name"

    def __reduce__(self) -> tuple[Callable[..., Problem], tuple[Any, ...]]:
        """Pickle nodes after those below them: depth is no limit."""
        return _restored, (self.variables, tuple(postorder((self.constraint,))))


def _restored(variables: tuple[Variable, ...], nodes: tuple[Node, ...]) -> Problem:
    return Problem(variables, cast(Formula, nodes[-1]))


def holds(problem: Problem, witness: Mapping[str, float], slack: float = 0.0) -> bool:
    """Whether a point lies in the ranges of the variables and satisfies the constraint.

    Args:
        problem: The problem.
        witness: The values of variables by name; without that of one of them, it does not.
        slack: By how much each end and each comparison may be missed, in its unit.
    """
    given: dict[Identity, float] = {}
    for variable in problem.variables:
        value = given[variable.leaf.identity] = witness.get(variable.name, math.nan)
        if not variable.low - slack <= value <= variable.high + slack:
            return False
    values: dict[int, Value] = {}
    for node in postorder((problem.constraint,)):
        args = [values[id(child)] for child in children(node)]
        match node:
            case Constant():
                values[id(node)] = node.value
            case Range():
                values[id(node)] = given[node.identity]
            case Logic():
                values[id(node)] = connect(node.op, args)
            case _:
                lost = next((arg for arg in args if isinstance(arg, Undefined)), None)
                values[id(node)] = lost or _operated(
                    cast("Arithmetic | Compare", node), cast("list[float]", args), slack
                )
    return values[id(problem.constraint)] is True


def _operated(node: Arithmetic | Compare, args: list[float], slack: float) -> Value:
    if isinstance(node, Arithmetic):
        return arithmetic(node.op, args)
    left, right = args
    return _weakly(node, left, right, slack)


def _weakly(atom: Compare, left: float, right: float, slack: float) -> bool:
    """Whether a comparison holds or fails by no more than a slack."""
    if compare(atom.op, left, right):
        return True
    return slack > 0 and (abs(left - right) if atom.op is CompareOp.EQ else left - right) <= slack
