"""What behaviors, monitors and scenarios are before they run: definitions, and calls of these.

A call makes something that runs over time: `require monitor` runs a monitor, `with behavior` and `do` a behavior, `do`
in what composes scenarios a scenario. The behaviors and actions of Scenic's libraries are known by their names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeGuard, cast

from scenicq.compiler.values import Function, ModelValue, fail
from scenicq.errors import ScenarioError, Span
from scenicq.syntax import ast

__all__ = [
    "BehaviorDefinition",
    "CoroutineCall",
    "CoroutineDefinition",
    "DelayedCall",
    "LibraryCall",
    "LibraryName",
    "MonitorDefinition",
    "ScenarioCall",
    "ScenarioDefinition",
    "ScenarioNotBegunError",
    "as_behavior",
    "beside_blocks",
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
class ScenarioDefinition(CoroutineDefinition):
    """A scenario."""

    @property
    def setup(self) -> tuple[ast.Statement, ...]:
        """What makes its objects and says what it requires."""
        body = cast("tuple[ast.Statement, ...]", self.body)
        if any(map(_is_block, body)):
            return tuple(line for each in body if _is_block(each) and each.kind == "setup" for line in each.body)
        return tuple(each for each in body if not _is_guard(each))

    @property
    def compose(self) -> tuple[ast.Statement, ...] | None:
        """What runs other scenarios; None where nothing does."""
        body = cast("tuple[ast.Statement, ...]", self.body)
        blocks = [each.body for each in body if _is_block(each) and each.kind == "compose"]
        return tuple(line for each in blocks for line in each) if blocks else None


def _is_block(node: ast.Statement) -> TypeGuard[ast.DynamicDefinition]:
    return isinstance(node, ast.DynamicDefinition) and node.kind in ("setup", "compose")


def _is_guard(node: ast.Statement) -> bool:
    return isinstance(node, ast.DynamicStatement) and node.kind in ("precondition", "invariant")


def beside_blocks(body: tuple[ast.Statement, ...]) -> list[ast.Statement]:
    """What stands in a scenario beside its blocks, where it has any: neither a condition nor a text that explains."""
    if not any(map(_is_block, body)):
        return []
    return [each for each in body if not (_is_block(each) or _is_guard(each) or _is_text(each))]


def _is_text(node: ast.Statement) -> bool:
    return isinstance(node, ast.ExpressionStatement) and isinstance(node.value, ast.LiteralValue)


class ScenarioNotBegunError(ScenarioError):
    """What a scenario makes is read before it begins."""


@dataclass(frozen=True, slots=True, eq=False)
class CoroutineCall:
    """A call of a monitor, behavior or scenario.

    Attributes:
        of: What is called.
        given: Values of its parameters.
        span: The call.
    """

    of: CoroutineDefinition
    given: Mapping[str, ModelValue]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class ScenarioCall(CoroutineCall):
    """A call of a scenario."""


@dataclass(frozen=True, slots=True, eq=False)
class DelayedCall:
    """A call of a scenario that takes what another one makes, which has not begun yet."""

    call: ast.Call


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
