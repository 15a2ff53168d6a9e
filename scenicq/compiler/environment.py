"""Variables and budgets of a program that is being evaluated."""

from __future__ import annotations

from scenicq.budget import look
from scenicq.compiler.suggestions import unavailable_name, unknown_name
from scenicq.compiler.values import ModelValue, fail
from scenicq.errors import Span
from scenicq.geometry.features import region_name
from scenicq.geometry.network import Network
from scenicq.limits import LIMITS

__all__ = ["FIRST_LIBRARIES", "FIRST_NAMES", "Budget", "Environment"]

FIRST_LIBRARIES = frozenset({"gtaLib", "mars"})
"""The 2019 paper's libraries."""

FIRST_NAMES = {"height": "length", "viewDistance": "visibleDistance"}
"""Properties that the 2019 paper calls by other names than later versions do (table 2)."""


class Budget:
    """What a program may use: steps of evaluation (time and memory alike) and depth of calls.

    Attributes:
        steps: Steps left.
        depth: Calls in progress.
    """

    ITEMS_PER_STEP = 8
    LOOK_UP_STEPS = 20
    """What asking the map about one known place takes."""

    def __init__(self) -> None:
        """Start with everything left."""
        self.steps = LIMITS.program_steps
        self.depth = 0

    def pay(self, items: int, span: Span) -> None:
        """Use up the steps of making or going through a value of so many items."""
        self.step(span, items // self.ITEMS_PER_STEP)

    def step(self, span: Span | None, count: int = 1) -> None:
        """Use up steps.

        Raises:
            ScenarioError: budget-exceeded.
            Exhausted: See `scenicq.budget`.
        """
        look()
        self.steps -= count
        if self.steps < 0:
            raise fail("budget-exceeded", f"the program takes more than {LIMITS.program_steps:,} steps", span,
                       "the budget ends here", ("make loops shorter",))  # fmt: skip

    def enter(self, span: Span) -> None:
        """Enter a call."""
        self.depth += 1
        if self.depth > LIMITS.call_nesting:
            raise fail("budget-exceeded", f"calls are nested deeper than {LIMITS.call_nesting}", span, "this call",
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
        own: Names that a function binds somewhere: unset before, whatever is around.
        comprehension: Whether it is that of a comprehension, whose `:=` binds outside.
        library: Whether this is a library's rather than the user's text.
        package: The package of the file that this belongs to; empty in a file that is in none.
    """

    __slots__ = ("comprehension", "library", "names", "own", "package", "parent", "shared")

    def __init__(
        self,
        names: dict[str, ModelValue],
        parent: Environment | None = None,
        *,
        library: bool = False,
        user: bool = False,
        own: frozenset[str] = frozenset(),
        comprehension: bool = False,
        package: str | None = None,
    ) -> None:
        """Take the names and the enclosing environment, which says of what file this is unless it is told otherwise."""
        self.names = names
        self.parent = parent
        self.shared: dict[str, Environment] = {}
        self.own = own
        self.comprehension = comprehension
        self.library = not user and (library or (parent is not None and parent.library))
        self.package: str = package if package is not None else parent.package if parent is not None else ""

    @property
    def is_module(self) -> bool:
        """Whether it holds the names of a file: only a model's names or those of the language are around it."""
        around = self.parent
        return around is None or around.parent is None or (around.library and not self.library)

    @property
    def module(self) -> Environment:
        """The environment of the file around."""
        current = self
        while not current.is_module and current.parent is not None:
            current = current.parent
        return current

    def find(self, name: str) -> Environment | None:
        """The environment that a name's value is in, None if it has none."""
        current: Environment | None = self
        while current is not None and name not in current.names:
            if name in current.own:
                return None
            current = current.shared.get(name, current.parent)
        return current

    def get(self, name: str, span: Span) -> ModelValue:
        """The value of a name.

        Raises:
            ScenarioError: unknown-name, with the nearest name as a hint; unsupported-construct, for what Scenic has.
        """
        found = self.find(name)
        if found is not None:
            return found.names[name]
        refused = unavailable_name(name, span)
        if refused is not None:
            raise refused
        known: set[str] = set()
        current: Environment | None = self
        while current is not None:
            if name in current.own:
                raise fail("unknown-name", f"`{name}` is used before the function gives it a value", span,
                           "has no value yet", (f"`global {name}` says that the program's own is meant",))  # fmt: skip
            known.update(current.names)
            current = current.parent
        raise unknown_name(name, known, self._region_of_kind(name), span)

    def _region_of_kind(self, name: str) -> str | None:
        """What the network calls elements of a kind that Scenic does not know, by the kind's name or its region's."""
        found = self.find("network")
        network = None if found is None else found.names["network"]
        if not isinstance(network, Network):
            return None
        return next((each for each in (name, region_name(name)) if each in network.otherRegions), None)

    def set(self, name: str, value: ModelValue) -> None:
        """Give a name a value."""
        self.shared.get(name, self).names[name] = value
