"""What the roles of a run do from when to when, and what the one does not show that does not do what it should."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenicq.compiler.contract_bounds import BOUNDS
from scenicq.forest.nodes import Compare, CompareOp, Feature, Logic, LogicOp, Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import Activity, Process, StartTimer, Test, Wait
from scenicq.forest.walk import postorder
from scenicq.query.explain.bands import KnownConditions, shorten, sides_over
from scenicq.store.tracks import RecordingTracks
from scenicq.temporal.intervals import IntervalVerdict
from scenicq.temporal.timeline import ModeSegment, timeline_of
from scenicq.temporal.truth import FALSE

__all__ = ["RunModes", "run_modes"]

_UNITS = {"speed": "m/s", "acceleration": "m/s\N{SUPERSCRIPT TWO}"}


@dataclass(frozen=True, eq=False)
class RunModes:
    """What the processes of a run do.

    Attributes:
        scenario: The program.
        seconds: Times of the samples of the run, in the recording.
        over: What is known of conditions.
        segments: The modes.
    """

    scenario: Scenario
    seconds: Sequence[float]
    over: KnownConditions
    segments: tuple[ModeSegment, ...]

    def lines(self) -> list[str]:
        """A line for each object, monitor and scenario that the program says something of."""
        dynamics = self.scenario.dynamics
        assert dynamics is not None
        lines: dict[str, list[str]] = {}
        for each in self.segments:
            process = dynamics.processes[each.process]
            who = "scenario" if process.composes else shorten(self._who(process))
            what = "not known" if each.activity is None else shorten(_text(each.activity))
            # it goes on to the sample at which something else does
            until = self.seconds[self._end(each)]
            lines.setdefault(who, []).append(f"{what} {self.seconds[each.first]:.1f}-{until:.1f} s")
        return [f"{who}: {', '.join(told)}" for who, told in lines.items()]

    def broken(self, process: int) -> list[str]:
        """What a behavior that has rejected the run asked for at last, and what its object has shown."""
        assert self.scenario.dynamics is not None
        behavior = self.scenario.dynamics.processes[process]
        mine = [each for each in self.segments if each.process == process]
        if behavior.object is None or not mine or mine[-1].activity is None:
            return []
        activity, at = mine[-1].activity, self._end(mine[-1])
        found: list[str] = []
        for number in dict.fromkeys(_asked_in(behavior, activity)):
            truth = self.over.truths.get(number)
            if truth is None or truth[at] != FALSE:
                continue
            right = np.flatnonzero(truth[:at] != FALSE)
            since = max(int(right[-1]) + 1 if len(right) else 0, mine[-1].first)
            values = self._values(self.scenario.dynamics.conditions[number], at)
            line = activity.what.source.position(activity.what.start)[0]
            found.append(
                f"`{self._who(behavior)}` {self._moved(behavior.object, since)} at {self.seconds[since]:.1f} s, "
                f"the program asks it for `{shorten(_text(activity))}` (line {line}): "
                f"{values or 'it shows something else'} at {self.seconds[at]:.1f} s"
            )
        return found

    def ends(self, process: int) -> float | None:
        """When a process has done its last, in seconds; None where it is not known to have done anything."""
        mine = [each for each in self.segments if each.process == process]
        return self.seconds[self._end(mine[-1])] if mine else None

    def _end(self, segment: ModeSegment) -> int:
        return min(segment.last + 1, len(self.seconds) - 1)

    def _who(self, process: Process) -> str:
        if process.object is None:
            return " ".join(process.span.text.split()).removeprefix("require ")
        return self.scenario.every_object[process.object].name

    def _moved(self, index: int, at: int) -> str:
        """What an object is seen to do at a sample."""
        speed, gains = (
            self._observed(Feature(index, name, "scalar", current=True), at) for name in ("speed", "acceleration")
        )
        if speed is not None and speed < BOUNDS["rest"].value:
            return "stood"
        if gains is None or abs(gains) < BOUNDS["change"].value:
            return "went on" if speed is not None else "was"
        return "got faster" if gains > 0 else "braked"

    def _observed(self, node: Node, at: int) -> float | None:
        columns = self.over.columns
        found = columns.number(columns.expanded(node))
        return None if found is None or np.isnan(found[at]) else float(found[at])

    def _values(self, condition: Node, at: int) -> str:
        """What is observed at a sample of all that is asked for and does not hold there, against what is asked."""
        low: dict[str, float] = {}
        high: dict[str, float] = {}
        shown: dict[str, tuple[float, str]] = {}
        wrong: dict[str, None] = {}
        for clause in _parts(condition, LogicOp.AND):
            options = _parts(clause, LogicOp.OR)
            fails = self._is_false(clause, at)
            for each in options if fails else [each for each in options if isinstance(each, Compare)]:
                for one in (node for node in postorder((each,)) if isinstance(node, Compare)):
                    sides = sides_over(self.over.columns, one)
                    if not sides or np.isnan(sides[at]).any() or one.op not in _ENDS:
                        continue
                    name, unit = _quantity(one.left)
                    is_low = one.op in (CompareOp.GE, CompareOp.GT)
                    shown[name] = sides[at][0], unit
                    # a bound that stands with another condition is none by itself
                    if one is each:
                        ends, loosest = (low, min) if is_low else (high, max)
                        ends[name] = loosest(ends.get(name, sides[at][1]), sides[at][1])
                    if fails and one is each:
                        wrong[name] = None
        return "; ".join(_against(shown[name], low.get(name), high.get(name), name) for name in wrong)

    def _is_false(self, node: Node, at: int) -> bool:
        return bool(self.over.columns.truth(node)[at] == FALSE)


_ENDS = (CompareOp.GE, CompareOp.GT, CompareOp.LE, CompareOp.LT)


def run_modes(
    scenario: Scenario, tracks: RecordingTracks, interval: IntervalVerdict, over: KnownConditions
) -> RunModes | None:
    """What the processes of a run do over an interval; None where the program has none.

    Args:
        scenario: The program.
        tracks: The recording.
        interval: The interval.
        over: What is known of conditions over it.
    """
    dynamics = scenario.dynamics
    if dynamics is None or not dynamics.processes:
        return None
    within = slice(interval.start, interval.end + 1)
    segments = timeline_of(dynamics, tracks.times_us[within], over.truths).segments
    return RunModes(scenario, tracks.seconds[within].tolist(), over, segments)


def _asked_in(process: Process, activity: Activity) -> Iterator[int]:
    """The conditions that must be shown while something is done, by their numbers."""
    for step in process.steps:
        if not (isinstance(step, Wait) and activity in step.activities):
            continue
        at = step.then
        # who shows what it must has time again
        while isinstance(test := process.steps[at], Test):
            kept = process.steps[test.then]
            if not (isinstance(kept, StartTimer) and kept.extends):
                break
            yield test.condition.number
            at = kept.then


def _parts(node: Node, op: LogicOp) -> list[Node]:
    """The conditions that are connected so, in order."""
    found: list[Node] = []
    stack = [node]
    while stack:
        each = stack.pop()
        if isinstance(each, Logic) and each.op is op:
            stack += reversed(each.args)
        else:
            found.append(each)
    return found


def _quantity(node: Node) -> tuple[str, str]:
    """What a comparison is about, and its unit."""
    if isinstance(node, Feature):
        return node.property, _UNITS.get(node.property, "")
    kinds = {type(each).__name__ for each in postorder((node,))}
    return ("distance", "m") if "Distance" in kinds else ("direction", "rad")


def _against(shown: tuple[float, str], low: float | None, high: float | None, name: str) -> str:
    value, unit = shown
    told = f"{name} {value:.3g} {unit}".rstrip()
    if low is not None and high is not None and low < high:
        return f"{told}, target {(low + high) / 2:.3g} \N{PLUS-MINUS SIGN} {(high - low) / 2:.2g}"
    if low is not None:
        return f"{told}, at least {low:.3g}"
    return told if high is None else f"{told}, at most {high:.3g}"


def _text(activity: Activity) -> str:
    return " ".join(activity.what.text.split())
