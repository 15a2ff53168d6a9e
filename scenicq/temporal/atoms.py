"""Atoms over the samples of a binding: the value of a boolean expression at each sample, all at once.

The one interface is `AtomColumns.truth`; nodes are interpreted in the domain of columns (`forest.column_domain`). A
sample at which something that is read is not observed makes what depends on it unknown, and nothing else. Where a field
allows several directions, any of them will do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.forest.among import LabelElements, among_column, concatenate, take_rows
from scenicq.forest.clear_columns import QuickColumns, quick_form
from scenicq.forest.column_domain import ColumnDomain, first_direction
from scenicq.forest.columns import (
    DEFINED,
    UNDEFINED,
    CodedValues,
    Column,
    arrays_of,
    column_of,
    constant_column,
    truth_of,
)
from scenicq.forest.columns import UNKNOWN as UNOBSERVED
from scenicq.forest.condition import expand
from scenicq.forest.course_ends import has_ends
from scenicq.forest.ego_frame import DISTANCE, PLACE
from scenicq.forest.interpret import OnMap, Steps, interpret, steps_of
from scenicq.forest.nodes import (
    COURSE,
    GOING,
    LAST_LANE,
    PAST,
    Among,
    DirectionAt,
    Feature,
    Identity,
    LaneCourse,
    Leaf,
    Node,
    Value,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import Atom
from scenicq.forest.unobserved import certain_and_possible, is_only_observed
from scenicq.forest.walk import children, is_leaf, leaves, postorder
from scenicq.limits import LIMITS
from scenicq.match.problem.observation import rule_of_courses
from scenicq.temporal.grouping import group_equal
from scenicq.temporal.samples import FIXED, BoundSamples, RoleSamples, is_moving
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["AtomColumns", "UnclearVariable", "reads_start"]


Numbers: TypeAlias = NDArray[np.float64]


def reads_start(condition: Node) -> bool:
    """Whether an expanded condition over time depends on what was observed at the first sample."""
    nodes = postorder((condition,))
    return any(isinstance(node, Feature) and not node.current and node.property not in FIXED for node in nodes)


def _is_speed(node: Node) -> bool:
    return isinstance(node, Feature) and node.property == "speed"


def _is_none(_: Node) -> bool:
    return False


class UnclearVariable(Exception):
    """What a condition over time depends on a random variable for is not known by arrays; the message says why."""


@dataclass(frozen=True, slots=True)
class _LookedUp:
    """An expression of which some parts are known whatever the random variables are.

    Attributes:
        root: The expression.
        steps: Those in which the rest is interpreted.
        given: The values of these parts.
    """

    root: Node
    steps: Steps
    given: Mapping[int, Column]


@dataclass(eq=False)
class AtomColumns:
    """The conditions of a scenario over the samples of a binding.

    Attributes:
        scenario: The scenario.
        samples: The samples.
        assignment: Values of random variables.
        start: For each sample the first one of its run, at which what is not current is read; None where each is one.
        given: Values of some nodes, by their ids.
        undecided: Samples at which more directions were allowed than were tried.
    """

    scenario: Scenario
    samples: RoleSamples
    assignment: Mapping[Identity, Value] = field(default_factory=dict["Identity", "Value"])
    start: NDArray[np.int64] | None = None
    given: Mapping[int, Column] = field(default_factory=dict["int", "Column"])
    undecided: list[NDArray[np.bool_]] = field(default_factory=list["NDArray[np.bool_]"])
    _features: dict[tuple[int, str], Column | None] = field(default_factory=dict["tuple[int, str]", "Column | None"])
    _looked_up: dict[int, _LookedUp] = field(default_factory=dict["int", "_LookedUp"])
    _elements: list[tuple[int, int, LabelElements | None]] = field(
        default_factory=list["tuple[int, int, LabelElements | None]"]
    )
    _readings: dict[int, tuple[Node, NDArray[np.int64]]] = field(default_factory=dict["int", "tuple[Node, Any]"])

    def assigned(self, assignment: Mapping[Identity, Value]) -> AtomColumns:
        """The same with values of random variables; what is observed, and the map's answers about it, are shared."""
        return AtomColumns(
            self.scenario, self.samples, assignment, self.start, self.given, self.undecided, self._features,
            self._looked_up, self._elements,
        )  # fmt: skip

    def assuming(self, given: Mapping[int, Column]) -> AtomColumns:
        """The same with values of some nodes, by their ids; what is observed is shared."""
        return AtomColumns(
            self.scenario, self.samples, self.assignment, self.start, given, self.undecided, self._features,
            self._looked_up, self._elements,
        )  # fmt: skip

    def expanded(self, condition: Node) -> Node:
        """A condition with the program's own value of what no label observes and what does not change."""
        return expand(condition, self._definition)

    def unknown(self) -> Truth:
        """Unknown at each sample, shape (n,)."""
        return np.full(len(self.samples), UNKNOWN)

    def truth(self, condition: Node) -> Truth:
        """The value of a condition at each sample, shape (n,).

        Raises:
            UnclearVariable: It depends on a random variable without a value.
        """
        return self.truth_of(self.expanded(condition))

    def truth_of(self, condition: Node) -> Truth:
        """As `truth`, of an expanded condition; unknown where too many directions are allowed to try them all."""
        look()
        found = np.full(len(self.samples), FALSE)
        several = np.zeros(len(self.samples), np.bool_)
        todo: list[dict[int, int]] = [{}]
        seen = {frozenset[tuple[int, int]]()}
        for _ in range(1 + LIMITS.direction_choices):
            if not todo:
                return self._with_bounds(condition, found)
            picks = todo.pop(0)
            counts: dict[int, NDArray[np.intp]] = {}
            found = np.maximum(found, self._truth(condition, picks, counts))
            for node, count in counts.items():
                several |= count > 1
                # a direction may lead to where other ones are allowed
                for number in range(1, int(count.max())) if node not in picks else ():
                    further = {**picks, node: number}
                    if (key := frozenset(further.items())) not in seen:
                        seen.add(key)
                        todo.append(further)
        if todo:
            open_ = several & (found != TRUE)
            self.undecided.append(open_)
            found[open_] = UNKNOWN
        return found

    def reader(self, conditions: Sequence[Node], given: Mapping[int, Truth] | None = None) -> Callable[[Atom], Truth]:
        """What gives the value of an atom at each sample, each worked out when it is first asked for.

        Args:
            conditions: The expanded conditions that atoms stand for.
            given: Values of some that are known already, by their numbers.
        """
        known = dict(given or {})

        def read(atom: Atom) -> Truth:
            if atom.number not in known:
                known[atom.number] = self.truth_of(conditions[atom.number])
            return known[atom.number]

        return read

    def _with_bounds(self, condition: Node, found: Truth) -> Truth:
        """The truth where a condition is the same for every speed that is not observed, and between ends of courses."""
        # between two cells a bound of a hidden number would be another one
        if not (found == UNKNOWN).any() or leaves(condition):
            return found
        nodes = list(postorder((condition,)))
        # first as if all speeds were observed
        unobserved: list[Callable[[Feature | Among], bool]] = [_is_none] if any(map(has_ends, nodes)) else []
        for reads in [*unobserved, *([_is_speed] if any(map(_is_speed, nodes)) else [])]:
            open_ = found == UNKNOWN
            certain, possible = certain_and_possible(condition, reads)
            found[open_ & (self._truth(possible, {}, {}) == FALSE)] = FALSE
            found[open_ & (self._truth(certain, {}, {}) == TRUE)] = TRUE
        return found

    def number(self, node: Node) -> Numbers | None:
        """The values of an expanded scalar expression, nan where it has none; None if it is no one number."""
        found = self.scalar(node)
        return None if found is None else found[0]

    def scalar(self, node: Node) -> tuple[Numbers, NDArray[np.bool_]] | None:
        """As `number`, with where the value is not known."""
        found = self.column(node)
        if found is None:
            return None
        data, status = found
        if not isinstance(data, np.ndarray) or data.dtype == np.bool_:
            return None
        n = len(self.samples)
        values = np.where(status == DEFINED, data, np.nan)
        return np.broadcast_to(values, n).copy(), np.broadcast_to(status == UNOBSERVED, n).copy()

    def column(self, node: Node) -> Column | None:
        """The values of an expanded expression; None where a field allows several directions.

        Raises:
            UnclearVariable: It depends on a random variable without a value.
        """
        counts: dict[int, NDArray[np.intp]] = {}
        found = self._evaluate(node, {}, counts)
        return None if any((each > 1).any() for each in counts.values()) else found

    def with_first_directions(self, node: Node) -> tuple[Column, NDArray[np.bool_]]:
        """As `column`, with the first of several directions, and where a field allows several; shape (n,).

        Raises:
            UnclearVariable: It depends on a random variable without a value.
        """
        counts: dict[int, NDArray[np.intp]] = {}
        found, several = self._evaluate(node, {}, counts), np.zeros(len(self.samples), np.bool_)
        for each in counts.values():
            several |= np.greater(each, 1)
        return found, several

    def observed(self, feature: Feature, sample: int) -> Value:
        """What is observed of a feature at a sample; None if nothing is."""
        column = self._feature(feature)
        if column is None or column.status[sample] != DEFINED:
            return None
        match column.data:
            case CodedValues(which, options):
                return options[int(which[sample])]
            case (x, y):
                return float(x[sample]), float(y[sample])
            case np.ndarray() as data:
                return cast("float | bool", data[sample].item())
            case _:
                return None

    def readings(self, condition: Node) -> NDArray[np.int64]:
        """What an expanded condition reads at each sample, by number; -1 where some of it is not observed.

        Equal numbers are equal readings. Shape (n,).
        """
        if id(condition) not in self._readings:
            self._readings[id(condition)] = condition, self._read(condition)
        return self._readings[id(condition)][1]

    def _read(self, condition: Node) -> NDArray[np.int64]:
        nodes = [each for each in postorder((condition,)) if isinstance(each, Feature) and each.current]
        found, observed = np.zeros(len(self.samples), np.int64), np.ones(len(self.samples), np.bool_)
        for each in nodes:
            column = self._feature(each)
            if column is None:
                return np.full(len(self.samples), -1)
            observed &= column.status == DEFINED
            for part in arrays_of(column.data):
                _, codes = np.unique(part, return_inverse=True)
                _, found = group_equal(found * (int(codes.max(initial=0)) + 1) + codes)
        return np.where(observed, found, -1)

    def _definition(self, feature: Feature) -> Node | None:
        if is_moving(feature.property) or self._feature(feature) is not None:
            return None
        if is_only_observed(self.scenario, feature.object, feature.property):
            return None
        return self.scenario.every_object[feature.object].properties[feature.property].value

    def _truth(self, condition: Node, chosen: Mapping[int, int], counts: dict[int, NDArray[np.intp]]) -> Truth:
        found = self._quickly(condition)
        if found is None:
            return _as_truth(self._evaluate(condition, chosen, counts), len(self.samples))
        open_ = np.flatnonzero(found == UNKNOWN)
        if len(open_):
            domain = ColumnDomain(lambda node: self._observed_at(node, open_), self._assigned, first_direction)
            with np.errstate(all="ignore"):
                found[open_] = _as_truth(interpret(steps_of(condition), domain)[id(condition)], len(open_))
        return found

    def _quickly(self, condition: Node) -> Truth | None:
        """The value of a condition at each sample, unknown where rounding may decide; None if that saves nothing."""
        samples = self.samples
        if self.given or not isinstance(samples, BoundSamples):
            return None
        ego = self.scenario.ego
        if not samples.block.are_egos(samples.members[ego]):
            return None
        quick = quick_form(condition, ego)
        if quick is None:
            return None
        domain = QuickColumns(self._observed, self._assigned, first_direction)
        with np.errstate(all="ignore"):
            return _as_truth(interpret(steps_of(quick), domain)[id(quick)], len(samples))

    def _evaluate(self, root: Node, chosen: Mapping[int, int], counts: dict[int, NDArray[np.intp]]) -> Column:
        """The values of an expression.

        Args:
            root: The expression.
            chosen: Which of several directions a field takes, by the id of its node; the first if not given.
            counts: Gets how many directions a field allows at each sample, where these are several somewhere.
        """

        def pick(node: DirectionAt, allowed: NDArray[np.intp]) -> NDArray[np.intp]:
            counts[id(node)] = allowed
            return np.full(1, chosen.get(id(node), 0))

        domain = ColumnDomain(self._observed, self._assigned, pick, others=self._others)
        with np.errstate(all="ignore"):
            if not self.assignment:
                return interpret(steps_of(root, known=self.given), domain, self.given)[id(root)]
            if id(root) not in self._looked_up:
                self._looked_up[id(root)] = self._look_up(root)
            asked = self._looked_up[id(root)]
            return interpret(asked.steps, domain, asked.given)[id(root)]

    def _look_up(self, root: Node) -> _LookedUp:
        """Ask the map about what is observed, once for all values of random variables."""
        hidden: set[int] = set()
        steps: list[tuple[Node, tuple[Node, ...]]] = []
        for node in postorder((root,)):
            below = children(node)
            if is_leaf(node) or any(id(each) in hidden for each in below):
                hidden.add(id(node))
            else:
                steps.append((node, below))
        several: set[int] = set()

        def pick(node: DirectionAt, _: NDArray[np.intp]) -> NDArray[np.intp]:
            several.add(id(node))
            return np.zeros(1, np.intp)

        known = interpret(steps, ColumnDomain(self._observed, self._assigned, pick, others=self._others))
        given: dict[int, Column] = {}
        for node, below in steps:
            # each of several directions is tried
            if id(node) in several or any(id(each) in several for each in below):
                several.add(id(node))
            elif isinstance(node, OnMap | Among):
                given[id(node)] = known[id(node)]
        return _LookedUp(root, steps_of(root, known=given), given)

    def _assigned(self, leaf: Leaf, _args: Sequence[Column]) -> Column:
        if leaf.identity not in self.assignment:
            raise UnclearVariable("a hidden random variable over time")
        return constant_column(self.assignment[leaf.identity])

    def _others(self, node: Among, inputs: Sequence[Column]) -> Column:
        """What holds of the label objects of each sample; unknown where the samples are of one binding alone."""
        samples = self.samples
        if not isinstance(samples, BoundSamples) or not len(samples):
            return Column(np.full(1, np.nan), np.full(1, UNOBSERVED))
        rules = rule_of_courses(self.scenario)
        if not self._elements:
            self._elements += samples.pieces(rules)
        found: list[Column] = []
        for first, end, elements in self._elements:
            look()
            # those of many samples are not kept
            there = elements or samples.at(np.arange(first, end)).elements(rules)
            rows = np.arange(first, end)
            mine = [each if _is_one(each) else take_rows(each, rows, len(samples)) for each in inputs]
            found.append(among_column(node, mine, there))
        return found[0] if len(found) == 1 else concatenate(found)

    def _observed_at(self, node: Feature, samples: NDArray[np.int64]) -> Column:
        """What is observed of a feature at some samples."""
        found = self._observed(node)
        return found if len(found.status) != len(self.samples) else _as_at(samples, found)

    def _observed(self, node: Feature) -> Column:
        found = self._feature(node)
        if found is None:
            return Column(np.full(1, np.nan), np.full(1, UNOBSERVED))
        return found if node.current or self.start is None else _as_at(self.start, found)

    def _seen(self, index: int, name: str) -> tuple[Numbers, ...] | list[Value] | None:
        if name in (PLACE, DISTANCE):
            assert isinstance(self.samples, BoundSamples)
            return self.samples.seen(self.scenario.ego, index, name)
        if name.startswith(PAST):
            return None
        if name == COURSE:
            rules = self.scenario.objects[index].properties[COURSE].value
            assert isinstance(rules, LaneCourse)
            return self.samples.courses(index, rules)
        return self.samples.observed(index, name)

    def _feature(self, node: Feature) -> Column | None:
        """What is observed of a feature; None if no sample has it."""
        key = node.object, node.property
        if key not in self._features:
            seen = self._seen(*key)
            if seen is None:
                self._features[key] = None
            elif isinstance(seen, list):
                self._features[key] = column_of(seen)
            else:
                # who is there without a heading may go any way
                there = self._seen(node.object, "position") if node.property in (GOING, LAST_LANE) else None
                told = there[0] if isinstance(there, tuple) else seen[0]
                status = np.where(np.isnan(told), UNOBSERVED, DEFINED)
                self._features[key] = Column((seen[0], seen[1]) if len(seen) == 2 else seen[0], status)
        return self._features[key]


def _is_one(column: Column) -> bool:
    """Whether a column has one value for all places."""
    return all(part.size == 1 for part in (*arrays_of(column.data), column.status))


def _as_truth(found: Column, count: int) -> Truth:
    """A column of truth values as so many."""
    held = np.where(truth_of(found.data), TRUE, FALSE)
    truth = np.where(found.status == DEFINED, held, np.where(found.status == UNDEFINED, FALSE, UNKNOWN))
    return np.broadcast_to(truth, count).copy()


def _as_at(samples: NDArray[np.int64], column: Column) -> Column:
    """What was observed, at some samples."""
    data, status = column.data, column.status[samples]
    match data:
        case CodedValues():
            return Column(CodedValues(data.which[samples], data.options), status)
        case (x, y):
            return Column((x[samples], y[samples]), status)
        case np.ndarray():
            return Column(data[samples], status)
        case _:
            raise TypeError("no feature is a region")
