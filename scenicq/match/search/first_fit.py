"""First fit: every role gets the first candidate that passes, for many labels side by side.

Most of what a prefilter leaves matches in the first way that is tried. Where all groups of a plan have closed forms,
the labels that share it are a batch: role by role, in the order of the program, each label gives its next free
candidate, and the closed forms are computed once for the whole batch. Labels whose candidate fails form a batch of
their own with their next one, or with the next of an earlier role. Whoever is not surely decided, or runs out of
candidates, is left to `LabelSearch`. One label is a batch of one.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar, cast

import numpy as np

from scenicq.budget import look
from scenicq.forest.nodes import Identity, Leaf, Value
from scenicq.forest.scenario import Scenario
from scenicq.match.decide.closed_form import Evaluated
from scenicq.match.decide.compiled_expressions import Column, Columns, Get, UnclearError
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.constraints import Signature
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.observation import observe, observe_params, observed_names
from scenicq.match.problem.outcome import Satisfied
from scenicq.match.search.group_plan import GroupPlan, MatchPlan
from scenicq.store.labels import Label, LabelObject

__all__ = ["FilledBatch", "FirstFit", "Row", "first_fit_of", "signature_of"]

_MOST_DECISIONS = 64
_MORE_DECISIONS = 16
"""For each role: what is given up costs as much as half a search at most."""
_SCALARS = frozenset({"heading", "width", "length", "height"})

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Row:
    """A label of a batch.

    Attributes:
        place: Its number among the labels that were asked about.
        label: The label.
        candidates: Who may play whom.
    """

    place: int
    label: Label
    candidates: Candidates
    _seen: dict[int, Mapping[str, Value]] = field(default_factory=dict["int", "Mapping[str, Value]"])

    def label_object(self, number: int) -> LabelObject:
        """The label object of a number; 0 is the label's ego."""
        return self.label.objects[number - 1] if number else self.label.ego

    def observed(self, number: int) -> Mapping[str, Value]:
        """What is observed of it."""
        seen = self._seen.get(number)
        if seen is None:
            seen = self._seen[number] = observe(self.label_object(number))
        return seen


