"""What a scenario says about time: formulas over conditions on one instant, processes, and when it ends.

Formulas are those of Scenic 3.1's requirements: linear temporal logic over finite traces (LTLf), `next` strong. Their
atoms are boolean expressions of the forest, read at one sample of a recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from scenicq.errors import Span
from scenicq.forest.nodes import Node

__all__ = [
    "Activity",
    "Always",
    "And",
    "Atom",
    "Begin",
    "BranchOnTimer",
    "CheckSample",
    "Choose",
    "Dynamics",
    "End",
    "Eventually",
    "Formula",
    "GiveUp",
    "Goto",
    "IfRuns",
    "Leave",
    "Next",
    "Not",
    "Or",
    "Process",
    "ProcessStep",
    "PutBehavior",
    "Reject",
    "StartTimer",
    "Stop",
    "SubScenario",
    "TemporalRequirement",
    "Terminate",
    "Termination",
    "Test",
    "Until",
    "Wait",
    "operands",
    "successors",
]


@dataclass(frozen=True, slots=True, eq=False)
class Atom:
    """A condition on one sample: its number among those of `Dynamics`."""

    number: int


@dataclass(frozen=True, slots=True, eq=False)
class Not:
    """`not f`."""

    operand: Formula


@dataclass(frozen=True, slots=True, eq=False)
class And:
    """`f and g`."""

    operands: tuple[Formula, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Or:
    """`f or g`."""

    operands: tuple[Formula, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Always:
    """`always f`: at this sample and all later ones."""

    operand: Formula


@dataclass(frozen=True, slots=True, eq=False)
class Eventually:
    """`eventually f`: at this sample or a later one."""

    operand: Formula


@dataclass(frozen=True, slots=True, eq=False)
class Next:
    """`next f`: there is a next sample, and it holds there."""

    operand: Formula


@dataclass(frozen=True, slots=True, eq=False)
class Until:
    """`f until g`: g at this sample or a later one, and f at all before that."""

    left: Formula
    right: Formula


Formula: TypeAlias = Atom | Not | And | Or | Always | Eventually | Next | Until


def operands(formula: Formula) -> tuple[Formula, ...]:
    """The formulas that a formula is made of."""
    match formula:
        case Atom():
            return ()
        case Not() | Always() | Eventually() | Next():
            return (formula.operand,)
        case And() | Or():
            return formula.operands
        case Until():
            return (formula.left, formula.right)


@dataclass(frozen=True, slots=True)
class TemporalRequirement:
    """`require f` with an operator of time, evaluated from the first sample to the last, both included."""

    formula: Formula
    span: Span


@dataclass(frozen=True, slots=True)
class Termination:
    """What ends a run.

    Attributes:
        span: Where the program says it.
        condition: `terminate when C`: at the first sample where it holds.
        after_s: `terminate after N seconds`: at the first sample at least so many seconds after the start.
        simulation: Whether the condition is read after the monitors of the sample (`terminate simulation when`), not
            before.
    """

    span: Span
    condition: Atom | None = None
    after_s: float | None = None
    simulation: bool = False


@dataclass(frozen=True, slots=True)
class Test:
    """Goes on with one of two steps, within the same sample."""

    condition: Atom
    then: int
    otherwise: int


@dataclass(frozen=True, slots=True)
class Goto:
    """Goes on with another step, within the same sample."""

    then: int


@dataclass(frozen=True, slots=True)
class Activity:
    """What goes on from one sample to the next.

    Attributes:
        what: What is done, in the program: an action, a behavior of the libraries, a `wait`, a scenario that runs.
        calls: The calls within which it is done, the outermost first.
        scenario: The number of the scenario that runs; -1 for what is none.
    """

    what: Span
    calls: tuple[Span, ...] = ()
    scenario: int = -1


@dataclass(frozen=True, slots=True)
class Wait:
    """Goes on with a step at the next sample.

    Attributes:
        then: The step.
        timers: The timers that go on; others are forgotten.
        activities: What goes on meanwhile; of what composes scenarios also those that run.
    """

    then: int
    timers: tuple[int, ...] = ()
    activities: tuple[Activity, ...] = ()

    @property
    def activity(self) -> Span | None:
        """What goes on meanwhile, in the program; None where nothing does."""
        return self.activities[0].what if self.activities else None


@dataclass(frozen=True, slots=True)
class StartTimer:
    """Starts a timer, and goes on with another step within the same sample.

    Attributes:
        timer: Its number within the process.
        after_s: It is due at the first sample so many seconds later, and at least the next one.
        then: The step.
        extends: Whether it goes on instead if it runs, and is due no sooner than it was.
    """

    timer: int
    after_s: float
    then: int
    extends: bool = False


@dataclass(frozen=True, slots=True)
class BranchOnTimer:
    """Goes on with one of two steps, within the same sample, by whether the time of a timer is over."""

    timer: int
    then: int
    otherwise: int


@dataclass(frozen=True, slots=True)
class Choose:
    """Goes on with any of some steps, within the same sample: a match is a run in which one of them leads to one."""

    options: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Terminate:
    """Ends the run at this sample."""

    span: Span


@dataclass(frozen=True, slots=True)
class Reject:
    """What the process asks for does not hold: no match."""

    span: Span


@dataclass(frozen=True, slots=True)
class End:
    """The process is over, and says nothing any more."""


@dataclass(frozen=True, slots=True)
class GiveUp:
    """Nobody knows how the run goes on: it would need more objects than are counted."""

    span: Span


@dataclass(frozen=True, slots=True)
class Begin:
    """A scenario begins, with its monitors and the behaviors of its objects; goes on within the same sample."""

    scenario: int
    then: int


@dataclass(frozen=True, slots=True)
class CheckSample:
    """The requirements of a scenario read the sample; goes on within it."""

    scenario: int
    then: int


@dataclass(frozen=True, slots=True)
class Stop:
    """A scenario ends if it runs, with those that it runs: its requirements must hold; goes on within the sample."""

    scenario: int
    then: int


@dataclass(frozen=True, slots=True)
class Leave:
    """What a scenario runs (-1: the program) is left: no monitor of theirs runs any more; goes on within the sample."""

    scenario: int
    then: int


@dataclass(frozen=True, slots=True)
class IfRuns:
    """Goes on with one of two steps, within the same sample, by whether a scenario runs."""

    scenario: int
    then: int
    otherwise: int


@dataclass(frozen=True, slots=True)
class PutBehavior:
    """An object behaves in another way until a scenario (-1: the program) ends; goes on within the same sample.

    Attributes:
        scenario: The scenario.
        object: The object.
        process: Its behavior; -1 for none.
        then: The step.
    """

    scenario: int
    object: int
    process: int
    then: int


ProcessStep: TypeAlias = (
    Test
    | Goto
    | Wait
    | StartTimer
    | BranchOnTimer
    | Choose
    | Terminate
    | Reject
    | End
    | GiveUp
    | Begin
    | CheckSample
    | Stop
    | Leave
    | IfRuns
    | PutBehavior
)


def successors(step: ProcessStep) -> tuple[int, ...]:
    """The steps that may follow one within the same sample."""
    match step:
        case Test() | BranchOnTimer() | IfRuns():
            return step.then, step.otherwise
        case Goto() | StartTimer() | Begin() | CheckSample() | Stop() | Leave() | PutBehavior():
            return (step.then,)
        case Choose():
            return step.options
        case _:
            return ()


@dataclass(frozen=True, slots=True)
class Process:
    """A monitor, the behavior of an object, or what composes scenarios: a graph of steps, some for each sample.

    Attributes:
        span: Where the program requires it, gives it to the object, or defines the scenario.
        steps: They refer to each other by their numbers, and it begins with the first. A run in which it goes in a
            circle without a `Wait` is none.
        object: Whose behavior it is; None for what is none.
        composes: Whether it runs scenarios: it comes before monitors.
        overrides: Whether it is a behavior that is put for another one, and does not begin by itself.
        afresh: For steps at which it may stand between samples those at which it goes on after it was overridden.
    """

    span: Span
    steps: tuple[ProcessStep, ...]
    object: int | None = None
    composes: bool = False
    overrides: bool = False
    afresh: Mapping[int, int] = field(default_factory=dict[int, int])

    @property
    def terminates(self) -> bool:
        """Whether it may end the run, as it may where nobody knows how the run goes on."""
        return any(isinstance(step, Terminate | GiveUp) for step in self.steps)


@dataclass(frozen=True, slots=True)
class SubScenario:
    """A scenario that begins within a run.

    Attributes:
        span: Where the program runs it.
        parent: The number of the scenario that runs it; -1 for the program.
        requirements: Requirements with operators of time, from its first sample to its last.
        processes: The numbers of its monitors, and of the behaviors of its objects.
    """

    span: Span
    parent: int = -1
    requirements: tuple[TemporalRequirement, ...] = ()
    processes: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Dynamics:
    """What a dynamic program says beside its initial scene.

    Attributes:
        conditions: Boolean expressions, each about one sample: what atoms are.
        requirements: Requirements with operators of time.
        terminations: What ends a run, but what the program's own values rule out; without any it may end anywhere.
        processes: What composes scenarios, monitors that are required, then behaviors of objects, in the order in
            which they run.
        scenarios: Scenarios that begin within a run.
        needs: The numbers of those that have begun in every run that matches.
        closes: Whether the program says when it ends, although no run with these objects comes to that.
    """

    conditions: tuple[Node, ...] = ()
    requirements: tuple[TemporalRequirement, ...] = ()
    terminations: tuple[Termination, ...] = ()
    processes: tuple[Process, ...] = ()
    scenarios: tuple[SubScenario, ...] = ()
    needs: tuple[int, ...] = ()
    closes: bool = False

    @property
    def every_requirement(self) -> tuple[TemporalRequirement, ...]:
        """Its requirements, then those of its scenarios."""
        return (*self.requirements, *(own for each in self.scenarios for own in each.requirements))

    @property
    def terminates(self) -> bool:
        """Whether the program says when it ends."""
        return self.closes or bool(self.terminations) or any(process.terminates for process in self.processes)

    @property
    def time_limit_s(self) -> float | None:
        """After how many seconds `terminate after` ends a run at the latest; None where no time ends it."""
        return min((each.after_s for each in self.terminations if each.after_s is not None), default=None)
