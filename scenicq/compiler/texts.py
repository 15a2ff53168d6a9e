"""Strings with values in them: f-strings, with the formats of numbers and texts that cannot grow large."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from scenicq.compiler.environment import Environment
from scenicq.compiler.known_properties import as_constant
from scenicq.compiler.values import ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.forest.nodes import Constant
from scenicq.limits import LIMITS
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["checked_text", "format_string"]

_FORMAT = re.compile(r"(.?[<>=^])?[-+ ]?#?0?\d{0,3}[,_]?(\.\d{1,2})?[bcdeEfFgGnosxX%]?", re.DOTALL)
"""Format specifications whose result is at most about a thousand characters long."""


def checked_text(text: str, span: Span) -> str:
    """A string of the program, which must be text that can be written and compared anywhere.

    Raises:
        ScenarioError: It has half of a surrogate pair.
    """
    if not text.isascii() and any("\ud800" <= character <= "\udfff" for character in text):
        raise fail("wrong-value", "half of a surrogate pair is no character", span, "in this string")
    return text


def format_string(run: Interpreter, node: ast.FormattedString, scope: Environment) -> str:
    """The text of an f-string.

    Raises:
        ScenarioError: What is put in is random or no plain value, or the text grows too long.
    """
    text: list[str] = []
    for part in node.parts:
        if isinstance(part, ast.LiteralValue):
            text.append(checked_text(str(part.value), part.span))
            continue
        value = as_constant(run, run.evaluate(part.value, scope))
        value = value.value if isinstance(value, Constant) else value
        if not isinstance(value, str | int | float | bool | None):
            raise fail("unsupported-construct", "only known numbers and strings can be put in a string", part.span,
                       f"this is {describe(value)}",
                       ("choose between known strings with `Uniform(...)`",))  # fmt: skip
        value = {"r": repr, "a": ascii, "s": str}[part.conversion](value) if part.conversion else value
        text.append(_laid_out(value, format_string(run, part.format, scope) if part.format else "", part.span))
        run.budget.pay(len(text[-1]), node.span)
    if sum(map(len, text)) > LIMITS.value_items:
        raise fail(
            "budget-exceeded", f"a string grows beyond {LIMITS.value_items:,} characters", node.span, "grows here"
        )
    return "".join(text)


def _laid_out(value: ModelValue, wanted: str, span: Span) -> str:
    if not _FORMAT.fullmatch(wanted):
        raise fail("unsupported-construct", "a format like this is not supported", span, "a format",
                   ("widths go up to 999 and precisions up to 99",))  # fmt: skip
    try:
        return format(value, wanted)
    except (ValueError, TypeError, OverflowError):
        raise fail("runtime-error", f"this format does not apply to {describe(value)}", span, "a format") from None
