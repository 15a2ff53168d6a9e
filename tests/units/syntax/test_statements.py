"""Scenic's own statements."""

from __future__ import annotations

import pytest

from scenicq.syntax import ast

from .shape import error, module, shape, statement

STATEMENTS = {
    "model scenic.domains.driving.model": "Model(scenic.domains.driving.model)",
    "param time = 12*60": "Param([ParamItem(time, (* 12 60))])",
    "param a = 1, 'b c' = 2": "Param([ParamItem(a, 1), ParamItem(b c, 2)])",
    "param a = 1,\n    b = 2": "Param([ParamItem(a, 1), ParamItem(b, 2)])",
    "require x": "Require(x)",
    "require (x) > 3": "Require((x > 3))",
    "require abs(relative heading of walker) > 70 deg": "Require((abs(<relative heading of walker>) > <70 deg>))",
    "require[0.5] car2 can see ego": "Require(<car2 can see ego>, 0.5)",
    "require x as name": "Require(x, name)",
    "require x as 'a name'": "Require(x, a name)",
    "require monitor M(3)": "RequireMonitor(M(3))",
    "require monitor > 3": "Require((monitor > 3))",
    "require not x": "Require((not x))",
    "mutate": "Mutate()",
    "mutate by 2": "Mutate(2)",
    "mutate taxi": "Mutate([taxi])",
    "mutate ego, taxi by 2": "Mutate([ego, taxi], 2)",
    "simulator S(x=1)": "Simulator(S(x=1))",
    "terminate": "DynamicStatement(terminate)",
    "terminate when x > 3": "DynamicStatement(terminate when, (x > 3))",
    "terminate after 3 seconds": "DynamicStatement(terminate after, 3, seconds)",
    "terminate simulation": "DynamicStatement(terminate simulation)",
    "terminate simulation when x": "DynamicStatement(terminate simulation, x)",
    "record x as y": "DynamicStatement(record, x, y)",
    "record initial x": "DynamicStatement(record initial, x)",
    "record final (x)": "DynamicStatement(record final, x)",
    "record x every 2 seconds after 3 steps as 'y z' to 'f'": "DynamicStatement(record, x, y z, [every, after, to])",
    "do F() until x": "Do([F()], x)",
    "do F() for 3 * x seconds": "Do([F()], (* 3 x), seconds)",
    "try:\n  wait\ninterrupt when x:\n  wait\ninterrupt when y:\n  abort": "TryInterrupt("
    "[DynamicStatement(wait)], [Interrupt(x, [DynamicStatement(wait)]), Interrupt(y, [DynamicStatement(abort)])])",
    "do choose {A(): 1, B(): 2}": "Do([Dict([DictItem(A(), 1), DictItem(B(), 2)])], choose)",
    "do shuffle A(), B()": "Do([A(), B()], shuffle)",
    "take A(), B()": "Take([A(), B()])",
    "wait": "DynamicStatement(wait)",
    "wait for 3 seconds": "DynamicStatement(wait for, 3, seconds)",
    "wait until x": "DynamicStatement(wait until, x)",
    "terminate when x as y": "DynamicStatement(terminate when, x)",
    "abort": "DynamicStatement(abort)",
    "invoke A()": "Do([A()])",
    "override ego with behavior B(),\n  with x 1": "Override(ego, [With(behavior, B()), With(x, 1)])",
    "try:\n  do A()\ninterrupt when x:\n  do B()\nexcept E:\n  abort": "TryInterrupt([Do([A()])], "
    "[Interrupt(x, [Do([B()])])], [ExceptHandler(E, [DynamicStatement(abort)])])",
}


@pytest.mark.parametrize("text", STATEMENTS)
def test_statement(text: str) -> None:
    first, second = module(f"{text}\nafter = 1\n").body
    assert shape(first) == STATEMENTS[text]
    assert first.span.text == text
    assert shape(second) == "Assign([after], 1)"


DEFINITIONS = {
    "behavior B(a, b=2):": ("behavior", "B", "    while True:\n        take A()\n\n    # end\n"),
    "monitor M:": ("monitor", "M", "    wait\n"),
    "monitor M():": ("monitor", "M", "    if x:\n      abort\n"),
    "scenario S(a):": ("scenario", "S", "  precondition: x\n  setup:\n    ego = Car\n  compose:\n    do T()\n"),
    "scenario S:": ("scenario", "S", "  ego = Car\n"),
    "setup:": ("setup", "", "  ego = Car\n"),
    "compose:": ("compose", "", "  do A()\n"),
}


@pytest.mark.parametrize("header", DEFINITIONS)
def test_definition_of_what_happens_over_time(header: str) -> None:
    kind, name, body = DEFINITIONS[header]
    first, second = module(f"{header}\n{body}after = 1\n").body
    assert isinstance(first, ast.DynamicDefinition)
    assert (first.kind, first.name) == (kind, name)
    assert first.span.text == header
    assert shape(second) == "Assign([after], 1)"


def test_bodies_of_behaviors_are_read() -> None:
    (behavior,) = module(
        "behavior B(a, b=2):\n  precondition: a > 3\n  invariant: b\n  while True:\n    take A(), B()\n"
    ).body
    assert isinstance(behavior, ast.DynamicDefinition)
    assert shape(behavior.body) == (
        "[DynamicStatement(precondition, (a > 3)), DynamicStatement(invariant, b), While(True, [Take([A(), B()])])]"
    )


def test_guards_are_names_elsewhere() -> None:
    assert shape(statement("invariant: int = 3")) == "AnnotatedAssign(invariant, int, 3)"


def test_names_of_params_have_places() -> None:
    node = statement("param 'a b' = 1")
    assert isinstance(node, ast.Param)
    assert node.items[0].name_span.text == "'a b'"
    model = statement("model a.b")
    assert isinstance(model, ast.Model)
    assert model.name_span.text == "a.b"


@pytest.mark.parametrize(
    ("text", "message"),
    {
        "param x": "`=` is missing after the name of the parameter",
        "param x = ": "an expression is missing",
        "require x as": "the name of the requirement is missing",
        "require[] x": "an index is missing between the brackets",
        "require x y": "`y` does not continue the statement",
        "mutate by": "an expression is missing",
        "behavior B()": "`:` is missing after the header of the behavior",
    }.items(),
)
def test_incomplete_statement(text: str, message: str) -> None:
    assert message in error(text)
