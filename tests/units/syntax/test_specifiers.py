"""Instances and every specifier, in the spellings of the versions."""

from __future__ import annotations

import pytest

from scenicq.syntax import ast

from .shape import error, expression, module, shape, spans, statement

SPECIFIERS = {
    "with width 3": "With(width, 3)",
    "with behavior Follow(speed=3)": "With(behavior, Follow(speed=3))",
    "with at 3": "With(at, 3)",
    "at (1, 2)": "<at Tuple([1, 2])>",
    "at (front of c) offset by (x @ y)": "<at <<front of c> offset by <x @ y>>>",
    "in road": "<in road>",
    "on visible curb": "<on <visible curb>>",
    "contained in road": "<contained in road>",
    "offset by -1 @ 2": "<offset by <(- 1) @ 2>>",
    "offset along 30 deg by (1, 2)": "<offset along <30 deg> by Tuple([1, 2])>",
    "beyond c by 1 @ 2": "<beyond c by <1 @ 2>>",
    "beyond c by 3 from ego": "<beyond c by 3 from ego>",
    "visible": "<visible>",
    "visible from x": "<visible from x>",
    "not visible": "<not visible>",
    "not visible from x": "<not visible from x>",
    "left of spot": "<left of spot>",
    "left of spot by 0.5": "<left of spot by 0.5>",
    "right of spot by x": "<right of spot by x>",
    "ahead of ego by (1, 2)": "<ahead of ego by Tuple([1, 2])>",
    "behind ego": "<behind ego>",
    "above ego by 2": "<above ego by 2>",
    "below ego": "<below ego>",
    "following f for 3": "<following f for 3>",
    "following f from x for 3": "<following f from x for 3>",
    "facing 30 deg relative to roadDirection": "<facing <<30 deg> relative to roadDirection>>",
    "facing (1, 2, 3)": "<facing Tuple([1, 2, 3])>",
    "facing toward ego": "<facing toward ego>",
    "facing directly toward ego": "<facing directly toward ego>",
    "facing away from ego": "<facing away from ego>",
    "facing directly away from ego": "<facing directly away from ego>",
    "facing toward": "<facing toward>",
    "apparently facing 3 deg": "<apparently facing <3 deg>>",
    "apparently facing 3 from x": "<apparently facing 3 from x>",
    "using f(1, x=2)": "<using f(1, x=2)>",
}


@pytest.mark.parametrize("text", SPECIFIERS)
def test_specifier(text: str) -> None:
    node = expression(f"new Car {text}")
    assert isinstance(node, ast.New)
    (specifier,) = node.specifiers
    assert shape(specifier) == SPECIFIERS[text]
    assert specifier.span.text == text
    assert node.span.text == f"new Car {text}"


SCENIC_3_ONLY = ("contained in", "above", "below", "facing directly")


@pytest.mark.parametrize("text", [text for text in SPECIFIERS if not text.startswith(SCENIC_3_ONLY)])
def test_specifier_without_new(text: str) -> None:
    node = expression(f"Car {text}")
    assert isinstance(node, ast.New)
    assert not node.keyword
    assert shape(node.specifiers[0]) == SPECIFIERS[text]
    assert node.span.text == f"Car {text}"


@pytest.mark.parametrize("text", ["with a 1", "facing 3", "left of x", "on road", "visible", "beyond x by 2"])
def test_lower_case_class_before_a_specifier_that_continues_no_expression(text: str) -> None:
    assert isinstance(expression(f"rover {text}"), ast.New)


def test_words_that_are_operators_after_values_and_specifiers_after_classes() -> None:
    assert shape(expression("roadDirection at x")) == "<roadDirection at x>"
    assert shape(expression("spot offset by x")) == "<spot offset by x>"
    assert shape(expression("road visible from x")) == "<road visible from x>"
    assert shape(expression("x in road")) == "(x in road)"
    assert shape(expression("Car at x")) == "New(Car, [<at x>], False)"
    assert shape(expression("lib.Car offset by x")) == "New(lib.Car, [<offset by x>], False)"
    assert shape(expression("ORIGIN offset by x")) == "<ORIGIN offset by x>"


def test_names_that_the_program_assigns_are_values_and_those_it_defines_are_classes() -> None:
    body = module("Field = f()\nx = Field at y\nclass thing: pass\nz = thing at y\n").body
    assert shape(body[1]) == "Assign([x], <Field at y>)"
    assert shape(body[3]) == "Assign([z], New(thing, [<at y>], False))"


def test_a_name_before_in_is_a_value_where_new_is_used() -> None:
    assert shape(expression("[new Car, Car in classes]")) == "List([New(Car, True), (Car in classes)])"


