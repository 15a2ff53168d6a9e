"""Specifiers: what can follow the class of an instance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from scenicq.errors import Span
from scenicq.syntax.nodes.base import SyntaxNode

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
class WithSpecifier(SyntaxNode):
    """`with property value`."""

    property: str
    property_span: Span
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class AtSpecifier(SyntaxNode):
    """`at position`."""

    position: Expression


@dataclass(frozen=True, slots=True, eq=False)
class InSpecifier(SyntaxNode):
    """`in region`."""

    region: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OnSpecifier(SyntaxNode):
    """`on region` (Scenic 3: also a vector)."""

    region: Expression


@dataclass(frozen=True, slots=True, eq=False)
class ContainedInSpecifier(SyntaxNode):
    """`contained in region`."""

    region: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetBySpecifier(SyntaxNode):
    """`offset by offset`."""

    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class OffsetAlongSpecifier(SyntaxNode):
    """`offset along direction by offset`."""

    direction: Expression
    offset: Expression


@dataclass(frozen=True, slots=True, eq=False)
class BeyondSpecifier(SyntaxNode):
    """`beyond target by offset [from origin]`."""

    target: Expression
    offset: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class VisibleSpecifier(SyntaxNode):
    """`visible [from viewer]`."""

    viewer: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class NotVisibleSpecifier(SyntaxNode):
    """`not visible [from viewer]`."""

    viewer: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class DirectionSpecifier(SyntaxNode):
    """`left of reference [by distance]`, and `right of`, `ahead of`, `behind`, `above`, `below`."""

    direction: Literal["left", "right", "ahead", "behind", "above", "below"]
    reference: Expression
    distance: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class FollowingSpecifier(SyntaxNode):
    """`following field [from origin] for distance`."""

    field: Expression
    origin: Expression | None
    distance: Expression


@dataclass(frozen=True, slots=True, eq=False)
class FacingSpecifier(SyntaxNode):
    """`facing heading`, of a heading or a vector field."""

    heading: Expression


@dataclass(frozen=True, slots=True, eq=False)
class FacingTowardSpecifier(SyntaxNode):
    """`facing [directly] toward target`."""

    target: Expression
    directly: bool


@dataclass(frozen=True, slots=True, eq=False)
class FacingAwayFromSpecifier(SyntaxNode):
    """`facing [directly] away from target`."""

    target: Expression
    directly: bool


@dataclass(frozen=True, slots=True, eq=False)
class ApparentlyFacingSpecifier(SyntaxNode):
    """`apparently facing heading [from origin]`."""

    heading: Expression
    origin: Expression | None


@dataclass(frozen=True, slots=True, eq=False)
class UsingSpecifier(SyntaxNode):
    """`using f(...)`."""

    value: Expression
