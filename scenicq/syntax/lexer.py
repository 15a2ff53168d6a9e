"""Text to tokens: indentation, line joining, brackets, comments.

A line joins the next one inside brackets, after a backslash, and after a comma that ends it where the next line is
indented further (Scenic's way of writing a list of specifiers; in Python such a line is always an error).
"""

from __future__ import annotations

import re

from scenicq.errors import Diagnostic, Note, ScenarioError, Source, Span
from scenicq.limits import LIMITS
from scenicq.syntax.hints import unit_hint
from scenicq.syntax.tokens import CLOSERS, KEYWORDS, Token, TokenKind

__all__ = ["tokenize", "tokenize_part"]


_TOKEN = re.compile(
    r"""
      (?P<space>[ \t\f]+)
    | (?P<comment>\#[^\r\n]*)
    | (?P<newline>\r\n|\r|\n)
    | (?P<joined>\\(?:\r\n|\r|\n))
    | (?P<string>(?i:rb|br|fr|rf|r|u|b|f)?
        (?: \"\"\"(?:[^\\]|\\.)*?\"\"\" | '''(?:[^\\]|\\.)*?'''
          | "(?!"")(?:[^"\\\r\n]|\\\r\n|\\.)*" | '(?!'')(?:[^'\\\r\n]|\\\r\n|\\.)*' ))
    | (?P<name>[^\W\d]\w*)
    | (?P<number>
        0[xX](?:_?[0-9a-fA-F])+ | 0[oO](?:_?[0-7])+ | 0[bB](?:_?[01])+
      | (?: [0-9](?:_?[0-9])*\.(?:[0-9](?:_?[0-9])*)? | \.[0-9](?:_?[0-9])* | [0-9](?:_?[0-9])* )
        (?:[eE][+-]?[0-9](?:_?[0-9])*)? [jJ]?)
    | (?P<operator>\*\*=|//=|<<=|>>=|\.\.\.|:=|->|==|!=|<=|>=|\+=|-=|\*=|/=|%=|@=|&=|\|=|\^=|\*\*|//|<<|>>
        |[-+*/%@&|^~<>()\[\]{},:.;=!])
    """,
    re.VERBOSE | re.DOTALL,
)
_INDENTATION = re.compile(r"[ \t\f]*")
_BLANK_LINES = re.compile(r"(?:[ \t\f]*(?:#[^\r\n]*)?(?:\r\n|\r|\n))*")
_LOOKALIKES = {
    "\u2013": "-", "\u2014": "-", "\u2212": "-", "\u00d7": "*", "\u00b7": "*", "\u2264": "<=", "\u2265": ">=",
    "\u2260": "!=", "\u201c": '"', "\u201d": '"', "\u2018": "'", "\u2019": "'", "\u00a0": " ", "\u00b0": " deg",
}  # fmt: skip


def tokenize(source: Source) -> list[Token]:
    """Split a whole text; the last token is `end`.

    Raises:
        ScenarioError: `parse-error` for what is no token, unbalanced brackets and indentation that fits no block,
            `budget-exceeded` for brackets or blocks nested deeper than `LIMITS.bracket_nesting`.
    """
    return _Lexer(source, 0, len(source.text), whole=True).run()


def tokenize_part(source: Source, start: int, end: int) -> list[Token]:
    """Split a range of a text that holds one expression, where line ends mean nothing; the last token is `end`."""
    return _Lexer(source, start, end, whole=False).run()


