"""The table of phrases: each row is read as it is written, has one meaning, and nothing else has one."""

from __future__ import annotations

import re
from itertools import product

import pytest

from scenicq.syntax import ast
from scenicq.syntax.phrases import OPERATORS, SPECIFIERS, PhraseRow, each_meaning
from scenicq.syntax.walk import walk

from .shape import error, module

OPTIONAL = re.compile(r" ?\[(\w+ \{\w+\})\]")


def written(row: PhraseRow) -> list[tuple[str, tuple[str | None, ...]]]:
    """The texts of a row, with and without what may be left out, and the names of the operands in each."""
    found: list[tuple[str, tuple[str | None, ...]]] = []
    for kept in product((True, False), repeat=len(OPTIONAL.findall(row.text))):
        places = iter(kept)
        text = OPTIONAL.sub(lambda part, places=places: f" {part[1]}" if next(places) else "", row.text)
        left = [name for name in re.findall(r"\{(\w+)\}", row.text) if f"{{{name}}}" in text]
        names = re.findall(r"\{(\w+)\}", row.text)
        found.append((text.replace("{", "a_").replace("}", ""), tuple(f"a_{n}" if n in left else None for n in names)))
    return found


def check(row: PhraseRow, *programs: str) -> None:
    """Each text of the row is a phrase of it wherever it stands, with these operands."""
    for text, names in written(row):
        for program in programs:
            body = module(program.format(text)).body
            (phrase,) = [each for each in walk(*body) if ast.is_phrase(each, row)]
            assert phrase.span.text == text
            assert tuple(each and each.span.text for each in phrase.operands) == names


@pytest.mark.parametrize("row", SPECIFIERS, ids=lambda row: row.text)
def test_each_specifier_is_read_as_it_is_written(row: PhraseRow) -> None:
    check(row, "x = new Car {}", "x = f(new Car with b 1, {}, with a 1)")


@pytest.mark.parametrize("row", OPERATORS, ids=lambda row: row.text)
def test_each_operator_is_read_as_it_is_written(row: PhraseRow) -> None:
    check(row, "require {}", "require ({}) and not ({{y: ()}})", "require ({}) < 2 or z")


def test_each_row_has_exactly_one_meaning() -> None:
    meanings = {row.text: row.words for row in SPECIFIERS}
    assert each_meaning(SPECIFIERS, meanings) == {row: row.words for row in SPECIFIERS}
    with pytest.raises(ValueError, match=r"differ: \['behind \{reference\} \[by \{distance\}\]'\]"):
        each_meaning(SPECIFIERS, {text: meanings[text] for text in meanings if not text.startswith("behind")})
    with pytest.raises(ValueError, match=r"differ: \['near'\]"):
        each_meaning(SPECIFIERS, {**meanings, "near": ()})


def test_no_word_is_passed_over_in_silence() -> None:
    assert "`toward` does not continue the statement" in error("x = new Car facing directly toward")
    assert "`away` does not continue the statement" in error("x = new Car facing directly away")
