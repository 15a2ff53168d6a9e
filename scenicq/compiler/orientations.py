"""The preferred heading of a region at a point: what `on` and `in` give besides a place."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import cast

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.compute import fold
from scenicq.forest.nodes import (
    CompareOp,
    Constant,
    DirectionAt,
    Distance,
    Node,
    Range,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Select,
    Undefined,
)
from scenicq.geometry.abstract_map import AbstractDirection
from scenicq.geometry.regions import (
    DifferenceOf,
    IntersectionOf,
    PolygonSet,
    PolylineSet,
    Region,
    UnionOf,
    orientation_of,
)

__all__ = ["orientation", "surely_gives_a_heading"]


def orientation(region: Node, point: Node, span: Span | None) -> Node | None:
    """The preferred heading of a region at a point; None if it has none.

    What lies in the areas of a map has a direction; where the map does not say which (sidewalks and crossings), it is
    any.
    """
    match region:
        case Constant(value=UnionOf() as union):
            return _of_union([build.constant(part, span) for part in union.parts], point, span)
        case Constant():
            field = orientation_of(cast(Region, region.value))
            if field is not None:
                return DirectionAt(build.constant(field, span), point, span=span)
            undirected = isinstance(region.value, PolygonSet) and region.value.ids
            return _any_heading(span) if undirected else None
        case Select():
            return _chosen_orientation(region, point, span)
        case RegionUnion():
            return _of_union(region.parts, point, span)
        case RegionIntersection():
            found = (orientation(part, point, span) for part in region.parts)
            return next((heading for heading in found if heading is not None), None)
        case RegionDifference():
            return orientation(region.base, point, span)
        case _:
            return None


def surely_gives_a_heading(region: Node, may_lack: Callable[[Node], bool]) -> bool:
    """Whether a region with a preferred heading gives it in every outcome.

    An element that is chosen at random may lack the part asked for: Scenic draws a random region once, while it
    compiles, and only where that succeeds does the region give a heading. Lines that something is taken off lose theirs
    in Scenic.

    Args:
        region: The region.
        may_lack: Whether some option of the choice with an index lacks a part.
    """
    todo = [region]
    while todo:
        part = _opened(todo.pop())
        match part:
            case Select():
                if may_lack(part.index):
                    return False
                todo += part.options
            case RegionIntersection() | RegionUnion():
                todo += part.parts
            case RegionDifference():
                if _is_of_lines(part.base):
                    return False
                todo += [part.base, part.removed]
            case _:
                pass
    return True


def _is_of_lines(region: Node) -> bool:
    """Whether some option of a region is lines."""
    todo = [region]
    while todo:
        part = _opened(todo.pop())
        match part:
            case Constant(value=PolylineSet()):
                return True
            case Select():
                todo += part.options
            case RegionIntersection():
                todo += part.parts
            case RegionDifference():
                todo.append(part.base)
            case _:
                pass
    return False


def _opened(region: Node) -> Node:
    """A known region that is made of others as what it is made of."""
    match region:
        case Constant(value=DifferenceOf() as known):
            return RegionDifference(build.constant(known.base), build.constant(known.removed))
        case Constant(value=IntersectionOf() as known):
            return RegionIntersection(tuple(map(build.constant, known.parts)))
        case _:
            return region


def _of_union(parts: Sequence[Node], point: Node, span: Span | None) -> Node | None:
    """The direction of the first part that has one and holds the point, or of the nearest where rounding decides."""
    headings = [(part, heading) for part in parts if (heading := orientation(part, point, span)) is not None]
    if not headings:
        return None
    others, found = headings.pop()
    for part, heading in reversed(headings):
        if _field(heading) is None or _field(heading) != _field(found):
            away = [fold(Distance(each, point, span=span)) for each in (part, others)]
            found = Select(build.compare(CompareOp.LE, away[0], away[1], span), (found, heading), span=span)
        others = fold(RegionUnion((part, others), span=span))
    return found


def _field(heading: Node) -> int | None:
    """What identifies the field that a heading is read from."""
    if not isinstance(heading, DirectionAt):
        return None
    return id(heading.field.value if isinstance(heading.field, Constant) else heading.field)


def _is_abstract(heading: Node) -> bool:
    """Whether a heading is that of any of several elements."""
    field = heading.field if isinstance(heading, DirectionAt) else None
    return isinstance(field, Constant) and isinstance(field.value, AbstractDirection)


def _any_heading(span: Span | None) -> Node:
    return Range(build.constant(-math.pi, span), build.constant(math.pi, span), span=span)


def _chosen_orientation(region: Select, point: Node, span: Span | None) -> Node | None:
    """The direction of a region chosen at random; an option that is no region has none, and does not count."""
    found: list[Node | None] = []
    for option in region.options:
        if isinstance(option, Constant) and isinstance(option.value, Undefined):
            found.append(None)
            continue
        heading = orientation(option, point, span)
        if heading is None:
            return None
        found.append(heading)
    if any(isinstance(heading, Range) for heading in found):
        return _any_heading(span)
    known = [heading for heading in found if heading is not None]
    if not known:
        return None
    fields = {_field(each) for each in known}
    if None in fields:
        return Select(region.index, tuple(heading or known[0] for heading in found), span=span)
    if len(fields) == 1 and not _is_abstract(known[0]):
        return known[0]
    options = tuple(cast(DirectionAt, heading or known[0]).field for heading in found)
    return DirectionAt(Select(region.index, options, span=span), point, span=span)