@dataclass(frozen=True, slots=True)
class FilledBatch:
    """Labels all of whose roles are filled.

    Attributes:
        rows: The labels.
        numbers: Of each, who plays the objects of `FirstFit.order`.
        variables: The random variables that have a value, group by group.
        witnesses: Of each label, their values.
    """

    rows: Sequence[Row]
    numbers: Sequence[tuple[int, ...]]
    variables: tuple[Leaf, ...]
    witnesses: Sequence[tuple[Value, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class FirstFit:
    """A plan whose groups all have closed forms.

    Attributes:
        plan: The plan.
        order: The ego, then the other objects in program order.
        places: Where in the order each object is.
        due: For each of them, the groups that can be decided once it has a candidate.
        most_decisions: After how many decisions a label is given up.
    """

    plan: MatchPlan
    order: tuple[int, ...]
    places: Mapping[int, int]
    due: tuple[tuple[GroupPlan, ...], ...]
    most_decisions: int

    def fill(self, rows: Sequence[Row], options: MatchOptions, lookups: MapLookups) -> Iterator[FilledBatch]:
        """The labels whose roles can be filled, in batches; the others are left out.

        Args:
            rows: Labels of the plan.
            options: Tolerance and radius.
            lookups: What is known of the map.

        Raises:
            TimeIsUp: The time is used up.
        """
        todo = [_Batch(self, rows, [(0,)] * len(rows))]
        while todo:
            look()
            batch = todo.pop()
            for group in self.due[batch.depth]:
                found, size = batch.decide(group, options, lookups), len(batch.rows)
                holds, fails = _listed(found.holds, size), _listed(found.fails, size)
                if not all(holds):
                    todo += batch.where(fails).with_next_candidate()
                    batch = batch.where(holds)
                    if not batch.rows:
                        break
            if batch.rows and batch.depth + 1 == len(self.order):
                yield batch.filled()
            elif batch.rows:
                todo += batch.with_next_role()


@dataclass(slots=True)
class _Batch:
    """Labels of a plan that have the same number of roles filled.

    Attributes:
        fit: The plan.
        rows: The labels.
        numbers: Of each, who plays the first objects of the order.
        values: By group, the values of its random variables, a column each.
        decisions: How many groups were decided for these labels.
        columns: What is observed of the label objects in the roles.
    """

    fit: FirstFit
    rows: Sequence[Row]
    numbers: Sequence[tuple[int, ...]]
    values: dict[GroupPlan, Mapping[Identity, Column | list[Value]]] = field(
        default_factory=dict["GroupPlan", "Mapping[Identity, Column | list[Value]]"]
    )
    decisions: int = 0
    columns: Columns | None = None

    @property
    def depth(self) -> int:
        """The place of the newest role in the order."""
        return len(self.numbers[0]) - 1

    def decide(self, group: GroupPlan, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        """Decide a group for all labels, and keep its witness."""
        form, size = group.closed_form, len(self.rows)
        assert form is not None
        self.decisions += 1
        if self.decisions > self.fit.most_decisions:
            return Evaluated([False] * size, [False] * size, {})
        if size == 1:
            outcome = form.decide(self._get(0), options, lookups)
            if not isinstance(outcome, Satisfied):
                return Evaluated(False, outcome is not None, {})
            self.values[group] = {identity: [value] for identity, value in outcome.values.items()}
            return Evaluated(True, False, outcome.values)
        if self.columns is None:
            self.columns = Columns(size, self._column)
        found = form.decide_many(self._get, self.columns, options, lookups)
        self.values[group] = {
            identity: column if isinstance(column, np.ndarray | list) else [cast(Value, column)] * size
            for identity, column in found.values.items()
        }
        return found

    def where(self, kept: Sequence[bool]) -> _Batch:
        """The labels of which something is true."""
        if all(kept):
            return self
        mask = np.array(kept, dtype=bool)
        values: dict[GroupPlan, Mapping[Identity, Column | list[Value]]] = {}
        if mask.any():
            for group, found in self.values.items():
                values[group] = {
                    identity: column[mask] if isinstance(column, np.ndarray) else list(itertools.compress(column, kept))
                    for identity, column in found.items()
                }
        rows, numbers = itertools.compress(self.rows, kept), itertools.compress(self.numbers, kept)
        return _Batch(self.fit, [*rows], [*numbers], values, self.decisions)

    def with_next_role(self) -> list[_Batch]:
        """The labels with the first free candidate for the next role; without one, with the next for an earlier one."""
        index = self.fit.order[self.depth + 1]
        numbers = [
            next(((*taken, one) for one in row.candidates[index] if one not in taken), None)
            for row, taken in zip(self.rows, self.numbers, strict=True)
        ]
        kept = [each is not None for each in numbers]
        stuck = [] if all(kept) else self.where([not each for each in kept]).with_next_candidate()
        batch = self.where(kept)
        # the columns of the roles before stay what they are
        batch.numbers = [each for each in numbers if each is not None]
        return [*stuck, batch] if batch.numbers else stuck

    def with_next_candidate(self) -> list[_Batch]:
        """The labels with the next free candidate for the newest role that has one left, by how many are filled."""
        numbers = [self._next(row, taken) for row, taken in zip(self.rows, self.numbers, strict=True)]
        lengths = [0 if each is None else len(each) for each in numbers]
        found: list[_Batch] = []
        for length in sorted(set(lengths) - {0}):
            kept = [each == length for each in lengths]
            batch = self.where(kept)
            batch.numbers, batch.columns = [each for each in numbers if each is not None and len(each) == length], None
            found.append(batch)
        return found

    def _next(self, row: Row, numbers: Sequence[int]) -> tuple[int, ...] | None:
        taken = list(numbers)
        while len(taken) > 1:
            tried = taken.pop()
            options = row.candidates[self.fit.order[len(taken)]]
            for one in options[options.index(tried) + 1 :]:
                if one not in taken:
                    return (*taken, one)
        return None

    def filled(self) -> FilledBatch:
        """The labels with their witnesses."""
        variables: list[Leaf] = []
        columns: list[Sequence[Value]] = []
        for group in self.fit.plan.groups:
            for leaf in group.group.variables:
                if leaf.identity in self.values[group]:
                    variables.append(leaf)
                    columns.append(_listed(self.values[group][leaf.identity], len(self.rows)))
        witnesses = list(zip(*columns, strict=True)) if columns else [()] * len(self.rows)
        return FilledBatch(self.rows, self.numbers, tuple(variables), witnesses)

    def _get(self, place: int) -> Get:
        """The observed values of one label."""
        row, numbers, places = self.rows[place], self.numbers[place], self.fit.places

        def get(index: int, name: str) -> Value:
            return row.observed(numbers[places[index]])[name]

        return get

    def _column(self, index: int, name: str) -> Column | tuple[Column, Column]:
        """The values of a property of the label objects that play an object."""
        place = self.fit.places[index]
        objects = [row.label_object(numbers[place]) for row, numbers in zip(self.rows, self.numbers, strict=True)]
        if name == "position":
            return np.array([each.x for each in objects]), np.array([each.y for each in objects])
        if name in _SCALARS:
            return np.array([getattr(each, name) for each in objects], dtype=np.float64)
        raise UnclearError


def _listed(values: Column | Sequence[T] | T, size: int) -> list[T]:
    if isinstance(values, np.ndarray):
        return cast("list[T]", values.tolist())
    return cast("list[T]", values) if isinstance(values, list) else [cast(T, values)] * size


def first_fit_of(plan: MatchPlan, scenario: Scenario) -> FirstFit | None:
    """The plan made ready; None if some group has no closed form, or there are too many."""
    if any(group.closed_form is None for group in plan.groups):
        return None
    order = (scenario.ego, *(each.index for each in scenario.objects if each.index != scenario.ego))
    places = {index: place for place, index in enumerate(order)}
    due: list[list[GroupPlan]] = [[] for _ in order]
    for group in sorted(plan.groups, key=lambda each: len(each.roles)):
        due[max((places[index] for index in group.roles), default=0)].append(group)
    most = _MOST_DECISIONS + _MORE_DECISIONS * (len(order) - 1)
    return FirstFit(plan, order, places, tuple(map(tuple, due)), most)


def signature_of(label: Label, ego: int, among: Candidates, relevant: tuple[frozenset[str], ...]) -> Signature | None:
    """What is observed of all candidates, if it is the same for all of a role."""
    objects = label.objects
    numbers = {number for index, numbers in among.items() if index != ego for number in numbers}
    seen = {number: observed_names(objects[number - 1]) for number in numbers}
    params = frozenset(observe_params(label)) if label.params else frozenset[str]()
    own = observed_names(label.ego)
    if len(set(seen.values())) == 1 and all(among[index] for index in range(len(relevant)) if index != ego):
        return _signature(relevant, ego, own, next(iter(seen.values())), params)
    kinds: list[frozenset[str]] = []
    for index, names in enumerate(relevant):
        if index == ego:
            kinds.append(names & own)
            continue
        first, *others = {names & seen[number] for number in among[index]} or {None}
        if first is None or others:
            return None
        kinds.append(first)
    return (*kinds, params)


@functools.lru_cache
def _signature(
    relevant: tuple[frozenset[str], ...],
    ego: int,
    own: frozenset[str],
    others: frozenset[str],
    params: frozenset[str],
) -> Signature:
    """Where the ego has some properties, and all others have the same."""
    return (*(names & (own if index == ego else others) for index, names in enumerate(relevant)), params)
