"""How far a frame is from matching: the smallest tolerance under which it would, and the frames that come closest.

A tolerance is *widened by s metres* if its position part grows by s, its heading part by s times 20 degrees (the ratio
of the query paper's experiments, 0.25 m and 5 degrees), and the part for other numbers by s of their own unit. All
parts grow together, so what matches at one s matches at every larger one, and bisection finds the smallest.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import islice

from scenicq.errors import ScenarioError
from scenicq.match.matcher import Finding, Matcher
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Cause, Match, NoMatch
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.prefilter.executor import names, run_prefilter
from scenicq.query.prefilter.plan import Plan, make_plan
from scenicq.store.labels import Label

__all__ = ["Closest", "closest", "nearest_misses", "widened"]

MOST_M = 100.0
"""Metres beyond which a tolerance is not widened."""
FINEST_M = 1e-3
"""Metres to which the smallest tolerance is found."""
MOST_FRAMES = 5000
"""Frames that a ranking looks at."""

_LADDER_M = (0.01, 0.1, 1.0, 4.0, 16.0, MOST_M)
_TIMEOUT_S = 1.0
_HEADING_PER_M = math.radians(20)
_BATCH = 256


@dataclass(frozen=True, slots=True)
class Closest:
    """The smallest widening under which a label matches.

    Attributes:
        widening_m: Metres, found to within `FINEST_M` or a hundredth of it; 0 if the label matches as it is.
        tolerance: The widened tolerance.
        finding: The match under it.
    """

    widening_m: float
    tolerance: Tolerance
    finding: Finding


def widened(tolerance: Tolerance, widening_m: float) -> Tolerance:
    """A tolerance widened by so many metres, in the sense of this module."""
    return tolerance.widened(widening_m, widening_m * _HEADING_PER_M)


def closest(matcher: Matcher, label: Label, most_m: float = MOST_M) -> Closest | None:
    """The smallest widening of the matcher's tolerance under which a label matches.

    Args:
        matcher: The matcher, with the tolerance to start from.
        label: The label.
        most_m: Metres beyond which it does not matter.

    Returns:
        None if it does not match even then: a class is missing, or something fails that no tolerance helps.
    """
    patient = replace(matcher.options, timeout_s=min(matcher.options.timeout_s, _TIMEOUT_S))

    def at(widening_m: float) -> Closest | None:
        tolerance = widened(patient.tolerance, widening_m)
        finding = matcher.relaxed(replace(patient, tolerance=tolerance)).examine(label)
        return Closest(widening_m, tolerance, finding) if isinstance(finding.verdict, Match) else None

    found = at(0.0)
    if found is not None:
        return found
    if most_m < MOST_M and at(most_m) is None:
        return None
    # small tolerances are decided fastest
    low, best = 0.0, None
    for size in _LADDER_M:
        best = at(min(size, most_m))
        if best is not None or size >= most_m:
            break
        low = size
    if best is None:
        return None
    while best.widening_m - low > max(FINEST_M, best.widening_m / 100):
        middle = (low + best.widening_m) / 2
        found = at(middle)
        if found is None:
            low = middle
        else:
            best = found
    return best


def _candidates(query: Query, most_frames: int) -> Iterator[tuple[Matcher, Label]]:
    """The labels that can match under the widest tolerance, with the matcher of their map."""
    left = most_frames
    options = query.options
    wide = replace(options.match, tolerance=widened(options.match.tolerance, MOST_M))
    with LazySolver(options.solver) as solver:
        for name in query.dataset.maps:
            try:
                scenario, network = query.compile(name)
            except ScenarioError as error:
                if error.diagnostics[0].code == "map-lacks":
                    continue
                raise
            matcher = Matcher(scenario, options.match, solver)
            frames = list(islice(_frames(query, make_plan(scenario, network, wide)), left))
            left -= len(frames)
            for start in range(0, len(frames), _BATCH):
                for label in query.dataset.labels(frames[start : start + _BATCH]):
                    yield matcher, label


def _frames(query: Query, plan: Plan) -> Iterator[str]:
    """The frames that a prefilter leaves."""
    with closing(query.dataset.connect()) as connection:
        for block in query.blocks(plan.map):
            missed = run_prefilter(query.dataset, connection, plan, block).tolist()
            if min(missed, default=0) < 0:
                rows = zip(names(query.dataset, connection, block), missed, strict=True)
                yield from (frame for (frame, _, _), number in rows if number < 0)


def nearest_misses(
    query: Query,
    count: int,
    *,
    most_frames: int = MOST_FRAMES,
    progress: Callable[[int], None] | None = None,
) -> list[Result]:
    """The frames that do not match but come closest, the closest first; ties in the order of the store.

    A frame that is no closer than the worst of the list costs two decisions, the others a bisection. The cause of each
    result is the tolerance under which it would match, its correspondence the one by which it then does.

    Args:
        query: The query.
        count: How many.
        most_frames: Frames to look at: those of the right classes, in the order of the store.
        progress: Called with 1 for each frame looked at.
    """
    heap: list[tuple[float, int, Result]] = []
    for number, (matcher, label) in enumerate(_candidates(query, most_frames)):
        if progress is not None:
            progress(1)
        bound = MOST_M if len(heap) < count else -heap[0][0]
        found = closest(matcher, label, bound)
        if found is None or found.widening_m == 0 or not isinstance(found.finding.verdict, Match):
            continue
        cause = Cause("tolerance", f"would match with {found.tolerance}")
        verdict = NoMatch(cause, found.finding.verdict.correspondence)
        entry = (
            -found.widening_m,
            -number,
            Result(label.frame, label.recording, label.timestamp_us, verdict, label.sensors),
        )
        if len(heap) < count:
            heapq.heappush(heap, entry)
        elif found.widening_m < bound:
            heapq.heapreplace(heap, entry)
    return [result for _, _, result in sorted(heap, key=lambda each: (-each[0], -each[1]))]
