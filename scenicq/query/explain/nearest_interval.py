"""The recordings that do not match over time but come closest, and what would let each through.

What would do is a tolerance, widened by so many metres in the sense of `nearest_miss`, under which an interval matches;
or one number of the program, changed by so much in its own unit, where a binding misses a requirement over time or the
end of the program; or a shorter least duration. A recording's distance is the smallest of these. Whatever is told has
been tried: with it the recording matches.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from scenicq.errors import Span
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Cause, Match, NoMatch
from scenicq.query.execution.block_matcher import CompiledMap
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.explain.interval_changes import Change
from scenicq.query.explain.interval_explanation import changes_of, placed
from scenicq.query.explain.nearest_miss import FINEST_M, LADDER_M, show_tolerance, tell_cut, widened, with_parts

__all__ = ["nearest_intervals"]


@dataclass(frozen=True, slots=True)
class _Near:
    """A recording that does not match.

    Attributes:
        amount: Its distance.
        result: With what would do as its cause.
    """

    amount: float
    result: Result


def nearest_intervals(query: Query, count: int) -> list[Result]:
    """The recordings that do not match but come closest, the closest first; ties in the order of the store.

    Args:
        query: A query over time.
        count: How many.

    Raises:
        ScenarioError: The program is wrong.
    """
    every = Query(query.dataset, query.source, replace(query.options, every=True, limit=None), files=query.siblings)
    results = [each for each in every.results() if each.interval is not None]
    matching = {each.recording for each in results if isinstance(each.verdict, Match)}
    near: dict[str, _Near] = {}
    missed: dict[str, list[Result]] = {}
    for each in results:
        if each.recording not in matching and isinstance(each.verdict, NoMatch):
            missed.setdefault(each.recording, []).append(each)
    furthest = sorted(missed.values(), key=lambda mine: -max(map(_length, mine)))
    if len(furthest) > LIMITS.ranked_recordings:
        tell_cut(query, LIMITS.ranked_recordings, "recordings")
    for mine in furthest[: LIMITS.ranked_recordings]:
        longest = sorted(mine, key=_length, reverse=True)
        _keep(near, _by_number(every, longest[: max(1, LIMITS.ranked_bindings // len(missed))]))
        _keep(near, _by_duration(every, longest[0]))
    seen = set(matching)
    for widening_m in LADDER_M:
        nearer = _bound(near, count)
        if widening_m > nearer and widening_m / 10 > nearer:
            break
        for each in _under(every, widened(query.options.match.tolerance, widening_m)):
            if each.recording in seen:
                continue
            if len(seen) - len(matching) >= LIMITS.ranked_recordings:
                tell_cut(query, LIMITS.ranked_recordings, "recordings")
                break
            seen.add(each.recording)
            _keep(near, _by_tolerance(every, each.recording, widening_m, _bound(near, count)))
        if widening_m >= _bound(near, count):
            break
    order = {each: place for place, each in enumerate(query.dataset.manifest.by_recording)}
    nearest = sorted(near.values(), key=lambda each: (each.amount, order[each.result.recording]))
    return [each.result for each in nearest[:count]]


def _length(result: Result) -> int:
    return 0 if result.interval is None else result.interval.count


def _keep(near: dict[str, _Near], found: _Near | None) -> None:
    """Take a recording in, unless it is known to be nearer."""
    if found is not None and found.amount < near.get(found.result.recording, _Near(math.inf, found.result)).amount:
        near[found.result.recording] = found


def _bound(near: dict[str, _Near], count: int) -> float:
    """The distance beyond which a recording does not matter."""
    amounts = sorted(each.amount for each in near.values())
    return amounts[count - 1] if len(amounts) >= count else math.inf


def _under(query: Query, tolerance: Tolerance) -> Iterable[Result]:
    """The intervals that match under another tolerance."""
    options = replace(query.options, match=replace(query.options.match, tolerance=tolerance), every=False)
    other = Query(query.dataset, query.source, options, files=query.siblings)
    return [each for each in other.results() if _is_match(each)]


def _longest(query: Query, recording: str, map_name: str, world: CompiledMap, match: MatchOptions) -> Result | None:
    """The longest interval of a recording that matches under another scenario or other options."""
    found = [each for each in query.alone(recording, map_name, world, match).results() if _is_match(each)]
    return max(found, key=_length, default=None)


def _is_match(result: Result) -> bool:
    return isinstance(result.verdict, Match)


def _map_of(query: Query, recording: str) -> str:
    """The map that a recording is on."""
    with query.dataset.connect() as connection:
        found = connection.execute("SELECT map FROM labels WHERE recording = ? LIMIT 1", [recording]).fetchone()
    assert found is not None
    return found[0]


def _let_through(found: Result, amount: float, cause: Cause) -> _Near:
    assert isinstance(found.verdict, Match)
    return _Near(amount, replace(found, verdict=NoMatch(cause, found.verdict.correspondence)))


def _by_number(query: Query, results: Sequence[Result]) -> _Near | None:
    """The least change of one number by which a recording matches that has these bindings.

    Args:
        query: The query.
        results: Of one recording, at least one, none of which matches.
    """
    recording, match = results[0].recording, query.options.match
    map_name = _map_of(query, recording)
    world = query.compiled_map(map_name)
    dynamics = world.scenario.dynamics
    if dynamics is None:
        return None
    changes: list[tuple[float, Change, Span | None]] = []
    for result in results:
        scenario, tracks, interval = placed(query, result)
        found = changes_of(scenario, tracks, interval, quick=True)
        changes += [(abs(each.amount), each, interval.broken) for each in found]
    for amount, change, broken in sorted(changes, key=lambda each: each[0])[: LIMITS.ranked_numbers]:
        conditions = change.made(dynamics.conditions)
        changed = replace(world.scenario, dynamics=replace(dynamics, conditions=conditions))
        other = CompiledMap.of(changed, world.network, match, prefilter=query.options.prefilter)
        longest = _longest(query, recording, map_name, other, match)
        if longest is not None:
            return _let_through(longest, amount, Cause("program", change.text(), broken))
    return None


def _by_duration(query: Query, result: Result) -> _Near | None:
    """The least duration with which a recording matches whose longest interval is too short.

    Args:
        query: The query.
        result: The longest interval.
    """
    wanted, span = query.options.time.min_duration_s, result.interval
    if wanted is None or span is None:
        return None
    enough = math.floor((span.end_us - result.timestamp_us) / 1e4) / 100
    if not 0 < enough < wanted:
        return None
    map_name = _map_of(query, result.recording)
    shorter = replace(query, options=replace(query.options, time=replace(query.options.time, min_duration_s=enough)))
    found = _longest(shorter, result.recording, map_name, query.compiled_map(map_name), query.options.match)
    cause = Cause("--min-duration", f"would match with --min-duration {enough:g}")
    return None if found is None else _let_through(found, wanted - enough, cause)


def _by_tolerance(query: Query, recording: str, enough_m: float, most_m: float) -> _Near | None:
    """The least tolerance under which a recording matches.

    Args:
        query: The query.
        recording: Its name.
        enough_m: Metres of widening under which it does.
        most_m: Metres beyond which it does not matter.
    """
    map_name, base = _map_of(query, recording), query.options.match
    world = query.compiled_map(map_name)

    def at(tolerance: Tolerance) -> Result | None:
        match = replace(base, tolerance=tolerance)
        other = CompiledMap.of(world.scenario, world.network, match, prefilter=query.options.prefilter)
        return _longest(query, recording, map_name, other, match)

    low, high = 0.0, enough_m
    if most_m < enough_m:
        if at(widened(base.tolerance, most_m)) is None:
            return None
        high = most_m
    while high - low > max(FINEST_M, high / 100):
        middle = (low + high) / 2
        low, high = (low, middle) if at(widened(base.tolerance, middle)) is not None else (middle, high)
    # one part alone is better advice
    told = [with_parts(base.tolerance, {part: high}) for part in ("position", "heading")]
    alone = [each for each in told if at(each) is not None] or [widened(base.tolerance, high)]
    found = at(alone[0])
    if found is None:
        return None
    words = " or ".join(map(show_tolerance, alone))
    return _let_through(found, high, Cause("tolerance", f"would match with {words}"))
