"""Reading phrases by their rows."""

from __future__ import annotations

from abc import abstractmethod
from bisect import bisect_right

from scenicq.errors import ScenarioError, Source
from scenicq.limits import LIMITS
from scenicq.syntax import ast
from scenicq.syntax.atoms import AtomParser
from scenicq.syntax.phrases import Operand, PhraseRow
from scenicq.syntax.precedence import OR
from scenicq.syntax.tokens import CLOSERS, Token

__all__ = ["PhraseParser"]


class PhraseParser(AtomParser):
    """Reads phrases whose first words stand here.

    Attributes:
        places: The places of a word, for `line_has`.
        retries: How many tokens were looked at in vain.
    """

    def __init__(self, source: Source, tokens: list[Token]) -> None:
        """Start at the first token."""
        super().__init__(source, tokens)
        self.places: dict[str, list[int]] = {}
        self.retries = 0

    @abstractmethod
    def binary(self, level: int) -> ast.Expression:
        """Read an expression of operators at least as tight as the level."""

    @abstractmethod
    def climb(self, start: int, left: ast.Expression, level: int) -> ast.Expression:
        """Read the operators after a left operand, as long as they are tight enough."""

    @abstractmethod
    def conditional(self, start: int, then: ast.Expression) -> ast.Expression:
        """Read `if test else other` after a value, if it is there."""

    @abstractmethod
    def level_here(self) -> int:
        """How tight the operator is that stands here; 0 for none."""

    def phrase(self, start: int, row: PhraseRow, *left: ast.Expression) -> ast.Phrase:
        """Read a phrase from its words on.

        Args:
            start: Where it starts.
            row: The phrase.
            left: What stands before its words.
        """
        self.move(self.index + len(row.words))
        operands: list[ast.Expression | None] = [*left]
        place = self.token.start
        for part in row.rest:
            if isinstance(part, str):
                self.expect(part, f"after {row.after}", f"write `{row.example}`")
            elif part.word and not self.comes_to(part, place, operands):
                operands.append(None)
            else:
                place = self.token.start
                operands.append(self.binary(part.level) if part.level else self.expression())
        return ast.Phrase(self.span(start), row, tuple(operands))

    def comes_to(self, part: Operand, place: int, operands: list[ast.Expression | None]) -> bool:
        """Go past the word before an operand that may be left out, if it is there.

        Before the word stands any expression; without the word, the operand before it ends where a sum ends. So where
        a looser operator follows, read on only if that leads to the word.

        Args:
            part: The operand.
            place: Where the operand before it starts.
            operands: The operands so far.
        """
        if self.text != part.word:
            before = operands[-1] if part.level else None
            if before is None or (self.text != "if" and not self.level_here()):
                return False
            wide = self.read_on(place, before, part.word)
            if wide is None:
                return False
            operands[-1] = wide
        self.advance()
        return True

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
