"""Where runs of a dynamic program that start at some samples of one stretch end, and what is true of them.

A run from sample i matches if it ends at j and everything holds on i..j. A program that says when it ends has one j for
each i; any other may end anywhere, and then j is the last sample up to which everything holds. This is the general way;
`run_columns` decides the runs of many stretches at once where a program allows it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import Span
from scenicq.forest.temporal import Atom, Dynamics
from scenicq.temporal.ltlf import evaluate
from scenicq.temporal.monitor_run import NEVER, SLACK_S, Outcome, run_monitor
from scenicq.temporal.occurrences import next_at
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["SLACK_S", "Run", "runs_from"]

_MOST_CELLS = 4_000_000
"""Truth values of a formula in memory."""


@dataclass(frozen=True, slots=True)
class Run:
    """What became of the run from one sample.

    Attributes:
        start: The sample.
        end: The last sample; of a run that is no match, how far it came.
        truth: Whether it matches.
        broken: What keeps it from matching, in the program; None where nothing does, and where it is cut off.
        cut_off: Whether the samples are over before the program ends.
        open_: Whether a later end is not excluded: of a match that what is unknown may let go on.
    """

    start: int
    end: int
    truth: int
    broken: Span | None = None
    cut_off: bool = False
    open_: bool = False


def runs_from(
    dynamics: Dynamics, atom: Callable[[Atom], Truth], seconds: NDArray[np.float64], starts: Sequence[int]
) -> list[Run]:
    """The runs from some samples.

    Args:
        dynamics: The program.
        atom: The value of an atom at each sample, shape (n,).
        seconds: Time of each sample, shape (n,).
        starts: Samples to start from, ascending.
    """
    n = len(seconds)
    watched = [run_monitor(monitor, atom, seconds) for monitor in dynamics.monitors]
    if dynamics.terminates:
        return _terminating(dynamics, atom, seconds, starts, watched)
    found = {start: Run(start, start, int(FALSE)) for start in starts}
    broken: dict[int, Span | None] = {}
    size = max(1, _MOST_CELLS // max(n, 1))
    for first in range(0, n, size):
        ends = np.arange(first, min(first + size, n))
        values = _requirements(dynamics, atom, ends, n)
        holds = values.min(axis=0)
        for start in starts:
            row = holds[start].copy()
            row[ends < start] = FALSE
            outcomes = [outcomes[start] for outcomes in watched]
            for outcome in outcomes:
                row[ends >= outcome.rejects] = FALSE
                row[ends >= outcome.unclear] = np.minimum(row[ends >= outcome.unclear], UNKNOWN)
            best = int(row.max(initial=FALSE))
            # a later end of the same truth counts, one that is less sure does not
            if best > FALSE and best >= found[start].truth:
                held = np.flatnonzero(row == best)[-1]
                found[start] = Run(start, int(ends[held]), best, open_=bool((row[held + 1 :] > FALSE).any()))
            elif best > FALSE:
                found[start] = replace(found[start], open_=True)
            if first <= start < first + size:
                broken[start] = _broken(dynamics, values[:, start, start - first], outcomes)
    return [run if run.truth > FALSE else replace(run, broken=broken[run.start]) for run in found.values()]


def _requirements(dynamics: Dynamics, atom: Callable[[Atom], Truth], ends: NDArray[np.intp], n: int) -> Truth:
    """Whether each requirement holds from each sample to each of some ends, shape (requirements + 1, n, m).

    The last one holds always, so that there is one.
    """
    found = [evaluate(requirement.formula, atom, ends) for requirement in dynamics.requirements]
    return np.stack([*found, np.full((n, len(ends)), TRUE)])


def _broken(dynamics: Dynamics, values: Truth, outcomes: Sequence[Outcome]) -> Span | None:
    """The first requirement that is broken, by its value, or the first monitor that rejects."""
    for number in np.flatnonzero(values == FALSE).tolist():
        return dynamics.requirements[number].span
    rejecting = [m.span for m, outcome in zip(dynamics.monitors, outcomes, strict=True) if outcome.rejects < NEVER]
    return rejecting[0] if rejecting else None


def _terminating(
    dynamics: Dynamics,
    atom: Callable[[Atom], Truth],
    seconds: NDArray[np.float64],
    starts: Sequence[int],
    watched: Sequence[Sequence[Outcome]],
) -> list[Run]:
    n = len(seconds)
    ended = np.full(n, FALSE)
    for termination in dynamics.terminations:
        if termination.condition is not None:
            ended = np.maximum(ended, atom(termination.condition))
    after_s = min((each.after_s for each in dynamics.terminations if each.after_s is not None), default=math.inf)
    sure, possible = next_at(ended == TRUE), next_at(ended >= UNKNOWN)
    spans: list[tuple[int, int, bool]] = []
    for start in starts:
        outcomes = [outcomes[start] for outcomes in watched]
        late = n
        if math.isfinite(after_s):
            late = int(np.searchsorted(seconds, float(seconds[start]) + after_s - SLACK_S))
        last = min([int(sure[start]), max(late, start), *(outcome.ends for outcome in outcomes)])
        unclear = min([int(possible[start]), *(outcome.unclear for outcome in outcomes)])
        spans.append((min(unclear, last), last, unclear < last))
    wanted = sorted({end for first, last, _ in spans for end in range(first, min(last, n - 1) + 1)})
    holds: dict[int, Truth] = {}
    size = max(1, _MOST_CELLS // max(n, 1))
    for first in range(0, len(wanted), size):
        some = np.array(wanted[first : first + size], dtype=np.intp)
        # only the rows of starts are asked for
        values = _requirements(dynamics, atom, some, n)[:, list(starts)]
        holds |= {int(end): values[:, :, column] for column, end in enumerate(some)}
    found: list[Run] = []
    for place, (start, (first, last, unclear)) in enumerate(zip(starts, spans, strict=True)):
        outcomes = [outcomes[start] for outcomes in watched]
        truths = {
            end: _monitored(int(holds[end][:, place].min()), end, outcomes)
            for end in range(first, min(last, n - 1) + 1)
        }
        if not truths:
            # its samples are over, unless a monitor has rejected it before
            rejected = min((outcome.rejects for outcome in outcomes), default=NEVER)
            broken = None if rejected == NEVER else _broken(dynamics, np.empty(0, np.int8), outcomes)
            found.append(Run(start, n - 1, int(FALSE), broken, cut_off=rejected == NEVER))
        elif not unclear:
            truth = truths[last]
            broken = _broken(dynamics, holds[last][:, place], outcomes) if truth == FALSE else None
            found.append(Run(start, last, truth, broken))
        else:
            open_ends = [end for end, truth in truths.items() if truth > FALSE]
            end = last if last < n else open_ends[0] if open_ends else first
            # where the end itself is not seen, it may still come
            found.append(Run(start, end, int(UNKNOWN if open_ends or last >= n else FALSE)))
    return found


def _monitored(truth: int, end: int, outcomes: Sequence[Outcome]) -> int:
    """The truth of a run with what monitors reject by its end."""
    for outcome in outcomes:
        if outcome.rejects <= end:
            return int(FALSE)
        if outcome.unclear <= end:
            truth = min(truth, int(UNKNOWN))
    return truth
