"""Any region, near some place, as a union of simple terms: a clip shape cut by a few circles.

This is what makes questions about combined regions exact. Polygons are intersected and subtracted by shapely, and each
result is a shape again; discs stay what they are, as conditions on the distance to their centres. A sector is a disc
and a polygon that agrees with the sector's wedge inside the disc.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import assert_never

from scenicq.errors import CannotEvaluate
from scenicq.geometry import shapes
from scenicq.geometry.angles import direction
from scenicq.geometry.boxes import corners
from scenicq.geometry.regions import (
    SLACK,
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    Nowhere,
    PointSet,
    PolygonSet,
    PolylineSet,
    Rectangle,
    Region,
    Sector,
    UnionOf,
)
from scenicq.geometry.shapes import Bounds, Shape
from scenicq.limits import LIMITS

__all__ = ["Circle", "Term", "both", "overlap", "rectangle_shape", "terms"]

_MANY_CORNERS = 256
"""Polygons with more corners are cut to the neighbourhood first."""
_PAD = 1e-6
"""Metres around a term's box, so that it has an area and its border lies beyond the reach of `SLACK`."""


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle: centre and radius, in metres."""

    x: float
    y: float
    radius: float

    def holds(self, bounds: Bounds) -> bool:
        """Whether a box lies inside."""
        return _reach(self.x, self.y, bounds) <= self.radius

    def misses(self, bounds: Bounds) -> bool:
        """Whether a box lies outside."""
        west, south, east, north = bounds
        dx, dy = max(west - self.x, self.x - east, 0.0), max(south - self.y, self.y - north, 0.0)
        return math.hypot(dx, dy) > self.radius + SLACK


@dataclass(frozen=True, slots=True)
class Term:
    """The points of a bounded shape that lie in or on all of some circles, and outside of or on all of others."""

    clip: Shape
    inside: tuple[Circle, ...] = ()
    outside: tuple[Circle, ...] = ()


def overlap(a: Bounds, b: Bounds) -> Bounds:
    """What two boxes share; some minimum exceeds its maximum if that is nothing."""
    return max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])


def terms(region: Region, box: Bounds) -> Iterator[Term]:
    """The region as a union of terms that are right inside a finite box (outside of it they may hold more or less).

    Raises:
        CannotEvaluate: The region removes too many discs.
    """
    if box[0] > box[2] or box[1] > box[3]:
        return
    match region:
        case Everywhere():
            yield Term(shapes.box(*box))
        case Nowhere():
            pass
        case Disc():
            yield from _cut(Term(shapes.box(*box)), Circle(*region.center, region.radius))
        case Sector():
            yield from _sector(region, box)
        case Rectangle():
            yield Term(rectangle_shape(region))
        case PolygonSet() | PolylineSet() | PointSet():
            for piece in region.near(box):
                large = shapes.corner_count(piece) > _MANY_CORNERS
                yield Term(shapes.intersection(piece, shapes.box(*box)) if large else piece)
        case UnionOf():
            for part in region.parts:
                yield from terms(part, box)
        case IntersectionOf():
            yield from _intersection(region.parts, box)
        case DifferenceOf():
            for term in terms(region.base, box):
                yield from _without(term, region.removed, box)
        case _:
            assert_never(region)


def both(a: Term, b: Term) -> Iterator[Term]:
    """What two terms share, as at most one term."""
    clip = shapes.intersection(a.clip, b.clip)
    if not clip.is_empty:
        yield from _reduced(Term(clip, a.inside + b.inside, a.outside + b.outside))


def _reduced(term: Term) -> Iterator[Term]:
    """The term without circles that change nothing, or nothing if some circle empties it."""
    bounds = shapes.bounds_of(term.clip)
    if any(circle.radius < 0 or circle.misses(bounds) for circle in term.inside):
        return
    if any(circle.radius > 0 and _reach(circle.x, circle.y, bounds) < circle.radius - SLACK for circle in term.outside):
        return
    inside = tuple(dict.fromkeys(circle for circle in term.inside if not circle.holds(bounds)))
    outside = tuple(dict.fromkeys(c for c in term.outside if c.radius > 0 and not c.misses(bounds)))
    yield Term(term.clip, inside, outside)


def _cut(term: Term, circle: Circle) -> Iterator[Term]:
    yield from _reduced(Term(term.clip, (*term.inside, circle), term.outside))


def _sector(sector: Sector, box: Bounds) -> Iterator[Term]:
    circle = Circle(*sector.center, sector.radius)
    if sector.angle >= math.tau or sector.radius <= 0:
        yield from _cut(Term(shapes.box(*box)), circle)
        return
    x, y = sector.center
    # a fan of corners at most 45 degrees apart, far enough out that its edges stay beyond the disc and the box
    far = 1.5 * min(sector.radius, _reach(x, y, box)) + 1.0
    angle = max(sector.angle, 0.0)
    count = math.ceil(angle / (math.pi / 4))
    headings = [sector.heading - angle / 2 + angle * i / max(count, 1) for i in range(count + 1)]
    fan = [(x + far * dx, y + far * dy) for dx, dy in map(direction, headings)]
    yield from _cut(Term(shapes.polygon([(x, y), *fan]) if angle > 0 else shapes.line([(x, y), *fan])), circle)


def _intersection(parts: tuple[Region, ...], box: Bounds) -> Iterator[Term]:
    if not parts:
        yield Term(shapes.box(*box))
        return
    # discs and the like first: they are one term each and shrink where the others must be looked at
    first, *others = sorted(parts, key=lambda part: isinstance(part, PolygonSet | UnionOf | DifferenceOf))
    for term in terms(first, box):
        for rest in _intersection(tuple(others), _within(term, box)):
            yield from both(term, rest)


def _within(term: Term, box: Bounds) -> Bounds:
    for circle in term.inside:
        x, y, r = circle.x, circle.y, circle.radius + _PAD
        box = overlap(box, (x - r, y - r, x + r, y + r))
    west, south, east, north = shapes.bounds_of(term.clip)
    return overlap(box, (west - _PAD, south - _PAD, east + _PAD, north + _PAD))


def rectangle_shape(region: Rectangle) -> Shape:
    """A rectangle as a polygon, or as a polyline if it has no area."""
    outline = corners(*region.center, region.heading, region.width, region.length)
    return shapes.polygon(outline) if region.width > 0 and region.length > 0 else shapes.line(outline)


def _without(term: Term, removed: Region, box: Bounds) -> list[Term]:
    box = _within(term, box)
    groups: dict[tuple[tuple[Circle, ...], tuple[Circle, ...]], list[Shape]] = {}
    for other in terms(removed, box):
        groups.setdefault((other.inside, other.outside), []).append(other.clip)
    left = [term]
    for (inside, outside), clips in groups.items():
        merged = clips[0] if len(clips) == 1 else shapes.union_all(clips)
        cut: list[Term] = []
        for old in left:
            clip = shapes.difference(old.clip, merged)
            if not clip.is_empty:
                cut += _reduced(Term(clip, old.inside, old.outside))
            for circle in inside:
                cut += _reduced(Term(old.clip, old.inside, (*old.outside, circle)))
            for circle in outside:
                cut += _reduced(Term(old.clip, (*old.inside, circle), old.outside))
        if len(cut) > LIMITS.difference_terms:
            raise CannotEvaluate("the region removes too many separate discs")
        left = cut
    return left


def _reach(x: float, y: float, bounds: Bounds) -> float:
    """Distance from a point to the farthest corner of a box."""
    west, south, east, north = bounds
    return math.hypot(max(x - west, east - x), max(y - south, north - y))
