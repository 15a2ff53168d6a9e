"""Size and depth: an answer or one diagnostic, soon, and never a crash of the stack."""

from __future__ import annotations

import contextlib
import sys

import pytest

from scenicq.errors import ScenarioError, Source
from scenicq.limits import LIMITS
from scenicq.syntax.parser import parse

from .shape import error, module, shape

NESTED = {
    "parentheses": ("(", "1", ")"),
    "sums": ("(1 + ", "1", ")"),
    "calls": ("f(", "1", ")"),
    "named arguments": ("f(a=", "1", ")"),
    "lists": ("[", "1", "]"),
    "subscripts": ("a[", "1", "]"),
    "dictionaries": ("{1: ", "1", "}"),
}


@pytest.mark.parametrize("kind", NESTED)
def test_a_hundred_levels_of_brackets(kind: str) -> None:
    before, middle, after = NESTED[kind]
    assert len(module(f"x = {before * 100}{middle}{after * 100}").body) == 1
    assert error(f"x = {before * 101}{middle}{after * 101}").startswith("error[budget-exceeded]")


MANY = {
    "signs": "x = {}1", "not": "x = {}1", "powers": "x = {}1", "sums": "x = {}1", "lambdas": "x = {}1",
    "conditions": "x = {}1", "distances": "x = {}1", "visible": "x = {}a", "attributes": "x = a{}",
}  # fmt: skip
PIECES = {
    "signs": "-", "not": "not ", "powers": "2**", "sums": "1+", "lambdas": "lambda:", "conditions": "1 if a else ",
    "distances": "distance to ", "visible": "visible ", "attributes": ".b",
}  # fmt: skip


@pytest.mark.parametrize("kind", MANY)
@pytest.mark.parametrize("count", [1000, 20_000])
@pytest.mark.one_in(3)
def test_endless_operators(kind: str, count: int) -> None:
    message = error(MANY[kind].format(PIECES[kind] * count))
    assert message.startswith("error[budget-exceeded]")


@pytest.mark.parametrize("kind", MANY)
def test_many_operators(kind: str) -> None:
    assert len(module(MANY[kind].format(PIECES[kind] * 90)).body) == 1


@pytest.mark.parametrize("before", ["(new Car at ", "(distance to ", "(not ", "(lambda: "])
def test_brackets_around_operators(before: str) -> None:
    assert len(module(f"x = {before * 50}1{')' * 50}").body) == 1
    assert error(f"x = {before * 101}1{')' * 101}").startswith("error[budget-exceeded]")


def test_blocks() -> None:
    def blocks(count: int) -> str:
        return "".join(f"{' ' * level}if x:\n" for level in range(count)) + " " * count + "y\n"

    assert len(module(blocks(99)).body) == 1
    assert error(blocks(101)).startswith("error[budget-exceeded]: the program is nested deeper than 100 levels")


def test_little_room_on_the_stack() -> None:
    def deep(count: int) -> str:
        return error("x = " + "(" * 100 + "1" + ")" * 100) if not count else deep(count - 1)

    frames = 0
    frame = sys._getframe()
    while frame is not None:
        frames += 1
        frame = frame.f_back
    assert deep(sys.getrecursionlimit() - frames - 150).startswith("error[budget-exceeded]")


def test_a_program_that_is_too_long() -> None:
    with pytest.raises(ScenarioError) as caught:
        parse(Source("long.scenic", " " * (LIMITS.program_characters + 1)))
    assert str(caught.value) == "error[budget-exceeded]: `long.scenic` is longer than 200,000 characters"


LINES = """\
ego = new Car on roadway,
    facing Range(-15, 15) deg relative to roadDirection
require abs(relative heading of pedestrian) > 70 deg
require (distance to intersection) < 10 and distance from ego to x < 3
if a is not None:
    cars.append(section)
"""


def calls(text: str) -> int:
    """How many functions are called to parse a text, whatever else the machine does."""
    count = 0

    def step(frame: object, event: str, arg: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(step)
    try:
        with contextlib.suppress(ScenarioError):
            module(text)
    finally:
        sys.setprofile(None)
    return count


def test_a_line_takes_few_steps() -> None:
    assert calls(LINES * 50) < 2000 * len((LINES * 50).splitlines())


@pytest.mark.parametrize(
    "piece",
    ["a = 1\n", "[1,", "1 and ", "x < ", "'a' ", "f'{a}' ", "# c\n", "\n", "distance to a < 3 and ", "Car with a 1, "],
)
@pytest.mark.one_in(2)
def test_steps_grow_with_the_length(piece: str) -> None:
    count = 250
    assert calls(piece * count * 8) < 10 * calls(piece * count) + 1000


def test_operators_that_can_be_read_in_two_ways() -> None:
    text = "x = " + "distance to a < 3 and " * 12 + "r visible from b"
    assert shape(module(text).body[0]).endswith("<r visible from b>))")
    short, long = ("x = " + "distance to a < 3 and " * count + "r visible from b" for count in (50, 400))
    assert calls(long) < 10 * calls(short)
