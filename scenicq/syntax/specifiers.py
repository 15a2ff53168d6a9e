"""Instances: a class and its specifiers, with `new` or without."""

from __future__ import annotations

from abc import abstractmethod
from typing import Literal

from scenicq.errors import ScenarioError, Source, similar
from scenicq.syntax import ast
from scenicq.syntax.atoms import AtomParser
from scenicq.syntax.precedence import POWER
from scenicq.syntax.tokens import INFIX_NAMES, Token

__all__ = ["InstanceParser"]

_SPECIFIERS = [
    "with", "at", "in", "on", "contained in", "offset by", "offset along", "beyond", "visible", "not visible",
    "left of", "right of", "ahead of", "behind", "above", "below", "following", "facing", "facing toward",
    "facing away from", "apparently facing", "using",
]  # fmt: skip
_ONE_WORD = frozenset(("on", "at", "facing", "following", "beyond", "behind", "above", "below", "using"))
_UNMISTAKABLE = _ONE_WORD - {"at"}
_TWO_WORDS = {
    "left": ("of",), "right": ("of",), "ahead": ("of",), "contained": ("in",), "apparently": ("facing",),
    "offset": ("by", "along"),
}  # fmt: skip
_ENDS = frozenset((",", ")", "]", "}", ";", ":", "if", "else", "for", "and", "or", "from", "as"))

_FAR = "a requirement says how far: `require (distance from a to b) < 10`"
_OUT = "a requirement says where it is not: `in everywhere` and `require not (a.position in road)`"
_BESIDE = "`at X offset by Range(1, 6) @ Range(-5, 5)` is an area on the right of X"
_SAID = {
    "near": _FAR, "within": _FAR, "close": _FAR, "off": _OUT, "outside": _OUT, "not": _OUT,
    "next": _BESIDE, "beside": _BESIDE, "alongside": _BESIDE,
}  # fmt: skip
"""What people try to place objects with, and how Scenic says it."""


