"""Functions over lists that call back into the program: `filter`, `map`, `sorted`, `any`, `all`, `min`, `max`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cmp_to_key
from typing import TYPE_CHECKING, Any

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import is_random
from scenicq.compiler.builtins import extreme, language_names, truth
from scenicq.compiler.coerce import kind_of_model, to_scalar
from scenicq.compiler.comparisons import compare
from scenicq.compiler.expressions import call
from scenicq.compiler.items import components, is_vector, items_of
from scenicq.compiler.known_properties import as_constant, known_truth
from scenicq.compiler.other_objects import count_others, truth_of_list
from scenicq.compiler.random_values import each_existing, is_choice
from scenicq.compiler.rounding import sort_numbers
from scenicq.compiler.values import Builtin, Choice, Function, LabelObjects, ModelValue, OtherList, fail
from scenicq.errors import Span
from scenicq.forest.nodes import Constant

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["sequence_functions"]


def _plain(value: ModelValue) -> ModelValue:
    return value.value if isinstance(value, Constant) else value


def sequence_functions(run: Interpreter) -> dict[str, ModelValue]:
    """The functions, by name.

    Args:
        run: The interpreter that calls the program's own functions.
    """

    def apply(function: ModelValue, item: ModelValue, span: Span) -> ModelValue:
        run.budget.step(span)
        return item if function is None else call(run, function, [item], {}, span)

    def filtered(span: Span, function: ModelValue, items: ModelValue) -> ModelValue:
        if isinstance(items, Choice):
            return each_existing(run, items, lambda option: filtered(span, function, option), span)
        return [item for item in items_of(run, items, span) if known_truth(run, apply(function, item, span), span)]

    def mapped(span: Span, function: ModelValue, *lists: ModelValue) -> ModelValue:
        columns = [items_of(run, items, span) for items in lists]
        return [call(run, function, list(row), {}, span) for row in zip(*columns, strict=False)]

    def less(one: ModelValue, other: ModelValue, span: Span) -> bool:
        run.budget.step(span)
        return known_truth(run, compare("<", one, other, span), span)

    def ordered(span: Span, items: ModelValue, key: ModelValue = None, reverse: ModelValue = False) -> ModelValue:
        keyed = [(_plain(as_constant(run, apply(key, item, span))), item) for item in items_of(run, items, span)]
        random, backwards = any(is_random(value) for value, _ in keyed), truth(reverse, span)
        if random and key is None and all(kind_of_model(item) == "scalar" for _, item in keyed):
            run.budget.step(span, len(keyed) ** 2)
            numbers = sort_numbers([to_scalar(item, span) for _, item in keyed], span)
            return numbers[::-1] if backwards else numbers
        if random and run.course is None:
            raise fail("random-branch", "random values have no known order", span, "random here",
                       ("sort by a known value", "state conditions with `require`"))  # fmt: skip

        def before(a: tuple[ModelValue, ModelValue], b: tuple[ModelValue, ModelValue]) -> int:
            # all that sorting asks
            return -1 if less(a[0], b[0], span) else 0

        return [item for _, item in sorted(keyed, key=cmp_to_key(before), reverse=backwards)]

    def quantified(op: str) -> Callable[..., ModelValue]:
        def decide(span: Span, items: ModelValue) -> ModelValue:
            if isinstance(items, OtherList):
                return truth_of_list(op, items, span)
            values = items_of(run, items, span)
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
            values = items_of(run, items[0], span) if len(items) == 1 else list(items)
            if not values and default is not None:
                return default
            if key is None:
                return plain(span, *values)
            if not values:
                raise fail("runtime-error", f"`{name}` of an empty list", span)
            keys = [_plain(as_constant(run, apply(key, value, span))) for value in values]
            if run.course is None and any(map(is_random, keys)):
                raise fail("random-branch", "random values have no known order", span, "random here",
                           ("compare by a known value", "state conditions with `require`"))  # fmt: skip
            best = 0
            for number in range(1, len(values)):
                one, other = (number, best) if name == "min" else (best, number)
                best = number if less(keys[one], keys[other], span) else best
            return values[best]

        return find

    def unrolled(name: str) -> Callable[..., ModelValue]:
        """A function of lists that takes a vector for its coordinates."""
        plain: Builtin = language_names()[name]

        def apply_to(span: Span, *args: ModelValue) -> ModelValue:
            if name == "len" and len(args) == 1 and isinstance(args[0], OtherList | LabelObjects):
                return count_others(args[0], span)
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
    return {name: Builtin(name, each, spread=is_choice if name == "len" else None) for name, each in functions.items()}
