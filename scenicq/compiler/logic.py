"""`and`, `or`, `not`: as conditions, of which only the truth counts, and as the values that Python makes of them."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import is_random
from scenicq.compiler.builtins import truth
from scenicq.compiler.coerce import kind_of_model, to_boolean
from scenicq.compiler.courses import as_test, split_by_course
from scenicq.compiler.environment import Environment
from scenicq.compiler.known_properties import known_truth
from scenicq.compiler.random_values import is_choice, lift
from scenicq.compiler.values import DelayedValue, ModelValue, fail, is_node
from scenicq.errors import Span
from scenicq.forest.nodes import Constant
from scenicq.syntax import ast
from scenicq.syntax.walk import walk

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["condition", "connect", "invert"]


def condition(run: Interpreter, node: ast.Expression, scope: Environment) -> ModelValue:
    """The value of an expression of which only the truth counts."""
    match node:
        case ast.BoolOp():
            # each operand takes its courses by itself, unless one names what another reads
            alone = run.course is not None and not any(isinstance(each, ast.Walrus) for each in walk(node))
            values = (_operand(run, part, scope) if alone else condition(run, part, scope) for part in node.values)
            return _joined(node.operator, _until_decided(run, node.operator, values, node.span), node.span)
        case ast.UnaryOp(operator="not"):
            return invert(condition(run, node.operand, scope), node.span)
        case _:
            return run.evaluate(node, scope)


def _operand(run: Interpreter, node: ast.Expression, scope: Environment) -> ModelValue:
    """The truth of an operand, with all its courses."""
    found = split_by_course(run, lambda: to_boolean(condition(run, node, scope), node.span), node.span)
    return found.value if isinstance(found, Constant) and isinstance(found.value, bool) else found


def invert(value: ModelValue, span: Span) -> ModelValue:
    """`not value`."""
    return operators.combine("not", [value], span) if is_random(value) else not truth(value, span)


def connect(run: Interpreter, node: ast.BoolOp, scope: Environment) -> ModelValue:
    """The value of `a and b` or `a or b`: the operand that decides, else the last one."""
    values = (run.evaluate(part, scope) for part in node.values)
    return _deciding(run, node.operator, _until_decided(run, node.operator, values, node.span), node.span)


def _until_decided(run: Interpreter, op: str, values: Iterable[ModelValue], span: Span) -> list[ModelValue]:
    """Operands up to the first known one that decides: Python does not evaluate the others.

    What one of them lacks excludes scenes in which those before do not decide.
    """
    found: list[ModelValue] = []
    with ExitStack() as around:
        for value in values:
            if isinstance(value, DelayedValue):
                raise fail("wrong-type", "this needs the object's position, which is not known here", span)
            found.append(value)
            if not is_random(value):
                if truth(value, span) == (op == "or"):
                    break
            elif is_node(test := as_test(value, span)):
                around.enter_context(run.excluded.assuming(test, int(op == "and"), 2))
    return found


def _joined(op: str, values: list[ModelValue], span: Span) -> ModelValue:
    """The truth of operands together."""
    pending = [value for value in values if is_random(value)]
    if not pending or not (is_random(values[-1]) or truth(values[-1], span) != (op == "or")):
        return values[-1]
    return operators.combine(op, pending, span)


def _deciding(run: Interpreter, op: str, values: list[ModelValue], span: Span) -> ModelValue:
    """The operand that Python would take.

    Raises:
        ScenarioError: random-branch, where that depends on the truth of random numbers or strings.
    """
    # a known operand that does not decide counts only if it is the last one
    left = [value for value in values[:-1] if is_random(value)] + values[-1:]
    if len(left) == 1 or all(kind_of_model(value) == "boolean" and not is_choice(value) for value in left):
        return _joined(op, left, span)
    if any(map(is_choice, left[:-1])):

        def taken(*outcome: ModelValue) -> ModelValue:
            return _deciding(run, op, _until_decided(run, op, outcome, span), span)

        return lift(taken, *left, span=span, spread=is_choice)
    if run.course is not None:
        return next((value for value in left[:-1] if known_truth(run, value, span) == (op == "or")), left[-1])
    raise fail("random-branch", f"which operand `{op}` gives depends on a random value", span, "random here",
               ("compare the values, as in `a > 0`", "state conditions with `require`"))  # fmt: skip
