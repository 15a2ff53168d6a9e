"""Regions of the plane as values.

The language paper's regions (its table of operators over regions), closed: the boundary counts as inside. What can be
asked of a region is a function in `membership`, `meeting`, `cells` and `sampling`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
from shapely import STRtree
from shapely.geometry import LineString, MultiLineString, MultiPolygon, Polygon

from scenicq.geometry import shapes
from scenicq.geometry.fields import VectorField
from scenicq.geometry.shapes import XY, Bounds, Shape

__all__ = [
    "SLACK",
    "XY",
    "Bounds",
    "DeferredPolygons",
    "DeferredPolylines",
    "DifferenceOf",
    "Disc",
    "Everywhere",
    "IntersectionOf",
    "Nowhere",
    "PointSet",
    "PolygonSet",
    "PolylineSet",
    "Rectangle",
    "Region",
    "Sector",
    "UnionOf",
    "difference",
    "intersection",
    "orientation_of",
    "union",
]

SLACK = 1e-9
"""Metres by which a point may miss a region and still count as on its boundary."""


@dataclass(frozen=True, slots=True, eq=False)
class Everywhere:
    """The whole plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Nowhere:
    """The empty region."""


@dataclass(frozen=True, slots=True, eq=False)
class Disc:
    """All points within a radius (metres, at least 0) of a centre."""

    center: XY
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Sector:
    """The part of a disc within `angle / 2` of a heading, as seen from the centre.

    Attributes:
        center: The apex.
        radius: Metres.
        heading: Radians, the middle of the sector.
        angle: Full opening in radians; from 2 pi on the sector is the disc.
    """

    center: XY
    radius: float
    heading: float
    angle: float


@dataclass(frozen=True, slots=True, eq=False)
class Rectangle:
    """A box: `length` along the heading, `width` across, in metres."""

    center: XY
    heading: float
    width: float
    length: float


class _Indexed:
    """What the sets of shapes share: a flat tuple of simple shapes under a lazily built search tree."""

    @cached_property
    def pieces(self) -> tuple[Shape, ...]:
        """The simple, non-empty shapes that make up the set."""
        return shapes.simple_parts(self._shapes())

    @cached_property
    def tree(self) -> STRtree:
        """Search tree over `pieces`."""
        return STRtree(self.pieces)

    @cached_property
    def extent(self) -> Bounds:
        """The box around the set."""
        return shapes.total_bounds(self.pieces)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing in it."""
        return not self.pieces

    def near(self, bounds: Bounds) -> list[Shape]:
        """The pieces whose boxes meet the given one, in order."""
        found: list[int] = np.sort(shapes.tree_query(self.tree, shapes.box(*bounds))).tolist()
        return [self.pieces[index] for index in found]

    def _shapes(self) -> tuple[Shape, ...]:
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class PolygonSet(_Indexed):
    """The union of polygons that may overlap, up to 10^4 of them; they are never merged.

    Attributes:
        polygons: Valid polygons.
        name: What messages call the region.
        orientation: The preferred heading of what is placed in the region.
        ids: The map's identifiers of the polygons, in their order, or empty.
    """

    polygons: tuple[Polygon | MultiPolygon, ...] = field(repr=False)
    name: str
    orientation: VectorField | None = field(default=None, repr=False)
    ids: tuple[str, ...] = field(default=(), repr=False)

    def _shapes(self) -> tuple[Shape, ...]:
        return self.polygons


class DeferredPolygons(PolygonSet):
    """The union of polygons that are worked out when somebody asks for them."""

    def __init__(self, name: str, make: Callable[[], PolygonSet]) -> None:
        """Take the name, and what makes the region."""
        vars(self).update(name=name, orientation=None, ids=(), _make=make)

    @cached_property
    def _made(self) -> PolygonSet:
        return vars(self)["_make"]()

    @property
    def polygons(self) -> tuple[Polygon | MultiPolygon, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Valid polygons."""
        return self._made.polygons


