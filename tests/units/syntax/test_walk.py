"""Visiting trees."""

from __future__ import annotations

from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import children, walk

from .shape import expression, module, shape


def test_children_are_in_the_order_of_the_fields() -> None:
    assert [shape(child) for child in children(expression("f(a, b=c)"))] == ["f", "a", "b=c"]
    assert [shape(child) for child in children(expression("a if b else c"))] == ["b", "a", "c"]


def test_walk_visits_a_node_before_what_it_holds() -> None:
    body = module("x = f(a + b)\nif x:\n    y\n").body
    names = [node.id for node in walk(*body) if isinstance(node, ast.Name)]
    assert names == ["x", "f", "a", "b", "x", "y"]


def test_walk_needs_no_stack() -> None:
    node: ast.Expression = expression("x")
    for _ in range(5000):
        node = ast.Phrase(node.span, phrases.DEG, (node,))
    assert sum(1 for _ in walk(node)) == 5001
