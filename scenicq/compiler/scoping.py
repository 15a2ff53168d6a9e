"""Which names belong to a function: those that it gives a value anywhere, as in Python."""

from __future__ import annotations

from scenicq.syntax import ast
from scenicq.syntax.walk import children

__all__ = ["bound_names", "own_names"]


def own_names(body: tuple[ast.Statement, ...]) -> frozenset[str]:
    """The names that statements bind in their own scope, not counting functions and classes inside."""
    found, shared = _names(body)
    return frozenset(found - shared)


def bound_names(body: tuple[ast.Statement, ...]) -> frozenset[str]:
    """The names that statements bind in their own scope or in one that they share."""
    return frozenset(_names(body)[0])


def _names(body: tuple[ast.Statement, ...]) -> tuple[set[str], set[str]]:
    """The names that statements bind, and those that they share."""
    found: set[str] = set()
    shared: set[str] = set()
    stack: list[ast.SyntaxNode] = list(body)
    while stack:
        node = stack.pop()
        match node:
            case ast.FunctionDef() | ast.ClassDef():
                found.add(node.name)
                continue
            case ast.Lambda():
                continue
            case ast.Global() | ast.Nonlocal():
                shared.update(name.id for name in node.names)
            case ast.Assign():
                found.update(name for target in node.targets for name in _targets(target))
            case ast.AugmentedAssign() | ast.AnnotatedAssign() | ast.For() | ast.Walrus():
                found.update(_targets(node.target))
            case ast.Import() | ast.ImportFrom():
                found.update(alias.name or alias.path.split(".")[0] for alias in node.aliases)
            case _:
                pass
        stack.extend(children(node))
    return found, shared


def _targets(target: ast.Expression) -> list[str]:
    """The names that an assignment to a target binds."""
    stack, names = [target], list[str]()
    while stack:
        part = stack.pop()
        match part:
            case ast.Name():
                names.append(part.id)
            case ast.Tuple() | ast.List():
                stack.extend(part.items)
            case ast.Starred():
                stack.append(part.value)
            case _:
                pass
    return names
