"""Syntax trees as short text, and the shortest ways to get one."""

from __future__ import annotations

import re

import pytest

from scenicq.errors import ScenarioError, Source, render
from scenicq.syntax import ast
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import walk

_PLACE = r"( )\[(\w+ )\{\w+\}\]|\{\w+\}"
"""An operand of a phrase, with the word before one that may be left out."""


def module(text: str, version: int | None = None) -> ast.Program:
    return parse(Source("test.scenic", text), version)


def statement(text: str, version: int | None = None) -> ast.Statement:
    (only,) = module(text, version).body
    return only


def expression(text: str, version: int | None = None) -> ast.Expression:
    """The expression that is the text, read on the right of an assignment."""
    node = statement(f"_ = {text}", version)
    assert isinstance(node, ast.Assign)
    return node.value


def error(text: str, version: int | None = None) -> str:
    """The message that the text leads to."""
    with pytest.raises(ScenarioError) as caught:
        module(text, version)
    (diagnostic,) = caught.value.diagnostics
    return render(diagnostic)


def shape(value: object) -> str:
    """`<x deg>` for `x deg`; operators of arithmetic in prefix form; places, None and empty fields left out."""
    match value:
        case ast.Name():
            return value.id
        case ast.LiteralValue():
            return repr(value.value)
        case ast.BinaryOp():
            return f"({value.operator} {shape(value.left)} {shape(value.right)})"
        case ast.UnaryOp():
            return f"({value.operator} {shape(value.operand)})"
        case ast.BoolOp():
            return f"({value.operator} {' '.join(shape(item) for item in value.values)})"
        case ast.ComparisonChain():
            rest = " ".join(f"{item.operator} {shape(item.right)}" for item in value.comparisons)
            return f"({shape(value.left)} {rest})"
        case ast.Attribute():
            return f"{shape(value.value)}.{value.name}"
        case ast.Argument():
            name = f"{value.name}=" if value.name else value.star
            return f"{name}{shape(value.value)}"
        case ast.Call():
            return f"{shape(value.function)}({', '.join(shape(item) for item in value.arguments)})"
        case ast.ExpressionStatement():
            return shape(value.value)
        case ast.Phrase():
            operands = iter(value.operands)

            def fill(place: re.Match[str]) -> str:
                operand = next(operands)
                return "" if operand is None else (place[1] or "") + (place[2] or "") + shape(operand)

            return f"<{re.sub(_PLACE, fill, value.row.text)}>"
        case ast.SyntaxNode():
            names = [name for name in value.__dataclass_fields__ if name != "span" and not name.endswith("_span")]
            fields = [getattr(value, name) for name in names]
            shown = ", ".join(shape(field) for field in fields if field not in (None, (), ""))
            return f"{type(value).__name__.removesuffix('Specifier')}({shown})"
        case tuple():
            return f"[{', '.join(shape(item) for item in value)}]"  # pyright: ignore[reportUnknownVariableType]
        case _:
            return str(value)


def spans(text: str, kind: type[ast.SyntaxNode], version: int | None = None) -> list[str]:
    """The texts of all nodes of a kind, in the order of the walk."""
    return [node.span.text for node in walk(*module(text, version).body) if isinstance(node, kind)]
