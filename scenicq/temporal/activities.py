"""What the behaviors of a run do from when to when: the run is followed once more, one sample after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import Span
from scenicq.forest.temporal import Dynamics
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import later_sample
from scenicq.temporal.truth import UNKNOWN, Truth

__all__ = ["Activity", "activities_of"]


@dataclass(frozen=True, slots=True)
class Activity:
    """What a behavior does for some samples.

    Attributes:
        object: Whose behavior it is.
        what: The action, the behavior of the libraries or the `wait`, in the program.
        start, end: The first and the last sample, from the start of the run.
    """

    object: int
    what: Span
    start: int
    end: int


def activities_of(
    dynamics: Dynamics, seconds: NDArray[np.float64], truths: Mapping[int, Truth]
) -> tuple[Activity, ...]:
    """What behaviors do from the first sample on, object by object; up to where that is not known, or to be chosen.

    Args:
        dynamics: The program.
        seconds: Times of the samples of a run, ascending.
        truths: What is known of conditions at each sample, by their numbers; the others are unknown.
    """
    machine = RunMachine(dynamics)
    found: dict[int, list[Activity]] = {}
    situation: int | None = 0
    for here in range(len(seconds)):
        if situation is None:
            break
        later = partial(later_sample, seconds, here)
        values = {number: int(truths[number][here]) if number in truths else int(UNKNOWN) for number in machine.atoms}
        doing = machine.activities(situation, values, here=here, later=later)
        if doing is None:
            break
        for process, what in zip(dynamics.processes, doing, strict=True):
            if process.object is None or what is None:
                continue
            mine = found.setdefault(process.object, [])
            if mine and mine[-1].what == what and mine[-1].end == here - 1:
                mine[-1] = Activity(process.object, what, mine[-1].start, here)
            else:
                mine.append(Activity(process.object, what, here, here))
        ways = machine.advance(situation, values, due=False, here=here, later=later)
        situation = ways[0].situation if len(ways) == 1 else None
    return tuple(each for mine in found.values() for each in mine)
