"""Strings: plain, bytes, formatted, and several side by side."""

from __future__ import annotations

from scenicq.syntax import ast
from scenicq.syntax.grammar import Grammar
from scenicq.syntax.lexer import tokenize_part
from scenicq.syntax.literals import Field, LiteralText, decode, split_format, string_parts
from scenicq.syntax.tokens import Token

__all__ = ["TextParser"]

_FORMAT_LEVELS = 2


class TextParser(Grammar):
    """Reads strings."""

    def strings(self) -> ast.Expression:
        """Read adjacent string literals as one value."""
        start = self.token.start
        parts: list[ast.LiteralValue | ast.Replacement] = []
        formatted = False
        binary: bool | None = None
        while self.token.kind == "string":
            token = self.advance()
            prefix, begin, end = string_parts(token)
            if binary is not None and binary != ("b" in prefix):
                raise self.fail("strings and bytes stand side by side", self.token_span(token))
            binary = "b" in prefix
            raw = "r" in prefix
            if "f" in prefix:
                formatted = True
                parts += self.format_parts(begin, end, raw, _FORMAT_LEVELS)
            else:
                value = decode(self.source, begin, end, raw=raw, binary=binary)
                parts.append(ast.LiteralValue(self.token_span(token), value))
        span = self.span(start)
        if formatted:
            return ast.FormattedString(span, tuple(parts))
        text = "".join(str(part.value) for part in parts)
        if not binary:
            return ast.LiteralValue(span, text)
        if any(ord(character) > 255 for character in text) or not span.text.isascii():
            raise self.fail("bytes hold ASCII characters only", span)
        return ast.LiteralValue(span, text.encode("latin-1"))

    def format_parts(self, start: int, end: int, raw: bool, levels: int) -> list[ast.LiteralValue | ast.Replacement]:
        """Read the text and the fields of a formatted string."""
        if not levels:
            place = Token("string", "", start, end)
            raise self.fail("fields are nested too deeply in the formatted string", self.token_span(place))
        self.enter()
        parts: list[ast.LiteralValue | ast.Replacement] = []
        for piece in split_format(self.source, start, end, raw=raw):
            match piece:
                case LiteralText():
                    whole = Token("string", "", piece.start, piece.end)
                    parts.append(ast.LiteralValue(self.token_span(whole), piece.value))
                case Field():
                    parts += self.field(piece, raw, levels)
        self.depth -= 1
        return parts

    def field(self, field: Field, raw: bool, levels: int) -> list[ast.LiteralValue | ast.Replacement]:
        """Read one field of a formatted string."""
        begin, end = field.expression
        inner = self.part(tokenize_part(self.source, begin, end))
        inner.depth = self.depth
        value = inner.expressions()
        if inner.token.kind != "end":
            raise inner.fail(f"`{inner.text}` does not continue the expression")
        whole = Token("string", "", field.start, field.end)
        spec: ast.FormattedString | None = None
        if field.format is not None:
            place = Token("string", "", *field.format)
            spec = ast.FormattedString(self.token_span(place), tuple(self.format_parts(*field.format, raw, levels - 1)))
        replacement = ast.Replacement(self.token_span(whole), value, field.conversion, spec)
        if not field.shows_text:
            return [replacement]
        shown = self.source.text[begin:end] + "="
        return [ast.LiteralValue(self.token_span(Token("string", "", begin, end)), shown), replacement]
