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
from typing import TYPE_CHECKING, TypeAlias, TypeVar, cast

from scenicq.compiler.assignment import assign
from scenicq.compiler.coerce import read_over_time, to_boolean
from scenicq.compiler.contracts import Contract, action_contract, behavior_contract
from scenicq.compiler.coroutines import CoroutineCall, LibraryCall, MonitorDefinition, as_behavior
from scenicq.compiler.courses import split, without_courses
from scenicq.compiler.environment import Environment
from scenicq.compiler.exclusions import with_exclusions
from scenicq.compiler.items import items_of
from scenicq.compiler.local_values import Held, LocalValues
from scenicq.compiler.logic import condition
from scenicq.compiler.scoping import own_names
from scenicq.compiler.values import Choice, Delayed, Function, Instance, ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import CompareOp, Constant, Feature, Identity, Index, Leaf, Node
from scenicq.forest.temporal import (
    Arm,
    Atom,
    Choose,
    Due,
    End,
    Goto,
    Process,
    ProcessStep,
    Reject,
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

__all__ = ["Seconds", "process_of"]

_Result = TypeVar("_Result")


# --- states


@dataclass(frozen=True, slots=True)
class _Check:
    """Asks the invariants of the innermost call."""


@dataclass(frozen=True, slots=True)
class _Begin:
    """Begins a behavior."""

    what: Held
    span: Span


@dataclass(frozen=True, slots=True)
class _Pick:
    """Begins one of some behaviors that may begin; of a shuffle the others after it.

    Attributes:
        options: The behaviors.
        shuffle: Whether the others follow.
        enabled: Which of the first ones may begin, as far as that has been asked.
        span: The statement.
    """

    options: tuple[Held, ...]
    shuffle: bool
    span: Span
    enabled: tuple[bool, ...] = ()


@dataclass(frozen=True, slots=True)
class _Idle:
    """Does nothing for ever."""


_Statement: TypeAlias = ast.Statement | _Check | _Begin | _Pick | _Idle


@dataclass(frozen=True, slots=True)
class _Block:
    """Statements that are left."""

    body: tuple[_Statement, ...]


@dataclass(frozen=True, slots=True)
class _While:
    """A loop whose condition is asked next."""

    node: ast.While


@dataclass(frozen=True, slots=True, eq=False)
class _Items:
    """What a loop goes through; there is one of each, so that it need not be compared.

    Attributes:
        held: It.
        stays: Whether nothing of it is read at each sample.
    """

    held: tuple[Held, ...]
    stays: bool


@dataclass(frozen=True, slots=True)
class _For:
    """A loop, with how many items it has been through."""

    node: ast.For
    items: _Items
    done: int = 0


@dataclass(frozen=True, slots=True)
class _Call:
    """A behavior or monitor that runs, with its variables."""

    call: CoroutineCall
    names: tuple[tuple[str, Held], ...]


@dataclass(frozen=True, slots=True)
class _Library:
    """A behavior of the libraries that runs.

    Attributes:
        call: Its call.
        phase: The number of its phase.
        lasted: For how many samples, as far as that matters.
    """

    call: Held
    phase: int = 0
    lasted: int = 0


@dataclass(frozen=True, slots=True)
class _Try:
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
    handlers: tuple[tuple[_Statement, ...], ...]
    body: tuple[_Statement, ...]
    timer: int = -1
    running: int = -1
    waiting: tuple[tuple[int, tuple[_Frame, ...]], ...] = ()
    ends: bool = False


_Frame: TypeAlias = "_Block | _While | _For | _Call | _Library | _Try"


@dataclass(frozen=True, slots=True)
class _State:
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
    """

    frames: tuple[_Frame, ...]
    resumed: int = -1
    asked: int = -1
    guards: tuple[ast.DynamicStatement, ...] = ()
    of: int = -1
    first: bool = True
    modes: tuple[tuple[Held, int], ...] = ()
    seen: int = -1


@dataclass(frozen=True, slots=True)
class _Asked:
    """A test, after what it asks for so that it can be made: a run without that is rejected, at its place.

    Attributes:
        node: The condition.
        guards: What it asks for.
        then, otherwise: How it goes on.
        loose: Whether a circle through it is none of the program's loops.
    """

    node: Node
    guards: _Guards
    then: _Next
    otherwise: _Next
    loose: bool = False


_Guards: TypeAlias = tuple[tuple[Node, Span], ...]
_Next: TypeAlias = "_State | _Asked | _Ways | _Timed | _Started | _Waits | Terminate | Reject | End"


@dataclass(frozen=True, slots=True)
class _Ways:
    """Any of some ways to go on."""

    options: tuple[_Next, ...]


@dataclass(frozen=True, slots=True)
class _Timed:
    """Whether the time of a timer is over."""

    timer: int
    then: _Next
    otherwise: _Next


@dataclass(frozen=True, slots=True)
class _Started:
    """A timer starts."""

    timer: int
    after_s: float
    then: _Next
    extends: bool = False


@dataclass(frozen=True, slots=True)
class _Waits:
    """The sample is over, and something goes on."""

    then: _State
    activity: Span | None = None


Seconds = Callable[["Interpreter", ast.Expression, str, Environment], float]
"""The time that a statement names, in seconds."""


@dataclass(eq=False)
class _Graph:
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
    steps: list[ProcessStep] = field(default_factory=list[ProcessStep])
    loose: set[int] = field(default_factory=set[int])
    _asked: dict[Hashable, tuple[Node, _Guards]] = field(default_factory=dict["Hashable", "tuple[Node, _Guards]"])
    _contracts: dict[Hashable, tuple[tuple[Contract, ...], _Guards]] = field(
        default_factory=dict["Hashable", "tuple[tuple[Contract, ...], _Guards]"]
    )
    _items: dict[tuple[Held, ...], _Items] = field(default_factory=dict["tuple[Held, ...]", "_Items"])
    _numbers: dict[_State, int] = field(default_factory=dict["_State", int])
    _todo: list[tuple[int, _State]] = field(default_factory=list["tuple[int, _State]"])

    @property
    def word(self) -> str:
        """What it is."""
        return "monitor" if self.agent is None else "behavior"

    # --- the graph

    def follow(self, start: _State) -> None:
        """Follow it from its start."""
        self.number(start)
        with read_over_time(), without_courses(self.run):
            while self._todo:
                number, state = self._todo.pop()
                found = self.next_of(state)
                self.steps[number] = self.made(found)
                if isinstance(found, _Asked) and found.loose:
                    self.loose.add(number)

    def add(self, step: ProcessStep) -> int:
        """Add a step; its number."""
        if len(self.steps) > LIMITS.process_steps:
            raise fail("budget-exceeded", f"the {self.word} takes more than {LIMITS.process_steps:,} steps", self.span,
                       "the budget ends here", ("make loops shorter",))  # fmt: skip
        self.steps.append(step)
        return len(self.steps) - 1

    def number(self, state: _State) -> int:
        """The number of the step that a state is."""
        if state not in self._numbers:
            self._numbers[state] = self.add(End())
            self._todo.append((self._numbers[state], state))
        return self._numbers[state]

    def next_of(self, state: _State) -> _Next:
        """What happens next that is more than going on."""
        for _ in range(LIMITS.process_steps):
            found = self.advance(state)
            if not isinstance(found, _State):
                return found
            state = found
        raise self.spins()

    def spins(self) -> Exception:
        """What is wrong where it never waits."""
        return fail("runtime-error", f"the {self.word} has a loop that never waits", self.span,
                    "never gets to the next sample", ("write `wait` in the loop",))  # fmt: skip

    def placed(self, found: _Next) -> int:
        """The number of the step for what happens next."""
        return self.number(found) if isinstance(found, _State) else self.add(self.made(found))

    def made(self, found: _Next) -> ProcessStep:
        """The step for what happens next."""
        match found:
            case _Asked():
                if isinstance(found.node, Constant):
                    step: ProcessStep = Goto(self.placed(found.then if found.node.value else found.otherwise))
                else:
                    step = Test(self.atom(found.node), self.placed(found.then), self.placed(found.otherwise))
                for guard, span in found.guards:
                    step = Test(self.atom(guard), self.add(step), self.add(Reject(span)))
                return step
            case _Ways():
                return Choose(tuple(dict.fromkeys(map(self.placed, found.options))))
            case _Timed():
                return Due(found.timer, self.placed(found.then), self.placed(found.otherwise))
            case _Started():
                return Arm(found.timer, found.after_s, self.placed(found.then), found.extends)
            case _Waits():
                timers = _timers_of(found.then)
                return Wait(self.number(found.then), tuple(sorted(timers)), found.activity)
            case _State():
                return Goto(self.number(found))
            case _:
                return found

    # --- evaluating

    def call_of(self, state: _State, before: int | None = None) -> int:
        """The number of the innermost call, or of the innermost below a frame."""
        end = len(state.frames) if before is None else before
        return next(number for number in reversed(range(end)) if isinstance(state.frames[number], _Call))

    def scope(self, state: _State, number: int) -> Environment:
        """The names that a call sees."""
        frame = cast(_Call, state.frames[number])
        of = frame.call.of
        names = {name: self.values.copied(held.value) for name, held in frame.names}
        if self.agent is not None:
            names.setdefault("self", self.agent)
        around = Environment(self.names, cast(Environment, of.environment))
        return Environment(names, around, own=own_names(cast("tuple[ast.Statement, ...]", of.body)))

    def ask(
        self, state: _State, wanted: ast.Expression, then: _Next, otherwise: _Next, number: int | None = None
    ) -> _Next:
        """Go on in one of two ways by a condition, which is read in the innermost call or another one."""
        run = self.run
        number = self.call_of(state) if number is None else number
        names = self.scope(state, number)

        def evaluated() -> Node:
            value = condition(run, wanted, names)
            if isinstance(value, Delayed):
                raise fail("wrong-type", "this needs the position of an object", wanted.span, "no object here",
                           ("write `F at V`",))  # fmt: skip
            return to_boolean(value, wanted.span)

        key = wanted, state.frames[number]
        if key not in self._asked:
            self._asked[key] = self.excluding(lambda: split(run, evaluated, wanted.span))
        node, guards = self._asked[key]
        return self.test(state, node, guards, then, otherwise, wanted.span)

    def excluding(self, work: Callable[[], _Result]) -> tuple[_Result, _Guards]:
        """What is worked out, with what it excludes."""
        found, excluded = with_exclusions(self.run, work)
        return found, tuple(excluded)

    def test(self, state: _State, node: Node, guards: _Guards, then: _Next, otherwise: _Next, span: Span) -> _Next:
        """Go on in one of two ways by a condition, whose random numbers are drawn."""

        def tested(settled: ModelValue) -> _Next:
            if isinstance(settled, Constant) and not guards:
                return then if settled.value else otherwise
            return _Asked(cast(Node, settled), guards, then, otherwise)

        return self.with_drawn(state, node, span, tested)

    def unknown(self, leaf: Leaf, state: _State, span: Span, targets: tuple[str, ...]) -> Feature:
        """What stands for a number that is drawn and not known."""
        owner = 0 if self.agent is None or self.agent.index is None else self.agent.index
        found = self.values.unknown(leaf, owner, f"{leaf.span.start if leaf.span else 0} {span.start}")
        for frame in state.frames:
            for name, held in frame.names if isinstance(frame, _Call) else ():
                used = (node for node in postorder(self.values.nodes(held.value)) if isinstance(node, Feature))
                if name not in targets and any(each.property == found.property for each in used):
                    raise fail("unsupported-construct", "this random number is drawn again while it is used", span,
                               "drawn here")  # fmt: skip
        return found

    def simple(self, state: _State, node: ast.Statement, rest: _State) -> _Next:
        """Run a statement that only computes."""
        number = self.call_of(state)
        names = self.scope(state, number)
        _, guards = self.excluding(lambda: self.run.run((node,), names))
        if names.shared:
            raise self.refused(node.span)
        after = self.with_names(rest, number, names, node.span)
        return _guarded(guards, after)

    def with_names(self, state: _State, number: int, names: Environment, span: Span) -> _Next:
        """A state with the variables of a call as they are now; random numbers among them are drawn."""
        changed = {name: value for name, value in names.names.items() if name != "self"}
        for value in changed.values():
            if isinstance(value, Function) and value.environment is names:
                raise fail("unsupported-construct", f"a function inside a {self.word} is not supported", span,
                           "defined here", ("define it at the top level",))  # fmt: skip

        def assigned(names: ModelValue) -> _Next:
            call = cast(_Call, state.frames[number]).call
            frame = _Call(call, self.held(cast("dict[str, ModelValue]", names)))
            return replace(state, frames=(*state.frames[:number], frame, *state.frames[number + 1 :]))

        return self.with_drawn(state, cast(ModelValue, changed), span, assigned, variables=True)

    def held(self, names: Mapping[str, ModelValue]) -> tuple[tuple[str, Held], ...]:
        """Variables in the order of their names."""
        return tuple((name, self.values.hold(names[name])) for name in sorted(names))

    def evaluated(self, state: _State, node: ast.Expression) -> tuple[ModelValue, _Guards]:
        """The value of an expression in the innermost call, and what it excludes."""
        return self.excluding(lambda: self.run.evaluate(node, self.scope(state, self.call_of(state))))

    # --- what happens

    def advance(self, state: _State) -> _Next:
        """What a state does first."""
        self.run.budget.step(self.span)
        if state.seen >= 0:
            return self.shown(state)
        if state.guards:
            first, *others = state.guards
            assert first.operand is not None
            then = replace(state, guards=tuple(others), of=state.of if others else -1)
            return self.ask(state, first.operand, then, Reject(first.span), state.of)
        if state.resumed >= 0:
            return self.resume(state)
        if not state.frames:
            return End()
        frame = state.frames[-1]
        below = replace(state, frames=state.frames[:-1])
        match frame:
            case _Block():
                if not frame.body:
                    return below
                rest = replace(state, frames=(*below.frames, _Block(frame.body[1:])))
                return self.statement(state, frame.body[0], rest)
            case _While():
                again = self.pushed(state, _Block(frame.node.body))
                return self.ask(state, frame.node.test, again, self.pushed(below, _Block(frame.node.orelse)))
            case _For():
                if frame.done == len(frame.items.held):
                    return self.pushed(below, _Block(frame.node.orelse))
                rest = self.pushed(below, replace(frame, done=frame.done + 1), _Block(frame.node.body))
                number = self.call_of(state)
                names = self.scope(state, number)
                assign(self.run, frame.node.target, frame.items.held[frame.done].value, names)
                return self.with_names(rest, number, names, frame.node.span)
            case _Call():
                return below
            case _Library():
                return self.library(state, frame, below)
            case _Try():
                # the block that runs is over
                if frame.running == len(frame.handlers):
                    return below
                again = replace(frame, running=-1)
                return replace(state, frames=(*below.frames, again), resumed=len(below.frames), asked=0)

    def pushed(self, state: _State, *frames: _Frame) -> _State:
        """A state with more frames."""
        return replace(state, frames=(*state.frames, *frames))

    def resume(self, state: _State) -> _Next:
        """Go on after a sample: ask what interrupts, from the outside to the inside, and then go on inside."""
        at = state.resumed
        while at < len(state.frames) and not isinstance(state.frames[at], _Try):
            at += 1
        if at == len(state.frames):
            return self.checked(replace(state, resumed=-1, asked=-1))
        if state.asked < 0:
            return self.checked(replace(state, resumed=at, asked=0), self.call_of(state, at))
        frame = cast(_Try, state.frames[at])
        number = state.asked
        if number == len(frame.handlers):
            return self.switched(state, at, number)
        running = frame.running == number or any(block == number for block, _ in frame.waiting)
        if running:
            return self.switched(state, at, number)
        wanted = frame.conditions[number]
        interrupted = replace(state, asked=-1)
        chosen = self.switched(interrupted, at, number)
        following = replace(state, resumed=at, asked=number + 1)
        if wanted is None:
            return _Timed(frame.timer, chosen, following)
        asked = self.ask(state, wanted, chosen, following, self.call_of(state, at))
        return replace(asked, loose=True) if isinstance(asked, _Asked) else asked

    def checked(self, state: _State, number: int | None = None) -> _State:
        """A state in which the invariants of a call are asked first."""
        calls = [each for each, frame in enumerate(state.frames) if isinstance(frame, _Call)]
        if not calls:
            return state
        number = calls[-1] if number is None else number
        invariants = cast(_Call, state.frames[number]).call.of.guards("invariant")
        return replace(state, guards=invariants, of=number) if invariants else state

    def switched(self, state: _State, at: int, block: int) -> _State:
        """A state in which a block of a `try` runs."""
        frame = cast(_Try, state.frames[at])
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
        return replace(state, frames=(*state.frames[:at], switched, _Block(body)), resumed=-1, asked=-1)

    def waits(self, rest: _State, activity: Span | None, contracts: Sequence[Contract] = ()) -> _Next:
        """Go on with a state at the next sample, by when some contracts must be kept."""
        frames = self.aged(rest.frames, "", first=rest.first)
        found: list[tuple[Held, int]] = []
        used = _timers_of(rest)
        started: list[tuple[int, float]] = []
        for contract in contracts if self.reaction_s is not None else ():
            if contract.shows is None:
                continue
            held = self.values.hold_contract(contract)
            timer = dict(rest.modes).get(held)
            if timer is None:
                timer = _free_timer(used)
                used.add(timer)
                started.append((timer, cast(float, self.reaction_s) + contract.settles_s))
            found.append((held, timer))
        modes = tuple(found)
        after: _Next = _Waits(
            replace(rest, frames=frames, resumed=0, asked=-1, first=False, modes=modes, seen=0 if modes else -1),
            activity,
        )
        for timer, after_s in started:
            after = _Started(timer, after_s, after)
        return after

    def shown(self, state: _State) -> _Next:
        """Ask whether a contract is kept: it is not if for some time no sample has shown what it asks for."""
        if state.seen == len(state.modes):
            return replace(state, seen=-1)
        held, timer = state.modes[state.seen]
        contract = cast(Contract, held.value)
        following = replace(state, seen=state.seen + 1)
        kept = _Started(timer, contract.settles_s, following, extends=True)
        broken = _Timed(timer, Reject(self.span), following)
        assert contract.shows is not None
        return self.test(state, contract.shows, (), kept, broken, self.span)

    def aged(self, frames: tuple[_Frame, ...], place: str, *, first: bool) -> tuple[_Frame, ...]:
        """Frames at the next sample."""
        found: list[_Frame] = []
        for number, frame in enumerate(frames):
            here = f"{place}{number}"

            def old(held: Held, name: str, here: str = here) -> Held:
                return self.values.aged(held, f"{here} {name}", first=first)

            match frame:
                case _Call():
                    names = tuple((name, old(held, name)) for name, held in frame.names)
                    found.append(replace(frame, names=names))
                case _For() if not frame.items.stays:
                    items = tuple([old(held, f"item {count}") for count, held in enumerate(frame.items.held)])
                    found.append(replace(frame, items=self.items(items)))
                case _Library():
                    found.append(replace(frame, call=old(frame.call, "call")))
                case _Block():
                    found.append(_Block(tuple(self.old_statement(each, old) for each in frame.body)))
                case _Try():
                    waiting = tuple(
                        (block, self.aged(inner, f"{here}.{block}.", first=first)) for block, inner in frame.waiting
                    )
                    body = tuple(self.old_statement(each, old) for each in frame.body)
                    found.append(replace(frame, waiting=waiting, body=body))
                case _:
                    found.append(frame)
        return tuple(found)

    def old_statement(self, node: _Statement, old: Callable[[Held, str], Held]) -> _Statement:
        """A statement at the next sample."""
        match node:
            case _Begin():
                return replace(node, what=old(node.what, "begun"))
            case _Pick():
                return replace(node, options=tuple(old(each, f"option {k}") for k, each in enumerate(node.options)))
            case _:
                return node

    def library(self, state: _State, frame: _Library, below: _State) -> _Next:
        """What a behavior of the libraries does: it goes through its phases, each over by a condition."""
        contracts, guards = self.contracts_of(frame.call)
        if frame.phase == len(contracts):
            return below
        contract, activity = contracts[frame.phase], cast(LibraryCall, frame.call.value).span
        following = self.pushed(below, _Library(frame.call, frame.phase + 1))
        lasting = self.pushed(below, replace(frame, lasted=min(frame.lasted + 1, contract.least_steps)))
        found = self.waits(lasting, activity, (contract,))
        if contract.over is not None and frame.lasted >= contract.least_steps:
            found = self.test(state, contract.over, (), following, found, self.span)
        asked = guards if not frame.phase and not frame.lasted else ()
        found = _guarded(asked, found)
        return replace(found, loose=True) if isinstance(found, _Asked) else found

    def contracts_of(self, held: Held) -> tuple[tuple[Contract, ...], _Guards]:
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

    def statement(self, state: _State, node: _Statement, rest: _State) -> _Next:
        """What a statement does, after which a state follows."""
        match node:
            case _Check():
                return self.checked(rest)
            case _Begin():
                return self.begin(state, node.what.value, rest, node.span)
            case _Pick():
                return self.pick(state, node, rest)
            case _Idle():
                return self.waits(state, None)
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
                return self.limited(state, rest, (_Idle(),), until, duration, node.unit)
            case ast.Do() if self.agent is not None:
                return self.do(state, node, rest)
            case ast.DynamicStatement(kind="terminate" | "terminate simulation", operand=None):
                return Terminate(node.span)
            case ast.DynamicStatement(kind="abort"):
                return self.left(state, node.span, _Try)
            case ast.Global() | ast.Nonlocal():
                raise self.refused(node.span)
            case ast.TryInterrupt() if not (node.handlers or node.orelse or node.final):
                interrupts = tuple(reversed(node.interrupts))
                frame = _Try(
                    tuple(each.condition for each in interrupts), tuple(each.body for each in interrupts), node.body
                )
                return replace(self.pushed(rest, frame), resumed=len(rest.frames), asked=0)
            case ast.Require(probability=None):
                return self.ask(state, node.condition, rest, Reject(node.span))
            case ast.Assert():
                return self.ask(state, node.test, rest, Reject(node.span))
            case ast.If():
                return self.branch(state, node, 0, rest)
            case ast.While():
                return self.pushed(rest, _While(node))
            case ast.For():
                value, guards = self.evaluated(state, node.iterable)
                items = tuple([self.values.hold(each) for each in items_of(self.run, value, node.iterable.span)])
                found = self.pushed(rest, _For(node, self.items(items)))
                return _guarded(guards, found)
            case ast.Break():
                frames = self.left(state, node.span, _While, _For).frames
                return replace(state, frames=frames)
            case ast.Continue():
                frames = self.left(state, node.span, _While, _For, keep=True).frames
                return replace(state, frames=frames)
            case ast.Return():
                return replace(state, frames=state.frames[: self.call_of(state)])
            case ast.Assign() | ast.AugmentedAssign() | ast.AnnotatedAssign() | ast.ExpressionStatement():
                return self.simple(state, node, rest)
            case ast.TryInterrupt() | ast.Try() if node.handlers:
                raise self.refused(node.handlers[0].span)
            case _:
                raise self.refused(node.span)

    def refused(self, span: Span) -> Exception:
        """What is wrong with a statement that is not read."""
        word = span.text.split()[0].rstrip(":")
        if span.text.startswith("try"):
            word = "finally"
        return fail("unsupported-construct", f"`{word}` in a {self.word} is not supported", span,
                    "is not followed over time")  # fmt: skip

    def items(self, held: tuple[Held, ...]) -> _Items:
        """What a loop goes through."""
        if held not in self._items:
            self._items[held] = _Items(held, not any(self.values.reads_samples(each.value) for each in held))
        return self._items[held]

    def branch(self, state: _State, node: ast.If, number: int, rest: _State) -> _Next:
        """One branch after the other."""
        if number == len(node.branches):
            return self.pushed(rest, _Block(node.orelse))
        branch = node.branches[number]
        others = ast.If(node.span, node.branches[number + 1 :], node.orelse)
        other = self.pushed(rest, _Block((others,))) if others.branches else self.pushed(rest, _Block(node.orelse))
        return self.ask(state, branch.test, self.pushed(rest, _Block(branch.body)), other)

    def left(self, state: _State, span: Span, *kinds: type, keep: bool = False) -> _State:
        """A state in which the innermost frame of a kind of the call is left, or where it goes on."""
        for number in reversed(range(len(state.frames))):
            frame = state.frames[number]
            if isinstance(frame, kinds) and not (isinstance(frame, _Try) and frame.ends):
                return replace(state, frames=state.frames[: number + keep])
            if isinstance(frame, _Call):
                break
        raise fail("parse-error", f"`{span.text.split()[0]}` stands outside of what it leaves", span, "leaves nothing")

    def take(self, state: _State, node: ast.Take, rest: _State) -> _Next:
        """Take actions."""
        values: list[ModelValue] = []
        excluded: list[tuple[Node, Span]] = []
        for expression in node.actions:
            value, guards = self.evaluated(state, expression)
            excluded += guards
            several = isinstance(value, list | tuple) and len(node.actions) == 1
            values += list(cast("list[ModelValue]", value)) if several else [value]

        def taken(actions: ModelValue) -> _Next:
            contracts: list[Contract] = []
            asked = list(excluded)
            for action in cast("list[ModelValue]", actions):
                contract, guards = self.action(action, node.span)
                asked += guards
                contracts += [contract] if contract is not None else []
            found = self.waits(rest, node.span, contracts)
            return _guarded(tuple(asked), found)

        return self.with_drawn(state, values, node.span, taken)

    def with_drawn(
        self, state: _State, value: ModelValue, span: Span, following: Callable[[ModelValue], _Next],
        *, variables: bool = False,
    ) -> _Next:  # fmt: skip
        """Go on with a value whose random numbers are drawn: by each way of a choice, with an unknown for a number.

        Args:
            state: Where the process stands.
            value: It.
            span: The statement that draws.
            following: How it goes on.
            variables: Whether it has those that are assigned, which no longer use what stood for an earlier draw.
        """
        for leaf in self.values.drawn(value):
            if isinstance(leaf, Index):
                settled = self.values.each(value, leaf)
                return _any_of([self.with_drawn(state, each, span, following, variables=variables) for each in settled])
            names = cast("dict[str, ModelValue]", value) if variables else {}
            targets = tuple(name for name, each in names.items() if leaf in self.values.drawn(each))
            value = self.values.without(value, leaf, self.unknown(leaf, state, span, targets))
        return following(value)

    def action(self, value: ModelValue, span: Span) -> tuple[Contract | None, _Guards]:
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

    def do(self, state: _State, node: ast.Do, rest: _State) -> _Next:
        """Do a behavior."""
        if not node.schedule and len(node.behaviors) > 1:
            raise fail("parse-error", "a behavior does one thing at a time", node.span, "several are done here")
        values: list[ModelValue] = []
        excluded: list[tuple[Node, Span]] = []
        for expression in node.behaviors:
            value, guards = self.evaluated(state, expression)
            excluded += guards
            if node.schedule and isinstance(value, dict) and len(node.behaviors) == 1:
                weights = cast("dict[ModelValue, ModelValue]", value)
                values += [behavior for behavior, weight in weights.items() if weight != 0]
            else:
                values.append(value)

        def done(behaviors: ModelValue) -> _Next:
            held = tuple(self.values.hold(as_behavior(each, node.span)) for each in behaviors)
            inner: _Statement = _Begin(held[0], node.span) if not node.schedule else _Pick(
                held, node.schedule == "shuffle", node.span
            )  # fmt: skip
            return self.limited(state, rest, (inner,), node.until, node.duration, node.unit)

        after = self.with_drawn(state, values, node.span, done)
        return _guarded(tuple(excluded), after)

    def limited(
        self, state: _State, rest: _State, body: tuple[_Statement, ...], until: ast.Expression | None,
        duration: ast.Expression | None, unit: str,
    ) -> _Next:  # fmt: skip
        """Do something until a condition holds or a time is over, or to its end."""
        checked = self.pushed(rest, _Block((_Check(),)))
        if until is None and duration is None:
            return self.pushed(checked, _Block(body))
        if until is not None:
            frame = _Try((until,), ((),), body, ends=True)
            return replace(self.pushed(checked, frame), resumed=len(checked.frames), asked=0)
        assert duration is not None
        after_s = self.seconds(self.run, duration, unit, self.scope(state, self.call_of(state)))
        if after_s <= 0:
            return checked
        timer = _free_timer(_timers_of(checked))
        frame = _Try((None,), ((),), body, timer, ends=True)
        found = replace(self.pushed(checked, frame), resumed=len(checked.frames), asked=0)
        return _Started(timer, after_s, found)

    def begin(self, state: _State, value: ModelValue, rest: _State, span: Span) -> _Next:
        """Begin a behavior."""
        match value:
            case CoroutineCall() if not isinstance(value.of, MonitorDefinition):
                if sum(isinstance(frame, _Call) for frame in state.frames) > LIMITS.call_nesting:
                    raise fail("budget-exceeded", f"calls are nested deeper than {LIMITS.call_nesting}", span,
                               "this call", ("replace the recursion by a loop",))  # fmt: skip
                found = self.called(rest, value)
                guards = value.of.guards("precondition") + value.of.guards("invariant")
                return replace(found, guards=guards, of=len(rest.frames)) if guards else found
            case LibraryCall() if not value.of.is_action:
                return self.pushed(rest, _Library(self.values.hold(value)))
            case Choice():
                return self.chosen(value, lambda option: self.pushed(rest, _Block((_Begin(option, span),))), span)
            case _:
                raise fail("wrong-type", "this is no behavior", span, f"this is {describe(value)}")

    def called(self, state: _State, call: CoroutineCall) -> _State:
        """A state in which a call has begun."""
        body = cast("tuple[ast.Statement, ...]", call.of.body)
        return self.pushed(state, _Call(call, self.held(call.given)), _Block(body))

    def chosen(self, choice: Choice, following: Callable[[Held], _State], span: Span) -> _Next:
        """Go on with the option that a random choice comes out as: any that is drawn now, or that of the scene."""
        states = [following(self.values.hold(as_behavior(each, span))) for each in choice.options]
        if self.values.drawn(choice.index):
            return _Ways(tuple(states))
        found: _Next = states[-1]
        for number in reversed(range(len(states) - 1)):
            node = build.compare(CompareOp.EQ, choice.index, build.constant(float(number)), span)
            found = _Asked(node, (), states[number], found)
        return found

    def pick(self, state: _State, node: _Pick, rest: _State) -> _Next:
        """Begin one of some behaviors that may begin."""
        if not node.options:
            return rest
        if len(node.enabled) < len(node.options):
            value = node.options[len(node.enabled)].value
            yes, no = (
                self.pushed(rest, _Block((replace(node, enabled=(*node.enabled, each)),))) for each in (True, False)
            )
            if not isinstance(value, CoroutineCall) or not value.of.guards("precondition", "invariant"):
                return yes
            return self.enabled(state, value, yes, no)
        enabled = [number for number, each in enumerate(node.enabled) if each]
        if not enabled:
            return Reject(node.span)
        ways: list[_State] = []
        for number in enabled:
            others = (*node.options[:number], *node.options[number + 1 :])
            later = (_Pick(others, node.shuffle, node.span),) if node.shuffle else ()
            ways.append(self.pushed(rest, _Block((_Begin(node.options[number], node.span), *later))))
        return ways[0] if len(ways) == 1 else _Ways(tuple(ways))

    def enabled(self, state: _State, call: CoroutineCall, yes: _State, no: _State) -> _Next:
        """Go on by whether a behavior may begin."""
        found: _Next = yes
        within = self.called(state, call)
        for guard in reversed(call.of.guards("precondition") + call.of.guards("invariant")):
            assert guard.operand is not None
            found = self.ask(within, guard.operand, found, no)
        return found


def _any_of(ways: Sequence[_Next]) -> _Next:
    """Any of some ways."""
    return ways[0] if len(ways) == 1 else _Ways(tuple(ways))


def _guarded(guards: _Guards, then: _Next) -> _Next:
    """What happens next, after what is asked for so that it can."""
    return _Asked(build.constant(True), guards, then, then) if guards else then


def _timers_of(state: _State) -> set[int]:
    """The timers that a state needs."""
    return _timers(state.frames) | {timer for _, timer in state.modes}


def _free_timer(used: set[int]) -> int:
    return next(number for number in range(LIMITS.process_steps) if number not in used)


def _timers(frames: Sequence[_Frame]) -> set[int]:
    """The timers that frames need."""
    found: set[int] = set()
    for frame in frames:
        if isinstance(frame, _Try):
            found |= {frame.timer} - {-1}
            for _, inner in frame.waiting:
                found |= _timers(inner)
    return found


def process_of(
    run: Interpreter, call: ModelValue, number: int, agent: Instance | None, atom: Callable[[Node], Atom],
    seconds: Seconds, actions: dict[str, Span], span: Span, reaction_s: float | None = None,
) -> tuple[Process, tuple[tuple[_Guards, Node, Span], ...]]:  # fmt: skip
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

    Raises:
        ScenarioError: unsupported-construct, for a statement that is not followed; runtime-error for a loop that never
            waits; budget-exceeded; whatever is wrong with an expression.
    """
    values = LocalValues(number, Identity().order, run.lookups.ranks)
    graph = _Graph(run, atom, agent, values, seconds, {}, span, actions, reaction_s)
    asked: list[tuple[_Guards, Node, Span]] = []
    start = _State(())
    if isinstance(call, CoroutineCall):
        start = graph.called(start, call)
        with read_over_time():
            for guard in call.of.guards("precondition") + call.of.guards("invariant"):
                found = graph.ask(start, cast(ast.Expression, guard.operand), End(), Reject(guard.span))
                match found:
                    case _Asked():
                        asked.append((found.guards, found.node, guard.span))
                    case Reject():
                        asked.append(((), build.constant(False), guard.span))
                    case _:
                        pass
    else:
        start = graph.pushed(start, _Block((_Begin(values.hold(call), span),)))
    graph.follow(start)
    if _spins(graph.steps, graph.loose):
        raise graph.spins()
    return Process(span, tuple(graph.steps), None if agent is None else agent.index), tuple(asked)


def _spins(steps: Sequence[ProcessStep], loose: set[int]) -> bool:
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
