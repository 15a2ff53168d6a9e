"""First fit: every role gets the first candidate that passes, for many labels side by side.

Most of what a prefilter leaves matches in the first way that is tried. Where all groups of a plan have closed forms,
the labels that share it are a batch: role by role, in the order of the program, each label gives its next free
candidate, and the closed forms are computed once for the whole batch. Labels whose candidate fails form a batch of
their own with their next one, or with the next of an earlier role. A label all of whose candidates surely fail does
not match. What is open (it depends on what is not observed) is passed over first; a label that nothing else fills is
unknown by the first correspondence that nothing excludes. Whoever is not surely decided is left to `LabelSearch`. One
label is a batch of one.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.forest.among import LABEL_OBJECTS
from scenicq.forest.columns import CodedValues
from scenicq.forest.groups import Constraint, Group
from scenicq.forest.nodes import COURSE, GOING, LAST_LANE, RANK, WHO, Identity, LaneCourse, Leaf, Value
from scenicq.forest.scenario import Scenario
from scenicq.limits import LIMITS
from scenicq.match.decide.closed_form import ClosedForm, GroupEvaluation
from scenicq.match.decide.observed_forms import COURSES, observed_form_of
from scenicq.match.decide.range_forms import Columns, FloatColumn, Lookup
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.constraints import Signature
from scenicq.match.problem.label_elements import elements_of
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.observation import course_without_role, observe, observe_course, observed_names
from scenicq.match.problem.outcome import Outcome
from scenicq.match.search.group_plan import GroupPlan, MatchPlan
from scenicq.store.labels import Label, LabelObject
from scenicq.store.reader import LAST

__all__ = ["FailedBatch", "FilledBatch", "FirstFit", "LabelRow", "OpenBatch", "first_fit_of", "signature_of"]

_SCALARS = frozenset({"heading", "width", "length", "height"})

T = TypeVar("T")
Values: TypeAlias = "Value | FloatColumn | list[Value]"
"""Values of many labels: one each, or the one that all have."""
RowTruth: TypeAlias = "bool | Sequence[bool]"
"""Truth for many labels likewise."""


@dataclass(slots=True, eq=False)
class LabelRow:
    """A label of a batch.

    Attributes:
        number: Its number among the labels that were asked about.
        label: The label.
        candidates: Who may play whom.
        seen: What is observed of its objects, by their numbers, as far as it was asked for.
        courses: How courses are made, if the scenario asks for any.
    """

    number: int
    label: Label
    candidates: Candidates
    seen: dict[int, Mapping[str, Value]]
    courses: LaneCourse | None = None

    def observed(self, number: int) -> Mapping[str, Value]:
        """What is observed of a label object; worked out when it is first asked for."""
        seen = self.seen.get(number)
        if seen is None:
            mine = _label_object(self.label, number)
            seen = self.seen[number] = observe(mine)
            course = None if self.courses is None else observe_course(self.label, mine, self.courses)
            if course is not None:
                seen = self.seen[number] = {**seen, COURSE: course}
        return seen

    def observe_without_course(self, number: int) -> Mapping[str, Value]:
        """What is observed of a label object that need not play a role; its course would take long to make."""
        seen = self.seen.get(number)
        return observe(_label_object(self.label, number)) if seen is None else seen

    def course(self, number: int) -> Value:
        """The course of a label object that need not play a role."""
        known = self.seen.get(number, {}).get(COURSE)
        return known or course_without_role(self.label, _label_object(self.label, number), self.courses)


@dataclass(frozen=True, slots=True)
class FilledBatch:
    """Labels all of whose roles are filled.

    Attributes:
        rows: The labels.
        numbers: Numbers of the label objects that play `FirstFit.order`, for each label.
        variables: The random variables that have a value, group by group.
        witnesses: Values of the variables, for each label.
    """

    rows: Sequence[LabelRow]
    numbers: Sequence[tuple[int, ...]]
    variables: tuple[Leaf, ...]
    witnesses: Sequence[tuple[Value, ...]]


@dataclass(frozen=True, slots=True)
class FailedBatch:
    """Labels that do not match.

    Attributes:
        rows: The labels.
        numbers: As in `FilledBatch`, for the correspondence that comes furthest.
        constraint: What fails of that.
        form: The closed form of the group of which it is one.
    """

    rows: Sequence[LabelRow]
    numbers: Sequence[tuple[int, ...]]
    constraint: Constraint
    form: ClosedForm

    def outcomes(
        self, ranks: Mapping[int, int], options: MatchOptions, lookups: MapLookups
    ) -> Iterator[Outcome | None]:
        """What is said of each label in words, given `FirstFit.ranks`; None where it is not clear."""
        return (
            self.form.decide(_getter(row, numbers, ranks), options, lookups)
            for row, numbers in zip(self.rows, self.numbers, strict=True)
        )


@dataclass(frozen=True, slots=True)
class OpenBatch:
    """Labels that do not surely match, and match if what is not observed is right.

    Attributes:
        rows: The labels.
        numbers: As in `FilledBatch`, for the first correspondence that nothing excludes.
        groups: The first group of the plan that is open, for each label.
    """

    rows: Sequence[LabelRow]
    numbers: Sequence[tuple[int, ...]]
    groups: Sequence[Group]

    def observed(self, place: int) -> Iterator[frozenset[str]]:
        """The names of what is observed of each label object in the roles of a label."""
        label = self.rows[place].label
        return (_observed_of(label, _label_object(label, number)) for number in self.numbers[place])


@dataclass(frozen=True, slots=True)
class _Failure:
    """What failed furthest of a label.

    Attributes:
        depth: How many roles were filled, and the place of the group among those that are due then.
        form: The closed form of the group.
        numbers: Who played the roles.
    """

    depth: tuple[int, int]
    form: ClosedForm
    numbers: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _PassedOver:
    """Numbers of labels, noted while what is open is passed over.

    Attributes:
        opened: Those of which something was open.
        settled: Those whose roles are filled, and those of which something is not clear.
    """

    opened: set[int] = field(default_factory=set[int])
    settled: set[int] = field(default_factory=set[int])


@dataclass(frozen=True, slots=True, eq=False)
class FirstFit:
    """A plan whose groups all have closed forms.

    Attributes:
        plan: The plan.
        order: The ego, then the other objects in program order.
        ranks: Where in the order each object is.
        due: For each of them, the groups that can be decided once it has a candidate, and their closed forms.
        most_decisions: After how many decisions a label is given up.
    """

    plan: MatchPlan
    order: tuple[int, ...]
    ranks: Mapping[int, int]
    due: tuple[tuple[tuple[GroupPlan, ClosedForm], ...], ...]
    most_decisions: int

    def fill(
        self, rows: Sequence[LabelRow], options: MatchOptions, lookups: MapLookups
    ) -> Iterator[FilledBatch | FailedBatch | OpenBatch]:
        """The labels whose roles can be filled, surely cannot, or may be, in batches; the others are left out.

        Labels without a match are left out where there are several roles: it takes a search to say what fails.

        Args:
            rows: Labels of the plan.
            options: Tolerance and radius.
            lookups: What is known of the map.

        Raises:
            Exhausted: The time is used up.
        """
        passed = _PassedOver()
        yield from self._fill(rows, options, lookups, passed)
        left = [row for row in rows if row.number in passed.opened - passed.settled]
        if left:
            yield from self._fill(left, options, lookups)

    def _fill(
        self,
        rows: Sequence[LabelRow],
        options: MatchOptions,
        lookups: MapLookups,
        passed: _PassedOver | None = None,
    ) -> Iterator[FilledBatch | FailedBatch | OpenBatch]:
        """As `fill`, without what is open, or with that alone.

        Args:
            rows: Labels of the plan.
            options: Tolerance and radius.
            lookups: What is known of the map.
            passed: Takes what is passed over; None: what is open is taken for what holds.
        """
        todo = [_Batch(self, rows, [(0,)] * len(rows))]
        while todo:
            look()
            batch = todo.pop()
            depth = len(batch.numbers[0])
            for place, (group, form) in enumerate(self.due[depth - 1]):
                holds, fails, open_ = batch.decide(group, form, options, lookups)
                if holds is True:
                    continue
                if fails is not False:
                    failing = batch.where(fails)
                    if len(self.order) <= 2 and passed is not None:
                        failing.note((depth, place), form)
                        yield from failing.lost(options, lookups, passed.opened)
                    todo += failing.with_next_candidate()
                if passed is not None:
                    passed.settled.update(batch.unclear(holds, fails, open_))
                if open_ is not False and passed is not None:
                    opened = batch.where(open_)
                    passed.opened.update(row.number for row in opened.rows)
                    todo += opened.with_next_candidate()
                elif open_ is not False:
                    batch.note_open(open_, self.plan.groups.index(group))
                    holds = _either(holds, open_)
                if holds is False:
                    break
                batch = batch.where(holds)
            else:
                if depth < len(self.order):
                    todo += batch.with_next_role()
                elif passed is None:
                    yield batch.opened()
                else:
                    passed.settled.update(row.number for row in batch.rows)
                    yield batch.filled()


@dataclass(slots=True)
class _Batch:
    """Labels of a plan that have the same number of roles filled.

    Attributes:
        fit: The plan.
        rows: The labels.
        numbers: Numbers of the label objects that play the first objects of the order, for each label.
        values: By group, the values of its random variables: a column each, or what all labels have.
        decisions: How many groups were decided for these labels.
        columns: What is observed of the label objects in the roles.
        failures: What failed furthest of each label, as far as it is noted.
        opens: The place in the plan of the first group that is open of each label, as far as it is noted.
    """

    fit: FirstFit
    rows: Sequence[LabelRow]
    numbers: list[tuple[int, ...]]
    values: dict[GroupPlan, Mapping[Identity, Values]] = field(
        default_factory=dict["GroupPlan", "Mapping[Identity, Values]"]
    )
    decisions: int = 0
    columns: Columns | None = None
    failures: list[_Failure | None] | None = None
    opens: list[int | None] | None = None

    def decide(
        self, group: GroupPlan, form: ClosedForm, options: MatchOptions, lookups: MapLookups
    ) -> tuple[RowTruth, RowTruth, RowTruth]:
        """For which labels a group surely holds, surely fails, and is open; keeps the witness."""
        size = len(self.rows)
        self.decisions += 1
        if self.decisions > self.fit.most_decisions:
            return False, False, False
        if size == 1 and not form.takes_columns:
            holds, fails, self.values[group], open_ = form.evaluate_one(self.get(0), options, lookups)
            return holds, fails, open_
        holds, fails, self.values[group], open_ = self.evaluate(form, options, lookups)
        return _alike(_listed(holds, size)), _alike(_listed(fails, size)), _alike(_listed(open_, size))

    def unclear(self, *truths: RowTruth) -> Iterator[int]:
        """The numbers of labels of which nothing is true."""
        if True in truths:
            return iter(())
        told = [any(each) for each in zip(*(_listed(truth, len(self.rows)) for truth in truths), strict=True)]
        return (row.number for row, known in zip(self.rows, told, strict=True) if not known)

    def note_open(self, open_: RowTruth, place: int) -> None:
        """Note that a group of the plan is open of some labels."""
        before: list[int | None] = self.opens or [None] * len(self.rows)
        self.opens = [
            known if not mine else place if known is None else min(known, place)
            for known, mine in zip(before, _listed(open_, len(self.rows)), strict=True)
        ]

    def where(self, kept: RowTruth) -> _Batch:
        """The labels of which something is true: at least one."""
        if isinstance(kept, bool):
            return self
        mask = np.array(kept, dtype=bool)
        values: dict[GroupPlan, Mapping[Identity, Values]] = {
            group: {identity: _kept(column, mask, kept) for identity, column in found.items()}
            for group, found in self.values.items()
        }
        rows, numbers = itertools.compress(self.rows, kept), itertools.compress(self.numbers, kept)
        failures = None if self.failures is None else [*itertools.compress(self.failures, kept)]
        opens = None if self.opens is None else [*itertools.compress(self.opens, kept)]
        return _Batch(self.fit, [*rows], [*numbers], values, self.decisions, failures=failures, opens=opens)

    def note(self, depth: tuple[int, int], form: ClosedForm) -> None:
        """Note that a group fails of all labels, where nothing failed as far as that before."""
        before: list[_Failure | None] = self.failures or [None] * len(self.rows)
        self.failures = [
            _Failure(depth, form, mine) if known is None or known.depth < depth else known
            for known, mine in zip(before, self.numbers, strict=True)
        ]

    def lost(self, options: MatchOptions, lookups: MapLookups, opened: Container[int]) -> Iterator[FailedBatch]:
        """The labels, all failing now and none open, that have no other candidate, with what fails of them."""
        order, found = self.fit.order, dict[ClosedForm, list[int]]()
        if self.failures is None:
            return
        for number, (row, mine) in enumerate(zip(self.rows, self.numbers, strict=True)):
            failure = self.failures[number]
            played = row.number not in opened and all(row.candidates[index] for index in order[1:])
            if failure is not None and played and not _following(order, row.candidates, mine):
                found.setdefault(failure.form, []).append(number)
        for form, some in found.items():
            furthest = [failure.numbers for number in some if (failure := self.failures[number]) is not None]
            yield from _blamed(
                form, _Batch(self.fit, [self.rows[number] for number in some], furthest), options, lookups
            )

    def evaluate(self, form: ClosedForm, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        """What a closed form says of the labels."""
        if self.columns is None:
            # not a method of this batch: a cycle would keep its labels until the collector comes
            self.columns = Columns(len(self.rows), functools.partial(_column, self.fit.ranks, self.rows, self.numbers))
        return form.evaluate_many(self.get, self.columns, options, lookups)

    def with_next_role(self) -> list[_Batch]:
        """The labels with the first free candidate for the next role; without one, with the next for an earlier one."""
        index = self.fit.order[len(self.numbers[0])]
        numbers = [
            _with_first_free(taken, row.candidates[index]) for row, taken in zip(self.rows, self.numbers, strict=True)
        ]
        if all(numbers):
            # in place: the columns of the roles before stay what they are, and those of the next are made of it
            self.numbers[:] = numbers
            return [self]
        found = self.where(_alike([not each for each in numbers])).with_next_candidate()
        if any(numbers):
            batch = self.where(_alike([bool(each) for each in numbers]))
            batch.numbers = [each for each in numbers if each]
            found.append(batch)
        return found

    def with_next_candidate(self) -> list[_Batch]:
        """The labels with the next free candidate for the newest role that has one left, by how many are filled."""
        order = self.fit.order
        if len(self.rows) == 1:
            # most of the moves of a label by itself
            following = _following(order, self.rows[0].candidates, self.numbers[0])
            self.numbers, self.columns = [following], None
            return [self] if following else []
        numbers = [_following(order, row.candidates, taken) for row, taken in zip(self.rows, self.numbers, strict=True)]
        lengths = _alike([*map(len, numbers)])
        if isinstance(lengths, int):
            self.numbers, self.columns = numbers, None
            return [self] if lengths else []
        found: list[_Batch] = []
        for length in sorted({*lengths} - {0}):
            batch = self.where([each == length for each in lengths])
            batch.numbers, batch.columns = [each for each in numbers if len(each) == length], None
            found.append(batch)
        return found

    def filled(self) -> FilledBatch:
        """The labels with their witnesses."""
        size = len(self.rows)
        variables: list[Leaf] = []
        columns: list[Sequence[Value]] = []
        for group in self.fit.plan.groups:
            found = self.values[group]
            for leaf in group.group.variables if found else ():
                if leaf.identity in found:
                    variables.append(leaf)
                    columns.append(_listed(found[leaf.identity], size))
        witnesses = list(zip(*columns, strict=True)) if columns else [()] * size
        return FilledBatch(self.rows, self.numbers, tuple(variables), witnesses)

    def opened(self) -> OpenBatch:
        """The labels with what is open of them: of those that hold altogether, nothing."""
        rows, numbers, groups = list[LabelRow](), list[tuple[int, ...]](), list[Group]()
        for row, mine, place in zip(self.rows, self.numbers, self.opens or [None] * len(self.rows), strict=True):
            if place is not None:
                rows.append(row)
                numbers.append(mine)
                groups.append(self.fit.plan.groups[place].group)
        return OpenBatch(rows, numbers, groups)

    def get(self, number: int) -> Lookup:
        """The observed values of one label."""
        return _getter(self.rows[number], self.numbers[number], self.fit.ranks)


def _getter(row: LabelRow, numbers: tuple[int, ...], ranks: Mapping[int, int]) -> Lookup:
    """The observed values of one label."""
    known = row.seen

    def get(index: int, name: str) -> Value:
        playing = numbers[ranks[index]]
        return (known[playing] if playing in known else row.observed(playing))[name]

    return get


def _blamed(form: ClosedForm, batch: _Batch, options: MatchOptions, lookups: MapLookups) -> Iterator[FailedBatch]:
    """Labels of which a group fails, by its first constraint that fails alone, or else by the first."""
    left = batch
    for part in form.parts:
        fails = _listed(left.evaluate(part, options, lookups).fails, len(left.rows))
        if any(fails):
            some = left.where(fails)
            yield FailedBatch(some.rows, some.numbers, part.constraint, form)
            if all(fails):
                return
            left = left.where([not each for each in fails])
    yield FailedBatch(left.rows, left.numbers, form.constraint, form)


def _column(
    ranks: Mapping[int, int], rows: Sequence[LabelRow], numbers: Sequence[tuple[int, ...]], index: int, name: str
) -> FloatColumn | tuple[FloatColumn, FloatColumn]:
    """The values of a property of the label objects that play an object.

    Args:
        ranks: Where in the order of roles each object is.
        rows: The labels.
        numbers: Numbers of the label objects that play the first objects of that order, for each label.
        index: The object.
        name: The property.
    """
    if (index, name) == LABEL_OBJECTS:

        @functools.cache  # each property is asked of each of them
        def seen(place: int, number: int) -> Mapping[str, Value]:
            return rows[place].observe_without_course(number)

        def course(place: int, number: int) -> Value:
            return rows[place].course(number)

        some = functools.partial(elements_of, [row.label for row in rows], seen, course)
        return cast(FloatColumn, functools.cache(some))
    rank = ranks[index]
    if name in WHO:
        return _who(rows, [mine[rank] for mine in numbers], name)
    playing = [(row, mine[rank]) for row, mine in zip(rows, numbers, strict=True)]
    if name == COURSES:
        courses = tuple(row.observed(number)[COURSE] for row, number in playing)
        return cast(FloatColumn, CodedValues(np.arange(len(courses)), courses))
    if name == GOING:
        name = "heading"  # nan where there is none
    elif name == LAST_LANE:
        name = LAST
    elif name not in _SCALARS and name != "position":
        return _numeric([row.observed(number)[name] for row, number in playing])
    objects = [_label_object(row.label, number) for row, number in playing]
    if name == "position":
        x, y = np.array([(each.x, each.y) for each in objects], dtype=np.float64).reshape(-1, 2).T
        return x, y
    return np.array([getattr(each, name) for each in objects], dtype=np.float64)


def _who(rows: Sequence[LabelRow], playing: Sequence[int], name: str) -> FloatColumn:
    """The number of the label object that plays a role, or the place of its id in its label."""
    if name != RANK:
        return np.array(playing, dtype=np.float64)
    return np.array([
        sum(each.id < _label_object(row.label, number).id for each in (row.label.ego, *row.label.objects))
        for row, number in zip(rows, playing, strict=True)
    ], dtype=np.float64)  # fmt: skip


def _numeric(values: Sequence[Value]) -> FloatColumn | tuple[FloatColumn, FloatColumn]:
    """Values as a column, or as a pair of columns; `CannotEvaluate` where they are not all numbers or all vectors."""
    if all(isinstance(value, float) for value in values):
        return np.array(values, dtype=np.float64)
    if all(isinstance(value, tuple) for value in values):
        x, y = np.array(values, dtype=np.float64).T
        return x, y
    raise CannotEvaluate("what a closed form does not say")


def _label_object(label: Label, number: int) -> LabelObject:
    """The label object of a number; 0 is the label's ego."""
    return label.objects[number - 1] if number else label.ego


