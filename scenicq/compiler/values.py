"""What names stand for while a program is evaluated.

A value is a plain Python value (number, string, list, function ...), a forest node (anything random, every vector and
region), or one of the classes below. Nothing here evaluates syntax.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from scenicq.errors import Diagnostic, Note, ScenarioError, Span
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Identity, Index, Node
from scenicq.syntax import ast

__all__ = [
    "Builtin",
    "Choice",
    "DelayedValue",
    "Function",
    "Instance",
    "LabelObjects",
    "ModelValue",
    "Module",
    "Nearest",
    "OtherList",
    "PropertyDefinition",
    "ScenicClass",
    "describe",
    "fail",
    "is_node",
]

ModelValue: TypeAlias = Any
"""A value of the program; `Any` because programs are dynamically typed."""


def is_node(value: ModelValue) -> bool:
    """Whether a value is an expression of the forest."""
    return isinstance(value, Node)


def fail(
    code: str,
    message: str,
    span: Span | None,
    label: str = "",
    hints: tuple[str, ...] = (),
    notes: tuple[Note, ...] = (),
) -> ScenarioError:
    """The error to raise for a fault of the program."""
    return ScenarioError(Diagnostic(code, message, span, label, notes, hints))


@dataclass(frozen=True, slots=True, eq=False)
class PropertyDefinition:
    """A property line of a class.

    Attributes:
        name: The property.
        default: Its expression, evaluated for every instance; None for built-in properties.
        computed: The value for an instance where there is no expression.
        needs: Properties of `self` that the expression uses.
        modifiers: "additive", "final" or "dynamic".
        environment: Variables that the expression sees.
        library: Whether a library rather than the user's program defines it.
    """

    name: str
    default: ast.Expression | None
    computed: Callable[[Instance], ModelValue]
    needs: frozenset[str]
    modifiers: tuple[str, ...]
    environment: Any
    library: bool
    span: Span | None


@dataclass(frozen=True, slots=True, eq=False)
class ScenicClass:
    """A class of points, oriented points or objects.

    Attributes:
        name: Its name.
        base: Its superclass; None for `Point`.
        definitions: Its own property lines.
        attributes: Other names that its body defines.
        category: The name in the class tree that label objects are compared with.
        span: Where it is defined.
    """

    name: str
    base: ScenicClass | None
    definitions: Mapping[str, PropertyDefinition]
    attributes: Mapping[str, ModelValue]
    category: str
    span: Span | None = None

    def ancestry(self) -> list[ScenicClass]:
        """The class and its superclasses, most derived first."""
        chain: list[ScenicClass] = []
        current: ScenicClass | None = self
        while current is not None:
            chain.append(current)
            current = current.base
        return chain

    def definition(self, name: str) -> PropertyDefinition | None:
        """The property line that counts for a property, the most derived one."""
        return next((each.definitions[name] for each in self.ancestry() if name in each.definitions), None)

    def derives_from(self, name: str) -> bool:
        """Whether the class or a superclass has a name."""
        return any(ancestor.name == name for ancestor in self.ancestry())


@dataclass(slots=True, eq=False)
class Instance:
    """A point, oriented point or object that the program creates.

    Attributes:
        cls: Its class.
        index: Its index among the scenario's objects; None for points and oriented points.
        properties: Values by name.
        explicit: Names of properties that the program itself sets.
        spans: Where each property comes from.
        label: The name that the program gives it.
        mutation: Scale of `mutate`, None if not mutated.
        span: The expression that creates it.
    """

    cls: ScenicClass
    index: int | None
    span: Span | None
    properties: dict[str, ModelValue] = field(default_factory=dict[str, Any])
    explicit: set[str] = field(default_factory=set[str])
    spans: dict[str, Span | None] = field(default_factory=dict[str, "Span | None"])
    label: str = ""
    mutation: ModelValue = None

    @property
    def oriented(self) -> bool:
        """Whether it has a heading."""
        return self.cls.derives_from("OrientedPoint")


@dataclass(frozen=True, slots=True, eq=False)
class LabelObjects:
    """Label objects of a class: those without a role, or all but the ego.

    Attributes:
        cls: The class.
        excluded: The tracks of those who are left out.
    """

    cls: ScenicClass
    excluded: tuple[Node, ...]


@dataclass(frozen=True, slots=True, eq=False)
class OtherList:
    """A list with something of each of some label objects.

    Attributes:
        objects: The label objects.
        element: What stands for each.
        conditions: Which of them count.
        value: What the list has of each.
    """

    objects: LabelObjects
    element: Instance
    conditions: tuple[Node, ...]
    value: ModelValue


@dataclass(slots=True, eq=False)
class Nearest(Instance):
    """`nearest(C)`: a point with the properties of the nearest label object of a class.

    Attributes:
        objects: The label objects of the class.
        counts: Which of them count, given what stands for each.
        ego: To whom they are near.
    """

    objects: LabelObjects | None = None
    ego: ModelValue = None
    counts: Callable[[Instance], Node] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DelayedValue:
    """A value that needs properties of the object being specified, such as `10 deg relative to roadDirection`.

    Attributes:
        needs: The properties.
        evaluate: The value, given the object.
    """

    needs: frozenset[str]
    evaluate: Callable[[Instance], ModelValue]


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """One of several values that are not numbers, vectors or regions: which one is random.

    Attributes:
        index: Which: a random variable, or an expression such as which lane lies at a place.
        options: The values.
        size: How many outcomes there are, those of nested choices included.
    """

    index: Node
    options: tuple[ModelValue, ...]
    size: int

    @property
    def key(self) -> Identity | int:
        """What two choices have in common that always come out the same."""
        return self.index.identity if isinstance(self.index, Index) else id(self.index)


@dataclass(frozen=True, slots=True, eq=False)
class Function:
    """A function of the program."""

    name: str
    parameters: tuple[ast.Parameter, ...]
    defaults: Mapping[str, ModelValue]
    body: tuple[ast.Statement, ...] | ast.Expression
    environment: Any
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Builtin:
    """A function that the language provides.

    Attributes:
        name: What programs call it.
        call: Takes the span of the call, positional and keyword arguments.
        lifted: Whether the call waits for delayed arguments.
        owner: What it is a method of: the call may go through all of it.
        cost: Steps that a call takes besides.
        known: Whether it takes known values only: what the program itself says of its objects counts as known.
        spread: Which random choices among its arguments it takes each outcome of by itself; none if not given.
    """

    name: str
    call: Callable[..., ModelValue]
    lifted: bool = True
    owner: ModelValue = None
    cost: int = 0
    known: bool = False
    spread: Callable[[ModelValue], bool] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Module:
    """An imported module, or another record of names and their values.

    Attributes:
        name: What messages call it.
        names: The values by name.
        dynamic: Whether it has nothing to say about one instant: any name of it may be imported and stands for nothing.
        call: What a call of it calls, as of a class of Python's that programs make values with; None if it is none.
    """

    name: str
    names: dict[str, ModelValue]
    dynamic: bool = False
    call: ModelValue = None


_NAMES: dict[type, str] = {
    bool: "a truth value",
    int: "a number",
    float: "a number",
    str: "a string",
    list: "a list",
    tuple: "a tuple",
    dict: "a dictionary",
    set: "a set",
    type(None): "None",
    Function: "a function",
    Builtin: "a function",
    ScenicClass: "a class",
    Module: "a module",
    Choice: "a random choice",
    LabelObjects: "the other label objects of a class",
    OtherList: "a list of other label objects",
    DelayedValue: "a value that depends on an object's position",
}


_KINDS = {"boolean": "a truth value", "other": "a value"}
"""What values of a forest are called whose kind has another name."""


def describe(value: ModelValue) -> str:
    """What a value is, in words for a message."""
    if isinstance(value, Instance):
        return f"an instance of `{value.cls.name}`"
    if is_node(value):
        return _KINDS.get(kind_of(value)) or f"a {kind_of(value)}"
    name = type(value).__name__
    if type(value).__module__.startswith("scenicq.compiler"):
        name = re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower()
    return _NAMES.get(type(value)) or f"a {name}"
