"""Look-ups at a random place of which nothing else is asked: which element lies there is a choice of its own.

`network.laneAt(p)` of a point anywhere on the road is any lane of which some part is road. As a choice between these it
needs no geometry when it is matched. The choice has the same outcomes but not their probabilities: for matching only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

from scenicq.forest import build
from scenicq.forest.compute import fold
from scenicq.forest.nodes import (
    Arithmetic,
    Constant,
    DirectionAt,
    Identity,
    Index,
    Node,
    PointIn,
    Select,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.simplify import rebuilt, roots_of
from scenicq.forest.walk import children, postorder, transform
from scenicq.geometry.occupancy import ElementAtPoint, Occupancy
from scenicq.geometry.regions import Everywhere, PolygonSet

__all__ = ["choose_elements"]


def choose_elements(scenario: Scenario) -> Scenario:
    """The scenario with choices in place of look-ups at places that nothing else depends on."""
    tables = _free_places(roots_of(scenario))
    picks: dict[Identity, Node] = {}
    found: dict[tuple[int, int], tuple[int, ...]] = {}
    for identity, (table, region) in tables.items():
        key = id(table), id(region.value)
        if key not in found:
            found[key] = _found_in(table, region)
        numbers = found[key]
        if len(numbers) > 1:
            options = tuple(build.constant(number / table.scale, region.span) for number in numbers)
            picks[identity] = Select(Index((1.0,) * len(numbers), span=region.span), options, span=region.span)
    if not picks:
        return scenario
    memo: dict[int, Node] = {}
    return rebuilt(scenario, lambda node: transform(node, lambda each: _step(each, picks), memo))


def _free_places(roots: list[Node]) -> dict[Identity, tuple[Occupancy, Constant]]:
    """Random points of a known area that only look-ups of one kind use: the look-up, and the area."""
    found: dict[Identity, tuple[Occupancy, Constant]] = {}
    others: set[Identity] = {root.identity for root in roots if isinstance(root, PointIn)}
    for node in postorder(roots):
        for child in children(node):
            if not isinstance(child, PointIn):
                continue
            field = node.field if isinstance(node, DirectionAt) else None
            ranked = field.value if isinstance(field, Constant) else None
            if not (isinstance(ranked, ElementAtPoint) and isinstance(child.region, Constant)) or ranked.by_heading:
                others.add(child.identity)
                continue
            known = found.setdefault(child.identity, (ranked.options, child.region))
            if known[0] is not ranked.options:
                others.add(child.identity)
    return {identity: place for identity, place in found.items() if identity not in others}


def _found_in(table: Occupancy, region: Constant) -> tuple[int, ...]:
    """The numbers of the options that some point of an area has; none where that is not worked out."""
    area = region.value
    if isinstance(area, Everywhere):
        return tuple(range(table.nothing + 1))
    return table.found_in(area.polygons) or () if isinstance(area, PolygonSet) else ()


def _step(node: Node, picks: Mapping[Identity, Node]) -> Node:
    match node:
        case DirectionAt(point=PointIn() as place) if place.identity in picks:
            return picks[place.identity]
        case Arithmetic(args=(Select(index=Index()) as pick, Constant() as factor)) if _is_known(pick):
            options = (fold(replace(node, args=(option, factor))) for option in pick.options)
            return replace(pick, options=tuple(options))
        case Select(index=Select(index=Index()) as pick) if _is_known(pick):
            numbers = [int(cast(float, cast(Constant, option).value)) for option in pick.options]
            return replace(node, index=pick.index, options=tuple(node.options[number] for number in numbers))
        case Select(options=(Select() as first, *others)) if all(_is_same(first, other) for other in others):
            return first
        case _:
            return node


def _is_known(pick: Select) -> bool:
    return all(isinstance(option, Constant) for option in pick.options)


def _is_same(first: Select, other: Node) -> bool:
    """Whether two choices between known values always come out the same."""
    if not (isinstance(other, Select) and other.index is first.index and _is_known(first) and _is_known(other)):
        return False
    return [cast(Constant, each).value for each in first.options] == [
        cast(Constant, each).value for each in other.options
    ]
