"""The map that a program names: `param map = localPath('Town05.xodr')`, read off without running the program.

A program is compiled against a map, so which one must be known before.
"""

from __future__ import annotations

from dataclasses import dataclass

from scenicq.errors import Source, Span
from scenicq.syntax import ast
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import walk

__all__ = ["NamedMap", "named_map"]


@dataclass(frozen=True, slots=True)
class NamedMap:
    """A map that a program names.

    Attributes:
        file: As the program writes it; relative to the program's folder.
        span: Where it does.
    """

    file: str
    span: Span


def named_map(source: Source, version: int | None = None) -> NamedMap | None:
    """The map that a program names last; None where it names none, or computes the name.

    Args:
        source: The program.
        version: 1, 2 or 3; inferred from the spelling if not given.

    Raises:
        ScenarioError: The text is not Scenic.
    """
    found: NamedMap | None = None
    for node in walk(*parse(source, version).body):
        if isinstance(node, ast.ParamItem) and node.name == "map":
            file = _file(node.value)
            found = None if file is None else NamedMap(file, node.value.span)
    return found


def _file(value: ast.Expression) -> str | None:
    match value:
        case ast.LiteralValue(value=str(file)):
            return file
        case ast.Call(function=ast.Name(id="localPath"), arguments=(ast.Argument(name=None, star="", value=inner),)):
            return _file(inner)
        case _:
            return None
