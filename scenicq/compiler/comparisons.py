"""Arithmetic and comparisons of any two values, known, random or chosen at random; and going through lists."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import cast

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import check_hashable, check_weight, is_flat, is_random, plain_binary
from scenicq.compiler.coerce import kind_of_model
from scenicq.compiler.other_objects import is_element, is_nearest, same_object
from scenicq.compiler.random_values import holds_instances, is_choice, lift, possible_values
from scenicq.compiler.values import (
    Choice,
    Instance,
    LabelObjects,
    ModelValue,
    Nearest,
    OtherList,
    describe,
    fail,
    is_node,
)
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import CompareOp, Constant, Node, Select
from scenicq.geometry.abstract_map import AbstractElement, AbstractList, NeedsMapError
from scenicq.geometry.elements import Maneuver, NetworkElement
from scenicq.syntax.hints import condition_hint

__all__ = ["binary", "compare", "iterate", "symbolic"]


def symbolic(value: ModelValue) -> bool:
    """Whether an operator on a value makes an expression."""
    return is_node(value) or isinstance(value, Choice | Instance)


def binary(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """Arithmetic on any two values.

    Raises:
        ScenarioError: wrong-type and its like.
    """

    def known(a: ModelValue, b: ModelValue) -> ModelValue:
        if symbolic(a) or symbolic(b):
            return operators.binary(op, a, b, span)
        return plain_binary(op, a, b, span)

    return lift(known, left, right, span=span, spread=is_choice)


def compare(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """A comparison of any two values.

    Raises:
        ScenarioError: wrong-type and its like.
    """
    return lift(lambda a, b: _compare(op, a, b, span), left, right)


def _compare(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    if op in ("in", "not in"):
        return _membership(op, left, right, span)
    if op in _SAMENESS:
        same = _same_choice(left, right, span)
        if same is not None:
            if isinstance(same, bool):
                return same is not _SAMENESS[op]
            return operators.combine("not", [same], span) if _SAMENESS[op] else same
    return lift(lambda a, b: _compare_known(op, a, b, span), left, right, span=span, spread=is_choice)


_SAMENESS = {"==": False, "is": False, "!=": True, "is not": True}
"""Whether an operator asks if two values differ."""


def _same_choice(left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    """Whether a random choice of elements comes out as another or as one element, without going through all pairs.

    None where something else is compared.
    """
    if not isinstance(left, Choice):
        left, right = right, left
    atoms = _atoms(left), _atoms(right)
    if not isinstance(left, Choice) or atoms[0] is None or atoms[1] is None:
        return None
    if not atoms[0] & atoms[1]:
        return False
    if isinstance(right, AbstractElement):
        # what is compared is its place, which it does not tell
        raise NeedsMapError
    codes: dict[object, float] = {
        atom: float(code) for code, atom in enumerate(dict.fromkeys(map(_atom, possible_values(left))))
    }
    one, other = _numbered(left, codes, span), _numbered(right, codes, span)
    return build.compare(CompareOp.EQ, one, other, span)


def _atom(value: ModelValue) -> object:
    """What equal elements have in common: those that stand for any of a kind are told apart by their places alone."""
    return ("any", value.kind) if isinstance(value, AbstractElement) else value


def _atoms(value: ModelValue) -> set[object] | None:
    """The elements that a value may be, or None where it may be something else."""
    found = set[object]()
    for each in possible_values(value):
        if each is not None and not isinstance(each, NetworkElement | Maneuver):
            return None
        found.add(_atom(each))
    return found


def _numbered(value: ModelValue, codes: dict[object, float], span: Span) -> Node:
    """The number of the element that a value comes out as, where equal elements have equal numbers."""
    if not isinstance(value, Choice):
        return build.constant(codes.setdefault(_atom(value), float(len(codes))), span)
    numbers = tuple(_numbered(option, codes, span) for option in value.options)
    known = [number.value for number in numbers if isinstance(number, Constant)]
    return value.index if known == list(range(len(numbers))) else Select(value.index, numbers, span=span)


def _compare_known(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    if op not in _SAMENESS or not (isinstance(left, Instance) and isinstance(right, Instance)):
        return _compare_values(op, left, right, span)
    if isinstance(left, Nearest) or isinstance(right, Nearest):
        one, other = (right, left) if isinstance(left, Nearest) else (left, right)
        if isinstance(one, Nearest) or not isinstance(other, Nearest):
            raise fail("wrong-type", "only an object can be the nearest", span, f"this is {describe(one)}")
        same = is_nearest(one, other, span)
    elif is_element(left) or is_element(right):
        same = same_object(left, right, span)
    else:
        return _compare_values(op, left, right, span)
    if isinstance(same, bool):
        return same is not _SAMENESS[op]
    return operators.combine("not", [same], span) if _SAMENESS[op] else same


def _compare_values(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    if op in ("is", "is not"):
        if is_random(left) != is_random(right) and not isinstance(left, bool | type(None)) and right is not None:
            raise fail("random-branch", f"`{op}` asks for one and the same value, which a random one is not", span,
                       "random here", ("compare with `==`",))  # fmt: skip
        if isinstance(left, Instance) and isinstance(right, Instance) and (said := _at_a_side(span)):
            raise fail(
                "wrong-type",
                f"`{op}` asks whether two names mean one object",
                span,
                f"this is {describe(right)}",
                said,
            )
        same = left is right or (
            isinstance(left, str | bool | type(None)) and type(left) is type(right) and left == right
        )
        return same == (op == "is")
    if op in ("==", "!="):
        if left is None or right is None:
            return (left is right) == (op == "==")
        if isinstance(left, Instance) and isinstance(right, Instance):
            return (left is right) == (op == "==")
        if isinstance(left, list | tuple) and isinstance(right, list | tuple):
            one, other = (list(cast("Sequence[ModelValue]", each)) for each in (left, right))
            nested = any(isinstance(each, list | tuple | dict | set) for each in one + other)
            if not nested and any(map(_is_special, one + other)):
                equal = type(left) is type(right) and len(one) == len(other)
                same = _all_equal(one, other, span) if equal else False
                if isinstance(same, bool):
                    return same == (op == "==")
                return same if op == "==" else operators.combine("not", [same], span)
    if is_node(left) or is_node(right):
        return operators.compare(op, left, right, span)
    return plain_binary(op, left, right, span)


def _membership(op: str, left: ModelValue, right: ModelValue, span: Span) -> ModelValue:
    def negated(value: ModelValue) -> ModelValue:
        if op == "in":
            return value
        return not value if isinstance(value, bool) else operators.combine("not", [value], span)

    if kind_of_model(right) == "region":
        inside = lift(
            lambda item, area: operators.within(item, area, span), left, right, span=span, spread=holds_instances
        )
        return negated(inside)
    if isinstance(right, str) and isinstance(left, str):
        return (left in right) == (op == "in")
    if isinstance(right, AbstractList):
        same = _same_choice(left, cast(ModelValue, right.some(span)), span)
        if same is None or isinstance(same, bool):
            raise NeedsMapError
        return negated(same)
    if isinstance(right, list | tuple | dict | set | range):
        items = list(cast("list[ModelValue]", right))
        if _is_special(left) or (not is_flat(items) and any(map(_is_special, items))):
            return negated(_any_equal(left, items, span))
        check_weight(span, left, right, compared=True)
        return (check_hashable(left, span) in right if isinstance(right, dict | set) else left in items) == (op == "in")
    raise fail("wrong-type", f"`{op}` needs a region or a list", span, f"this is {describe(right)}",
               _at_a_side(span))  # fmt: skip


def _at_a_side(span: Span) -> tuple[str, ...]:
    """Hints for `in front of` or `is left of`, which are no operators of Scenic's."""
    side = _SIDE.search(span.text)
    return (condition_hint(side[1]),) if side else ()


