"""Necessary conditions: what must hold of a frame's columns for the frame to match.

Taken from the forest by interval analysis. Each condition has a name, the place in the program it comes from, and holds
for every label that matches (the tests compare with and without them).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

from scenicq.errors import Span
from scenicq.forest.bounds import EVERYTHING, Interval, scalar_bounds, vector_bounds
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    DirectionAt,
    DiscAt,
    Feature,
    Node,
    PointIn,
    RegionIntersection,
    Rotate,
    SectorAt,
    VectorSum,
)
from scenicq.forest.scenario import Scenario, ScenarioObject
from scenicq.forest.walk import features
from scenicq.geometry.network import Network
from scenicq.geometry.regions import IntersectionOf, PolygonSet, Region, UnionOf
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.options import MatchOptions
from scenicq.query.expression import SLACK, Columns, angle_between, number, requirement_sql
from scenicq.store.schema import MEMBERSHIP_RADIUS_M
from scenicq.store.sql import sql_text

__all__ = ["Condition", "object_conditions"]

_MOST_IDS = 2000
"""Regions named one by one in a condition, at most."""

_OBSERVED = ("position", "heading")


@dataclass(frozen=True, slots=True)
class Condition:
    """A necessary condition on one object's row (or the ego's).

    Attributes:
        what: The feature or requirement, in the words of the program.
        sql: Over the columns of `objects` (or `labels`, for the ego); `{near}` stands for the object's memberships.
        span: Where the program says it.
        region: For a condition on memberships: the SQL over their columns.
    """

    what: str
    sql: str
    span: Span | None
    region: str = ""


def _columns(scenario: Scenario, index: int) -> Columns:
    ego = scenario.ego
    found: dict[tuple[int, str], str | tuple[str, str]] = {
        (ego, "position"): ("ego_x", "ego_y"),
        (ego, "heading"): "ego_heading",
    }
    if index != ego:
        found[index, "position"] = ("x", "y")
        found[index, "heading"] = "heading"
    return found


@dataclass(frozen=True, slots=True)
class _Names:
    """What the regions of a network are called in `memberships`.

    Attributes:
        kinds: The kinds of map element whose union a region is, by the region's identity.
        elements: The name of the map element that each element's area is.
    """

    kinds: dict[int, tuple[str, ...]]
    elements: dict[str, str]


def _names(network: Network) -> _Names:
    kinds = {
        id(network.laneRegion): ("lane",),
        id(network.intersectionRegion): ("intersection",),
        id(network.crossingRegion): ("crossing",),
        id(network.sidewalkRegion): ("sidewalk",),
        id(network.shoulderRegion): ("shoulder",),
        id(network.drivableRegion): ("lane", "road", "intersection", "drivable"),
    }
    elements = {feature.id: feature.id for feature in network.features}
    for section in network.laneSections:
        # A lane that the map does not cut is its own only section, which the map has no name for.
        elements.setdefault(section.id, section.lane.id)
    return _Names(kinds, elements)


def _near(region: Region, names: _Names, reach: float) -> str | None:
    """A condition on the columns of `memberships` that some row of an object in the region meets."""
    match region:
        case PolygonSet():
            known = region.ids and all(name in names.elements for name in region.ids)
            if id(region) in names.kinds:
                wanted = ", ".join(map(sql_text, names.kinds[id(region)]))
                chosen = f"kind IN ({wanted})"
            elif known and len(region.ids) <= _MOST_IDS and len(region.ids) == len(region.polygons):
                chosen = f"region IN ({', '.join(sql_text(names.elements[name]) for name in region.ids)})"
            else:
                return None
            return f"({chosen} AND distance <= {number(reach + SLACK)})"
        case UnionOf():
            parts = [_near(part, names, reach) for part in region.parts]
            if any(part is None for part in parts):
                return None
            return "(" + " OR ".join(part for part in parts if part is not None) + ")"
        case _:
            return None


def _region_conditions(
    region: Node, what: str, span: Span | None, names: _Names | None, ego: int, reach: float
) -> Iterator[Condition]:
    match region:
        case Constant():
            known = cast(Region, region.value)
            for part in known.parts if isinstance(known, IntersectionOf) else (known,):
                near = None if names is None else _near(part, names, reach)
                if near is not None:
                    yield Condition(what, "{near}", span, near)
        case RegionIntersection():
            for part in region.parts:
                yield from _region_conditions(part, what, span, names, ego, reach)
        case DiscAt() | SectorAt():
            center = region.center
            if isinstance(center, Feature) and (center.object, center.property) == (ego, "position"):
                _, high = scalar_bounds(region.radius)
                if math.isfinite(high):
                    yield Condition(what, f"ego_distance <= {number(high + reach + SLACK)}", span)
        case _:
            return


def _within(column: str, limits: Interval, reach: float) -> Iterator[str]:
    low, high = limits
    if math.isfinite(low):
        yield f"{column} >= {number(low - reach - SLACK)}"
    if math.isfinite(high):
        yield f"{column} <= {number(high + reach + SLACK)}"


def _is_feature(node: Node, index: int, name: str) -> bool:
    return isinstance(node, Feature) and (node.object, node.property) == (index, name)


def _position_conditions(
    node: Node, what: str, span: Span | None, names: _Names | None, ego: int, reach: float
) -> Iterator[Condition]:
    if isinstance(node, PointIn):
        # Memberships are recorded up to a distance: a wider tolerance cannot be prefiltered by them.
        close = reach <= MEMBERSHIP_RADIUS_M - SLACK
        yield from _region_conditions(node.region, what, span, names if close else None, ego, reach)
        return
    if isinstance(node, VectorSum) and _is_feature(node.left, ego, "position"):
        turned = node.right
        if isinstance(turned, Rotate) and _is_feature(turned.angle, ego, "heading"):
            right, ahead = vector_bounds(turned.vector)
            for column, limits in (("ego_right", right), ("ego_ahead", ahead)):
                for sql in _within(column, limits, reach):
                    yield Condition(what, sql, span)


def _heading_terms(node: Node) -> tuple[list[Node], Interval] | None:
    """A heading as a sum of at most one known term (a feature or field) and an interval."""
    known: list[Node] = []
    total: Interval = (0.0, 0.0)
    stack = [node]
    while stack:
        part = stack.pop()
        if isinstance(part, Arithmetic) and part.op is ArithmeticOp.ADD:
            stack.extend(part.args)
        elif isinstance(part, Feature | DirectionAt):
            known.append(part)
        else:
            if features(part):
                return None
            low, high = scalar_bounds(part)
            total = (total[0] + low, total[1] + high)
    return known, total


def _heading_condition(
    node: Node, what: str, span: Span | None, thing: ScenarioObject, ego: int, width: float
) -> Condition | None:
    found = _heading_terms(node)
    if found is None or len(found[0]) != 1 or EVERYTHING[1] in (found[1][1], -found[1][0]):
        return None
    (term,), (low, high) = found
    low, high = low - width, high + width
    if high - low >= math.tau:
        return None
    own, directions = ("ego_heading", "ego_road_directions") if thing.index == ego else ("heading", "road_directions")
    if thing.index != ego and _is_feature(term, ego, "heading"):
        return Condition(what, angle_between("relative_heading", low, high), span)
    if not (isinstance(term, DirectionAt) and _is_feature(term.point, thing.index, "position")):
        return None
    if not (isinstance(term.field, Constant) and isinstance(term.field.value, RoadDirection)):
        return None
    test = angle_between(f"({own} - d)", low, high)
    return Condition(what, f"({own} IS NULL OR len(list_filter({directions}, lambda d: {test})) > 0)", span)


def object_conditions(
    scenario: Scenario, thing: ScenarioObject, network: Network, options: MatchOptions
) -> Iterator[Condition]:
    """The necessary conditions on the label object that plays a role (for the ego: on the frame).

    Args:
        scenario: The scenario.
        thing: One of its objects.
        network: The map it was compiled for.
        options: Tolerances and radius.
    """
    ego = scenario.ego

    reach = options.tolerance.reach
    if not thing.mutated and not any(other.mutated for other in scenario.objects):
        for name in _OBSERVED:
            given = thing.properties[name]
            what = f"{thing.name}.{name}"
            node = given.value
            if name == "position":
                yield from _position_conditions(node, what, given.span, _names(network), ego, reach)
            else:
                found = _heading_condition(node, what, given.span, thing, ego, options.tolerance.heading)
                if found is not None:
                    yield found
    if thing.index != ego and options.radius is not None:
        yield Condition(f"{thing.name} within radius", f"ego_distance <= {number(options.radius + SLACK)}", thing.span)
    yield from _requirements(scenario, thing)


def _requirements(scenario: Scenario, thing: ScenarioObject) -> Iterator[Condition]:
    if any(other.mutated for other in scenario.objects):
        return
    for requirement in scenario.requirements:
        about = {index for index, _ in features(requirement.condition)}
        others = about - {scenario.ego}
        if requirement.built_in is not None or others != ({thing.index} - {scenario.ego}):
            continue
        sql = requirement_sql(requirement.condition, _columns(scenario, thing.index))
        if sql is not None and requirement.span is not None:
            yield Condition(" ".join(requirement.span.text.split()), sql, requirement.span)
