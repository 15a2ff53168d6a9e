"""What a program says about time is collected here: requirements with operators of time, what ends a run, processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from scenicq.compiler.coerce import read_over_time
from scenicq.compiler.coroutines import CoroutineCall, as_behavior
from scenicq.compiler.exclusions import with_exclusions
from scenicq.compiler.process_graph import process_of
from scenicq.compiler.step_times import simulation, step_seconds
from scenicq.compiler.values import Instance, ModelValue, fail
from scenicq.errors import Diagnostic, Span
from scenicq.forest.nodes import Constant, Feature, Node
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
    """

    behaviors: Behaviors
    reaction_s: float = REACTION_S
    used: bool = False
    _conditions: list[Callable[[], Node]] = field(default_factory=list[Callable[[], Node]])
    _requirements: list[TemporalRequirement] = field(default_factory=list[TemporalRequirement])
    _terminations: list[Termination] = field(default_factory=list[Termination])
    _monitors: list[tuple[CoroutineCall, Span]] = field(default_factory=list["tuple[CoroutineCall, Span]"])
    _behaviors: list[tuple[Instance, ModelValue, Span]] = field(
        default_factory=list["tuple[Instance, ModelValue, Span]"]
    )
    actions: dict[str, Span] = field(default_factory=dict[str, Span])

    def require(self, deferred: Deferred, wanted: ast.Expression, span: Span) -> None:
        """Add a requirement with an operator of time."""
        self.used = True
        self._requirements.append(TemporalRequirement(self._formula(deferred, wanted), span))

    def end(
        self, span: Span, *, condition: Callable[[], Node] | None = None, after_s: float | None = None,
        simulation: bool = False,
    ) -> None:  # fmt: skip
        """Add what ends a run."""
        self.used = True
        atom = None if condition is None else self.atom(condition)
        self._terminations.append(Termination(span, atom, after_s, simulation))

    def watch(self, monitor: CoroutineCall, span: Span) -> None:
        """Add a monitor."""
        self.used = True
        self._monitors.append((monitor, span))

    def behave(self, agent: Instance, behavior: ModelValue, span: Span) -> None:
        """Add the behavior of an object, if it is not None."""
        behavior = as_behavior(behavior, span)
        if behavior is not None:
            self.used = True
            self._behaviors.append((agent, behavior, span))

    def atom(self, condition: Callable[[], Node]) -> Atom:
        """A condition on one sample."""
        self._conditions.append(condition)
        return Atom(len(self._conditions) - 1)

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
            nodes, always = with_exclusions(run, lambda: [condition() for condition in self._conditions])
        for requirement in self._requirements:
            if _known(requirement.formula, nodes) is False:
                raise fail(
                    "impossible-requirement", "no run satisfies this requirement", requirement.span, "always false"
                )
        requirements, excluded = list(self._requirements), list[tuple[Node, Span]]()
        for condition, span in always:
            if any(isinstance(node, Feature) and node.current for node in postorder([condition])):
                requirements.append(TemporalRequirement(Always(Atom(len(nodes))), span))
                nodes.append(condition)
            else:
                excluded.append((condition, span))
        processes = self._processes(run, nodes, requirements)
        return Dynamics(tuple(nodes), tuple(requirements), tuple(self._terminations), processes), excluded

    def _processes(
        self, run: Interpreter, nodes: list[Node], requirements: list[TemporalRequirement]
    ) -> tuple[Process, ...]:
        """Monitors and behaviors; what they read is added to the conditions, what they ask for first is required."""
        numbers, known = ValueNumbers(), dict[int, Atom]()

        def atom(node: Node) -> Atom:
            number = numbers.expression(node)
            if number not in known:
                known[number] = Atom(len(nodes))
                nodes.append(node)
            return known[number]

        found: list[Process] = []
        calls = [(None, call, span) for call, span in self._monitors] + self._behaviors
        for number, (agent, call, span) in enumerate(calls):
            reaction_s = self.reaction_s if self.behaviors == "motion" else None
            process, asked = process_of(run, call, number, agent, atom, step_seconds, self.actions, span, reaction_s)
            found.append(process)
            for guards, node, place in asked:
                wanted = [*guards, (node, place)]
                requirements += [TemporalRequirement(atom(each), where) for each, where in wanted]
        for name, place in self.actions.items() if self.behaviors == "motion" else ():
            message = f"what `{name}` does is not compared"
            run.ignored.append(Diagnostic("unseen-action", message, place, severity="note"))
        return tuple(found)

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
