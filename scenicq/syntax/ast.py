"""The syntax tree: what the text says, without what it means.

Every node is a frozen value whose first field is the `Span` of the text it was read from. Parentheses leave no node.
The unions at the end (`Expression`, `Specifier`, `Statement`) are closed, so that a `match` over one can end in
`assert_never`. What cannot describe a single instant (behaviors, `do`, `record`, ...) is kept as a place only.

The nodes themselves stand in `nodes`, which knows the unions for its annotations only.
"""

from __future__ import annotations

from typing import TypeAlias

from scenicq.syntax.nodes.base import SyntaxNode
from scenicq.syntax.nodes.expressions import (
    Argument,
    Attribute,
    BinaryOp,
    BoolOp,
    Call,
    Clause,
    ComparisonChain,
    ComparisonLink,
    Comprehension,
    Dict,
    DictComprehension,
    DictItem,
    FormattedString,
    IfElse,
    Lambda,
    List,
    LiteralValue,
    Name,
    Parameter,
    Replacement,
    Set,
    Starred,
    Subscript,
    SubscriptSlice,
    Tuple,
    UnaryOp,
    UnsupportedExpression,
    Walrus,
)
from scenicq.syntax.nodes.program import (
    DynamicDefinition,
    DynamicStatement,
    Evidence,
    Model,
    Mutate,
    Param,
    ParamItem,
    Program,
    Require,
    RequireMonitor,
    Simulator,
)
from scenicq.syntax.nodes.specifiers import New, Phrase, WithSpecifier, is_phrase
from scenicq.syntax.nodes.statements import (
    AnnotatedAssign,
    Assert,
    Assign,
    AugmentedAssign,
    Branch,
    Break,
    ClassDef,
    Continue,
    Delete,
    ExceptHandler,
    ExpressionStatement,
    For,
    FunctionDef,
    Global,
    If,
    Import,
    ImportAlias,
    ImportFrom,
    Nonlocal,
    Pass,
    PropertyDefault,
    Raise,
    Return,
    Try,
    UnsupportedStatement,
    While,
    WithItem,
    WithStatement,
)

__all__ = [
    "AnnotatedAssign",
    "Argument",
    "Assert",
    "Assign",
    "Attribute",
    "AugmentedAssign",
    "BinaryOp",
    "BoolOp",
    "Branch",
    "Break",
    "Call",
    "ClassDef",
    "Clause",
    "ComparisonChain",
    "ComparisonLink",
    "Comprehension",
    "Continue",
    "Delete",
    "Dict",
    "DictComprehension",
    "DictItem",
    "DynamicDefinition",
    "DynamicStatement",
    "Evidence",
    "ExceptHandler",
    "Expression",
    "ExpressionStatement",
    "For",
    "FormattedString",
    "FunctionDef",
    "Global",
    "If",
    "IfElse",
    "Import",
    "ImportAlias",
    "ImportFrom",
    "Lambda",
    "List",
    "LiteralValue",
    "Model",
    "Mutate",
    "Name",
    "New",
    "Nonlocal",
    "Param",
    "ParamItem",
    "Parameter",
    "Pass",
    "Phrase",
    "Program",
    "PropertyDefault",
    "Raise",
    "Replacement",
    "Require",
    "RequireMonitor",
    "Return",
    "Set",
    "Simulator",
    "Specifier",
    "Starred",
    "Statement",
    "Subscript",
    "SubscriptSlice",
    "SyntaxNode",
    "Try",
    "Tuple",
    "UnaryOp",
    "UnsupportedExpression",
    "UnsupportedStatement",
    "Walrus",
    "While",
    "WithItem",
    "WithSpecifier",
    "WithStatement",
    "is_phrase",
]  # fmt: skip

Specifier: TypeAlias = WithSpecifier | Phrase
"""What can follow the class of an instance."""

Expression: TypeAlias = (
    Name
    | LiteralValue
    | FormattedString
    | Tuple
    | List
    | Set
    | Dict
    | Starred
    | UnaryOp
    | BinaryOp
    | BoolOp
    | ComparisonChain
    | IfElse
    | Lambda
    | Comprehension
    | DictComprehension
    | Call
    | Attribute
    | SubscriptSlice
    | Subscript
    | Walrus
    | UnsupportedExpression
    | New
    | Phrase
)
"""What has a value."""

Statement: TypeAlias = (
    ExpressionStatement
    | Assign
    | AugmentedAssign
    | AnnotatedAssign
    | If
    | For
    | While
    | Break
    | Continue
    | Pass
    | FunctionDef
    | Return
    | Delete
    | Assert
    | Raise
    | Try
    | WithStatement
    | PropertyDefault
    | ClassDef
    | Import
    | ImportFrom
    | Global
    | Nonlocal
    | UnsupportedStatement
    | Model
    | Param
    | Require
    | RequireMonitor
    | Mutate
    | Simulator
    | DynamicStatement
    | DynamicDefinition
)
"""What stands in a block."""
