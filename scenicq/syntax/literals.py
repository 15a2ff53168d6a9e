"""Literals: the values of numbers and strings, and the pieces of formatted strings."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from scenicq.errors import Diagnostic, ScenarioError, Source, Span
from scenicq.limits import LIMITS
from scenicq.syntax.tokens import CLOSERS, Token

__all__ = ["Field", "LiteralText", "decode", "number_value", "split_format", "string_parts"]

_ESCAPE = re.compile(r"\\(N\{[^}\n]*\}|x[0-9a-fA-F]{2}|u[0-9a-fA-F]{4}|U[0-9a-fA-F]{8}|[0-7]{1,3}|.)", re.DOTALL)
_SIMPLE = {"a": "\a", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "v": "\v", "\\": "\\", "'": "'", '"': '"'}
_PREFIX = re.compile(r"[a-zA-Z]*")
_QUOTED = re.compile(r"\"\"\"(?:[^\\]|\\.)*?\"\"\"|'''(?:[^\\]|\\.)*?'''|\"[^\"\n]*\"|'[^'\n]*'", re.DOTALL)
_RAW_TEXT = re.compile(r"[^{}]*")
_PLAIN_TEXT = re.compile(r"(?:\\N\{[^}]*\}|\\[^{}]|[^{}\\]|\\)*")


def _fail(source: Source, message: str, start: int, end: int, hint: str = "") -> ScenarioError:
    span = Span(source, start, end)
    return ScenarioError(Diagnostic("parse-error", message, span, hints=(hint,) if hint else ()))


def number_value(source: Source, token: Token) -> int | float | complex:
    """The value of a number token.

    Raises:
        ScenarioError: A whole number with thousands of digits.
    """
    text = token.text.replace("_", "").lower()
    if text.endswith("j") and not text.startswith("0x"):
        return complex(0, float(text[:-1]))
    if text[:2] in ("0x", "0o", "0b"):
        return int(text, 0)
    if "." in text or "e" in text:
        return float(text)
    if len(text) > LIMITS.number_digits:
        raise _fail(source, f"a number has more than {LIMITS.number_digits} digits", token.start, token.end)
    return int(text)


def string_parts(token: Token) -> tuple[str, int, int]:
    """The prefix of a string token in lower case, and where the text between its quotes starts and ends."""
    found = _PREFIX.match(token.text)
    prefix = found.group() if found else ""
    quotes = 3 if token.text[len(prefix) : len(prefix) + 3] in ('"""', "'''") else 1
    return prefix.lower(), token.start + len(prefix) + quotes, token.end - quotes


def decode(source: Source, start: int, end: int, *, raw: bool, binary: bool) -> str:
    """The value of a piece of a string; bytes come as characters up to 255.

    Raises:
        ScenarioError: An escape sequence that is cut off or names no character.
    """
    text = source.text[start:end].replace("\r\n", "\n")
    if raw or "\\" not in text:
        return text

    def value(found: re.Match[str]) -> str:
        body = found.group(1)
        if body in _SIMPLE:
            return _SIMPLE[body]
        if body == "\n":
            return ""
        if body[0] in "01234567":
            return chr(int(body, 8) & (0xFF if binary else 0x1FF))
        if body[0] == "x" and len(body) > 1:
            return chr(int(body[1:], 16))
        if binary or body[0] not in "xuUN":
            return found.group()
        place = (start + found.start(), start + found.end())
        if len(body) == 1:
            raise _fail(source, f"the escape sequence `\\{body}` is not complete", *place)
        if body[0] == "N":
            try:
                return unicodedata.lookup(body[2:-1])
            except KeyError:
                raise _fail(source, f"no character is called `{body[2:-1]}`", *place) from None
        number = int(body[1:], 16)
        if number > 0x10FFFF:
            raise _fail(source, "no character has such a number", *place)
        return chr(number)

    return _ESCAPE.sub(value, text)


@dataclass(frozen=True, slots=True)
class LiteralText:
    """Literal text of a formatted string, with doubled braces already single."""

    start: int
    end: int
    value: str


