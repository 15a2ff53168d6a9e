"""Drawing scenes from a scenario: the improviser of the language paper (section 5.4), by rejection."""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import cast

from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.evaluate import evaluate
from scenicq.forest.nodes import (
    DirectionAt,
    DiscreteRange,
    Identity,
    Index,
    Leaf,
    Node,
    Normal,
    PointIn,
    Range,
    TruncatedNormal,
    Undefined,
    Value,
)
from scenicq.forest.scenario import BuiltIn, Scenario
from scenicq.forest.walk import children, features, leaves
from scenicq.geometry.regions import Region
from scenicq.geometry.sampling import sample

__all__ = ["Draw", "Scene", "draw_scene"]

_MOST_DRAWS = 1000
"""Draws of a truncated normal before its interval counts as out of reach."""


@dataclass(frozen=True, slots=True)
class Scene:
    """One scene of a scenario.

    Attributes:
        values: The value of each (object, property) that has one.
        params: The values of global parameters.
    """

    values: Mapping[tuple[int, str], Value]
    params: Mapping[str, Value]


class Draw:
    """Values of random variables, drawn when first asked for."""

    def __init__(self, rng: random.Random) -> None:
        """Take the source of randomness."""
        self.rng = rng
        self.values: dict[Identity, Value] = {}
        self._picked: dict[int, float] = {}

    def __call__(self, leaf: Leaf, args: tuple[Value, ...]) -> Value:
        """The value of a random variable, given its distribution's parameters."""
        if leaf.identity not in self.values:
            undefined = next((arg for arg in args if isinstance(arg, Undefined)), None)
            self.values[leaf.identity] = self._draw(leaf, args) if undefined is None else undefined
        return self.values[leaf.identity]

    def _draw(self, leaf: Leaf, args: tuple[Value, ...]) -> Value:
        numbers = cast("tuple[float, ...]", args)
        match leaf:
            case Range():
                return self.rng.uniform(*numbers)
            case Normal():
                return self.rng.gauss(*numbers)
            case TruncatedNormal():
                mean, deviation, low, high = numbers
                for _ in range(_MOST_DRAWS):
                    value = self.rng.gauss(mean, deviation)
                    if low <= value <= high:
                        return value
                return Undefined("a truncated normal far outside of its interval")
            case DiscreteRange():
                return float(self.rng.randint(int(numbers[0]), int(numbers[1])))
            case Index():
                return float(self.rng.choices(range(len(leaf.weights)), leaf.weights)[0])
            case PointIn():
                try:
                    return sample(cast(Region, args[0]), self.rng)
                except ValueError:
                    return Undefined("an empty region")

    def choose(self, node: DirectionAt, allowed: tuple[float, ...]) -> float:
        """One of several directions, the same one for every reference to one use of a field."""
        return self._picked.setdefault(id(node), self.rng.choice(allowed))


def draw_scene(scenario: Scenario, rng: random.Random, attempts: int = 1000) -> Scene | None:
    """A scene that satisfies every hard requirement, or None if none came up: acceptance is then below 1 in `attempts`.

    What fails is drawn again by itself, the rest is kept: any scene of the support will do. For the same reason soft
    requirements are ignored. Mutation noise is not added.

    Args:
        scenario: The scenario.
        rng: Source of randomness.
        attempts: Scenes to try.
    """
    order = _order(scenario)
    depends = _dependencies(order, scenario)
    draw = Draw(rng)
    conditions = [
        requirement.condition
        for requirement in scenario.requirements
        if requirement.built_in in (None, BuiltIn.VISIBILITY)
    ]
    for attempt in range(attempts):
        scene = _attempt(scenario, order, conditions, draw)
        if isinstance(scene, Scene):
            return scene
        if scene is None or attempt % _PATIENCE == _PATIENCE - 1:
            draw.values.clear()
        else:
            _forget(draw, scene, depends)
    return None


_PATIENCE = 40
"""Attempts at mending a scene before all of it is drawn anew."""


@dataclass(frozen=True, slots=True)
class _Dependencies:
    """What depends on which random variables.

    Attributes:
        keys: The random variables that each feature depends on.
        leaves: The random variables that the distribution of each one depends on.
    """

    keys: Mapping[tuple[int, str], frozenset[Identity]]
    leaves: Mapping[Identity, frozenset[Identity]]

    def of(self, node: Node) -> frozenset[Identity]:
        """The random variables that an expression depends on."""
        own = frozenset(leaf.identity for leaf in leaves(node))
        return own.union(*(self.keys[key] for key in features(node)))


def _dependencies(order: Iterable[tuple[tuple[int, str], Node]], scenario: Scenario) -> _Dependencies:
    found = _Dependencies({}, {})
    nodes = [(key, node) for key, node in order]
    nodes += [(None, requirement.condition) for requirement in scenario.requirements]
    for key, node in nodes:
        if key is not None:
            cast("dict[tuple[int, str], frozenset[Identity]]", found.keys)[key] = found.of(node)
        for leaf in leaves(node):
            parameters = frozenset[Identity]().union(*(found.of(child) for child in children(leaf)))
            cast("dict[Identity, frozenset[Identity]]", found.leaves)[leaf.identity] = parameters
    return found


def _forget(draw: Draw, failed: Node, depends: _Dependencies) -> None:
    """Forget some of the values that a failed expression depends on, and all that was drawn with their help."""
    candidates = sorted(depends.of(failed), key=list(draw.values).index) if draw.values else []
    candidates = [identity for identity in candidates if identity in draw.values]
    if not candidates:
        draw.values.clear()
        return
    void = {identity for identity in candidates if isinstance(draw.values[identity], Undefined)}
    gone = void.union(*(depends.leaves[identity] for identity in void))
    # what was drawn late disturbs least; now and then more goes
    start = max(0, len(candidates) - 1 - int(draw.rng.expovariate(0.7)))
    gone |= set() if void else set(candidates[start:])
    for identity in list(draw.values):
        if identity in gone or gone & depends.leaves.get(identity, frozenset()):
            gone.add(identity)
            del draw.values[identity]


def _order(scenario: Scenario) -> list[tuple[tuple[int, str], Node]]:
    """Properties in an order in which each comes after those it refers to."""
    pending = {
        (thing.index, name): given.value for thing in scenario.objects for name, given in thing.properties.items()
    }
    needs = {key: features(node) for key, node in pending.items()}
    order: list[tuple[tuple[int, str], Node]] = []
    done: set[tuple[int, str]] = set()
    while pending:
        ready = [key for key in pending if needs[key] <= done]
        assert ready, "properties depend on each other"
        for key in ready:
            order.append((key, pending.pop(key)))
            done.add(key)
    return order


def _attempt(
    scenario: Scenario, order: Iterable[tuple[tuple[int, str], Node]], conditions: Iterable[Node], draw: Draw
) -> Scene | Node | None:
    """A scene, or the expression that failed, or None where nothing can be told."""
    values: dict[tuple[int, str], Value] = {}
    try:
        for key, node in order:
            values[key] = evaluate(node, draw, values, draw.choose)
            if key[1] in ("position", "heading") and isinstance(values[key], Undefined):
                return node
        for condition in conditions:
            held = evaluate(condition, draw, values, draw.choose)
            if isinstance(held, Undefined) or not held:
                return condition
        params = {name: evaluate(given.value, draw, values, draw.choose) for name, given in scenario.params.items()}
    except CannotEvaluate:
        return None
    return Scene(values, params)
