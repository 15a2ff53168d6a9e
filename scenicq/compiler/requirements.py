"""`require`: a condition on every scene, over the names that the program has at that moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenicq.compiler import expressions
from scenicq.compiler.coerce import to_boolean
from scenicq.compiler.courses import split_by_course
from scenicq.compiler.environment import Environment
from scenicq.compiler.logic import condition
from scenicq.compiler.temporal import is_temporal
from scenicq.compiler.values import DelayedValue, ModelValue, fail
from scenicq.errors import Span
from scenicq.forest.nodes import Node
from scenicq.syntax import ast, phrases

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["RequireStatement", "defer", "defer_value", "requirement"]


@dataclass(frozen=True, slots=True, eq=False)
class RequireStatement:
    """A `require` statement: its condition, or what computes it once the ego is known."""

    condition: Callable[[], Node]
    span: Span
    probability: float = 1.0


def requirement(run: Interpreter, node: ast.Require, scope: Environment) -> RequireStatement | None:
    """The requirement that a statement makes; None where it is about time and ignored.

    Raises:
        ScenarioError: wrong-value for what is no probability, or one that a requirement over time cannot have.
    """
    probability = 1.0 if node.probability is None else _probability(run, node.probability, scope)
    wanted = node.condition
    if is_temporal(wanted) and node.probability is not None and probability != 1:
        raise fail("wrong-value", "a requirement with operators of time has no probability", node.probability.span,
                   "only 1 is allowed here", ("leave the probability out",))  # fmt: skip
    if run.timed is not None and is_temporal(wanted):
        run.timed.require(lambda expression: defer(run, expression, scope, node.span), wanted, node.span)
        return None
    if ast.is_phrase(wanted, *phrases.TEMPORAL):
        run.dynamic(f"require {wanted.row.words[0]}", wanted.span)
        if wanted.row is not phrases.ALWAYS:
            return None
        (wanted,) = wanted.given
    return RequireStatement(defer(run, wanted, scope, node.span), node.span, probability)


def defer(run: Interpreter, wanted: ast.Expression, scope: Environment, span: Span) -> Callable[[], Node]:
    """What computes a condition, once the ego is known, over the names that the program has now."""
    evaluated = defer_value(run, wanted, scope, span, condition)

    def truth() -> Node:
        value = evaluated()
        if isinstance(value, DelayedValue):
            raise fail("wrong-type", "this needs the position of an object", wanted.span, "no object here",
                       ("write `F at V`",))  # fmt: skip
        return to_boolean(value, wanted.span)

    return lambda: split_by_course(run, truth, wanted.span)


def defer_value(
    run: Interpreter, wanted: ast.Expression, scope: Environment, span: Span,
    evaluate: Callable[[Interpreter, ast.Expression, Environment], ModelValue] = expressions.evaluate,
) -> Callable[[], ModelValue]:  # fmt: skip
    """What evaluates an expression, once the ego is known, over the names that the program has now."""
    names: dict[str, ModelValue] = {}
    current = scope
    while current.parent is not None:
        names = current.names | names
        current = current.parent
    run.budget.step(span, 20 + len(names))
    frozen, ego = Environment(names, current), run.current_ego
    module = scope.module
    then = dict(module.names)

    def evaluated() -> ModelValue:
        # names and the ego are those of the moment of the statement, also in the functions that the expression calls
        now, before = module.names, run.current_ego
        module.names, run.current_ego = now | then, ego
        try:
            return evaluate(run, wanted, frozen)
        finally:
            module.names, run.current_ego = now, before

    return evaluated


def _probability(run: Interpreter, node: ast.Expression, scope: Environment) -> float:
    value = run.evaluate(node, scope)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        raise fail("wrong-value", "a probability must be a known number from 0 to 1", node.span)
    return float(value)
