"""What a program says about time is collected here: requirements with operators of time, what ends a run, processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, cast

from scenicq.compiler.coerce import read_over_time
from scenicq.compiler.composition_graph import Composition, CompositionGraph
from scenicq.compiler.coroutines import CoroutineCall, ScenarioDefinition, as_behavior
from scenicq.compiler.environment import Environment
from scenicq.compiler.exclusions import collect_exclusions
from scenicq.compiler.local_values import LocalValues
from scenicq.compiler.process_graph import process_of
from scenicq.compiler.process_states import GraphGuards
from scenicq.compiler.step_times import simulation, step_seconds
from scenicq.compiler.values import Instance, ModelValue, fail
from scenicq.errors import Diagnostic, Note, Source, Span
from scenicq.forest.nodes import Constant, Feature, Identity, Node
from scenicq.forest.temporal import (
    Always,
    And,
    Atom,
    Dynamics,
    Eventually,
    Formula,
    Next,
    Not,
    Or,
    Process,
    PutBehavior,
    SubScenario,
    TemporalRequirement,
    Termination,
    Until,
)
from scenicq.forest.value_numbers import ValueNumbers
from scenicq.forest.walk import postorder
from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import walk

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["REACTION_S", "Behaviors", "Deferred", "TimedStatements", "is_temporal"]

REACTION_S = 1.0
"""Seconds after which what an object does must be seen, unless it is said."""
Behaviors = Literal["motion", "guards", "ignore"]
"""What becomes of behaviors: what they do must be seen, too; they run, and let every action pass; they are left out."""


_NO_PROCESS = Process(Span(Source("", ""), 0, 0), ())
"""What stands for a process that is being followed."""


def _implication(left: Formula, right: Formula) -> Formula:
    return Or((Not(left), right))


_OPERATORS: dict[phrases.PhraseRow, Callable[..., Formula]] = phrases.each_meaning(
    (*phrases.TEMPORAL, phrases.IMPLICATION),
    {
        "always {condition}": Always,
        "eventually {condition}": Eventually,
        "next {condition}": Next,
        "{left} until {right}": Until,
        "{left} implies {right}": _implication,
    },
)

Deferred = Callable[[ast.Expression], Callable[[], Node]]
"""Gives what computes a condition once the whole program has run, over the names that it has now."""


def is_temporal(node: ast.Expression) -> bool:
    """Whether an expression has an operator of time."""
    return any(ast.is_phrase(each, *phrases.TEMPORAL) for each in walk(node))


@dataclass(eq=False)
class TimedStatements:
    """The statements about time of a program that is matched over time.

    Attributes:
        behaviors: What becomes of behaviors.
        reaction_s: Seconds after which what an object does must be seen.
        used: Whether the program has any statement about time: it is a dynamic one.
        actions: The actions of behaviors that constrain nothing, each with its first place.
        conditions: What computes the conditions on one sample.
        requirements: Requirements with operators of time.
        terminations: What ends a run.
        monitors: Monitors that are required.
        agents: Objects with their behaviors.
        overrides: Objects whose behavior is another one.
        composition: What composes scenarios, once it has been followed.
    """

    behaviors: Behaviors
    reaction_s: float = REACTION_S
    used: bool = False
    actions: dict[str, Span] = field(default_factory=dict[str, Span])
    conditions: list[Callable[[], Node]] = field(default_factory=list[Callable[[], Node]])
    requirements: list[TemporalRequirement] = field(default_factory=list[TemporalRequirement])
    terminations: list[Termination] = field(default_factory=list[Termination])
    monitors: list[tuple[CoroutineCall, Span]] = field(default_factory=list["tuple[CoroutineCall, Span]"])
    agents: list[tuple[Instance, ModelValue, Span]] = field(default_factory=list["tuple[Instance, ModelValue, Span]"])
    overrides: list[tuple[Instance, ModelValue, Span]] = field(
        default_factory=list["tuple[Instance, ModelValue, Span]"]
    )
    composition: Composition | None = None
    _top: tuple[CoroutineCall, Environment] | None = None
    _nodes: list[Node] = field(default_factory=list[Node])
    _processes: list[Process] = field(default_factory=list[Process])
    _numbers: ValueNumbers = field(default_factory=ValueNumbers)
    _known: dict[int, Atom] = field(default_factory=dict[int, Atom])

    def require(self, deferred: Deferred, wanted: ast.Expression, span: Span) -> None:
        """Add a requirement with an operator of time."""
        self.used = True
        self.requirements.append(TemporalRequirement(self._formula(deferred, wanted), span))

    def end(
        self, span: Span, *, condition: Callable[[], Node] | None = None, after_s: float | None = None,
        simulation: bool = False,
    ) -> None:  # fmt: skip
        """Add what ends a run."""
        self.used = True
        atom = None if condition is None else self.atom(condition)
        self.terminations.append(Termination(span, atom, after_s, simulation))

    def watch(self, monitor: CoroutineCall, span: Span) -> None:
        """Add a monitor."""
        self.used = True
        self.monitors.append((monitor, span))

    def behave(self, agent: Instance, behavior: ModelValue, span: Span) -> None:
        """Add the behavior of an object, if it is not None."""
        behavior = as_behavior(behavior, span)
        if behavior is not None:
            self.used = True
            self.agents.append((agent, behavior, span))

    def atom(self, condition: Callable[[], Node]) -> Atom:
        """A condition on one sample."""
        self.conditions.append(condition)
        return Atom(len(self.conditions) - 1)

    def for_inner_run(self) -> TimedStatements:
        """What takes what a scenario says that begins within a run."""
        return TimedStatements(self.behaviors, self.reaction_s, actions=self.actions)

    def override(self, instance: Instance, behavior: ModelValue, span: Span) -> None:
        """Put another behavior for that of an object."""
        self.used = True
        self.overrides.append((instance, as_behavior(behavior, span), span))

    def enter(self, span: Span, ignored: list[Diagnostic]) -> None:
        """Leave out what counts only where the program itself runs, and no scenario of it: as Scenic does."""
        left = [each.span for each in self.terminations] + [place for _, place in self.monitors]
        for place in left:
            message = "this does not count: a scenario of the program runs"
            notes, hints = (Note(span, "this runs"),), ("write it in this scenario",)
            told = Diagnostic(
                "unsupported-construct", message, place, "outside of the scenario", notes, hints, "warning"
            )
            ignored.append(told)
        self.terminations, self.monitors = [], []

    def compose(self, call: CoroutineCall, scope: Environment) -> None:
        """Take the scenario that the program runs, once it has been set up."""
        definition = cast(ScenarioDefinition, call.of)
        if definition.compose is not None or definition.guards("precondition", "invariant"):
            self.used = True
            self._top = call, scope

    def follow(self, run: Interpreter) -> None:
        """Follow what composes scenarios, once the program has run: what these make are objects of the scenario, too.

        Raises:
            ScenarioError: What is wrong with it; see `process_of`.
        """
        if self._top is None:
            return
        run.simulation = simulation(run)
        call, scope = self._top
        values = LocalValues(-1, Identity().order, run.lookups.ranks)
        reaction_s = self.reaction_s if self.behaviors == "motion" else None

        def adds(
            what: ModelValue, agent: Instance | None, span: Span, scenario: int, overrides: bool
        ) -> tuple[int, Sequence[tuple[GraphGuards, Node, Span]]]:
            number = len(self._processes)
            self._processes.append(_NO_PROCESS)
            owner = next((each.number for each in graph.scenarios if agent in each.objects), -1)
            own = LocalValues(number, values.drawn_after, run.lookups.ranks, values.of_scene)
            process, asked = process_of(
                run, as_behavior(what, span), number, agent, self._atom, step_seconds, self.actions, span, reaction_s,
                values=own, scenario=owner if agent is not None else scenario,
            )  # fmt: skip
            self._processes[number] = replace(process, overrides=overrides)
            return number, asked

        definition = cast(ScenarioDefinition, call.of)
        graph = CompositionGraph(
            run, self._atom, None, values, step_seconds, {}, call.span, self.actions, None, top=call, adds=adds,
            has_setup=bool(definition.setup),
        )  # fmt: skip
        self.composition = graph.composition(scope.names)
        if run.current_ego is None:
            run.current_ego = next((each.made.ego for each in graph.scenarios if each.made.ego is not None), None)

    def _atom(self, node: Node) -> Atom:
        """The number of a condition that a process reads; those of requirements and ends come before."""
        number = self._numbers.expression(node)
        if number not in self._known:
            self._known[number] = Atom(len(self.conditions) + len(self._nodes))
            self._nodes.append(node)
        return self._known[number]

    def dynamics(self, run: Interpreter) -> tuple[Dynamics | None, list[tuple[Node, Span]]]:
        """What has been collected, None for a static program; and what of it excludes scenes, whatever the sample.

        Where a condition asks for something that is not there, Scenic rejects the run when it reads the condition:
        that of a requirement or a termination at each sample, that of a monitor where the monitor comes to it.

        Raises:
            ScenarioError: impossible-requirement, where no run satisfies one.
        """
        if not self.used:
            return None, []
        run.simulation = simulation(run)
        with read_over_time():
            nodes, always = collect_exclusions(run, lambda: [condition() for condition in self.conditions])
        for requirement in self.requirements:
            if _known(requirement.formula, nodes) is False:
                raise fail(
                    "impossible-requirement", "no run satisfies this requirement", requirement.span, "always false"
                )
        requirements, excluded = list(self.requirements), list[tuple[Node, Span]]()
        for condition, span in always:
            if any(isinstance(node, Feature) and node.current for node in postorder([condition])):
                requirements.append(TemporalRequirement(Always(self._atom(condition)), span))
            else:
                excluded.append((condition, span))
        self._follow_processes(run, requirements)
        processes, scenarios = self._in_order()
        conditions = (*nodes, *self._nodes)
        # as with a monitor's `terminate`, what the program's own values rule out is no end
        ends = tuple(e for e in self.terminations if e.condition is None or _known(e.condition, nodes) is not False)
        dynamics = Dynamics(conditions, tuple(requirements), ends, processes, scenarios)
        return dynamics, excluded

    def _follow_processes(self, run: Interpreter, requirements: list[TemporalRequirement]) -> None:
        """Follow the program's own monitors and behaviors; what they ask for first is required."""
        overridden = {id(instance) for instance, _, _ in self.overrides}
        agents = [each for each in self.agents if id(each[0]) not in overridden]
        agents += [each for each in self.overrides if each[1] is not None]
        for agent, call, span in [*((None, call, span) for call, span in self.monitors), *agents]:
            reaction_s = self.reaction_s if self.behaviors == "motion" else None
            process, asked = process_of(
                run, call, len(self._processes), agent, self._atom, step_seconds, self.actions, span, reaction_s
            )
            self._processes.append(process)
            for guards, node, place in asked:
                wanted = [*guards, (node, place)]
                requirements += [TemporalRequirement(self._atom(each), where) for each, where in wanted]
        for name, place in self.actions.items() if self.behaviors == "motion" else ():
            message = f"what `{name}` does is not compared"
            run.ignored.append(Diagnostic("unseen-action", message, place, severity="note"))

    def _in_order(self) -> tuple[tuple[Process, ...], tuple[SubScenario, ...]]:
        """The processes in the order in which they run, and the scenarios that begin within a run."""
        composition = self.composition
        if composition is None:
            return tuple(self._processes), ()
        # monitors, then behaviors by when their objects are made
        order = sorted(
            range(len(self._processes)),
            key=lambda number: -1 if (owner := self._processes[number].object) is None else owner,
        )
        places = {number: place for place, number in enumerate(order, 1)} | {-1: -1}

        def placed(process: Process) -> Process:
            steps = tuple(
                replace(step, process=places[step.process]) if isinstance(step, PutBehavior) else step
                for step in process.steps
            )
            return replace(process, steps=steps)

        scenarios = tuple(
            replace(each, processes=tuple(places[number] for number in each.processes))
            for each in composition.as_scenarios()
        )
        return (placed(composition.process), *(placed(self._processes[number]) for number in order)), scenarios

    def _formula(self, deferred: Deferred, node: ast.Expression) -> Formula:
        if not is_temporal(node):
            return self.atom(deferred(node))
        match node:
            case ast.Phrase() if node.row in _OPERATORS:
                return _OPERATORS[node.row](*(self._formula(deferred, part) for part in node.given))
            case ast.UnaryOp(operator="not"):
                return Not(self._formula(deferred, node.operand))
            case ast.BoolOp():
                parts = tuple(self._formula(deferred, part) for part in node.values)
                return And(parts) if node.operator == "and" else Or(parts)
            case _:
                # evaluating it says what is wrong with an operator of time inside
                return self.atom(deferred(node))


def _known(formula: Formula, nodes: Sequence[Node]) -> bool | None:
    """What a formula is whatever the run, where its constant atoms tell; None where they do not."""
    match formula:
        case Atom():
            node = nodes[formula.number]
            return None if not isinstance(node, Constant) else node.value is True
        case Not():
            value = _known(formula.operand, nodes)
            return None if value is None else not value
        case And() | Or():
            values = [_known(part, nodes) for part in formula.operands]
            decisive = isinstance(formula, Or)
            return decisive if decisive in values else None if None in values else not decisive
        case Always() | Eventually():
            return _known(formula.operand, nodes)
        case Next():
            # there may be no next sample
            return False if _known(formula.operand, nodes) is False else None
        case Until():
            return _known(formula.right, nodes)
