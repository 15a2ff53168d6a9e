"""Monitors that wait, test and terminate: their statements as a graph of steps.

A monitor goes on until it waits, once a sample. What it does in between are tests, so the graph is all there is to say;
variables of its own would make it more, and are refused. A `for` loop, whose items are known, is written out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from scenicq.compiler.environment import Environment
from scenicq.compiler.temporal import TimedStatements
from scenicq.compiler.values import Function, ModelValue, fail
from scenicq.errors import ScenarioError, Span
from scenicq.forest.nodes import Node
from scenicq.forest.temporal import End, Goto, Monitor, MonitorStep, Reject, Terminate, Test, Wait
from scenicq.limits import LIMITS
from scenicq.syntax import ast

__all__ = ["Deferred", "MonitorCall", "MonitorDefinition", "Rounds", "Seconds", "graph_of"]

Deferred = Callable[[ast.Expression, Environment], Callable[[], Node]]
"""Gives what computes a condition over some names once the whole program has run."""
Rounds = Callable[[ast.For, Environment], list[Environment]]
"""The names in each round of a loop."""
Seconds = Callable[[ast.DynamicStatement, Environment], float]
"""The time that a statement names, in seconds."""


@dataclass(frozen=True, slots=True, eq=False)
class MonitorDefinition(Function):
    """A monitor of the program: a call of it is only required."""


@dataclass(frozen=True, slots=True, eq=False)
class MonitorCall:
    """A call of a monitor, which `require monitor` runs.

    Attributes:
        monitor: The monitor.
        given: Values of its parameters.
    """

    monitor: MonitorDefinition
    given: Mapping[str, ModelValue]


@dataclass(slots=True)
class _Loop:
    """Where `break` and `continue` lead."""

    after: int
    again: int


@dataclass(slots=True)
class _Graph:
    timed: TimedStatements
    deferred: Deferred
    rounds: Rounds
    seconds: Seconds
    steps: list[MonitorStep] = field(default_factory=list[MonitorStep])

    def add(self, step: MonitorStep) -> int:
        """Add a step; its number."""
        self.steps.append(step)
        return len(self.steps) - 1

    def test(self, condition: ast.Expression, then: int, otherwise: int, scope: Environment) -> int:
        """Add a test, or nothing where the condition is `True` or `False` in the text."""
        if isinstance(condition, ast.LiteralValue) and isinstance(condition.value, bool):
            return then if condition.value else otherwise
        return self.add(Test(self.timed.atom(self.deferred(condition, scope)), then, otherwise))

    def block(self, body: tuple[ast.Statement, ...], then: int, loop: _Loop | None, scope: Environment) -> int:
        """Add statements after which a step follows; the number of their first step."""
        for statement in reversed(body):
            then = self.statement(statement, then, loop, scope)
        return then

    def statement(self, node: ast.Statement, then: int, loop: _Loop | None, scope: Environment) -> int:
        """Add a statement after which a step follows; the number of its first step."""
        if len(self.steps) > LIMITS.monitor_steps:
            raise fail("budget-exceeded", f"the monitor takes more than {LIMITS.monitor_steps:,} steps", node.span,
                       "the budget ends here", ("make loops shorter",))  # fmt: skip
        match node:
            case ast.Pass() | ast.ExpressionStatement(value=ast.LiteralValue()):
                return then
            case ast.DynamicStatement(kind="wait"):
                return self.add(Wait(then))
            case ast.DynamicStatement(kind="wait for"):
                time_s = self.seconds(node, scope)
                return self.add(Wait(then, time_s)) if time_s > 0 else then
            case ast.DynamicStatement(kind="wait until") if node.operand is not None:
                head = self.add(End())
                self.steps[head] = Goto(self.test(node.operand, then, self.add(Wait(head)), scope))
                return head
            case ast.DynamicStatement(kind="terminate"):
                return self.add(Terminate(node.span))
            case ast.DynamicStatement(kind="terminate simulation", operand=None):
                return self.add(Terminate(node.span))
            case ast.Require(probability=None):
                return self.test(node.condition, then, self.add(Reject(node.span)), scope)
            case ast.If():
                first = self.block(node.orelse, then, loop, scope)
                for branch in reversed(node.branches):
                    first = self.test(branch.test, self.block(branch.body, then, loop, scope), first, scope)
                return first
            case ast.While():
                head = self.add(End())
                body = self.block(node.body, head, _Loop(then, head), scope)
                self.steps[head] = Goto(self.test(node.test, body, self.block(node.orelse, then, loop, scope), scope))
                return head
            case ast.For():
                first = self.block(node.orelse, then, loop, scope)
                for names in reversed(self.rounds(node, scope)):
                    first = self.block(node.body, first, _Loop(then, first), names)
                return first
            case ast.Break() if loop is not None:
                return loop.after
            case ast.Continue() if loop is not None:
                return loop.again
            case ast.Return(value=None):
                return self.add(End())
            case _:
                raise _refused(node.span)


def graph_of(
    timed: TimedStatements, body: tuple[ast.Statement, ...], scope: Environment, deferred: Deferred, rounds: Rounds,
    seconds: Seconds, span: Span,
) -> Monitor:  # fmt: skip
    """The graph of a monitor.

    Args:
        timed: Takes its conditions.
        body: Its statements.
        scope: The names at its beginning.
        deferred: Gives what computes a condition later on.
        rounds: The names in each round of a loop.
        seconds: The time that a `wait for` names.
        span: Where the program requires it.

    Raises:
        ScenarioError: unsupported-construct, for what does more than wait, test and terminate; runtime-error for a loop
            that never waits; budget-exceeded.
    """
    graph = _Graph(timed, deferred, rounds, seconds)
    first = graph.add(Goto(0))
    graph.steps[first] = Goto(graph.block(body, graph.add(End()), None, scope))
    if _spins(graph.steps):
        raise fail("runtime-error", "the monitor has a loop that never waits", span, "never gets to the next sample",
                   ("write `wait` in the loop",))  # fmt: skip
    return Monitor(span, tuple(graph.steps))


def _refused(span: Span) -> ScenarioError:
    word = span.text.split()[0].rstrip(":")
    return fail("unsupported-construct", f"`{word}` in a monitor is not supported", span,
                "does more than wait, test and terminate",
                ("a monitor may hold `if`, `while`, `for`, `wait`, `require` and `terminate`",))  # fmt: skip


def _spins(steps: list[MonitorStep]) -> bool:
    """Whether some steps lead to each other without a `Wait`."""
    waiting = [0] * len(steps)
    after: list[tuple[int, ...]] = []
    for step in steps:
        match step:
            case Test():
                after.append((step.then, step.otherwise))
            case Goto():
                after.append((step.then,))
            case _:
                after.append(())
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
