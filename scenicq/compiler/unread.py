"""Names that nothing reads: what computing their values excludes, or lacks, counts once they are read.

Scenic draws only what a scene needs. So what a statement `name = value` excludes is kept beside the value, and is said
where the name is read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenicq.compiler.environment import Environment
from scenicq.compiler.random_values import NothingLeftError
from scenicq.compiler.values import Function, ModelValue, ScenicClass
from scenicq.errors import ScenarioError
from scenicq.syntax import ast
from scenicq.syntax.walk import walk

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["NoValue", "evaluate_when_read", "read_value"]


@dataclass(frozen=True, slots=True, eq=False)
class NoValue:
    """The value of a name that has none, which is an error once the name is read."""

    error: ScenarioError


def evaluate_when_read(
    run: Interpreter, node: ast.Expression, scope: Environment, compute: Callable[[], ModelValue]
) -> ModelValue:
    """The value that a statement gives a name.

    Args:
        run: The interpreter.
        node: The expression.
        scope: The names it sees.
        compute: Evaluates it.
    """
    if not _is_pure(node, scope):
        return compute()
    with run.excluded.collect_separately() as found:
        try:
            value: ModelValue = compute()
        except ScenarioError as error:
            # Scenic refuses `Uniform()` where it stands: it is given nothing, whatever a scene has
            empty = isinstance(error, NothingLeftError) and any(
                isinstance(each, ast.Call) and not each.arguments for each in walk(node)
            )
            if empty or any(each.code != "map-lacks" for each in error.diagnostics):
                raise
            value = NoValue(error)
    run.excluded.keep(value, found)
    return value


def read_value(run: Interpreter, value: ModelValue) -> ModelValue:
    """A value whose name is read.

    Raises:
        ScenarioError: map-lacks, where no outcome of it is left.
    """
    if isinstance(value, NoValue):
        raise value.error
    run.excluded.say(value)
    return value


def _is_pure(node: ast.Expression, scope: Environment) -> bool:
    """Whether all that an expression does is to give its value: it makes nothing and changes nothing."""
    for each in walk(node):
        if isinstance(each, ast.New | ast.Walrus):
            return False
        if isinstance(each, ast.Call) and isinstance(each.function, ast.Attribute) and each.function.name in _CHANGES:
            return False
        owner = scope.find(each.id) if isinstance(each, ast.Name) else None
        if isinstance(each, ast.Name) and owner and isinstance(owner.names[each.id], ScenicClass | Function):
            return False
    return True


_CHANGES = frozenset("append extend insert pop remove reverse clear sort update setdefault add discard".split())
