"""Specifiers: what can follow the class of an instance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from scenicq.errors import Span
from scenicq.syntax.nodes.base import Node

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression

__all__ = [
    "ApparentlyFacingSpecifier",
    "AtSpecifier",
    "BeyondSpecifier",
    "ContainedInSpecifier",
    "DirectionSpecifier",
    "FacingAwayFromSpecifier",
    "FacingSpecifier",
    "FacingTowardSpecifier",
    "FollowingSpecifier",
    "InSpecifier",
    "NotVisibleSpecifier",
    "OffsetAlongSpecifier",
    "OffsetBySpecifier",
    "OnSpecifier",
    "UsingSpecifier",
    "VisibleSpecifier",
    "WithSpecifier",
]


@dataclass(frozen=True, slots=True, eq=False)
class WithSpecifier(Node):
    """`with property value`."""

    property: str
    property_span: Span
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class AtSpecifier(Node):
    """`at position`."""

    position: Expression


@dataclass(frozen=True, slots=True, eq=False)
class InSpecifier(Node):
    """`in region`."""

    region: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OnSpecifier(Node):
    """`on region` (Scenic 3: also a vector)."""

    region: Expression


@dataclass(frozen=True, slots=True, eq=False)
class ContainedInSpecifier(Node):
    """`contained in region`."""

    region: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetBySpecifier(Node):
    """`offset by offset`."""

    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetAlongSpecifier(Node):
    """`offset along direction by offset`."""

    direction: Expression
    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class BeyondSpecifier(Node):
    """`beyond target by offset [from origin]`."""

    target: Expression
    offset: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class VisibleSpecifier(Node):
    """`visible [from viewer]`."""

    viewer: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class NotVisibleSpecifier(Node):
    """`not visible [from viewer]`."""

    viewer: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class DirectionSpecifier(Node):
    """`left of reference [by distance]`, and `right of`, `ahead of`, `behind`, `above`, `below`."""

    direction: Literal["left", "right", "ahead", "behind", "above", "below"]
    reference: Expression
    distance: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class FollowingSpecifier(Node):
    """`following field [from origin] for distance`."""

    field: Expression
    origin: Expression | None
    distance: Expression


@dataclass(frozen=True, slots=True, eq=False)
class FacingSpecifier(Node):
    """`facing heading`, of a heading or a vector field."""

    heading: Expression


@dataclass(frozen=True, slots=True, eq=False)
class FacingTowardSpecifier(Node):
    """`facing [directly] toward target`."""

    target: Expression
    directly: bool


@dataclass(frozen=True, slots=True, eq=False)
class FacingAwayFromSpecifier(Node):
    """`facing [directly] away from target`."""

    target: Expression
    directly: bool


@dataclass(frozen=True, slots=True, eq=False)
class ApparentlyFacingSpecifier(Node):
    """`apparently facing heading [from origin]`."""

    heading: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class UsingSpecifier(Node):
    """`using f(...)`."""

    value: Expression
