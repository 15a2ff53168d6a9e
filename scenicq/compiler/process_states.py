"""Where a process stands while it is followed: frames, what is left to do in them, and what happens next."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from scenicq.compiler.coroutines import CoroutineCall
from scenicq.compiler.local_values import VariableValue
from scenicq.compiler.raised import Handler
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import Node
from scenicq.forest.temporal import (
    Activity,
    Begin,
    CheckSample,
    End,
    GiveUp,
    Leave,
    PutBehavior,
    Reject,
    Stop,
    Terminate,
)
from scenicq.limits import LIMITS
from scenicq.syntax import ast

__all__ = [
    "AskInvariants",
    "BeginBehavior",
    "BlockFrame",
    "CallFrame",
    "Directs",
    "EnterScenarios",
    "ExceptFrame",
    "FinalFrame",
    "Following",
    "ForFrame",
    "GraphGuards",
    "GraphStatement",
    "GuardedTest",
    "Idle",
    "LibraryFrame",
    "LoopItems",
    "OnRunning",
    "OnTimer",
    "PickBehavior",
    "ProcessFrame",
    "ProcessState",
    "Raise",
    "RunningScenario",
    "ScenarioStep",
    "TimerStarts",
    "TogetherFrame",
    "TryFrame",
    "Waits",
    "Ways",
    "WhileFrame",
    "any_of",
    "ask_guards",
    "free_timer",
    "timers_of",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class AskInvariants:
    """Asks the invariants of the innermost call."""


@dataclass(frozen=True, slots=True)
class BeginBehavior:
    """Begins a behavior."""

    what: VariableValue
    span: Span


@dataclass(frozen=True, slots=True)
class PickBehavior:
    """Begins one of some behaviors that may begin; of a shuffle the others after it.

    Attributes:
        options: The behaviors.
        shuffle: Whether the others follow.
        enabled: Which of the first ones may begin, as far as that has been asked.
        span: The statement.
    """

    options: tuple[VariableValue, ...]
    shuffle: bool
    span: Span
    enabled: tuple[bool, ...] = ()


@dataclass(frozen=True, slots=True)
class Idle:
    """Does nothing for ever.

    Attributes:
        span: The statement.
    """

    span: Span


@dataclass(frozen=True, slots=True)
class Raise:
    """Raises something again, after a `finally`.

    Attributes:
        raised: What.
        span: Where it was raised.
    """

    raised: str
    span: Span


@dataclass(frozen=True, slots=True)
class EnterScenarios:
    """Begins scenarios one after the other; when all have begun, they run side by side.

    Attributes:
        waiting: Those that have not begun, or what they are in the program.
        begun: Those that have.
        span: The statement.
    """

    waiting: tuple[VariableValue | ast.Expression, ...]
    span: Span
    begun: tuple[RunningScenario, ...] = ()


GraphStatement: TypeAlias = (
    "ast.Statement | AskInvariants | BeginBehavior | PickBehavior | Idle | Raise | EnterScenarios"
)


@dataclass(frozen=True, slots=True)
class BlockFrame:
    """Statements that are left."""

    body: tuple[GraphStatement, ...]


@dataclass(frozen=True, slots=True)
class WhileFrame:
    """A loop whose condition is asked next."""

    node: ast.While


@dataclass(frozen=True, slots=True, eq=False)
class LoopItems:
    """What a loop goes through; there is one of each, so that it need not be compared.

    Attributes:
        held: It.
        stays: Whether nothing of it is read at each sample.
    """

    held: tuple[VariableValue, ...]
    stays: bool


@dataclass(frozen=True, slots=True)
class ForFrame:
    """A loop, with how many items it has been through."""

    node: ast.For
    items: LoopItems
    done: int = 0


@dataclass(frozen=True, slots=True)
class CallFrame:
    """A behavior or monitor that runs, with its variables."""

    call: CoroutineCall
    names: tuple[tuple[str, VariableValue], ...]


@dataclass(frozen=True, slots=True)
class LibraryFrame:
    """A behavior of the libraries that runs.

    Attributes:
        call: Its call.
        phase: The number of its phase.
        lasted: For how many samples, as far as that matters.
    """

    call: VariableValue
    phase: int = 0
    lasted: int = 0


@dataclass(frozen=True, slots=True)
class TryFrame:
    """What may be interrupted: frames above this one are those of the block that runs.

    Attributes:
        conditions: What interrupts it, that of the highest priority first; None for a timer.
        handlers: What is done then; of one without any, all is over then.
        body: What is interrupted.
        timer: The number of the timer.
        running: Which block runs: the number of a handler, or the number of these for the body; -1 for none.
        waiting: The frames of blocks that are interrupted themselves, by the numbers of the blocks.
        ends: Whether the condition ends it (`do ... until`).
    """

    conditions: tuple[ast.Expression | None, ...]
    handlers: tuple[tuple[GraphStatement, ...], ...]
    body: tuple[GraphStatement, ...]
    timer: int = -1
    running: int = -1
    waiting: tuple[tuple[int, tuple[ProcessFrame, ...]], ...] = ()
    ends: bool = False


@dataclass(frozen=True, slots=True)
class ExceptFrame:
    """A `try` with handlers: what frames above this one raise, they may catch.

    Attributes:
        handlers: Its handlers.
        orelse: What is done where nothing was raised.
    """

    handlers: tuple[Handler, ...]
    orelse: tuple[ast.Statement, ...]


@dataclass(frozen=True, slots=True)
class FinalFrame:
    """A `try` with a `finally`: whatever leaves frames above this one does its statements first."""

    body: tuple[ast.Statement, ...]


@dataclass(frozen=True, slots=True)
class RunningScenario:
    """A scenario that another one runs.

    Attributes:
        number: Its number.
        timer: The number of the timer that ends it; -1 for none.
        frames: Those of what it composes, the outermost first; None where it composes nothing.
        resumes: Whether they go on after a sample.
        is_new: Whether it has begun with this sample: then its time is not over.
    """

    number: int
    timer: int
    frames: tuple[ProcessFrame, ...] | None
    resumes: bool = False
    is_new: bool = True


@dataclass(frozen=True, slots=True)
class TogetherFrame:
    """Scenarios that run side by side: frames above this one are those of the one that is led through the sample.

    Attributes:
        scenarios: They.
        span: The statement that runs them.
        at: Which of them comes next.
        stage: What comes next: "runs", whether it still runs after a sample; "begins", its requirements and its time;
            "inside", what it composes; "ends", what ends it then.
    """

    scenarios: tuple[RunningScenario, ...]
    span: Span
    at: int = 0
    stage: str = "begins"


ProcessFrame: TypeAlias = (
    "BlockFrame | WhileFrame | ForFrame | CallFrame | LibraryFrame"
    " | TryFrame | ExceptFrame | FinalFrame | TogetherFrame"
)


@dataclass(frozen=True, slots=True)
class ProcessState:
    """Where a process stands.

    Attributes:
        frames: What it is in, the outermost first.
        resumed: Before which frame it goes on after a sample; -1 where it runs.
        asked: How many interrupts of that frame have been asked; -1 for none yet, nor the invariants.
        guards: Conditions that are asked next, of the call with the number after them.
        of: This number.
        first: Whether the sample is the first one.
        modes: What must have been shown since the sample before, each with its timer.
        seen: How many of these have been looked at; -1 where they have not to be.
        begun: The numbers of the scenarios that have begun, by their calls.
    """

    frames: tuple[ProcessFrame, ...]
    resumed: int = -1
    asked: int = -1
    guards: tuple[ast.DynamicStatement, ...] = ()
    of: int = -1
    first: bool = True
    modes: tuple[tuple[VariableValue, int], ...] = ()
    seen: int = -1
    begun: tuple[tuple[Hashable, int], ...] = ()


@dataclass(frozen=True, slots=True)
class GuardedTest:
    """A test, after what it asks for so that it can be made: a run without that is rejected, at its place.

    Attributes:
        node: The condition.
        guards: What it asks for.
        then, otherwise: How it goes on.
        lacking: How it goes on without what it asks for; None where the run is rejected.
        loose: Whether a circle through it is none of the program's loops.
    """

    node: Node
    guards: GraphGuards
    then: Following
    otherwise: Following
    loose: bool = False
    lacking: Following | None = None


GraphGuards: TypeAlias = tuple[tuple[Node, Span], ...]
ScenarioStep: TypeAlias = Begin | CheckSample | Stop | Leave | PutBehavior
_Last: TypeAlias = Terminate | Reject | End | GiveUp
Following: TypeAlias = "ProcessState | GuardedTest | Ways | OnTimer | TimerStarts | Waits | Directs | OnRunning | _Last"


@dataclass(frozen=True, slots=True)
class Ways:
    """Any of some ways to go on."""

    options: tuple[Following, ...]


@dataclass(frozen=True, slots=True)
class OnTimer:
    """Whether the time of a timer is over."""

    timer: int
    then: Following
    otherwise: Following


@dataclass(frozen=True, slots=True)
class TimerStarts:
    """A timer starts."""

    timer: int
    after_s: float
    then: Following
    extends: bool = False


@dataclass(frozen=True, slots=True)
class Waits:
    """The sample is over, and something goes on."""

    then: ProcessState
    activities: tuple[Activity, ...] = ()


@dataclass(frozen=True, slots=True)
class Directs:
    """A scenario begins, is checked, ends, is left, or overrides something.

    Attributes:
        step: The step, whatever it says of what follows.
        then: What follows.
    """

    step: ScenarioStep
    then: Following


@dataclass(frozen=True, slots=True)
class OnRunning:
    """Whether a scenario runs."""

    scenario: int
    then: Following
    otherwise: Following


def any_of(ways: Sequence[Following]) -> Following:
    """Any of some ways."""
    return ways[0] if len(ways) == 1 else Ways(tuple(ways))


def ask_guards(guards: GraphGuards, then: Following, lacking: Following | None = None) -> Following:
    """Ask for what must hold, then go on."""
    return GuardedTest(build.constant(True), guards, then, then, lacking=lacking) if guards else then


def timers_of(state: ProcessState) -> set[int]:
    """The timers that a state needs."""
    return _timers(state.frames) | {timer for _, timer in state.modes}


def free_timer(used: set[int]) -> int:
    """A timer that is not among those in use."""
    return next(number for number in range(LIMITS.process_steps) if number not in used)


def _timers(frames: Sequence[ProcessFrame]) -> set[int]:
    """The timers that frames need."""
    found: set[int] = set()
    for frame in frames:
        if isinstance(frame, TryFrame):
            found |= {frame.timer} - {-1}
            for _, inner in frame.waiting:
                found |= _timers(inner)
        if isinstance(frame, TogetherFrame):
            for each in frame.scenarios:
                found |= ({each.timer} - {-1}) | _timers(each.frames or ())
    return found
