"""Drawing scenes from a scenario: the improviser of the language paper (section 5.4), by rejection with pruning.

Scenes come with the distribution of the program: that of its random variables, given that every requirement holds. A
requirement of probability p below 1 is in force in a share p of the scenes. What makes rejection quick keeps the
distribution: conditions are tested as soon as they can be, independent parts are drawn apart (`draw_schedule`), and
random points are not drawn where conditions exclude them (`containment_pruning`, `proximity_pruning`).
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.forest.containment_pruning import shrink_regions
from scenicq.forest.draw_schedule import DrawSchedule, lay_out
from scenicq.forest.inline import Check, inline_scenario
from scenicq.forest.nodes import Constant, Encloses, Identity, Undefined, Value
from scenicq.forest.proximity_pruning import Window, close_points
from scenicq.forest.scenario import BuiltIn, Scenario

__all__ = ["Improviser", "Scene"]

_ALL = frozenset(BuiltIn)
_PATIENCE = 30
"""Boxes that stick out of their container before the regions that they stand in are cut to it."""


@dataclass(frozen=True, slots=True)
class Scene:
    """One scene of a scenario.

    Attributes:
        values: The value of each (object, property) that has one.
        params: The values of global parameters.
    """

    values: Mapping[tuple[int, str], Value]
    params: Mapping[str, Value]


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """A schedule with the condition that each step tests, and the conditions that no scene meets."""

    schedule: DrawSchedule
    tested: tuple[int | None, ...]
    impossible: tuple[int, ...]


class Improviser:
    """Draws scenes from a scenario, one after the other.

    Attributes:
        checks: The conditions.
        rejected: How often each condition was not met so far, by its index in `checks`.
    """

    def __init__(self, scenario: Scenario, enforce: Set[BuiltIn] = _ALL, *, prune: bool = True) -> None:
        """Prepare to draw.

        Args:
            scenario: The scenario.
            enforce: The built-in requirements in force.
            prune: Whether random points are kept from where conditions exclude them; scenes are the same without.
        """
        parts = inline_scenario(scenario.as_written or scenario, enforce)
        self.checks = parts.checks
        self.rejected: Counter[int] = Counter()
        self.undecided = ""
        """What geometry could not tell last, so that a scene was given up."""
        self._keys, self._params = tuple(parts.values), tuple(parts.params)
        conditions = (check.condition for check in parts.checks)
        self._roots = (*conditions, *parts.values.values(), *parts.params.values())
        self._prune, self._shrunk = prune, False
        self._plan = self._planned()

    def draw(self, rng: random.Random, attempts: int) -> Scene | None:
        """A scene, or None where more than `attempts` conditions failed on the way (`rejected` says which).

        Args:
            rng: Source of randomness; the same scenes come from the same state of it and of the improviser.
            attempts: Failures to endure.

        Raises:
            Exhausted: The time that the caller allows (`budget.limited`) is over.
        """
        # once a scene, not once an attempt: the requirement then holds in a share p of the scenes, or more
        waived = {
            number for number, check in enumerate(self.checks)
            if check.probability < 1.0 and rng.random() >= check.probability
        }  # fmt: skip
        values, place, failures = self._blank(), 0, 0
        while place < len(self._plan.schedule.steps):
            if self._plan.impossible:
                self.rejected.update(self._plan.impossible)
                return None
            number = self._plan.tested[place]
            if self._step(place, values, rng) or number in waived:
                place += 1
                continue
            look()
            failures += 1
            if failures > attempts:
                return None
            place = self._plan.schedule.restarts[place]
            if number is not None:
                self.rejected[number] += 1
                if self._prune and not self._shrunk and self._contained_failures() >= _PATIENCE:
                    self._shrunk, place = True, 0
                    self._plan = self._planned()
                    values = self._blank()
        found = [values[slot] for slot in self._plan.schedule.places]
        count = len(self._keys)
        return Scene(
            dict(zip(self._keys, found[:count], strict=True)), dict(zip(self._params, found[count:], strict=True))
        )

    def _step(self, place: int, values: list[Value], rng: random.Random) -> bool:
        try:
            return self._plan.schedule.steps[place].run(values, rng)
        except CannotEvaluate as error:
            self.undecided = str(error)
            return False

    def _blank(self) -> list[Value]:
        schedule = self._plan.schedule
        return [schedule.constants.get(slot) for slot in range(schedule.slots)]

    def _contained_failures(self) -> int:
        return sum(
            times for number, times in self.rejected.items() if isinstance(self.checks[number].condition, Encloses)
        )

    def _planned(self) -> _Plan:
        roots, barren = self._roots, ()
        windows: dict[Identity, Window] = {}
        hard = [check.probability == 1.0 and not check.defined for check in self.checks]
        if self._shrunk:
            roots, barren = shrink_regions(roots, hard)
        if self._prune:
            roots, windows = close_points([root for root, sure in zip(roots, hard, strict=False) if sure], roots)
        checks = [replace(check, condition=root) for check, root in zip(self.checks, roots, strict=False)]
        false = (number for number, check in enumerate(checks) if check.probability == 1.0 and _never(check))
        numbers = {id(check): number for number, check in enumerate(checks)}
        schedule = lay_out(roots[len(checks) :], checks, windows)
        tested = tuple(None if check is None else numbers[id(check)] for check in schedule.checks())
        return _Plan(schedule, tested, (*barren, *false))

    @property
    def impossible(self) -> Check | None:
        """A condition that no scene meets, as far as that is known."""
        return next((self.checks[number] for number in self._plan.impossible), None)

    def times_rejected(self) -> list[tuple[Check, int]]:
        """How often each requirement was not met so far, the most frequent first."""
        sums: Counter[int] = Counter()
        for number, times in self.rejected.items():
            sums[self.checks[number].source] += times
        first = {check.source: check for check in reversed(self.checks)}
        return [(first[source], times) for source, times in sums.most_common()]


def _never(check: Check) -> bool:
    """Whether a condition is known to fail."""
    if not isinstance(check.condition, Constant):
        return False
    value = check.condition.value
    return isinstance(value, Undefined) or not (check.defined or bool(value))
