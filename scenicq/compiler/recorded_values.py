"""`record`: values that results carry; they say nothing about whether a label matches.

What cannot be recorded is left out with a warning, as it changes no match.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, cast

from scenicq.compiler.coerce import kind_of_model, read_over_time, to_node
from scenicq.compiler.courses import split_by_course
from scenicq.compiler.environment import Environment
from scenicq.compiler.exclusions import collect_exclusions
from scenicq.compiler.requirements import defer_value
from scenicq.compiler.values import DelayedValue, ModelValue, describe, fail
from scenicq.errors import Diagnostic, ScenarioError, Span, printable
from scenicq.forest import build
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Constant, LogicOp, Node, Select, Undefined
from scenicq.forest.scenario import RecordedValue
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["RecordStatement", "record_statement", "recorded_values"]

_WHEN: dict[str, Literal["always", "initial", "final"]] = {
    "record": "always", "record initial": "initial", "record final": "final",
}  # fmt: skip
_RECORDED = ("scalar", "boolean", "vector")
_LACKING = Undefined("the program asks for what is not there")


@dataclass(frozen=True, slots=True, eq=False)
class RecordStatement:
    """A `record` statement.

    Attributes:
        name: What its value is called.
        when: Which samples of an interval give the value.
        value: Computes it once the whole program has run.
        span: The statement.
    """

    name: str
    when: Literal["always", "initial", "final"]
    value: Callable[[], Node]
    span: Span


def record_statement(run: Interpreter, node: ast.DynamicStatement, scope: Environment) -> None:
    """Keep what a `record` statement says; a value of the same name is replaced, as in Scenic.

    Raises:
        ScenarioError: budget-exceeded.
    """
    assert node.operand is not None
    line, _ = node.span.source.position(node.span.start)
    name = printable(node.name) or f"record{line}"
    for word in node.manners:
        run.ignored.append(_warning(f"`{word}` of `record` is left out", node.span,
                                    "the value at each sample is recorded, in the results"))  # fmt: skip
    if any(each.name == name for each in run.records):
        run.ignored.append(_warning(f"two values are recorded as `{name}`", node.span,
                                    "this one is in the results"))  # fmt: skip
        run.records = [each for each in run.records if each.name != name]
    operand, evaluated = node.operand, defer_value(run, node.operand, scope, node.span)

    def value() -> Node:
        return split_by_course(run, lambda: _as_recorded(evaluated(), operand.span), operand.span)

    run.records.append(RecordStatement(name, _WHEN[node.kind], value, node.span))


def _as_recorded(value: ModelValue, span: Span) -> Node:
    """A value as one that a result can carry.

    Raises:
        ScenarioError: wrong-type.
    """
    kind = None if isinstance(value, DelayedValue) else kind_of_model(value)
    if value is None or (kind not in _RECORDED and kind != "other" and not _is_vector(value)):
        raise fail("wrong-type", "this cannot be recorded", span, f"this is {describe(value)}",
                   ("a number, truth value, vector or text can be",))  # fmt: skip
    return to_node(value, span)


def _is_vector(value: ModelValue) -> bool:
    return isinstance(value, tuple | list) and len(cast("tuple[ModelValue, ...]", value)) in (2, 3)


def recorded_values(run: Interpreter) -> tuple[RecordedValue, ...]:
    """What the program records, once it has run; warnings say what of it cannot be."""
    found: list[RecordedValue] = []
    for each in run.records:
        try:
            with read_over_time():
                value, excluded = collect_exclusions(run, each.value)
        except ScenarioError as error:
            for told in error.diagnostics:
                message = f"`{each.name}` is not recorded: {told.message}"
                run.ignored.append(replace(told, code="not-recorded", message=message, severity="warning"))
            continue
        if excluded:
            # the value is none where that is not there, and no scene is excluded
            there = build.connect(LogicOp.AND, [condition for condition, _ in excluded], each.span)
            lacking = Constant(_LACKING, span=each.span)
            value = Select(build.opposite(there), (value, lacking), span=each.span)
        found.append(RecordedValue(each.name, each.when, value, kind_of(value), each.span))
    return tuple(found)


def _warning(message: str, span: Span, label: str) -> Diagnostic:
    return Diagnostic("not-recorded", message, span, label, severity="warning")
