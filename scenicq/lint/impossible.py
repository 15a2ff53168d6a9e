"""Requirements that no scene of a program satisfies, whatever labels have: by intervals over all that it draws."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from scenicq.errors import Diagnostic
from scenicq.forest.bounds import may_hold
from scenicq.forest.inline import inline_scenario
from scenicq.forest.interpret import OnMap
from scenicq.forest.nodes import Constant, Node
from scenicq.forest.scenario import Requirement, Scenario, ScenarioObject
from scenicq.forest.walk import features, postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.regions import PolygonSet, PolylineSet

__all__ = ["impossible_requirements"]

_DRAWN = frozenset({"position", "heading"})
"""What each scene says of an object, whoever sets it; a library's default of other properties says nothing."""


def impossible_requirements(scenarios: Sequence[Scenario], *, real: bool) -> list[Diagnostic]:
    """The requirements that no scene satisfies on any of some maps.

    Args:
        scenarios: The program as compiled against each map, none of them made ready.
        real: Whether the maps are those that are meant; if not, what depends on a map is not spoken of.
    """
    found = [dict.fromkeys(_impossible(each, real=real)) for each in scenarios]
    return [each for each in found[0] if all(each in others for others in found[1:])] if found else []


def _impossible(scenario: Scenario, *, real: bool) -> Iterator[Diagnostic]:
    noisy = {owner.index for owner in scenario.objects if owner.mutated}
    plain = replace(
        scenario,
        objects=tuple(map(_as_written, scenario.objects)),
        # Scenic asks for them after the noise, which has no bounds
        requirements=tuple(each for each in scenario.requirements if not _is_about(each, noisy)),
        soft=(),
    )
    for check in inline_scenario(plain, frozenset()).checks:
        if check.defined or check.built_in is not None or not (real or _is_free_of_maps(check.condition)):
            continue
        if not may_hold(check.condition):
            yield Diagnostic(
                "impossible-requirement", "no scene of this program satisfies this requirement", check.span,
                "false for all that it draws",
            )  # fmt: skip


def _is_free_of_maps(condition: Node) -> bool:
    return not any(
        isinstance(node, OnMap)
        or (isinstance(node, Constant) and isinstance(node.value, PolygonSet | PolylineSet | VectorField))
        for node in postorder((condition,))
    )


def _is_about(requirement: Requirement, objects: set[int]) -> bool:
    return any(index in objects for index, _ in features(requirement.condition))


def _as_written(owner: ScenarioObject) -> ScenarioObject:
    """The object without noise and without what a library alone says of it."""
    given = {name: each for name, each in owner.properties.items() if each.explicit or name in _DRAWN}
    return replace(owner, properties=given, mutated=frozenset())
