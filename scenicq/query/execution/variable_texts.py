"""What the program says at the places of its random variables."""

from __future__ import annotations

from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import leaves

__all__ = ["variable_texts"]


def variable_texts(scenario: Scenario) -> dict[str, str]:
    """The source text of each random variable on one line, by its place, as witnesses name it.

    Args:
        scenario: The scenario.
    """
    roots = [requirement.condition for requirement in scenario.requirements]
    roots += [given.value for given in scenario.params.values()]
    roots += [given.value for owner in scenario.objects for given in owner.properties.values()]
    return {leaf.span.mark: " ".join(leaf.span.text.split()) for leaf in leaves(*roots) if leaf.span is not None}
