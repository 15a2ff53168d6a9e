"""Numbers and strings have the values that Python gives them."""

from __future__ import annotations

import ast as python_ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.syntax import ast

from .shape import error, expression, shape

NUMBERS = ["0", "00", "12", "1_000", "0x_fF", "0o17", "0b101", "1.", ".5", "1.5e3", "1E-3", "1_0.2_5", "3j", "0.5J"]


@pytest.mark.parametrize("text", NUMBERS)
def test_number(text: str) -> None:
    node = expression(text)
    assert isinstance(node, ast.LiteralValue)
    expected = python_ast.literal_eval(text)
    assert (type(node.value), node.value) == (type(expected), expected)


STRINGS = [
    "'a'", '"b"', "'''a\nb'''", '"""a"b"""', "''", '""""""', r"'\n\t\\\'\x41\u00e9\U0001F600\101'",
    "r'\\n'", "R\"\\\"\"", "u'x'", "b'ab\\xff'", "rb'\\x'", "Br'\\\\'", "'a' \"b\" r'\\c'", "'a\\\nb'", r"'\N{BULLET}'",
    r"'\q'", r"b'\u0041'", "'\\\r\nb'", "'''a\r\nb'''",
]  # fmt: skip


@pytest.mark.parametrize("text", STRINGS)
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
def test_string(text: str) -> None:
    node = expression(text)
    assert isinstance(node, ast.LiteralValue)
    assert node.value == python_ast.literal_eval(text)
    assert node.span.text == text


@given(st.text() | st.binary())
def test_any_string_that_python_writes(value: str | bytes) -> None:
    node = expression(repr(value))
    assert isinstance(node, ast.LiteralValue)
    assert node.value == value


FORMATTED = {
    "f'a{b}c'": "FormattedString(['a', Replacement(b), 'c'])",
    "f'{{{a}}}'": "FormattedString(['{', Replacement(a), '}'])",
    "f'{a + 1!r:>{w}.2f}'": "FormattedString([Replacement((+ a 1), r, FormattedString(['>', Replacement(w), '.2f']))])",
    "f'{a=}'": "FormattedString(['a=', Replacement(a, r)])",
    "f'{a = :3}'": "FormattedString(['a =', Replacement(a, FormattedString(['3']))])",
    "f'{d[\"k\"]}'": "FormattedString([Replacement(Subscript(d, 'k'))])",
    "f'{a != b}'": "FormattedString([Replacement((a != b))])",
    "f'{ {1: 2}[1] }'": "FormattedString([Replacement(Subscript(Dict([DictItem(1, 2)]), 1))])",
    "f'{a, b}'": "FormattedString([Replacement(Tuple([a, b]))])",
    "f'{1 deg}'": "FormattedString([Replacement(<1 deg>)])",
    "'x' f'{a}' 'y'": "FormattedString(['x', Replacement(a), 'y'])",
    "rf'\\d{a}'": "FormattedString(['\\\\d', Replacement(a)])",
    "f'\\N{BULLET}{a}'": "FormattedString(['\u2022', Replacement(a)])",
    "f'''{\na\n}'''": "FormattedString([Replacement(a)])",
}


@pytest.mark.parametrize("text", FORMATTED)
def test_formatted_string(text: str) -> None:
    node = expression(text)
    assert shape(node) == FORMATTED[text]
    assert node.span.text == text


def test_places_inside_formatted_strings() -> None:
    node = expression("f'ab{x.y}'")
    assert isinstance(node, ast.FormattedString)
    replacement = node.parts[1]
    assert isinstance(replacement, ast.Replacement)
    assert replacement.span.text == "{x.y}"
    assert replacement.value.span.text == "x.y"


@pytest.mark.parametrize(
    ("text", "message"),
    {
        "f'{'": "`{` of the formatted string is never closed",
        "f'{a'": "`{` of the formatted string is never closed",
        "f'}'": "`}` closes no `{` of the formatted string",
        "f'{}'": "the braces of the formatted string hold no expression",
        "f'{a!x}'": "a conversion is `!r`, `!s` or `!a`",
        "f'{a b}'": "`b` does not continue the expression",
        "f'{a:{b:{c}}}'": "fields are nested too deeply",
        "'\\x1'": "the escape sequence `\\x` is not complete",
        "'\\N{no such}'": "no character is called `no such`",
        "'\\Uffffffff'": "no character has such a number",
        "b'\u00e9'": "bytes hold ASCII characters only",
        "'a' b'b'": "strings and bytes stand side by side",
        "'a": "the string is not closed",
        "'''a": "the string is not closed",
        "0777": "hint: write `777`",
        "5deg": "hint: write `5 deg`",
        "1__0": "a number runs into what follows it",
        "9" * 5000: "a number has more than 4000 digits",
    }.items(),
)
def test_bad_literal(text: str, message: str) -> None:
    assert message in error(f"_ = {text}")
