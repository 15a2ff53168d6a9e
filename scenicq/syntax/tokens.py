"""Tokens: the words of a program, each with its place in the text."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

__all__ = ["CLOSERS", "KEYWORDS", "Token", "TokenKind"]

TokenKind: TypeAlias = Literal["name", "keyword", "number", "string", "operator", "newline", "indent", "dedent", "end"]


class Token(NamedTuple):
    """One token.

    Attributes:
        kind: What it is; Scenic's own words are names, only Python's are keywords.
        text: The characters; empty for `newline`, `indent`, `dedent` and `end`, so that no text is taken for another.
        start: Offset of the first character.
        end: Offset after the last character.
    """

    kind: TokenKind
    text: str
    start: int
    end: int


KEYWORDS: frozenset[str] = frozenset(
    [
        "False",
        "None",
        "True",
        "and",
        "as",
        "assert",
        "async",
        "await",
        "break",
        "class",
        "continue",
        "def",
        "del",
        "elif",
        "else",
        "except",
        "finally",
        "for",
        "from",
        "global",
        "if",
        "import",
        "in",
        "is",
        "lambda",
        "nonlocal",
        "not",
        "of",
        "or",
        "pass",
        "raise",
        "return",
        "try",
        "while",
        "with",
        "yield",
    ]
)
"""Words that can never be names: Python's in every version of Scenic, and `of`."""

CLOSERS: dict[str, str] = {"(": ")", "[": "]", "{": "}"}
"""Opening brackets with their closing ones."""
