"""The Python subset: expressions and statements."""

from __future__ import annotations

import pytest

from scenicq.syntax import ast

from .shape import error, expression, module, shape, spans, statement

EXPRESSIONS = {
    "()": "Tuple()",
    "(a,)": "Tuple([a])",
    "a, b": "Tuple([a, b])",
    "a,": "Tuple([a])",
    "[]": "List()",
    "[a, *b,]": "List([a, Starred(b)])",
    "{}": "Dict()",
    "{a}": "Set([a])",
    "{a, *b}": "Set([a, Starred(b)])",
    "{a: 1, **b}": "Dict([DictItem(a, 1), DictItem(b)])",
    "{**b, a: 1,}": "Dict([DictItem(b), DictItem(a, 1)])",
    "[x for x in y]": "Comprehension(list, x, [Clause(x, y)])",
    "{x for x in y}": "Comprehension(set, x, [Clause(x, y)])",
    "(x for x in y)": "Comprehension(generator, x, [Clause(x, y)])",
    "{x: 1 for x, z in y}": "DictComprehension(x, 1, [Clause(Tuple([x, z]), y)])",
    "[x for x in y if a if b for z in x]": "Comprehension(list, x, [Clause(x, y, [a, b]), Clause(z, x)])",
    "f()": "f()",
    "f(a, *b, c=1, **d)": "f(a, *b, c=1, **d)",
    "f(x for x in y)": "f(Comprehension(generator, x, [Clause(x, y)]))",
    "f(a := 1)": "f(Walrus(a, 1))",
    "a.b.c(1)[2]": "Subscript(a.b.c(1), 2)",
    "a[1:2]": "Subscript(a, SubscriptSlice(1, 2))",
    "a[::2]": "Subscript(a, SubscriptSlice(2))",
    "a[1:, :2, 3]": "Subscript(a, Tuple([SubscriptSlice(1), SubscriptSlice(2), 3]))",
    "a[*b]": "Subscript(a, Starred(b))",
    "(a := 1)": "Walrus(a, 1)",
    "...": "Ellipsis",
    "None is not True": "(None is not True)",
    "await x": "UnsupportedExpression(await)",
    "yield x, y": "UnsupportedExpression(yield)",
    "lambda: 1": "Lambda(1)",
}


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_expression(text: str) -> None:
    node = expression(text)
    assert shape(node) == EXPRESSIONS[text]
    if text != "(a := 1)":
        assert node.span.text == text


STATEMENTS = {
    "a = b = 1": "Assign([a, b], 1)",
    "a, (b, *c) = d": "Assign([Tuple([a, Tuple([b, Starred(c)])])], d)",
    "a.b[1] = 2": "Assign([Subscript(a.b, 1)], 2)",
    "a += 1": "AugmentedAssign(a, +, 1)",
    "a @= 1": "AugmentedAssign(a, @, 1)",
    "a.b //= 1, 2": "AugmentedAssign(a.b, //, Tuple([1, 2]))",
    "a: int = 1": "AnnotatedAssign(a, int, 1)",
    "a: int": "AnnotatedAssign(a, int)",
    "pass": "Pass()",
    "if a: b": "If([Branch(a, [b])])",
    "if a: b\nelif c: d\nelse: e": "If([Branch(a, [b]), Branch(c, [d])], [e])",
    "if a:\n  b\n  c\nelse:\n  d": "If([Branch(a, [b, c])], [d])",
    "if (a := b): pass": "If([Branch(Walrus(a, b), [Pass()])])",
    "for a, b in c, d: e\nelse: f": "For(Tuple([a, b]), Tuple([c, d]), [e], [f])",
    "for X in cars:\n  break": "For(X, cars, [Break()])",
    "while a:\n  continue\nelse:\n  b": "While(a, [Continue()], [b])",
    "def f(): pass": "FunctionDef(f, [Pass()])",
    "def f(a, b: int = 1, /, c=2, *d, e, **g) -> int:\n  return a": (
        "FunctionDef(f, [Parameter(a, positional-only), Parameter(b, positional-only, int, 1), "
        "Parameter(c, positional, 2), Parameter(d, *), Parameter(e, keyword-only), Parameter(g, **)], int, "
        "[Return(a)])"
    ),
    "def f(a, *, b): return": "FunctionDef(f, [Parameter(a, positional), Parameter(b, keyword-only)], [Return()])",
    "@a.b(1)\ndef f(): pass": "FunctionDef(f, [Pass()], [a.b(1)])",
    "@a\n@b\nclass C: pass": "ClassDef(C, [Pass()], [a, b])",
    "del a, b[1]": "Delete([a, Subscript(b, 1)])",
    "assert a, 'text'": "Assert(a, 'text')",
    "raise": "Raise()",
    "raise A(1) from b": "Raise(A(1), b)",
    "try: a\nexcept B as c: d\nexcept (E, F): g\nexcept: h\nelse: i\nfinally: j": (
        "Try([a], [ExceptHandler(B, c, [d]), ExceptHandler(Tuple([E, F]), [g]), ExceptHandler([h])], [i], [j])"
    ),
    "try: a\nfinally: b": "Try([a], [b])",
    "with a as b, c: d": "WithStatement([WithItem(a, b), WithItem(c)], [d])",
    "with (a as b, c): d": "WithStatement([WithItem(a, b), WithItem(c)], [d])",
    "with (a).b: c": "WithStatement([WithItem(a.b)], [c])",
    "import a.b as c, d": "Import([ImportAlias(a.b, c), ImportAlias(d)])",
    "from a.b import c as d, e": "ImportFrom(a.b, 0, [ImportAlias(c, d), ImportAlias(e)])",
    "from a import *": "ImportFrom(a, 0, [ImportAlias(*)])",
    "from ...a import (b,\n  c,)": "ImportFrom(a, 3, [ImportAlias(b), ImportAlias(c)])",
    "from . import a": "ImportFrom(1, [ImportAlias(a)])",
    "global a, b": "Global([a, b])",
    "nonlocal a": "Nonlocal([a])",
    "match x:\n  case 1:\n    y": "UnsupportedStatement(match)",
    "async def f():\n  await x": "UnsupportedStatement(async)",
    "match(x)": "match(x)",
    "match = 3": "Assign([match], 3)",
}


