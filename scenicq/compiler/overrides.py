"""`override`: while a scenario runs, objects behave in another way."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenicq.compiler.environment import Environment
from scenicq.compiler.values import Instance, ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["find_overrides", "override"]

_MOVING = frozenset(("position", "heading", "velocity", "speed", "angularSpeed", "angularVelocity", "yaw"))
"""Properties that no statement overrides."""


def override(run: Interpreter, node: ast.Override, scope: Environment) -> None:
    """Read what a scenario overrides where it is set up.

    Raises:
        ScenarioError: unsupported-construct for other properties than behaviors; wrong-type for what is no object.
    """
    if run.timed is None or run.timed.behaviors == "ignore":
        return run.dynamic(node.kind, node.span)
    for instance, behavior, span in find_overrides(run, node, scope):
        run.timed.override(instance, behavior, span)


def find_overrides(run: Interpreter, node: ast.Override, scope: Environment) -> list[tuple[Instance, ModelValue, Span]]:
    """Find the objects whose behavior a statement overrides, each with the new one, and where it says so.

    Raises:
        ScenarioError: See `override`.
    """
    target = run.evaluate(node.target, scope)
    if not isinstance(target, Instance) or target.index is None:
        raise fail("wrong-type", "only objects can be overridden", node.target.span,
                   f"this is {describe(target)}")  # fmt: skip
    found: list[tuple[Instance, ModelValue, Span]] = []
    for each in node.specifiers:
        if not isinstance(each, ast.WithSpecifier) or each.property in _MOVING:
            raise fail("wrong-value", "properties that move an object cannot be overridden", each.span,
                       "comes from the recording", ("override its `behavior`",))  # fmt: skip
        if each.property != "behavior":
            raise fail("unsupported-construct", f"`override` of `{each.property}` is not supported", each.span,
                       "only a `behavior` is overridden here")  # fmt: skip
        found.append((target, run.evaluate(each.value, scope), each.span))
    return found
