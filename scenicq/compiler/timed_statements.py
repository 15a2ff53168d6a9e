"""Statements about time where a program is matched over time: each is read, left out with a remark, or refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, cast

from scenicq.compiler.assignment import assign
from scenicq.compiler.courses import without_courses
from scenicq.compiler.environment import Environment
from scenicq.compiler.items import items_of
from scenicq.compiler.monitors import MonitorCall, MonitorDefinition, graph_of
from scenicq.compiler.requirements import defer
from scenicq.compiler.temporal import TimedStatements
from scenicq.compiler.values import describe, fail
from scenicq.errors import Diagnostic, Span
from scenicq.forest.nodes import Node
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["leave_out", "timed_statement"]

_OF_BEHAVIORS = frozenset(
    ("behavior", "with behavior", "do", "do choose", "do shuffle", "take", "wait", "wait for", "wait until", "abort",
     "invoke", "override", "try/interrupt", "precondition", "invariant")
)  # fmt: skip
_MODULAR = frozenset(("scenario", "setup", "compose", "override"))
_SILENT = frozenset(("simulator", "initial scenario"))
"""What says nothing about whether a recording matches."""
_STEP_S = 0.1
"""Seconds of a step, where the program sets no `time_step`."""


def timed_statement(
    run: Interpreter, timed: TimedStatements, node: ast.DynamicStatement | ast.DynamicDefinition | ast.RequireMonitor,
    scope: Environment,
) -> None:  # fmt: skip
    """Read a statement about time.

    Raises:
        ScenarioError: unsupported-construct, for what cannot be matched over time; whatever else is wrong with it.
    """
    match node:
        case ast.DynamicDefinition(kind="monitor"):
            monitor = MonitorDefinition(
                node.name,
                node.parameters,
                {p.name: run.evaluate(p.default, scope) for p in node.parameters if p.default is not None},
                node.body,
                scope,
                node.span,
            )
            scope.set(node.name, monitor)
            if run.version < 3:  # there, a monitor that is defined is required
                _watch(run, timed, MonitorCall(monitor, monitor.defaults), node.span)
        case ast.RequireMonitor():
            value = run.evaluate(node.monitor, scope)
            if isinstance(value, MonitorDefinition):
                raise fail("wrong-type", "a monitor is called", node.monitor.span, "not called",
                           (f"write `require monitor {value.name}()`",))  # fmt: skip
            if not isinstance(value, MonitorCall):
                raise fail("wrong-type", "this is no monitor", node.monitor.span, f"this is {describe(value)}")
            _watch(run, timed, value, node.span)
        case ast.DynamicStatement(kind="terminate when" | "terminate simulation") if node.operand is not None:
            simulation = node.kind == "terminate simulation"
            timed.end(node.span, condition=defer(run, node.operand, scope, node.span), simulation=simulation)
        case ast.DynamicStatement(kind="terminate after"):
            timed.end(node.span, after_s=_seconds(run, node, scope))
        case _:
            leave_out(timed, run.ignored, node.kind, node.span)
            if isinstance(node, ast.DynamicDefinition) and node.name:
                scope.set(node.name, None)


def leave_out(timed: TimedStatements, ignored: list[Diagnostic], kind: str, span: Span) -> None:
    """Leave out what is no part of a match over time, or refuse it.

    Raises:
        ScenarioError: unsupported-construct.
    """
    if kind in _SILENT:
        return
    timed.used = True
    if kind in _MODULAR:
        raise fail("unsupported-construct", f"`{kind}` is not supported", span, "a scenario made of others",
                   ("write the objects at the top level",
                    "`--initial` matches the initial scene of what stands there"))  # fmt: skip
    is_import = kind.startswith("import of ")
    if kind not in _OF_BEHAVIORS and not is_import:
        raise fail("unsupported-construct", f"`{kind}` cannot stand here", span, "no statement of a top level")
    if timed.behaviors == "refuse":
        raise fail("unsupported-construct", f"`{kind}` is not supported", span, "what an object does over time",
                   ("`--behaviors ignore` leaves behaviors out and matches the rest over time",
                    "`--initial` matches the initial scene"))  # fmt: skip
    message = f"`{kind}` is not matched"
    ignored.append(Diagnostic("unsupported-construct", message, span, "left out", severity="warning"))


def _watch(run: Interpreter, timed: TimedStatements, call: MonitorCall, span: Span) -> None:
    """Require a monitor with values of its parameters."""
    scope = Environment(dict(call.given), cast(Environment, call.monitor.environment))
    body = cast("tuple[ast.Statement, ...]", call.monitor.body)

    def rounds(node: ast.For, around: Environment) -> list[Environment]:
        inner: list[Environment] = []
        with without_courses(run):
            items = items_of(run, run.evaluate(node.iterable, around), node.iterable.span)
        for item in items:
            run.budget.step(node.span)
            inner.append(Environment({}, around))
            assign(run, node.target, item, inner[-1])
        return inner

    def conditions(wanted: ast.Expression, names: Environment) -> Callable[[], Node]:
        return defer(run, wanted, names, span)

    def seconds(node: ast.DynamicStatement, names: Environment) -> float:
        return _seconds(run, node, names)

    timed.watch(graph_of(timed, body, scope, conditions, rounds, seconds, span))


def _seconds(run: Interpreter, node: ast.DynamicStatement, scope: Environment) -> float:
    """The time of `terminate after` or `wait for`, in seconds."""
    assert node.operand is not None
    value = run.evaluate(node.operand, scope)
    if isinstance(value, bool) or not isinstance(value, int | float) or value < 0:
        raise fail("wrong-value", "this must be a known number that is not negative", node.operand.span)
    if node.unit == "seconds":
        return float(value)
    step = run.params.get("time_step") or run.params.get("timestep")
    if step is None:
        return value * _STEP_S
    if isinstance(step[0], bool) or not isinstance(step[0], int | float) or step[0] <= 0:
        raise fail("wrong-value", "`time_step` must be a known positive number", step[1])
    return value * float(step[0])
