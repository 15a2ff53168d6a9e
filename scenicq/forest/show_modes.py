"""What a program does over time as text: the modes that its monitors, behaviors and scenarios may be in.

A mode is where a process stands between two samples. Each line has its number, what is done meanwhile, and where it
leads: to which modes, under which conditions, or to the end of the run.
"""

from __future__ import annotations

from collections.abc import Sequence

from scenicq.errors import Span
from scenicq.forest.nodes import Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import (
    Arm,
    Choose,
    Due,
    Dynamics,
    End,
    GiveUp,
    IfRuns,
    Process,
    Reject,
    Terminate,
    Test,
    Wait,
    successors,
)
from scenicq.limits import LIMITS

__all__ = ["show_modes"]

_WAYS_SHOWN = 6


def show_modes(scenario: Scenario) -> list[str]:
    """The modes of a program, a line each below one for each process; of each variant, where there are several."""
    lines: list[str] = []
    for each in scenario.variants or (scenario,):
        if each.dynamics is None:
            continue
        if scenario.variants:
            lines.append(f"with {', '.join(owner.name for owner in each.every_object)}:")
        lines += _of_dynamics(each, each.dynamics)
    return lines or ["no modes: the program says nothing about time"]


def _of_dynamics(scenario: Scenario, dynamics: Dynamics) -> list[str]:
    lines = [
        f"requirement {_place(each.span)}: {_text(each.span)}" for each in dynamics.every_requirement
    ]  # fmt: skip
    lines += [f"end {_place(each.span)}: {_text(each.span)}" for each in dynamics.terminations]
    for process in dynamics.processes:
        if process.composes:
            who = "what composes scenarios"
        elif process.object is None:
            who = "monitor"
        else:
            who = f"behavior of {scenario.every_object[process.object].name}"
        lines += _of_process(process, dynamics.conditions, who)
    return lines


def _of_process(process: Process, conditions: Sequence[Node], who: str) -> list[str]:
    """A line for the process, and one for each of its modes."""
    numbers: dict[int, int] = {0: 0}
    does: dict[int, Span | None] = {0: None}
    for step in process.steps:
        if isinstance(step, Wait) and step.then not in numbers:
            numbers[step.then] = len(numbers)
            does[step.then] = step.activity
    met, stack = {0}, [0]
    ways: dict[int, list[str]] = {}
    while stack:
        at = stack.pop()
        ways[at], after = _ways(process, at, conditions, numbers)
        stack += after - met
        met |= after
    head = f"{who} {_place(process.span)}: {len(met) - 1} {'mode' if len(met) == 2 else 'modes'}"
    return [head, *(
        f"  {numbers[at]}  {'begins' if not numbers[at] else _does(does[at])} -> {'; '.join(ways[at])}"
        for at in sorted(met, key=numbers.__getitem__)
    )]  # fmt: skip


def _does(activity: Span | None) -> str:
    return "waits" if activity is None else f"{_text(activity)} {_place(activity)}"


def _ways(
    process: Process, first: int, conditions: Sequence[Node], numbers: dict[int, int]
) -> tuple[list[str], set[int]]:
    """Where a mode leads, in words, and to which modes."""
    found: dict[str, list[tuple[str, ...]]] = {}
    after: set[int] = set()
    stack: list[tuple[int, tuple[str, ...]]] = [(first, ())]
    for _ in range(LIMITS.mode_ways):
        if not stack:
            break
        at, told = stack.pop()
        step = process.steps[at]
        match step:
            case Wait():
                after.add(step.then)
                found.setdefault(f"{numbers[step.then]}", []).append(told)
            case Terminate():
                found.setdefault("the run ends", []).append(told)
            case Reject():
                found.setdefault("no match", []).append(told)
            case End():
                found.setdefault("over", []).append(told)
            case GiveUp():
                found.setdefault("unknown", []).append(told)
            case Test():
                text = _condition(conditions[step.condition.number])
                stack += [(step.otherwise, (*told, f"not {text}")), (step.then, (*told, text))]
            case Due():
                stack += [(step.otherwise, told), (step.then, (*told, "its time is over"))]
            case IfRuns():
                stack += [(step.otherwise, (*told, "a scenario is over")), (step.then, told)]
            case Choose():
                stack += [(each, (*told, "it chooses so")) for each in reversed(step.options)]
            case Arm():
                stack.append((step.then, told))
            case _:
                stack += [(each, told) for each in successors(step)]
    lines = [_way(where, several) for where, several in found.items()]
    more = len(lines) - _WAYS_SHOWN
    if stack or more > 0:
        lines = [*lines[:_WAYS_SHOWN], "and more"]
    return lines, after


def _way(where: str, several: Sequence[tuple[str, ...]]) -> str:
    """One place that a mode leads to."""
    if len(several) > 1:
        return f"{where} in {len(several)} ways"
    told = several[0]
    return f"{where} if {' and '.join(told)}" if told else where


def _condition(node: Node) -> str:
    return "a condition" if node.span is None else f"({_text(node.span)})"


def _text(span: Span) -> str:
    return " ".join(span.text.split())


def _place(span: Span) -> str:
    return f"[line {span.source.position(span.start)[0]}]"
