"""`break`, `continue` and `return` stand where there is something to leave."""

from __future__ import annotations

from collections.abc import Iterable

from scenicq.errors import Diagnostic, ScenarioError
from scenicq.syntax import ast

__all__ = ["check_jumps"]


def check_jumps(body: Iterable[ast.Statement]) -> None:
    """Refuse a jump out of nothing: a function does not leave its caller's loop, nor a program itself.

    Raises:
        ScenarioError: `parse-error`, at the jump.
    """
    stack = [(statement, False, False) for statement in body]
    while stack:
        node, in_loop, in_function = stack.pop()
        match node:
            case ast.Break() | ast.Continue() if not in_loop:
                raise _outside(node, "a loop")
            case ast.Return() if not in_function:
                raise _outside(node, "a function")
            case ast.For() | ast.While():
                stack += [(inner, True, in_function) for inner in node.body]
                stack += [(inner, in_loop, in_function) for inner in node.orelse]
            case ast.If():
                inside = [inner for branch in node.branches for inner in branch.body]
                stack += [(inner, in_loop, in_function) for inner in (*inside, *node.orelse)]
            case ast.FunctionDef():
                stack += [(inner, False, True) for inner in node.body]
            case ast.ClassDef():
                stack += [(inner, False, False) for inner in node.body]
            case _:
                pass


def _outside(node: ast.Statement, place: str) -> ScenarioError:
    word = node.span.text.split()[0]
    return ScenarioError(Diagnostic("parse-error", f"`{word}` stands outside of {place}", node.span, "leaves nothing"))
