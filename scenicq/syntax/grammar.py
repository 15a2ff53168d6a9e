"""What every part of the grammar needs of the others."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self

from scenicq.errors import Source
from scenicq.syntax import ast
from scenicq.syntax.cursor import Cursor
from scenicq.syntax.phrases import INFIX_WORDS
from scenicq.syntax.tokens import Token

__all__ = ["Grammar"]


class Grammar(Cursor, ABC):
    """The base of the parsers, each of which adds one part of the grammar.

    Attributes:
        temporal: Whether the expression is a requirement's, where `until` is an operator and `always (x)` no call.
    """

    def __init__(self, source: Source, tokens: list[Token]) -> None:
        """Start at the first token."""
        super().__init__(source, tokens)
        self.temporal = False

    @abstractmethod
    def part(self, tokens: list[Token]) -> Self:
        """A parser of the same program for the tokens of a part of it."""

    @abstractmethod
    def expression(self) -> ast.Expression:
        """Read one expression: no tuple without brackets, no `:=`, no star."""

    @abstractmethod
    def disjunction(self) -> ast.Expression:
        """Read one expression that does not end in `if ... else` and is no lambda."""

    @abstractmethod
    def starred(self) -> ast.Expression:
        """Read `*value`."""

    def expressions(self) -> ast.Expression:
        """Read expressions separated by commas: a tuple where there is a comma."""
        start = self.token.start
        first = self.item()
        if self.text != ",":
            return first
        items = [first]
        while self.accept(","):
            if not self.starts_operand(self.index):
                break
            items.append(self.item())
        return ast.Tuple(self.span(start), tuple(items))

    def item(self) -> ast.Expression:
        """Read an expression or `*value`."""
        if self.text == "*":
            return self.starred()
        if self.text == "yield":
            return self.unsupported()
        return self.expression()

    def named(self) -> ast.Expression:
        """Read an expression, `*value` or `name := value`."""
        if self.token.kind == "name" and self.peek().text == ":=":
            token = self.advance()
            target = ast.Name(self.token_span(token), token.text)
            self.advance()
            value = self.expression()
            return ast.Walrus(self.span(token.start), target, value)
        return self.item() if self.text in ("*", "yield") else self.expression()

    def unsupported(self) -> ast.Expression:
        """Read past `yield ...` or `await ...`."""
        word = self.advance()
        self.accept("from")
        if self.starts_operand(self.index):
            self.expressions()
        return ast.UnsupportedExpression(self.span(word.start), word.text)

    def starts_operand(self, index: int) -> bool:
        """Whether an expression can start at the token."""
        token = self.tokens[index]
        match token.kind:
            case "number" | "string":
                return True
            case "name":
                return token.text not in INFIX_WORDS
            case "keyword":
                return token.text in ("not", "lambda", "await", "yield", "True", "False", "None")
            case "operator":
                return token.text in ("(", "[", "{", "-", "+", "~", "*", "...")
            case _:
                return False