@dataclass(frozen=True, eq=False)
class PolylineSet(_Indexed):
    """The union of polylines.

    Attributes:
        lines: Polylines.
        name: What messages call the region.
        orientation: The preferred heading of what is placed in the region.
    """

    lines: tuple[LineString | MultiLineString, ...] = field(repr=False)
    name: str
    orientation: VectorField | None = field(default=None, repr=False)

    def _shapes(self) -> tuple[Shape, ...]:
        return self.lines


class DeferredPolylines(PolylineSet):
    """The union of polylines that are worked out when somebody asks for them."""

    def __init__(self, name: str, make: Callable[[], PolylineSet], orientation: VectorField | None = None) -> None:
        """Take the name, what makes the region, and its preferred heading if that is known before."""
        vars(self).update(name=name, _make=make, _orientation=orientation)

    @cached_property
    def _made(self) -> PolylineSet:
        return vars(self)["_make"]()

    @property
    def lines(self) -> tuple[LineString | MultiLineString, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Polylines."""
        return self._made.lines

    @property
    def orientation(self) -> VectorField | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The preferred heading of what is placed in the region."""
        return vars(self)["_orientation"] or self._made.orientation


@dataclass(frozen=True, eq=False)
class PointSet(_Indexed):
    """Finitely many points, each (x, y) in metres."""

    points: tuple[XY, ...]
    name: str

    def _shapes(self) -> tuple[Shape, ...]:
        return tuple(shapes.point(x, y) for x, y in self.points)


@dataclass(frozen=True, slots=True, eq=False)
class UnionOf:
    """What lies in any part."""

    parts: tuple[Region, ...]


@dataclass(frozen=True, slots=True, eq=False)
class IntersectionOf:
    """What lies in every part."""

    parts: tuple[Region, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DifferenceOf:
    """The closure of what lies in the base and not in the removed region."""

    base: Region
    removed: Region


Region: TypeAlias = (
    Everywhere
    | Nowhere
    | Disc
    | Sector
    | Rectangle
    | PolygonSet
    | PolylineSet
    | PointSet
    | UnionOf
    | IntersectionOf
    | DifferenceOf
)
"""Any region."""


def union(*regions: Region) -> Region:
    """The union, flattened and without what changes nothing."""
    parts: list[Region] = []
    for region in regions:
        match region:
            case Nowhere():
                pass
            case Everywhere():
                return region
            case UnionOf():
                parts += region.parts
            case _:
                parts.append(region)
    return parts[0] if len(parts) == 1 else UnionOf(tuple(parts)) if parts else Nowhere()


def intersection(*regions: Region) -> Region:
    """The intersection, flattened and without what changes nothing."""
    parts: list[Region] = []
    for region in regions:
        match region:
            case Everywhere():
                pass
            case Nowhere():
                return region
            case IntersectionOf():
                parts += region.parts
            case _:
                parts.append(region)
    return parts[0] if len(parts) == 1 else IntersectionOf(tuple(parts)) if parts else Everywhere()


def difference(base: Region, removed: Region) -> Region:
    """The difference; removing one region after another removes their union."""
    if isinstance(base, Nowhere) or isinstance(removed, Nowhere):
        return base
    if isinstance(removed, Everywhere):
        return Nowhere()
    if isinstance(base, DifferenceOf):
        return DifferenceOf(base.base, union(base.removed, removed))
    return DifferenceOf(base, removed)


def orientation_of(region: Region) -> VectorField | None:
    """The preferred orientation: a set's own, that of a difference's base, the first of an intersection or union."""
    match region:
        case PolygonSet() | PolylineSet():
            return region.orientation
        case DifferenceOf():
            return orientation_of(region.base)
        case IntersectionOf() | UnionOf():
            found = (orientation_of(part) for part in region.parts)
            return next((field for field in found if field is not None), None)
        case _:
            return None
