"""Visiting all nodes below a node, without recursion."""

from __future__ import annotations

from collections.abc import Iterator

from scenicq.errors import Diagnostic, ScenarioError
from scenicq.limits import LIMITS
from scenicq.syntax import ast

__all__ = ["check_height", "children", "walk"]


_fields: dict[type[ast.SyntaxNode], tuple[str, ...]] = {}


def children(node: ast.SyntaxNode) -> Iterator[ast.SyntaxNode]:
    """The nodes that are fields of a node, in the order of the fields."""
    kind = type(node)
    names = _fields.get(kind)
    if names is None:
        names = tuple(name for name in kind.__dataclass_fields__ if name != "span" and not name.endswith("_span"))
        _fields[kind] = names
    for name in names:
        value: object = getattr(node, name)
        if isinstance(value, ast.SyntaxNode):
            yield value
        elif isinstance(value, tuple):
            for item in value:  # pyright: ignore[reportUnknownVariableType]
                if isinstance(item, ast.SyntaxNode):
                    yield item


def walk(*roots: ast.SyntaxNode) -> Iterator[ast.SyntaxNode]:
    """All nodes from the roots down, a node before what it holds, in the order of the fields."""
    stack = list(reversed(roots))
    while stack:
        node = stack.pop()
        yield node
        stack.extend(reversed(tuple(children(node))))


def check_height(roots: tuple[ast.SyntaxNode, ...]) -> None:
    """Refuse a tree that is too high, such as a sum of thousands of terms.

    Raises:
        ScenarioError: `budget-exceeded`, at the node that is too deep.
    """
    level: list[ast.SyntaxNode] = list(roots)
    height = 0
    while level:
        height += 1
        if height > LIMITS.tree_height:
            message = "the expression has too many operators or levels"
            raise ScenarioError(Diagnostic("budget-exceeded", message, level[0].span))
        level = [child for node in level for child in children(node)]
