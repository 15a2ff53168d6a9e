"""What behaviors and monitors are before they run: definitions, and calls of these.

A call makes something that runs over time: `require monitor` runs a monitor, `with behavior` and `do` a behavior. The
behaviors and actions of Scenic's libraries are known by their names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenicq.compiler.values import Function, ModelValue, fail
from scenicq.errors import Span
from scenicq.syntax import ast

__all__ = [
    "BehaviorDefinition", "CoroutineCall", "CoroutineDefinition", "LibraryCall", "LibraryName", "MonitorDefinition",
    "as_behavior",
]  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class CoroutineDefinition(Function):
    """A behavior or a monitor of the program."""

    def guards(self, *kinds: str) -> tuple[ast.DynamicStatement, ...]:
        """Its preconditions, invariants, or both."""
        body = self.body if isinstance(self.body, tuple) else ()
        return tuple(each for each in body if isinstance(each, ast.DynamicStatement) and each.kind in kinds)


@dataclass(frozen=True, slots=True, eq=False)
class MonitorDefinition(CoroutineDefinition):
    """A monitor: a call of it is only required."""


@dataclass(frozen=True, slots=True, eq=False)
class BehaviorDefinition(CoroutineDefinition):
    """A behavior."""


@dataclass(frozen=True, slots=True, eq=False)
class CoroutineCall:
    """A call of a monitor or behavior.

    Attributes:
        of: What is called.
        given: Values of its parameters.
        span: The call.
    """

    of: CoroutineDefinition
    given: Mapping[str, ModelValue]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class LibraryName:
    """A behavior or action of Scenic's libraries, or an action of the program's own Python.

    Attributes:
        name: Its name.
        is_action: Whether it is an action.
    """

    name: str
    is_action: bool


@dataclass(frozen=True, slots=True, eq=False)
class LibraryCall:
    """A call of one.

    Attributes:
        of: What is called.
        positional, named: The arguments.
        span: The call.
    """

    of: LibraryName
    positional: tuple[ModelValue, ...]
    named: Mapping[str, ModelValue]
    span: Span


def as_behavior(value: ModelValue, span: Span) -> ModelValue:
    """What a value runs as the behavior of an object: a call, or None; of what can be called alone, the call.

    Raises:
        ScenarioError: wrong-type; wrong-arity, where it needs arguments.
    """
    match value:
        case BehaviorDefinition():
            missing = [
                each.name for each in value.parameters if each.name not in value.defaults and each.kind[0] != "*"
            ]
            if missing:
                raise fail("wrong-arity", f"`{value.name}` needs a value for `{missing[0]}`", span, "called here")
            return CoroutineCall(value, dict(value.defaults), span)
        case LibraryName(is_action=False):
            return LibraryCall(value, (), {}, span)
        case _:
            return value
