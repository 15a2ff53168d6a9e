"""Variables and budgets of a program that is being evaluated."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Protocol

from scenicq.compiler.values import Function, Instance, ModelValue, fail
from scenicq.errors import Span
from scenicq.syntax import ast

__all__ = ["Budget", "Environment", "Runner"]


class Budget:
    """What a program may use: steps of evaluation and depth of calls.

    Attributes:
        steps: Steps left.
        depth: Calls in progress.
    """

    MOST_STEPS = 1_000_000
    MOST_CALLS = 40

    def __init__(self) -> None:
        """Start with everything left."""
        self.steps = self.MOST_STEPS
        self.depth = 0

    def step(self, span: Span) -> None:
        """Use up one step."""
        self.steps -= 1
        if self.steps < 0:
            raise fail("budget-exceeded", f"the program takes more than {self.MOST_STEPS:,} steps", span,
                       "the budget ends here", ("make loops shorter",))  # fmt: skip

    def enter(self, span: Span) -> None:
        """Enter a call."""
        self.depth += 1
        if self.depth > self.MOST_CALLS:
            raise fail("budget-exceeded", f"calls are nested deeper than {self.MOST_CALLS}", span, "this call",
                       ("replace the recursion by a loop",))  # fmt: skip

    def leave(self) -> None:
        """Leave a call."""
        self.depth -= 1


class Environment:
    """Names and their values, inside those of an enclosing environment.

    Attributes:
        names: The innermost names.
        parent: The enclosing environment.
        shared: Names that `global` or `nonlocal` takes from an enclosing environment.
        library: Whether this is a library's rather than the user's text.
    """

    __slots__ = ("library", "names", "parent", "shared")

    def __init__(
        self, names: dict[str, ModelValue], parent: Environment | None = None, *, library: bool = False
    ) -> None:
        """Take the names and the enclosing environment."""
        self.names = names
        self.parent = parent
        self.shared: dict[str, Environment] = {}
        self.library = library or (parent is not None and parent.library)

    def find(self, name: str) -> Environment | None:
        """The innermost environment that has a name."""
        current: Environment | None = self
        while current is not None and name not in current.names:
            current = current.parent
        return current

    def get(self, name: str, span: Span) -> ModelValue:
        """The value of a name.

        Raises:
            ScenarioError: unknown-name, with the nearest name as a hint.
        """
        found = self.find(name)
        if found is not None:
            return found.names[name]
        known: set[str] = set()
        current: Environment | None = self
        while current is not None:
            known.update(current.names)
            current = current.parent
        close = get_close_matches(name, sorted(known), 1, 0.75)
        hints = (f"`{close[0]}` has a similar name",) if close else ()
        if not close and "network" not in known:
            hints = ("names such as `road` come with `model scenic.domains.driving.model`",)
        raise fail("unknown-name", f"`{name}` is not defined", span, "not found", hints)

    def set(self, name: str, value: ModelValue) -> None:
        """Give a name a value."""
        self.shared.get(name, self).names[name] = value


class Runner(Protocol):
    """What evaluating an expression asks of the interpreter.

    Attributes:
        version: The version of Scenic that the program is read as.
        budget: What the program may still use.
    """

    version: int
    budget: Budget

    def ego(self, span: Span) -> Instance:
        """The ego.

        Raises:
            ScenarioError: no-ego, where none is defined yet.
        """
        ...

    def call_function(
        self, function: Function, args: list[ModelValue], named: Mapping[str, ModelValue], span: Span
    ) -> ModelValue:
        """Call a function of the program."""
        ...

    def make_function(
        self,
        name: str,
        parameters: tuple[ast.Parameter, ...],
        body: tuple[ast.Statement, ...] | ast.Expression,
        scope: Environment,
        span: Span,
    ) -> Function:
        """Make a function, evaluating the defaults of its parameters."""
        ...

    def name_value(self, name: str, value: ModelValue, scope: Environment, span: Span) -> None:
        """Give a name a value; an object's first name becomes its own."""
        ...

    def make_instance(self, node: ast.New, scope: Environment) -> Instance:
        """Make a point, oriented point or object."""
        ...
