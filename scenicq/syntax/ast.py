"""The syntax tree: what the text says, without what it means.

Every node is a frozen value whose first field is the `Span` of the text it was read from. Parentheses leave no node.
The unions at the end (`Expression`, `Specifier`, `Statement`) are closed, so that a `match` over one can end in
`assert_never`. What is not read (scenarios, `record`, ...) is kept as a place only.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import EllipsisType
from typing import Literal, TypeAlias, TypeGuard

from scenicq.errors import Source, Span
from scenicq.syntax.phrases import PhraseRow


@dataclass(frozen=True, slots=True, eq=False)
class SyntaxNode:
    """Base of all nodes.

    Attributes:
        span: The text of the construct, without surrounding parentheses.
    """

    span: Span


# --- expressions


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


# --- instances and phrases


@dataclass(frozen=True, slots=True, eq=False)
class New(SyntaxNode):
    """An instance: `new Car at (1, 2)` (3), `Car at 1 @ 2` (1 and 2: `keyword` is false, at least one specifier)."""

    cls: Expression
    specifiers: tuple[Specifier, ...]
    keyword: bool


@dataclass(frozen=True, slots=True, eq=False)
class WithSpecifier(SyntaxNode):
    """`with property value`."""

    property: str
    property_span: Span
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Phrase(SyntaxNode):
    """A specifier or an operator of Scenic: a row of `phrases`.

    Attributes:
        row: The row.
        operands: What stands in its places; None for what is left out.
    """

    row: PhraseRow
    operands: tuple[Expression | None, ...]

    @property
    def given(self) -> list[Expression]:
        """The operands that are there."""
        return [value for value in self.operands if value is not None]

    def of_kind(self, *kinds: str) -> list[Expression]:
        """The operands of these kinds that are there."""
        pairs = zip(self.row.operands, self.operands, strict=True)
        return [value for operand, value in pairs if value is not None and operand.kind in kinds]


def is_phrase(node: object, *rows: PhraseRow) -> TypeGuard[Phrase]:
    """Whether something is a phrase of one of these rows."""
    return isinstance(node, Phrase) and node.row in rows


# --- statements of Python


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
    """`try`, `except`, `else`, `finally` (`interrupt when` makes it a `TryInterrupt`)."""

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


# --- statements of Scenic, and the whole program


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
    """A statement of one line about what happens over time.

    Kinds: `terminate when`, `terminate after`, `terminate simulation`, `terminate`, `record`, `record initial`,
    `record final`, `wait`, `wait for`, `wait until`, `abort`, `precondition`, `invariant`.

    Attributes:
        kind: Which.
        operand: The condition of `terminate when`, `terminate simulation when` and the like, the number of
            `terminate after` and `wait for`, the value of `record`.
        unit: "seconds" or "steps" for `terminate after` and `wait for`.
        name: What `record` calls its value; "" where it does not say.
        manners: `every`, `after`, `to`: what `record` says of how it is recorded.
    """

    kind: str
    operand: Expression | None = None
    unit: str = ""
    name: str = ""
    manners: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Override(SyntaxNode):
    """`override object specifiers`: other properties of an object while a scenario runs."""

    target: Expression
    specifiers: tuple[Specifier, ...]

    @property
    def kind(self) -> str:
        """What messages call it."""
        return "override"


@dataclass(frozen=True, slots=True, eq=False)
class Take(SyntaxNode):
    """`take action, ...`."""

    actions: tuple[Expression, ...]

    @property
    def kind(self) -> str:
        """What messages call it."""
        return "take"


@dataclass(frozen=True, slots=True, eq=False)
class Do(SyntaxNode):
    """`do behavior, ... [until condition | for number unit]`, `do choose ...`, `do shuffle ...`.

    Attributes:
        behaviors: What is done.
        schedule: "choose", "shuffle" or "".
        until: The condition that ends it.
        duration: The time after which it ends.
        unit: "seconds" or "steps" for a duration.
    """

    behaviors: tuple[Expression, ...]
    schedule: str = ""
    until: Expression | None = None
    duration: Expression | None = None
    unit: str = ""

    @property
    def kind(self) -> str:
        """What messages call it."""
        return f"do {self.schedule}".strip()


@dataclass(frozen=True, slots=True, eq=False)
class Interrupt(SyntaxNode):
    """`interrupt when condition: body`."""

    condition: Expression
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True, eq=False)
class TryInterrupt(SyntaxNode):
    """`try` with `interrupt when`, and what else belongs to a `try`."""

    body: tuple[Statement, ...]
    interrupts: tuple[Interrupt, ...]
    handlers: tuple[ExceptHandler, ...] = ()
    orelse: tuple[Statement, ...] = ()
    final: tuple[Statement, ...] = ()

    @property
    def kind(self) -> str:
        """What messages call it."""
        return "try/interrupt"


@dataclass(frozen=True, slots=True, eq=False)
class DynamicDefinition(SyntaxNode):
    """A definition of what happens over time; unnamed blocks have no name.

    Kinds: `behavior`, `monitor`, `scenario`, `setup`, `compose`. The span ends with the header's colon.

    Attributes:
        kind: Which.
        name: Its name.
        parameters: What it takes.
        body: What it does; of a scenario its blocks, or what it sets up.
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


# --- what may stand where

Specifier: TypeAlias = WithSpecifier | Phrase
"""What can follow the class of an instance."""

Expression: TypeAlias = (
    Name | LiteralValue | FormattedString | Tuple | List | Set | Dict | Starred | UnaryOp | BinaryOp | BoolOp
    | ComparisonChain | IfElse | Lambda | Comprehension | DictComprehension | Call | Attribute | SubscriptSlice
    | Subscript | Walrus | UnsupportedExpression | New | Phrase
)  # fmt: skip
"""What has a value."""

Statement: TypeAlias = (
    ExpressionStatement | Assign | AugmentedAssign | AnnotatedAssign | If | For | While | Break | Continue | Pass
    | FunctionDef | Return | Delete | Assert | Raise | Try | WithStatement | PropertyDefault | ClassDef | Import
    | ImportFrom | Global | Nonlocal | UnsupportedStatement | Model | Param | Require | RequireMonitor | Mutate
    | Simulator | DynamicStatement | DynamicDefinition | Override | Take | Do | TryInterrupt
)  # fmt: skip
"""What stands in a block."""
