"""Closed forms: what decides a group of one constraint by formulas of what is observed.

What most features look like once the label is known: a point of a region, an offset by ranges in a known frame, a
heading within ranges of a known one, a condition that is known altogether. The formulas are worked out once per
scenario, and hold for one assignment of label objects (floats) and for many (columns) alike. Only clear answers are
given: whatever is close to a boundary is left to the cascade. `closed_forms` finds the closed form of a group.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias, cast

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.groups import Comparison, Condition
from scenicq.forest.nodes import Identity, Value
from scenicq.geometry.regions import Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.decide.range_forms import Columns, FloatColumn, Lookup
from scenicq.match.options import MatchOptions
from scenicq.match.problem.map_lookups import XY, MapLookups
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied

__all__ = ["FAILS", "ClosedForm", "GroupEvaluation", "each_position"]


class GroupEvaluation(NamedTuple):
    """A group under one assignment of label objects, or under many.

    Attributes:
        holds: Whether it is surely satisfied; of many assignments, one truth value each.
        fails: Whether it surely cannot be.
        values: A witness for where it holds; elsewhere it means nothing.
        open: Whether what is not observed would tell. Where none of the three is true nothing is said.
    """

    holds: bool | Sequence[bool]
    fails: bool | Sequence[bool]
    values: Mapping[Identity, Value | FloatColumn | list[Value]]
    open: bool | Sequence[bool] = False


FAILS = GroupEvaluation(False, True, {})
_UNCLEAR = GroupEvaluation(False, False, {})
Evaluate: TypeAlias = Callable[[Lookup, MatchOptions, MapLookups], GroupEvaluation]


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """A group's closed form.

    Attributes:
        constraint: Its first constraint, of most groups the only one.
        evaluate: From the observed values, tolerance and radius, and what is known of the map, to what is clear.
            It may raise `CannotEvaluate`, of columns where single values would do.
        field: The field that it asks at the position of `index`.
        regions: The regions that it asks for the position of `index`.
        index: The object whose position matters to field or regions.
        detail: What a refutation says.
        parts: The closed forms of which it is made, if it is of several constraints.
        takes_columns: Whether it takes nothing but columns, also of one assignment.
    """

    constraint: Comparison | Condition
    evaluate: Evaluate
    field: RoadDirection | None = None
    regions: tuple[Region, ...] = ()
    index: int = -1
    detail: Callable[[Lookup, MapLookups], str] | None = None
    parts: tuple[ClosedForm, ...] = ()
    takes_columns: bool = False

    def decide(self, get: Lookup, options: MatchOptions, lookups: MapLookups) -> Outcome | None:
        """Decide one assignment.

        Args:
            get: Its observed values.
            options: Tolerance and radius.
            lookups: What is known of the map.

        Returns:
            None where it is not clear.
        """
        found = self.evaluate_one(get, options, lookups)
        if found.holds:
            return Satisfied(cast("Mapping[Identity, Value]", found.values))
        if found.fails:
            for part in self.parts:
                if part.evaluate_one(get, options, lookups).fails:
                    return part.decide(get, options, lookups)
            try:
                return Refuted(self.constraint, "" if self.detail is None else self.detail(get, lookups))
            except CannotEvaluate:
                pass
        return None

    def evaluate_one(self, get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        """As `decide`, without words; None where an expression has no value."""
        try:
            return self.evaluate(get, options, lookups)
        except CannotEvaluate:
            return _UNCLEAR

    def evaluate_many(
        self, row: Callable[[int], Lookup], columns: Columns, options: MatchOptions, lookups: MapLookups
    ) -> GroupEvaluation:
        """Evaluate many assignments, each as `evaluate_one` does.

        Args:
            row: The observed values of each, by its number.
            columns: The same, side by side.
            options: Tolerance and radius.
            lookups: What is known of the map.
        """
        try:
            with np.errstate(all="ignore"):
                return self.evaluate(columns, options, lookups)
        except CannotEvaluate:
            return self._one_by_one([row(number) for number in range(columns.size)], options, lookups)

    def _one_by_one(self, rows: Sequence[Lookup], options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        """Where columns do not do; nothing is said of those whose witness has other variables than the first one's."""
        outcomes = [self.decide(get, options, lookups) for get in rows]
        witnesses = [outcome.values if isinstance(outcome, Satisfied) else None for outcome in outcomes]
        known = next((values.keys() for values in witnesses if values is not None), frozenset[Identity]())
        kept = [values if values is not None and values.keys() == known else None for values in witnesses]
        return GroupEvaluation(
            [values is not None for values in kept],
            [isinstance(outcome, Refuted) for outcome in outcomes],
            {identity: [math.nan if values is None else values[identity] for values in kept] for identity in known},
        )


def each_position(position: Value) -> list[XY]:
    """The positions that a pair of columns has; of one position, it alone."""
    x, y = cast(XY, position)
    if isinstance(x, np.ndarray):
        return list(zip(cast(FloatColumn, x).tolist(), cast(FloatColumn, y).tolist(), strict=True))
    return [(x, y)]
