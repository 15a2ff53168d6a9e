"""Scenic's expressions: instances and the operators on vectors, headings, regions and objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from scenicq.syntax.nodes.base import Node

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression, Specifier

__all__ = [
    "Altitude",
    "Angle",
    "ApparentHeading",
    "CanSee",
    "Deg",
    "Distance",
    "DistancePast",
    "FieldAt",
    "Follow",
    "Implies",
    "InitialScenario",
    "Intersects",
    "New",
    "OffsetAlong",
    "OffsetBy",
    "PartOf",
    "RelativeHeading",
    "RelativePosition",
    "RelativeTo",
    "Temporal",
    "Until",
    "Vector",
    "Visible",
    "VisibleFrom",
]


@dataclass(frozen=True, slots=True, eq=False)
class New(Node):
    """An instance: `new Car at (1, 2)` (3), `Car at 1 @ 2` (1 and 2: `keyword` is false, at least one specifier)."""

    cls: Expression
    specifiers: tuple[Specifier, ...]
    keyword: bool


@dataclass(frozen=True, slots=True, eq=False)
class Deg(Node):
    """`value deg`."""

    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Vector(Node):
    """`x @ y`."""

    x: Expression
    y: Expression


@dataclass(frozen=True, slots=True, eq=False)
class FieldAt(Node):
    """`field at position`."""

    field: Expression
    position: Expression


@dataclass(frozen=True, slots=True, eq=False)
class RelativeTo(Node):
    """`left relative to right`, of headings, fields or vectors."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetBy(Node):
    """`origin offset by offset`."""

    origin: Expression
    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetAlong(Node):
    """`origin offset along direction by offset`."""

    origin: Expression
    direction: Expression
    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class RelativePosition(Node):
    """`relative position of target [from origin]`; without origin, from the ego (as for all that follow)."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class RelativeHeading(Node):
    """`relative heading of target [from origin]`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class ApparentHeading(Node):
    """`apparent heading of target [from origin]`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Distance(Node):
    """`distance [from origin] to target`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class DistancePast(Node):
    """`distance past target [of origin]`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Angle(Node):
    """`angle [from origin] to target`, also spelled `azimuth`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class Altitude(Node):
    """`altitude [from origin] to target`."""

    target: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class CanSee(Node):
    """`viewer can see target`."""

    viewer: Expression
    target: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Intersects(Node):
    """`left intersects right`."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Follow(Node):
    """`follow field [from origin] for distance`."""

    field: Expression
    origin: Expression | None
    distance: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Visible(Node):
    """`visible region`, `not visible region`: the part that the ego sees, or does not."""

    region: Expression
    negated: bool


@dataclass(frozen=True, slots=True, eq=False)
class VisibleFrom(Node):
    """`region visible from viewer`, `region not visible from viewer`."""

    region: Expression
    viewer: Expression
    negated: bool


@dataclass(frozen=True, slots=True, eq=False)
class PartOf(Node):
    """`front of target`, `front left of target`, ...: a point of the box, oriented along the heading."""

    part: str
    target: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Temporal(Node):
    """`always x`, `eventually x`, `next x`."""

    operator: Literal["always", "eventually", "next"]
    operand: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Until(Node):
    """`left until right`."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Implies(Node):
    """`left implies right`."""

    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, eq=False)
class InitialScenario(Node):
    """`initial scenario`: true in the scenario that runs first."""
