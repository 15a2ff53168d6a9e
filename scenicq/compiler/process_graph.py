"""Behaviors and monitors as graphs of steps: what each would do is followed once for every state that it can be in.

A state is where it stands, with the values of its local variables. From one wait to the next it is followed as Scenic
runs it; where a condition is about the sample, both ways are followed. So calls, loops, interrupts and variables leave
nothing in the graph but tests, and states that are alike are one. What Scenic asks at a sample, in its order:

- of a `try`, the conditions of its interrupts, the last one first, unless the handler runs; then what runs goes on;
- after each sample the invariants of who has a `try`, and of who did something;
- of `do B() until C`, C before B begins, and before it goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeVar, cast

from scenicq.compiler.assignment import assign
from scenicq.compiler.coerce import read_over_time, to_boolean
from scenicq.compiler.contracts import Contract, action_contract, behavior_contract
from scenicq.compiler.coroutines import CoroutineCall, LibraryCall, MonitorDefinition, ScenarioDefinition, as_behavior
from scenicq.compiler.courses import forbid_courses, split_by_course
from scenicq.compiler.environment import Environment
from scenicq.compiler.exclusions import collect_exclusions
from scenicq.compiler.items import items_of
from scenicq.compiler.local_values import HERE, LocalValues, VariableValue
from scenicq.compiler.logic import condition
from scenicq.compiler.process_states import (
    AskInvariants,
    BeginBehavior,
    BlockFrame,
    CallFrame,
    Directs,
    ExceptFrame,
    FinalFrame,
    Following,
    ForFrame,
    GraphGuards,
    GraphStatement,
    GuardedTest,
    Idle,
    LibraryFrame,
    LoopItems,
    OnRunning,
    OnTimer,
    PickBehavior,
    ProcessFrame,
    ProcessState,
    Raise,
    TimerStarts,
    TogetherFrame,
    TryFrame,
    Waits,
    Ways,
    WhileFrame,
    any_of,
    ask_guards,
    free_timer,
    timers_of,
)  # fmt: skip
from scenicq.compiler.raised import read_handlers, violation
from scenicq.compiler.scoping import bound_names
from scenicq.compiler.values import Choice, DelayedValue, Function, Instance, ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import CompareOp, Constant, Feature, Identity, Index, Leaf, Node
from scenicq.forest.temporal import (
    Activity,
    Atom,
    BranchOnTimer,
    Choose,
    End,
    Goto,
    IfRuns,
    Process,
    ProcessStep,
    Reject,
    StartTimer,
    Stop,
    Terminate,
    Test,
    Wait,
    successors,
)  # fmt: skip
from scenicq.forest.walk import postorder
from scenicq.limits import LIMITS
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["ProcessGraph", "Seconds", "has_circle", "process_of"]

_Result = TypeVar("_Result")


Seconds = Callable[["Interpreter", ast.Expression, str, Environment], float]
"""The time that a statement names, in seconds."""


@dataclass(eq=False)
class ProcessGraph:
    """A process that is followed.

    Attributes:
        run: The interpreter.
        atom: Gives a condition its number.
        agent: Whose behavior it is; None for a monitor.
        values: The values of its variables.
        seconds: Reads times.
        names: What it sees besides the program's names.
        span: Where the program makes it run.
        actions: Takes the actions that constrain nothing, each with its place.
        reaction_s: Seconds after which what it does must be shown; None where nothing must.
        scenario: The number of the scenario that made the agent; -1 for the program.
        resumable: Whether another behavior may be put for it, after which it goes on.
        afresh: See `Process`.
    """

    run: Interpreter
    atom: Callable[[Node], Atom]
    agent: Instance | None
    values: LocalValues
    seconds: Seconds
    names: dict[str, ModelValue]
    span: Span
    actions: dict[str, Span]
    reaction_s: float | None
    scenario: int = -1
    resumable: bool = False
    afresh: dict[int, int] = field(default_factory=dict[int, int])
    steps: list[ProcessStep] = field(default_factory=list[ProcessStep])
    loose: set[int] = field(default_factory=set[int])
    _asked: dict[Hashable, tuple[Node, GraphGuards]] = field(
        default_factory=dict["Hashable", "tuple[Node, GraphGuards]"]
    )
    _contracts: dict[Hashable, tuple[tuple[Contract, ...], GraphGuards]] = field(
        default_factory=dict["Hashable", "tuple[tuple[Contract, ...], GraphGuards]"]
    )
    _items: dict[tuple[VariableValue, ...], LoopItems] = field(
        default_factory=dict["tuple[VariableValue, ...]", "LoopItems"]
    )
    _numbers: dict[ProcessState, int] = field(default_factory=dict["ProcessState", int])
    _todo: list[tuple[int, ProcessState]] = field(default_factory=list["tuple[int, ProcessState]"])

    @property
    def word(self) -> str:
        """What it is."""
        return "monitor" if self.agent is None else "behavior"

    # --- the graph

    def follow(self, start: ProcessState) -> None:
        """Follow it from its start.

        Raises:
            ScenarioError: unsupported-construct, where it changes what all of the program sees.
        """
        around = [frame.call.of.environment for frame in start.frames if isinstance(frame, CallFrame)]
        shared = {} if not around else _containers(cast(Environment, around[0]).module)
        self._follow(start)
        for name, (value, before) in shared.items():
            if _contents(value) != before:
                raise fail("unsupported-construct", f"`{name}` of the program cannot be changed over time", self.span,
                           f"changed by this {self.word}", (f"keep it in a variable of the {self.word}",))  # fmt: skip

    def _follow(self, start: ProcessState) -> None:
        self.number(start)
        with read_over_time(), forbid_courses(self.run):
            while self._todo:
                number, state = self._todo.pop()
                found = self.next_of(state)
                self.steps[number] = self.make_step(found)
                if isinstance(found, GuardedTest) and found.loose:
                    self.loose.add(number)

    def add(self, step: ProcessStep) -> int:
        """Add a step; its number."""
        if len(self.steps) > LIMITS.process_steps:
            raise fail("budget-exceeded", f"the {self.word} takes more than {LIMITS.process_steps:,} steps", self.span,
                       "the budget ends here", ("make loops shorter",))  # fmt: skip
        self.steps.append(step)
        return len(self.steps) - 1

    def number(self, state: ProcessState) -> int:
        """The number of the step that a state is."""
        if state not in self._numbers:
            self._numbers[state] = self.add(End())
            self._todo.append((self._numbers[state], state))
        return self._numbers[state]

    def next_of(self, state: ProcessState) -> Following:
        """What happens next that is more than going on."""
        for _ in range(LIMITS.process_steps):
            found = self.advance(state)
            if not isinstance(found, ProcessState):
                return found
            state = found
        raise self.spins()

    def spins(self) -> Exception:
        """What is wrong where it never waits."""
        return fail("runtime-error", f"the {self.word} has a loop that never waits", self.span,
                    "never gets to the next sample", ("write `wait` in the loop",))  # fmt: skip

    def step_number(self, found: Following) -> int:
        """The number of the step for what happens next."""
        return self.number(found) if isinstance(found, ProcessState) else self.add(self.make_step(found))

    def make_step(self, found: Following) -> ProcessStep:
        """The step for what happens next."""
        match found:
            case GuardedTest():
                if isinstance(found.node, Constant):
                    step: ProcessStep = Goto(self.step_number(found.then if found.node.value else found.otherwise))
                else:
                    step = Test(self.atom(found.node), self.step_number(found.then), self.step_number(found.otherwise))
                for guard, span in found.guards:
                    lacking = Reject(span) if found.lacking is None else found.lacking
                    step = Test(self.atom(guard), self.add(step), self.step_number(lacking))
                return step
            case Ways():
                return Choose(tuple(dict.fromkeys(map(self.step_number, found.options))))
            case OnTimer():
                return BranchOnTimer(found.timer, self.step_number(found.then), self.step_number(found.otherwise))
            case TimerStarts():
                return StartTimer(found.timer, found.after_s, self.step_number(found.then), found.extends)
            case Waits():
                then, timers = found.then, timers_of(found.then)
                if self.resumable and then.modes:
                    self.afresh[self.number(then)] = self.number(replace(then, modes=(), seen=-1))
                return Wait(self.number(then), tuple(sorted(timers)), found.activities)
            case Directs():
                return replace(found.step, then=self.step_number(found.then))
            case OnRunning():
                return IfRuns(found.scenario, self.step_number(found.then), self.step_number(found.otherwise))
            case ProcessState():
                return Goto(self.number(found))
            case _:
                return found

    # --- evaluating

    def call_of(self, state: ProcessState, before: int | None = None) -> int:
        """The number of the innermost call, or of the innermost below a frame."""
        end = len(state.frames) if before is None else before
        return next(number for number in reversed(range(end)) if isinstance(state.frames[number], CallFrame))

    def scope(self, state: ProcessState, number: int) -> Environment:
        """The names that a call sees."""
        frame = cast(CallFrame, state.frames[number])
        of = frame.call.of
        names = {name: self.values.copy_value(held.value) for name, held in frame.names}
        if self.agent is not None:
            names.setdefault("self", self.agent)
        around = Environment(self.names, cast(Environment, of.environment))
        found = Environment(names, around, own=self.run.own_names(of))
        for name, value in names.items():
            if isinstance(value, Function) and value.environment is HERE:
                names[name] = replace(value, environment=found)
        return found

    def ask(
        self,
        state: ProcessState,
        wanted: ast.Expression,
        then: Following,
        otherwise: Following,
        number: int | None = None,
    ) -> Following:
        """Go on in one of two ways by a condition, which is read in the innermost call or another one."""
        run = self.run
        number = self.call_of(state) if number is None else number
        names = self.scope(state, number)

        def evaluated() -> Node:
            value = condition(run, wanted, names)
            if isinstance(value, DelayedValue):
                raise fail("wrong-type", "this needs the position of an object", wanted.span, "no object here",
                           ("write `F at V`",))  # fmt: skip
            return to_boolean(value, wanted.span)

        key = wanted, state.frames[number], state.begun
        if key not in self._asked:
            self._asked[key] = self.excluding(lambda: split_by_course(run, evaluated, wanted.span))
        node, guards = self._asked[key]
        # what a guard asks for and is not there violates it
        lacking = otherwise if state.guards else self.lacking(state)
        return self.test(state, node, guards, then, otherwise, wanted.span, lacking)

    def excluding(self, work: Callable[[], _Result]) -> tuple[_Result, GraphGuards]:
        """What is worked out, with what it excludes."""
        found, excluded = collect_exclusions(self.run, work)
        return found, tuple(excluded)

    def test(
        self, state: ProcessState, node: Node, guards: GraphGuards, then: Following, otherwise: Following, span: Span,
        lacking: Following | None = None,
    ) -> Following:  # fmt: skip
        """Go on in one of two ways by a condition, whose random numbers are drawn."""

        def tested(settled: ModelValue) -> Following:
            if isinstance(settled, Constant) and not guards:
                return then if settled.value else otherwise
            return GuardedTest(cast(Node, settled), guards, then, otherwise, lacking=lacking)

        return self.with_drawn(state, node, span, tested)

    def lacking(self, state: ProcessState) -> Following | None:
        """How a state goes on where something that is asked for is not there; None where the run is rejected."""
        found = self.raise_at(state, "RejectionException", self.span)
        return None if isinstance(found, Reject) else found

    def raise_at(self, state: ProcessState, raised: str, span: Span) -> Following:
        """Raise something: the innermost `except` that catches it goes on, else the run is rejected."""
        # what a `try` asks before it goes on inside is raised at the `try`
        end = state.resumed if state.resumed >= 0 else len(state.frames)
        for at in reversed(range(end)):
            frame = state.frames[at]
            below = replace(state, frames=state.frames[:at], resumed=-1, asked=-1, guards=(), of=-1)
            if isinstance(frame, FinalFrame):
                return self.push(below, BlockFrame((*frame.body, Raise(raised, span))))
            caught = [each for each in frame.handlers if each.catches(raised)] if isinstance(frame, ExceptFrame) else []
            if caught:
                handler = caught[0]
                if handler.variable is not None:
                    below = self.with_variable(below, handler.variable, raised)
                return self.push(below, BlockFrame(handler.body))
        return Reject(span)

    def with_variable(self, state: ProcessState, name: str, value: ModelValue) -> ProcessState:
        """A state in which a variable of the innermost call has a value."""
        number = self.call_of(state)
        frame = cast(CallFrame, state.frames[number])
        names = tuple(sorted({**dict(frame.names), name: self.values.hold(value)}.items(), key=lambda each: each[0]))
        return replace(
            state, frames=(*state.frames[:number], CallFrame(frame.call, names), *state.frames[number + 1 :])
        )

    def unknown(self, leaf: Leaf, state: ProcessState, span: Span, targets: tuple[str, ...]) -> Feature:
        """What stands for a number that is drawn and not known."""
        owner = 0 if self.agent is None or self.agent.index is None else self.agent.index
        found = self.values.unknown(leaf, owner, f"{leaf.span.start if leaf.span else 0} {span.start}")
        for frame in state.frames:
            for name, held in frame.names if isinstance(frame, CallFrame) else ():
                used = (node for node in postorder(self.values.nodes(held.value)) if isinstance(node, Feature))
                if name not in targets and any(each.property == found.property for each in used):
                    raise fail("unsupported-construct", "this random number is drawn again while it is used", span,
                               "drawn here")  # fmt: skip
        return found

    def simple(self, state: ProcessState, node: ast.Statement, rest: ProcessState) -> Following:
        """Run a statement that only computes."""
        number = self.call_of(state)
        names = self.scope(state, number)
        _, guards = self.excluding(lambda: self.run.run((node,), names))
        if names.shared:
            raise self.refusal(node.span)
        after = self.with_names(rest, number, names, node.span)
        return ask_guards(guards, after, self.lacking(rest))

    def with_names(self, state: ProcessState, number: int, names: Environment, span: Span) -> Following:
        """A state with the variables of a call as they are now; random numbers among them are drawn."""
        changed = {name: value for name, value in names.names.items() if name != "self"}
        for name, value in changed.items():
            if isinstance(value, Function) and value.environment is names:
                # it sees the variables as they are when it is called
                changed[name] = replace(value, environment=HERE)

        def assigned(names: ModelValue) -> Following:
            call = cast(CallFrame, state.frames[number]).call
            frame = CallFrame(call, self.hold_names(cast("dict[str, ModelValue]", names)))
            return replace(state, frames=(*state.frames[:number], frame, *state.frames[number + 1 :]))

        return self.with_drawn(state, cast(ModelValue, changed), span, assigned, variables=True)

    def hold_names(self, names: Mapping[str, ModelValue]) -> tuple[tuple[str, VariableValue], ...]:
        """Variables in the order of their names."""
        return tuple((name, self.values.hold(names[name])) for name in sorted(names))

    def evaluate(self, state: ProcessState, node: ast.Expression) -> tuple[ModelValue, GraphGuards]:
        """The value of an expression in the innermost call, and what it excludes."""
        return self.excluding(lambda: self.run.evaluate(node, self.scope(state, self.call_of(state))))

    # --- what happens

    def advance(self, state: ProcessState) -> Following:
        """What a state does first."""
        self.run.budget.step(self.span)
        if state.seen >= 0:
            return self.ask_contract(state)
        if state.guards:
            first, *others = state.guards
            assert first.operand is not None
            then = replace(state, guards=tuple(others), of=state.of if others else -1)
            broken = self.raise_at(state, violation(first), first.span)
            return self.ask(state, first.operand, then, broken, state.of)
        if state.resumed >= 0:
            return self.resume(state)
        if not state.frames:
            return End()
        frame = state.frames[-1]
        below = replace(state, frames=state.frames[:-1])
        match frame:
            case BlockFrame():
                if not frame.body:
                    return below
                rest = replace(state, frames=(*below.frames, BlockFrame(frame.body[1:])))
                return self.statement(state, frame.body[0], rest)
            case WhileFrame():
                again = self.push(state, BlockFrame(frame.node.body))
                return self.ask(state, frame.node.test, again, self.push(below, BlockFrame(frame.node.orelse)))
            case ForFrame():
                if frame.done == len(frame.items.held):
                    return self.push(below, BlockFrame(frame.node.orelse))
                rest = self.push(below, replace(frame, done=frame.done + 1), BlockFrame(frame.node.body))
                number = self.call_of(state)
                names = self.scope(state, number)
                assign(self.run, frame.node.target, frame.items.held[frame.done].value, names)
                return self.with_names(rest, number, names, frame.node.span)
            case CallFrame():
                return below
            case LibraryFrame():
                return self.library(state, frame, below)
            case ExceptFrame():
                return self.push(below, BlockFrame(frame.orelse))
            case FinalFrame():
                return self.push(below, BlockFrame(frame.body))
            case TogetherFrame():
                raise fail("unsupported-construct", f"a {self.word} runs no scenarios", self.span, "this one does")
            case TryFrame():
                # the block that runs is over
                if frame.running == len(frame.handlers):
                    return below
                again = replace(frame, running=-1)
                return replace(state, frames=(*below.frames, again), resumed=len(below.frames), asked=0)

    def push(self, state: ProcessState, *frames: ProcessFrame) -> ProcessState:
        """A state with more frames."""
        return replace(state, frames=(*state.frames, *frames))

    def resume(self, state: ProcessState) -> Following:
        """Go on after a sample: ask what interrupts, from the outside to the inside, and then go on inside."""
        at = state.resumed
        while at < len(state.frames) and not isinstance(state.frames[at], TryFrame):
            at += 1
        if at == len(state.frames):
            return self.ask_invariants(replace(state, resumed=-1, asked=-1))
        if state.asked < 0:
            return self.ask_invariants(replace(state, resumed=at, asked=0), self.call_of(state, at))
        frame = cast(TryFrame, state.frames[at])
        number = state.asked
        if number == len(frame.handlers):
            return self.switch_block(state, at, number)
        running = frame.running == number or any(block == number for block, _ in frame.waiting)
        if running:
            return self.switch_block(state, at, number)
        wanted = frame.conditions[number]
        interrupted = replace(state, asked=-1)
        chosen = self.switch_block(interrupted, at, number)
        following = replace(state, resumed=at, asked=number + 1)
        if wanted is None:
            return OnTimer(frame.timer, chosen, following)
        asked = self.ask(state, wanted, chosen, following, self.call_of(state, at))
        return replace(asked, loose=True) if isinstance(asked, GuardedTest) else asked

    def ask_invariants(self, state: ProcessState, number: int | None = None) -> ProcessState:
        """A state in which the invariants of a call are asked first."""
        calls = [each for each, frame in enumerate(state.frames) if isinstance(frame, CallFrame)]
        if not calls:
            return state
        number = calls[-1] if number is None else number
        invariants = cast(CallFrame, state.frames[number]).call.of.guards("invariant")
        return replace(state, guards=invariants, of=number) if invariants else state

    def switch_block(self, state: ProcessState, at: int, block: int) -> Following:
        """A state in which a block of a `try` runs."""
        frame = cast(TryFrame, state.frames[at])
        inner = state.frames[at + 1 :]
        if block == frame.running:
            return replace(state, resumed=at + 1, asked=-1)
        if frame.ends and block < len(frame.handlers):
            return replace(state, frames=state.frames[:at], resumed=-1, asked=-1)
        waiting = dict(frame.waiting)
        if frame.running >= 0:
            waiting[frame.running] = inner
        mine = waiting.pop(block, None)
        switched = replace(frame, running=block, waiting=tuple(sorted(waiting.items(), key=lambda each: each[0])))
        if mine is not None:
            return replace(state, frames=(*state.frames[:at], switched, *mine), resumed=at + 1, asked=-1)
        body = frame.body if block == len(frame.handlers) else frame.handlers[block]
        return replace(state, frames=(*state.frames[:at], switched, BlockFrame(body)), resumed=-1, asked=-1)

    def activities(self, frames: tuple[ProcessFrame, ...], what: Span) -> tuple[Activity, ...]:
        """What goes on from one sample to the next, given the frames in which something is done."""
        return (Activity(what, tuple(frame.call.span for frame in frames if isinstance(frame, CallFrame))),)

    def waits(self, rest: ProcessState, activity: Span, contracts: Sequence[Contract] = ()) -> Following:
        """Go on with a state at the next sample, by when some contracts must be kept."""
        frames = self.age_frames(rest.frames, "", first=rest.first)
        found: list[tuple[VariableValue, int]] = []
        used = timers_of(rest)
        started: list[tuple[int, float]] = []
        for contract in contracts if self.reaction_s is not None else ():
            if contract.shows is None:
                continue
            held = self.values.hold_contract(contract)
            timer = dict(rest.modes).get(held)
            if timer is None:
                timer = free_timer(used)
                used.add(timer)
                started.append((timer, cast(float, self.reaction_s) + contract.settles_s))
            found.append((held, timer))
        modes = tuple(found)
        after: Following = Waits(
            replace(rest, frames=frames, resumed=0, asked=-1, first=False, modes=modes, seen=0 if modes else -1),
            self.activities(rest.frames, activity),
        )
        for timer, after_s in started:
            after = TimerStarts(timer, after_s, after)
        return after

    def ask_contract(self, state: ProcessState) -> Following:
        """Ask whether a contract is kept: it is not if for some time no sample has shown what it asks for."""
        if state.seen == len(state.modes):
            return replace(state, seen=-1)
        held, timer = state.modes[state.seen]
        contract = cast(Contract, held.value)
        following = replace(state, seen=state.seen + 1)
        kept = TimerStarts(timer, contract.settles_s, following, extends=True)
        broken = OnTimer(timer, Reject(self.span), following)
        assert contract.shows is not None
        return self.test(state, contract.shows, (), kept, broken, self.span)

    def age_frames(self, frames: tuple[ProcessFrame, ...], place: str, *, first: bool) -> tuple[ProcessFrame, ...]:
        """Frames at the next sample."""
        found: list[ProcessFrame] = []
        for number, frame in enumerate(frames):
            here = f"{place}{number}"

            def old(held: VariableValue, name: str, here: str = here) -> VariableValue:
                return self.values.age_value(held, f"{here} {name}", first=first)

            match frame:
                case CallFrame():
                    names = tuple((name, old(held, name)) for name, held in frame.names)
                    found.append(replace(frame, names=names))
                case ForFrame() if not frame.items.stays:
                    items = tuple([old(held, f"item {count}") for count, held in enumerate(frame.items.held)])
                    found.append(replace(frame, items=self.items(items)))
                case LibraryFrame():
                    found.append(replace(frame, call=old(frame.call, "call")))
                case BlockFrame():
                    found.append(BlockFrame(tuple(self.old_statement(each, old) for each in frame.body)))
                case TryFrame():
                    waiting = tuple(
                        (block, self.age_frames(inner, f"{here}.{block}.", first=first))
                        for block, inner in frame.waiting
                    )
                    body = tuple(self.old_statement(each, old) for each in frame.body)
                    found.append(replace(frame, waiting=waiting, body=body))
                case _:
                    found.append(frame)
        return tuple(found)

    def old_statement(self, node: GraphStatement, old: Callable[[VariableValue, str], VariableValue]) -> GraphStatement:
        """A statement at the next sample."""
        match node:
            case BeginBehavior():
                return replace(node, what=old(node.what, "begun"))
            case PickBehavior():
                return replace(node, options=tuple(old(each, f"option {k}") for k, each in enumerate(node.options)))
            case _:
                return node

    def library(self, state: ProcessState, frame: LibraryFrame, below: ProcessState) -> Following:
        """What a behavior of the libraries does: it goes through its phases, each over by a condition."""
        contracts, guards = self.contracts_of(frame.call)
        if frame.phase == len(contracts):
            return below
        contract, activity = contracts[frame.phase], cast(LibraryCall, frame.call.value).span
        following = self.push(below, LibraryFrame(frame.call, frame.phase + 1))
        lasting = self.push(below, replace(frame, lasted=min(frame.lasted + 1, contract.least_steps)))
        found = self.waits(lasting, activity, (contract,))
        if contract.over is not None and frame.lasted >= contract.least_steps:
            found = self.test(state, contract.over, (), following, found, self.span)
        asked = guards if not frame.phase and not frame.lasted else ()
        found = ask_guards(asked, found, self.lacking(below))
        return replace(found, loose=True) if isinstance(found, GuardedTest) else found

    def contracts_of(self, held: VariableValue) -> tuple[tuple[Contract, ...], GraphGuards]:
        """The contracts of the phases of a behavior of the libraries."""
        if held.key not in self._contracts:
            call = cast(LibraryCall, held.value)
            assert self.agent is not None
            agent = self.agent
            found, guards = self.excluding(
                lambda: behavior_contract(self.run, call.of.name, agent, call.positional, call.named, call.span)
            )
            if found is None:
                raise fail("unsupported-construct", f"the behavior `{call.of.name}` is not known", call.span,
                           "is not followed over time")  # fmt: skip
            self._contracts[held.key] = found, guards
            if all(each.shows is None for each in found):
                self.actions.setdefault(call.of.name, call.span)
        return self._contracts[held.key]

    # --- statements

    def statement(self, state: ProcessState, node: GraphStatement, rest: ProcessState) -> Following:
        """What a statement does, after which a state follows."""
        match node:
            case AskInvariants():
                return self.ask_invariants(rest)
            case BeginBehavior():
                return self.begin(state, node.what.value, rest, node.span)
            case PickBehavior():
                return self.pick(state, node, rest)
            case Idle():
                return self.waits(state, node.span)
            case ast.Pass() | ast.ExpressionStatement(value=ast.LiteralValue()):
                return rest
            case ast.DynamicStatement(kind="precondition" | "invariant"):
                return rest
            case ast.DynamicStatement(kind="wait"):
                return self.waits(rest, node.span)
            case ast.Take() if self.agent is not None:
                return self.take(state, node, rest)
            case ast.DynamicStatement(kind="wait for" | "wait until"):
                until = node.operand if node.kind == "wait until" else None
                duration = node.operand if node.kind == "wait for" else None
                return self.run_limited(state, rest, (Idle(node.span),), until, duration, node.unit)
            case ast.Do() if self.agent is not None:
                return self.do(state, node, rest)
            case ast.DynamicStatement(kind="terminate", operand=None) if self.scenario >= 0 and self.agent is not None:
                # it ends the scenario of the object, and goes on
                return Directs(Stop(self.scenario, 0), self.waits(rest, node.span))
            case ast.DynamicStatement(kind="terminate" | "terminate simulation", operand=None):
                return Terminate(node.span)
            case ast.DynamicStatement(kind="abort"):
                return self.leave(state, node, self.innermost(state, node.span, TryFrame))
            case ast.Global() if self.only_reads(state, node):
                return rest
            case ast.Global() | ast.Nonlocal():
                raise self.refusal(node.span)
            case ast.Try() | ast.TryInterrupt():
                return self.attempt(state, node, rest)
            case Raise():
                return self.raise_at(rest, node.raised, node.span)
            case ast.Require(probability=None):
                broken = self.raise_at(rest, "RejectSimulationException", node.span)
                return self.ask(state, node.condition, rest, broken)
            case ast.Assert():
                return self.ask(state, node.test, rest, self.raise_at(rest, "AssertionError", node.span))
            case ast.If():
                return self.branch(state, node, 0, rest)
            case ast.While():
                return self.push(rest, WhileFrame(node))
            case ast.For():
                value, guards = self.evaluate(state, node.iterable)
                items = tuple([self.values.hold(each) for each in items_of(self.run, value, node.iterable.span)])
                found = self.push(rest, ForFrame(node, self.items(items)))
                return ask_guards(guards, found, self.lacking(rest))
            case ast.Break():
                return self.leave(state, node, self.innermost(state, node.span, WhileFrame, ForFrame))
            case ast.Continue():
                return self.leave(state, node, self.innermost(state, node.span, WhileFrame, ForFrame) + 1)
            case ast.Return():
                return self.leave(state, node, self.call_of(state))
            case (
                ast.Assign() | ast.AugmentedAssign() | ast.AnnotatedAssign() | ast.ExpressionStatement()
                | ast.FunctionDef()
            ):  # fmt: skip
                return self.simple(state, node, rest)
            case _:
                raise self.refusal(node.span)

    def only_reads(self, state: ProcessState, node: ast.Global) -> bool:
        """Whether none of the names that a `global` takes from the program gets a value in the innermost call."""
        body = cast("tuple[ast.Statement, ...]", cast(CallFrame, state.frames[self.call_of(state)]).call.of.body)
        return bound_names(body).isdisjoint(each.id for each in node.names)

    def refusal(self, span: Span) -> Exception:
        """What is wrong with a statement that is not read."""
        word = span.text.split()[0].rstrip(":")
        if span.text.startswith("try"):
            word = "finally"
        return fail("unsupported-construct", f"`{word}` in a {self.word} is not supported", span,
                    "is not followed over time")  # fmt: skip

    def items(self, held: tuple[VariableValue, ...]) -> LoopItems:
        """What a loop goes through."""
        if held not in self._items:
            self._items[held] = LoopItems(held, not any(self.values.reads_samples(each.value) for each in held))
        return self._items[held]

    def branch(self, state: ProcessState, node: ast.If, number: int, rest: ProcessState) -> Following:
        """One branch after the other."""
        if number == len(node.branches):
            return self.push(rest, BlockFrame(node.orelse))
        branch = node.branches[number]
        others = ast.If(node.span, node.branches[number + 1 :], node.orelse)
        other = self.push(rest, BlockFrame((others,))) if others.branches else self.push(rest, BlockFrame(node.orelse))
        return self.ask(state, branch.test, self.push(rest, BlockFrame(branch.body)), other)

    def attempt(self, state: ProcessState, node: ast.Try | ast.TryInterrupt, rest: ProcessState) -> Following:
        """Begin a `try`."""
        if node.final:
            rest = self.push(rest, FinalFrame(node.final))
        if node.handlers:
            handlers = read_handlers(node.handlers, self.scope(state, self.call_of(state)))
            rest = self.push(rest, ExceptFrame(handlers, node.orelse))
        if isinstance(node, ast.Try):
            return self.push(rest, BlockFrame(node.body))
        interrupts = tuple(reversed(node.interrupts))
        frame = TryFrame(
            tuple(each.condition for each in interrupts), tuple(each.body for each in interrupts), node.body
        )
        return replace(self.push(rest, frame), resumed=len(rest.frames), asked=0)

    def innermost(self, state: ProcessState, span: Span, *kinds: type) -> int:
        """The number of the innermost frame of a kind in the call."""
        for number in reversed(range(len(state.frames))):
            frame = state.frames[number]
            if isinstance(frame, kinds) and not (isinstance(frame, TryFrame) and frame.ends):
                return number
            if isinstance(frame, CallFrame):
                break
        raise fail("parse-error", f"`{span.text.split()[0]}` has nothing to leave here", span, "leaves nothing")

    def leave(self, state: ProcessState, node: ast.Statement, number: int) -> ProcessState:
        """A state without the frames from a number on; before that a `finally` among them is done, and leaves, too."""
        for at in reversed(range(number, len(state.frames))):
            frame = state.frames[at]
            if isinstance(frame, FinalFrame):
                return replace(state, frames=(*state.frames[:at], BlockFrame((*frame.body, node))))
        return replace(state, frames=state.frames[:number])

    def take(self, state: ProcessState, node: ast.Take, rest: ProcessState) -> Following:
        """Take actions."""
        values: list[ModelValue] = []
        excluded: list[tuple[Node, Span]] = []
        for expression in node.actions:
            value, guards = self.evaluate(state, expression)
            excluded += guards
            several = isinstance(value, list | tuple) and len(node.actions) == 1
            values += list(cast("list[ModelValue]", value)) if several else [value]

        def taken(actions: ModelValue) -> Following:
            contracts: list[Contract] = []
            asked = list(excluded)
            for action in cast("list[ModelValue]", actions):
                contract, guards = self.action(action, node.span)
                asked += guards
                contracts += [contract] if contract is not None else []
            found = self.waits(rest, node.span, contracts)
            return ask_guards(tuple(asked), found, self.lacking(rest))

        return self.with_drawn(state, values, node.span, taken)

    def with_drawn(
        self, state: ProcessState, value: ModelValue, span: Span, following: Callable[[ModelValue], Following],
        *, variables: bool = False,
    ) -> Following:  # fmt: skip
        """Go on with a value whose random numbers are drawn: by each way of a choice, with an unknown for a number.

        Args:
            state: Where the process stands.
            value: It.
            span: The statement that draws.
            following: How it goes on.
            variables: Whether it has those that are assigned, which no longer use what stood for an earlier draw.
        """
        for leaf in self.values.drawn_variables(value):
            if isinstance(leaf, Index):
                settled = self.values.outcomes_of(value, leaf)
                return any_of([self.with_drawn(state, each, span, following, variables=variables) for each in settled])
            names = cast("dict[str, ModelValue]", value) if variables else {}
            targets = tuple(name for name, each in names.items() if leaf in self.values.drawn_variables(each))
            value = self.values.without(value, leaf, self.unknown(leaf, state, span, targets))
        return following(value)

    def action(self, value: ModelValue, span: Span) -> tuple[Contract | None, GraphGuards]:
        """The contract of an action, if it has one."""
        match value:
            case LibraryCall() if value.of.is_action:
                assert self.agent is not None
                agent = self.agent
                # who takes it again and again is given what each sample has
                contract, guards = self.excluding(
                    lambda: action_contract(self.run, value.of.name, agent, value.positional, value.named, value.span)
                )
                if contract is None or contract.shows is None:
                    self.actions.setdefault(value.of.name, value.span)
                return contract, guards
            case Choice():
                for option in value.options:
                    self.action(option, span)
                return None, ()
            case _:
                raise fail("wrong-type", "this is no action", span, f"this is {describe(value)}")

    def do(self, state: ProcessState, node: ast.Do, rest: ProcessState) -> Following:
        """Do a behavior."""
        if not node.schedule and len(node.behaviors) > 1:
            raise fail("parse-error", "a behavior does one thing at a time", node.span, "several are done here")
        values: list[ModelValue] = []
        excluded: list[tuple[Node, Span]] = []
        for expression in node.behaviors:
            value, guards = self.evaluate(state, expression)
            excluded += guards
            if node.schedule and isinstance(value, dict) and len(node.behaviors) == 1:
                weights = cast("dict[ModelValue, ModelValue]", value)
                values += [behavior for behavior, weight in weights.items() if weight != 0]
            else:
                values.append(value)

        def done(behaviors: ModelValue) -> Following:
            held = tuple(self.values.hold(self.as_done(each, node.span)) for each in behaviors)
            inner: GraphStatement = BeginBehavior(held[0], node.span) if not node.schedule else PickBehavior(
                held, node.schedule == "shuffle", node.span
            )  # fmt: skip
            return self.run_limited(state, rest, (inner,), node.until, node.duration, node.unit)

        after = self.with_drawn(state, values, node.span, done)
        return ask_guards(tuple(excluded), after, self.lacking(rest))

    def as_done(self, value: ModelValue, span: Span) -> ModelValue:
        """What is done, as a call."""
        return as_behavior(value, span)

    def run_limited(
        self, state: ProcessState, rest: ProcessState, body: tuple[GraphStatement, ...], until: ast.Expression | None,
        duration: ast.Expression | None, unit: str,
    ) -> Following:  # fmt: skip
        """Do something until a condition holds or a time is over, or to its end."""
        checked = self.push(rest, BlockFrame((AskInvariants(),)))
        if until is None and duration is None:
            return self.push(checked, BlockFrame(body))
        if until is not None:
            frame = TryFrame((until,), ((),), body, ends=True)
            return replace(self.push(checked, frame), resumed=len(checked.frames), asked=0)
        assert duration is not None
        after_s = self.seconds(self.run, duration, unit, self.scope(state, self.call_of(state)))
        if after_s <= 0:
            return checked
        timer = free_timer(timers_of(checked))
        frame = TryFrame((None,), ((),), body, timer, ends=True)
        # no time is over at the sample at which it starts
        found = self.switch_block(self.push(checked, frame), len(checked.frames), len(frame.handlers))
        return TimerStarts(timer, after_s, found)

    def begin(self, state: ProcessState, value: ModelValue, rest: ProcessState, span: Span) -> Following:
        """Begin a behavior."""
        match value:
            case CoroutineCall() if not isinstance(value.of, MonitorDefinition | ScenarioDefinition):
                if sum(isinstance(frame, CallFrame) for frame in state.frames) > LIMITS.call_nesting:
                    raise fail("budget-exceeded", f"calls are nested deeper than {LIMITS.call_nesting}", span,
                               "this call", ("replace the recursion by a loop",))  # fmt: skip
                found = self.push_call(rest, value)
                guards = value.of.guards("precondition") + value.of.guards("invariant")
                return replace(found, guards=guards, of=len(rest.frames)) if guards else found
            case LibraryCall() if not value.of.is_action:
                return self.push(rest, LibraryFrame(self.values.hold(value)))
            case Choice():
                return self.follow_choice(
                    value, lambda option: self.push(rest, BlockFrame((BeginBehavior(option, span),))), span
                )
            case _:
                raise fail("wrong-type", "this is no behavior", span, f"this is {describe(value)}")

    def push_call(self, state: ProcessState, call: CoroutineCall) -> ProcessState:
        """A state in which a call has begun."""
        body = cast("tuple[ast.Statement, ...]", call.of.body)
        return self.push(state, CallFrame(call, self.hold_names(call.given)), BlockFrame(body))

    def follow_choice(
        self, choice: Choice, following: Callable[[VariableValue], ProcessState], span: Span
    ) -> Following:
        """Go on with the option that a random choice comes out as: any that is drawn now, or that of the scene."""
        states = [following(self.values.hold(as_behavior(each, span))) for each in choice.options]
        if self.values.drawn_variables(choice.index):
            return Ways(tuple(states))
        found: Following = states[-1]
        for number in reversed(range(len(states) - 1)):
            node = build.compare(CompareOp.EQ, choice.index, build.constant(float(number)), span)
            found = GuardedTest(node, (), states[number], found)
        return found

    def pick(self, state: ProcessState, node: PickBehavior, rest: ProcessState) -> Following:
        """Begin one of some behaviors that may begin."""
        if not node.options:
            return rest
        if len(node.enabled) < len(node.options):
            value = node.options[len(node.enabled)].value
            yes, no = (
                self.push(rest, BlockFrame((replace(node, enabled=(*node.enabled, each)),))) for each in (True, False)
            )
            if not isinstance(value, CoroutineCall) or not value.of.guards("precondition", "invariant"):
                return yes
            return self.ask_enabled(state, value, yes, no)
        enabled = [number for number, each in enumerate(node.enabled) if each]
        if not enabled:
            return self.raise_at(rest, "RejectSimulationException", node.span)
        ways: list[ProcessState] = []
        for number in enabled:
            others = (*node.options[:number], *node.options[number + 1 :])
            later = (PickBehavior(others, node.shuffle, node.span),) if node.shuffle else ()
            ways.append(self.push(rest, BlockFrame((BeginBehavior(node.options[number], node.span), *later))))
        return ways[0] if len(ways) == 1 else Ways(tuple(ways))

    def ask_enabled(self, state: ProcessState, call: CoroutineCall, yes: ProcessState, no: ProcessState) -> Following:
        """Go on by whether a behavior may begin."""
        found: Following = yes
        within = self.push_call(state, call)
        for guard in reversed(call.of.guards("precondition") + call.of.guards("invariant")):
            assert guard.operand is not None
            found = self.ask(replace(within, guards=(guard,)), guard.operand, found, no)
        return found


def process_of(
    run: Interpreter, call: ModelValue, number: int, agent: Instance | None, atom: Callable[[Node], Atom],
    seconds: Seconds, actions: dict[str, Span], span: Span, reaction_s: float | None = None,
    *, values: LocalValues | None = None, scenario: int = -1,
) -> tuple[Process, tuple[tuple[GraphGuards, Node, Span], ...]]:  # fmt: skip
    """A monitor or behavior as a graph, and what its first call asks for before anything happens.

    Args:
        run: The interpreter, after the program.
        call: The call of a monitor or behavior, or a random choice between some.
        number: The number of the process.
        agent: Whose behavior it is; None for a monitor.
        atom: Gives a condition its number.
        seconds: The time that an expression with a unit is.
        actions: Takes the names of actions that constrain nothing, each with its first place.
        span: Where the program requires it, or gives it to the object.
        reaction_s: Seconds after which what it does must be shown; None where nothing must.
        values: Tells which random variables it draws; all that are made from now on if not given.
        scenario: See `ProcessGraph`.

    Raises:
        ScenarioError: unsupported-construct, for a statement that is not followed; runtime-error for a loop that never
            waits; budget-exceeded; whatever is wrong with an expression.
    """
    values = values or LocalValues(number, Identity().order, run.lookups.ranks)
    graph = ProcessGraph(
        run, atom, agent, values, seconds, {}, span, actions, reaction_s, scenario, resumable=run.overrides
    )
    asked: list[tuple[GraphGuards, Node, Span]] = []
    start = ProcessState(())
    if isinstance(call, CoroutineCall):
        start = graph.push_call(start, call)
        with read_over_time():
            for guard in call.of.guards("precondition") + call.of.guards("invariant"):
                found = graph.ask(start, cast(ast.Expression, guard.operand), End(), Reject(guard.span))
                match found:
                    case GuardedTest():
                        asked.append((found.guards, found.node, guard.span))
                    case Reject():
                        asked.append(((), build.constant(False), guard.span))
                    case _:
                        pass
    else:
        start = graph.push(start, BlockFrame((BeginBehavior(values.hold(call), span),)))
    graph.follow(start)
    if has_circle(graph.steps, graph.loose):
        raise graph.spins()
    owner = None if agent is None else agent.index
    return Process(span, tuple(graph.steps), owner, afresh=graph.afresh), tuple(asked)


def has_circle(steps: Sequence[ProcessStep], loose: set[int]) -> bool:
    """Whether some steps lead to each other without a `Wait`, but for some that may."""
    waiting = [0] * len(steps)
    after = [() if number in loose else successors(step) for number, step in enumerate(steps)]
    for targets in after:
        for target in targets:
            waiting[target] += 1
    # taking away what nothing leads to, again and again, leaves the circles
    free = [number for number, count in enumerate(waiting) if not count]
    left = len(steps)
    while free:
        left -= 1
        for target in after[free.pop()]:
            waiting[target] -= 1
            if not waiting[target]:
                free.append(target)
    return left > 0


@dataclass(frozen=True, slots=True, eq=False)
class _Same:
    """A value, which is like no other one."""

    value: ModelValue

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


def _containers(module: Environment) -> dict[str, tuple[ModelValue, Hashable]]:
    """The lists, dictionaries and sets that have a name in a file, with what they contain."""
    return {
        name: (value, _contents(value)) for name, value in module.names.items() if isinstance(value, list | dict | set)
    }


def _contents(value: ModelValue) -> Hashable:
    """What tells whether a value has been changed: two are alike that contain the same values."""
    match value:
        case list():
            return tuple([_contents(each) for each in cast("list[ModelValue]", value)])
        case dict():
            items = cast("dict[ModelValue, ModelValue]", value).items()
            return tuple([(key, _contents(each)) for key, each in items])
        case set():
            return frozenset(map(id, cast("set[ModelValue]", value)))
        case _:
            return _Same(value)