@dataclass(frozen=True, slots=True)
class Field:
    """`{expression!conversion:format}` of a formatted string, as offsets.

    Attributes:
        start: Offset of the opening brace.
        end: Offset after the closing one.
        expression: Range of the expression.
        shows_text: Whether `=` after the expression asks for its text too.
        conversion: `r`, `s`, `a` or empty.
        format: Range of the format, where there is one.
    """

    start: int
    end: int
    expression: tuple[int, int]
    shows_text: bool
    conversion: str
    format: tuple[int, int] | None


def split_format(source: Source, start: int, end: int, *, raw: bool) -> list[LiteralText | Field]:
    """Split the text between the quotes of a formatted string (or a format in one) into text and fields.

    Raises:
        ScenarioError: Braces that do not pair, or an empty field.
    """
    text = source.text
    pieces = _RAW_TEXT if raw else _PLAIN_TEXT
    parts: list[LiteralText | Field] = []
    position = start
    while position < end:
        found = pieces.match(text, position, end)
        stop = found.end() if found else position
        if stop > position:
            parts.append(LiteralText(position, stop, decode(source, position, stop, raw=raw, binary=False)))
        if stop >= end:
            break
        if text[stop : stop + 2] in ("{{", "}}") and stop + 2 <= end:
            parts.append(LiteralText(stop, stop + 2, text[stop]))
            position = stop + 2
        elif text[stop] == "}":
            hint = "write `}}` for a brace in the text"
            raise _fail(source, "`}` closes no `{` of the formatted string", stop, stop + 1, hint)
        else:
            field = _field(source, stop, end)
            parts.append(field)
            if len(parts) > LIMITS.string_parts:
                raise _fail(source, f"a string has more than {LIMITS.string_parts:,} parts", start, position)
            position = field.end
    return parts


def _field(source: Source, start: int, end: int) -> Field:
    text = source.text
    position = _expression_end(source, start + 1, end, start)
    expression_end = position
    shows_text = text[position] == "="
    if shows_text:
        position += 1
        while position < end and text[position] == " ":
            position += 1
    if not text[start + 1 : expression_end].strip():
        raise _fail(source, "the braces of the formatted string hold no expression", start, position + 1)
    conversion = ""
    if position < end and text[position] == "!":
        conversion = text[position + 1 : position + 2]
        if conversion not in ("r", "s", "a"):
            raise _fail(source, "a conversion is `!r`, `!s` or `!a`", position, position + 2)
        position += 2
    spec: tuple[int, int] | None = None
    if position < end and text[position] == ":":
        begin, depth = position + 1, 0
        position = begin
        while position < end and (depth or text[position] != "}"):
            depth += {"{": 1, "}": -1}.get(text[position], 0)
            position += 1
        spec = (begin, position)
    if position >= end or text[position] != "}":
        raise _fail(source, "`{` of the formatted string is never closed", start, start + 1, "write `{{` for a brace")
    if shows_text and not conversion and spec is None:
        conversion = "r"
    return Field(start, position + 1, (start + 1, expression_end), shows_text, conversion, spec)


def _expression_end(source: Source, position: int, end: int, start: int) -> int:
    """Where the expression of a field ends: at `!`, `:`, `}` or a last `=` outside of brackets and strings."""
    text = source.text
    depth = 0
    while position < end:
        character = text[position]
        if character in "\"'":
            quoted = _QUOTED.match(text, position, end)
            position = quoted.end() if quoted else position + 1
            continue
        if character in CLOSERS:
            depth += 1
        elif depth and character in ")]}":
            depth -= 1
        elif not depth:
            if character == "}" or character == ":":
                return position
            if character in "!=<>" and text[position + 1 : position + 2] == "=":
                position += 2
                continue
            if character == "!" or (character == "=" and text[position + 1 : end].lstrip(" ")[:1] in ("}", "!", ":")):
                return position
        position += 1
    raise _fail(source, "`{` of the formatted string is never closed", start, start + 1, "write `{{` for a brace")
