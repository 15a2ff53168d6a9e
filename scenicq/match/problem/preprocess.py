"""A scenario as the matcher reads it: the same outcomes in expressions that are cheaper to match."""

from __future__ import annotations

from dataclasses import replace

from scenicq.forest.free_places import choose_elements
from scenicq.forest.scenario import Scenario
from scenicq.forest.simplify import simplify
from scenicq.forest.step_counts import choose_steps

__all__ = ["prepare_scenario"]


def prepare_scenario(scenario: Scenario) -> Scenario:
    """The scenario rewritten to be matched; scenes are still drawn from it as it was written.

    Args:
        scenario: As compiled, or made ready before.
    """
    if scenario.as_written is not None:
        return scenario
    made = simplify(choose_elements(choose_steps(scenario)))
    return replace(made, as_written=scenario, variants=tuple(map(prepare_scenario, scenario.variants)))
