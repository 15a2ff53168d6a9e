"""The parser's position among the tokens: look ahead, move on, and fail with a diagnostic."""

from __future__ import annotations

from scenicq.errors import Diagnostic, Note, ScenarioError, Source, Span
from scenicq.limits import LIMITS
from scenicq.syntax.tokens import CLOSERS, Token

__all__ = ["Cursor"]


class Cursor:
    """A position in a list of tokens.

    Attributes:
        source: The text.
        tokens: Its tokens, the last one of kind `end`.
        index: Which token is next.
        token: The next token.
        text: The next token's text.
        depth: How deep the parser is, at most `LIMITS.expression_nesting`.
    """

    def __init__(self, source: Source, tokens: list[Token]) -> None:
        """Start at the first token."""
        self.source = source
        self.tokens = tokens
        self.index = 0
        self.token = tokens[0]
        self.text = self.token.text
        self.depth: int = 0

    def move(self, index: int) -> None:
        """Go to a token, forwards or back."""
        self.index = index
        self.token = self.tokens[index]
        self.text = self.token.text

    def advance(self) -> Token:
        """Go past the next token and return it."""
        token = self.token
        if token.kind != "end":
            self.index += 1
            self.token = self.tokens[self.index]
            self.text = self.token.text
        return token

    def peek(self, ahead: int = 1) -> Token:
        """A token after the next one."""
        return self.tokens[min(self.index + ahead, len(self.tokens) - 1)]

    def at(self, *texts: str) -> bool:
        """Whether the next token reads like one of these."""
        return self.text in texts

    def reads(self, index: int, words: tuple[str, ...]) -> bool:
        """Whether the tokens from an index on read like these words."""
        return all(self.tokens[index + ahead].text == word for ahead, word in enumerate(words))

    def accept(self, text: str) -> bool:
        """Go past the next token if it reads so."""
        if self.text != text:
            return False
        self.advance()
        return True

    def expect(self, text: str, where: str, hint: str = "") -> Token:
        """Go past the next token, which must read so; `where` says after what."""
        if self.text != text:
            raise self.fail(f"`{text}` is missing {where}", label=self.found(), hint=hint)
        return self.advance()

    def name(self, what: str) -> Token:
        """Go past the next token, which must be a name; `what` says the name of what."""
        if self.token.kind == "keyword":
            raise self.fail(f"`{self.text}` cannot be {what}", label="this word is reserved")
        if self.token.kind != "name":
            raise self.fail(f"{what} is missing", label=self.found())
        return self.advance()

    def closing(self, opening: int) -> int:
        """Index of the bracket that closes the one at the index."""
        depth = 0
        for index in range(opening, len(self.tokens)):
            text = self.tokens[index].text
            if text in CLOSERS:
                depth += 1
            elif text in (")", "]", "}"):
                depth -= 1
                if not depth:
                    return index
        return len(self.tokens) - 1

    def at_line_end(self) -> bool:
        """Whether the statement could end here."""
        return self.token.kind in ("newline", "end", "dedent") or self.text == ";"

    def last_end(self) -> int:
        """Offset after the last token that was passed and has text."""
        index = self.index - 1
        while index > 0 and not self.tokens[index].text:
            index -= 1
        return self.tokens[index].end if index >= 0 else 0

    def span(self, start: int) -> Span:
        """From an offset to the end of the last token that was passed."""
        return Span(self.source, start, max(start, self.last_end()))

    def token_span(self, token: Token) -> Span:
        """The place of a token."""
        return Span(self.source, token.start, token.end)

    def found(self) -> str:
        """What stands at this place, in words."""
        match self.token.kind:
            case "newline" | "dedent":
                return "the line ends here"
            case "end":
                return "the text ends here"
            case "indent":
                return "an indented block starts here"
            case _:
                return f"found `{self.text}`" if len(self.text) < 40 and "\n" not in self.text else "found this"

    def here(self) -> Span:
        """The place of the next token; at the end of a line, right after what stands on it."""
        if self.token.text or self.token.kind == "indent":
            return self.token_span(self.token)
        end = self.last_end()
        return Span(self.source, end, end)

    def fail(
        self,
        message: str,
        span: Span | None = None,
        *,
        label: str = "",
        hint: str = "",
        notes: tuple[Note, ...] = (),
        code: str = "parse-error",
    ) -> ScenarioError:
        """The error to raise, about the next token unless another place is given."""
        hints = (hint,) if hint else ()
        return ScenarioError(Diagnostic(code, message, span or self.here(), label, notes, hints))

    def enter(self) -> None:
        """Count one more level of nesting; the caller takes it off `depth` again."""
        self.depth += 1
        if self.depth > LIMITS.expression_nesting:
            raise self.fail("the expression is nested too deeply", code="budget-exceeded")
