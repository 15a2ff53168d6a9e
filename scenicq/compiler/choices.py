"""Random choices between values that are not expressions: objects, road elements, lists.

An operator whose meaning depends on what it is applied to (an object has a box, a point has none) is applied to every
option, and the results become one random choice again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

from scenicq.compiler.coerce import kind_of_model, to_node
from scenicq.compiler.values import Choice, Instance, ModelValue, fail, is_node
from scenicq.errors import Span
from scenicq.forest.nodes import Identity, Index, Select

__all__ = ["distribute", "holds_instances", "is_choice", "make_choice", "map_choice"]

_MOST_OPTIONS = 20_000
"""Options of a choice, those of nested choices included."""


def make_choice(index: Index, options: list[ModelValue], span: Span | None) -> ModelValue:
    """A random choice, as an expression where all options are numbers, vectors or regions of one kind.

    Raises:
        ScenarioError: budget-exceeded, for choices nested beyond all bounds.
    """
    if all(option is options[0] for option in options) and not isinstance(options[0], Choice):
        return options[0]
    size = sum(option.size if isinstance(option, Choice) else 1 for option in options)
    if size > _MOST_OPTIONS:
        raise fail("budget-exceeded", f"a random choice has more than {_MOST_OPTIONS:,} outcomes", span, "chosen here")
    kinds = {kind_of_model(option) for option in options}
    plain = all(not isinstance(option, Instance) and kind_of_model(option) is not None for option in options)
    elements = any(kind_of_model(option) == "region" and not is_node(option) for option in options)
    if plain and len(kinds) == 1 and not elements:
        return Select(index, tuple(to_node(option, span) for option in options), span=span)
    return Choice(index, tuple(options), size)


def map_choice(value: ModelValue, function: Callable[[ModelValue], ModelValue], span: Span | None) -> ModelValue:
    """Apply a function to each option of a random choice, or to a value that is none."""
    if not isinstance(value, Choice):
        return function(value)
    return make_choice(value.index, [function(option) for option in value.options], span)


def is_choice(value: ModelValue) -> bool:
    """Whether a value is a random choice between values that are not expressions."""
    return isinstance(value, Choice)


def holds_instances(value: ModelValue) -> bool:
    """Whether a value is a random choice that may come out as a point or an object."""
    if not isinstance(value, Choice):
        return False
    return any(isinstance(option, Instance) or holds_instances(option) for option in value.options)


def distribute(
    function: Callable[..., ModelValue],
    values: tuple[ModelValue, ...],
    span: Span,
    picked: Mapping[Identity, int] | None = None,
    *,
    spread: Callable[[ModelValue], bool] = holds_instances,
) -> ModelValue:
    """Apply a function to every outcome of the random choices among its arguments.

    One choice that occurs in several arguments comes out the same in all of them.

    Args:
        function: Takes the values, with no such choice among them.
        values: The arguments.
        span: The construct.
        picked: Options that are already settled.
        spread: Which arguments to take apart; choices of objects if not given.
    """
    picked = picked or {}
    for number, value in enumerate(values):
        if not spread(value):
            continue
        choice = cast(Choice, value)
        identity = choice.index.identity

        def given(option: int, number: int = number, choice: Choice = choice) -> tuple[ModelValue, ...]:
            return (*values[:number], choice.options[option], *values[number + 1 :])

        if identity in picked:
            return distribute(function, given(picked[identity]), span, picked, spread=spread)
        results = [
            distribute(function, given(option), span, {**picked, identity: option}, spread=spread)
            for option in range(len(choice.options))
        ]
        return make_choice(choice.index, results, span)
    return function(*values)
