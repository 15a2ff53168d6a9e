"""The discrete choices that conditions over time hang on: each joint outcome makes a scenario without them.

The outcome of a choice is part of a run from its first sample on: one for the initial scene, all requirements, all that
ends a run and all monitors. So outcomes are split off before anything else is decided, and a recording matches if it
matches the scenario of one of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from scenicq.forest.condition import condition, expand
from scenicq.forest.nodes import Constant, DiscreteRange, Feature, Identity, Index, Leaf, Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.simplify import rebuilt, roots_of
from scenicq.forest.walk import deciding_first, leaves
from scenicq.match.verdict import WitnessValue
from scenicq.temporal.samples import MOVING

__all__ = ["Outcome", "outcomes_of", "place_of", "steady_value"]

_MOST_OUTCOMES = 3000
"""Beyond these, choices stay random variables, of which examples are looked for."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One joint outcome of choices.

    Attributes:
        scenario: The scenario with the choices made.
        witness: What was chosen, by the places in the program.
        same_start: Whether the initial scene hangs on none of the choices.
    """

    scenario: Scenario
    witness: Mapping[str, WitnessValue]
    same_start: bool = True


def outcomes_of(scenario: Scenario) -> tuple[Outcome, ...]:
    """The joint outcomes of the choices that conditions over time hang on; one without choices if there are none.

    Args:
        scenario: The scenario, made ready to be matched.
    """
    found: list[Outcome] = []
    whole = Outcome(scenario, {})
    stack = [whole]
    while stack:
        outcome = stack.pop()
        choice = _choice(outcome.scenario)
        if choice is None:
            found.append(outcome)
            continue
        stack += reversed(list(_made(outcome, *choice)))
        if len(found) + len(stack) > _MOST_OUTCOMES:
            return (whole,)
    return tuple(found)


def place_of(leaf: Leaf) -> str:
    """Where the program says a random variable."""
    return leaf.span.mark if leaf.span else type(leaf).__name__


def steady_value(scenario: Scenario, feature: Feature) -> Node | None:
    """What the program says of a property that does not change, should no label tell."""
    if feature.property in MOVING:
        return None
    return scenario.objects[feature.object].properties[feature.property].value


def _choice(scenario: Scenario) -> tuple[Leaf, range] | None:
    """A choice that conditions over time hang on, with its options."""
    dynamics = scenario.dynamics
    conditions = () if dynamics is None else dynamics.conditions
    # a choice that decides which others matter comes first
    for leaf in deciding_first([expand(each, lambda feature: steady_value(scenario, feature)) for each in conditions]):
        match leaf:
            case Index():
                return leaf, range(len(leaf.weights))
            case DiscreteRange(low=Constant(value=float() as low), high=Constant(value=float() as high)):
                return leaf, range(math.ceil(min(low, high)), math.floor(max(low, high)) + 1)
            case _:
                pass
    return None


def _made(outcome: Outcome, leaf: Leaf, options: range) -> Iterator[Outcome]:
    """The outcomes that options of a choice make of one in which it is open."""
    initial = roots_of(replace(outcome.scenario, dynamics=None))
    same_start = outcome.same_start and all(each.identity is not leaf.identity for each in leaves(*initial))
    for option in options:
        given, memo = {leaf.identity: float(option)}, dict[int, Node]()
        yield Outcome(
            _with(outcome.scenario, given, memo), {**outcome.witness, place_of(leaf): float(option)}, same_start
        )


def _with(scenario: Scenario, given: Mapping[Identity, float], memo: dict[int, Node]) -> Scenario:
    return rebuilt(scenario, lambda node: condition(node, {}, given, memo))
