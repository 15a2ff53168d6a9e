"""The expression forest on one page: every kind of node that a compiled scenario is made of.

A scenario's features and requirements are expressions over random variables (leaves) and features of other objects
(query paper, section 2 and figure 4). Nodes are frozen and compared by identity, never by content: one `Range` used
twice is one random variable, two that look alike are two. Every node knows the place in the program it came from.
Nothing here computes; passes are functions elsewhere (`walk`, `evaluate`, `condition`, `show`). A class declares its
children by the types of its fields, in their order, and the kind of its value by its base class.

Values: a scalar is a float (headings in radians, lengths in metres), a vector a pair of floats, a region or a vector
field a value of `scenicq.geometry`; anything else (a string, None) is only ever compared for equality.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from itertools import count
from typing import TYPE_CHECKING, ClassVar, Literal, TypeAlias

from scenicq.errors import Span

if TYPE_CHECKING:  # takes long to load, and whoever asks a solver about numbers needs none of it
    from scenicq.geometry.driven_courses import CoursePlace
    from scenicq.geometry.fields import VectorField
    from scenicq.geometry.measures import MeasureName
    from scenicq.geometry.network import Network
    from scenicq.geometry.regions import Region

__all__ = [
    "CLOCK", "COURSE", "ELEMENT", "GIVEN", "GOING", "IDENTITY", "LAST_LANE", "MIRRORED", "OPEN", "PAST", "RANK",
    "TRACK", "WHO", "AheadInLanes", "Among", "AmongOp", "Arithmetic", "ArithmeticOp", "Bearing", "Body", "Compare",
    "CompareOp", "Constant", "Contains", "Coordinate", "Corridor", "CourseCoordinate", "DirectionAt", "DiscAt",
    "DiscreteRange", "Distance", "Encloses", "Feature", "Identity", "Index", "Intersects", "Kind", "LaneCourse",
    "Leaf", "Logic", "LogicOp", "Measure", "Node", "Norm", "Normal", "PointIn", "Range", "RectangleAt",
    "RegionDifference", "RegionIntersection", "RegionUnion", "Rotate", "Scale", "SectorAt", "Select",
    "TruncatedNormal", "Undefined", "Value", "Vector", "VectorOf", "VectorSum",
]  # fmt: skip

Vector: TypeAlias = tuple[float, float]
Kind: TypeAlias = Literal["scalar", "boolean", "vector", "region", "field", "other"]


@dataclass(frozen=True, slots=True)
class Undefined:
    """The value of an expression that has none here, such as the road's direction far from any road.

    Attributes:
        reason: Why, as a fact for the user.
    """

    reason: str


Value: TypeAlias = "float | bool | str | Vector | Region | VectorField | CoursePlace | Undefined | None"

COURSE = "driven course"
"""The property of an object that is its course; no program can give one of such a name."""
GOING = "way it goes"
"""The property of an object that tells its lanes from others at its place: its heading, None where a label has none."""
LAST_LANE = "last lane"
"""The property of an object that does so where its heading does not: the number of its track's last lane, or None."""
CLOCK = "time of the sample"
"""The property of any object that is the time of a sample, in seconds from a moment of its recording."""
PAST = "past value of "
"""How the names of properties begin that no label observes: what they were at a sample that is not kept."""


class ArithmeticOp(StrEnum):
    """Operations on scalars; `WRAP` brings an angle into [-pi, pi]."""

    ADD = "+"
    SUB = "-"
    MUL = "*"
    DIV = "/"
    FLOORDIV = "//"
    MOD = "%"
    POW = "**"
    NEG = "neg"
    ABS = "abs"
    MIN = "min"
    MAX = "max"
    SQRT = "sqrt"
    SIN = "sin"
    COS = "cos"
    TAN = "tan"
    ASIN = "asin"
    ACOS = "acos"
    ATAN = "atan"
    ATAN2 = "atan2"
    EXP = "exp"
    LOG = "log"
    FLOOR = "floor"
    CEIL = "ceil"
    WRAP = "wrap"


