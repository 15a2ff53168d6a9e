"""What a program says about time is collected here: requirements with operators of time, what ends a run, monitors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from scenicq.compiler.coerce import read_over_time
from scenicq.errors import Diagnostic, Span
from scenicq.forest.nodes import Node
from scenicq.forest.temporal import (
    Always,
    And,
    Atom,
    Dynamics,
    Eventually,
    Formula,
    Monitor,
    Next,
    Not,
    Or,
    TemporalRequirement,
    Termination,
    Until,
)
from scenicq.syntax import ast
from scenicq.syntax.walk import walk

__all__ = ["Behaviors", "Deferred", "TimedStatements", "is_temporal"]

Behaviors = Literal["refuse", "ignore"]
"""What becomes of behaviors: they are refused, or left out."""

Deferred = Callable[[ast.Expression], Callable[[], Node]]
"""Gives what computes a condition once the whole program has run, over the names that it has now."""


def is_temporal(node: ast.Expression) -> bool:
    """Whether an expression has an operator of time."""
    return any(isinstance(each, ast.Temporal | ast.UntilOperator) for each in walk(node))


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
    _soft: list[Span] = field(default_factory=list[Span])

    def require(self, deferred: Deferred, wanted: ast.Expression, span: Span, probability: float) -> None:
        """Add a requirement with an operator of time; one that may be broken excludes nothing."""
        self.used = True
        if probability < 1:
            self._soft.append(span)
        else:
            self._requirements.append(TemporalRequirement(self._formula(deferred, wanted), span))

    def end(self, span: Span, *, condition: Callable[[], Node] | None = None, after_s: float | None = None) -> None:
        """Add what ends a run."""
        self.used = True
        self._terminations.append(Termination(span, None if condition is None else self.atom(condition), after_s))

    def watch(self, monitor: Monitor) -> None:
        """Add a monitor."""
        self.used = True
        self._monitors.append(monitor)

    def atom(self, condition: Callable[[], Node]) -> Atom:
        """A condition on one sample."""
        self._conditions.append(condition)
        return Atom(len(self._conditions) - 1)

    def dynamics(self) -> Dynamics | None:
        """What has been collected; None for a static program."""
        if not self.used:
            return None
        with read_over_time():
            conditions = tuple(condition() for condition in self._conditions)
        return Dynamics(
            conditions,
            tuple(self._requirements),
            tuple(self._terminations),
            tuple(self._monitors),
        )

    def remarks(self) -> list[Diagnostic]:
        """What the author should know."""
        hint = "a run that breaks it is still possible: write `require` for what must hold"
        return [
            Diagnostic("soft-requirement", "this requirement excludes nothing", span, "holds only with a probability",
                       hints=(hint,), severity="warning")
            for span in self._soft
        ]  # fmt: skip

    def _formula(self, deferred: Deferred, node: ast.Expression) -> Formula:
        if not is_temporal(node):
            return self.atom(deferred(node))
        match node:
            case ast.Temporal():
                operator = {"always": Always, "eventually": Eventually, "next": Next}[node.operator]
                return operator(self._formula(deferred, node.operand))
            case ast.UntilOperator():
                return Until(self._formula(deferred, node.left), self._formula(deferred, node.right))
            case ast.Implies():
                return Or((Not(self._formula(deferred, node.left)), self._formula(deferred, node.right)))
            case ast.UnaryOp(operator="not"):
                return Not(self._formula(deferred, node.operand))
            case ast.BoolOp():
                parts = tuple(self._formula(deferred, part) for part in node.values)
                return And(parts) if node.operator == "and" else Or(parts)
            case _:
                # evaluating it says what is wrong with an operator of time inside
                return self.atom(deferred(node))
