"""Scenic's phrases, one row each: the only place that says how a phrase is written.

The parser reads a phrase off its row, `versions` which Scenic has it, the linter where angles stand; its meaning
stands under the same text in the compiler. In a row, `{name}` is an operand and `[from {name}]` one that may be left
out. `{name:kind}` says what kind of value it is, where more than the meaning needs to know: a `number`, or a `heading`,
which a number is, too. `{name=ego}` is the ego where it is left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from scenicq.syntax.precedence import POWER

__all__ = ["FACING", "SPECIFIERS", "SPECIFIERS_AT", "VERSIONS", "Operand", "PhraseRow", "each_meaning"]

Meaning = TypeVar("Meaning")

VERSIONS = frozenset((1, 2, 3))
_NEW = frozenset((3,))


@dataclass(frozen=True, slots=True, eq=False)
class Operand:
    """A place in a phrase.

    Attributes:
        name: What stands there.
        kind: `number`, `heading`, or nothing.
        word: The word that introduces what may be left out, else nothing.
        is_ego: Whether what is left out is the ego.
        level: How tight the operators in it are at least; 0 for any expression.
    """

    name: str
    kind: str
    word: str
    is_ego: bool
    level: int


@dataclass(frozen=True, slots=True, eq=False)
class PhraseRow:
    """A phrase.

    Attributes:
        text: How it is written, without kinds: its name.
        words: The words that it starts with.
        rest: What follows them: operands and words.
        versions: The versions of Scenic that have it.
        construct: What those are told who mix versions.
        after: What stands before a word that is missing.
        example: What to write then.
    """

    text: str
    words: tuple[str, ...]
    rest: tuple[Operand | str, ...]
    versions: frozenset[int]
    construct: str
    after: str
    example: str

    @property
    def operands(self) -> tuple[Operand, ...]:
        """The operands, in the order of the text."""
        return tuple(part for part in self.rest if isinstance(part, Operand))


_PART = re.compile(r"(\[(?P<word>\w+) )?\{(?P<name>\w+)(:(?P<kind>\w+))?(?P<ego>=ego)?\}\]?|(?P<plain>\w+)")
_KIND = re.compile(r":\w+|=ego")


def _specifier(text: str, *, since_3: str = "", level: int = 0, after: str = "", example: str = "") -> PhraseRow:
    parts: list[Operand | str] = []
    for found in _PART.finditer(text):
        name, kind, word = found["name"], found["kind"] or "", found["word"] or ""
        parts.append(Operand(name, kind, word, bool(found["ego"]), level) if name else found["plain"])
    count = next((number for number, part in enumerate(parts) if isinstance(part, Operand)), len(parts))
    words = tuple(part for part in parts[:count] if isinstance(part, str))
    versions = _NEW if since_3 else VERSIONS
    return PhraseRow(_KIND.sub("", text), words, tuple(parts[count:]), versions, since_3, after, example)


def _by_word(rows: Iterable[PhraseRow]) -> dict[str, list[PhraseRow]]:
    """The rows by their first word, those of more words first."""
    found: dict[str, list[PhraseRow]] = {}
    for row in sorted(rows, key=lambda row: -len(row.words)):
        found.setdefault(row.words[0], []).append(row)
    return found


_DIRECTLY = "`facing directly`"

SPECIFIERS: tuple[PhraseRow, ...] = (
    _specifier("at {position}"),
    _specifier("in {region}"),
    _specifier("on {region}"),
    _specifier("contained in {region}", since_3="`contained in`"),
    _specifier("offset by {offset}"),
    _specifier("offset along {direction:heading} by {offset}",
               after="the direction", example="offset along direction by vector"),
    _specifier("beyond {target} by {offset} [from {origin=ego}]",
               after="the position to be beyond", example="beyond position by offset"),
    _specifier("visible [from {viewer=ego}]"),
    _specifier("not visible [from {viewer=ego}]"),
    _specifier("left of {reference} [by {distance}]"),
    _specifier("right of {reference} [by {distance}]"),
    _specifier("ahead of {reference} [by {distance}]"),
    _specifier("behind {reference} [by {distance}]"),
    _specifier("above {reference} [by {distance}]", since_3="`above`"),
    _specifier("below {reference} [by {distance}]", since_3="`below`"),
    _specifier("following {field} [from {origin=ego}] for {distance:number}",
               after="the field to follow", example="following field for distance"),
    _specifier("facing {heading:heading}"),
    _specifier("facing toward {target}"),
    _specifier("facing away from {target}"),
    _specifier("facing directly toward {target}", since_3=_DIRECTLY),
    _specifier("facing directly away from {target}", since_3=_DIRECTLY),
    _specifier("apparently facing {heading:heading} [from {origin=ego}]"),
    _specifier("using {value}", level=POWER + 1),
)  # fmt: skip
"""What can follow the class of an instance, besides `with property value`."""

SPECIFIERS_AT = _by_word(SPECIFIERS)
FACING = next(row for row in SPECIFIERS if row.text == "facing {heading}")


def each_meaning(rows: Iterable[PhraseRow], meanings: Mapping[str, Meaning]) -> dict[PhraseRow, Meaning]:
    """The meaning of each row.

    Args:
        rows: The rows of a table.
        meanings: Meanings by the text of the row.

    Raises:
        ValueError: A row has no meaning, or a meaning has no row.
    """
    by_text = {row.text: row for row in rows}
    if by_text.keys() != meanings.keys():
        message = f"rows and meanings differ: {sorted(by_text.keys() ^ meanings.keys())}"
        raise ValueError(message)
    return {row: meanings[text] for text, row in by_text.items()}
