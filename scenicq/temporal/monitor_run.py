"""A monitor run from every sample at once: when it ends the run or rejects it.

What a monitor does from a sample on hangs on the sample and on the step it is at alone. So outcomes are worked out from
the last sample to the first, and runs that stand at the same step share them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Atom, End, Goto, Monitor, Reject, Terminate, Test, Wait
from scenicq.temporal.truth import FALSE, TRUE, Truth

__all__ = ["NEVER", "SLACK_S", "Outcome", "run_monitor"]

NEVER = 1 << 60
"""A sample that does not come."""
SLACK_S = 1e-6
"""How much earlier than it should a sample may come: times are rounded."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What becomes of a run, by numbers of samples.

    Attributes:
        ends: At which sample the monitor terminates it.
        rejects: At which sample a requirement of the monitor is broken.
        unclear: From which sample on it is not known what the monitor does.
    """

    ends: int = NEVER
    rejects: int = NEVER
    unclear: int = NEVER

    def or_else(self, other: Outcome) -> Outcome:
        """What is sure of one outcome or the other."""
        if self == other:
            return self
        return Outcome(unclear=min(self.ends, self.rejects, self.unclear, other.ends, other.rejects, other.unclear))


def run_monitor(monitor: Monitor, atom: Callable[[Atom], Truth], seconds: NDArray[np.float64]) -> list[Outcome]:
    """What becomes of the runs that start at each sample.

    Args:
        monitor: The monitor.
        atom: The value of an atom at each sample, shape (n,).
        seconds: Time of each sample, ascending, shape (n,).
    """
    n = len(seconds)
    waits = {number: step for number, step in enumerate(monitor.steps) if isinstance(step, Wait)}
    # at which sample a wait that begins at each sample is over; n where none is late enough
    over: dict[int, list[int]] = {
        number: np.maximum(np.searchsorted(seconds, seconds + step.for_s - SLACK_S), np.arange(1, n + 1)).tolist()
        for number, step in waits.items()
    }
    entries = {0, *(step.then for step in waits.values())}
    tests = {
        number: atom(step.condition).tolist() for number, step in enumerate(monitor.steps) if isinstance(step, Test)
    }
    # by sample, the last of which is one that does not come: outcomes from each step that a wait leads to
    found: list[dict[int, Outcome]] = [{} for _ in range(n)]
    found.append(dict.fromkeys(entries, Outcome()))
    for sample in range(n - 1, -1, -1):
        known = {number: found[over[number][sample]][step.then] for number, step in waits.items()}
        found[sample] = {entry: _from(monitor, entry, sample, tests, known) for entry in entries}
    return [outcomes[0] for outcomes in found[:n]]


def _from(
    monitor: Monitor,
    first: int,
    sample: int,
    tests: dict[int, list[int]],
    known: dict[int, Outcome],
) -> Outcome:
    """The outcome from a step on at a sample, where those of waits are known; between them there is no circle."""
    stack = [first]
    while stack:
        number = stack[-1]
        step = monitor.steps[number]
        match step:
            case Test():
                value = tests[number][sample]
                after = (
                    [step.then]
                    if value == TRUE
                    else [step.otherwise]
                    if value == FALSE
                    else [step.then, step.otherwise]
                )
            case Goto():
                after = [step.then]
            case Wait():
                after = []
            case Terminate():
                after = []
                known[number] = Outcome(ends=sample)
            case Reject():
                after = []
                known[number] = Outcome(rejects=sample)
            case End():
                after = []
                known[number] = Outcome()
            case _:
                assert_never(step)
        waiting = [target for target in after if target not in known]
        if waiting:
            stack += waiting
            continue
        stack.pop()
        if after:
            outcome = known[after[0]]
            for target in after[1:]:
                outcome = outcome.or_else(known[target])
            known[number] = outcome
    return known[first]
