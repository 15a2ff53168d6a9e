"""The recordings that do not match over time but come closest, and what would let each through.

What would do is a tolerance, widened by so many metres in the sense of `nearest_miss`, under which an interval matches;
or one number of the program, changed by so much in its own unit, where a binding misses a requirement over time or the
end of the program; or a shorter least duration. A recording's distance is the smallest of these. Whatever is told has
been tried: with it the recording matches.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from scenicq.limits import LIMITS
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Cause, Match, NoMatch
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.explain.changes import (
    LADDER_M,
    Change,
    change_duration,
    change_tolerance,
    find_least,
    interval_length,
    longest_interval,
    shift_comparison,
    show_tolerance,
)
from scenicq.query.explain.interval_explanation import changes_of, locate_interval
from scenicq.query.explain.nearest_miss import tell_cut, widen_tolerance, with_parts

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
    furthest = sorted(missed.values(), key=lambda mine: -max(map(interval_length, mine)))
    if len(furthest) > LIMITS.ranked_recordings:
        tell_cut(query, LIMITS.ranked_recordings, "recordings")
    for mine in furthest[: LIMITS.ranked_recordings]:
        longest = sorted(mine, key=interval_length, reverse=True)
        _keep(near, _by_number(every, longest[: max(1, LIMITS.ranked_bindings // len(missed))]))
        _keep(near, _by_duration(every, longest[0]))
    seen = set(matching)
    for widening_m in LADDER_M:
        nearer = _bound(near, count)
        if widening_m > nearer and widening_m / 10 > nearer:
            break
        for each in _under(every, widen_tolerance(query.options.match.tolerance, widening_m)):
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


def _is_match(result: Result) -> bool:
    return isinstance(result.verdict, Match)


def _tries(query: Query, recording: str) -> Callable[[Change], Result | None]:
    """Gives the longest interval of a recording that matches with a change."""
    with query.dataset.connect() as connection:
        found = connection.execute("SELECT map FROM labels WHERE recording = ? LIMIT 1", [recording]).fetchone()
    assert found is not None
    return partial(longest_interval, query, recording, found[0])


def _near(found: Result | None, change: Change) -> _Near | None:
    """A recording that a change lets in, with the change as its cause; None where it does not."""
    if found is None:
        return None
    assert isinstance(found.verdict, Match)
    cause = Cause(change.about, change.text, change.span)
    return _Near(change.size, replace(found, verdict=NoMatch(cause, found.verdict.correspondence)))


def _by_number(query: Query, results: Sequence[Result]) -> _Near | None:
    """The least change of one number by which a recording matches that has these bindings.

    Args:
        query: The query.
        results: Results of one recording, at least one, none of which matches.
    """
    changes: list[Change] = []
    for result in results:
        scenario, tracks, interval = locate_interval(query, result)
        changes += [
            shift_comparison(each, interval.broken) for each in changes_of(scenario, tracks, interval, quick=True)
        ]
    smallest = sorted(changes, key=lambda each: each.size)[: LIMITS.ranked_numbers]
    longest = _tries(query, results[0].recording)
    tried = (_near(longest(each), each) for each in smallest)
    return next((each for each in tried if each is not None), None)


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
    shorter = change_duration(enough, wanted - enough)
    return _near(_tries(query, result.recording)(shorter), shorter)


def _by_tolerance(query: Query, recording: str, enough_m: float, most_m: float) -> _Near | None:
    """The least tolerance under which a recording matches.

    Args:
        query: The query.
        recording: Its name.
        enough_m: Metres of widening under which it does.
        most_m: Metres beyond which it does not matter.
    """
    longest = _tries(query, recording)

    def wider(made: Callable[[Tolerance], Tolerance]) -> Change:
        return change_tolerance(show_tolerance(made(query.options.match.tolerance)), made, about="tolerance")

    def all_wider(widening_m: float) -> Change:
        return wider(lambda each: widen_tolerance(each, widening_m))

    ladder = [most_m] if most_m < enough_m else [enough_m]
    size = find_least(lambda widening_m: longest(all_wider(widening_m)) is not None, ladder, relative=0.01)
    if size is None:
        return None
    # one part alone is better advice
    parts = [wider(partial(with_parts, parts={part: size})) for part in ("position", "heading")]
    tried = [(longest(each), each) for each in parts]
    enough = [(found, each) for found, each in tried if found is not None]
    if not enough:
        whole = all_wider(size)
        enough = [(longest(whole), whole)]
    told = f"would match with {' or '.join(each.text for _, each in enough)}"
    found, change = enough[0]
    return _near(found, replace(change, text=told, size=size))
