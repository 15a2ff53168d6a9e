"""How far a frame is from matching: the least tolerance under which it would, and the frames that come closest.

A part of a tolerance (of positions, headings, speeds ...) is *widened by s metres* if it grows by s, a heading by s
times 20 degrees (the ratio of the query paper's experiments, 0.25 m and 5 degrees), any other number by s of its own
unit. A frame's distance from matching is the least s by which all parts must be widened together: what matches at one s
matches at every larger one, and bisection finds it. It is the least *widest* part of any tolerance under which the
frame matches. Each part of the advice is then made as small as it can be; and each part that is enough alone is
named with what it needs.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial

from scenicq.errors import Diagnostic
from scenicq.forest.groups import Comparison
from scenicq.limits import LIMITS
from scenicq.match.explanation import Finding
from scenicq.match.matcher import Matcher
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Cause, Match, NoMatch
from scenicq.query.execution.block_matcher import CompiledMap
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.explain.changes import FINEST_M, LADDER_M, MOST_M, find_least, show_tolerance
from scenicq.query.prefilter.executor import names, run_prefilter
from scenicq.query.prefilter.plan import make_plan
from scenicq.store.labels import Label

__all__ = [
    "NearestMiss",
    "closest",
    "narrow_advice",
    "nearest_misses",
    "tell_cut",
    "widen_tolerance",
    "with_parts",
]

_TIMEOUT_S = 1.0
_HEADING_PER_M = math.radians(20)
_BATCH = 256


@dataclass(frozen=True, slots=True)
class NearestMiss:
    """The least widening under which a label matches.

    Attributes:
        widening_m: Metres, found to within `FINEST_M` or a hundredth of it; 0 if the label matches as it is.
        tolerance: The widened tolerance.
        finding: The match under it.
        alone: Tolerances of which only one part is widened, and that is enough; the one that is widened least first.
    """

    widening_m: float
    tolerance: Tolerance
    finding: Finding
    alone: tuple[Tolerance, ...] = ()


def widen_tolerance(tolerance: Tolerance, widening_m: float) -> Tolerance:
    """A tolerance widened by so many metres, in the sense of this module."""
    return tolerance.widened(widening_m, widening_m * _HEADING_PER_M)


def with_parts(tolerance: Tolerance, parts: Mapping[str, float]) -> Tolerance:
    """A tolerance of which some parts are widened, each by so many metres.

    Args:
        tolerance: The tolerance.
        parts: "position", "heading" or another property, with its widening.
    """

    def size(name: str, old: float) -> float:
        part = "position" if name in ("x", "y") else name
        by_m = parts.get(part, 0.0)
        return min(math.pi, old + by_m * _HEADING_PER_M) if part == "heading" else old + by_m

    ruled = {name for scope, name, _ in tolerance.rules if not scope}
    others = [name for name, by_m in parts.items() if by_m and name not in ("position", "heading", *ruled)]
    return replace(
        tolerance,
        x=None if tolerance.x is None else size("x", tolerance.x),
        y=None if tolerance.y is None else size("y", tolerance.y),
        position=size("position", tolerance.position),
        heading=size("heading", tolerance.heading),
        rules=(
            *((scope, name, size(name, old)) for scope, name, old in tolerance.rules),
            *(("", name, size(name, tolerance.other)) for name in others),
        ),
    )


def closest(matcher: Matcher, label: Label, most_m: float = MOST_M) -> NearestMiss | None:
    """The smallest widening of the matcher's tolerance under which a label matches.

    Args:
        matcher: The matcher, with the tolerance to start from.
        label: The label.
        most_m: Metres beyond which it does not matter.

    Returns:
        None if it does not match even then: a class is missing, or something fails that no tolerance helps.
    """
    patient = replace(matcher.options, timeout_s=min(matcher.options.timeout_s, _TIMEOUT_S))

    reached: dict[float, NearestMiss] = {}

    def matches(widening_m: float) -> bool:
        if widening_m in reached:
            return True
        tolerance = widen_tolerance(patient.tolerance, widening_m)
        finding = matcher.relaxed(replace(patient, tolerance=tolerance)).examine(label)
        if isinstance(finding.verdict, Match):
            reached[widening_m] = NearestMiss(widening_m, tolerance, finding)
        return widening_m in reached

    if matches(0.0):
        return reached[0.0]
    # what is no closer than others costs one decision more
    if most_m < MOST_M and not matches(most_m):
        return None
    ladder = [*(size for size in LADDER_M if size < most_m), most_m]
    found = find_least(matches, ladder, relative=0.01)
    return None if found is None else reached[found]


def narrow_advice(matcher: Matcher, label: Label, found: NearestMiss) -> NearestMiss:
    """What is advised for a label: no part wider than it must be, and the parts that are enough alone.

    Args:
        matcher: The matcher.
        label: The label.
        found: As `closest` gives it for them.
    """
    if found.widening_m == 0 or found.finding.plan is None:
        return found
    base = replace(matcher.options, timeout_s=min(matcher.options.timeout_s, _TIMEOUT_S))
    constraints = (each for group in found.finding.plan.groups for each in group.group.constraints)
    compared = dict.fromkeys(each.property for each in constraints if isinstance(each, Comparison))

    def at(parts: Mapping[str, float]) -> Finding | None:
        options = replace(base, tolerance=with_parts(base.tolerance, parts))
        finding = matcher.relaxed(options).examine(label)
        return finding if isinstance(finding.verdict, Match) else None

    alone: list[tuple[float, Tolerance]] = []
    for part in compared:
        # widened alone, a part must be at least as wide as all together
        sizes = [found.widening_m, *(size for size in LADDER_M if size > found.widening_m)]
        too_little = max(0.0, 0.98 * found.widening_m - FINEST_M)
        size = find_least(partial(_enough, at, part, {}), sizes, low=too_little)
        if size is not None:
            alone.append((size, with_parts(base.tolerance, {part: size})))
    if alone:
        alone.sort(key=lambda each: each[0])
        return replace(found, alone=tuple(tolerance for _, tolerance in alone))
    parts = dict.fromkeys(compared, found.widening_m)
    for part in compared:
        rest = {name: size for name, size in parts.items() if name != part}
        if at(rest):
            parts = rest
        else:
            size = find_least(partial(_enough, at, part, rest), [parts[part]])
            parts[part] = parts[part] if size is None else size
    finding = at(parts)
    if finding is None:
        return found
    return replace(found, tolerance=with_parts(base.tolerance, parts), finding=finding)


def _enough(
    at: Callable[[Mapping[str, float]], Finding | None], part: str, rest: Mapping[str, float], size: float
) -> bool:
    """Whether a size of one part is enough beside the rest."""
    return at({**rest, part: size}) is not None


def _frames(query: Query, world: CompiledMap, widening_m: float) -> Iterator[tuple[int, str]]:
    """The frames that the prefilter of a widened tolerance leaves, each with its number on the map."""
    options = replace(query.options.match, tolerance=widen_tolerance(query.options.match.tolerance, widening_m))
    plan = make_plan(world.scenario, world.network, options)
    number = 0
    with closing(query.dataset.connect()) as connection:
        for block in query.blocks(plan.map):
            missed = run_prefilter(query.dataset, connection, plan, block).tolist()
            if min(missed, default=0) < 0:
                rows = zip(names(query.dataset, connection, block), missed, strict=True)
                for place, ((frame, _, _), step) in enumerate(rows, number):
                    if step < 0:
                        yield place, frame
            number += len(missed)


@dataclass(slots=True)
class _Ranking:
    """The frames that come closest so far.

    Attributes:
        count: How many there shall be.
        heap: The farthest first: its negative distance and place in the store, and what is needed to tell of it.
    """

    count: int
    heap: list[tuple[float, tuple[int, int], Matcher, Label, NearestMiss]]

    @property
    def bound(self) -> float:
        """Metres beyond which a frame does not matter."""
        return MOST_M if len(self.heap) < self.count else -self.heap[0][0]

    def add(self, found: NearestMiss, place: tuple[int, int], matcher: Matcher, label: Label) -> None:
        """Take a frame in, in place of the farthest one."""
        entry = (-found.widening_m, (-place[0], -place[1]), matcher, label, found)
        if len(self.heap) < self.count:
            heapq.heappush(self.heap, entry)
        elif found.widening_m < self.bound:
            heapq.heapreplace(self.heap, entry)


def nearest_misses(
    query: Query,
    count: int,
    *,
    most_frames: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Result]:
    """The frames that do not match but come closest, the closest first; ties in the order of the store.

    The prefilter says under ever wider tolerances which frames may match at all: those that it leaves first are looked
    at first, and the others only where they can still be among the closest. A frame that is no closer than the worst of
    the list costs two decisions, the others a bisection. The cause of each result is the tolerance under which it would
    match, its correspondence the one by which it then does.

    Args:
        query: The query.
        count: How many.
        most_frames: Frames to look at.
        progress: Called with 1 for each frame looked at.
    """
    ranking = _Ranking(count, [])
    left = most = LIMITS.ranked_frames if most_frames is None else most_frames
    seen: set[str] = set()
    with LazySolver(query.options.solver) as solver:
        worlds = [(world, Matcher(world.scenario, query.options.match, solver)) for world in query.fitting()]
        nearer = 0.0
        for widening_m in LADDER_M:
            if len(ranking.heap) >= count and ranking.bound <= nearer:
                break
            for map_number, (world, matcher) in enumerate(worlds):
                fresh = [each for each in _frames(query, world, widening_m) if each[1] not in seen]
                if len(fresh) > left:
                    tell_cut(query, most, "frames")
                fresh = fresh[:left]
                left -= len(fresh)
                for start in range(0, len(fresh), _BATCH):
                    places = {frame: place for place, frame in fresh[start : start + _BATCH]}
                    seen.update(places)
                    for label in query.dataset.labels(places):
                        found = closest(matcher, label, ranking.bound)
                        if found is not None and found.widening_m > 0:
                            ranking.add(found, (map_number, places[label.frame]), matcher, label)
                        if progress is not None:
                            progress(1)
            nearer = widening_m
        nearest = sorted(ranking.heap, key=lambda each: (-each[0], (-each[1][0], -each[1][1])))
        return [_result(matcher, label, found) for _, _, matcher, label, found in nearest]


def tell_cut(query: Query, most: int, what: str) -> None:
    """Say, once, that a ranking has not looked at all that may be among the closest."""
    message = f"--near looked at {most:,} {what}: others may come closer"
    warning = Diagnostic("ranking-cut", message, severity="warning")
    if warning not in query.funnel.warnings:
        query.funnel.warnings.append(warning)


def _result(matcher: Matcher, label: Label, found: NearestMiss) -> Result:
    advice = narrow_advice(matcher, label, found)
    assert isinstance(advice.finding.verdict, Match)
    told = " or ".join(map(show_tolerance, advice.alone or (advice.tolerance,)))
    verdict = NoMatch(Cause("tolerance", f"would match with {told}"), advice.finding.verdict.correspondence)
    return Result(label.frame, label.recording, label.timestamp_us, verdict, label.sensors)