def _following(order: Sequence[int], candidates: Candidates, numbers: tuple[int, ...]) -> tuple[int, ...]:
    """The next numbers to try for the first roles of an order; () if all have been tried."""
    for length in range(len(numbers) - 1, 0, -1):
        options, taken = candidates[order[length]], numbers[:length]
        for one in options[options.index(numbers[length]) + 1 :]:
            if one not in taken:
                return (*taken, one)
    return ()


def _with_first_free(taken: tuple[int, ...], options: Sequence[int]) -> tuple[int, ...]:
    """The numbers taken so far and the first option that is free; () if none is."""
    for one in options:
        if one not in taken:
            return (*taken, one)
    return ()


def _kept(values: Values, mask: NDArray[np.bool_], kept: Sequence[bool]) -> FloatColumn | list[Value]:
    """The values of some of the labels."""
    return (
        values[mask] if isinstance(values, np.ndarray) else list(itertools.compress(_listed(values, len(kept)), kept))
    )


def _either(one: RowTruth, other: RowTruth) -> RowTruth:
    """Where one of two is true."""
    if isinstance(one, bool):
        return True if one else other
    if isinstance(other, bool):
        return True if other else one
    return _alike([a or b for a, b in zip(one, other, strict=True)])


def _alike(values: list[T]) -> T | list[T]:
    """One value if all are equal, else the list."""
    return values[0] if values.count(values[0]) == len(values) else values


