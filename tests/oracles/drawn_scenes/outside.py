"""Whether a label lies outside of a scenario's support, decided apart from the matcher: by outer bounds and shapely.

Sound, not complete: where it says "outside", no correspondence of objects has values that explain the label.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import shapely

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import scalar_bounds, vector_bounds
from scenicq.forest.condition import condition, expand
from scenicq.forest.evaluate import evaluate
from scenicq.forest.nodes import Constant, Feature, Node, PointIn, Undefined, Value
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import features
from scenicq.geometry.regions import PolygonSet
from scenicq.store.classes import class_matches
from scenicq.store.labels import Label, LabelObject

MARGIN = 0.01
"""Metres and radians: ten times the default tolerance of a match."""
MOST_STEPS = 3000
"""Partial correspondences that are looked at."""

Features = Mapping[tuple[int, str], Value]


def outside(scenario: Scenario, label: Label) -> bool:
    """Whether it is certain that the label does not match.

    Roles are given to label objects one by one, and what a condition excludes for those that it is about is not tried
    any further.
    """
    return not _Search(scenario, label).possible()


class TooManyError(Exception):
    """More correspondences than anyone would go through."""


class _Search:
    """Correspondences that are not known to be excluded."""

    def __init__(self, scenario: Scenario, label: Label) -> None:
        self.scenario = scenario
        self.things = (label.ego, *label.objects)
        self.roles = [thing.index for thing in scenario.objects if thing.index != scenario.ego]
        self.steps = 0
        self.known: dict[tuple[object, ...], bool] = {}
        self.checks: list[tuple[frozenset[int], int, str]] = []
        for thing in scenario.objects:
            for name in ("position", "heading", "width", "length"):
                given = thing.properties.get(name)
                if given is not None:
                    self.checks.append((self._about(given.value) | {thing.index}, thing.index, name))
        for number, requirement in enumerate(scenario.requirements):
            if requirement.built_in is None:
                self.checks.append((self._about(requirement.condition), number, "requirement"))

    def _about(self, node: Node) -> frozenset[int]:
        """The objects whose features an expression refers to, those that are not observed by what they are made of."""
        return frozenset(index for index, _ in features(_expanded(self.scenario, node, _Everything())))

    def possible(self) -> bool:
        ego = {self.scenario.ego: 0}
        if self._excluded(ego, None):
            return False
        options = {
            role: [
                number
                for number in range(1, len(self.things))
                if class_matches(self.scenario.objects[role].category, self.things[number].category, "fine")
                and not self._excluded({**ego, role: number}, role)
            ]
            for role in self.roles
        }
        return self._matched(options) and self._extended(ego, options)

    def _matched(self, options: Mapping[int, list[int]]) -> bool:
        """Whether all roles can be given at once as far as each alone is concerned: augmenting paths."""
        player: dict[int, int] = {}

        def given(role: int, tried: set[int]) -> bool:
            for number in options[role]:
                if number not in tried:
                    tried.add(number)
                    if number not in player or given(player[number], tried):
                        player[number] = role
                        return True
            return False

        return all(given(role, set()) for role in self.roles)

    def _extended(self, chosen: dict[int, int], options: Mapping[int, list[int]]) -> bool:
        left = [role for role in self.roles if role not in chosen]
        if not left:
            return True
        taken = set(chosen.values())
        role = min(left, key=lambda role: len([number for number in options[role] if number not in taken]))
        for number in options[role]:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise TooManyError
            more = {**chosen, role: number}
            if number not in taken and not self._excluded(more, role) and self._extended(more, options):
                return True
        return False

    def _excluded(self, chosen: Mapping[int, int], last: int | None) -> bool:
        """Whether a condition about objects that are chosen, the last among them, fails."""
        return any(
            self._fails(check, chosen)
            for check in self.checks
            if check[0] <= chosen.keys() and (last is None or last in check[0])
        )

    def _fails(self, check: tuple[frozenset[int], int, str], chosen: Mapping[int, int]) -> bool:
        about, number, name = check
        key = (number, name, *(chosen[index] for index in sorted(about)))
        if key not in self.known:
            seen = {key: value for index in about for key, value in _seen(index, self.things[chosen[index]])}
            if name == "requirement":
                self.known[key] = _requirement_excluded(
                    self.scenario, self.scenario.requirements[number].condition, seen
                )
            else:
                value = seen.get((number, name))
                self.known[key] = value is not None and _feature_excluded(self.scenario, (number, name), value, seen)
        return self.known[key]


class _Everything(dict[tuple[int, str], Value]):
    """Whatever a label can observe is observed."""

    def __contains__(self, key: object) -> bool:
        return isinstance(key, tuple) and key[1] in ("position", "heading", "width", "length")


def _seen(index: int, thing: LabelObject) -> Iterator[tuple[tuple[int, str], Value]]:
    yield (index, "position"), (thing.x, thing.y)
    for name in ("heading", "width", "length"):
        value = getattr(thing, name)
        if value is not None:
            yield (index, name), value


def _requirement_excluded(scenario: Scenario, wanted: Node, seen: Features) -> bool:
    known = _conditioned(scenario, wanted, seen)
    if isinstance(known, Constant) and (isinstance(known.value, Undefined) or not known.value):
        return _clearly(scenario, wanted, seen)
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
