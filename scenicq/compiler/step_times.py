"""Times that a program names, in seconds: of a step, its `time_step` says how long it takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenicq.compiler.environment import Environment
from scenicq.compiler.values import Builtin, Module, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import CLOCK, ArithmeticOp, Feature
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["simulation", "step_s", "step_seconds"]

_STEP_S = 0.1
"""Seconds of a step, where the program sets no `time_step`."""


def step_seconds(run: Interpreter, node: ast.Expression, unit: str, scope: Environment) -> float:
    """The time of `terminate after`, `wait for` or `do ... for`, in seconds.

    Args:
        run: The interpreter.
        node: The number.
        unit: "seconds" or "steps".
        scope: The names that it sees.

    Raises:
        ScenarioError: wrong-value.
    """
    value = run.evaluate(node, scope)
    if isinstance(value, bool) or not isinstance(value, int | float) or value < 0:
        raise fail("wrong-value", "this must be a known number that is not negative", node.span)
    return float(value) if unit == "seconds" else value * step_s(run)


def simulation(run: Interpreter) -> Builtin:
    """`simulation`: what programs ask of it are its objects and the number of steps that it has taken."""

    def called(span: Span) -> Module:
        ego = 0 if run.current_ego is None else run.current_ego.index or 0
        seconds = build.minus(
            Feature(ego, CLOCK, "scalar", current=True, span=span), Feature(ego, CLOCK, "scalar", span=span)
        )
        step = build.constant(step_s(run))
        # what floating point lacks of a step is one
        steps = build.add(build.arithmetic(ArithmeticOp.DIV, seconds, step), build.constant(1e-6))
        known = {
            "currentTime": build.arithmetic(ArithmeticOp.FLOOR, steps), "timestep": step_s(run),
            "objects": list(run.objects),
        }  # fmt: skip
        return Module("simulation", known)

    return Builtin("simulation", called)


def step_s(run: Interpreter) -> float:
    """The seconds of a step.

    Raises:
        ScenarioError: wrong-value, of the program's `time_step`.
    """
    step = run.params.get("time_step") or run.params.get("timestep")
    if step is None:
        return _STEP_S
    value, span = step[0], step[1]
    if isinstance(value, bool) or not isinstance(value, int | float) or value <= 0:
        raise fail("wrong-value", "`time_step` must be a known positive number", span)
    return float(value)
