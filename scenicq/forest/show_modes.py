"""What a program does over time: the modes that its monitors, behaviors and scenarios may be in, and as text.

A mode is where a process stands between two samples. Each has a number, what is done meanwhile, and where it leads: to
which modes, under which conditions, or to the end of the run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scenicq.errors import Span
from scenicq.forest.nodes import Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import (
    Activity,
    BranchOnTimer,
    Choose,
    Dynamics,
    End,
    GiveUp,
    IfRuns,
    Process,
    Reject,
    StartTimer,
    Terminate,
    Test,
    Wait,
    successors,
)
from scenicq.limits import LIMITS

__all__ = ["ModeWay", "ProcessMode", "ProcessModes", "modes_of", "show_modes"]

_WAYS_SHOWN = 6


@dataclass(frozen=True, slots=True)
class ModeWay:
    """Where a mode leads.

    Attributes:
        target: The number of a mode, or what becomes of the run in words.
        told: Under which conditions, in words; "" where it always leads there.
    """

    target: int | str
    told: str

    @property
    def text(self) -> str:
        """In words."""
        return f"{self.target} {self.told}".rstrip()


@dataclass(frozen=True, slots=True)
class ProcessMode:
    """A mode of a process.

    Attributes:
        number: Its number; it begins in 0.
        does: What is done meanwhile, with its line.
        ways: Where it leads.
        more: Whether it leads elsewhere, too.
    """

    number: int
    does: str
    ways: tuple[ModeWay, ...]
    more: bool


@dataclass(frozen=True, slots=True)
class ProcessModes:
    """The modes of a process.

    Attributes:
        head: Whose they are, and how many.
        modes: They; none of what is about the run as a whole, such as a requirement.
    """

    head: str
    modes: tuple[ProcessMode, ...] = ()


def show_modes(scenario: Scenario) -> list[str]:
    """The modes of a program, a line each below one for each process; of each variant, where there are several."""
    lines: list[str] = []
    for process in modes_of(scenario):
        lines.append(process.head)
        for each in process.modes:
            ways = [*(way.text for way in each.ways), *(["and more"] if each.more else [])]
            lines.append(f"  {each.number}  {each.does} -> {'; '.join(ways)}")
    return lines


def modes_of(scenario: Scenario) -> list[ProcessModes]:
    """What a program says about time, process by process; of each variant, where there are several."""
    found: list[ProcessModes] = []
    for each in scenario.variants or (scenario,):
        if each.dynamics is None:
            continue
        if scenario.variants:
            found.append(ProcessModes(f"with {', '.join(owner.name for owner in each.every_object)}:"))
        found += _of_dynamics(each, each.dynamics)
    return found or [ProcessModes("no modes: the program says nothing about time")]


def _of_dynamics(scenario: Scenario, dynamics: Dynamics) -> list[ProcessModes]:
    found = [
        ProcessModes(f"requirement {_place(each.span)}: {_text(each.span)}") for each in dynamics.every_requirement
    ]  # fmt: skip
    found += [ProcessModes(f"end {_place(each.span)}: {_text(each.span)}") for each in dynamics.terminations]
    for process in dynamics.processes:
        if process.composes:
            who = "what composes scenarios"
        elif process.object is None:
            who = "monitor"
        else:
            who = f"behavior of {scenario.every_object[process.object].name}"
        found.append(_of_process(process, dynamics.conditions, who))
    return found


def _of_process(process: Process, conditions: Sequence[Node], who: str) -> ProcessModes:
    """The modes of a process: where the same is done within the same calls, it is in one mode."""
    numbers: dict[tuple[Activity, ...], int] = {}
    does: dict[int, Span | None] = {0: None}
    firsts: dict[int, dict[int, None]] = {0: {0: None}}
    for step in process.steps:
        if isinstance(step, Wait):
            number = numbers.setdefault(step.activities, len(numbers) + 1)
            does.setdefault(number, step.activity)
            firsts.setdefault(number, {})[step.then] = None
    met, stack = {0}, [0]
    ways: dict[int, list[ModeWay]] = {}
    more: dict[int, bool] = {}
    while stack:
        number = stack.pop()
        ways[number], more[number], after = _ways(process, [*firsts[number]], conditions, numbers)
        stack += after - met
        met |= after
    head = f"{who} {_place(process.span)}: {len(met) - 1} {'mode' if len(met) == 2 else 'modes'}"
    return ProcessModes(head, tuple(
        ProcessMode(number, _does(does[number]) if number else "begins", tuple(ways[number]), more[number])
        for number in sorted(met)
    ))  # fmt: skip


def _does(activity: Span | None) -> str:
    return "waits" if activity is None else f"{_text(activity)} {_place(activity)}"


def _ways(
    process: Process, firsts: Sequence[int], conditions: Sequence[Node], numbers: Mapping[tuple[Activity, ...], int]
) -> tuple[list[ModeWay], bool, set[int]]:
    """Where a mode leads, whether that is not all, and to which modes."""
    found: dict[int | str, dict[tuple[str, ...], None]] = {}
    after: set[int] = set()
    stack: list[tuple[int, tuple[str, ...], frozenset[int]]] = [(first, (), frozenset()) for first in reversed(firsts)]
    for _ in range(LIMITS.mode_ways):
        if not stack:
            break
        at, told, before = stack.pop()
        if at in before:
            # a way in a circle never gets to the next sample
            continue
        step, seen = process.steps[at], before | {at}
        match step:
            case Wait():
                after.add(numbers[step.activities])
                found.setdefault(numbers[step.activities], {})[told] = None
            case Terminate():
                found.setdefault("the run ends", {})[told] = None
            case Reject():
                found.setdefault("no match", {})[told] = None
            case End():
                found.setdefault("over", {})[told] = None
            case GiveUp():
                found.setdefault("unknown", {})[told] = None
            case Test():
                text = _condition(conditions[step.condition.number])
                stack += [(step.otherwise, (*told, f"not {text}"), seen), (step.then, (*told, text), seen)]
            case BranchOnTimer():
                stack += [(step.otherwise, told, seen), (step.then, (*told, "its time is over"), seen)]
            case IfRuns():
                stack += [(step.otherwise, (*told, "a scenario is over"), seen), (step.then, told, seen)]
            case Choose():
                stack += [(each, (*told, "it chooses so"), seen) for each in reversed(step.options)]
            case StartTimer():
                stack.append((step.then, told, seen))
            case _:
                stack += [(each, told, seen) for each in successors(step)]
    lines = [_way(where, [*several]) for where, several in found.items()]
    return lines[:_WAYS_SHOWN], bool(stack) or len(lines) > _WAYS_SHOWN, after


def _way(where: int | str, several: Sequence[tuple[str, ...]]) -> ModeWay:
    """One place that a mode leads to."""
    if len(several) > 1:
        return ModeWay(where, f"in {len(several)} ways")
    told = several[0]
    return ModeWay(where, f"if {' and '.join(told)}" if told else "")


def _condition(node: Node) -> str:
    return "a condition" if node.span is None else f"({_text(node.span)})"


def _text(span: Span) -> str:
    return " ".join(span.text.split())


def _place(span: Span) -> str:
    return f"[line {span.source.position(span.start)[0]}]"
