"""How many of the frames that match do so by a tolerance alone: with exact positions, or headings, they would not.

Frames are matched again with that part of the tolerance left out, as many as there is time for, in an order that chance
gives. A frame of which that is undecided does not count.
"""

from __future__ import annotations

import random
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scenicq.forest.scenario import Scenario
from scenicq.match.matcher import Matcher
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import NoMatch
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.run import Query
from scenicq.store.labels import Label

__all__ = ["ToleranceShare", "by_tolerance_alone"]

_TOGETHER = 10
"""Frames that are read together."""
_LONGEST_S = 0.1
"""Seconds for one frame."""
_PLACES = ("position", "x", "y")


@dataclass(frozen=True, slots=True)
class ToleranceShare:
    """How many of some frames match by a tolerance alone.

    Attributes:
        frames: How many frames there are.
        positions, headings: How many of them would not match with exact positions, or headings.
    """

    frames: int
    positions: int
    headings: int


def by_tolerance_alone(query: Query, frames: Sequence[str], budget_s: float) -> ToleranceShare:
    """How many of some frames match by a tolerance alone, as far as there is time.

    Args:
        query: The query by which they match; it is about frames.
        frames: Their names.
        budget_s: Seconds after which no other frame is begun.
    """
    until = time.monotonic() + budget_s
    tolerance = query.options.match.tolerance
    counted, alone = 0, [0, 0]
    order = list(frames)
    random.Random(0).shuffle(order)
    matchers: dict[str, list[Matcher | None]] = {}
    with LazySolver(query.options.solver) as solver:
        for first in range(0, len(order), _TOGETHER):
            for label in query.dataset.labels(order[first : first + _TOGETHER]):
                if time.monotonic() >= until:
                    return ToleranceShare(counted, *alone)
                if label.map not in matchers:
                    scenario = query.compiled_map(label.map).scenario
                    options = replace(query.options.match, timeout_s=min(query.options.match.timeout_s, _LONGEST_S))
                    matchers[label.map] = [
                        None if each == tolerance else Matcher(scenario, replace(options, tolerance=each), solver)
                        for each in (_exact_places(tolerance), _exact_headings(tolerance, scenario))
                    ]
                counted += 1
                for number, matcher in enumerate(matchers[label.map]):
                    alone[number] += matcher is not None and _fails(matcher, label)
    return ToleranceShare(counted, *alone)


def _fails(matcher: Matcher, label: Label) -> bool:
    return isinstance(matcher.match(label), NoMatch)


def _exact_places(tolerance: Tolerance) -> Tolerance:
    """A tolerance with positions as of generated labels, where they are not more exact."""
    rules = tuple(rule for rule in tolerance.rules if rule[1] not in _PLACES)
    return replace(tolerance, x=None, y=None, position=min(tolerance.position, EXACT.position), rules=rules)


def _exact_headings(tolerance: Tolerance, scenario: Scenario) -> Tolerance:
    """A tolerance with such headings of the objects of which the program says one; roads turn nobody exactly."""
    said = [each.name for each in scenario.objects if each.properties["heading"].explicit]
    others = tuple(rule for rule in tolerance.rules if rule[1] != "heading" or rule[0] not in said)
    return replace(tolerance, rules=(*others, *((name, "heading", EXACT.heading) for name in said)))
