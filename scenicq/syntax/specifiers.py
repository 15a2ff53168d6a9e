"""Instances: a class and its specifiers, with `new` or without."""

from __future__ import annotations

from abc import abstractmethod

from scenicq.errors import ScenarioError, Source, similar
from scenicq.syntax import ast
from scenicq.syntax.phrase_parser import PhraseParser
from scenicq.syntax.phrases import INFIX_NAMES, SPECIFIERS, SPECIFIERS_AT, PhraseRow
from scenicq.syntax.tokens import Token

__all__ = ["InstanceParser"]

_NAMES = ["with", *(" ".join(row.words) for row in SPECIFIERS)]
_ENDS = frozenset((",", ")", "]", "}", ";", ":", "if", "else", "for", "and", "or", "from", "as"))

_FAR = "a requirement says how far: `require (distance from a to b) < 10`"
_OUT = "a requirement says where it is not: `in everywhere` and `require not (a.position in road)`"
_BESIDE = "`at X offset by Range(1, 6) @ Range(-5, 5)` is an area on the right of X"
_SAID = {
    "near": _FAR, "within": _FAR, "close": _FAR, "off": _OUT, "outside": _OUT, "not": _OUT,
    "next": _BESIDE, "beside": _BESIDE, "alongside": _BESIDE,
}  # fmt: skip
"""What people try to place objects with, and how Scenic says it."""


class InstanceParser(PhraseParser):
    """Reads instances.

    Attributes:
        classes: Names that the program defines as classes.
        variables: Names that the program assigns to.
        has_new: Whether `new` is used, so that a name before `in` is a value and no class.
    """

    def __init__(self, source: Source, tokens: list[Token]) -> None:
        """Start at the first token, and see which names are classes."""
        super().__init__(source, tokens)
        self.classes: set[str] = set()
        self.variables: set[str] = set()
        self.has_new = False

    @abstractmethod
    def prefix_here(self) -> PhraseRow | None:
        """The operator that starts here with words, such as `distance to`."""

    def looks_like_class(self, node: ast.Expression) -> bool:
        """Whether a name is one of a class: defined as such, or in capitals as classes are."""
        match node:
            case ast.Name(id=name):
                if name in self.classes:
                    return True
                if name in self.variables:
                    return False
            case ast.Attribute(name=name):
                pass
            case _:
                return False
        return name[:1].isupper() and any(character.islower() for character in name)

    def starts_instance(self, node: ast.Expression) -> bool:
        """Whether the next tokens make a name the class of an instance without `new`."""
        if self.text == "with":
            return True
        if self.specifier_at(self.index) is None:
            return False
        if not self.level_here():
            return True
        # the words are an operator after a value, and a specifier after a class
        only_old = self.text not in ("at", "offset")
        return not (only_old and self.has_new) and self.looks_like_class(node)

    def specifier_at(self, index: int) -> PhraseRow | None:
        """The specifier that starts at the token, but for `with`."""
        for row in SPECIFIERS_AT.get(self.tokens[index].text, ()):
            # `toward` may be a variable
            if self.reads(index, row.words) and (
                row.words[-1] != "toward" or self.starts_operand(index + len(row.words))
            ):
                return row
        return None

    def starts_specifier(self, index: int) -> bool:
        """Whether a specifier starts at the token."""
        if self.tokens[index].text == "with":
            return self.tokens[min(index + 1, len(self.tokens) - 1)].kind == "name"
        row = self.specifier_at(index)
        if row is None:
            return False
        after = index + len(row.words)
        text = self.tokens[after].text
        if row.operands[0].word:
            return text in _ENDS or not text
        return len(row.words) > 1 or row.words == ("in",) or self.starts_operand(after) or text in INFIX_NAMES

    def names_class(self, index: int) -> bool:
        """Whether the name after `new` is that of a class, and not an operator after a variable called `new`."""
        if self.tokens[index].text in INFIX_NAMES:
            return self.starts_specifier(index + 1)
        return self.starts_operand(index)

    def new(self) -> ast.Expression:
        """Read `new Class specifiers`."""
        start = self.advance().start
        name = self.name("the class after `new`")
        cls: ast.Expression = ast.Name(self.token_span(name), name.text)
        while self.accept("."):
            name = self.name("the name of an attribute")
            cls = ast.Attribute(self.span(cls.span.start), cls, name.text, self.token_span(name))
        return self.instance(start, cls, keyword=True)

    def instance(self, start: int, cls: ast.Expression, *, keyword: bool) -> ast.Expression:
        """Read the specifiers of an instance of the class."""
        specifiers: list[ast.Specifier] = []
        temporal, self.temporal = self.temporal, False
        if self.starts_specifier(self.index) or (self.token.text and not keyword):
            specifiers.append(self.specifier())
        elif self.token.kind == "name" and self.starts_operand(self.index):
            raise self.unknown()
        while specifiers and self.text == ",":
            if not self.starts_specifier(self.index + 1):
                self.advance()
                if self.is_unknown():
                    raise self.unknown()
                self.move(self.index - 1)
                break
            self.advance()
            specifiers.append(self.specifier())
        self.temporal = temporal
        span = self.span(start)
        several_lines = "\n" in span.text
        if several_lines and self.text == "," and self.peek().kind == "newline":
            self.advance()
        return ast.New(span, cls, tuple(specifiers), keyword)

    def is_unknown(self) -> bool:
        """Whether two words side by side can only be a misspelt specifier."""
        following = self.peek()
        if self.token.kind != "name" or not self.starts_operand(self.index) or self.text[:1].isupper():
            return False
        if following.kind == "name":
            return (
                self.starts_operand(self.index + 1) and bool(similar(self.text, _NAMES)) and self.prefix_here() is None
            )
        return following.kind in ("number", "string")

    def unknown(self) -> ScenarioError:
        """The error for a word that starts no specifier."""
        close = similar(self.text, _NAMES) or similar(f"{self.text} {self.peek().text}", _NAMES)
        if close.startswith(f"{self.text} "):
            message = f"`{self.text}` alone starts no specifier"
            return self.fail(message, hint=f"write `{close}`", code="unknown-specifier")
        hint = f"`{close}` is spelled similarly" if close else "a property is set by `with property value`"
        hint = _SAID.get(self.text, hint)
        return self.fail(f"no specifier starts with `{self.text}`", hint=hint, code="unknown-specifier")

    def specifier(self) -> ast.Specifier:
        """Read one specifier."""
        start = self.token.start
        if self.accept("with"):
            name = self.name("the name of the property")
            value = self.expression()
            return ast.WithSpecifier(self.span(start), name.text, self.token_span(name), value)
        row = self.specifier_at(self.index)
        if row is None:
            raise self.unknown()
        return self.phrase(start, row)