@pytest.mark.parametrize("text", STATEMENTS)
def test_statement(text: str) -> None:
    node = statement(text)
    assert shape(node) == STATEMENTS[text]
    if not text.startswith("@"):
        assert node.span.text == text


CLASSES = {
    "class Car: pass": "ClassDef(Car, [Pass()])",
    "class Car(Object):\n    width: self.model.width\n    position: Point on road\n": (
        "ClassDef(Car, [Object], [PropertyDefault(width, self.model.width), "
        "PropertyDefault(position, New(Point, [<on road>], False))])"
    ),
    "class C:\n  a[additive]: 1\n  b[dynamic, final]: 2\n  def f(self): return self.a[1]\n  x[0] = 3\n": (
        "ClassDef(C, [PropertyDefault(a, [additive], 1), PropertyDefault(b, [dynamic, final], 2), "
        "FunctionDef(f, [Parameter(self, positional)], [Return(Subscript(self.a, 1))]), "
        "Assign([Subscript(x, 0)], 3)])"
    ),
    "class C:\n  heading: (roadDirection at self.position) \\\n    + self.roadDeviation\n  behavior: None\n": (
        "ClassDef(C, [PropertyDefault(heading, (+ <roadDirection at self.position> self.roadDeviation)), "
        "PropertyDefault(behavior, None)])"
    ),
    "constructor Car(Vehicle):\n  a: 1\n": "ClassDef(Car, [Vehicle], [PropertyDefault(a, 1)])",
}


@pytest.mark.parametrize("text", CLASSES)
def test_class(text: str) -> None:
    assert shape(statement(text)) == CLASSES[text]


def test_statements_on_one_line() -> None:
    assert [shape(node) for node in module("a = 1; b = 2;\nif a: b; c\n").body] == [
        "Assign([a], 1)",
        "Assign([b], 2)",
        "If([Branch(a, [b, c])])",
    ]


def test_comments_blank_lines_and_joined_lines() -> None:
    text = "# first\n\na = 1 + \\\n  2  # rest\n\n   # indented comment\nb = [1,\n# inside\n  2]\n\t\n"
    assert [shape(node) for node in module(text).body] == ["Assign([a], (+ 1 2))", "Assign([b], List([1, 2]))"]


def test_a_block_that_ends_with_the_text() -> None:
    assert shape(statement("if a:\n  if b:\n    c")) == "If([Branch(a, [If([Branch(b, [c])])])])"


def test_soft_words_are_names_where_they_start_nothing() -> None:
    words = "at by visible position road model param require mutate new following facing on offset to take do wait"
    words += " record terminate setup compose distance angle front left follow deg can until behavior monitor abort"
    for word in words.split():
        assert shape(statement(f"{word} = 1")) == f"Assign([{word}], 1)"
        assert shape(statement(f"x.{word}({word}=2)")) == f"x.{word}({word}=2)"


def test_names_of_attributes_and_functions_have_places() -> None:
    node = expression("a.bcd")
    assert isinstance(node, ast.Attribute)
    assert node.name_span.text == "bcd"
    function = statement("def go(): pass")
    assert isinstance(function, ast.FunctionDef)
    assert function.name_span.text == "go"
    assert spans("f(a, b=2, *c)", ast.Argument) == ["a", "b=2", "*c"]
    assert spans("{a: 1, (b): 2, **c}", ast.DictItem) == ["a: 1", "(b): 2", "**c"]


@pytest.mark.parametrize(
    "text", ["1 = 2", "a + b = 1", "f() = 1", "(a, 1) = b", "for 1 in a: b", "[x for f() in y]", "a, b += 1"]
)
def test_what_cannot_be_assigned_to(text: str) -> None:
    assert "only a name, an attribute or an element can be" in error(text)
