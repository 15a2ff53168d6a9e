"""Whatever the text, the answer is a tree or a `ScenarioError` with one diagnostic inside the text."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from scenicq.errors import ScenarioError, Source
from scenicq.syntax import ast
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import children, walk

WORDS = [
    "new",
    "Car",
    "ego",
    "x",
    "y",
    "1",
    "2.5",
    "'a'",
    "f'{x}'",
    "f'{'",
    "+",
    "-",
    "*",
    "/",
    "**",
    "@",
    "=",
    "==",
    "<",
    ":=",
    "->",
    "...",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    ";",
    ".",
    "!",
    "\\",
    "#",
    "not",
    "and",
    "or",
    "in",
    "is",
    "if",
    "elif",
    "else",
    "for",
    "while",
    "def",
    "class",
    "lambda",
    "return",
    "del",
    "try",
    "except",
    "finally",
    "with",
    "as",
    "import",
    "from",
    "global",
    "yield",
    "await",
    "async",
    "match",
    "case",
    "at",
    "by",
    "on",
    "to",
    "of",
    "from",
    "deg",
    "relative",
    "offset",
    "along",
    "visible",
    "can",
    "see",
    "intersects",
    "distance",
    "angle",
    "altitude",
    "heading",
    "position",
    "apparent",
    "apparently",
    "facing",
    "toward",
    "away",
    "directly",
    "beyond",
    "behind",
    "above",
    "below",
    "left",
    "right",
    "front",
    "back",
    "top",
    "ahead",
    "following",
    "follow",
    "using",
    "contained",
    "with",
    "require",
    "param",
    "model",
    "mutate",
    "record",
    "terminate",
    "when",
    "do",
    "until",
    "take",
    "wait",
    "abort",
    "override",
    "behavior",
    "monitor",
    "scenario",
    "setup",
    "compose",
    "interrupt",
    "always",
    "eventually",
    "next",
    "implies",
    "initial",
    "simulator",
]
SPACES = ["\n", "\n    ", "\n        ", "\t", " "]


def check_problem(problem: ScenarioError, text: str) -> None:
    (diagnostic,) = problem.diagnostics
    assert diagnostic.span is not None
    assert 0 <= diagnostic.span.start <= diagnostic.span.end <= len(text)
    assert str(problem)


def check(text: str, version: int | None = None) -> None:
    source = Source("soup.scenic", text)
    try:
        module = parse(source, version)
    except ScenarioError as problem:
        check_problem(problem, text)
        return
    for node in walk(*module.body):
        assert 0 <= node.span.start <= node.span.end <= len(text)
        for child in children(node):
            assert node.span.start <= child.span.start
            # the span of a behavior or monitor is that of its header
            assert child.span.end <= node.span.end or isinstance(node, ast.DynamicDefinition)


@given(st.lists(st.sampled_from(WORDS + SPACES), max_size=40).map(" ".join), st.sampled_from([None, 1, 2, 3]))
@settings(max_examples=600, deadline=None)
def test_words_in_any_order(text: str, version: int | None) -> None:
    check(text, version)


@given(st.text(max_size=60))
@settings(max_examples=300, deadline=None)
def test_any_text(text: str) -> None:
    check(text)


PROGRAM = """\
model scenic.domains.driving.model
param time = 12 * 60, 'weather' = f'{x!r:>3}'
ego = new Car on road,
    facing Range(-15, 15) deg relative to roadDirection,
    with behavior Follow(speed=3)
def f(a, *b, c=1, **d):
    return [x for x in a if x is not None]
class C(Object):
    a[additive]: 3
behavior B():
    do A() until x
require[0.5] (distance from ego to front of x) < 3 and relative heading of a from b > 3 deg
"""


@given(st.integers(0, len(PROGRAM)), st.integers(0, 12), st.sampled_from(["", " ", *WORDS]))
@settings(max_examples=600, deadline=None)
def test_a_program_with_one_piece_replaced(start: int, length: int, piece: str) -> None:
    check(PROGRAM[:start] + piece + PROGRAM[start + length :])
