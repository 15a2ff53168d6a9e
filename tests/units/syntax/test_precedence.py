"""Which operator binds tighter: as in the grammar of Scenic 3, checked against its parser when this was written."""

from __future__ import annotations

import pytest

from .shape import error, expression, shape, statement

CASES = {
    # Python's own
    "1 + 2 * 3": "(+ 1 (* 2 3))",
    "a - b - c": "(- (- a b) c)",
    "-x ** 2": "(- (** x 2))",
    "2 ** -x": "(** 2 (- x))",
    "2 ** 3 ** 4": "(** 2 (** 3 4))",
    "a // b % c": "(% (// a b) c)",
    "a << 1 + b": "(<< a (+ 1 b))",
    "a | b ^ c & d": "(| a (^ b (& c d)))",
    "not a == b": "(not (a == b))",
    "not a and b or c": "(or (and (not a) b) c)",
    "a < b <= c is not d not in e": "(a < b <= c is not d not in e)",
    "a if b else c if d else e": "IfElse(b, a, IfElse(d, c, e))",
    "lambda x, *y, z=1, **k: x + y": "Lambda([Parameter(x, positional), Parameter(y, *), "
    "Parameter(z, keyword-only, 1), Parameter(k, **)], (+ x y))",
    "- + ~ x": "(- (+ (~ x)))",
    # degrees and vectors bind like products
    "-5 deg": "<(- 5) deg>",
    "2 * x deg": "<(* 2 x) deg>",
    "x deg + y": "(+ <x deg> y)",
    "a + 1 @ 2": "(+ a <1 @ 2>)",
    "1 @ -2": "<1 @ (- 2)>",
    "2 * a @ b": "<(* 2 a) @ b>",
    "Range(-15, 15) deg relative to roadDirection": "<<Range((- 15), 15) deg> relative to roadDirection>",
    "Uniform(1, -1) * Range(90, 180) deg relative to roadDirection": (
        "<<(* Uniform(1, (- 1)) Range(90, 180)) deg> relative to roadDirection>"
    ),
    "-1 * Range(50, 135) deg relative to ego.heading": "<<(* (- 1) Range(50, 135)) deg> relative to ego.heading>",
    # fields, offsets, relations
    "roadDirection at 1 @ 2": "<roadDirection at <1 @ 2>>",
    "f at x + y": "<f at (+ x y)>",
    "f at x relative to g at y": "<<f at x> relative to <g at y>>",
    "a relative to b relative to c": "<<a relative to b> relative to c>",
    "a offset by b relative to c": "<<a offset by b> relative to c>",
    "a offset along b by c offset by d": "<a offset along b by <c offset by d>>",
    "a offset along b relative to c by d": "<a offset along <b relative to c> by d>",
    "a relative to b visible from c": "<<a relative to b> visible from c>",
    "a not visible from b": "<a not visible from b>",
    "a can see b < c": "(<a can see b> < c)",
    "a can see b and c": "(and <a can see b> c)",
    "a intersects b": "<a intersects b>",
    "x is in r": "(x in r)",
    "x in r and y": "(and (x in r) y)",
    # operators that start with words take a sum
    "distance from ego to intersection < 10": "(<distance from ego to intersection> < 10)",
    "distance to a + 1 < 3": "(<distance to (+ a 1)> < 3)",
    "distance to a from b": "<distance to a from b>",
    "distance to a and b from c": "<distance to (and a b) from c>",
    "distance to a < 3 and r visible from b": "(and (<distance to a> < 3) <r visible from b>)",
    "distance from a": "<distance from a>",
    "distance from a relative to b to c": "<distance from <a relative to b> to c>",
    "distance from a relative to b": "<<distance from a> relative to b>",
    "distance past a of b": "<distance past a of b>",
    "distance past a": "<distance past a>",
    "abs((angle to goal) - (angle to bottleneck)) <= 10 deg": (
        "(abs((- <angle to goal> <angle to bottleneck>)) <= <10 deg>)"
    ),
    "angle from a to b": "<angle from a to b>",
    "angle from a": "<angle from a>",
    "azimuth to b": "<azimuth to b>",
    "altitude from a to b": "<altitude from a to b>",
    "relative heading of a > 70 deg": "(<relative heading of a> > <70 deg>)",
    "relative heading of a from b > 1": "(<relative heading of a from b> > 1)",
    "relative heading of a relative to b from c": "<relative heading of <a relative to b> from c>",
    "relative heading of a relative to b": "<<relative heading of a> relative to b>",
    "relative position of a from b": "<relative position of a from b>",
    "apparent heading of a from b": "<apparent heading of a from b>",
    "visible road visible from x": "<<visible road> visible from x>",
    "not visible road": "<not visible road>",
    "not visible": "(not visible)",
    "visible not visible road": "<visible <not visible road>>",
    "front of car offset by x": "<<front of car> offset by x>",
    "back left of visible x": "<back left of <visible x>>",
    "follow f from front of car for 3 < x": "(<follow f from <front of car> for 3> < x)",
    "follow f for x": "<follow f for x>",
    "follow (a).f from b for 1": "<follow a.f from b for 1>",
    "initial scenario": "<initial scenario>",
    # an instance reaches as far as an expression does
    "new Car at a if b else c": "New(Car, [<at IfElse(b, a, c)>], True)",
    "-new Car": "(- New(Car, True))",
    "[new Car, visible road]": "List([New(Car, True), <visible road>])",
    "(new Car at x, facing y).z": "New(Car, [<at x>, <facing y>], True).z",
}


