"""Evaluating expressions: the Python subset and Scenic's operators, over known and random values.

No Python is ever executed: every construct is interpreted here, and what is not listed is refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from inspect import signature
from typing import TYPE_CHECKING, assert_never, cast

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import check_hashable, plain_unary
from scenicq.compiler.assignment import assign_around, go_through, through_others
from scenicq.compiler.attributes import attribute
from scenicq.compiler.comparisons import binary, compare, iterate, symbolic
from scenicq.compiler.coroutines import LibraryCall, LibraryName
from scenicq.compiler.courses import option_of
from scenicq.compiler.distributions import DISTRIBUTIONS, interval
from scenicq.compiler.environment import FIRST_NAMES, Environment
from scenicq.compiler.items import items_of, length_of, subscript
from scenicq.compiler.known_properties import as_constant, known_truth
from scenicq.compiler.logic import condition, connect, invert
from scenicq.compiler.operations import phrase
from scenicq.compiler.random_values import each_existing, is_choice, lift, nothing_to_choose
from scenicq.compiler.texts import checked_text, format_string
from scenicq.compiler.unread import read_value
from scenicq.compiler.values import (
    Builtin,
    Choice,
    Function,
    Instance,
    LabelObjects,
    ModelValue,
    Module,
    ScenicClass,
    describe,
    fail,
    is_node,
)
from scenicq.errors import Span
from scenicq.geometry.abstract_map import AbstractList, NeedsMapError
from scenicq.geometry.elements import NetworkElement
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["call", "evaluate"]


class _Arguments:
    """Evaluated arguments of a call, a star over a random choice of lists included."""

    def __init__(self) -> None:
        self.positional: list[ModelValue] = []
        self.named: dict[str, ModelValue] = {}
        self.choice: Choice | None = None
        self.drawn: AbstractList | None = None


def _arguments(run: Interpreter, items: tuple[ast.Argument, ...], scope: Environment) -> _Arguments:
    found = _Arguments()
    for item in items:
        value = evaluate(run, item.value, scope)
        if item.star == "*":
            if isinstance(value, AbstractList) and len(items) == 1:
                found.drawn = value
            elif isinstance(value, Choice) and len(items) == 1:
                found.choice = value
            else:
                found.positional += items_of(run, value, item.span)
        elif item.star == "**":
            if not isinstance(value, dict):
                raise fail("wrong-type", "`**` needs a dictionary", item.span, f"this is {describe(value)}")
            found.named.update(cast("dict[str, ModelValue]", value))
        elif item.name is not None:
            found.named[item.name] = value
        else:
            found.positional.append(value)
    return found


_ONE_BY_ONE = frozenset({"sum", "min", "max", "sorted"})
"""Functions that take each item on its own by the rules of the language, not of Python."""


def call(
    run: Interpreter, function: ModelValue, args: list[ModelValue], named: Mapping[str, ModelValue], span: Span
) -> ModelValue:
    """Call a function, with evaluated arguments."""
    run.budget.step(span)
    if isinstance(function, Function):
        return run.call_function(function, args, named, span)
    if isinstance(function, Builtin):
        items = sum(length_of(value) for value in (function.owner, *args, *named.values()))
        run.budget.step(span, items if function.name in _ONE_BY_ONE else items // run.budget.ITEMS_PER_STEP)
        run.budget.step(span, function.cost)
        if function.known:
            args = [as_constant(run, value) for value in args]

        def now(*values: ModelValue) -> ModelValue:
            given = dict(zip(named, values[len(args) :], strict=True))
            try:
                return function.call(span, *values[: len(args)], **given)
            except TypeError as error:
                raise fail("wrong-arity", f"`{function.name}` cannot take these arguments", span,
                           _told(error, function, span, values[: len(args)], given)) from None  # fmt: skip

        values = (*args, *named.values())
        return lift(now, *values, span=span, spread=function.spread) if function.lifted else now(*values)
    if isinstance(function, Choice):
        return each_existing(run, function, lambda option: call(run, option, args, named, span), span)
    if isinstance(function, Module) and function.call is not None:
        return call(run, function.call, args, named, span)
    if isinstance(function, LibraryName):
        return LibraryCall(function, tuple(args), dict(named), span)
    if isinstance(function, ScenicClass):
        spelled = f"new {function.name} at (1, 2)" if run.version == 3 else f"{function.name} at 1 @ 2"
        raise fail("wrong-type", f"`{function.name}` is a class of objects, not a function", span, "called here",
                   (f"give objects their properties by specifiers, as in `{spelled}`",))  # fmt: skip
    raise fail("wrong-type", f"{describe(function)} cannot be called", span, "not a function")


def _told(
    error: TypeError, function: Builtin, span: Span, args: tuple[ModelValue, ...], named: Mapping[str, ModelValue]
) -> str:
    """What is wrong with the arguments; where Python itself says it, it counts the place of the call as one."""
    try:
        signature(function.call).bind(span, *args, **named)
    except (TypeError, ValueError) as mismatch:
        return str(mismatch)
    return str(error).split(") ", 1)[-1].replace("() ", " ")


def _call(run: Interpreter, node: ast.Call, scope: Environment) -> ModelValue:
    function = evaluate(run, node.function, scope)
    arguments = _arguments(run, node.arguments, scope)
    if arguments.drawn is not None:
        if not isinstance(function, Builtin) or function.call is not DISTRIBUTIONS["Uniform"]:
            raise NeedsMapError
        return cast(ModelValue, arguments.drawn.draw(node.span))
    if arguments.choice is not None:
        return _call_each(run, function, arguments.choice, node.span)
    return call(run, function, arguments.positional, arguments.named, node.span)


def _call_each(run: Interpreter, function: ModelValue, choice: Choice, span: Span) -> ModelValue:
    """`f(*list)` of a random list: an empty list has no scene, as in Scenic, where it is rejected."""

    def now(items: ModelValue) -> ModelValue:
        given = iterate(items, span)
        if not given:
            raise nothing_to_choose(span)
        return call(run, function, given, {}, span)

    return each_existing(run, choice, now, span)


def _tuple(run: Interpreter, node: ast.Tuple, scope: Environment) -> ModelValue:
    items = _items(run, node.items, scope)
    if run.version == 1 and not scope.library and len(items) == 2 and node.span.text.startswith("("):
        return lift(lambda low, high: interval(low, high, node.span), *items)
    return lift(lambda *values: tuple(values), *items)


def _items(run: Interpreter, nodes: Iterable[ast.Expression], scope: Environment) -> list[ModelValue]:
    items: list[ModelValue] = []
    for node in nodes:
        value = evaluate(run, node.value if isinstance(node, ast.Starred) else node, scope)
        items += items_of(run, value, node.span) if isinstance(node, ast.Starred) else [value]
    return items


def _compare_chain(run: Interpreter, node: ast.ComparisonChain, scope: Environment) -> ModelValue:
    left = evaluate(run, node.left, scope)
    results: list[ModelValue] = []
    for comparison in node.comparisons:
        if results and results[-1] is False:
            return False
        right = evaluate(run, comparison.right, scope)
        if comparison.operator in ("in", "not in") and _holds_lists(right):
            right = option_of(run, right, comparison.right.span)
        run.budget.pay(length_of(left) + length_of(right), node.span)
        results.append(compare(comparison.operator, left, right, node.span))
        left = right
    if len(results) == 1:
        return results[0]
    return lift(lambda *values: _all(list(values), node.span), *results)


def _holds_lists(value: ModelValue) -> bool:
    return isinstance(value, Choice) and any(isinstance(each, list | tuple | dict | set) for each in value.options)


def _all(values: list[ModelValue], span: Span) -> ModelValue:
    return operators.combine("and", values, span) if any(map(symbolic, values)) else all(values)


def _unary(op: str, value: ModelValue, span: Span) -> ModelValue:
    def known(each: ModelValue) -> ModelValue:
        if op == "not":
            return invert(each, span)
        if is_node(each):
            return operators.negate(each, span) if op == "-" else each
        return plain_unary(op, each, span)

    return lift(known, value, span=span, spread=is_choice)


def evaluate(run: Interpreter, node: ast.Expression, scope: Environment) -> ModelValue:
    """The value of an expression.

    Args:
        run: The interpreter.
        node: The expression.
        scope: The names it sees.

    Raises:
        ScenarioError: Whatever is wrong with it.
    """
    run.budget.step(node.span)
    value = _evaluate(run, node, scope)
    if isinstance(node, _MAKERS):
        run.budget.pay(length_of(value), node.span)
    return value


_MAKERS = (ast.Call, ast.BinaryOp, ast.Subscript, ast.List, ast.Tuple, ast.Comprehension, ast.ComparisonChain)
"""Expressions that make a new value of some length, or go through one."""


def _evaluate(run: Interpreter, node: ast.Expression, scope: Environment) -> ModelValue:
    span = node.span
    match node:
        case ast.Name():
            if node.id == "ego":
                return run.ego(span)
            if node.id == "globalParameters" and scope.find(node.id) is None:
                return Module("globalParameters", {name: given[0] for name, given in run.params.items()})
            if node.id == "simulation" and run.simulation is not None and scope.find(node.id) is None:
                return run.simulation
            return read_value(run, scope.get(node.id, span))
        case ast.LiteralValue():
            if isinstance(node.value, complex | bytes | type(...)):
                raise fail("unsupported-construct", "a literal of this kind is not supported", span)
            return node.value if not isinstance(node.value, str) else checked_text(node.value, span)
        case ast.Attribute():
            return lift(lambda value: _attribute(run, value, node, scope), evaluate(run, node.value, scope))
        case ast.Call():
            return _call(run, node, scope)
        case ast.BinaryOp():
            left, right = evaluate(run, node.left, scope), evaluate(run, node.right, scope)
            return binary(node.operator, left, right, span)
        case ast.UnaryOp():
            return _unary(node.operator, evaluate(run, node.operand, scope), span)
        case ast.ComparisonChain():
            return _compare_chain(run, node, scope)
        case ast.BoolOp():
            return connect(run, node, scope)
        case ast.IfElse():
            chosen = node.then if known_truth(run, condition(run, node.test, scope), node.test.span) else node.otherwise
            return evaluate(run, chosen, scope)
        case ast.Tuple():
            return _tuple(run, node, scope)
        case ast.List():
            return _items(run, node.items, scope)
        case ast.Set():
            return {check_hashable(item, span) for item in _items(run, node.items, scope)}
        case ast.Dict():
            return _dictionary(run, node, scope)
        case ast.Subscript():
            value = evaluate(run, node.value, scope)
            if isinstance(node.index, ast.SubscriptSlice):
                parts = (node.index.lower, node.index.upper, node.index.step)
                ends = [None if part is None else evaluate(run, part, scope) for part in parts]
                return subscript(run, value, slice(*ends), span)
            return subscript(run, value, evaluate(run, node.index, scope), span)
        case ast.Lambda():
            return run.make_function("<lambda>", node.parameters, node.body, scope, span)
        case ast.Comprehension():
            # the first list is evaluated outside of the comprehension
            first = evaluate(run, node.clauses[0].iterable, scope)
            if isinstance(first, LabelObjects):
                return through_others(run, node, first, scope)
            items: list[ModelValue] = []
            go_through(run, node.clauses, scope, lambda inner: items.append(evaluate(run, node.element, inner)), first)
            return {check_hashable(item, span) for item in items} if node.kind == "set" else items
        case ast.DictComprehension():
            table: dict[ModelValue, ModelValue] = {}

            def put(inner: Environment) -> None:
                table[check_hashable(evaluate(run, node.key, inner), span)] = evaluate(run, node.value, inner)

            go_through(run, node.clauses, scope, put)
            return table
        case ast.FormattedString():
            return format_string(run, node, scope)
        case ast.Walrus():
            value = evaluate(run, node.value, scope)
            assign_around(run, node.target, value, scope)
            return value
        case ast.SubscriptSlice() | ast.Starred() | ast.UnsupportedExpression():
            raise fail("unsupported-construct", f"`{span.text.split()[0]}` is not supported here", span)
        case ast.New():
            return run.make_instance(node, scope)
        case ast.Phrase():
            return phrase(run, node, lambda part: evaluate(run, part, scope))
        case _:
            assert_never(node)


def _attribute(run: Interpreter, value: ModelValue, node: ast.Attribute, scope: Environment) -> ModelValue:
    if value is None and isinstance(node.value, ast.Attribute):
        owner, lacked = evaluate(run, node.value.value, scope), node.value.name
        if isinstance(owner, NetworkElement):
            hints = (f"`{lacked}` is None there: exclude such elements by a condition",)
            raise fail("map-lacks", f"the map says that {owner.name} has no `{lacked}`", node.value.name_span,
                       "not in this map", hints)  # fmt: skip
    name = FIRST_NAMES.get(node.name, node.name) if run.version == 1 and isinstance(value, Instance) else node.name
    found = attribute(run, value, name, node.name_span)
    if isinstance(found, Function) and isinstance(value, Instance) and name not in value.properties:
        method = found

        def call_method(span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
            return run.call_function(method, [value, *args], named, span)

        return Builtin(node.name, call_method, lifted=False)
    return found


def _dictionary(run: Interpreter, node: ast.Dict, scope: Environment) -> dict[ModelValue, ModelValue]:
    table: dict[ModelValue, ModelValue] = {}
    for item in node.items:
        value = evaluate(run, item.value, scope)
        if item.key is None:
            if not isinstance(value, dict):
                raise fail("wrong-type", "`**` needs a dictionary", item.value.span, f"this is {describe(value)}")
            table.update(cast("dict[ModelValue, ModelValue]", value))
        else:
            table[check_hashable(evaluate(run, item.key, scope), item.key.span)] = value
    return table
