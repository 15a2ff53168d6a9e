"""Values that come later, or out in several ways: random choices between objects, road elements, lists.

An operator whose meaning depends on what it is applied to (an object has a box, a point has none) is applied to every
option, and the results become one random choice again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, cast

from scenicq.compiler.coerce import kind_of_model, to_heading, to_node, to_vector
from scenicq.compiler.roots import oriented_point
from scenicq.compiler.values import Choice, DelayedValue, Instance, ModelValue, fail, is_node
from scenicq.errors import ScenarioError, Span
from scenicq.forest.nodes import Constant, Identity, Node, Select, Undefined
from scenicq.limits import LIMITS

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = [
    "LACKING",
    "NothingLeftError",
    "each_existing",
    "holds_instances",
    "is_choice",
    "lift",
    "make_choice",
    "nothing_to_choose",
    "possible_values",
    "regions_apart",
    "to_common_type",
]

LACKING = frozenset({"map-lacks", "runtime-error"})
"""Errors that only say that something is not there: a part of the map, an item of a list."""


class NothingLeftError(ScenarioError):
    """No outcome of a random choice has what the program asks for."""


def nothing_to_choose(span: Span) -> NothingLeftError:
    """What is said of a choice from an empty list."""
    hint = "if the list comes from the map, the map has no such element"
    error = fail("map-lacks", "there is nothing to choose from", span, "an empty list", (hint,))
    return NothingLeftError(error.diagnostics)


def make_choice(index: Node, options: list[ModelValue], span: Span | None) -> ModelValue:
    """A random choice, as an expression where all options are numbers, vectors or regions of one kind.

    Raises:
        ScenarioError: budget-exceeded, for choices nested beyond all bounds.
    """
    if all(option is options[0] for option in options) and not isinstance(options[0], Choice):
        return options[0]
    size = sum(option.size if isinstance(option, Choice) else 1 for option in options)
    if size > LIMITS.choice_options:
        raise fail(
            "budget-exceeded", f"a random choice has more than {LIMITS.choice_options:,} outcomes", span, "chosen here"
        )
    kinds = {kind_of_model(option) for option in options}
    plain = all(not isinstance(option, Instance) and kind_of_model(option) is not None for option in options)
    elements = any(kind_of_model(option) == "region" and not is_node(option) for option in options)
    if plain and len(kinds) == 1 and not elements:
        return Select(index, tuple(to_node(option, span) for option in options), span=span)
    return Choice(index, tuple(options), size)


def each_existing(
    run: Interpreter, choice: Choice, function: Callable[[ModelValue], ModelValue], span: Span
) -> ModelValue:
    """Apply a function to each option for which it has a result; the others have no scene, as in Scenic.

    Raises:
        ScenarioError: What the function says of the first option, if it has no result for any.
    """
    found: dict[int, ModelValue] = {}
    missing: ScenarioError | None = None
    for number, option in enumerate(choice.options):
        try:
            with run.excluded.assuming(choice.index, number, len(choice.options)):
                nested = isinstance(option, Choice)
                found[number] = each_existing(run, option, function, span) if nested else function(option)
        except ScenarioError as error:
            if option is not None and error.diagnostics[0].code not in LACKING:
                raise
            missing = missing or error
            if option is not None:
                run.excluded.note_lacking(choice.index)
    if not found:
        assert missing is not None
        raise NothingLeftError(missing.diagnostics)
    count = len(choice.options)
    run.excluded.add(choice.index, [number for number in range(count) if number not in found], count, span)
    spare = next(iter(found.values()))
    return make_choice(choice.index, [found.get(number, spare) for number in range(count)], span)


def regions_apart(value: ModelValue) -> ModelValue:
    """A random choice of regions as one of values that are taken by themselves; anything else as it is.

    What is no region, because there is no such element, becomes None.
    """
    if not (isinstance(value, Select) and kind_of_model(value) == "region"):
        return value
    options = tuple(
        None if isinstance(option, Constant) and isinstance(option.value, Undefined) else option
        for option in value.options
    )
    return Choice(value.index, options, len(options))


def is_choice(value: ModelValue) -> bool:
    """Whether a value is a random choice between values that are not expressions."""
    return isinstance(value, Choice)


def possible_values(value: ModelValue) -> Iterator[ModelValue]:
    """What a value may come out as: the options of a random choice, nested ones in their places, or it alone."""
    stack = [value]
    while stack:
        each = stack.pop()
        if isinstance(each, Choice):
            stack += reversed(each.options)
        else:
            yield each


def holds_instances(value: ModelValue) -> bool:
    """Whether a value is a random choice that may come out as a point or an object."""
    return isinstance(value, Choice) and any(isinstance(each, Instance) for each in possible_values(value))


def to_common_type(value: ModelValue, span: Span | None) -> ModelValue:
    """A random choice as one between what all its outcomes are: objects, oriented points, or places.

    Scenic decides what is next to something before it is drawn, by the type that all outcomes have in common: of an
    object among oriented points the box does not count, of an oriented point among places the heading does not.

    Raises:
        ScenarioError: wrong-type, for what is no place.
    """
    outcomes = list(possible_values(value))
    instances = [each for each in outcomes if isinstance(each, Instance)]
    if not instances:
        return value
    if len(instances) < len(outcomes) or not all(each.oriented for each in instances):
        return to_vector(value, span)
    if all(each.index is not None for each in instances):
        return value

    def as_point(each: ModelValue) -> ModelValue:
        known = {"position": to_vector(each, span), "heading": to_heading(each, span)}
        return oriented_point(known) if cast(Instance, each).index is not None else each

    return lift(as_point, value, span=span, spread=is_choice)


def lift(
    function: Callable[..., ModelValue], *values: ModelValue, span: Span | None = None,
    spread: Callable[[ModelValue], bool] | None = None,
) -> ModelValue:  # fmt: skip
    """Apply a function to values of which some are known later, or come out in several ways.

    Where one waits for the properties of the object that is being made, the result does, too. The function is applied
    to every outcome of the random choices among the values; one that occurs in several comes out the same in all.

    Args:
        function: Takes the values, with nothing that waits and no such choice among them.
        values: The values.
        span: The construct.
        spread: Which values to take apart; none if not given.
    """
    if any(isinstance(value, DelayedValue) for value in values):
        needs = frozenset[str]().union(*(value.needs for value in values if isinstance(value, DelayedValue)))

        def later(instance: Instance) -> ModelValue:
            known = (value.evaluate(instance) if isinstance(value, DelayedValue) else value for value in values)
            return lift(function, *known, span=span, spread=spread)

        return DelayedValue(needs, later)
    choices = [value for value in values if isinstance(value, Choice) and spread and spread(value)]
    if not choices:
        return function(*values)
    outcomes = math.prod({choice.key: len(choice.options) for choice in choices}.values())
    if outcomes > LIMITS.choice_options:
        what = f"this has more than {LIMITS.choice_options:,} outcomes"
        raise fail("budget-exceeded", what, span, "of random choices",
                   ("choose between fewer", "compare numbers that are made from the choices"))  # fmt: skip
    return _each_outcome(function, values, span, {}, spread or is_choice)


def _each_outcome(
    function: Callable[..., ModelValue],
    values: tuple[ModelValue, ...],
    span: Span | None,
    picked: Mapping[Identity | int, int],
    spread: Callable[[ModelValue], bool],
) -> ModelValue:
    """The function of values of which some choices are picked already, by key."""
    for number, value in enumerate(values):
        if not spread(value):
            continue
        choice = cast(Choice, value)

        def given(option: int, number: int = number, choice: Choice = choice) -> tuple[ModelValue, ...]:
            return (*values[:number], choice.options[option], *values[number + 1 :])

        if choice.key in picked:
            return _each_outcome(function, given(picked[choice.key]), span, picked, spread)
        results = [
            _each_outcome(function, given(option), span, {**picked, choice.key: option}, spread)
            for option in range(len(choice.options))
        ]
        return make_choice(choice.index, results, span)
    return function(*values)