_SIDE = re.compile(r"\b(front|back|left|right)\s+of\b")


def _is_special(value: ModelValue) -> bool:
    """Whether Python's own `==` says nothing about a value."""
    return is_random(value) or is_node(value)


def _any_equal(left: ModelValue, items: list[ModelValue], span: Span) -> ModelValue:
    compared = [compare("==", left, item, span) for item in items]
    known = [each.value if isinstance(each, Constant) else each for each in compared]
    if True in known or not any(map(is_random, known)):
        return True in known
    return operators.combine("or", known, span)


def _all_equal(left: list[ModelValue], right: list[ModelValue], span: Span) -> ModelValue:
    compared = [compare("==", one, other, span) for one, other in zip(left, right, strict=True)]
    known = [each.value if isinstance(each, Constant) else each for each in compared]
    if False in known or not any(map(is_random, known)):
        return False not in known
    return operators.combine("and", [each for each in known if is_random(each)], span)


def iterate(value: ModelValue, span: Span) -> list[ModelValue]:
    """The items of a known sequence.

    Raises:
        ScenarioError: wrong-type or random-branch.
    """
    if isinstance(value, list | tuple | range | dict | str):
        return list(cast("list[ModelValue]", value))
    if isinstance(value, set):
        # the order of a set of strings differs from run to run in Python; here it never does
        items = list(cast("set[ModelValue]", value))
        plain = all(isinstance(item, str | int | float) for item in items)
        return sorted(items, key=lambda item: (isinstance(item, str), item)) if plain else items
    if is_random(value):
        raise fail("random-branch", "a program cannot loop over a random list", span, "random here",
                   ("use `Uniform(*list)` to pick one of its items",))  # fmt: skip
    if isinstance(value, LabelObjects | OtherList):
        hint = "ask with `any(... for c in others(C))`, `all(...)`, `len([...])`, or `count(C)`"
        what = "a program cannot loop over the other label objects"
        raise fail("unsupported-construct", what, span, "not a list", (hint,))
    raise fail("wrong-type", f"a program cannot loop over {describe(value)}", span, "not a list")
