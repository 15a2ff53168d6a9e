"""Abstract interpretation: one walk over the node language, for every domain of values.

A domain says what each operation does to its own values (outer bounds of numbers, columns of them, ...); the walk says
which operation a node is, once and exhaustively. `intervals` has the domain of intervals.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import Protocol, TypeAlias, TypeVar, assert_never

from scenicq.forest.nodes import (
    AheadInLanes,
    Among,
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    Coordinate,
    Corridor,
    CourseCoordinate,
    DirectionAt,
    DiscAt,
    DiscreteRange,
    Distance,
    Encloses,
    Feature,
    Index,
    Intersects,
    LaneCourse,
    Leaf,
    Logic,
    LogicOp,
    Measure,
    Node,
    Norm,
    Normal,
    PointIn,
    Range,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Rotate,
    Scale,
    SectorAt,
    Select,
    TruncatedNormal,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder

__all__ = ["AbstractDomain", "OnMap", "RegionNode", "Steps", "interpret", "steps_of"]

V = TypeVar("V")

OnMap: TypeAlias = (
    Distance | DirectionAt | Contains | Intersects | Encloses | CourseCoordinate | Measure | LaneCourse
)  # fmt: skip
"""What is asked of regions, vector fields and courses."""
RegionNode: TypeAlias = (
    DiscAt | SectorAt | RectangleAt | Corridor | AheadInLanes | RegionUnion | RegionIntersection | RegionDifference
)  # fmt: skip
Steps: TypeAlias = Sequence[tuple[Node, tuple[Node, ...]]]
"""Nodes with their children, which come before them."""


class AbstractDomain(Protocol[V]):
    """What the operations of the node language do to abstract values."""

    def constant(self, value: Value) -> V:
        """A known value."""
        ...

    def feature(self, node: Feature) -> V:
        """A property of an object."""
        ...

    def variable(self, node: Leaf, args: Sequence[V]) -> V:
        """A random variable, given the parameters of its distribution."""
        ...

    def arithmetic(self, op: ArithmeticOp, args: Sequence[V]) -> V:
        """An operation on scalars."""
        ...

    def vector(self, x: V, y: V) -> V:
        """A vector of two scalars."""
        ...

    def sum(self, left: V, right: V) -> V:
        """The sum of two vectors."""
        ...

    def scale(self, vector: V, factor: V) -> V:
        """A vector times a scalar."""
        ...

    def rotate(self, vector: V, angle: V) -> V:
        """A vector turned counter-clockwise."""
        ...

    def coordinate(self, vector: V, axis: int) -> V:
        """One coordinate of a vector."""
        ...

    def norm(self, vector: V) -> V:
        """The length of a vector."""
        ...

    def bearing(self, vector: V) -> V:
        """The heading of a vector."""
        ...

    def compare(self, op: CompareOp, left: V, right: V) -> V:
        """A comparison."""
        ...

    def logic(self, op: LogicOp, args: Sequence[V]) -> V:
        """A combination of truth values."""
        ...

    def select(self, index: V, options: Sequence[V]) -> V:
        """One of some options."""
        ...

    def on_map(self, node: OnMap, args: Sequence[V]) -> V:
        """What a region, vector field or course says of points or of other regions."""
        ...

    def region(self, node: RegionNode, args: Sequence[V]) -> V:
        """A region."""
        ...

    def among(self, node: Among, args: Sequence[V]) -> V:
        """What holds of label objects."""
        ...


def steps_of(*roots: Node, known: Container[int] = ()) -> Steps:
    """The steps in which expressions are interpreted; what they share once.

    Args:
        roots: The expressions.
        known: The ids of nodes whose values will be given, which need no steps.
    """
    return tuple((node, children(node)) for node in postorder(roots, beyond=known))


def interpret(steps: Steps, domain: AbstractDomain[V], given: Mapping[int, V] | None = None) -> dict[int, V]:
    """The abstract value of each node, by the node's id.

    Args:
        steps: Those of the expressions.
        domain: What operations do.
        given: Values of some nodes, by their ids.
    """
    known: dict[int, V] = dict(given or {})
    for node, below in steps:
        if id(node) not in known:
            known[id(node)] = _value(node, [known[id(child)] for child in below], domain)
    return known


def _value(node: Node, args: list[V], domain: AbstractDomain[V]) -> V:
    match node:
        case Constant():
            return domain.constant(node.value)
        case Feature():
            return domain.feature(node)
        case Arithmetic():
            return domain.arithmetic(node.op, args)
        case VectorOf():
            return domain.vector(args[0], args[1])
        case VectorSum():
            return domain.sum(args[0], args[1])
        case Scale():
            return domain.scale(args[0], args[1])
        case Rotate():
            return domain.rotate(args[0], args[1])
        case Coordinate():
            return domain.coordinate(args[0], node.axis)
        case Norm():
            return domain.norm(args[0])
        case Bearing():
            return domain.bearing(args[0])
        case Compare():
            return domain.compare(node.op, args[0], args[1])
        case Logic():
            return domain.logic(node.op, args)
        case Select():
            return domain.select(args[0], args[1:])
        case Range() | DiscreteRange() | Normal() | TruncatedNormal() | Index() | PointIn():
            return domain.variable(node, args)
        case (
            Distance() | DirectionAt() | Contains() | Intersects() | Encloses() | CourseCoordinate() | Measure()
            | LaneCourse()
        ):  # fmt: skip
            return domain.on_map(node, args)
        case (
            DiscAt() | SectorAt() | RectangleAt() | Corridor() | AheadInLanes() | RegionUnion()
            | RegionIntersection() | RegionDifference()
        ):  # fmt: skip
            return domain.region(node, args)
        case Among():
            return domain.among(node, args)
        case _:
            assert_never(node)
