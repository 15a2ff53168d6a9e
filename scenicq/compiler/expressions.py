"""Evaluating expressions: the Python subset and Scenic's operators, over known and random values.

No Python is ever executed: every construct is interpreted here, and what is not listed is refused.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any, cast

from scenicq.compiler import operators
from scenicq.compiler.attributes import attribute, part_of
from scenicq.compiler.builtins import LARGEST, interval, truth
from scenicq.compiler.coerce import kind_of_model, to_vector
from scenicq.compiler.environment import Environment, Runner
from scenicq.compiler.values import (
    Builtin,
    Choice,
    Delayed,
    Function,
    Instance,
    ModelValue,
    ScenicClass,
    describe,
    fail,
    is_node,
    lift,
)
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import Constant
from scenicq.syntax import ast

__all__ = ["assign", "call", "evaluate", "iterate", "plain_binary"]

_PYTHON: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "//": operator.floordiv,
    "%": operator.mod,
    "**": operator.pow,
    "<<": operator.lshift,
    ">>": operator.rshift,
    "&": operator.and_,
    "|": operator.or_,
    "^": operator.xor,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def _is_random(value: ModelValue) -> bool:
    return (is_node(value) and not isinstance(value, Constant)) or isinstance(value, Choice)


def _symbolic(value: ModelValue) -> bool:
    return is_node(value) or isinstance(value, Choice | Instance)


def _check_size(op: str, left: Any, right: Any, span: Span) -> None:
    """Refuse what would make a number or a sequence too large to hold."""
    size = 0
    sequences = (str, list, tuple)
    if op == "*" and (isinstance(left, sequences) or isinstance(right, sequences)):
        sequence, times = (left, right) if isinstance(left, sequences) else (right, left)
        size = len(sequence) * times if isinstance(times, int) else 0
    elif op == "+" and isinstance(left, sequences) and isinstance(right, sequences):
        size = len(left) + len(right)
    elif op in ("**", "<<") and isinstance(left, int) and isinstance(right, int):
        size = left.bit_length() * right if op == "**" else left.bit_length() + right
    elif op == "*" and isinstance(left, int) and isinstance(right, int):
        size = left.bit_length() + right.bit_length()
    elif op == "%" and isinstance(left, str):
        raise fail("unsupported-construct", "`%` on a string is not supported", span, "formats a string",
                   ("write an f-string",))  # fmt: skip
    if size > LARGEST:
        raise fail("budget-exceeded", "the result of this is too large", span, f"more than {LARGEST:,} items or bits")


def plain_binary(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """A binary operator on known values."""
    _check_size(op, left, right, span)
    try:
        return _PYTHON[op](left, right)
    except (TypeError, ZeroDivisionError, OverflowError, ValueError) as error:
        if isinstance(error, TypeError):
            raise fail("wrong-type", f"`{op}` does not apply to {describe(left)} and {describe(right)}", span) from None
        raise fail("runtime-error", f"`{op}` failed: {error}", span) from None


def _binary(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    if _symbolic(left) or _symbolic(right):
        if isinstance(left, Choice) or isinstance(right, Choice):
            choice = left if isinstance(left, Choice) else right
            return operators.map_choice(
                choice, lambda v: _binary(op, *((v, right) if choice is left else (left, v)), span), span
            )
        return operators.binary(op, left, right, span)
    return plain_binary(op, left, right, span)


def _compare(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    if op in ("is", "is not"):
        same = left is right or (isinstance(left, bool | type(None)) and left == right)
        if isinstance(left, Choice) or isinstance(right, Choice):
            choice, other = (left, right) if isinstance(left, Choice) else (right, left)
            return operators.map_choice(choice, lambda v: (v is other) == (op == "is"), span)
        return same == (op == "is")
    if op in ("in", "not in"):
        return _membership(op, left, right, span)
    if is_node(left) or is_node(right):
        if op in ("==", "!=") and None in (left, right):
            return op == "!="
        return operators.compare(op, left, right, span)
    if isinstance(left, Choice) or isinstance(right, Choice):
        choice = left if isinstance(left, Choice) else right
        return operators.map_choice(
            choice, lambda v: _compare(op, *((v, right) if choice is left else (left, v)), span), span
        )
    if op in ("==", "!=") and (isinstance(left, Instance) or isinstance(right, Instance)):
        return (left is right) == (op == "==")
    return plain_binary(op, left, right, span)


def _membership(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    if kind_of_model(right) == "region":
        inside = operators.within(left, right, span)
        return operators.combine("not", [inside], span) if op == "not in" else inside
    if isinstance(right, str | list | tuple | dict | set | range):
        if is_node(left):
            matches = [operators.compare("==", left, item, span) for item in cast("list[ModelValue]", right)]
            found = operators.combine("or", matches, span)
            return operators.combine("not", [found], span) if op == "not in" else found
        return (left in cast("list[ModelValue]", right)) == (op == "in")
    raise fail("wrong-type", f"`{op}` needs a region or a list", span, f"this is {describe(right)}")


def iterate(value: ModelValue, span: Span) -> list[ModelValue]:
    """The items of a known sequence.

    Raises:
        ScenarioError: wrong-type or random-branch.
    """
    if isinstance(value, list | tuple | set | range | dict | str):
        return list(cast("list[ModelValue]", value))
    if _is_random(value):
        raise fail("random-branch", "a random list cannot be gone through", span, "random here",
                   ("use `Uniform(*list)` to pick one of its items",))  # fmt: skip
    raise fail("wrong-type", f"{describe(value)} cannot be gone through", span, "not a list")


class _Arguments:
    """Evaluated arguments of a call, a star over a random choice of lists included."""

    def __init__(self) -> None:
        self.positional: list[ModelValue] = []
        self.named: dict[str, ModelValue] = {}
        self.choice: Choice | None = None


def _arguments(run: Runner, items: tuple[ast.Argument, ...], scope: Environment) -> _Arguments:
    found = _Arguments()
    for item in items:
        value = evaluate(run, item.value, scope)
        if item.star == "*":
            if isinstance(value, Choice) and len(items) == 1:
                found.choice = value
            else:
                found.positional += iterate(value, item.span)
        elif item.star == "**":
            if not isinstance(value, dict):
                raise fail("wrong-type", "`**` needs a dictionary", item.span, f"this is {describe(value)}")
            found.named.update(cast("dict[str, ModelValue]", value))
        elif item.name is not None:
            found.named[item.name] = value
        else:
            found.positional.append(value)
    return found


def call(run: Runner, function: ModelValue, args: list[ModelValue], named: Mapping[str, ModelValue], span: Span) -> ModelValue:
    """Call a function or make an instance of a class, with evaluated arguments."""
    run.budget.step(span)
    if isinstance(function, Function):
        return run.call_function(function, args, named, span)
    if isinstance(function, Builtin):

        def now(*values: ModelValue) -> ModelValue:
            given = dict(zip(named, values[len(args) :], strict=True))
            try:
                return function.call(span, *values[: len(args)], **given)
            except TypeError as error:
                raise fail("wrong-arity", f"`{function.name}` cannot take these arguments", span,
                           str(error).split(") ", 1)[-1].replace("() ", " ")) from None  # fmt: skip

        return lift(now, *args, *named.values()) if function.lifted else now(*args, *named.values())
    if isinstance(function, Choice):
        return operators.map_choice(function, lambda option: call(run, option, args, named, span), span)
    if isinstance(function, ScenicClass):
        raise fail("wrong-type", f"`{function.name}` is a class of objects, not a function", span, "called here",
                   (f"write `new {function.name}` with specifiers",))  # fmt: skip
    raise fail("wrong-type", f"{describe(function)} cannot be called", span, "not a function")


def _call(run: Runner, node: ast.Call, scope: Environment) -> ModelValue:
    function = evaluate(run, node.function, scope)
    arguments = _arguments(run, node.arguments, scope)
    if arguments.choice is not None:
        choice = arguments.choice
        options = [call(run, function, iterate(option, node.span), {}, node.span) for option in choice.options]
        return operators.make_choice(choice.index, options, node.span)
    return call(run, function, arguments.positional, arguments.named, node.span)


def _subscript(value: ModelValue, index: ModelValue, span: Span) -> ModelValue:
    if isinstance(value, Choice):
        return operators.map_choice(value, lambda option: _subscript(option, index, span), span)
    if _is_random(index) and isinstance(value, list | tuple):
        raise fail("unsupported-construct", "a random index is not supported", span, "random here",
                   ("use `Uniform(*list)` to pick one of the items",))  # fmt: skip
    if kind_of_model(value) == "vector" and index in (0, 1):
        return build.coordinate(to_vector(value, span), int(index), span)
    if isinstance(value, list | tuple | dict | str | range):
        try:
            return cast(Any, value)[index]
        except (IndexError, KeyError, TypeError):
            raise fail("runtime-error", "there is no item with this index", span, "not found") from None
    raise fail("wrong-type", f"{describe(value)} has no items", span, "indexed here")


def _comprehension(run: Runner, clauses: tuple[ast.Clause, ...], scope: Environment, visit: Callable[[Environment], None]) -> None:
    if not clauses:
        visit(scope)
        return
    clause = clauses[0]
    for item in iterate(evaluate(run, clause.iterable, scope), clause.iterable.span):
        run.budget.step(clause.span)
        inner = Environment({}, scope)
        assign(run, clause.target, item, inner)
        if all(truth(evaluate(run, test, inner), test.span) for test in clause.conditions):
            _comprehension(run, clauses[1:], inner, visit)


def assign(run: Runner, target: ast.Expression, value: ModelValue, scope: Environment) -> None:
    """Give a name, an item or several names a value."""
    match target:
        case ast.Name():
            run.name_value(target.id, value, scope, target.span)
        case ast.Tuple() | ast.List():
            items = iterate(value, target.span)
            if len(items) != len(target.items) or any(isinstance(item, ast.Starred) for item in target.items):
                raise fail("wrong-value", f"{len(items)} values for {len(target.items)} names", target.span)
            for part, item in zip(target.items, items, strict=True):
                assign(run, part, item, scope)
        case ast.Subscript():
            holder = evaluate(run, target.value, scope)
            if not isinstance(holder, list | dict):
                raise fail("wrong-type", f"an item of {describe(holder)} cannot be set", target.span)
            try:
                cast(Any, holder)[evaluate(run, target.index, scope)] = value
            except (IndexError, TypeError):
                raise fail("runtime-error", "there is no item with this index", target.span) from None
        case _:
            raise fail("unsupported-construct", "this cannot be assigned to", target.span, "not a name",
                       ("give objects their properties with `with`",))  # fmt: skip


def _tuple(run: Runner, node: ast.Tuple, scope: Environment) -> ModelValue:
    items = _items(run, node.items, scope)
    if run.version == 1 and len(items) == 2 and node.span.text.startswith("("):
        return lift(lambda low, high: interval(low, high, node.span), *items)
    return lift(lambda *values: tuple(values), *items)


def _items(run: Runner, nodes: Iterable[ast.Expression], scope: Environment) -> list[ModelValue]:
    items: list[ModelValue] = []
    for node in nodes:
        value = evaluate(run, node.value if isinstance(node, ast.Starred) else node, scope)
        items += iterate(value, node.span) if isinstance(node, ast.Starred) else [value]
    return items


def _formatted(run: Runner, node: ast.FormattedString, scope: Environment) -> str:
    text: list[str] = []
    for part in node.parts:
        if isinstance(part, ast.Constant):
            text.append(str(part.value))
            continue
        value = evaluate(run, part.value, scope)
        if not isinstance(value, str | int | float | bool) or part.format is not None:
            raise fail("unsupported-construct", "only plain numbers and strings can be put in a string", part.span)
        text.append(str(value))
    return "".join(text)


def _compare_chain(run: Runner, node: ast.Compare, scope: Environment) -> ModelValue:
    left = evaluate(run, node.left, scope)
    results: list[ModelValue] = []
    for comparison in node.comparisons:
        right = evaluate(run, comparison.right, scope)
        results.append(lift(lambda a, b, op=comparison.operator: _compare(op, a, b, node.span), left, right))
        left = right
    if len(results) == 1:
        return results[0]
    return lift(lambda *values: _all(list(values), node.span), *results)


def _all(values: list[ModelValue], span: Span) -> ModelValue:
    return operators.combine("and", values, span) if any(map(_symbolic, values)) else all(values)


def _boolean(run: Runner, node: ast.BoolOp, scope: Environment) -> ModelValue:
    decisive = node.operator == "or"
    pending: list[ModelValue] = []
    value: ModelValue = None
    for part in node.values:
        value = evaluate(run, part, scope)
        if isinstance(value, Delayed):
            raise fail("wrong-type", "this needs the object's position, which is not known here", part.span)
        if _is_random(value):
            pending.append(value)
        elif bool(value.value if isinstance(value, Constant) else value) == decisive:
            return value
    return operators.combine(node.operator, pending, node.span) if pending else value


def _unary(op: str, value: ModelValue, span: Span) -> ModelValue:
    if isinstance(value, Choice):
        return operators.map_choice(value, lambda option: _unary(op, option, span), span)
    if op == "not":
        return operators.combine("not", [value], span) if _is_random(value) else not truth(value, span)
    if is_node(value):
        return operators.negate(value, span) if op == "-" else value
    try:
        return {"-": operator.neg, "+": operator.pos, "~": operator.invert}[op](value)
    except TypeError:
        raise fail("wrong-type", f"`{op}` does not apply to {describe(value)}", span) from None


def evaluate(run: Runner, node: ast.Expression, scope: Environment) -> ModelValue:  # noqa: PLR0911, PLR0912
    """The value of an expression.

    Args:
        run: The interpreter.
        node: The expression.
        scope: The names it sees.

    Raises:
        ScenarioError: Whatever is wrong with it.
    """
    run.budget.step(node.span)
    span = node.span
    match node:
        case ast.Name():
            return run.ego(span) if node.id == "ego" else scope.get(node.id, span)
        case ast.Constant():
            if isinstance(node.value, complex | bytes | type(...)):
                raise fail("unsupported-construct", "a literal of this kind is not supported", span)
            return node.value
        case ast.Attribute():
            return lift(lambda value: attribute(value, node.name, node.name_span), evaluate(run, node.value, scope))
        case ast.Call():
            return _call(run, node, scope)
        case ast.BinaryOp():
            left, right = evaluate(run, node.left, scope), evaluate(run, node.right, scope)
            return lift(lambda a, b: _binary(node.operator, a, b, span), left, right)
        case ast.UnaryOp():
            return lift(lambda value: _unary(node.operator, value, span), evaluate(run, node.operand, scope))
        case ast.Compare():
            return _compare_chain(run, node, scope)
        case ast.BoolOp():
            return _boolean(run, node, scope)
        case ast.IfElse():
            chosen = node.then if truth(evaluate(run, node.test, scope), node.test.span) else node.otherwise
            return evaluate(run, chosen, scope)
        case ast.Tuple():
            return _tuple(run, node, scope)
        case ast.List():
            return _items(run, node.items, scope)
        case ast.Set():
            return _hashed(lambda: set(_items(run, node.items, scope)), span)
        case ast.Dict():
            return _hashed(lambda: _dictionary(run, node, scope), span)
        case ast.Subscript():
            value = evaluate(run, node.value, scope)
            if isinstance(node.index, ast.Slice):
                parts = (node.index.lower, node.index.upper, node.index.step)
                ends = [None if part is None else evaluate(run, part, scope) for part in parts]
                return _subscript(value, slice(*ends), span)
            return _subscript(value, evaluate(run, node.index, scope), span)
        case ast.Lambda():
            return run.make_function("<lambda>", node.parameters, node.body, scope, span)
        case ast.Comprehension():
            items: list[ModelValue] = []
            _comprehension(run, node.clauses, scope, lambda inner: items.append(evaluate(run, node.element, inner)))
            return _hashed(lambda: set(items), span) if node.kind == "set" else items
        case ast.DictComprehension():
            table: dict[ModelValue, ModelValue] = {}

            def put(inner: Environment) -> None:
                table[evaluate(run, node.key, inner)] = evaluate(run, node.value, inner)

            return _hashed(lambda: _comprehension(run, node.clauses, scope, put) or table, span)
        case ast.FormattedString():
            return _formatted(run, node, scope)
        case ast.Walrus():
            value = evaluate(run, node.value, scope)
            assign(run, node.target, value, scope)
            return value
        case ast.Slice() | ast.Starred() | ast.UnsupportedExpression():
            raise fail("unsupported-construct", f"`{span.text.split()[0]}` is not supported here", span)
        case _:
            return _scenic(run, node, scope)


def _hashed(make: Callable[[], ModelValue], span: Span) -> ModelValue:
    try:
        return make()
    except TypeError:
        raise fail("wrong-type", "a list or dictionary cannot be a member or key here", span) from None


def _dictionary(run: Runner, node: ast.Dict, scope: Environment) -> dict[ModelValue, ModelValue]:
    table: dict[ModelValue, ModelValue] = {}
    for item in node.items:
        value = evaluate(run, item.value, scope)
        if item.key is None:
            table.update(cast("dict[ModelValue, ModelValue]", value))
        else:
            table[evaluate(run, item.key, scope)] = value
    return table


def _scenic(run: Runner, node: ast.Expression, scope: Environment) -> ModelValue:  # noqa: PLR0911, PLR0912
    span = node.span

    def value(part: ast.Expression) -> ModelValue:
        return evaluate(run, part, scope)

    def origin(part: ast.Expression | None) -> ModelValue:
        return run.ego(span) if part is None else value(part)

    match node:
        case ast.New():
            return run.make_instance(node, scope)
        case ast.Deg():
            return lift(lambda v: operators.degrees(v, span), value(node.value))
        case ast.Vector():
            return lift(lambda x, y: to_vector((x, y), span), value(node.x), value(node.y))
        case ast.FieldAt():
            return lift(lambda f, p: operators.direction_at(f, p, span), value(node.field), value(node.position))
        case ast.RelativeTo():
            return lift(lambda a, b: operators.relative_to(a, b, span), value(node.left), value(node.right))
        case ast.OffsetBy():
            return lift(lambda o, by: operators.offset(o, by, span), value(node.origin), value(node.offset))
        case ast.OffsetAlong():
            parts = value(node.origin), value(node.direction), value(node.offset)
            return lift(lambda o, d, by: operators.along(o, d, by, span), *parts)
        case ast.RelativePosition():
            return lift(
                lambda t, o: build.vector_difference(to_vector(t, span), to_vector(o, span), span),
                value(node.target),
                origin(node.origin),
            )
        case ast.RelativeHeading():
            return lift(lambda t, o: operators.relative_heading(t, o, span), value(node.target), origin(node.origin))
        case ast.ApparentHeading():
            return lift(lambda t, o: operators.apparent_heading(t, o, span), value(node.target), origin(node.origin))
        case ast.Distance():
            return lift(lambda t, o: operators.distance_to(t, o, span), value(node.target), origin(node.origin))
        case ast.Angle():
            return lift(lambda t, o: operators.angle_to(t, o, span), value(node.target), origin(node.origin))
        case ast.CanSee():
            return lift(lambda v, t: operators.can_see(v, t, span), value(node.viewer), value(node.target))
        case ast.Intersects():
            return lift(lambda a, b: operators.intersects(a, b, span), value(node.left), value(node.right))
        case ast.Follow():
            return operators.follow(value(node.field), origin(node.origin), value(node.distance), span)
        case ast.Visible() | ast.VisibleFrom():
            viewer = run.ego(span) if isinstance(node, ast.Visible) else value(node.viewer)
            seen = operators.visible_region(viewer, span)
            combine = operators.region_difference if node.negated else operators.region_intersection
            return combine(value(node.region), seen, span)
        case ast.PartOf():
            return part_of(node.part, value(node.target), span)
        case ast.Implies():
            left, right = value(node.left), value(node.right)
            return lift(
                lambda a, b: operators.combine("or", [operators.combine("not", [a], span), b], span), left, right
            )
        case _:
            raise fail("unsupported-construct", f"`{span.text}` is not supported", span, "does not describe one instant",
                       ("a scene is matched at one instant, in 2D",))  # fmt: skip
