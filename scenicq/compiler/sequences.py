"""Functions over lists that call back into the program: `filter`, `map`, `sorted`, `any`, `all`, `min`, `max`."""

# Programs are dynamically typed: their values are `Any`, and so is what lambdas take.
# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownParameterType=false, reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Callable
from functools import cmp_to_key
from typing import Any

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import is_random, plain_binary
from scenicq.compiler.builtins import extreme, language_names, truth
from scenicq.compiler.choices import each_option
from scenicq.compiler.comparisons import iterate
from scenicq.compiler.environment import Runner
from scenicq.compiler.expressions import call
from scenicq.compiler.items import components, is_vector
from scenicq.compiler.known_properties import decided, settled
from scenicq.compiler.values import Builtin, Choice, Function, ModelValue, fail
from scenicq.errors import Span
from scenicq.forest.nodes import Constant

__all__ = ["sequence_functions"]


def _plain(value: ModelValue) -> ModelValue:
    return value.value if isinstance(value, Constant) else value


def sequence_functions(run: Runner) -> dict[str, ModelValue]:
    """The functions, by name.

    Args:
        run: The interpreter that calls the program's own functions.
    """

    def apply(function: ModelValue, item: ModelValue, span: Span) -> ModelValue:
        run.budget.step(span)
        return item if function is None else call(run, function, [item], {}, span)

    def filtered(span: Span, function: ModelValue, items: ModelValue) -> ModelValue:
        if isinstance(items, Choice):
            return each_option(run, items, lambda option: filtered(span, function, option), span)
        return [item for item in iterate(items, span) if decided(run, apply(function, item, span), span)]

    def mapped(span: Span, function: ModelValue, *lists: ModelValue) -> ModelValue:
        columns = [iterate(items, span) for items in lists]
        return [call(run, function, list(row), {}, span) for row in zip(*columns, strict=False)]

    def ordered(span: Span, items: ModelValue, key: ModelValue = None, reverse: ModelValue = False) -> ModelValue:
        keyed = [(_plain(settled(run, apply(key, item, span))), item) for item in iterate(items, span)]
        if any(is_random(value) for value, _ in keyed):
            raise fail("random-branch", "random values have no known order", span, "random here",
                       ("sort by something known",))  # fmt: skip

        def before(a: tuple[ModelValue, ModelValue], b: tuple[ModelValue, ModelValue]) -> int:
            run.budget.step(span)
            return plain_binary("<", b[0], a[0], span) - plain_binary("<", a[0], b[0], span)

        return [item for _, item in sorted(keyed, key=cmp_to_key(before), reverse=truth(reverse, span))]

    def quantified(op: str) -> Callable[..., ModelValue]:
        def decide(span: Span, items: ModelValue) -> ModelValue:
            values = iterate(items, span)
            run.budget.step(span, len(values) // 2)
            known = [truth(value, span) for value in values if not is_random(value)]
            random = [value for value in values if is_random(value)]
            if (op == "or") in known:
                return op == "or"
            return operators.combine(op, random, span) if random else op == "and"

        return decide

    def extremal(name: str) -> Callable[..., ModelValue]:
        plain = extreme(name)

        def find(span: Span, *items: ModelValue, key: ModelValue = None, default: ModelValue = None) -> ModelValue:
            values = iterate(items[0], span) if len(items) == 1 else list(items)
            if not values and default is not None:
                return default
            if key is None:
                return plain(span, *values)
            first = ordered(span, values, key, name == "max")
            if not first:
                raise fail("runtime-error", f"`{name}` of an empty list", span)
            return first[0]

        return find

    def unrolled(name: str) -> Callable[..., ModelValue]:
        """A function of lists that takes a vector for its coordinates."""
        plain: Builtin = language_names()[name]

        def apply_to(span: Span, *args: ModelValue) -> ModelValue:
            return plain.call(span, *(components(run, each, span) if is_vector(each) else each for each in args))

        return apply_to

    functions: dict[str, Callable[..., Any]] = {
        "len": unrolled("len"),
        "list": unrolled("list"),
        "tuple": unrolled("tuple"),
        "filter": filtered,
        "map": mapped,
        "sorted": ordered,
        "any": quantified("or"),
        "all": quantified("and"),
        "min": extremal("min"),
        "max": extremal("max"),
        "callable": lambda span, value: isinstance(value, Function | Builtin),
    }
    return {name: Builtin(name, function) for name, function in functions.items()}
