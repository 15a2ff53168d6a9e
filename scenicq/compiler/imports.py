"""Import statements: which names they bring in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from difflib import get_close_matches
from typing import TypeAlias

from scenicq.compiler.environment import FIRST_LIBRARIES, Environment
from scenicq.compiler.values import Module, fail
from scenicq.errors import Span
from scenicq.syntax import ast
from scenicq.syntax.walk import walk

__all__ = ["Load", "import_into", "named_modules"]

Load: TypeAlias = Callable[[str, int, Span], Module]
"""Resolves a module: its dotted name, the number of leading dots, the place."""


def named_modules(module: ast.Program) -> Iterator[tuple[str, int]]:
    """The modules that a program names, each with the number of leading dots."""
    for node in walk(*module.body):
        match node:
            case ast.Model():
                yield node.name, 0
            case ast.Import():
                yield from ((alias.path, 0) for alias in node.aliases)
            case ast.ImportFrom():
                yield node.module, node.level
            case _:
                pass


def import_into(node: ast.Import | ast.ImportFrom | ast.Model, scope: Environment, load: Load, version: int) -> None:
    """Run an `import`, `from ... import` or `model` statement.

    Args:
        node: The statement.
        scope: Takes the names.
        load: Resolves a module by its dotted name, the number of leading dots and the place.
        version: The version of Scenic.

    Raises:
        ScenarioError: unknown-model, unknown-name.
    """
    match node:
        case ast.Model():
            scope.names.update(load(node.name, 0, node.name_span).names)
        case ast.Import():
            for alias in node.aliases:
                _import_module(alias, scope, load, version)
        case ast.ImportFrom():
            module = load(node.module, node.level, node.span)
            for alias in node.aliases:
                if alias.path == "*":
                    scope.names.update(module.names)
                elif module.dynamic or alias.path in module.names:
                    scope.set(alias.name or alias.path, module.names.get(alias.path))
                else:
                    close = get_close_matches(alias.path, sorted(module.names), 1, 0.75)
                    raise fail("unknown-name", f"`{node.module}` has no `{alias.path}`", alias.span, "not found",
                               tuple(f"it has `{name}`" for name in close))  # fmt: skip


def _import_module(alias: ast.ImportAlias, scope: Environment, load: Load, version: int) -> None:
    module = load(alias.path, 0, alias.span)
    if alias.name or "." not in alias.path:
        scope.set(alias.name or alias.path, module)
        if version == 1 and not alias.name and module.name in FIRST_LIBRARIES:
            # the 2019 paper's `import gtaLib` gives the names themselves
            scope.names.update(module.names)
        return
    first, *rest = alias.path.split(".")
    for part in reversed(rest):
        module = Module(alias.path, {part: module})
    held = scope.names.get(first)
    merged = _merged(held, module) if isinstance(held, Module) else module
    scope.set(first, merged)


def _merged(one: Module, other: Module) -> Module:
    """A package that holds the modules of both."""
    names = dict(one.names)
    for name, value in other.names.items():
        held = names.get(name)
        names[name] = _merged(held, value) if isinstance(held, Module) and isinstance(value, Module) else value
    return Module(one.name, names)
