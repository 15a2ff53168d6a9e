"""How many matches depend on the tolerance: frames that would not match if positions, or headings, had to be exact.

Matches are decided again without that part of the tolerance, in random order and as many as there is time for. An
interval is decided at its first frame with the objects in its roles, since tolerances do not apply to conditions over
time. A frame that is then undecided does not count.
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

__all__ = ["ToleranceShare", "by_tolerance_alone"]

_TOGETHER = 10
"""Matches whose frames are read at once."""
_LONGEST_S = 0.1
"""Seconds for one match, after which it counts as undecided."""
_PLACES = ("position", "x", "y")


@dataclass(frozen=True, slots=True)
class ToleranceShare:
    """How many matches depend on the tolerance.

    Attributes:
        matches: The number of matches that were decided again.
        positions, headings: How many of them would not match with exact positions, or with exact headings.
    """

    matches: int
    positions: int
    headings: int


def by_tolerance_alone(query: Query, matches: Sequence[Result], budget_s: float) -> ToleranceShare:
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
                    alone[number] += matcher is not None and _fails(matcher, label, result)
    return ToleranceShare(counted, *alone)


def _fails(matcher: Matcher, label: Label, result: Result) -> bool:
    if result.interval is None:
        return isinstance(matcher.match(label), NoMatch)
    # others come later
    there = {each.name for each in matcher.scenario.objects}
    roles = {name: member for name, member in roles_in(label, result).items() if name in there}
    return isinstance(matcher.match(label, fixed_roles=roles), NoMatch)


def _exact_places(tolerance: Tolerance) -> Tolerance:
    """A tolerance with positions as of generated labels, where they are not more exact."""
    rules = tuple(rule for rule in tolerance.rules if rule[1] not in _PLACES)
    return replace(tolerance, x=None, y=None, position=min(tolerance.position, EXACT.position), rules=rules)


def _exact_headings(tolerance: Tolerance, scenario: Scenario) -> Tolerance:
    """A tolerance with such headings of the objects of which the program says one; roads turn nobody exactly."""
    said = [each.name for each in scenario.objects if each.properties["heading"].explicit]
    others = tuple(rule for rule in tolerance.rules if rule[1] != "heading" or rule[0] not in said)
    return replace(tolerance, rules=(*others, *((name, "heading", EXACT.heading) for name in said)))
