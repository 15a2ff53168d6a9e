"""Python's statements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from scenicq.errors import Span
from scenicq.syntax.nodes.base import SyntaxNode
from scenicq.syntax.nodes.expressions import Argument, Name, Parameter

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression, Statement

__all__ = [
    "AnnotatedAssign",
    "Assert",
    "Assign",
    "AugmentedAssign",
    "Branch",
    "Break",
    "ClassDef",
    "Continue",
    "Delete",
    "ExceptHandler",
    "ExpressionStatement",
    "For",
    "FunctionDef",
    "Global",
    "If",
    "Import",
    "ImportAlias",
    "ImportFrom",
    "Nonlocal",
    "Pass",
    "PropertyDefault",
    "Raise",
    "Return",
    "Try",
    "UnsupportedStatement",
    "While",
    "WithItem",
    "WithStatement",
]


@dataclass(frozen=True, slots=True, eq=False)
class ExpressionStatement(SyntaxNode):
    """An expression on its own line."""

    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Assign(SyntaxNode):
    """`a = b = value`."""

    targets: tuple[Expression, ...]
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class AugmentedAssign(SyntaxNode):
    """`target += value`; the operator is without `=`."""

    target: Expression
    operator: Literal["+", "-", "*", "/", "//", "%", "**", "<<", ">>", "&", "|", "^", "@"]
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class AnnotatedAssign(SyntaxNode):
    """`target: annotation [= value]`."""

    target: Expression
    annotation: Expression
    value: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Branch(SyntaxNode):
    """`if test: body` or `elif test: body`."""

    test: Expression
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class If(SyntaxNode):
    """`if`, any number of `elif`, and the body of `else` (empty where there is none)."""

    branches: tuple[Branch, ...]
    orelse: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class For(SyntaxNode):
    """`for target in iterable: body`, with an `else`."""

    target: Expression
    iterable: Expression
    body: tuple[Statement, ...]
    orelse: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class While(SyntaxNode):
    """`while test: body`, with an `else`."""

    test: Expression
    body: tuple[Statement, ...]
    orelse: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Break(SyntaxNode):
    """`break`."""


@dataclass(frozen=True, slots=True, eq=False)
class Continue(SyntaxNode):
    """`continue`."""


@dataclass(frozen=True, slots=True, eq=False)
class Pass(SyntaxNode):
    """`pass`."""


@dataclass(frozen=True, slots=True, eq=False)
class FunctionDef(SyntaxNode):
    """`def name(parameters) -> returns: body`; the span starts at `def`, after the decorators."""

    name: str
    name_span: Span
    parameters: tuple[Parameter, ...]
    returns: Expression | None
    body: tuple[Statement, ...]
    decorators: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Return(SyntaxNode):
    """`return [value]`."""

    value: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Delete(SyntaxNode):
    """`del a, b`."""

    targets: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Assert(SyntaxNode):
    """`assert test [, message]`."""

    test: Expression
    message: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Raise(SyntaxNode):
    """`raise [exception [from cause]]`."""

    exception: Expression | None
    cause: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class ExceptHandler(SyntaxNode):
    """`except [type [as name]]: body`."""

    type: Expression | None
    name: str | None
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Try(SyntaxNode):
    """`try`, `except`, `else`, `finally` (`interrupt when` makes it a `DynamicStatement`)."""

    body: tuple[Statement, ...]
    handlers: tuple[ExceptHandler, ...]
    orelse: tuple[Statement, ...]
    final: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class WithItem(SyntaxNode):
    """`context [as target]`."""

    context: Expression
    target: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class WithStatement(SyntaxNode):
    """`with items: body`."""

    items: tuple[WithItem, ...]
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PropertyDefault(SyntaxNode):
    """`name: value` in a class, or `name[additive]: value` with modifiers `additive`, `dynamic`, `final`."""

    name: str
    name_span: Span
    modifiers: tuple[str, ...]
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class ClassDef(SyntaxNode):
    """`class name(bases): body`; a property line is a `PropertyDefault`, all else an ordinary statement."""

    name: str
    name_span: Span
    bases: tuple[Argument, ...]
    body: tuple[Statement, ...]
    decorators: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ImportAlias(SyntaxNode):
    """`path [as name]`; the path is dotted in `import`, a single name (or `*`) in `from`."""

    path: str
    name: str | None


@dataclass(frozen=True, slots=True, eq=False)
class Import(SyntaxNode):
    """`import a.b as c, d`."""

    aliases: tuple[ImportAlias, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ImportFrom(SyntaxNode):
    """`from ..module import a as b, c`; level counts the leading dots."""

    module: str
    level: int
    aliases: tuple[ImportAlias, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Global(SyntaxNode):
    """`global a, b`."""

    names: tuple[Name, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Nonlocal(SyntaxNode):
    """`nonlocal a, b`."""

    names: tuple[Name, ...]


@dataclass(frozen=True, slots=True, eq=False)
class UnsupportedStatement(SyntaxNode):
    """Python that no scenario needs, skipped with its body: `async def`, `match`; construct is the keyword."""

    construct: str
