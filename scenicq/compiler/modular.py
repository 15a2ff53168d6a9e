"""Scenarios made of others: which one runs, and what a scenario has that has been set up."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from scenicq.compiler.coerce import read_over_time
from scenicq.compiler.coroutines import CoroutineCall, ScenarioDefinition
from scenicq.compiler.environment import Environment
from scenicq.compiler.exclusions import collect_exclusions
from scenicq.compiler.scoping import own_names
from scenicq.compiler.values import Instance, ModelValue, fail
from scenicq.errors import Span, similar
from scenicq.forest.nodes import Node
from scenicq.syntax import ast

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter
    from scenicq.compiler.requirements import RequireStatement
    from scenicq.compiler.temporal import TimedStatements

__all__ = ["SetUp", "run_program", "set_up", "top_scenario"]


@dataclass(eq=False)
class SetUp:
    """What a scenario has that has been set up.

    Attributes:
        scope: Its names.
        objects: The objects that it has made.
        requirements: What it requires when it begins.
        excluded: What must hold so that what it asks for is there.
        timed: What it says about time.
        ego: Who the ego is within it; None where nobody is yet.
    """

    scope: Environment
    objects: list[Instance]
    requirements: list[RequireStatement]
    excluded: list[tuple[Node, Span]]
    timed: TimedStatements
    ego: Instance | None
    names: Mapping[str, ModelValue] = field(init=False)

    def __post_init__(self) -> None:
        """Read what others may ask it for."""
        self.names = {**self.scope.names, "objects": list(self.objects)}
        if self.ego is not None:
            self.names["ego"] = self.ego


def top_scenario(module: ast.Program, scope: Environment, wanted: str | None) -> ScenarioDefinition | None:
    """The scenario that a program runs: the one that is wanted, `Main`, else the only one; None for the program itself.

    Args:
        module: The program.
        scope: Its names, after it has run.
        wanted: The name that the user gives.

    Raises:
        ScenarioError: unknown-name, where there is none of that name; wrong-arity, where it needs arguments;
            unsupported-construct, where it is not clear which one is meant.
    """
    defined = [each for each in module.body if isinstance(each, ast.DynamicDefinition) and each.kind == "scenario"]
    if wanted is None and isinstance(scope.names.get("Main"), ScenarioDefinition):
        wanted = "Main"
    if wanted is not None:
        found = scope.names.get(wanted)
        if not isinstance(found, ScenarioDefinition):
            names = [each.name for each in defined]
            close = similar(wanted, names)
            hints = (f"it has `{close or names[0]}`",) if names else ("it defines no scenario",)
            start = Span(module.source, 0, min(1, len(module.source.text)))
            raise fail("unknown-name", f"the program has no scenario `{wanted}`", start, "", hints)
        if missing := _missing(found):
            raise fail("wrong-arity", f"the scenario `{found.name}` needs a value for `{missing}`", found.span,
                       "runs without arguments", ("give the parameter a default",))  # fmt: skip
        return found
    if len(defined) > 1:
        others = ", ".join(f"`{each.name}`" for each in defined)
        raise fail("unsupported-construct", "it is not clear which scenario runs", defined[0].span, f"one of {others}",
                   ("call one of them `Main`", "`--scenario NAME` says which one"))  # fmt: skip
    found = scope.names.get(defined[0].name) if defined else None
    return found if isinstance(found, ScenarioDefinition) and not _missing(found) else None


def _missing(definition: ScenarioDefinition) -> str:
    """A parameter that needs a value; "" if none does."""
    names = (
        each.name for each in definition.parameters if each.name not in definition.defaults and each.kind[0] != "*"
    )
    return next(names, "")


def run_program(run: Interpreter, definition: ScenarioDefinition) -> None:
    """Set up the scenario that the program runs: its objects are those of the initial scene."""
    call = CoroutineCall(definition, dict(definition.defaults), definition.span)
    scope = _scope(call)
    if run.timed is not None:
        run.timed.enter(definition.span, run.ignored)
    run.run(definition.setup, scope)
    if definition.setup:
        run.is_initial = False
    guards = definition.guards("precondition", "invariant")
    if run.timed is not None:
        run.timed.compose(call, scope)
        return
    for guard in guards:
        run.dynamic(guard.kind, guard.span)
    if definition.compose is not None:
        body = cast("tuple[ast.Statement, ...]", definition.body)
        block = next(each for each in body if isinstance(each, ast.DynamicDefinition) and each.kind == "compose")
        run.dynamic("compose", block.span)


def set_up(run: Interpreter, call: CoroutineCall, ego: Instance | None) -> SetUp:
    """Set up a scenario that begins within a run.

    Args:
        run: The interpreter, after the program.
        call: The call of the scenario.
        ego: Who the ego is where it is called.
    """
    assert run.timed is not None
    definition = cast(ScenarioDefinition, call.of)
    scope, first = _scope(call), len(run.objects)
    timed = run.timed.for_inner_run()
    params, records = dict(run.params), list(run.records)
    with _within(run, timed, ego) as requirements, read_over_time(current=False):
        _, excluded = collect_exclusions(run, lambda: run.run(definition.setup, scope))
        ego = run.current_ego
    if definition.setup:
        run.is_initial = False
    if changed := [name for name in run.params if run.params[name] is not params.get(name)]:
        raise fail("unsupported-construct", "a parameter cannot be set within a run", run.params[changed[0]][1],
                   "set when the scenario begins", ("set it at the top level",))  # fmt: skip
    if added := [each for each in run.records if each not in records]:
        raise fail("unsupported-construct", "`record` within a run is not supported", added[0].span,
                   "of a scenario that others run", ("write it in the scenario that the program runs",))  # fmt: skip
    return SetUp(scope, run.objects[first:], requirements, excluded, timed, ego)


def _scope(call: CoroutineCall) -> Environment:
    """The names of a scenario: of all its blocks."""
    definition = cast(ScenarioDefinition, call.of)
    own = own_names((*definition.setup, *(definition.compose or ())))
    return Environment(dict(call.given), cast(Environment, definition.environment), own=own)


@contextmanager
def _within(run: Interpreter, timed: TimedStatements, ego: Instance | None) -> Generator[list[RequireStatement]]:
    """While a scenario is set up: what it says is its own, which it gets in turn."""
    before = run.requirements, run.timed, run.current_ego, run.course
    run.requirements, run.timed, run.current_ego, run.course = [], timed, ego, None
    try:
        yield run.requirements
    finally:
        run.requirements, run.timed, run.current_ego, run.course = before
