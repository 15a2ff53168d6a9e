"""Scenic's statements, and the whole program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenicq.errors import Source, Span
from scenicq.syntax.nodes.base import SyntaxNode

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression, Statement
    from scenicq.syntax.nodes.expressions import Parameter

__all__ = [
    "DynamicDefinition",
    "DynamicStatement",
    "Evidence",
    "Model",
    "Mutate",
    "Param",
    "ParamItem",
    "Program",
    "Require",
    "RequireMonitor",
    "Simulator",
]


@dataclass(frozen=True, slots=True, eq=False)
class Model(SyntaxNode):
    """`model scenic.domains.driving.model`."""

    name: str
    name_span: Span


@dataclass(frozen=True, slots=True, eq=False)
class ParamItem(SyntaxNode):
    """`name = value` of a `param` statement; the name may have been quoted."""

    name: str
    name_span: Span
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Param(SyntaxNode):
    """`param a = 1, b = 2`."""

    items: tuple[ParamItem, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Require(SyntaxNode):
    """`require condition`, `require[probability] condition`, each with an optional `as name`."""

    condition: Expression
    probability: Expression | None
    name: str | None


@dataclass(frozen=True, slots=True, eq=False)
class RequireMonitor(SyntaxNode):
    """`require monitor M()`."""

    monitor: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Mutate(SyntaxNode):
    """`mutate a, b by scale`; without objects, all."""

    objects: tuple[Expression, ...]
    scale: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Simulator(SyntaxNode):
    """`simulator S()`."""

    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class DynamicStatement(SyntaxNode):
    """What happens over time, skipped with its body but for what ends a run.

    Kinds: `terminate when`, `terminate after`, `terminate simulation`, `terminate`, `record`, `record initial`,
    `record final`, `do`, `do choose`, `do shuffle`, `take`, `wait`, `wait for`, `wait until`, `abort`, `invoke`,
    `override`, `try/interrupt`.

    Attributes:
        kind: Which.
        operand: The condition of `terminate when` and `terminate simulation when`, the number of `terminate after`.
        unit: "seconds" or "steps" for `terminate after`.
    """

    kind: str
    operand: Expression | None = None
    unit: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class DynamicDefinition(SyntaxNode):
    """A definition of what happens over time, skipped with its body but for monitors; unnamed blocks have no name.

    Kinds: `behavior`, `monitor`, `scenario`, `setup`, `compose`, `precondition`, `invariant`. The span ends with the
    header's colon.

    Attributes:
        kind: Which.
        name: Its name.
        parameters: Of a monitor.
        body: Of a monitor.
    """

    kind: str
    name: str
    parameters: tuple[Parameter, ...] = ()
    body: tuple[Statement, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """A construct that not every version of Scenic has.

    Attributes:
        span: The construct.
        construct: What it is, in words.
        versions: The versions that have it.
    """

    span: Span
    construct: str
    versions: frozenset[int]


@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """A whole program.

    Attributes:
        source: The text.
        body: The statements.
        versions: The versions of Scenic that the syntax leaves possible, never empty.
        version: The one that is left (or that was asked for), or None where several are.
        evidence: Why, in the order of the text.
    """

    source: Source
    body: tuple[Statement, ...]
    versions: frozenset[int]
    version: int | None
    evidence: tuple[Evidence, ...]