def test_several_specifiers_on_one_line() -> None:
    node = expression("Car left of spot by 0.5, facing badAngle relative to roadDirection, with model BUS")
    assert shape(node) == (
        "New(Car, [<left of spot by 0.5>, <facing <badAngle relative to roadDirection>>, With(model, BUS)], False)"
    )


LINES = [
    "ego = new Car at x,\n    facing 3 deg,\n    with a 1\nnext_one = 2\n",
    "ego = new Car at x,\n    facing 3 deg,\n    with a 1,\nnext_one = 2\n",
    "ego = new Car at x, \\\n  facing 3 deg, \\\n  with a 1\nnext_one = 2\n",
    "ego = new Car at x,  # first\n\n      # alone\n    facing 3 deg,\n  with a 1\nnext_one = 2",
    "ego = (new Car at x,\nfacing 3 deg,\nwith a 1)\nnext_one = 2",
    "ego = new Car at x,\r\n    facing 3 deg,\r\n    with a 1\r\nnext_one = 2\r\n",
    "ego = new Car,\n    at x,\n    facing 3 deg,\n    with a 1\nnext_one = 2\n",
    "ego = new Car,  # first\n\n      # alone\n    at x, facing 3 deg,\n    with a 1,\nnext_one = 2\n",
    "ego = new Car,\r\n    at x,\r\n    facing 3 deg,\r\n    with a 1\r\nnext_one = 2\r\n",
]


@pytest.mark.parametrize("text", LINES)
def test_specifiers_on_several_lines(text: str) -> None:
    first, second = module(text).body
    assert shape(first) == "Assign([ego], New(Car, [<at x>, <facing <3 deg>>, With(a, 1)], True))"
    assert shape(second) == "Assign([next_one], 2)"


@pytest.mark.parametrize("first", ["at x,", ",\n        at x,"])
def test_specifiers_on_several_lines_inside_a_block(first: str) -> None:
    node = statement(f"for i in f(a):\n    new Car {first}\n        facing y\n    b\n")
    assert shape(node) == "For(i, f(a), [New(Car, [<at x>, <facing y>], True), b])"


@pytest.mark.parametrize(
    "text", ["new Car, with a 1", "new Car, \\\n  with a 1", "(new Car,\n  with a 1)", "f(b, [new Car,\n  with a 1])"]
)
def test_a_comma_after_the_class_is_of_the_instance_only_at_the_end_of_a_line_outside_brackets(text: str) -> None:
    assert error(f"x = {text}\n").startswith("error[parse-error]")


def test_the_span_of_an_instance_ends_before_a_trailing_comma() -> None:
    assert spans("new Car at x,\n  facing y,\n", ast.New) == ["new Car at x,\n  facing y"]


def test_an_instance_in_a_tuple_or_an_argument_leaves_the_comma() -> None:
    assert shape(expression("Car at 1 @ 2, Car at 3 @ 4")).startswith("Tuple([New(Car, [<at <1 @ 2>>], False), New")
    assert shape(expression("f(new Car at x, y)")) == "f(New(Car, [<at x>], True), y)"
    assert shape(expression("f(new Car at x, behind=3)")) == "f(New(Car, [<at x>], True), behind=3)"


def test_a_class_without_specifiers() -> None:
    assert shape(expression("Car")) == "Car"
    assert shape(expression("new Car")) == "New(Car, True)"
    assert shape(expression("new lib.Car")) == "New(lib.Car, True)"


def test_misspelt_specifiers() -> None:
    assert error("x = new Car facng 3 deg") == (
        "error[unknown-specifier]: no specifier starts with `facng`\n"
        " --> test.scenic:1:13\n"
        "  |\n"
        "1 | x = new Car facng 3 deg\n"
        "  |             ^^^^^ \n".replace(" \n", "\n")
        + "  = hint: `facing` is spelled similarly"
    )
    assert "error[unknown-specifier]: no specifier starts with `fcing`" in error("Car at x, fcing 3")
    assert "error[unknown-specifier]: no specifier starts with `wit`" in error("Car at x, wit width 3")
    assert "hint: `beyond` is spelled similarly" in error("Car beyon x by 3")


@pytest.mark.parametrize(
    ("text", "message"),
    {
        "Car beyond x": "`by` is missing after the position to be beyond",
        "Car following f": "`for` is missing after the field to follow",
        "Car offset along x": "`by` is missing after the direction",
        "Car with": "the name of the property is missing",
        "Car with 3": "the name of the property is missing",
        "Car with width": "an expression is missing",
        "Car at": "an expression is missing",
        "Car left x": "`left` alone starts no specifier",
        "Car apparently x": "hint: write `apparently facing`",
    }.items(),
)
def test_incomplete_specifiers(text: str, message: str) -> None:
    assert message in error(text)
