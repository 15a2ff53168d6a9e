"""One scene of a program."""

from __future__ import annotations

import random
from collections.abc import Set

from scenicq.forest.improvise import Improviser, Scene
from scenicq.forest.scenario import BuiltIn, Scenario


def draw_scene(
    scenario: Scenario,
    rng: random.Random,
    attempts: int = 1000,
    enforce: Set[BuiltIn] = frozenset({BuiltIn.VISIBILITY}),
) -> Scene | None:
    """A scene that satisfies every hard requirement, or None if none came up.

    Args:
        scenario: The scenario.
        rng: Source of randomness.
        attempts: Failures to endure.
        enforce: The built-in requirements in force; by default those that matching enforces.
    """
    return Improviser(scenario, enforce).draw(rng, attempts)