def _listed(values: FloatColumn | Sequence[T] | T, size: int) -> list[T]:
    if isinstance(values, np.ndarray):
        return cast("list[T]", values.tolist())
    return cast("list[T]", values) if isinstance(values, list) else [cast(T, values)] * size


def first_fit_of(plan: MatchPlan, scenario: Scenario) -> FirstFit | None:
    """The plan made ready; None if some group has no closed form, or there are too many."""
    told = ((group, group.closed_form or observed_form_of(group.group)) for group in plan.groups)
    forms = [(group, form) for group, form in told if form is not None]
    if len(forms) < len(plan.groups):
        return None
    order = (scenario.ego, *(each.index for each in scenario.objects if each.index != scenario.ego))
    ranks = {index: rank for rank, index in enumerate(order)}
    due: list[list[tuple[GroupPlan, ClosedForm]]] = [[] for _ in order]
    for group, form in sorted(forms, key=lambda each: len(each[0].roles)):
        due[max((ranks[index] for index in group.roles), default=0)].append((group, form))
    most = LIMITS.fit_decisions + LIMITS.fit_decisions_a_role * (len(order) - 1)
    return FirstFit(plan, order, ranks, tuple(map(tuple, due)), most)


def signature_of(label: Label, ego: int, among: Candidates, relevant: tuple[frozenset[str], ...]) -> Signature | None:
    """What is observed of all candidates, if it is the same for all of a role."""
    params, own = _texts(tuple(label.params)), _observed_of(label, label.ego)
    if len(relevant) == 1:
        return _signature(relevant, ego, own, own, params)
    objects = label.objects
    numbers = {number for index, numbers in among.items() if index != ego for number in numbers}
    seen = {number: _observed_of(label, objects[number - 1]) for number in numbers}
    known = {_among(names, relevant) for names in {*seen.values()}}
    if len(known) == 1 and all(among[index] for index in range(len(relevant)) if index != ego):
        return _signature(relevant, ego, own, next(iter(known)), params)
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


def _observed_of(label: Label, label_object: LabelObject) -> frozenset[str]:
    """What is observed of an object of a label, by name; of what is recorded also its course."""
    names = observed_names(label_object)
    return names if label.recorded is None else _with_course(names)


@functools.lru_cache(maxsize=4096)
def _with_course(names: frozenset[str]) -> frozenset[str]:
    return names | {COURSE}


@functools.lru_cache(maxsize=4096)
def _among(names: frozenset[str], relevant: tuple[frozenset[str], ...]) -> frozenset[str]:
    """The names that are relevant for some object of the scenario."""
    return names & frozenset[str]().union(*relevant)


@functools.lru_cache(maxsize=4096)
def _texts(names: tuple[str, ...]) -> frozenset[str]:
    return frozenset(names)


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
