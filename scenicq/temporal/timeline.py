"""In which mode each process of a run is from when to when: the run is followed once more, sample after sample.

Where a behavior chooses, the run is one that ends as it should; where what is not observed leads on in several ways, a
process is in a known mode only if it is so in all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Activity, Dynamics
from scenicq.limits import LIMITS
from scenicq.temporal.run_machine import Advance, Choices, RunMachine
from scenicq.temporal.runs import later_sample
from scenicq.temporal.truth import UNKNOWN, Truth

__all__ = ["ModeSegment", "RunTimeline", "timeline_of"]


@dataclass(frozen=True, slots=True)
class ModeSegment:
    """A mode that a process is in for some samples.

    Attributes:
        process: The number of the process.
        activity: What it does, or the scenario that it runs; None where that is not known.
        first, last: The first and the last sample after which it does so, from the start of the run.
    """

    process: int
    activity: Activity | None
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class RunTimeline:
    """The modes of a run, process by process, in order of time.

    Attributes:
        segments: The modes.
        may_match: Whether it may end as a match with the last sample.
    """

    segments: tuple[ModeSegment, ...]
    may_match: bool


_Ways = Callable[[int, int], Iterator[tuple[Advance, Choices]]]
_Step = tuple[int, Choices]
"""A situation, and what is chosen in it."""


def timeline_of(dynamics: Dynamics, times_us: NDArray[np.int64], truths: Mapping[int, Truth]) -> RunTimeline:
    """The modes of a run: of one that matches and ends with the last sample, if there is one.

    Args:
        dynamics: The program.
        times_us: Times of the samples of the run, ascending.
        truths: What is known of conditions at each sample, by their numbers; the others are unknown.
    """
    machine, seconds = RunMachine(dynamics), (times_us - times_us[0]) / 1e6
    limit_s = dynamics.time_limit_s
    values = [
        {each: int(truths[each][here]) if each in truths else int(UNKNOWN) for each in machine.atoms}
        for here in range(len(seconds))
    ]
    due = [limit_s is not None and each >= limit_s - 1e-6 for each in seconds.tolist()]

    def ways(here: int, situation: int) -> Iterator[tuple[Advance, Choices]]:
        later = partial(later_sample, seconds, here)
        return machine.ways(situation, values[here], due=due[here], here=here, later=later)

    path, over, may_match = _path(machine, ways, len(seconds))
    count = len(dynamics.processes)
    doing: list[tuple[tuple[Activity, ...] | None, ...]] = []
    for here in range(len(seconds) - over):
        if here < len(path):
            situation, chosen = path[here]
            later = partial(later_sample, seconds, here)
            last = here == len(seconds) - 1
            doing.append(
                machine.doing(situation, values[here], chosen, due=due[here], here=here, later=later, last=last)
            )
        else:
            doing.append((None,) * count)
    found: list[ModeSegment] = []
    for number in range(count):
        found += _segments(number, [each[number] for each in doing], composes=dynamics.processes[number].composes)
    return RunTimeline(tuple(found), may_match)


def _path(machine: RunMachine, ways: _Ways, size: int) -> tuple[list[_Step], bool, bool]:
    """The situations of a run with what it chooses, whether it is over with the last sample, and may match."""
    # each situation before a sample, with the step that leads there
    layers: list[dict[int, _Step | None]] = [{0: None}]
    ends: list[tuple[tuple[int, int], _Step, bool]] = []
    for here in range(size):
        after: dict[int, _Step | None] = {}
        for situation in layers[here]:
            for advance, chosen in ways(here, situation):
                step = situation, chosen
                if here == size - 1:
                    ends += _ends(machine, advance, step)
                elif advance.situation is not None and len(after) < LIMITS.run_pieces:
                    after.setdefault(advance.situation, step)
        going = {each: step for each, step in after.items() if not machine.situations[each].undecided}
        if here < size - 1:
            if not going:
                break
            # what is lost for good is followed where nothing else is left
            hopeful = {each: step for each, step in going.items() if not machine.situations[each].is_lost}
            layers.append(hopeful or going)
    over = may_match = False
    step: _Step
    if ends:
        (rank, _), step, over = max(ends, key=lambda each: each[0])
        may_match = rank > 0
    else:
        step = next(iter(layers[-1])), {}
    path = [step]
    for layer in reversed(layers[1:]):
        before = layer[path[-1][0]]
        assert before is not None
        path.append(before)
    return path[::-1], over, may_match


def _ends(machine: RunMachine, advance: Advance, step: _Step) -> Iterator[tuple[tuple[int, int], _Step, bool]]:
    """How a run may end with the last sample, each with how well: above 0 where it may be a match."""
    terminates = machine.dynamics.terminates
    if advance.may_match or advance.may_fail:
        yield (2 * advance.may_match, -advance.may_fail), step, True
    if advance.situation is not None:
        after = machine.situations[advance.situation]
        yield (0 if terminates else int(after.truth), 1 - after.is_lost), step, False


def _segments(
    number: int, doing: Sequence[tuple[Activity, ...] | None], *, composes: bool
) -> Iterator[ModeSegment]:  # fmt: skip
    """The modes of a process, given what it does after each sample; of what composes scenarios those that run."""
    begun: dict[Activity | None, int] = {}
    found: list[ModeSegment] = []
    for here, told in enumerate([*doing, ()]):
        now: list[Activity | None] = [None] if told is None else [
            each for each in told if not composes or each.scenario >= 0
        ]  # fmt: skip
        for each in [each for each in begun if each not in now]:
            found.append(ModeSegment(number, each, begun.pop(each), here - 1))
        for each in now:
            begun.setdefault(each, here)
    yield from sorted(found, key=lambda each: each.first)
