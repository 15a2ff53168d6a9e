"""Operators that start with words: `distance to`, `relative heading of`, `visible`, `front of`, ..."""

from __future__ import annotations

from abc import abstractmethod
from bisect import bisect_right

from scenicq.errors import ScenarioError, Source
from scenicq.limits import LIMITS
from scenicq.syntax import ast
from scenicq.syntax.precedence import OR, PREFIX
from scenicq.syntax.specifiers import InstanceParser
from scenicq.syntax.tokens import CLOSERS, INFIX_NAMES, Token

__all__ = ["PrefixParser"]

_PARTS = frozenset(("front", "back", "left", "right", "top", "bottom"))
_AFTER_VISIBLE = INFIX_NAMES | {"(", "[", "{", "+", "-", "~"}
"""With these an operand starts after `visible`, which is then no name."""


class PrefixParser(InstanceParser):
    """Reads operators that start with words.

    Attributes:
        prefixes: What was read at a place, and the place after it: no such operator is read twice.
        places: The places of a word, for `line_has`.
        retries: How many tokens were looked at in vain.
    """

    def __init__(self, source: Source, tokens: list[Token]) -> None:
        """Start at the first token."""
        super().__init__(source, tokens)
        self.prefixes: dict[int, tuple[ast.Expression, int]] = {}
        self.places: dict[str, list[int]] = {}
        self.retries = 0

    @abstractmethod
    def climb(self, start: int, left: ast.Expression, level: int) -> ast.Expression:
        """Read the operators after a left operand, as long as they are tight enough."""

    @abstractmethod
    def conditional(self, start: int, then: ast.Expression) -> ast.Expression:
        """Read `if test else other` after a value, if it is there."""

    def is_prefix(self) -> bool:
        """Whether an operator of several words starts here, such as `distance to`."""
        following = self.peek()
        match self.text:
            case "distance":
                return following.text in ("from", "to", "past")
            case "angle" | "altitude" | "azimuth":
                return following.text in ("from", "to")
            case "relative":
                return following.text in ("heading", "position") and self.peek(2).text == "of"
            case "apparent":
                return following.text == "heading" and self.peek(2).text == "of"
            case "follow":
                if following.text == "(":
                    after = min(self.closing(self.index + 1) + 1, len(self.tokens) - 1)
                    return self.tokens[after].text in ("from", "for", ".", "[", "(")
                if following.text == "relative" and self.peek(2).text == "to":
                    return False
                return following.kind == "name" and self.starts_operand(self.index + 1)
            case "visible":
                if following.text == "not":
                    return self.peek(2).text == "visible" and self.peek(3).text != "from"
                if following.text == "relative" and self.peek(2).text == "to":
                    return False
                if following.text in _AFTER_VISIBLE:
                    return True
                return following.kind == "name" and self.starts_operand(self.index + 1)
            case word if word in _PARTS:
                ahead = 1
                while ahead < 3 and self.peek(ahead).text in _PARTS:
                    ahead += 1
                return self.peek(ahead).text == "of"
            case _:
                return False

    def prefix(self) -> ast.Expression:
        """Read an operator that starts with words; each place is read only once."""
        index = self.index
        known = self.prefixes.get(index)
        if known is None:
            self.enter()
            node = self.prefix_operator()
            self.depth -= 1
            self.prefixes[index] = node, self.index
            return node
        self.move(known[1])
        return known[0]

    def prefix_operator(self) -> ast.Expression:
        """Read an operator that starts with words."""
        start = self.token.start
        word = self.advance().text
        match word:
            case "not":
                self.advance()
                region = self.binary(PREFIX)
                return ast.Visible(self.span(start), region, negated=True)
            case "visible":
                region = self.binary(PREFIX)
                return ast.Visible(self.span(start), region, negated=False)
            case "relative" | "apparent":
                kind = f"{word} {self.advance().text}"
                self.advance()
                target, origin = self.target_then("from")
                span = self.span(start)
                if kind == "relative position":
                    return ast.RelativePosition(span, target, origin)
                if kind == "relative heading":
                    return ast.RelativeHeading(span, target, origin)
                return ast.ApparentHeading(span, target, origin)
            case "follow":
                field = self.expression()
                origin = self.expression() if self.accept("from") else None
                self.expect("for", "after the field to follow", "write `follow field from position for distance`")
                distance = self.binary(PREFIX)
                return ast.Follow(self.span(start), field, origin, distance)
            case "distance" if self.accept("past"):
                target, origin = self.target_then("of")
                return ast.DistancePast(self.span(start), target, origin)
            case "distance" | "angle" | "altitude" | "azimuth":
                return self.measure(start, word)
            case _:
                while not self.accept("of"):
                    word = f"{word} {self.advance().text}"
                target = self.binary(PREFIX)
                return ast.PartOf(self.span(start), word, target)

    def measure(self, start: int, word: str) -> ast.Expression:
        """Read the operands of `distance`, `angle` and `altitude`, in either order."""
        place = self.token
        if self.accept("to"):
            target, origin = self.target_then("from")
        else:
            self.advance()
            first, second = self.target_then("to")
            # With `from` alone, the other end is the ego; a distance has no direction.
            ego = ast.Name(self.token_span(place), "ego")
            target, origin = (
                (second, first) if second is not None else (first, None) if word == "distance" else (ego, first)
            )
        span = self.span(start)
        if word == "distance":
            return ast.DistanceOperator(span, target, origin)
        return ast.Altitude(span, target, origin) if word == "altitude" else ast.Angle(span, target, origin)

    def target_then(self, word: str) -> tuple[ast.Expression, ast.Expression | None]:
        """Read an operand and, after a word, a second one.

        Before the word stands any expression; without the word, the operand ends where a sum ends. So where a looser
        operator follows, read on only if that leads to the word.
        """
        start = self.token.start
        target = self.binary(PREFIX)
        if self.text != word and self.text != "if" and not self.level_here():
            return target, None
        if self.text != word:
            wide = self.read_on(start, target, word)
            if wide is None:
                return target, None
            target = wide
        self.advance()
        return target, self.binary(PREFIX)

    def read_on(self, start: int, left: ast.Expression, word: str) -> ast.Expression | None:
        """Read looser operators after an operand, if that leads to the word."""
        if self.retries > LIMITS.reading_retries:
            raise self.fail(
                "the program has too many operators that can be read in several ways", code="budget-exceeded"
            )
        if not self.line_has(word):
            return None
        index, depth, temporal = self.index, self.depth, self.temporal
        try:
            node = self.conditional(start, self.climb(start, left, OR))
        except ScenarioError:
            node = None
        if node is not None and self.text == word:
            return node
        self.retries += max(0, self.index - index)
        self.move(index)
        self.depth, self.temporal = depth, temporal
        return None

    def line_has(self, word: str) -> bool:
        """Whether the word comes later in these brackets of this line."""
        places = self.places.get(word)
        if places is None:
            places = [index for index, token in enumerate(self.tokens) if token.text == word]
            self.places[word] = places
        following = bisect_right(places, self.index)
        last = places[following] if following < len(places) else 0
        depth = 0
        for index in range(self.index, last + 1):
            token = self.tokens[index]
            self.retries += 1
            if token.text in CLOSERS:
                depth += 1
            elif token.text in (")", "]", "}"):
                depth -= 1
                if depth < 0:
                    return False
            elif token.kind == "newline" or (not depth and token.text in (",", ";")):
                return False
        return bool(last)
