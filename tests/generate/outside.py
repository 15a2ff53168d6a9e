"""Whether a label lies outside of a scenario's support, decided apart from the matcher: by outer bounds and shapely.

Sound, not complete: where it says "outside", no correspondence of objects has values that explain the label.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

import shapely

from scenicq.forest.bounds import scalar_bounds, vector_bounds
from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.condition import condition, expand
from scenicq.forest.evaluate import evaluate
from scenicq.forest.nodes import Constant, Feature, Node, PointIn, Undefined, Value
from scenicq.forest.scenario import Scenario
from scenicq.geometry.regions import PolygonSet
from scenicq.store.classes import class_matches
from scenicq.store.labels import Label, LabelObject

MARGIN = 0.01
"""Metres and radians: ten times the default tolerance of a match."""
MOST_ORDERS = 130

Features = Mapping[tuple[int, str], Value]


def outside(scenario: Scenario, label: Label) -> bool:
    """Whether it is certain that the label does not match."""
    return all(_excluded(scenario, seen) for seen in _orders(scenario, label))


def _orders(scenario: Scenario, label: Label) -> Iterator[Features]:
    """What each correspondence observes."""
    roles = [thing.index for thing in scenario.objects if thing.index != scenario.ego]
    if math.perm(len(label.objects), len(roles)) > MOST_ORDERS:
        raise TooManyError
    for chosen in itertools.permutations(label.objects, len(roles)):
        things = dict(zip(roles, chosen, strict=True)) | {scenario.ego: label.ego}
        if all(class_matches(scenario.objects[i].category, things[i].category, "fine") for i in things):
            yield {key: value for index, thing in things.items() for key, value in _seen(index, thing)}


class TooManyError(Exception):
    """More correspondences than anyone would go through."""


def _seen(index: int, thing: LabelObject) -> Iterator[tuple[tuple[int, str], Value]]:
    yield (index, "position"), (thing.x, thing.y)
    for name in ("heading", "width", "length"):
        value = getattr(thing, name)
        if value is not None:
            yield (index, name), value


def _excluded(scenario: Scenario, seen: Features) -> bool:
    if any(_feature_excluded(scenario, key, value, seen) for key, value in seen.items()):
        return True
    for requirement in scenario.requirements:
        if requirement.built_in is None:
            known = _conditioned(scenario, requirement.condition, seen)
            if isinstance(known, Constant) and (isinstance(known.value, Undefined) or not known.value):
                return _clearly(scenario, requirement.condition, seen)
    return False


def _clearly(scenario: Scenario, wanted: Node, seen: Features) -> bool:
    """Whether the requirement fails with the label's values themselves: matching knows no tolerance there."""
    try:
        held = evaluate(_expanded(scenario, wanted, seen), {}, seen)
    except CannotEvaluate:
        return False
    return isinstance(held, Undefined) or not held


def _expanded(scenario: Scenario, root: Node, seen: Features) -> Node:
    def definition(feature: Feature) -> Node | None:
        thing = scenario.objects[feature.object]
        hidden = thing.mutated and feature.property in ("position", "heading")
        if (feature.object, feature.property) in seen and not hidden:
            return None
        return thing.properties[feature.property].value

    return expand(root, definition)


def _conditioned(scenario: Scenario, root: Node, seen: Features) -> Node:
    try:
        return condition(_expanded(scenario, root, seen), seen)
    except CannotEvaluate:
        return root


def _feature_excluded(scenario: Scenario, key: tuple[int, str], value: Value, seen: Features) -> bool:
    index, name = key
    thing = scenario.objects[index]
    given = thing.properties.get(name)
    if given is None or (thing.mutated and name in ("position", "heading")):
        return False
    if name not in ("position", "heading") and not given.explicit:
        return False
    left = _conditioned(scenario, given.value, seen)
    if isinstance(left, Constant) and isinstance(left.value, Undefined):
        return True
    if isinstance(value, tuple):
        return _point_excluded(left, value)
    if not isinstance(value, float):
        return False
    low, high = scalar_bounds(left)
    if name == "heading":
        turns = [value + math.tau * turn for turn in range(-3, 4)]
        return high - low < math.tau and not any(low - MARGIN <= turn <= high + MARGIN for turn in turns)
    return not low - MARGIN <= value <= high + MARGIN


def _point_excluded(left: Node, point: tuple[float, float]) -> bool:
    if isinstance(left, PointIn) and isinstance(left.region, Constant) and isinstance(left.region.value, PolygonSet):
        return _distance(left.region.value.polygons, point) > MARGIN
    bounds = vector_bounds(left)
    return any(not low - MARGIN <= part <= high + MARGIN for part, (low, high) in zip(point, bounds, strict=True))


def _distance(polygons: Sequence[shapely.Geometry], point: tuple[float, float]) -> float:
    return min((shapely.distance(shapely.Point(point), polygon) for polygon in polygons), default=math.inf)
