"""The outcome of deciding one group for given label objects."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

from scenicq.budget import Exhausted
from scenicq.forest.groups import Constraint
from scenicq.forest.nodes import Identity, Value

__all__ = [
    "UNOBSERVED",
    "Outcome",
    "Patience",
    "Refuted",
    "Satisfied",
    "Search",
    "SearchSteps",
    "Undecided",
    "finish",
    "finish_together",
]


UNOBSERVED = "unobserved"
"""Why a group is undecided that reads what the label does not tell."""


class Patience(IntEnum):
    """What may take long, of what is asked about a label."""

    LITTLE = 0
    """Nothing."""
    LIKELY = 1
    """Some hundred cases of fields, searches for witnesses and the solver, over likely values of normal variables."""
    ALL = 2
    """Everything."""


@dataclass(frozen=True, slots=True)
class Satisfied:
    """The group can be satisfied.

    Attributes:
        values: A witness: of each random variable that matters its number, or its point in metres.
    """

    values: Mapping[Identity, Value]


@dataclass(frozen=True, slots=True)
class Refuted:
    """The group cannot be satisfied.

    Attributes:
        constraint: The one to blame, or the first of several.
        detail: What it comes out as and what was allowed, for a person.
    """

    constraint: Constraint
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Undecided:
    """It was not decided whether the group can be satisfied.

    Attributes:
        constraint: The one to blame, or the first of several.
        reason: As of `Unknown`.
        detail: Which limit ended it, in words, where one did.
    """

    constraint: Constraint
    reason: str
    detail: str = ""

    @classmethod
    def by(cls, constraint: Constraint, error: Exhausted) -> Undecided:
        """What is left undecided by a limit."""
        return cls(constraint, error.reason, error.detail)


Outcome = Satisfied | Refuted | Undecided
"""What is found of a question."""

SearchSteps: TypeAlias = Generator[Patience, None, Outcome]
"""Decides a question step by step; before a step that takes long it says how much patience that takes."""


class Search:
    """A question that is decided as far as patience goes, and from there on once there is more."""

    def __init__(self, steps: SearchSteps) -> None:
        """Take the steps, of which none was made."""
        self._steps = steps
        self._takes = Patience.LITTLE
        self._outcome: Outcome | None = None
        self._error: Exception | None = None

    @property
    def is_finished(self) -> bool:
        """Whether it is decided."""
        return self._outcome is not None

    def within(self, patience: Patience) -> Outcome | None:
        """The outcome; None where it takes more patience.

        Raises:
            Exhausted: The time is up.
        """
        while self._outcome is None and self._takes <= patience:
            if self._error is not None:
                raise self._error
            try:
                self._takes = next(self._steps)
            except StopIteration as end:
                self._outcome = end.value
            except Exception as error:
                self._error = error
                raise
        return self._outcome


def finish(steps: SearchSteps) -> Outcome:
    """The outcome, whatever it takes.

    Raises:
        Exhausted: The time is up.
    """
    outcome = Search(steps).within(Patience.ALL)
    assert outcome is not None
    return outcome


def finish_together(all_steps: Sequence[SearchSteps]) -> Generator[Patience, None, list[Outcome]]:
    """The outcomes of questions that all have to be satisfied; of the one that is refuted alone if one is."""
    searches = [Search(steps) for steps in all_steps]
    for patience in Patience:
        outcomes: list[Outcome] = []
        for search in searches:
            outcome = search.within(patience)
            if isinstance(outcome, Refuted):
                return [outcome]
            outcomes += [] if outcome is None else [outcome]
        if len(outcomes) == len(searches):
            return outcomes
        yield Patience(patience + 1)
    raise AssertionError("no step takes more than all patience")
