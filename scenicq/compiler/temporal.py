"""What a program says about time is collected here: requirements with operators of time, what ends a run, monitors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from scenicq.compiler.coerce import read_over_time
from scenicq.compiler.exclusions import Exclusions
from scenicq.compiler.values import fail
from scenicq.errors import Span
from scenicq.forest.nodes import Constant, Feature, Node
from scenicq.forest.temporal import (
    Always,
    And,
    Atom,
    Dynamics,
    Eventually,
    Formula,
    Monitor,
    MonitorStep,
    Next,
    Not,
    Or,
    Reject,
    TemporalRequirement,
    Termination,
    Test,
    Until,
)
from scenicq.forest.walk import postorder
from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import walk

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["Behaviors", "Deferred", "TimedStatements", "is_temporal"]

Behaviors = Literal["refuse", "ignore"]
"""What becomes of behaviors: they are refused, or left out."""


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
        used: Whether the program has any statement about time: it is a dynamic one.
    """

    behaviors: Behaviors
    used: bool = False
    _conditions: list[Callable[[], Node]] = field(default_factory=list[Callable[[], Node]])
    _requirements: list[TemporalRequirement] = field(default_factory=list[TemporalRequirement])
    _terminations: list[Termination] = field(default_factory=list[Termination])
    _monitors: list[Monitor] = field(default_factory=list[Monitor])

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

    def watch(self, monitor: Monitor) -> None:
        """Add a monitor."""
        self.used = True
        self._monitors.append(monitor)

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
        tested = {step.condition.number for each in self._monitors for step in each.steps if isinstance(step, Test)}
        always, at_test = Exclusions(), {number: Exclusions() for number in tested}
        of_scene = run.excluded
        nodes: list[Node] = []
        with read_over_time():
            for number, condition in enumerate(self._conditions):
                run.excluded = at_test.get(number, always)
                nodes.append(condition())
        run.excluded = of_scene
        for requirement in self._requirements:
            if _known(requirement.formula, nodes) is False:
                raise fail(
                    "impossible-requirement", "no run satisfies this requirement", requirement.span, "always false"
                )
        requirements, excluded = list(self._requirements), list[tuple[Node, Span]]()
        for condition, span in always.conditions():
            if any(isinstance(node, Feature) and node.current for node in postorder([condition])):
                requirements.append(TemporalRequirement(Always(Atom(len(nodes))), span))
                nodes.append(condition)
            else:
                excluded.append((condition, span))
        guards: dict[int, list[tuple[Atom, Span]]] = {}
        for number, exclusions in at_test.items():
            for condition, span in exclusions.conditions():
                guards.setdefault(number, []).append((Atom(len(nodes)), span))
                nodes.append(condition)
        monitors = tuple(_guarded(monitor, guards) for monitor in self._monitors)
        return Dynamics(tuple(nodes), tuple(requirements), tuple(self._terminations), monitors), excluded

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


def _guarded(monitor: Monitor, guards: Mapping[int, list[tuple[Atom, Span]]]) -> Monitor:
    """The monitor, rejecting where it comes to a test whose guards do not hold; guards by number of the condition."""
    steps: list[MonitorStep] = list(monitor.steps)
    for number, step in enumerate(monitor.steps):
        if not isinstance(step, Test):
            continue
        for guard, span in guards.get(step.condition.number, ()):
            steps += [steps[number], Reject(span)]
            steps[number] = Test(guard, len(steps) - 2, len(steps) - 1)
    return Monitor(monitor.span, tuple(steps))


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