class InstanceParser(AtomParser):
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
    def operand(self, level: int) -> ast.Expression:
        """Read what stands before, between or after operators."""

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
        text = self.text
        following = self.peek()
        match text:
            case "with":
                return True
            case "at":
                return self.looks_like_class(node)
            case "offset":
                return following.text in ("by", "along") and self.looks_like_class(node)
            case "in":
                return not self.has_new and self.looks_like_class(node)
            case "visible":
                return following.text != "from" or (not self.has_new and self.looks_like_class(node))
            case "not":
                if following.text != "visible":
                    return False
                return self.peek(2).text != "from" or (not self.has_new and self.looks_like_class(node))
            case "left" | "right" | "ahead" | "contained" | "apparently":
                return following.text in _TWO_WORDS[text]
            case _:
                return text in _UNMISTAKABLE

    def starts_specifier(self, index: int) -> bool:
        """Whether a specifier starts at the token."""
        token, following = self.tokens[index], self.tokens[min(index + 1, len(self.tokens) - 1)]
        text = token.text
        if text == "in":
            return True
        if text == "with":
            return following.kind == "name"
        if text in _ONE_WORD:
            return self.starts_operand(index + 1) or following.text in INFIX_NAMES
        if text in _TWO_WORDS:
            return following.text in _TWO_WORDS[text]
        if text == "not" and following.text == "visible":
            following = self.tokens[index + 2]
            return following.text in _ENDS or not following.text
        return text == "visible" and (following.text in _ENDS or not following.text)

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
                self.starts_operand(self.index + 1) and bool(similar(self.text, _SPECIFIERS)) and not self.is_prefix()
            )
        return following.kind in ("number", "string")

    @abstractmethod
    def is_prefix(self) -> bool:
        """Whether an operator of several words starts here, such as `distance to`."""

    def unknown(self) -> ScenarioError:
        """The error for a word that starts no specifier."""
        close = similar(self.text, _SPECIFIERS) or similar(f"{self.text} {self.peek().text}", _SPECIFIERS)
        if close.startswith(f"{self.text} "):
            message = f"`{self.text}` alone starts no specifier"
            return self.fail(message, hint=f"write `{close}`", code="unknown-specifier")
        hint = f"`{close}` is spelled similarly" if close else "a property is set by `with property value`"
        hint = _SAID.get(self.text, hint)
        return self.fail(f"no specifier starts with `{self.text}`", hint=hint, code="unknown-specifier")

    def specifier(self) -> ast.Specifier:
        """Read one specifier."""
        start = self.token.start
        word = self.advance().text
        match word:
            case "with":
                name = self.name("the name of the property")
                value = self.expression()
                return ast.WithSpecifier(self.span(start), name.text, self.token_span(name), value)
            case "at":
                value = self.expression()
                return ast.AtSpecifier(self.span(start), value)
            case "in":
                value = self.expression()
                return ast.InSpecifier(self.span(start), value)
            case "on":
                value = self.expression()
                return ast.OnSpecifier(self.span(start), value)
            case "contained":
                self.advance()
                value = self.expression()
                return ast.ContainedInSpecifier(self.span(start), value)
            case "offset":
                return self.offset(start)
            case "beyond":
                return self.beyond(start)
            case "visible":
                viewer = self.expression() if self.accept("from") else None
                return ast.VisibleSpecifier(self.span(start), viewer)
            case "not":
                self.expect("visible", "after `not`")
                viewer = self.expression() if self.accept("from") else None
                return ast.NotVisibleSpecifier(self.span(start), viewer)
            case "left" | "right" | "ahead":
                self.expect("of", f"after `{word}`")
                return self.direction(start, word)
            case "behind" | "above" | "below":
                return self.direction(start, word)
            case "following":
                field = self.expression()
                origin = self.expression() if self.accept("from") else None
                self.expect("for", "after the field to follow", "write `following field for distance`")
                distance = self.expression()
                return ast.FollowingSpecifier(self.span(start), field, origin, distance)
            case "facing":
                return self.facing(start)
            case "apparently":
                self.expect("facing", "after `apparently`")
                heading = self.expression()
                origin = self.expression() if self.accept("from") else None
                return ast.ApparentlyFacingSpecifier(self.span(start), heading, origin)
            case "using":
                value = self.operand(POWER)
                return ast.UsingSpecifier(self.span(start), value)
            case _:
                self.move(self.index - 1)
                raise self.unknown()

    def offset(self, start: int) -> ast.Specifier:
        """Read what follows `offset`."""
        if self.accept("along"):
            direction = self.expression()
            self.expect("by", "after the direction", "write `offset along direction by vector`")
            value = self.expression()
            return ast.OffsetAlongSpecifier(self.span(start), direction, value)
        self.expect("by", "after `offset`", "write `offset by vector` or `offset along direction by vector`")
        value = self.expression()
        return ast.OffsetBySpecifier(self.span(start), value)

    def beyond(self, start: int) -> ast.Specifier:
        """Read what follows `beyond`."""
        target = self.expression()
        self.expect("by", "after the position to be beyond", "write `beyond position by offset`")
        offset = self.expression()
        origin = self.expression() if self.accept("from") else None
        return ast.BeyondSpecifier(self.span(start), target, offset, origin)

    def direction(
        self, start: int, word: Literal["left", "right", "ahead", "behind", "above", "below"]
    ) -> ast.Specifier:
        """Read what follows `left of` and its like."""
        reference = self.expression()
        distance = self.expression() if self.accept("by") else None
        return ast.DirectionSpecifier(self.span(start), word, reference, distance)

    def facing(self, start: int) -> ast.Specifier:
        """Read what follows `facing`."""
        directly = self.text == "directly" and self.peek().text in ("toward", "away")
        if directly:
            self.advance()
        if self.text == "toward" and self.starts_operand(self.index + 1):
            self.advance()
            target = self.expression()
            return ast.FacingTowardSpecifier(self.span(start), target, directly)
        if self.text == "away" and self.peek().text == "from":
            self.advance()
            self.advance()
            target = self.expression()
            return ast.FacingAwayFromSpecifier(self.span(start), target, directly)
        heading = self.expression()
        return ast.FacingSpecifier(self.span(start), heading)
