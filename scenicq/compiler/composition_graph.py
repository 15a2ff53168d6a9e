"""What composes scenarios as a graph of steps: one process runs all scenarios that a program is made of.

It is followed as behaviors are (`process_graph`). Scenarios that run side by side are led through a sample one after
the other, as Scenic does it: whether it still runs, its requirements, its time, what it composes, what ends it. What
else a scenario has (monitors, behaviors of its objects) are processes of their own, which begin with it.

Where Scenic 3.1.1 does otherwise than its manual says, we do as Scenic does, but for one thing: what a scenario that
others run says with `terminate when` ends it. (There, it is taken for a requirement.)

- Whatever is run by a `do` that another one interrupts is left by that: the `do` is over when it goes on.
- A monitor that says `terminate` ends the run, whoever requires it.
- What is left goes on as objects and behaviors do; no time and no `terminate when` ends it any more.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

from scenicq.compiler.coerce import read_over_time
from scenicq.compiler.coroutines import (
    CoroutineCall,
    DelayedCall,
    ScenarioCall,
    ScenarioDefinition,
    ScenarioNotBegunError,
    as_behavior,
)
from scenicq.compiler.local_values import LocalValues, VariableValue
from scenicq.compiler.modular import SetUp, set_up
from scenicq.compiler.overrides import find_overrides
from scenicq.compiler.process_graph import ProcessGraph, has_circle
from scenicq.compiler.process_states import (
    BlockFrame,
    CallFrame,
    Directs,
    EnterScenarios,
    Following,
    GraphGuards,
    GraphStatement,
    OnRunning,
    OnTimer,
    ProcessFrame,
    ProcessState,
    RunningScenario,
    TimerStarts,
    TogetherFrame,
    TryFrame,
    Ways,
    ask_guards,
    free_timer,
    timers_of,
)  # fmt: skip
from scenicq.compiler.values import Choice, Instance, ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.forest.nodes import PAST, Feature, Identity, Index, Node
from scenicq.forest.temporal import (
    Activity,
    Always,
    And,
    Atom,
    Begin,
    CheckSample,
    End,
    Eventually,
    Formula,
    GiveUp,
    Leave,
    Next,
    Not,
    Or,
    Process,
    PutBehavior,
    Reject,
    Stop,
    SubScenario,
    TemporalRequirement,
    Terminate,
    Until,
)  # fmt: skip
from scenicq.limits import LIMITS
from scenicq.syntax import ast

__all__ = ["ARRIVES", "ComposedScenario", "Composition", "CompositionGraph"]

ARRIVES = f"{PAST}arrives "
"""How what stands for the beginning of a scenario that makes objects is called, before its number."""
MakesProcess = Callable[
    [ModelValue, "Instance | None", Span, int, bool], "tuple[int, Sequence[tuple[GraphGuards, Node, Span]]]"
]
"""Adds the process of a monitor or behavior, of a scenario or put for another one: its number, and what it asks for."""


@dataclass(eq=False)
class ComposedScenario:
    """A scenario that begins within a run.

    Attributes:
        number: Its number.
        parent: That of the scenario that runs it; -1 for the one that the program runs.
        call: The call.
        made: What it has since it has been set up.
        is_early: Whether it begins with the first sample.
        span: Where the program runs it.
        asked: What it asks for when it begins.
        requirements: What it requires over time.
        ends: What ends it, each with whether it ends the run.
        after_s: After how many seconds it ends; None for no time.
        processes: Its monitors, and the behaviors of its objects.
        overrides: What it overrides: the object, and the number of its behavior, -1 for none.
    """

    number: int
    parent: int
    call: ScenarioCall
    made: SetUp
    is_early: bool
    span: Span
    asked: list[tuple[GraphGuards, Node, Span]] = field(default_factory=list["tuple[GraphGuards, Node, Span]"])
    requirements: list[TemporalRequirement] = field(default_factory=list[TemporalRequirement])
    ends: list[tuple[GraphGuards, Node, Span, bool]] = field(
        default_factory=list["tuple[GraphGuards, Node, Span, bool]"]
    )
    after_s: float | None = None
    processes: list[int] = field(default_factory=list[int])
    overrides: list[tuple[int, int]] = field(default_factory=list["tuple[int, int]"])
    names: Mapping[str, ModelValue] = field(init=False)

    def __post_init__(self) -> None:
        """Give its names."""
        self.names = self.made.names

    @property
    def is_silent(self) -> bool:
        """Whether it says nothing over time that does not stand where it is run."""
        return not (self.requirements or self.processes or self.overrides)

    @property
    def objects(self) -> list[Instance]:
        """The objects that it makes."""
        return self.made.objects

    @property
    def is_late(self) -> bool:
        """Whether it makes objects after the first sample."""
        return bool(self.objects) and not self.is_early

    @property
    def arrives(self) -> Node:
        """The condition that a sample shows the objects which the scenario makes; no label says it."""
        index = cast(int, self.objects[0].index)
        return Feature(index, f"{ARRIVES}{self.number}", "boolean", current=True, span=self.span)


@dataclass(frozen=True, eq=False)
class Composition:
    """What composes scenarios, followed.

    Attributes:
        process: It.
        scenarios: Those that begin within a run.
        ego: The index of the ego that the scenario makes which the program runs; None if it makes none.
    """

    process: Process
    scenarios: tuple[ComposedScenario, ...]
    ego: int | None = None

    def as_scenarios(self) -> tuple[SubScenario, ...]:
        """The scenarios as a run knows them."""
        return tuple(
            SubScenario(each.span, each.parent, tuple(each.requirements), tuple(each.processes))
            for each in self.scenarios
        )


@dataclass(eq=False)
class CompositionGraph(ProcessGraph):
    """What composes scenarios while it is followed.

    Attributes:
        top: The scenario that the program runs.
        adds: Adds the processes of scenarios.
        scenarios: Those that have begun anywhere.
        has_setup: Whether the one that the program runs has set up something: no other one is the initial scenario.
    """

    top: CoroutineCall = field(kw_only=True)
    adds: MakesProcess = field(kw_only=True)
    scenarios: list[ComposedScenario] = field(default_factory=list[ComposedScenario])
    has_setup: bool = field(default=True, kw_only=True)
    _known: dict[Hashable, ComposedScenario] = field(default_factory=dict["Hashable", "ComposedScenario"])
    _overrides: dict[Hashable, tuple[int, Sequence[tuple[GraphGuards, Node, Span]]]] = field(
        default_factory=dict["Hashable", "tuple[int, Sequence[tuple[GraphGuards, Node, Span]]]"]
    )

    @property
    def word(self) -> str:
        """What it is."""
        return "compose block"

    def composition(self, names: Mapping[str, ModelValue]) -> Composition:
        """Follow it from its start.

        Args:
            names: The names of the scenario that the program runs, once it has been set up.

        Raises:
            ScenarioError: See `process_of`.
        """
        definition = cast(ScenarioDefinition, self.top.of)
        frames: tuple[ProcessFrame, ...] = (CallFrame(self.top, self.hold_names(names)), self._body(definition))
        guards = definition.guards("precondition") + definition.guards("invariant")
        start = ProcessState(frames)
        if guards:
            start = replace(start, guards=guards, of=0)
        self.follow(start)
        if has_circle(self.steps, self.loose):
            raise self.spins()
        process = Process(self.span, tuple(self.steps), composes=True)
        ego = None if self.run.current_ego is None else self.run.current_ego.index
        return Composition(process, tuple(self.scenarios), ego)

    @staticmethod
    def _body(definition: ScenarioDefinition) -> BlockFrame:
        """What a scenario composes; one that has invariants alone asks them at each sample."""
        if definition.compose is not None:
            return BlockFrame(definition.compose)
        waiting = ast.DynamicStatement(definition.span, "wait")
        return BlockFrame((ast.While(definition.span, ast.LiteralValue(definition.span, True), (waiting,), ()),))

    # --- which scenario it is in

    def within(self, state: ProcessState) -> int:
        """The number of the scenario that goes on, -1 for the one that the program runs."""
        at = _inside(state.frames)
        if at < 0:
            return -1
        frame = cast(TogetherFrame, state.frames[at])
        return frame.scenarios[frame.at].number

    def ego_of(self, state: ProcessState) -> Instance | None:
        """Who the ego is."""
        number = self.within(state)
        own = self.scenarios[number].made.ego if number >= 0 else None
        if own is not None or self.run.current_ego is not None:
            return own or self.run.current_ego
        begun = (self.scenarios[number].made.ego for _, number in state.begun)
        return next((each for each in begun if each is not None), None)

    def _as_seen(self, state: ProcessState, work: Callable[[], ModelValue]) -> ModelValue:
        """What is worked out with the ego of the scenario that goes on; it makes no objects."""
        run, before, count = self.run, (self.run.current_ego, self.run.begun), len(self.run.objects)
        begun = dict(state.begun)

        def names(call: ScenarioCall) -> Mapping[str, ModelValue] | None:
            number = begun.get(self.values.hold(call).key)
            return None if number is None else self.scenarios[number].names

        run.current_ego, run.begun = self.ego_of(state), names
        try:
            found = work()
        finally:
            run.current_ego, run.begun = before
        if len(run.objects) > count:
            raise fail("unsupported-construct", "an object cannot be made here", run.objects[count].span,
                       "within a compose block", ("make it in a `setup` block",))  # fmt: skip
        return found

    def ask(
        self, state: ProcessState, wanted: ast.Expression, then: Following, otherwise: Following,
        number: int | None = None,
    ) -> Following:  # fmt: skip
        """Go on in one of two ways by a condition, over the names and the ego of a scenario."""
        base = super().ask
        return self._as_seen(state, lambda: base(state, wanted, then, otherwise, number))

    def evaluate(self, state: ProcessState, node: ast.Expression) -> tuple[ModelValue, GraphGuards]:
        """The value of an expression, over the names and the ego of a scenario."""
        base = super().evaluate
        with self._drawn_by_scene(state):
            return self._as_seen(state, lambda: base(state, node))

    def simple(self, state: ProcessState, node: ast.Statement, rest: ProcessState) -> Following:
        """Run a statement that only computes, over the names and the ego of a scenario."""
        base = super().simple
        with self._drawn_by_scene(state):
            return self._as_seen(state, lambda: base(state, node, rest))

    def _drawn_by_scene(self, state: ProcessState) -> _Drawing:
        """While something is evaluated: at the first sample, what it draws is the scene's."""
        return _Drawing(self.values if state.first else None)

    # --- statements

    def statement(self, state: ProcessState, node: GraphStatement, rest: ProcessState) -> Following:
        """What a statement does, after which a state follows."""
        match node:
            case EnterScenarios():
                return self._enter(state, node, rest)
            case ast.Do():
                return self.do(state, node, rest)
            case ast.Override():
                return self._override(state, node, rest)
            case ast.DynamicStatement(kind="terminate", operand=None):
                return self._ended(state, node.span)
            case ast.Take():
                raise fail("parse-error", "only behaviors take actions", node.span, "this composes scenarios")
            case ast.Try() | ast.TryInterrupt() if node.handlers or node.final:
                # what a scenario raises while others run beside it, Scenic leaves half done
                raise self.refusal((node.handlers[0] if node.handlers else node).span)
            case ast.DynamicDefinition() | ast.Model() | ast.Param() | ast.Mutate() | ast.RequireMonitor():
                raise fail("unsupported-construct", "this cannot stand in a compose block", node.span, "",
                           ("write it in the `setup` block",))  # fmt: skip
            case _:
                return super().statement(state, node, rest)

    def do(self, state: ProcessState, node: ast.Do, rest: ProcessState) -> Following:
        """Run scenarios."""
        if node.schedule:
            return super().do(state, node, rest)
        inner: GraphStatement = EnterScenarios(node.behaviors, node.span)
        return self.run_limited(state, rest, (inner,), node.until, node.duration, node.unit)

    def as_done(self, value: ModelValue, span: Span) -> ModelValue:
        """What is done, as a call."""
        if isinstance(value, ScenarioDefinition):
            return self.run.call_function(value, [], {}, span)
        return value

    def begin(self, state: ProcessState, value: ModelValue, rest: ProcessState, span: Span) -> Following:
        """Begin what was chosen."""
        return self.push(rest, BlockFrame((EnterScenarios((self.values.hold(value),), span),)))

    def _enter(self, state: ProcessState, node: EnterScenarios, rest: ProcessState) -> Following:
        """Begin one scenario after the other, then run all of them."""
        if not node.waiting:
            return self.push(rest, TogetherFrame(node.begun, node.span))
        first, *others = node.waiting
        if not node.begun:
            # those that the scenario runs are others now
            rest = self._losing(rest)
        guards: GraphGuards = ()
        if isinstance(first, VariableValue):
            value = first.value
        else:
            value, guards = self.evaluate(state, first)
        if isinstance(value, DelayedCall):
            value, guards = self.evaluate(state, value.call)
        after = replace(node, waiting=tuple(others))
        is_named = isinstance(first, VariableValue) or not isinstance(first, ast.Call)
        found = self._entered(state, self.as_done(value, node.span), after, rest, is_named=is_named)
        found = ask_guards(guards, found)
        return found if node.begun else Directs(Leave(self.within(state), 0), found)

    def _entered(
        self, state: ProcessState, value: ModelValue, after: EnterScenarios, rest: ProcessState, *, is_named: bool
    ) -> Following:
        if isinstance(value, Choice):
            held = [self.values.hold(self.as_done(each, after.span)) for each in value.options]
            ways = [replace(after, waiting=(each, *after.waiting)) for each in held]
            return Ways(tuple(self.push(rest, BlockFrame((each,))) for each in ways))
        if not isinstance(value, ScenarioCall):
            raise fail("wrong-type", "this is no scenario", after.span, f"this is {describe(value)}")
        depth = sum(isinstance(each, TogetherFrame) for each in state.frames)
        if depth > LIMITS.call_nesting:
            raise fail("budget-exceeded", f"scenarios are nested deeper than {LIMITS.call_nesting}", after.span,
                       "this one", ("replace the recursion by a loop",))  # fmt: skip
        within = self.push_call(state, value)
        found = self._begun(state, value, after, rest, is_named=is_named)
        guards = value.of.guards("precondition") + value.of.guards("invariant")
        for guard in reversed(guards):
            found = self.ask(within, cast(ast.Expression, guard.operand), found, Reject(guard.span))
        return found

    def _begun(
        self, state: ProcessState, value: ScenarioCall, after: EnterScenarios, rest: ProcessState, *, is_named: bool
    ) -> Following:
        """What follows where a scenario begins."""
        scenario = self._scenario(state, value, after.span)
        if scenario is None:
            return GiveUp(after.span)
        timer = -1
        timed = rest
        if is_named or scenario.objects or (not self.has_setup and not rest.begun):
            key = self.values.hold(value).key
            begun = tuple(each for each in rest.begun if each[0] != key or self.scenarios[each[1]].objects)
            timed = replace(rest, begun=(*begun, (key, scenario.number)))
        if scenario.after_s is not None:
            timer = free_timer(timers_of(rest) | {each.timer for each in after.begun})
        definition = cast(ScenarioDefinition, value.of)
        frames: tuple[ProcessFrame, ...] | None = None
        if definition.compose is not None or definition.guards("invariant"):
            names = {name: scenario.names[name] for name in scenario.made.scope.names}
            call = CallFrame(value, self.hold_names(names))
            frames = call, self._body(definition)
        running = RunningScenario(scenario.number, timer, frames)
        found: Following = self.push(timed, BlockFrame((replace(after, begun=(*after.begun, running)),)))
        if scenario.after_s is not None:
            found = TimerStarts(timer, scenario.after_s, found)
        for index, process in reversed(scenario.overrides):
            found = Directs(PutBehavior(scenario.number, index, process, 0), found)
        if scenario.objects or not scenario.is_silent:
            found = Directs(Begin(scenario.number, 0), found)
        found = self._asking(state, scenario.asked, found)
        if scenario.is_late:
            found = self.test(state, scenario.arrives, (), found, Reject(after.span), after.span)
        return found

    def _override(self, state: ProcessState, node: ast.Override, rest: ProcessState) -> Following:
        """Put behaviors in place of others until the scenario ends."""
        number, found = self.within(state), cast("Following", rest)
        if self.run.timed is None or self.run.timed.behaviors == "ignore":
            self.run.dynamic(node.kind, node.span)
            return rest
        scope = self.scope(state, self.call_of(state))
        told = self._as_seen(state, lambda: find_overrides(self.run, node, scope))
        for instance, behavior, span in reversed(told):
            process, asked = self._overriding(behavior, instance, span)
            found = self._asking(state, asked, found)
            found = Directs(PutBehavior(number, cast(int, instance.index), process, 0), found)
        return found

    def _overriding(
        self, behavior: ModelValue, instance: Instance, span: Span
    ) -> tuple[int, Sequence[tuple[GraphGuards, Node, Span]]]:
        """The number of the process of a behavior that is put for another one, -1 for none; with what it asks for."""
        if behavior is None:
            return -1, ()
        key = self.values.hold(as_behavior(behavior, span)).key, instance.index, span
        if key not in self._overrides:
            self._overrides[key] = self.adds(behavior, instance, span, -1, True)
        return self._overrides[key]

    def _asking(
        self, state: ProcessState, asked: Sequence[tuple[GraphGuards, Node, Span]], then: Following
    ) -> Following:
        for guards, node, span in reversed(asked):
            then = self.test(state, node, guards, then, Reject(span), span)
        return then

    # --- scenarios

    def _scenario(self, state: ProcessState, call: ScenarioCall, span: Span) -> ComposedScenario | None:
        """The scenario that a call begins in a state: each that makes objects once; None where these are too many."""
        parent, key = self.within(state), self.values.hold(call).key
        used = {number for _, number in state.begun}
        initial = not self.has_setup and not state.begun
        for count in range(LIMITS.scenario_starts):
            known = self._known.get((key, parent, state.first, initial, count))
            if known is None:
                known = self._set_up(state, call, parent, span, initial=initial)
                self._known[key, parent, state.first, initial, count] = known
            if not known.objects or known.number not in used:
                return known
        return None

    def _set_up(
        self, state: ProcessState, call: ScenarioCall, parent: int, span: Span, *, initial: bool
    ) -> ComposedScenario:
        self.run.is_initial = initial
        given = {name: self.values.at_begin(value, f"{name} {call.span.start}", first=state.first)
                 for name, value in call.given.items()}  # fmt: skip
        with self._drawn_by_scene(state):
            made = set_up(self.run, replace(call, given=given), self.ego_of(state))
        number = len(self.scenarios)
        found = ComposedScenario(number, parent, call, made, state.first, span)
        self.scenarios.append(found)
        if found.is_late:
            found.names = {name: self._forgotten(value, found, name) for name, value in found.names.items()}
        with self._drawn_by_scene(state):
            self._read(state, found)
        return found

    def _read(self, state: ProcessState, found: ComposedScenario) -> None:
        """What a scenario says about time."""
        timed, run = found.made.timed, self.run
        before, run.current_ego = run.current_ego, found.made.ego or self.ego_of(state)
        course, run.course = run.course, None
        try:
            with read_over_time():
                if not found.objects:
                    for each in found.made.requirements:
                        node, guards = self.excluding(each.condition)
                        if each.probability >= 1:
                            found.asked.append((guards, node, each.span))
                conditions = [self.excluding(each) for each in timed.conditions]
        finally:
            run.current_ego, run.course = before, course
        if found.is_late:
            conditions = [
                (self._unknown_now(state, node, found, f"condition {number}"), guards)
                for number, (node, guards) in enumerate(conditions)
            ]
        if not found.objects:
            found.asked += [((), node, span) for node, span in found.made.excluded]
        for requirement in timed.requirements:
            lacking: list[tuple[Node, Span]] = []
            formula = self._formula(requirement.formula, conditions, lacking)
            found.requirements.append(TemporalRequirement(formula, requirement.span))
            found.requirements += [TemporalRequirement(Always(self.atom(node)), span) for node, span in lacking]
        for each in timed.terminations:
            if each.after_s is not None:
                found.after_s = each.after_s
            elif each.condition is not None:
                end, needs = conditions[each.condition.number]
                found.ends.append((needs, end, each.span, each.simulation))
        for monitor, span in timed.monitors:
            number, asked = self.adds(monitor, None, span, found.number, False)
            found.processes.append(number)
            found.asked += asked
        for instance, behavior, span in timed.agents:
            if found.is_late:
                behavior = self._forgotten(behavior, found, f"behavior {instance.index}")  # noqa: PLW2901
            number, asked = self.adds(behavior, instance, span, found.number, False)
            found.processes.append(number)
            found.asked += asked
        for instance, behavior, span in timed.overrides:
            number, asked = self._overriding(behavior, instance, span)
            found.asked += asked
            found.overrides.append((cast(int, instance.index), number))

    def _forgotten(self, value: ModelValue, scenario: ComposedScenario, name: str) -> ModelValue:
        """What is known of a value after the sample at which its scenario has begun."""
        return self.values.forgotten(value, f"{name} of scenario {scenario.number}")

    def _unknown_now(self, state: ProcessState, node: Node, scenario: ComposedScenario, name: str) -> Node:
        """A condition of which nothing is known that was read, or drawn, where its scenario has begun."""
        found = cast(Node, self._forgotten(node, scenario, name))
        for leaf in self.values.drawn_variables(found):
            if isinstance(leaf, Index):
                raise fail("unsupported-construct", "a choice of a scenario that begins within a run is not supported",
                           leaf.span or scenario.span, "drawn when it begins",
                           ("draw it in the `setup` of the scenario that runs it",))  # fmt: skip
            found = cast(Node, self.values.without(found, leaf, self.unknown(leaf, state, scenario.span, ())))
        return found

    def _formula(
        self, formula: Formula, conditions: Sequence[tuple[Node, GraphGuards]], guards: list[tuple[Node, Span]]
    ) -> Formula:
        """A formula over the conditions of the whole program."""
        match formula:
            case Atom():
                node, asked = conditions[formula.number]
                guards += asked
                return self.atom(node)
            case Not() | Always() | Eventually() | Next():
                return type(formula)(self._formula(formula.operand, conditions, guards))
            case And() | Or():
                return type(formula)(tuple(self._formula(each, conditions, guards) for each in formula.operands))
            case Until():
                left, right = (self._formula(each, conditions, guards) for each in (formula.left, formula.right))
                return Until(left, right)

    # --- scenarios that run side by side

    def advance(self, state: ProcessState) -> Following:
        """What a state does first."""
        idle = state.seen < 0 and not state.guards and state.resumed < 0 and bool(state.frames)
        if idle and isinstance(state.frames[-1], TogetherFrame):
            self.run.budget.step(self.span)
            return self._together(state, state.frames[-1])
        if not state.frames:
            return Terminate(self.span) if cast(ScenarioDefinition, self.top.of).compose is not None else End()
        return super().advance(state)

    def _together(self, state: ProcessState, frame: TogetherFrame) -> Following:
        """Lead the scenarios through a sample."""
        below = replace(state, frames=state.frames[:-1])
        if not frame.scenarios:
            return below

        def on(**changes: object) -> ProcessState:
            return self.push(below, replace(frame, **changes))  # type: ignore[arg-type]

        if frame.at == len(frame.scenarios):
            if frame.stage == "runs":
                return on(at=0, stage="begins")
            return self.waits(on(at=0, stage="runs"), frame.span)
        running = frame.scenarios[frame.at]
        scenario = self.scenarios[running.number]
        others = (*frame.scenarios[: frame.at], *frame.scenarios[frame.at + 1 :])
        without = on(scenarios=others)
        over = self._stopped(running.number, without)
        match frame.stage:
            case "runs":
                following = on(at=frame.at + 1)
                return following if scenario.is_silent else OnRunning(running.number, following, without)
            case "begins":
                known = (*frame.scenarios[: frame.at], replace(running, is_new=False), *frame.scenarios[frame.at + 1 :])
                inside = on(stage="ends" if running.frames is None else "inside", scenarios=known)
                if running.frames is not None:
                    inside = replace(inside, frames=(*inside.frames, *running.frames),
                                     resumed=len(inside.frames) if running.resumes else -1, asked=-1)  # fmt: skip
                found: Following = (
                    inside if running.timer < 0 or running.is_new else OnTimer(running.timer, over, inside)
                )
                if scenario.after_s == 0:
                    found = over
                return Directs(CheckSample(running.number, 0), found) if scenario.requirements else found
            case "inside":
                # what it composes is over
                return self._stopped(running.number, on(scenarios=others, stage="begins"))
            case _:
                found = on(at=frame.at + 1, stage="begins")
                over = self._stopped(running.number, on(scenarios=others, stage="begins"))
                for guards, node, span, simulation in reversed(scenario.ends):
                    found = self.test(state, node, guards, Terminate(span) if simulation else over, found, span)
                return found

    def activities(self, frames: tuple[ProcessFrame, ...], what: Span) -> tuple[Activity, ...]:
        """What goes on from one sample to the next: what is done, and each scenario that runs."""
        found = [Activity(what)]
        stack: list[tuple[tuple[ProcessFrame, ...], tuple[Span, ...]]] = [(frames, ())]
        while stack:
            inner, calls = stack.pop()
            for frame in inner:
                if isinstance(frame, TogetherFrame):
                    for each in frame.scenarios:
                        call = self.scenarios[each.number].call.span
                        found.append(Activity(call, calls, each.number))
                        stack.append((each.frames or (), (*calls, call)))
        return tuple(found)

    def waits(self, rest: ProcessState, activity: Span, contracts: Sequence[object] = ()) -> Following:
        """Go on at the next sample, once all scenarios that run side by side have come to it."""
        at = _inside(rest.frames)
        if at < 0:
            return super().waits(rest, activity)
        frame = cast(TogetherFrame, rest.frames[at])
        mine = replace(frame.scenarios[frame.at], frames=rest.frames[at + 1 :], resumes=True)
        scenarios = (*frame.scenarios[: frame.at], mine, *frame.scenarios[frame.at + 1 :])
        return replace(rest, frames=(*rest.frames[:at], replace(frame, scenarios=scenarios, stage="ends")))

    def resume(self, state: ProcessState) -> Following:
        """Go on after a sample; what is asked before what it is about has begun does not hold."""
        try:
            return super().resume(state)
        except ScenarioNotBegunError:
            return replace(state, asked=state.asked + 1)

    def ask_invariants(self, state: ProcessState, number: int | None = None) -> ProcessState:
        """A state in which the invariants of a scenario are asked first, unless it waits for others that it runs."""
        waits = bool(state.frames) and isinstance(state.frames[-1], TogetherFrame)
        return state if number is None and waits and state.resumed < 0 else super().ask_invariants(state, number)

    def switch_block(self, state: ProcessState, at: int, block: int) -> Following:
        """A state in which a block of a `try` runs; whatever a `do` ends, its scenarios end with it."""
        frame = cast(TryFrame, state.frames[at])
        found = super().switch_block(state, at, block)
        if not (frame.ends and block < len(frame.handlers) and block != frame.running):
            return found
        inner = next((each for each in state.frames[at + 1 :] if isinstance(each, TogetherFrame)), None)
        for each in reversed(inner.scenarios if inner is not None else ()):
            found = self._stopped(each.number, found)
        return found

    def _ended(self, state: ProcessState, span: Span) -> Following:
        """What follows where a scenario ends itself."""
        at = _inside(state.frames)
        if at < 0:
            return Terminate(span)
        frame = cast(TogetherFrame, state.frames[at])
        number = frame.scenarios[frame.at].number
        others = (*frame.scenarios[: frame.at], *frame.scenarios[frame.at + 1 :])
        after = replace(state, frames=(*state.frames[:at], replace(frame, scenarios=others, stage="begins")))
        return self._stopped(number, after)

    def _stopped(self, number: int, then: Following) -> Following:
        """End a scenario, and go on; nothing ends of one that says nothing over time."""
        return then if self.scenarios[number].is_silent else Directs(Stop(number, 0), then)

    @staticmethod
    def _losing(state: ProcessState) -> ProcessState:
        """A state in which a scenario runs others: those that it has interrupted are lost."""
        first = _inside(state.frames) + 1
        return replace(state, frames=(*state.frames[:first], *_lost(state.frames[first:])))

    def age_frames(self, frames: tuple[ProcessFrame, ...], place: str, *, first: bool) -> tuple[ProcessFrame, ...]:
        """Frames at the next sample."""
        found: list[ProcessFrame] = []
        for number, frame in enumerate(super().age_frames(frames, place, first=first)):
            if not isinstance(frame, TogetherFrame):
                found.append(frame)
                continue
            scenarios: list[RunningScenario] = []
            for count, each in enumerate(frame.scenarios):
                here = f"{place}{number}.{count}."
                inner = None if each.frames is None else self.age_frames(each.frames, here, first=first)
                scenarios.append(replace(each, frames=inner))
            found.append(replace(frame, scenarios=tuple(scenarios)))
        return tuple(found)


