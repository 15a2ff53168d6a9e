"""A monitor run from every sample at once: when it ends the run or rejects it.

What a monitor does from a sample on hangs on the sample and on the step it is at alone. So outcomes are worked out from
the last sample to the first, and runs that stand at the same step share them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import assert_never

from scenicq.forest.temporal import Atom, End, Goto, Monitor, Reject, Terminate, Test, Wait
from scenicq.temporal.truth import FALSE, TRUE, Truth

__all__ = ["NEVER", "Outcome", "run_monitor"]

NEVER = 1 << 60
"""A sample that does not come."""


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


def run_monitor(monitor: Monitor, atom: Callable[[Atom], Truth], n: int) -> list[Outcome]:
    """What becomes of the runs that start at each of n samples.

    Args:
        monitor: The monitor.
        atom: The value of an atom at each sample, shape (n,).
        n: Samples.
    """
    entries = {0, *(step.then for step in monitor.steps if isinstance(step, Wait))}
    tests = {
        number: atom(step.condition).tolist() for number, step in enumerate(monitor.steps) if isinstance(step, Test)
    }
    following = dict.fromkeys(entries, Outcome())
    found: list[Outcome] = []
    for sample in range(n - 1, -1, -1):
        at_step: dict[int, Outcome] = {}
        following = {entry: _from(monitor, entry, sample, tests, following, at_step) for entry in entries}
        found.append(following[0])
    return found[::-1]


def _from(
    monitor: Monitor,
    first: int,
    sample: int,
    tests: dict[int, list[int]],
    following: dict[int, Outcome],
    known: dict[int, Outcome],
) -> Outcome:
    """The outcome from a step on at a sample; what lies between two `Wait`s has no circle."""
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
                known[number] = following[step.then]
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