@pytest.mark.parametrize("text", CASES)
def test_precedence(text: str) -> None:
    assert shape(expression(text)) == CASES[text]


PARTS = [
    *("front", "back", "left", "right", "top", "bottom", "front left", "front right", "back left", "back right"),
    *(f"{a} {b} {c}" for a in ("top", "bottom") for b in ("front", "back") for c in ("left", "right")),
]


@pytest.mark.parametrize("part", PARTS)
def test_parts_of_a_box(part: str) -> None:
    assert shape(expression(f"{part} of x")) == f"<{part} of x>"


@pytest.mark.parametrize(
    ("text", "expected"),
    {
        "always x": "<always x>",
        "always x and y": "<always (and x y)>",
        "eventually (x and always y)": "<eventually (and x <always y>)>",
        "(always x) implies y": "<<always x> implies y>",
        "next (x)": "<next x>",
        "x until y": "<x until y>",
        "not always x or y": "(not <always (or x y)>)",
        "f(next(x)) > 1": "(f(next(x)) > 1)",
    }.items(),
)
def test_temporal_operators_in_requirements(text: str, expected: str) -> None:
    assert shape(statement(f"require {text}")) == f"Require({expected})"


@pytest.mark.parametrize("word", ["always", "eventually", "next"])
@pytest.mark.parametrize("place", ["{}", "not {}", "y and {}", "y or {}", "y implies {}", "y until {}", "({})"])
@pytest.mark.parametrize(
    "operand", ["x", "1", "'x'", "-x", "+x", "~x", "-1 < 3", "(x)", "[x][0]", "{1: x}[1]", "not x", "f(x)", "x.y[0]"]
)
def test_temporal_operators_before_whatever_begins_an_operand(word: str, place: str, operand: str) -> None:
    inner = shape(expression(operand))
    assert f"<{word} {inner}>" in shape(statement(f"require {place.format(f'{word} {operand}')}"))


def test_temporal_words_are_functions_and_variables_elsewhere() -> None:
    assert shape(expression("next(x) + always(y)")) == "(+ next(x) always(y))"
    for text in ("y > always(x)", "y > always - 1", "y in always[0]", "y + next[0] > 1"):
        assert "Temporal" not in shape(statement(f"require {text}"))


@pytest.mark.parametrize("text", ["1 + distance to x", "-angle to x", "2 * front of x", "x ** visible y"])
def test_word_operators_inside_tighter_ones_need_parentheses(text: str) -> None:
    assert "needs parentheses here" in error(f"_ = {text}")


def test_parentheses_are_not_nodes_but_part_of_what_is_around() -> None:
    node = expression("(a) + (b)")
    assert node.span.text == "(a) + (b)"
    assert shape(expression("((a))")) == "a"
    assert expression("((a))").span.text == "a"
