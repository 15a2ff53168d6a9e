"""Rewriting a scenario into an equivalent one that is cheaper to match.

A point in a region picked from a list is a point in the union of the list, if nothing else depends on the pick: the
support is the same, and the union has a spatial index. The probabilities are not: scenes are drawn from the program as
it is (`Scenario.as_written`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import cast

from scenicq.forest.nodes import Constant, Index, Node, PointIn, RegionUnion, Select, Undefined
from scenicq.forest.scenario import Requirement, Scenario, ScenarioObject
from scenicq.forest.walk import children, postorder, transform
from scenicq.geometry.regions import PolygonSet, Region, union

__all__ = ["rebuilt", "roots_of", "simplify"]


def roots_of(scenario: Scenario) -> list[Node]:
    """All expressions of a scenario."""
    found = [given.value for owner in scenario.objects for given in owner.properties.values()]
    found += [each.condition for each in (*scenario.requirements, *scenario.soft)]
    found += scenario.dynamics.conditions if scenario.dynamics is not None else ()
    return [*found, *(p.value for p in scenario.params.values())]


def _merged(regions: list[Region]) -> Region:
    """The union of regions, as one indexed set where all are sets of polygons.

    Headings are expressions of their own by now, so that the set needs no orientation.
    """
    sets = [region for region in regions if isinstance(region, PolygonSet)]
    if len(sets) != len(regions):
        return union(*regions)
    polygons = tuple(polygon for region in sets for polygon in region.polygons)
    return PolygonSet(polygons, f"{len(sets)} regions", ids=tuple(i for region in sets for i in region.ids))


def _is_undefined(node: Node) -> bool:
    return isinstance(node, Constant) and isinstance(node.value, Undefined)


def simplify(scenario: Scenario) -> Scenario:
    """The same scenario with simpler expressions; random variables keep their identity."""
    roots = roots_of(scenario)
    uses = Counter(id(child) for node in postorder(roots) for child in set(children(node)))
    uses.update(id(root) for root in roots)

    def by_chance(pick: Select) -> bool:
        return isinstance(pick.index, Index) and uses[id(pick.index)] == 1 and uses[id(pick)] == 1

    def step(node: Node) -> Node:
        if not (isinstance(node, PointIn) and isinstance(node.region, Select) and by_chance(node.region)):
            return node
        pick, options = node.region, tuple(_alternatives(node.region, by_chance))
        if not options:
            return node
        if all(isinstance(option, Constant) for option in options):
            merged = _merged([cast(Region, cast(Constant, option).value) for option in options])
            return replace(node, region=Constant(merged, span=pick.span))
        return replace(node, region=RegionUnion(options, span=pick.span))

    memo: dict[int, Node] = {}
    return rebuilt(scenario, lambda node: transform(node, step, memo))


def _alternatives(pick: Select, by_chance: Callable[[Select], bool]) -> Iterator[Node]:
    """The options of a pick in order, those of picks among them too."""
    todo: list[Node] = [pick]
    while todo:
        node = todo.pop()
        if isinstance(node, Select) and by_chance(node):
            todo += reversed(node.options)
        elif not _is_undefined(node):
            # an option without a value, such as the lane where there is none, has no points
            yield node


def rebuilt(scenario: Scenario, change: Callable[[Node], Node]) -> Scenario:
    """The scenario with each of its expressions changed."""

    def changed(owner: ScenarioObject) -> ScenarioObject:
        properties = {name: replace(p, value=change(p.value)) for name, p in owner.properties.items()}
        return replace(owner, properties=properties)

    def required(conditions: tuple[Requirement, ...]) -> tuple[Requirement, ...]:
        return tuple(replace(each, condition=change(each.condition)) for each in conditions)

    objects = tuple(map(changed, scenario.objects))
    requirements, soft = required(scenario.requirements), required(scenario.soft)
    arrivals = tuple(
        replace(each, objects=tuple(map(changed, each.objects)), requirements=required(each.requirements))
        for each in scenario.arrivals
    )
    params = {name: replace(p, value=change(p.value)) for name, p in scenario.params.items()}
    dynamics = scenario.dynamics
    if dynamics is not None:
        dynamics = replace(dynamics, conditions=tuple(map(change, dynamics.conditions)))
    records = tuple(replace(each, value=change(each.value)) for each in scenario.records)
    return replace(
        scenario,
        objects=objects,
        requirements=requirements,
        soft=soft,
        params=params,
        dynamics=dynamics,
        records=records,
        arrivals=arrivals,
    )
