"""Python's expressions."""

from __future__ import annotations

from dataclasses import dataclass
from types import EllipsisType
from typing import TYPE_CHECKING, Literal

from scenicq.errors import Span
from scenicq.syntax.nodes.base import Node

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression

__all__ = [
    "Argument",
    "Attribute",
    "BinaryOp",
    "BoolOp",
    "Call",
    "Clause",
    "Compare",
    "Comparison",
    "Comprehension",
    "Constant",
    "Dict",
    "DictComprehension",
    "DictItem",
    "FormattedString",
    "IfElse",
    "Lambda",
    "List",
    "Name",
    "Parameter",
    "Replacement",
    "Set",
    "Slice",
    "Starred",
    "Subscript",
    "Tuple",
    "UnaryOp",
    "UnsupportedExpression",
    "Walrus",
]


@dataclass(frozen=True, slots=True, eq=False)
class Name(Node):
    """A variable: `road`."""

    id: str


@dataclass(frozen=True, slots=True, eq=False)
class Constant(Node):
    """A literal: `1`, `2.5`, `'text'` (adjacent strings are joined), `b'x'`, `True`, `None`, `...`."""

    value: bool | int | float | complex | str | bytes | EllipsisType | None


@dataclass(frozen=True, slots=True, eq=False)
class Replacement(Node):
    """`{value!conversion:format}` in a formatted string; conversion is `r`, `s`, `a` or empty."""

    value: Expression
    conversion: str
    format: FormattedString | None


@dataclass(frozen=True, slots=True, eq=False)
class FormattedString(Node):
    """`f'...'`: text (as string constants) and replacements, in order."""

    parts: tuple[Constant | Replacement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Tuple(Node):
    """`a, b`, with or without parentheses (the span includes them); in Scenic 1 `(a, b)` may be an interval."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class List(Node):
    """`[a, b]`."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Set(Node):
    """`{a, b}`."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DictItem(Node):
    """`key: value`, or `**value` where the key is None."""

    key: Expression | None
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Dict(Node):
    """`{key: value, ...}`."""

    items: tuple[DictItem, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Starred(Node):
    """`*value` in a display, a subscript or an assignment's target (calls use `Argument`)."""

    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class UnaryOp(Node):
    """`-x`, `+x`, `~x`, `not x`."""

    operator: Literal["-", "+", "~", "not"]
    operand: Expression


@dataclass(frozen=True, slots=True, eq=False)
class BinaryOp(Node):
    """Python's arithmetic and bit operators, but for `@` (see `Vector`)."""

    operator: Literal["+", "-", "*", "/", "//", "%", "**", "<<", ">>", "&", "|", "^"]
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class BoolOp(Node):
    """`a and b and c`, or the same with `or`; at least two values."""

    operator: Literal["and", "or"]
    values: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison(Node):
    """One `operator right` of a chain; Scenic 1's `is in` reads as `in`. The span covers the operator and `right`."""

    operator: Literal["==", "!=", "<", "<=", ">", ">=", "in", "not in", "is", "is not"]
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Compare(Node):
    """`left op a op b ...`."""

    left: Expression
    comparisons: tuple[Comparison, ...]


@dataclass(frozen=True, slots=True, eq=False)
class IfElse(Node):
    """`then if test else otherwise`."""

    test: Expression
    then: Expression
    otherwise: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Parameter(Node):
    """One parameter of a function; the kind says how arguments reach it."""

    name: str
    kind: Literal["positional-only", "positional", "*", "keyword-only", "**"]
    annotation: Expression | None
    default: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Lambda(Node):
    """`lambda parameters: body`."""

    parameters: tuple[Parameter, ...]
    body: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Clause(Node):
    """`for target in iterable if condition if condition` of a comprehension."""

    target: Expression
    iterable: Expression
    conditions: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Comprehension(Node):
    """`[element for ...]`, `{element for ...}`, `(element for ...)`."""

    kind: Literal["list", "set", "generator"]
    element: Expression
    clauses: tuple[Clause, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DictComprehension(Node):
    """`{key: value for ...}`."""

    key: Expression
    value: Expression
    clauses: tuple[Clause, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Argument(Node):
    """`value`, `name=value`, `*value` or `**value` in a call or in the bases of a class."""

    name: str | None
    star: Literal["", "*", "**"]
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Call(Node):
    """`function(arguments)`."""

    function: Expression
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Attribute(Node):
    """`value.name`."""

    value: Expression
    name: str
    name_span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Slice(Node):
    """`lower:upper:step` in a subscript."""

    lower: Expression | None
    upper: Expression | None
    step: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Subscript(Node):
    """`value[index]`; several indices are a `Tuple`."""

    value: Expression
    index: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Walrus(Node):
    """`(target := value)`."""

    target: Name
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class UnsupportedExpression(Node):
    """Python that no scenario needs: `await x`, `yield x`; construct is the keyword."""

    construct: str
