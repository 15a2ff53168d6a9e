"""The outcome of deciding one group for given label objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenicq.forest.groups import Constraint
from scenicq.forest.nodes import Identity, Value

__all__ = ["Outcome", "Refuted", "Satisfied", "Undecided"]


@dataclass(frozen=True, slots=True)
class Satisfied:
    """The group can be satisfied, by these values of its random variables."""

    values: Mapping[Identity, Value]


@dataclass(frozen=True, slots=True)
class Refuted:
    """The group cannot be satisfied; `constraint` is the one to blame, or the first of several."""

    constraint: Constraint
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Undecided:
    """Not decided, and why."""

    constraint: Constraint
    reason: str


Outcome = Satisfied | Refuted | Undecided
