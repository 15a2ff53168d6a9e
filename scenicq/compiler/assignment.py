"""What gets a value: names, items, several names at once, the names of comprehensions."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from scenicq.compiler.arithmetic import check_hashable
from scenicq.compiler.coerce import to_boolean
from scenicq.compiler.environment import Environment
from scenicq.compiler.items import items_of
from scenicq.compiler.known_properties import known_truth
from scenicq.compiler.logic import condition
from scenicq.compiler.other_objects import list_elements
from scenicq.compiler.values import Instance, LabelObjects, ModelValue, OtherList, describe, fail
from scenicq.errors import Span
from scenicq.forest.nodes import Node
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["assign", "assign_around", "go_through", "through_others"]


def assign(run: Interpreter, target: ast.Expression, value: ModelValue, scope: Environment) -> None:
    """Give a name, an item or several names a value."""
    match target:
        case ast.Name():
            run.name_value(target.id, value, scope, target.span)
        case ast.Tuple() | ast.List():
            _assign_each(run, target.items, items_of(run, value, target.span), scope, target.span)
        case ast.Subscript(index=index) if not isinstance(index, ast.SubscriptSlice):
            holder = run.evaluate(target.value, scope)
            if not isinstance(holder, list | dict):
                raise fail("wrong-type", f"an item of {describe(holder)} cannot be set", target.span)
            place = run.evaluate(index, scope)
            try:
                cast(Any, holder)[check_hashable(place, target.span) if isinstance(holder, dict) else place] = value
            except (IndexError, TypeError):
                raise fail("runtime-error", "there is no item with this index", target.span) from None
        case ast.Subscript() | ast.SubscriptSlice() | ast.Starred():
            raise fail("unsupported-construct", "this cannot be assigned to", target.span, "not a name",
                       ("make a new list",))  # fmt: skip
        case _:
            raise fail("unsupported-construct", "this cannot be assigned to", target.span, "not a name",
                       ("give objects their properties with `with`",))  # fmt: skip


def _assign_each(
    run: Interpreter, targets: tuple[ast.Expression, ...], items: list[ModelValue], scope: Environment, span: Span
) -> None:
    """Give several names a value each; one with a star takes what the others leave."""
    starred = [number for number, target in enumerate(targets) if isinstance(target, ast.Starred)]
    spare = len(items) - len(targets)
    if len(starred) > 1 or (spare != 0 and not (starred and spare >= -1)):
        raise fail("wrong-value", f"{len(items)} values for {len(targets)} names", span)
    if starred:
        first = starred[0]
        taken = items[first : first + spare + 1]
        items = [*items[:first], taken, *items[first + spare + 1 :]]
    for target, item in zip(targets, items, strict=True):
        assign(run, target.value if isinstance(target, ast.Starred) else target, item, scope)


def assign_around(run: Interpreter, target: ast.Name, value: ModelValue, scope: Environment) -> None:
    """`name := value`, which binds outside of comprehensions."""
    while scope.comprehension and scope.parent is not None:
        scope = scope.parent
    assign(run, target, value, scope)


def go_through(
    run: Interpreter, clauses: tuple[ast.Clause, ...], scope: Environment, visit: Callable[[Environment], None],
    first: ModelValue = ...,
) -> None:  # fmt: skip
    """Visit every combination of a comprehension, whose names live in one scope of their own.

    Args:
        run: The interpreter.
        clauses: The clauses.
        scope: The names around, which the first list sees.
        visit: Called for each.
        first: The first list, where it is evaluated already.
    """
    _nest(run, clauses, scope, Environment({}, scope, comprehension=True), visit, first)


def through_others(run: Interpreter, node: ast.Comprehension, objects: LabelObjects, scope: Environment) -> OtherList:
    """A comprehension over label objects that play no role, which is evaluated for one that stands for each.

    Raises:
        ScenarioError: unsupported-construct, where there is more than one `for`, or a set is made.
    """
    (clause, *more) = node.clauses
    if more or node.kind == "set":
        what = more[0].span if more else node.span
        raise fail("unsupported-construct", "a list of other label objects has one `for`", what, "not that one",
                   ("ask about one of them after the other, with `any` inside `any`",))  # fmt: skip
    inner = Environment({}, scope, comprehension=True)

    def visit(element: Instance) -> tuple[tuple[Node, ...], ModelValue]:
        assign(run, clause.target, element, inner)
        conditions = tuple(to_boolean(condition(run, test, inner), test.span) for test in clause.conditions)
        return conditions, run.evaluate(node.element, inner)

    return list_elements(objects, clause.iterable.span, visit)


def _nest(
    run: Interpreter,
    clauses: tuple[ast.Clause, ...],
    around: Environment,
    inner: Environment,
    visit: Callable[[Environment], None],
    first: ModelValue = ...,
) -> None:
    if not clauses:
        visit(inner)
        return
    clause = clauses[0]
    iterable = run.evaluate(clause.iterable, around) if first is ... else first
    for item in items_of(run, iterable, clause.iterable.span):
        run.budget.step(clause.span)
        assign(run, clause.target, item, inner)
        if all(known_truth(run, condition(run, test, inner), test.span) for test in clause.conditions):
            _nest(run, clauses[1:], inner, inner, visit)
