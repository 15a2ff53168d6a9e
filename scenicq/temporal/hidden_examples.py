"""Runs whose conditions depend on random variables without intervals to split, such as a hidden point.

An *example* is values of the variables with which the label at the start matches; with it, every condition has a truth
at every sample. The question is which other truths other values can give:

1. The matcher gives a first example.
2. It is asked for bounds of the numbers and points that do not change over time. Where the bounds decide a condition
   (`enclosures`), its truth is *certain*.
3. It is asked for examples that give some other conditions another truth: many at once, then fewer. Where there is no
   such example, the truth is certain; else it is *open*.
4. Open conditions are assumed true and assumed false, from the first sample on, as long as an example agrees with all
   assumptions, until the run is decided.

So every outcome of the run is found, each with values that lead to it.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import limited, look
from scenicq.errors import CannotEvaluate
from scenicq.forest.build import constant
from scenicq.forest.draws import draw_leaf
from scenicq.forest.evaluate import evaluate_all
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    Feature,
    Identity,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Undefined,
    Value,
)
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.forest.walk import leaves, transform
from scenicq.limits import LIMITS
from scenicq.match.explanation import Finding
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch, WitnessValue
from scenicq.smt.answer import Solver
from scenicq.store.labels import Label
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.definedness import untrue
from scenicq.temporal.enclosures import Bounds, certainly, unchanging
from scenicq.temporal.runs import Runs
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["Example", "Examples", "InitialScene", "StartLabel"]

StartLabel = tuple[Label, Mapping[str, str]]
"""The label of a start, and its correspondence."""


_REACHES = (1.0, 4.0, 16.0)
"""How far beyond examples a number or a coordinate may be, tried in this order: in metres, radians, ..."""
_CLOSE = 1 / 8
"""Bounds are halved until their distance from the examples is this share of what it was."""
_SHARE = 0.2
"""The share of the time for one start that one question about bounds may take."""

_Place = tuple[int, int]
"""The number of a condition, and a sample."""
_Case = tuple[Mapping[int, Truth], tuple[Node, ...], Sequence["Example"]]
"""The truths of conditions, the assumptions, and the examples that agree with them."""


@dataclass(slots=True)
class InitialScene:
    """The initial scene of a program, which the labels of starts must match.

    Attributes:
        scenario: The scenario; its conditions over time are left out.
        match: Options of the matcher.
        solver: Decides what nothing of our own decides.
    """

    scenario: Scenario
    match: MatchOptions
    solver: Solver | None
    _plain: Matcher | None = None

    def examine(self, start: StartLabel, wanted: Node | None) -> Finding:
        """Match the label of a start with its correspondence, under one more condition if there is one."""
        if wanted is None:
            self._plain = self._plain or self._matcher(self.scenario.requirements)
            matcher = self._plain
        else:
            matcher = self._matcher((*self.scenario.requirements, Requirement(wanted, None)))
        return matcher.examine(*start)

    def _matcher(self, requirements: Sequence[Requirement]) -> Matcher:
        initial = replace(self.scenario, requirements=tuple(requirements), dynamics=None)
        return Matcher(initial, self.match, self.solver)


@dataclass(frozen=True, slots=True)
class Example:
    """Values of random variables with which a label matches.

    Attributes:
        values: The values of the variables that conditions over time read.
        witness: The values of all variables, by their places in the program.
        truth: The truth of each condition that depends on them, at each sample.
    """

    values: Mapping[Identity, Value]
    witness: Mapping[str, WitnessValue]
    truth: Mapping[int, Truth]


@dataclass(slots=True)
class Examples:
    """Finds the truths that values of random variables can give to conditions, for one start.

    Attributes:
        initial: The initial scene.
        start: The label of the start.
        columns: The samples as columns.
        conditions: The conditions that depend on random variables, expanded, by number.
        first: The sample of the start.
        decide: Decides the run from the truths of these conditions.
        found: The examples so far.
    """

    initial: InitialScene
    start: StartLabel
    columns: AtomColumns
    conditions: Mapping[int, Node]
    first: int
    decide: Callable[[Mapping[int, Truth]], Runs]
    found: list[Example] = field(default_factory=list[Example])
    _asked: int = 0
    _same_reading: dict[int, NDArray[np.int64]] = field(default_factory=dict[int, "NDArray[np.int64]"])
    _observed: dict[int, NDArray[np.bool_]] = field(default_factory=dict[int, "NDArray[np.bool_]"])

    def _compare_readings(self) -> None:
        """Find the samples at which a condition reads the same values, so that it has one truth."""
        readings = {number: self.columns.readings(each) for number, each in self.conditions.items()}
        self._observed = {number: each >= 0 for number, each in readings.items()}
        self._same_reading = {number: _first_same_reading(each, self.first) for number, each in readings.items()}

    def outcomes(self) -> list[tuple[Runs, Example]] | None:
        """Every outcome of the run, with an example; some may be unknown. None if there is no example."""
        certain = self._certain()
        if certain is None:
            return None
        found: list[tuple[Runs, Example]] = []
        cases: list[_Case] = [(certain, (), self.found[:])]
        while cases:
            look()
            known, assumed, examples = cases.pop()
            run = self.decide(known)
            settled = run.truth[0] != UNKNOWN and not run.open_[0]
            place = None if settled else self._open_place(known, examples[0])
            if place is None:
                found.append((run, examples[0]))
                continue
            for truth in (FALSE, TRUE):
                statement = self._state(*place, holds=bool(truth == TRUE))
                if statement is None:
                    found.append((run, examples[0]))
                    continue
                further = (*assumed, statement)
                fit = [each for each in examples if each.truth[place[0]][place[1]] == truth]
                answer = bool(fit) or self._ask(Logic(LogicOp.AND, further) if assumed else further[0])
                if answer and not fit:
                    fit = [each for each in self.found[-1:] if each.truth[place[0]][place[1]] == truth]
                if fit:
                    number, sample = place
                    more = {**known, number: known[number].copy()}
                    more[number][self._same_reading[number] == self._same_reading[number][sample]] = truth
                    cases.append((more, further, fit))
                elif answer is not False:
                    found.append((run, examples[0]))
        return found

    def _open_place(self, known: Mapping[int, Truth], example: Example) -> _Place | None:
        """The first place at which a condition is open; None where only observations are missing."""
        samples = range(self.first, len(self.columns.samples))
        return next(
            (
                (number, sample)
                for sample in samples
                for number in self.conditions
                if known[number][sample] == UNKNOWN
                and example.truth[number][sample] != UNKNOWN
                and self._observed[number][sample]
            ),
            None,
        )

    def _certain(self) -> Mapping[int, Truth] | None:
        """The certain truths of each condition, unknown where it is open; None if there is no example."""
        if self._ask(None) is not True:
            return None
        # takes as long as there are samples, which a start without an example shall not
        self._compare_readings()
        base = self.found[0].truth
        asked_places = [
            (number, sample)
            for number, sample in self._undecided_by_bounds()
            if self._same_reading[number][sample] == sample
        ]
        open_ = {(n, k) for n, k in asked_places if any(each.truth[n][k] != base[n][k] for each in self.found)}
        stack = [asked_places] if asked_places else []
        while stack:
            look()
            asked = [each for each in stack.pop() if each not in open_]
            # conditions on what is not observed, and those that cannot be stated, may have either truth
            negated = {
                place: statement
                for place in asked
                if self._observed[place[0]][place[1]]
                and (statement := self._state(*place, holds=bool(base[place[0]][place[1]] != TRUE))) is not None
            }
            open_ |= set(asked) - negated.keys()
            block, questions = [*negated], tuple(negated.values())
            if not block:
                continue
            answer = self._ask(questions[0] if len(block) == 1 else Logic(LogicOp.OR, questions))
            if answer is False:
                continue
            if answer is True:
                other = self.found[-1].truth
                changed = {(n, k) for n, k in block if other[n][k] != base[n][k]}
                if changed:
                    open_ |= changed
                    stack.append(block)
                    continue
            if len(block) == 1:
                open_.add(block[0])
            else:
                stack += [block[: len(block) // 2], block[len(block) // 2 :]]
        certain = {number: truth.copy() for number, truth in base.items()}
        for number, sample in open_:
            certain[number][self._same_reading[number] == sample] = UNKNOWN
        return certain

    def _undecided_by_bounds(self) -> list[_Place]:
        """Places that bounds of unchanging numbers and points do not decide."""
        nodes = unchanging(list(self.conditions.values()))
        bounds: dict[int, Sequence[Bounds]] = {}
        left = self._open_beside(bounds)
        for narrowed in (self._find_bounds, self._tighten):
            for node in nodes if left else ():
                found = narrowed(_numbers_of(node), bounds.get(id(node)))
                if found is not None:
                    bounds[id(node)] = found
            left = self._open_beside(bounds)
        return left

    def _open_beside(self, bounds: Mapping[int, Sequence[Bounds]]) -> list[_Place]:
        """Places at which the first example decides a condition, and bounds do not."""
        found: list[_Place] = []
        for number, each in self.conditions.items():
            base = self.found[0].truth[number]
            open_ = (base != UNKNOWN) & (base != certainly(self.columns, each, bounds))
            found += [(number, place) for place in np.flatnonzero(open_).tolist() if place >= self.first]
        return found

    def _find_bounds(self, parts: Sequence[Node], _: object) -> Sequence[Bounds] | None:
        """Find bounds of numbers, the closest to the examples that hold for all values; None if there are none."""
        for reach in _REACHES:
            bounds = [(low - reach, high + reach) for low, high in map(self._span, parts)]
            if not all(map(math.isfinite, itertools.chain(*bounds))):
                return None
            sides = [each for part, ends in zip(parts, bounds, strict=True) for each in _beyond(part, *ends)]
            answer = self._ask_briefly(Logic(LogicOp.OR, tuple(sides)))
            if answer is not True:
                return None if answer is None else bounds
        return None

    def _tighten(self, parts: Sequence[Node], bounds: Sequence[Bounds] | None) -> Sequence[Bounds] | None:
        """Move bounds closer to the examples; more examples are found on the way."""
        return bounds and [self._tighten_one(*each) for each in zip(parts, bounds, strict=True)]

    def _tighten_one(self, part: Node, bounds: Bounds) -> Bounds:
        ends = list(bounds)
        for side in (0, 1):
            close = abs(ends[side] - self._span(part)[side]) * _CLOSE
            while abs(ends[side] - (inner := self._span(part)[side])) > close:
                ends[side], outer = (ends[side] + inner) / 2, ends[side]
                answer = self._ask_briefly(_beyond(part, *ends)[side])
                if answer is not False:
                    ends[side] = outer
                if answer is None:
                    break
        return ends[0], ends[1]

    def _ask_briefly(self, wanted: Node) -> bool | None:
        with limited(self.initial.match.timeout_s * _SHARE):
            return self._ask(wanted)

    def _span(self, part: Node) -> Bounds:
        """The least and greatest value of a number among the examples; nan where one has no value."""
        found = [self.columns.assigned(each.values).number(part) for each in self.found]
        values = [math.nan if each is None else float(each[self.first]) for each in found]
        return float(np.min(values)), float(np.max(values))

    def _ask(self, wanted: Node | None) -> bool | None:
        """Look for an example with which a condition holds, and keep it; False if there is none, None if not known."""
        if self._asked >= LIMITS.start_questions:
            return None
        self._asked += 1
        finding = self.initial.examine(self.start, wanted)
        verdict = finding.verdict
        if isinstance(verdict, NoMatch):
            return False
        if not isinstance(verdict, Match):
            return None
        values = _assignment(leaves(*self.conditions.values()), finding.values())
        if values is None:
            return None
        columns = self.columns.assigned(values)
        truth = {number: columns.truth_of(each) for number, each in self.conditions.items()}
        self.found.append(Example(values, verdict.witness, truth))
        return True

    def _state(self, number: int, sample: int, *, holds: bool) -> Node | None:
        """State for the matcher that a condition holds at a sample, or fails there; None if it cannot be stated."""

        def observed(node: Node) -> Node:
            # what is read at the start is observed by the label
            return constant(self.columns.observed(node, sample)) if isinstance(node, Feature) and node.current else node

        here = transform(self.conditions[number], observed)
        return here if holds else untrue(here)


def _first_same_reading(readings: NDArray[np.int64], first: int) -> NDArray[np.int64]:
    """For each sample the first one, from the start on, at which a condition reads the same observed values."""
    found = np.arange(len(readings))
    after = readings[first:]
    _, where, which = np.unique(after, return_index=True, return_inverse=True)
    found[first:] = np.where(after >= 0, first + where[which], found[first:])
    return found


def _assignment(variables: Sequence[Leaf], known: Mapping[Identity, Value]) -> Mapping[Identity, Value] | None:
    """The value of each variable, by identity, as several may share a place; None if one has no value."""

    def value(leaf: Leaf, parameters: tuple[Value, ...]) -> Value:
        # a variable that the initial scene does not restrict may have any value
        told = known.get(leaf.identity)
        return draw_leaf(leaf, parameters, random.Random(0)) if told is None else told

    try:
        drawn = evaluate_all(tuple(variables), value)
    except CannotEvaluate:
        return None
    found = {leaf.identity: drawn[id(leaf)] for leaf in variables}
    return None if any(isinstance(each, Undefined) for each in found.values()) else found


def _numbers_of(node: Node) -> list[Node]:
    """A number, or both coordinates of a point."""
    return [Coordinate(node, axis) for axis in (0, 1)] if kind_of(node) == "vector" else [node]


def _beyond(number: Node, low: float, high: float) -> tuple[Node, Node]:
    """The conditions that a number is below one end, and above the other."""
    return Compare(CompareOp.LT, number, Constant(low)), Compare(CompareOp.GT, number, Constant(high))
