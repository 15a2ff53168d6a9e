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
from scenicq.syntax.nodes.operators import (
    Altitude,
    Angle,
    ApparentHeading,
    CanSee,
    Deg,
    DistanceOperator,
    DistancePast,
    FieldAt,
    Follow,
    Implies,
    InitialScenario,
    IntersectsOperator,
    New,
    OffsetAlong,
    OffsetBy,
    PartOf,
    RelativeHeading,
    RelativePosition,
    RelativeTo,
    Temporal,
    UntilOperator,
    VectorOperator,
    Visible,
    VisibleFrom,
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
from scenicq.syntax.nodes.specifiers import Phrase, WithSpecifier
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
    "Altitude",
    "Angle",
    "AnnotatedAssign",
    "ApparentHeading",
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
    "CanSee",
    "ClassDef",
    "Clause",
    "ComparisonChain",
    "ComparisonLink",
    "Comprehension",
    "Continue",
    "Deg",
    "Delete",
    "Dict",
    "DictComprehension",
    "DictItem",
    "DistanceOperator",
    "DistancePast",
    "DynamicDefinition",
    "DynamicStatement",
    "Evidence",
    "ExceptHandler",
    "Expression",
    "ExpressionStatement",
    "FieldAt",
    "Follow",
    "For",
    "FormattedString",
    "FunctionDef",
    "Global",
    "If",
    "IfElse",
    "Implies",
    "Import",
    "ImportAlias",
    "ImportFrom",
    "InitialScenario",
    "IntersectsOperator",
    "Lambda",
    "List",
    "LiteralValue",
    "Model",
    "Mutate",
    "Name",
    "New",
    "Nonlocal",
    "OffsetAlong",
    "OffsetBy",
    "Param",
    "ParamItem",
    "Parameter",
    "PartOf",
    "Pass",
    "Phrase",
    "Program",
    "PropertyDefault",
    "Raise",
    "RelativeHeading",
    "RelativePosition",
    "RelativeTo",
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
    "Temporal",
    "Try",
    "Tuple",
    "UnaryOp",
    "UnsupportedExpression",
    "UnsupportedStatement",
    "UntilOperator",
    "VectorOperator",
    "Visible",
    "VisibleFrom",
    "Walrus",
    "While",
    "WithItem",
    "WithSpecifier",
    "WithStatement",
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
    | Deg
    | VectorOperator
    | FieldAt
    | RelativeTo
    | OffsetBy
    | OffsetAlong
    | RelativePosition
    | RelativeHeading
    | ApparentHeading
    | DistanceOperator
    | DistancePast
    | Angle
    | Altitude
    | CanSee
    | IntersectsOperator
    | Follow
    | Visible
    | VisibleFrom
    | PartOf
    | Temporal
    | UntilOperator
    | Implies
    | InitialScenario
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
