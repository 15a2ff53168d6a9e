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
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import features
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

    def choose(self, _: DirectionAt, allowed: tuple[float, ...]) -> float:
        """One of several directions."""
        return self.rng.choice(allowed)


def draw_scene(scenario: Scenario, rng: random.Random, attempts: int = 1000) -> Scene | None:
    """A scene that satisfies every hard requirement, or None if none came up.

    Soft requirements are ignored: any scene of the support will do. Mutation noise is not added.

    Args:
        scenario: The scenario.
        rng: Source of randomness.
        attempts: Scenes to try.
    """
    order = _order(scenario)
    for _ in range(attempts):
        scene = _attempt(scenario, order, Draw(rng))
        if scene is not None:
            return scene
    return None


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


def _attempt(scenario: Scenario, order: Iterable[tuple[tuple[int, str], Node]], draw: Draw) -> Scene | None:
    values: dict[tuple[int, str], Value] = {}
    try:
        for key, node in order:
            values[key] = evaluate(node, draw, values, draw.choose)
        for thing in scenario.objects:
            if any(isinstance(values[thing.index, name], Undefined) for name in ("position", "heading")):
                return None
        for requirement in scenario.requirements:
            if requirement.built_in is None or requirement.built_in.value == "visibility":
                held = evaluate(requirement.condition, draw, values, draw.choose)
                if isinstance(held, Undefined) or not held:
                    return None
        params = {name: evaluate(given.value, draw, values, draw.choose) for name, given in scenario.params.items()}
    except CannotEvaluate:
        return None
    return Scene(values, params)
