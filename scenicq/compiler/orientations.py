"""The preferred heading of a region at a point: what `on` and `in` give besides a place."""

from __future__ import annotations

from typing import cast

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import (
    Constant,
    DirectionAt,
    Node,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Select,
    Undefined,
)
from scenicq.geometry.regions import Region, orientation_of

__all__ = ["orientation"]


def orientation(region: Node, point: Node, span: Span | None) -> Node | None:
    """The preferred heading of a region at a point; None if it has none."""
    match region:
        case Constant():
            field = orientation_of(cast(Region, region.value))
            return None if field is None else DirectionAt(build.constant(field, span), point, span=span)
        case Select():
            return _chosen_orientation(region, point, span)
        case RegionIntersection() | RegionUnion():
            found = (orientation(part, point, span) for part in region.parts)
            return next((heading for heading in found if heading is not None), None)
        case RegionDifference():
            return orientation(region.base, point, span)
        case _:
            return None


def _chosen_orientation(region: Select, point: Node, span: Span | None) -> Node | None:
    """That of a region chosen at random; an option that is no region has none either, and does not count."""
    found: list[Node | None] = []
    for option in region.options:
        if isinstance(option, Constant) and isinstance(option.value, Undefined):
            found.append(None)
            continue
        heading = orientation(option, point, span)
        if heading is None:
            return None
        found.append(heading)
    known = [cast(DirectionAt, heading) for heading in found if heading is not None]
    if not known:
        return None
    if len({id(each.field.value if isinstance(each.field, Constant) else each.field) for each in known}) == 1:
        return known[0]
    fields = tuple((known[0] if heading is None else cast(DirectionAt, heading)).field for heading in found)
    return DirectionAt(Select(region.index, fields, span=span), point, span=span)
