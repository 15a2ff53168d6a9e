"""Parts that have one random number in common: a value of it that suits all of them.

Each part has ways to be solved, and each way an interval that the number can be in. A value out of all parts is tried
in each of them by itself; where it fails, what is known of that part is sharpened. So the work is that of the parts
one after the other, not of all combinations of their ways.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from scenicq.forest.bounds import FloatInterval
from scenicq.forest.nodes import Identity, Value
from scenicq.limits import LIMITS
from scenicq.match.fields.cell_assignment import HeadingAssignment, extent, solve_cells
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided
from scenicq.match.tolerance import ROUNDING, SLACK, Tolerance

__all__ = ["find_shared_value", "join_intervals"]


@dataclass(frozen=True, slots=True)
class _Stretch:
    """An interval of the number in which a way may have a solution; whether its ends are those of the way's."""

    way: HeadingAssignment
    low: float
    high: float
    tight: bool = False

    def holds(self, value: float) -> bool:
        return self.low - ROUNDING <= value <= self.high + ROUNDING


def find_shared_value(
    parts: Sequence[Sequence[HeadingAssignment]],
    shared: Identity,
    tolerance: Tolerance,
    divided: Callable[[HeadingAssignment], list[HeadingAssignment] | None],
) -> Outcome:
    """Decide parts that share a random number; `Undecided` where that takes too long or cannot be told.

    Args:
        parts: Of each part the ways.
        shared: The number.
        tolerance: Per feature.
        divided: Makes ways of one over smaller ranges that have all of its solutions; None where that is no use.
    """
    first = parts[0][0].case.network.items[0][0]
    stretches = [[_Stretch(way, *way.limits) for way in ways] for ways in parts]
    sure = True
    tried: dict[int, tuple[float, Satisfied, HeadingAssignment]] = {}
    order = list(range(len(parts)))
    for _ in range(LIMITS.shared_values):
        common = _common(stretches)
        if not common:
            return Refuted(first) if sure else Undecided(first, "nonlinear")
        low, high = max(common, key=lambda ends: ends[1] - ends[0])
        value = (low + high) / 2
        for part in order:
            if part in tried and tried[part][0] == value:
                continue
            fitting = [stretch for stretch in stretches[part] if stretch.holds(value)]
            outcomes = _until_satisfied(fitting, shared, value, tolerance)
            if outcomes and isinstance(outcomes[-1], Satisfied):
                tried[part] = (value, outcomes[-1], fitting[len(outcomes) - 1].way)
                continue
            for stretch, outcome in zip(fitting, outcomes, strict=True):
                less, complete = _sharper(stretch, shared, value, tolerance, outcome, divided)
                at = stretches[part].index(stretch)
                stretches[part][at : at + 1] = less
                sure = sure and complete
            # what was hard is asked first from now on
            order.remove(part)
            order.insert(0, part)
            break
        else:
            return _all([tried[part][1:] for part in range(len(parts))], shared, value, tolerance)
    return Undecided(first, "nonlinear")


def join_intervals(ends: Sequence[FloatInterval]) -> list[FloatInterval]:
    """Intervals in order, those that meet as one."""
    found: list[FloatInterval] = []
    for low, high in sorted(ends):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found


def _common(parts: Sequence[Sequence[_Stretch]]) -> list[FloatInterval]:
    """Where every part has a stretch."""
    common: list[FloatInterval] | None = None
    for stretches in parts:
        own = join_intervals([(stretch.low, stretch.high) for stretch in stretches])
        if common is not None:
            pairs = [(max(a, c), min(b, d)) for a, b in common for c, d in own]
            own = [(min(low, high), max(low, high)) for low, high in pairs if low <= high + ROUNDING]
        common = own
    return common or []


def _until_satisfied(
    stretches: Sequence[_Stretch], shared: Identity, value: float, tolerance: Tolerance
) -> list[Outcome]:
    """What comes of a value in each stretch, up to the first in which it is part of a solution."""
    found: list[Outcome] = []
    for stretch in stretches:
        found.append(solve_cells(stretch.way, tolerance, {shared: value}))
        if isinstance(found[-1], Satisfied):
            break
    return found


def _sharper(
    stretch: _Stretch,
    shared: Identity,
    value: float,
    tolerance: Tolerance,
    outcome: Outcome,
    divided: Callable[[HeadingAssignment], list[HeadingAssignment] | None],
) -> tuple[list[_Stretch], bool]:
    """What is left of a stretch in which a value fails, and whether that is all for sure."""
    way = stretch.way
    if not stretch.tight:
        ends = extent(way, tolerance, shared, (stretch.low, stretch.high))
        if ends is None:
            return [], way.exact
        less = replace(stretch, low=ends[0], high=ends[1], tight=True)
        if not less.holds(value) or ends[1] - ends[0] < stretch.high - stretch.low - LIMITS.shared_width:
            return [less], way.exact
    ways = divided(way) if way.vague else None
    if ways is not None:
        return [_Stretch(each, *each.limits) for each in ways], True
    if stretch.high - stretch.low <= LIMITS.shared_width:
        return [], False
    # there may be solutions on either side of a gap between cells
    sides = [_Stretch(way, stretch.low, value), _Stretch(way, value, stretch.high)]
    return sides, isinstance(outcome, Refuted)


def _all(
    found: Sequence[tuple[Satisfied, HeadingAssignment]], shared: Identity, value: float, tolerance: Tolerance
) -> Outcome:
    values: dict[Identity, Value] = {}
    headings: dict[int, float] = {}
    for outcome, way in found:
        values |= outcome.values
        headings |= way.headings
    values[shared] = value
    items = [item for _, way in found for item in way.case.network.items]
    good = replay(items, values, tolerance, SLACK, headings)
    return Satisfied(values) if good else Undecided(items[0][0], "nonlinear")
