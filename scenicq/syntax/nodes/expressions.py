"""Python's expressions."""

from __future__ import annotations

from dataclasses import dataclass
from types import EllipsisType
from typing import TYPE_CHECKING, Literal

from scenicq.errors import Span
from scenicq.syntax.nodes.base import SyntaxNode

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression

__all__ = [
    "Argument",
    "Attribute",
    "BinaryOp",
    "BoolOp",
    "Call",
    "Clause",
    "ComparisonChain",
    "ComparisonLink",
    "Comprehension",
    "Dict",
    "DictComprehension",
    "DictItem",
    "FormattedString",
    "IfElse",
    "Lambda",
    "List",
    "LiteralValue",
    "Name",
    "Parameter",
    "Replacement",
    "Set",
    "Starred",
    "Subscript",
    "SubscriptSlice",
    "Tuple",
    "UnaryOp",
    "UnsupportedExpression",
    "Walrus",
]


@dataclass(frozen=True, slots=True, eq=False)
class Name(SyntaxNode):
    """A variable: `road`."""

    id: str


@dataclass(frozen=True, slots=True, eq=False)
class LiteralValue(SyntaxNode):
    """A literal: `1`, `2.5`, `'text'` (adjacent strings are joined), `b'x'`, `True`, `None`, `...`."""

    value: bool | int | float | complex | str | bytes | EllipsisType | None


@dataclass(frozen=True, slots=True, eq=False)
class Replacement(SyntaxNode):
    """`{value!conversion:format}` in a formatted string; conversion is `r`, `s`, `a` or empty."""

    value: Expression
    conversion: str
    format: FormattedString | None


@dataclass(frozen=True, slots=True, eq=False)
class FormattedString(SyntaxNode):
    """`f'...'`: text (as string constants) and replacements, in order."""

    parts: tuple[LiteralValue | Replacement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Tuple(SyntaxNode):
    """`a, b`, with or without parentheses (the span includes them); in Scenic 1 `(a, b)` may be an interval."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class List(SyntaxNode):
    """`[a, b]`."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Set(SyntaxNode):
    """`{a, b}`."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DictItem(SyntaxNode):
    """`key: value`, or `**value` where the key is None."""

    key: Expression | None
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Dict(SyntaxNode):
    """`{key: value, ...}`."""

    items: tuple[DictItem, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Starred(SyntaxNode):
    """`*value` in a display, a subscript or an assignment's target (calls use `Argument`)."""

    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class UnaryOp(SyntaxNode):
    """`-x`, `+x`, `~x`, `not x`."""

    operator: Literal["-", "+", "~", "not"]
    operand: Expression


@dataclass(frozen=True, slots=True, eq=False)
class BinaryOp(SyntaxNode):
    """Python's arithmetic and bit operators, but for `@` (see `Vector`)."""

    operator: Literal["+", "-", "*", "/", "//", "%", "**", "<<", ">>", "&", "|", "^"]
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class BoolOp(SyntaxNode):
    """`a and b and c`, or the same with `or`; at least two values."""

    operator: Literal["and", "or"]
    values: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ComparisonLink(SyntaxNode):
    """One `operator right` of a chain; Scenic 1's `is in` reads as `in`. The span covers the operator and `right`."""

    operator: Literal["==", "!=", "<", "<=", ">", ">=", "in", "not in", "is", "is not"]
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class ComparisonChain(SyntaxNode):
    """`left op a op b ...`."""

    left: Expression
    comparisons: tuple[ComparisonLink, ...]


@dataclass(frozen=True, slots=True, eq=False)
class IfElse(SyntaxNode):
    """`then if test else otherwise`."""

    test: Expression
    then: Expression
    otherwise: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Parameter(SyntaxNode):
    """One parameter of a function; the kind says how arguments reach it."""

    name: str
    kind: Literal["positional-only", "positional", "*", "keyword-only", "**"]
    annotation: Expression | None
    default: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Lambda(SyntaxNode):
    """`lambda parameters: body`."""

    parameters: tuple[Parameter, ...]
    body: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Clause(SyntaxNode):
    """`for target in iterable if condition if condition` of a comprehension."""

    target: Expression
    iterable: Expression
    conditions: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Comprehension(SyntaxNode):
    """`[element for ...]`, `{element for ...}`, `(element for ...)`."""

    kind: Literal["list", "set", "generator"]
    element: Expression
    clauses: tuple[Clause, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DictComprehension(SyntaxNode):
    """`{key: value for ...}`."""

    key: Expression
    value: Expression
    clauses: tuple[Clause, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Argument(SyntaxNode):
    """`value`, `name=value`, `*value` or `**value` in a call or in the bases of a class."""

    name: str | None
    star: Literal["", "*", "**"]
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Call(SyntaxNode):
    """`function(arguments)`."""

    function: Expression
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Attribute(SyntaxNode):
    """`value.name`."""

    value: Expression
    name: str
    name_span: Span


@dataclass(frozen=True, slots=True, eq=False)
class SubscriptSlice(SyntaxNode):
    """`lower:upper:step` in a subscript."""

    lower: Expression | None
    upper: Expression | None
    step: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Subscript(SyntaxNode):
    """`value[index]`; several indices are a `Tuple`."""

    value: Expression
    index: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Walrus(SyntaxNode):
    """`(target := value)`."""

    target: Name
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class UnsupportedExpression(SyntaxNode):
    """Python that no scenario needs: `await x`, `yield x`; construct is the keyword."""

    construct: str
