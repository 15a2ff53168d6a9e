"""Programs over time whose conditions are numbered, compiled, for tests that say themselves what holds."""

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.nodes import Compare, Constant
from scenicq.forest.temporal import Dynamics
from scenicq.forest.walk import postorder
from scenicq.geometry.default_street import street


def compiled(text: str) -> Dynamics | None:
    """The program; None for one that may be in too many states."""
    try:
        return compile_scenario(Source("b.scenic", text), street(), version=3, behaviors="guards").dynamics
    except ScenarioError as error:
        if error.diagnostics[0].code != "budget-exceeded":
            raise
        return None


def numbers_of(dynamics: Dynamics) -> dict[int, int]:
    """The number of the condition that each atom is."""
    found: dict[int, int] = {}
    for number, condition in enumerate(dynamics.conditions):
        (compare,) = (node for node in postorder((condition,)) if isinstance(node, Compare))
        sides = (compare.left, compare.right)
        found[number] = next(int(side.value) for side in sides if isinstance(side, Constant)) - 1
    return found
