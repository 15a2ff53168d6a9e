"""What is raised while a behavior or monitor runs, and which `except` catches it.

Scenic raises a violation of a guard, a rejection by a requirement or where something asked for is not there, and a
failed assertion. Whatever else Python would raise is an error of the program, which no `except` hides.
"""

from __future__ import annotations

import builtins
from dataclasses import dataclass

from scenicq.compiler.environment import Environment
from scenicq.compiler.values import fail
from scenicq.errors import similar
from scenicq.syntax import ast

__all__ = ["Handler", "read_handlers", "violation"]

_BUILTIN = frozenset(
    name for name, value in vars(builtins).items() if isinstance(value, type) and issubclass(value, BaseException)
)
_ABOVE = {
    "PreconditionViolation": ("GuardViolation", "Exception", "BaseException"),
    "InvariantViolation": ("GuardViolation", "Exception", "BaseException"),
    "RejectSimulationException": ("Exception", "BaseException"),
    "RejectionException": ("Exception", "BaseException"),
    "AssertionError": ("Exception", "BaseException"),
}
"""What is raised, each with the classes that it derives from."""
_SCENIC = frozenset(("GuardViolation", *_ABOVE)) - _BUILTIN


@dataclass(frozen=True, slots=True)
class Handler:
    """An `except`.

    Attributes:
        names: The exceptions that it names; None where it catches all.
        variable: The name that what is raised gets; None for none.
        body: What it does.
    """

    names: frozenset[str] | None
    variable: str | None
    body: tuple[ast.Statement, ...]

    def catches(self, raised: str) -> bool:
        """Whether it catches what is raised: it names that, or a class that it derives from."""
        return self.names is None or not self.names.isdisjoint((raised, *_ABOVE[raised]))


def violation(guard: ast.DynamicStatement) -> str:
    """What a guard raises that does not hold."""
    return "PreconditionViolation" if guard.kind == "precondition" else "InvariantViolation"


def read_handlers(handlers: tuple[ast.ExceptHandler, ...], scope: Environment) -> tuple[Handler, ...]:
    """The handlers of a `try`, in their order.

    Raises:
        ScenarioError: unknown-name; unsupported-construct, for what is no name of an exception.
    """
    found: list[Handler] = []
    for each in handlers:
        types = each.type.items if isinstance(each.type, ast.Tuple) else (each.type,)
        names = frozenset(_name(one, scope) for one in types if one is not None)
        found.append(Handler(names if each.type is not None else None, each.name, each.body))
    return tuple(found)


def _name(node: ast.Expression, scope: Environment) -> str:
    """The name of an exception; "" for one of the program's own, which nothing raises here."""
    root = node
    while isinstance(root, ast.Attribute):
        root = root.value
    if not isinstance(root, ast.Name):
        raise fail("unsupported-construct", "this is not supported after `except`", node.span, "not a name",
                   ("write the name of an exception, or several in brackets",))  # fmt: skip
    if scope.find(root.id) is not None:
        return ""
    if root is node and root.id in _BUILTIN | _SCENIC:
        return root.id
    close = similar(root.id, _BUILTIN | _SCENIC)
    raise fail("unknown-name", f"`{root.id}` is not defined", root.span, "not found",
               (f"`{close}` has a similar name",) if close else ())  # fmt: skip
