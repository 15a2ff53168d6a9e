"""Many labels at once: which of them match by the first candidates that fill the roles.

What the prefilter leaves of an archive mostly matches, in the first way that is tried. Labels of one plan are put into
columns, the closed forms are computed once for all of them, and what is not surely satisfied is left to be decided
alone. Whoever matches here has the correspondence and the witness that `direct` would give it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import cast

import numpy as np

from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.nodes import Identity, Leaf, Value
from scenicq.match.decide.closed_form import Certified
from scenicq.match.decide.compiled_expressions import Column, Columns, Get, UnclearError
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.map_lookups import Disc, MapLookups
from scenicq.match.problem.observation import observe
from scenicq.match.problem.outcome import Satisfied
from scenicq.match.search.first_fit import FirstFit
from scenicq.match.search.group_plan import GroupPlan
from scenicq.match.tolerance import Tolerance
from scenicq.store.labels import Label, LabelObject

__all__ = ["Assignment", "ColumnarFirstFit", "firsts", "together"]

_SCALARS = frozenset({"heading", "width", "length", "height"})


@dataclass(frozen=True, slots=True)
class Assignment:
    """A label whose roles are filled.

    Attributes:
        label: The label.
        numbers: Who plays the objects of `Direct.order`.
        disc: The area that is looked at.
    """

    label: Label
    numbers: tuple[int, ...]
    disc: Disc | None

    @property
    def things(self) -> list[LabelObject]:
        """The label objects that play."""
        objects = self.label.objects
        return [objects[number - 1] if number else self.label.ego for number in self.numbers]


@dataclass(frozen=True, slots=True)
class ColumnarFirstFit:
    """What is found of labels of one plan.

    Attributes:
        variables: The random variables that have a value, group by group.
        witnesses: For each label their values, or None where it is not sure that it is satisfied.
    """

    variables: tuple[Leaf, ...]
    witnesses: Sequence[tuple[Value, ...] | None]


def firsts(direct: FirstFit, among: Candidates) -> tuple[int, ...] | None:
    """Who plays whom if every object takes its first candidate that is left; None if one has none left."""
    numbers = [0]
    for index, _ in direct.due:
        number = next((number for number in among[index] if number not in numbers), None)
        if number is None:
            return None
        numbers.append(number)
    return tuple(numbers)


def together(
    direct: FirstFit, casts: Sequence[Assignment], tolerance: Tolerance, places: MapLookups
) -> ColumnarFirstFit:
    """How labels are satisfied as they are cast.

    Args:
        direct: The plan of all of them.
        casts: The labels.
        tolerance: The tolerance.
        places: What is known of places.
    """
    nothing = ColumnarFirstFit((), [None] * len(casts))
    groups = direct.plan.groups
    if len(groups) > direct.most_decisions:
        return nothing
    things = dict(zip(direct.order, zip(*(each.things for each in casts), strict=True), strict=True))
    columns = Columns(len(casts), lambda index, name: _column(things[index], name))
    discs = [each.disc for each in casts]
    sure = [True] * len(casts)
    variables: list[Leaf] = []
    values: list[Sequence[Value]] = []
    for group in groups:
        found = _satisfied(group, columns, discs, tolerance, places)
        if found is None:
            found = _alone(group, things, sure, discs, tolerance, places)
        holds, witness = found
        sure = [one and other for one, other in zip(sure, holds, strict=True)]
        if not any(sure):
            return nothing
        for leaf in group.group.variables:
            if leaf.identity in witness:
                variables.append(leaf)
                values.append(_listed(witness[leaf.identity], len(casts)))
    rows: Iterator[tuple[Value, ...]] = zip(*values, strict=True) if values else iter([()] * len(casts))
    return ColumnarFirstFit(tuple(variables), [row if one else None for one, row in zip(sure, rows, strict=True)])


def _column(things: Sequence[LabelObject], name: str) -> Column | tuple[Column, Column]:
    """The values of a property of label objects."""
    if name == "position":
        return np.array([thing.x for thing in things]), np.array([thing.y for thing in things])
    if name in _SCALARS:
        return np.array([getattr(thing, name) for thing in things], dtype=np.float64)
    raise UnclearError


def _listed(values: Column | Sequence[Value] | float, size: int) -> Sequence[Value]:
    if isinstance(values, float | int):
        return [values] * size
    return cast("list[Value]", values.tolist()) if isinstance(values, np.ndarray) else values


def _satisfied(
    group: GroupPlan, columns: Columns, discs: Sequence[Disc | None], tolerance: Tolerance, places: MapLookups
) -> Certified | None:
    """By the closed form of many labels; None if there is none."""
    if group.quick is None or group.quick.satisfied is None:
        return None
    try:
        with np.errstate(all="ignore"):
            return group.quick.satisfied(columns, discs, tolerance, places)
    except (UnclearError, CannotEvaluate, ArithmeticError, ValueError):
        return None


def _alone(
    group: GroupPlan,
    things: Mapping[int, Sequence[LabelObject]],
    sure: Sequence[bool],
    discs: Sequence[Disc | None],
    tolerance: Tolerance,
    places: MapLookups,
) -> Certified:
    """One label after the other, as far as the other groups are satisfied.

    Where an alternative decides which variables have a value, those that have others than the first are not sure.
    """
    assert group.quick is not None
    found: list[Mapping[Identity, Value] | None] = []
    for number, (one, disc) in enumerate(zip(sure, discs, strict=True)):
        outcome = group.quick.decide(_get(things, number), disc, tolerance, places) if one else None
        found.append(outcome.values if isinstance(outcome, Satisfied) else None)
    known = next((values.keys() for values in found if values is not None), frozenset[Identity]())
    kept = [values if values is not None and values.keys() == known else None for values in found]
    return [values is not None for values in kept], {
        identity: [math.nan if values is None else values[identity] for values in kept] for identity in known
    }


def _get(things: Mapping[int, Sequence[LabelObject]], number: int) -> Get:
    """The observed values of one label."""

    @cache
    def seen(index: int) -> Mapping[str, Value]:
        return observe(things[index][number])

    return lambda index, name: seen(index)[name]