class CompareOp(StrEnum):
    """Comparisons of scalars; `EQ` and `NE` also of other values."""

    LT = "<"
    LE = "<="
    GT = ">"
    GE = ">="
    EQ = "=="
    NE = "!="


MIRRORED = {
    CompareOp.LT: CompareOp.GT, CompareOp.LE: CompareOp.GE, CompareOp.GT: CompareOp.LT, CompareOp.GE: CompareOp.LE,
}  # fmt: skip
"""Orders as they are with the sides exchanged."""


class LogicOp(StrEnum):
    """Connectives."""

    AND = "and"
    OR = "or"
    NOT = "not"


@dataclass(frozen=True, slots=True, eq=False)
class _Node:
    span: Span | None = field(default=None, kw_only=True, repr=False)


class _Scalar(_Node):
    __slots__ = ()
    value_kind: ClassVar[Kind] = "scalar"


class _Vector(_Node):
    __slots__ = ()
    value_kind: ClassVar[Kind] = "vector"


class _Region(_Node):
    __slots__ = ()
    value_kind: ClassVar[Kind] = "region"


class _Boolean(_Node):
    __slots__ = ()
    value_kind: ClassVar[Kind] = "boolean"


class Identity:
    """What makes a random variable the same one, however its distribution's parameters are rewritten."""

    __slots__ = ("order",)

    def __init__(self) -> None:
        """Be the next one."""
        self.order = next(_ORDER)


_ORDER = count()
"""Numbers random variables as they are made, so that those of a moment can be told from later ones."""


@dataclass(frozen=True, slots=True, eq=False)
class _Leaf(_Node):
    value_kind: ClassVar[Kind] = "scalar"
    identity: Identity = field(default_factory=Identity, kw_only=True, repr=False)


# --- known values


@dataclass(frozen=True, slots=True, eq=False)
class Constant(_Node):
    """A known value."""

    value: Value


@dataclass(frozen=True, slots=True, eq=False)
class Feature(_Node):
    """A property of an object of the scenario, by reference: what the label observes of it is put here.

    Attributes:
        object: Index of the object in the scenario.
        property: Name of the property.
        kind: What kind of value the property has.
        current: In a condition over time: whether it is read at each sample, as what the condition names itself is.
            What was computed from objects before, such as the place of a point, is as it was at the first sample.
    """

    object: int
    property: str
    kind: Kind
    current: bool = False


# --- random variables (leaves): identity matters


@dataclass(frozen=True, slots=True, eq=False)
class Range(_Leaf):
    """Uniform on an interval (`Range(low, high)`); the ends may come in either order."""

    low: Node
    high: Node


@dataclass(frozen=True, slots=True, eq=False)
class Normal(_Leaf):
    """Normal distribution: its support is the whole line."""

    mean: Node
    deviation: Node


@dataclass(frozen=True, slots=True, eq=False)
class TruncatedNormal(_Leaf):
    """Normal distribution cut to an interval."""

    mean: Node
    deviation: Node
    low: Node
    high: Node


@dataclass(frozen=True, slots=True, eq=False)
class DiscreteRange(_Leaf):
    """An integer between two, both included."""

    low: Node
    high: Node


@dataclass(frozen=True, slots=True, eq=False)
class Index(_Leaf):
    """Which option of a `Uniform(...)` or `Discrete({...})`: 0 to n - 1, those of positive weight only.

    Attributes:
        weights: One positive weight per option.
    """

    weights: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PointIn(_Leaf):
    """A point uniformly at random in a region."""

    value_kind: ClassVar[Kind] = "vector"
    region: Node


# --- choice


@dataclass(frozen=True, slots=True, eq=False)
class Select(_Node):
    """The option that an index picks: a whole number, or a truth value for the first (false) or the second (true)."""

    index: Node
    options: tuple[Node, ...]


# --- scalars


