"""How many matches depend on the tolerance: frames that would not match if positions, or headings, had to be exact.

Each match is decided again, once with exact positions and once with exact headings: within 1 mm and 1 mrad (`EXACT`).
The order is random, and the work ends when the time is up. An interval is decided at its first frame, with its objects
in their roles, because tolerances do not apply to conditions over time. A match that is then undecided counts as
decided again, but not as dependent on the tolerance.
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
from scenicq.query.execution.interval_frames import roles_in
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.store.labels import Label

__all__ = ["ToleranceCounts", "by_tolerance_alone"]

_TOGETHER = 10
"""Matches whose frames are read at once."""
_LONGEST_S = 0.1
"""Seconds for one match, after which it counts as undecided."""
_PLACES = ("position", "x", "y")


@dataclass(frozen=True, slots=True)
class ToleranceCounts:
    """How many matches depend on the tolerance.

    Attributes:
        matches: The number of matches that were decided again.
        positions, headings: How many of them would not match with exact positions, or with exact headings.
    """

    matches: int
    positions: int
    headings: int


def by_tolerance_alone(query: Query, matches: Sequence[Result], budget_s: float) -> ToleranceCounts:
    """Count how many of some matches depend on the tolerance, as far as there is time.

    Args:
        query: The query that finds them.
        matches: Frames or intervals that match.
        budget_s: Seconds after which no other match is begun.
    """
    until = time.monotonic() + budget_s
    tolerance = query.options.match.tolerance
    counted, alone = 0, [0, 0]
    order = list(matches)
    random.Random(0).shuffle(order)
    matchers: dict[str, list[Matcher | None]] = {}
    with LazySolver(query.options.solver) as solver:
        for first in range(0, len(order), _TOGETHER):
            some = order[first : first + _TOGETHER]
            labels = {each.frame: each for each in query.dataset.labels(dict.fromkeys(each.frame for each in some))}
            for result in some:
                label = labels[result.frame]
                if time.monotonic() >= until:
                    return ToleranceCounts(counted, *alone)
                if label.map not in matchers:
                    scenario = query.compiled_map(label.map).scenario
                    options = replace(query.options.match, timeout_s=min(query.options.match.timeout_s, _LONGEST_S))
                    matchers[label.map] = [
                        None if each == tolerance else Matcher(scenario, replace(options, tolerance=each), solver)
                        for each in (_exact_places(tolerance), _exact_headings(tolerance, scenario))
                    ]
                counted += 1
                for number, matcher in enumerate(matchers[label.map]):
                    alone[number] += matcher is not None and _fails(matcher, label, result)
    return ToleranceCounts(counted, *alone)


def _fails(matcher: Matcher, label: Label, result: Result) -> bool:
    if result.interval is None:
        return isinstance(matcher.match(label), NoMatch)
    # objects that come later in the interval are not in this scenario
    there = {each.name for each in matcher.scenario.objects}
    roles = {name: member for name, member in roles_in(label, result).items() if name in there}
    return isinstance(matcher.match(label, fixed_roles=roles), NoMatch)


def _exact_places(tolerance: Tolerance) -> Tolerance:
    """The tolerance with exact positions (`EXACT`); a smaller size for positions stays."""
    rules = tuple(rule for rule in tolerance.rules if rule[1] not in _PLACES)
    return replace(tolerance, x=None, y=None, position=min(tolerance.position, EXACT.position), rules=rules)


def _exact_headings(tolerance: Tolerance, scenario: Scenario) -> Tolerance:
    """The tolerance with exact headings for the objects whose heading the program sets.

    Other headings keep their tolerance, since nobody follows the direction of a road exactly.
    """
    said = [each.name for each in scenario.objects if each.properties["heading"].explicit]
    others = tuple(rule for rule in tolerance.rules if rule[1] != "heading" or rule[0] not in said)
    return replace(tolerance, rules=(*others, *((name, "heading", EXACT.heading) for name in said)))
