"""Scenic's expressions: instances and the operators on vectors, headings, regions and objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from scenicq.syntax.nodes.base import SyntaxNode

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression, Specifier

__all__ = [
    "Altitude",
    "Angle",
    "ApparentHeading",
    "CanSee",
    "Deg",
    "DistanceOperator",
    "DistancePast",
    "FieldAt",
    "Follow",
    "Implies",
    "InitialScenario",
    "IntersectsOperator",
    "New",
    "OffsetAlong",
    "OffsetBy",
    "PartOf",
    "RelativeHeading",
    "RelativePosition",
    "RelativeTo",
    "Temporal",
    "UntilOperator",
    "VectorOperator",
    "Visible",
    "VisibleFrom",
]


@dataclass(frozen=True, slots=True, eq=False)
class New(SyntaxNode):
    """An instance: `new Car at (1, 2)` (3), `Car at 1 @ 2` (1 and 2: `keyword` is false, at least one specifier)."""

    cls: Expression
    specifiers: tuple[Specifier, ...]
    keyword: bool


@dataclass(frozen=True, slots=True, eq=False)
class Deg(SyntaxNode):
    """`value deg`."""

    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class VectorOperator(SyntaxNode):
    """`x @ y`."""

    x: Expression
    y: Expression


@dataclass(frozen=True, slots=True, eq=False)
class FieldAt(SyntaxNode):
    """`field at position`."""

    field: Expression
    position: Expression


@dataclass(frozen=True, slots=True, eq=False)
class RelativeTo(SyntaxNode):
    """`left relative to right`, of headings, fields or vectors."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetBy(SyntaxNode):
    """`origin offset by offset`."""

    origin: Expression
    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetAlong(SyntaxNode):
    """`origin offset along direction by offset`."""

    origin: Expression
    direction: Expression
    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class RelativePosition(SyntaxNode):
    """`relative position of target [from origin]`; without origin, from the ego (as for all that follow)."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class RelativeHeading(SyntaxNode):
    """`relative heading of target [from origin]`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class ApparentHeading(SyntaxNode):
    """`apparent heading of target [from origin]`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class DistanceOperator(SyntaxNode):
    """`distance [from origin] to target`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class DistancePast(SyntaxNode):
    """`distance past target [of origin]`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Angle(SyntaxNode):
    """`angle [from origin] to target`, also spelled `azimuth`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Altitude(SyntaxNode):
    """`altitude [from origin] to target`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class CanSee(SyntaxNode):
    """`viewer can see target`."""

    viewer: Expression
    target: Expression


@dataclass(frozen=True, slots=True, eq=False)
class IntersectsOperator(SyntaxNode):
    """`left intersects right`."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Follow(SyntaxNode):
    """`follow field [from origin] for distance`."""

    field: Expression
    origin: Expression | None
    distance: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Visible(SyntaxNode):
    """`visible region`, `not visible region`: the part that the ego sees, or does not."""

    region: Expression
    negated: bool


@dataclass(frozen=True, slots=True, eq=False)
class VisibleFrom(SyntaxNode):
    """`region visible from viewer`, `region not visible from viewer`."""

    region: Expression
    viewer: Expression
    negated: bool


@dataclass(frozen=True, slots=True, eq=False)
class PartOf(SyntaxNode):
    """`front of target`, `front left of target`, ...: a point of the box, oriented along the heading."""

    part: str
    target: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Temporal(SyntaxNode):
    """`always x`, `eventually x`, `next x`."""

    operator: Literal["always", "eventually", "next"]
    operand: Expression


@dataclass(frozen=True, slots=True, eq=False)
class UntilOperator(SyntaxNode):
    """`left until right`."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Implies(SyntaxNode):
    """`left implies right`."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class InitialScenario(SyntaxNode):
    """`initial scenario`: true in the scenario that runs first."""