@dataclass(frozen=True, slots=True, eq=False)
class Arithmetic(_Scalar):
    """An operation on scalars."""

    op: ArithmeticOp
    args: tuple[Node, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Coordinate(_Scalar):
    """The x (axis 0) or y (axis 1) of a vector."""

    vector: Node
    axis: int


@dataclass(frozen=True, slots=True, eq=False)
class Norm(_Scalar):
    """The length of a vector."""

    vector: Node


@dataclass(frozen=True, slots=True, eq=False)
class Bearing(_Scalar):
    """The heading in which a vector points."""

    vector: Node


@dataclass(frozen=True, slots=True, eq=False)
class Distance(_Scalar):
    """The distance from a point to a region, 0 inside."""

    region: Node
    point: Node


@dataclass(frozen=True, slots=True, eq=False)
class DirectionAt(_Scalar):
    """The heading of a vector field at a point; where the field allows several, any of them.

    Attributes:
        going: Which way goes who is there and the last lane of its track, where that tells which of several elements is
            meant; else empty.
    """

    field: Node
    point: Node
    going: tuple[Node, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class CourseCoordinate(_Scalar):
    """How far a point is along (axis 0) or beside (axis 1) an object's course.

    Attributes:
        end: The lower (0) or the upper (1) end of what it may be; None for the number itself, where both are equal.
    """

    course: Node
    point: Node
    axis: int
    end: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Measure(_Scalar):
    """A measure of the field (`scenicq.geometry.measures`).

    Attributes:
        measure: Which.
        args: The courses of the objects where it is one of tracks; else position, heading, velocity, width and length
            of each object.
        seconds: Over how long, where that matters.
        end: Which end is meant of a measure of tracks, as `CourseCoordinate` says.
    """

    measure: MeasureName
    args: tuple[Node, ...]
    seconds: float = 0.0
    end: int | None = None


# --- courses


@dataclass(frozen=True, slots=True, eq=False)
class LaneCourse(_Node):
    """The course of what is seen at one place alone: that of its lane.

    Attributes:
        network: The map.
        gap_s: Seconds without a label at which the course of a track, which takes the place of this one, is cut.
    """

    value_kind: ClassVar[Kind] = "other"
    point: Node
    heading: Node
    network: Network
    gap_s: float


# --- vectors


@dataclass(frozen=True, slots=True, eq=False)
class VectorOf(_Vector):
    """A vector from its coordinates."""

    x: Node
    y: Node


@dataclass(frozen=True, slots=True, eq=False)
class VectorSum(_Vector):
    """The sum of two vectors."""

    left: Node
    right: Node


@dataclass(frozen=True, slots=True, eq=False)
class Scale(_Vector):
    """A vector times a scalar."""

    vector: Node
    factor: Node


@dataclass(frozen=True, slots=True, eq=False)
class Rotate(_Vector):
    """A vector turned counter-clockwise."""

    vector: Node
    angle: Node


# --- regions


@dataclass(frozen=True, slots=True, eq=False)
class DiscAt(_Region):
    """A disc."""

    center: Node
    radius: Node


@dataclass(frozen=True, slots=True, eq=False)
class SectorAt(_Region):
    """A sector of a disc around a heading, of any full angle up to 2 pi."""

    center: Node
    radius: Node
    heading: Node
    angle: Node


@dataclass(frozen=True, slots=True, eq=False)
class RectangleAt(_Region):
    """A rectangle: its width is across the heading, its length along it."""

    center: Node
    heading: Node
    width: Node
    length: Node


@dataclass(frozen=True, slots=True, eq=False)
class RegionUnion(_Region):
    """What lies in any of the parts."""

    parts: tuple[Node, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RegionIntersection(_Region):
    """What lies in all parts."""

    parts: tuple[Node, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RegionDifference(_Region):
    """What lies in the base but not in what is removed."""

    base: Node
    removed: Node


@dataclass(frozen=True, slots=True, eq=False)
class Corridor(_Region):
    """What lies within half a width of a course; the line itself where that is 0."""

    course: Node
    half_width: Node


@dataclass(frozen=True, slots=True, eq=False)
class AheadInLanes(_Region):
    """What lies in the lanes of an object from its place to so many metres on (`scenicq.geometry.lane_stretches`).

    Attributes:
        heading, last: Its own and the number of its track's last lane, which tell its lanes from others; None for all.
        network: The map.
    """

    point: Node
    heading: Node
    last: Node
    distance: Node
    network: Network


# --- booleans


@dataclass(frozen=True, slots=True, eq=False)
class Compare(_Boolean):
    """A comparison."""

    op: CompareOp
    left: Node
    right: Node


@dataclass(frozen=True, slots=True, eq=False)
class Logic(_Boolean):
    """A connective over truth values."""

    op: LogicOp
    args: tuple[Node, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Contains(_Boolean):
    """Whether a point lies in a region, boundary included."""

    region: Node
    point: Node


@dataclass(frozen=True, slots=True, eq=False)
class Intersects(_Boolean):
    """Whether two regions have a point in common."""

    left: Node
    right: Node


@dataclass(frozen=True, slots=True, eq=False)
class Encloses(_Boolean):
    """Whether a region holds all of another (of a box)."""

    outer: Node
    inner: Node


# --- the label objects of a label, whether or not they play a role

ELEMENT, GIVEN = -2, -3
"""What features in a `Body` are of: the label object in question, or what is given from around, by its number."""
IDENTITY, TRACK, RANK = "#id", "#track", "#rank"
"""Properties of whoever plays an object, as numbers: who it is, where it is observed; who it is, wherever it is; its
place among the ids of its label."""
OPEN = "#open"
"""A truth value that no label object has: what depends on it is unknown."""
WHO = frozenset({IDENTITY, TRACK, RANK})
"""All of these: what is known of whoever plays a role, whatever a label observes of it."""


class AmongOp(StrEnum):
    """What is told of the label objects of a class."""

    AT_LEAST = "at least"
    EVERY = "every"
    COUNT = "count"
    NEAREST = "nearest"


@dataclass(frozen=True, slots=True)
class Body:
    """What is asked of each label object: expressions over features of `ELEMENT` and `GIVEN`.

    Not children of the node that has it: they have a value for each label object.

    Attributes:
        condition: Whether it counts.
        distance: How far away it is; of the nearest.
        value: What of the nearest is the value.
    """

    condition: Node
    distance: Node | None = None
    value: Node | None = None

    @property
    def parts(self) -> tuple[Node, ...]:
        """Condition, distance and value, as far as there are any."""
        return tuple(each for each in (self.condition, self.distance, self.value) if each is not None)


@dataclass(frozen=True, slots=True, eq=False)
class Among(_Node):
    """What holds of the label objects of a class, in three truth values (`forest/among`).

    Attributes:
        op: Whether at least so many count, or all do; how many do; or something of the nearest of those that do.
        category: The class.
        body: What counts.
        kind: What kind of value it has.
        number: How many, for `AT_LEAST`.
        excluded: How many of the inputs, the first ones, are the identities of label objects that are left out.
        inputs: What the body is given.
        elements: The label objects, where they are known before all inputs are.
        unknown: What stands for a truth value that is not known, where that is decided.
    """

    op: AmongOp
    category: str
    body: Body
    kind: Kind
    number: int
    excluded: int
    inputs: tuple[Node, ...]
    elements: object = field(default=None, kw_only=True, repr=False)
    unknown: bool | None = field(default=None, kw_only=True)


Leaf: TypeAlias = Range | Normal | TruncatedNormal | DiscreteRange | Index | PointIn
Node: TypeAlias = (
    Constant | Feature | Leaf | Select | Arithmetic | Coordinate | Norm | Bearing | Distance | DirectionAt |
    CourseCoordinate | Measure | LaneCourse | VectorOf | VectorSum | Scale | Rotate | DiscAt | SectorAt |
    RectangleAt | Corridor | AheadInLanes |
    RegionUnion | RegionIntersection | RegionDifference | Compare | Logic | Contains | Intersects | Encloses | Among
)  # fmt: skip
