"""Statements about time where a program is matched over time: each is read, left out with a remark, or refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenicq.compiler.coroutines import BehaviorDefinition, CoroutineCall, MonitorDefinition
from scenicq.compiler.environment import Environment
from scenicq.compiler.requirements import defer
from scenicq.compiler.step_times import step_seconds
from scenicq.compiler.temporal import TimedStatements
from scenicq.compiler.values import ModelValue, describe, fail
from scenicq.errors import Diagnostic, Span
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["leave_out", "timed_statement"]

_OF_BEHAVIORS = frozenset(
    ("behavior", "with behavior", "do", "do choose", "do shuffle", "take", "wait", "wait for", "wait until", "abort",
     "invoke", "override", "try/interrupt", "precondition", "invariant")
)  # fmt: skip
_SILENT = frozenset(("simulator", "initial scenario"))
"""What says nothing about whether a recording matches."""


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
                node.name, node.parameters, _defaults(run, node, scope), node.body, scope, node.span
            )
            scope.set(node.name, monitor)
            if run.version < 3:  # there, a monitor that is defined is required
                timed.watch(CoroutineCall(monitor, monitor.defaults, node.span), node.span)
        case ast.DynamicDefinition(kind="behavior") if timed.behaviors != "ignore":
            behavior = BehaviorDefinition(
                node.name, node.parameters, _defaults(run, node, scope), node.body, scope, node.span
            )
            scope.set(node.name, behavior)
        case ast.RequireMonitor():
            value = run.evaluate(node.monitor, scope)
            if isinstance(value, MonitorDefinition):
                raise fail("wrong-type", "a monitor is called", node.monitor.span, "not called",
                           (f"write `require monitor {value.name}()`",))  # fmt: skip
            if not isinstance(value, CoroutineCall) or not isinstance(value.of, MonitorDefinition):
                raise fail("wrong-type", "this is no monitor", node.monitor.span, f"this is {describe(value)}")
            timed.watch(value, node.span)
        case ast.DynamicStatement(kind="terminate when" | "terminate simulation") if node.operand is not None:
            simulation = node.kind == "terminate simulation"
            timed.end(node.span, condition=defer(run, node.operand, scope, node.span), simulation=simulation)
        case ast.DynamicStatement(kind="terminate after"):
            assert node.operand is not None
            timed.end(node.span, after_s=step_seconds(run, node.operand, node.unit, scope))
        case _:
            leave_out(timed, run.ignored, node.kind, node.span)
            if isinstance(node, ast.DynamicDefinition) and node.name:
                scope.set(node.name, None)


def _defaults(run: Interpreter, node: ast.DynamicDefinition, scope: Environment) -> dict[str, ModelValue]:
    """The values of parameters that have one."""
    return {each.name: run.evaluate(each.default, scope) for each in node.parameters if each.default is not None}


def leave_out(timed: TimedStatements, ignored: list[Diagnostic], kind: str, span: Span) -> None:
    """Leave out what is no part of a match over time, or refuse it.

    Raises:
        ScenarioError: unsupported-construct.
    """
    if kind in _SILENT:
        return
    timed.used = True
    is_import = kind.startswith("import of ")
    if kind not in _OF_BEHAVIORS and not is_import:
        raise fail("unsupported-construct", f"`{kind}` cannot stand here", span, "not a statement of the top level")
    if timed.behaviors != "ignore":
        if is_import:
            return
        raise fail("unsupported-construct", f"`{kind}` cannot stand here", span, "a statement of behaviors")
    message = f"`{kind}` is not matched"
    ignored.append(Diagnostic("unsupported-construct", message, span, "left out", severity="warning"))
