"""Python's operators on known values, within bounds: nothing here can take unbounded time or memory.

Shared lists make values whose expanded size is exponential in the program's length; whatever walks a value (comparing,
hashing, searching) is weighed first.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from typing import Any, cast

from scenicq.compiler.values import Choice, ModelValue, describe, fail, is_node
from scenicq.errors import ScenarioError, Span
from scenicq.forest.nodes import Constant
from scenicq.limits import LIMITS

__all__ = ["check_hashable", "check_weight", "is_flat", "is_random", "number_error", "plain_binary", "plain_unary"]


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
_UNARY: dict[str, Callable[[Any], Any]] = {"-": operator.neg, "+": operator.pos, "~": operator.invert}
_COMPARISONS = frozenset({"==", "!=", "<", "<=", ">", ">="})
_CONTAINERS = (list, tuple, dict, set)


def is_random(value: ModelValue) -> bool:
    """Whether a value is only known once a scene is drawn."""
    return isinstance(value, Choice) or (is_node(value) and not isinstance(value, Constant))


_ATOMS = frozenset({int, float, str, bool, type(None)})


def is_flat(value: ModelValue) -> bool:
    """Whether a list, tuple or set holds known numbers and strings only."""
    return not isinstance(value, dict) and set(map(type, cast("list[ModelValue]", value))) <= _ATOMS


def _weigh(values: Iterable[ModelValue], span: Span, *, compared: bool) -> int:
    """How many values there are with all they hold, counted as often as they are reached; one too many at most."""
    total = 0
    stack: list[tuple[ModelValue, int]] = [(value, 0) for value in values]
    while stack and total <= LIMITS.value_items:
        value, depth = stack.pop()
        if compared and depth and is_random(value):
            raise fail("random-branch", "a list that holds random values cannot be compared", span, "random inside",
                       ("compare the items themselves",))  # fmt: skip
        total += 1 + (len(value) // 64 if isinstance(value, str) else 0)
        if isinstance(value, _CONTAINERS):
            if depth >= LIMITS.value_nesting or len(cast("list[ModelValue]", value)) > LIMITS.value_items:
                return LIMITS.value_items + 1
            held = cast("Iterable[ModelValue]", value)
            stack += [(item, depth + 1) for item in held]
            if isinstance(value, dict):
                stack += [(item, depth + 1) for item in cast("dict[ModelValue, ModelValue]", value).values()]
    return total


def check_weight(span: Span, *values: ModelValue, compared: bool = False) -> None:
    """Refuse to walk values that are too large once expanded.

    Args:
        span: Where they are walked.
        values: The values.
        compared: Whether the result depends on what the values hold, so that this must be known.

    Raises:
        ScenarioError: budget-exceeded, random-branch.
    """
    held = [value for value in values if isinstance(value, _CONTAINERS) and not is_flat(value)]
    if held and _weigh(held, span, compared=compared) > LIMITS.value_items:
        raise fail("budget-exceeded", "this value is too large to go through", span, "nested or long beyond bounds",
                   (f"keep lists below {LIMITS.value_items:,} items and {LIMITS.value_nesting} levels",))  # fmt: skip


def number_error(error: ArithmeticError, span: Span | None, label: str) -> ScenarioError:
    """A runtime-error where arithmetic on known numbers has no result, or one that no float holds."""
    return fail("runtime-error", f"a number is too large, or not one: {error}", span, label)


def _check_size(op: str, left: Any, right: Any, span: Span) -> None:
    """Refuse what would make a number or a sequence too large to hold."""
    size, most = 0, LIMITS.value_items
    sequences = (str, list, tuple)
    if op == "*" and (isinstance(left, sequences) or isinstance(right, sequences)):
        sequence, times = (left, right) if isinstance(left, sequences) else (right, left)
        size = len(cast("list[Any]", sequence)) * times if isinstance(times, int) else 0
    elif op == "+" and isinstance(left, sequences) and isinstance(right, sequences):
        size = len(cast("list[Any]", left)) + len(cast("list[Any]", right))
    elif op in ("**", "<<") and isinstance(left, int) and isinstance(right, int):
        bits = left.bit_length()
        most = LIMITS.integer_bits
        size = bits * right if op == "**" and bits > 1 else bits + right if op == "<<" else 0
    elif op == "*" and isinstance(left, int) and isinstance(right, int):
        size, most = left.bit_length() + right.bit_length(), LIMITS.integer_bits
    elif op == "%" and isinstance(left, str):
        raise fail("unsupported-construct", "`%` on a string is not supported", span, "formats a string",
                   ("write an f-string",))  # fmt: skip
    if size > most:
        raise fail("budget-exceeded", "the result of this is too large", span, f"more than {most:,} items or bits")


def plain_binary(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """A binary operator or comparison on known values.

    Raises:
        ScenarioError: wrong-type, runtime-error, or budget-exceeded for results that are too large.
    """
    _check_size(op, left, right, span)
    if op in _COMPARISONS:
        check_weight(span, left, right, compared=True)
    try:
        result = _PYTHON[op](left, right)
    except (TypeError, ZeroDivisionError, OverflowError, ValueError) as error:
        if isinstance(error, TypeError):
            raise fail("wrong-type", f"`{op}` does not apply to {describe(left)} and {describe(right)}", span) from None
        raise fail("runtime-error", f"`{op}` failed: {error}", span) from None
    if isinstance(result, complex):
        raise fail("runtime-error", f"`{op}` has no real value here", span)
    return result


def plain_unary(op: str, value: ModelValue, span: Span) -> ModelValue:
    """`-x`, `+x` or `~x` of a known value.

    Raises:
        ScenarioError: wrong-type.
    """
    try:
        return _UNARY[op](value)
    except TypeError:
        raise fail("wrong-type", f"`{op}` does not apply to {describe(value)}", span) from None


def check_hashable(value: ModelValue, span: Span) -> ModelValue:
    """A value that is to be a key or the member of a set.

    Raises:
        ScenarioError: wrong-type for lists, dictionaries and sets, budget-exceeded.
    """
    check_weight(span, value)
    try:
        hash(value)
    except TypeError:
        raise fail("wrong-type", "a list or dictionary cannot be a member or key here", span,
                   f"this is {describe(value)}", ("use a tuple",)) from None  # fmt: skip
    return value
