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

from scenicq.syntax.precedence import ALONG, AT, IMPLIES, POWER, PREFIX, PRODUCT, RELATIVE, UNION, UNTIL

__all__ = [
    "ALWAYS", "BOX_PARTS", "CAN_SEE", "DEG", "DIRECTIONS", "FACING", "IMPLICATION", "INFIXES_AT", "INFIX_NAMES",
    "INFIX_WORDS", "OPERATORS", "PREFIXES_AT", "RELATION", "SPECIFIERS", "SPECIFIERS_AT", "TEMPORAL", "VECTOR",
    "VERSIONS", "Operand", "PhraseRow", "each_meaning",
]  # fmt: skip

Meaning = TypeVar("Meaning")

VERSIONS = frozenset((1, 2, 3))
_RECENT = frozenset((2, 3))
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
        level: How tight it binds, for an operator.
        words: The words that it starts with, or that stand after its left operand.
        rest: What follows them: operands and words.
        operands: All operands, in the order of the text.
        versions: The versions of Scenic that have it.
        construct: What those are told who mix versions.
        after: What stands before a word that is missing.
        example: What to write then.
        measures: `angle` or `length`, where it is one that labels tell.
    """

    text: str
    level: int
    words: tuple[str, ...]
    rest: tuple[Operand | str, ...]
    operands: tuple[Operand, ...]
    versions: frozenset[int]
    construct: str
    after: str
    example: str
    measures: str


_PART = re.compile(r"(\[(?P<word>\w+) )?\{(?P<name>\w+)(:(?P<kind>\w+))?(?P<ego>=ego)?\}\]?|(?P<plain>[\w@]+)")
_KIND = re.compile(r":\w+|=ego")


def _row(
    text: str, level: int = 0, *, versions: frozenset[int] = VERSIONS, construct: str = "", after: str = "",
    example: str = "", measures: str = "",
) -> PhraseRow:  # fmt: skip
    """A row from its text.

    The last operand of an operator is as tight as the operator, or tighter where it stands after another; before
    a further word that must be there any expression can stand, but for operators that are tight on the left, too.
    """
    parts = list(_PART.finditer(text))
    is_infix = text.startswith("{")
    last_word = max((number for number, part in enumerate(parts) if part["plain"]), default=0)
    found: list[Operand | str] = []
    for number, part in enumerate(parts):
        tight = (level if number < last_word else level + 1) if is_infix else level if number > last_word else 0
        name, kind, word = part["name"], part["kind"] or "", part["word"] or ""
        found.append(Operand(name, kind, word, bool(part["ego"]), tight) if name else part["plain"])
    rest = found[1:] if is_infix else found
    words: list[str] = []
    for part in rest:
        if isinstance(part, Operand):
            break
        words.append(part)
    operands = tuple(part for part in found if isinstance(part, Operand))
    return PhraseRow(
        _KIND.sub("", text), level, tuple(words), tuple(rest[len(words) :]), operands, versions, construct, after,
        example, measures,
    )  # fmt: skip


def _new(text: str, level: int = 0, construct: str = "", measures: str = "") -> PhraseRow:
    """A row that only Scenic 3 has."""
    return _row(text, level, versions=_NEW, construct=construct, measures=measures)


def _temporal(text: str, level: int = IMPLIES) -> PhraseRow:
    return _row(text, level, versions=_RECENT, construct="a temporal operator")


def _by_word(rows: Iterable[PhraseRow]) -> dict[str, list[PhraseRow]]:
    """The rows by their first word, those of more words first."""
    found: dict[str, list[PhraseRow]] = {}
    for row in sorted(rows, key=lambda row: -len(row.words)):
        found.setdefault(row.words[0], []).append(row)
    return found


_ALONG = "offset along direction by vector"
_DIRECTLY = "`facing directly`"

SPECIFIERS: tuple[PhraseRow, ...] = (
    _row("at {position}"),
    _row("in {region}"),
    _row("on {region}"),
    _new("contained in {region}", construct="`contained in`"),
    _row("offset by {offset}"),
    _row("offset along {direction:heading} by {offset}",
         after="the direction", example=_ALONG),
    _row("beyond {target} by {offset} [from {origin=ego}]",
         after="the position to be beyond", example="beyond position by offset"),
    _row("visible [from {viewer=ego}]"),
    _row("not visible [from {viewer=ego}]"),
    _row("left of {reference} [by {distance}]"),
    _row("right of {reference} [by {distance}]"),
    _row("ahead of {reference} [by {distance}]"),
    _row("behind {reference} [by {distance}]"),
    _new("above {reference} [by {distance}]", construct="`above`"),
    _new("below {reference} [by {distance}]", construct="`below`"),
    _row("following {field} [from {origin=ego}] for {distance:number}",
         after="the field to follow", example="following field for distance"),
    _row("facing {heading:heading}"),
    _row("facing toward {target}"),
    _row("facing away from {target}"),
    _new("facing directly toward {target}", construct=_DIRECTLY),
    _new("facing directly away from {target}", construct=_DIRECTLY),
    _row("apparently facing {heading:heading} [from {origin=ego}]"),
    _row("using {value}", level=POWER + 1),
)  # fmt: skip
"""What can follow the class of an instance, besides `with property value`."""

_CORNERS = ("front left", "front right", "back left", "back right")
BOX_PARTS = (
    "front", "back", "left", "right", *_CORNERS, "top", "bottom",
    *(f"{side} {corner}" for side in ("top", "bottom") for corner in _CORNERS),
)  # fmt: skip

OPERATORS: tuple[PhraseRow, ...] = (
    _temporal("{left} until {right}", UNTIL),
    _temporal("{left} implies {right}"),
    _temporal("always {condition}"),
    _temporal("eventually {condition}"),
    _temporal("next {condition}"),
    _row("{region} visible from {viewer}", UNION),
    _row("{region} not visible from {viewer}", UNION),
    _row("{viewer} can see {target}", UNION),
    _new("{left} intersects {right}", UNION, "`intersects`"),
    _row("{origin} offset along {direction:heading} by {offset}", ALONG, after="the direction", example=_ALONG),
    _row("{origin} offset by {offset}", RELATIVE),
    _row("{left} relative to {right}", RELATIVE),
    _row("{field} at {position}", AT),
    _row("relative position of {target} [from {origin=ego}]", PREFIX),
    _row("relative heading of {target} [from {origin=ego}]", PREFIX, measures="angle"),
    _row("apparent heading of {target} [from {origin=ego}]", PREFIX, measures="angle"),
    _row("distance to {target} [from {origin=ego}]", PREFIX, measures="length"),
    _row("distance from {origin} [to {target=ego}]", PREFIX, measures="length"),
    _new("minimum distance to {target} [from {origin=ego}]", PREFIX, "`minimum distance`", measures="length"),
    _new("minimum distance from {origin} [to {target=ego}]", PREFIX, "`minimum distance`", measures="length"),
    _row("distance past {target} [of {origin=ego}]", PREFIX, measures="length"),
    _row("angle to {target} [from {origin=ego}]", PREFIX, measures="angle"),
    _row("angle from {origin} [to {target=ego}]", PREFIX, measures="angle"),
    _row("azimuth to {target} [from {origin=ego}]", PREFIX, measures="angle"),
    _row("azimuth from {origin} [to {target=ego}]", PREFIX, measures="angle"),
    _new("altitude to {target} [from {origin=ego}]", PREFIX, "`altitude`"),
    _new("altitude from {origin} [to {target=ego}]", PREFIX, "`altitude`"),
    _row("follow {field} [from {origin=ego}] for {distance:number}", PREFIX,
         after="the field to follow", example="follow field from position for distance"),
    _row("visible {region}", PREFIX),
    _row("not visible {region}", PREFIX),
    *(
        _new(f"{part} of {{target}}", PREFIX, f"`{part} of`") if part.startswith(("top", "bottom"))
        else _row(f"{part} of {{target}}", PREFIX) for part in BOX_PARTS
    ),
    _row("{x:number} @ {y:number}", PRODUCT),
    _row("{value:number} deg", PRODUCT),
    _row("initial scenario", POWER),
)  # fmt: skip
"""Operators that Python does not have."""

_ROWS = {row.text: row for row in (*SPECIFIERS, *OPERATORS)}
FACING, DEG, VECTOR = _ROWS["facing {heading}"], _ROWS["{value} deg"], _ROWS["{x} @ {y}"]
DIRECTIONS = frozenset(row for row in OPERATORS if row.measures and row.words[0] in ("angle", "azimuth"))
"""What is a direction on the map, not a turn from one to another."""
RELATION, IMPLICATION = _ROWS["{left} relative to {right}"], _ROWS["{left} implies {right}"]
ALWAYS = _ROWS["always {condition}"]
CAN_SEE = _ROWS["{viewer} can see {target}"]
TEMPORAL = tuple(row for row in OPERATORS if row.versions is _RECENT and row is not IMPLICATION)

SPECIFIERS_AT = _by_word(SPECIFIERS)
INFIXES_AT = _by_word(row for row in OPERATORS if row.text.startswith("{"))
PREFIXES_AT = _by_word(row for row in OPERATORS if not row.text.startswith("{"))
_BETWEEN = {part if isinstance(part, str) else part.word for row in _ROWS.values() for part in row.rest} - {""}
INFIX_WORDS = frozenset("and as else for if in is or".split()) | _BETWEEN | (INFIXES_AT.keys() - PREFIXES_AT.keys())
"""Words that continue or end an expression, so that none starts there."""
INFIX_NAMES = frozenset(("can", "deg", "implies", "intersects", "offset"))
"""Those of them that a program may use as names, also where a word before them asks for an operand."""


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