class _Lexer:
    def __init__(self, source: Source, start: int, end: int, *, whole: bool) -> None:
        self.source = source
        self.text = source.text
        self.position = start
        self.end = end
        self.whole = whole
        self.tokens: list[Token] = []
        self.brackets: list[tuple[str, int]] = []
        self.indents: list[tuple[int, int]] = [(0, 0)]

    def run(self) -> list[Token]:
        if self.whole:
            if self.text.startswith("\ufeff"):
                self.position = 1
            self.start_line()
        tokens, text, end, match = self.tokens, self.text, self.end, _TOKEN.match
        while self.position < end:
            found = match(text, self.position, end)
            if found is None:
                raise self.stray()
            kind = found.lastgroup
            start, self.position = found.span()
            if kind == "space" or kind == "comment" or kind == "joined":
                continue
            if kind == "newline":
                self.newline(start)
                continue
            word = found.group()
            if kind == "name":
                tokens.append(Token("keyword" if word in KEYWORDS else "name", word, start, self.position))
            elif kind == "operator":
                self.operator(word, start)
            elif kind == "number":
                self.number(word, start)
            else:
                tokens.append(Token("string", word, start, self.position))
        self.finish()
        return tokens

    def add(self, kind: TokenKind, start: int, end: int) -> None:
        self.tokens.append(Token(kind, "", start, end))

    def fail(self, message: str, start: int, end: int, label: str = "", hint: str = "") -> ScenarioError:
        span = Span(self.source, start, end)
        return ScenarioError(Diagnostic("parse-error", message, span, label, hints=(hint,) if hint else ()))

    def too_deep(self, start: int, end: int) -> ScenarioError:
        message = f"the program is nested deeper than {LIMITS.bracket_nesting} levels"
        return ScenarioError(Diagnostic("budget-exceeded", message, Span(self.source, start, end)))

    def newline(self, start: int) -> None:
        if self.brackets or not self.whole:
            return
        if self.tokens and self.tokens[-1].text == ",":
            blank = _BLANK_LINES.match(self.text, self.position)
            after = blank.end() if blank else self.position
            if after < self.end and self.measure(after)[0] > self.indents[-1][0]:
                self.position = after
                return
        self.add("newline", start, self.position)
        self.start_line()

    def measure(self, position: int) -> tuple[int, int, int]:
        """Width of the indentation with tabs to multiples of 8, the same with tabs of width 1, and where it ends."""
        found = _INDENTATION.match(self.text, position)
        end = found.end() if found else position
        wide = narrow = 0
        for character in self.text[position:end]:
            if character == "\f":
                wide = narrow = 0
                continue
            wide = wide + 8 - wide % 8 if character == "\t" else wide + 1
            narrow += 1
        return wide, narrow, end

    def start_line(self) -> None:
        """Skip lines without tokens, then open or close blocks."""
        blank = _BLANK_LINES.match(self.text, self.position)
        begin = blank.end() if blank else self.position
        wide, narrow, end = self.measure(begin)
        self.position = end
        if end >= self.end or self.text[end] == "#":
            return
        top = self.indents[-1]
        if wide > top[0]:
            if narrow <= top[1]:
                raise self.tabs(begin, end)
            if len(self.indents) > LIMITS.bracket_nesting:
                raise self.too_deep(begin, end)
            self.indents.append((wide, narrow))
            self.add("indent", begin, end)
            return
        while wide < self.indents[-1][0]:
            self.indents.pop()
            self.add("dedent", end, end)
        if wide != self.indents[-1][0]:
            raise self.fail("the indentation fits no open block", begin, end, "no line above starts a block here")
        if narrow != self.indents[-1][1]:
            raise self.tabs(begin, end)

    def tabs(self, start: int, end: int) -> ScenarioError:
        message = "the indentation mixes tabs and spaces in a way that depends on the width of a tab"
        return self.fail(message, start, end, hint="indent with spaces only")

    def number(self, word: str, start: int) -> None:
        end = self.position
        following = self.text[end : end + 1] if end < self.end else ""
        if following.isalnum() or following == "_":
            stop = end
            while stop < self.end and (self.text[stop].isalnum() or self.text[stop] == "_"):
                stop += 1
            unit = self.text[end:stop]
            hint = unit_hint(word, unit) or (f"write `{word} {unit}`" if following.isalpha() else "")
            raise self.fail("a number runs into what follows it", start, stop, hint=hint)
        if len(word) > 1 and word[0] == "0" and word.replace("_", "").isdigit() and word.strip("0_"):
            hint = f"write `{word.lstrip('0_')}`"
            raise self.fail("a whole number does not start with 0", start, end, hint=hint)
        self.tokens.append(Token("number", word, start, end))

    def operator(self, word: str, start: int) -> None:
        if word in CLOSERS:
            if len(self.brackets) >= LIMITS.bracket_nesting:
                raise self.too_deep(start, self.position)
            self.brackets.append((word, start))
        elif word in (")", "]", "}"):
            if not self.brackets:
                raise self.fail(f"`{word}` closes nothing", start, self.position, "no bracket is open here")
            opener, place = self.brackets.pop()
            if CLOSERS[opener] != word:
                note = Note(Span(self.source, place, place + 1), f"this needs `{CLOSERS[opener]}`")
                span = Span(self.source, start, self.position)
                message = f"`{word}` does not close `{opener}`"
                raise ScenarioError(Diagnostic("parse-error", message, span, notes=(note,)))
        elif word == "!":
            raise self.fail("`!` is not an operator", start, self.position, hint="write `not`")
        self.tokens.append(Token("operator", word, start, self.position))

    def stray(self) -> ScenarioError:
        start = self.position
        character = self.text[start]
        if character in "\"'":
            triple = self.text[start : start + 3] == character * 3
            line = self.text.find("\n", start, self.end)
            end = start + 3 if triple else self.end if line < 0 else line
            return self.fail("the string is not closed", start, end, f"no closing `{character * (3 if triple else 1)}`")
        if character == "\\":
            message = "a backslash stands before something other than the end of the line"
            return self.fail(message, start, start + 1, hint="nothing may follow it, not even a space")
        name = f"`{character}`" if character.isprintable() and not character.isspace() else f"U+{ord(character):04X}"
        other = _LOOKALIKES.get(character, "")
        hint = f"write `{other}`" if other.strip() else "write a space" if other else ""
        return self.fail(f"the character {name} has no meaning here", start, start + 1, hint=hint)

    def finish(self) -> None:
        if self.brackets:
            opener, place = self.brackets[-1]
            raise self.fail(f"`{opener}` is never closed", place, place + 1, f"`{CLOSERS[opener]}` is missing")
        if self.whole:
            if self.tokens and self.tokens[-1].kind not in ("newline", "dedent"):
                self.add("newline", self.end, self.end)
            for _ in self.indents[1:]:
                self.add("dedent", self.end, self.end)
        self.add("end", self.end, self.end)