@dataclass(eq=False)
class _Drawing:
    """While something is evaluated what it draws is the scene's.

    Attributes:
        values: Learns of it; None where it is not so.
    """

    values: LocalValues | None
    _first: int = 0

    def __enter__(self) -> None:
        """Begin."""
        self._first = Identity().order

    def __exit__(self, *_: object) -> None:
        """End."""
        if self.values is not None:
            self.values.of_scene.append(range(self._first, Identity().order))


def _inside(frames: Sequence[ProcessFrame]) -> int:
    """The place of the innermost scenarios of which one is led through a sample above; -1 for none."""
    inside = (
        at for at in reversed(range(len(frames)))
        if isinstance(frame := frames[at], TogetherFrame) and frame.stage == "inside"
    )  # fmt: skip
    return next(inside, -1)


def _lost(frames: Sequence[ProcessFrame]) -> tuple[ProcessFrame, ...]:
    """Frames in which nothing runs side by side any more."""

    def lost(frame: ProcessFrame) -> ProcessFrame:
        match frame:
            case TogetherFrame():
                return replace(frame, scenarios=())
            case TryFrame():
                return replace(frame, waiting=tuple((block, _lost(inner)) for block, inner in frame.waiting))
            case _:
                return frame

    return tuple(map(lost, frames))
