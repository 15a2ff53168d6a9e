"""The outcome of deciding one group for given label objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from scenicq.budget import Exhausted
from scenicq.forest.groups import Constraint
from scenicq.forest.nodes import Identity, Value

__all__ = ["POSTPONED", "UNOBSERVED", "Outcome", "Patience", "Refuted", "Satisfied", "Undecided"]


UNOBSERVED = "unobserved"
"""Why a group is undecided that reads what the label does not tell."""


POSTPONED = "postponed"
"""Why a group is undecided that takes long, as long as other groups or correspondences may make that needless."""


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
