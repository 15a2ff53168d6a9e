"""Runs whose conditions hang on random variables of the scene: the best that any values of these make of each start."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import Exhausted, limited, look
from scenicq.forest.nodes import Compare, CompareOp, Constant, Identity, Logic, LogicOp, Node, Value
from scenicq.forest.scenario import Scenario
from scenicq.forest.simplify import roots_of
from scenicq.forest.walk import leaves
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown, WitnessValue
from scenicq.smt.answer import Solver
from scenicq.temporal.atoms import AtomColumns, UnclearVariable
from scenicq.temporal.hidden import inside
from scenicq.temporal.hidden_bounds import PossibleValues
from scenicq.temporal.hidden_conditions import HiddenConditions
from scenicq.temporal.hidden_examples import Example, Examples, Remembered, examine_start
from scenicq.temporal.outcomes import place_of
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Runs
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["HiddenRuns", "Remembered"]

Numbers = NDArray[np.float64]
_THIN = 4e-12
"""Relative width of a piece of values below which rounding may decide: there, a run is followed again with a value."""


@dataclass(frozen=True, eq=False, slots=True)
class HiddenRuns:
    """What decides runs with hidden random variables.

    Attributes:
        machine: What the program says about time.
        scenario: The scenario.
        match: Options of the matcher.
        solver: Decides what is not decided otherwise.
        reasons: Whether somebody reads what runs fail at.
    """

    machine: RunMachine
    scenario: Scenario
    match: MatchOptions
    solver: Solver | None
    reasons: bool = True

    def follow(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered],
    ) -> Runs:  # fmt: skip
        """What becomes of the runs from all starts: the best that any values make of each first, then others.

        Args:
            stretches: Stretches with their starts.
            columns: Over their places.
            expanded: Conditions over time.
            remember: The label of a start by its number.
        """
        try:
            with limited(self.match.timeout_s * (len(stretches.bounds) - 1)):
                return self._by_values(stretches, columns, expanded, remember)
        except (UnclearVariable, Exhausted):
            pass
        # what is unclear of one stretch is not so of all
        parts: list[Runs] = []
        for places, mine in stretches.apart():
            whole = np.arange(int(places.start), int(places.stop), dtype=np.int64)
            one = stretches.some(whole)
            own = self._of_stretch(one, AtomColumns(self.scenario, one.places, start=one.heads()), expanded, remember)
            parts.append(own.at(np.arange(int(mine.start), int(mine.stop)), whole))
        return Runs.joined(parts)

    def _of_stretch(
        self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered],
    ) -> Runs:  # fmt: skip
        """The runs of one stretch."""
        try:
            with limited(self.match.timeout_s):
                return self._by_values(stretch, columns, expanded, remember)
        except Exhausted as error:
            return Runs.unknown(stretch.starts, stretch.ends()).with_detail(str(error))
        except UnclearVariable as error:
            reason = str(error)
        # what the initial scene says of the variables may be enough
        every, parts = np.arange(len(stretch)), list[Runs]()
        for start, number in enumerate(cast("list[int]", stretch.numbers.tolist())):
            own = self._by_examples(stretch.beginning(start), columns, expanded, remember(number), reason)
            parts.append(own.at(np.array([start]), every))
        return Runs.joined(parts)

    def _by_values(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered],
    ) -> Runs:  # fmt: skip
        """The runs by the values of hidden numbers."""
        hidden = HiddenConditions(columns, expanded)
        if self.reasons:
            return self._within(stretches, columns, expanded, remember, hidden, None)
        possible = PossibleValues.of(self.machine, stretches, columns.reader(expanded), hidden)
        which = possible.any
        if which.all():
            return self._within(stretches, columns, expanded, remember, hidden, (possible.low, possible.high))
        lost = Runs.lost(stretches.starts).some(~which)
        if not which.any():
            return lost
        some, chosen = stretches.only(which)
        own = AtomColumns(self.scenario, some.places, start=some.heads())
        limits = possible.low[which], possible.high[which]
        part = self._within(some, own, expanded, remember, HiddenConditions(own, expanded), limits)
        return Runs.joined([part.at(np.flatnonzero(which), chosen), lost])

    def _within(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered], hidden: HiddenConditions, possible: tuple[Numbers, Numbers] | None,
    ) -> Runs:  # fmt: skip
        """The runs by those values of hidden numbers with which they may match, or by all."""
        pieces = follow_runs(self.machine, stretches, columns.reader(expanded), hidden, possible)
        self._confirm(pieces, stretches, columns, expanded, hidden)
        order = np.lexsort((*pieces.low.T[::-1], -pieces.ends, -pieces.truth.astype(np.int64), pieces.of))
        shared = {leaf.identity for leaf in leaves(*roots_of(replace(self.scenario, dynamics=None)))}
        joint = [place for place, leaf in enumerate(hidden.variables) if leaf.identity in shared]
        firsts = np.flatnonzero(np.diff(pieces.of[order], prepend=-1))
        every = np.arange(len(stretches.starts))
        if joint:
            found = self._again(pieces, np.split(order, firsts[1:]), hidden, joint, stretches, remember)
            return found.at(every, np.arange(len(stretches)))
        matches = order[pieces.truth[order] == TRUE]
        # one piece for each end
        new = (np.diff(pieces.of[matches], prepend=-1) != 0) | (np.diff(pieces.ends[matches], prepend=-1) != 0)
        kept = np.zeros(len(pieces), np.bool_)
        kept[order[firsts]] = kept[matches[new]] = True
        for each in cast("list[int]", matches[new].tolist()):
            pieces.details[each] = "", _witness(hidden, pieces, each)
        return pieces.some(order[kept[order]]).at(every, np.arange(len(stretches)))

    def _confirm(
        self, pieces: Runs, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        hidden: HiddenConditions,
    ) -> None:  # fmt: skip
        """Follow runs again with a value each where so few values match that rounding may decide."""
        with np.errstate(invalid="ignore"):
            narrow: NDArray[np.bool_] = pieces.high - pieces.low <= _THIN * (1 + np.abs(pieces.low))
        thin = np.any(narrow, axis=1)
        for each in np.flatnonzero(thin & (pieces.truth == TRUE)).tolist():
            look()
            start = int(pieces.of[each])
            one = stretches.alone(start)
            own = AtomColumns(self.scenario, one.places, _values(hidden, pieces, each), start=one.heads())
            run = self._run(one, own, expanded, {})
            first = int(stretches.starts[start]) - int(one.starts[0])
            if run.truth[0] != TRUE or run.ends[0] + first != pieces.ends[each]:
                pieces.truth[each] = FALSE

    def _by_examples(
        self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], start: Remembered, unclear: str
    ) -> Runs:
        """The matches of a start by what its label says of the variables, the longest first, else why there is none."""
        hanging = {number: each for number, each in enumerate(expanded) if any(True for _ in leaves(each))}

        def decide(known: Mapping[int, Truth]) -> Runs:
            return self._run(one, columns, expanded, known)

        first = int(one.starts[0])
        asked = Examples(self.scenario, self.match, self.solver, start, columns, hanging, first, decide)
        outcomes: list[tuple[Runs, Example]] | None = None
        try:
            with limited(self.match.timeout_s):
                outcomes = asked.outcomes()
        except (UnclearVariable, Exhausted):
            pass
        if outcomes and all(run.truth[0] == FALSE for run, _ in outcomes):
            return max((run for run, _ in outcomes), key=lambda run: (bool(run.cut_off[0]), int(run.ends[0])))
        none = Runs.unknown(one.starts, one.ends()).with_detail(unclear)
        undecided = [run.with_detail(unclear) for run, _ in outcomes or () if run.truth[0] == UNKNOWN]
        # an example is a proof, whatever else there may be
        proven = [*(outcomes or ()), *((decide(each.truth), each) for each in asked.found)]
        told = _one_each([run.with_detail("", each.witness) for run, each in proven if run.truth[0] == TRUE])
        if not told:
            return none
        ends = {int(run.ends[0]) for run in told}
        open_ = [none] if outcomes is None else undecided
        return Runs.joined([*told, *_one_each([run for run in open_ if int(run.ends[0]) not in ends])])

    def _run(self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], known: Mapping[int, Truth]) -> Runs:
        """The run of one start, given some conditions at each sample."""
        return follow_runs(self.machine, one, columns.reader(expanded, known))

    def _again(
        self, pieces: Runs, groups: Sequence[NDArray[np.int64]], hidden: HiddenConditions, joint: Sequence[int],
        stretches: Stretches, remember: Callable[[int], Remembered],
    ) -> Runs:  # fmt: skip
        """Match starts again with the values of random variables that the initial scene has, too."""
        numbers = cast("list[int]", stretches.numbers.tolist())
        stretch_of = np.searchsorted(stretches.bounds, stretches.starts, side="right")
        asked: Counter[int] = Counter()
        found: list[Runs] = []
        for group in groups:
            start, best = int(pieces.of[group[0]]), pieces.some(group[:1])
            if best.truth[0] == FALSE:
                found.append(best)
                continue
            asked[int(stretch_of[start])] += 1
            if asked[int(stretch_of[start])] > LIMITS.joint_starts:
                found.append(best.with_detail("budget", truth=int(UNKNOWN)))
            else:
                found.append(self._jointly(remember(numbers[start]), pieces, group, hidden, joint))
        return Runs.joined(found)

    def _jointly(
        self, start: Remembered, pieces: Runs, group: NDArray[np.int64], hidden: HiddenConditions, joint: Sequence[int]
    ) -> Runs:
        """The best runs of a start, given its pieces in order."""
        undecided: Runs | None = None
        found: list[Runs] = []
        ranked = cast("list[int]", group.tolist())
        for (truth, _), some in groupby(ranked, key=lambda each: (int(pieces.truth[each]), int(pieces.ends[each]))):
            same = list(some)
            if truth == FALSE or (found and truth == UNKNOWN):
                break
            within = _within(hidden, pieces, joint, same)
            finding = examine_start(self.scenario, self.match, self.solver, start, within)
            verdict = finding.verdict
            if isinstance(verdict, Match):
                known = finding.values()
                values = [known.get(hidden.variables[variable].identity) for variable in joint]
                held = next((each for each in same if _holds(pieces, each, joint, values)), same[0])
                found.append(pieces.some(np.array([held])).with_detail("", _witness(hidden, pieces, held)))
            if isinstance(verdict, Unknown) and undecided is None:
                undecided = pieces.some(np.array(same[:1])).with_detail(verdict.reason, truth=int(UNKNOWN))
        if found:
            return Runs.joined(found)
        return pieces.some(group[-1:]).with_detail("", truth=int(FALSE)) if undecided is None else undecided


def _one_each(matches: Sequence[Runs]) -> list[Runs]:
    """The runs of one start, the longest first, one for each end."""
    found = {int(each.ends[0]): each for each in reversed(matches)}
    return [found[end] for end in sorted(found, reverse=True)]


def _values(hidden: HiddenConditions, pieces: Runs, number: int) -> dict[Identity, Value]:
    """A value of each hidden number in a piece."""
    ends = zip(pieces.low[number].tolist(), pieces.high[number].tolist(), strict=True)
    return {leaf.identity: inside(*each) for leaf, each in zip(hidden.variables, ends, strict=True)}


def _witness(hidden: HiddenConditions, pieces: Runs, number: int) -> dict[str, WitnessValue]:
    """The same by their places in the program."""
    values = _values(hidden, pieces, number)
    return {place_of(leaf): cast("float", values[leaf.identity]) for leaf in hidden.variables}


def _within(hidden: HiddenConditions, pieces: Runs, joint: Sequence[int], some: Sequence[int]) -> Node:
    """That random variables have values of some pieces."""
    options: list[Node] = []
    for each in some:
        bounds: list[Node] = []
        for variable in joint:
            ends = (pieces.low[each, variable], pieces.high[each, variable])
            for op, end in zip((CompareOp.GE, CompareOp.LE), ends, strict=True):
                if np.isfinite(end):
                    bounds.append(Compare(op, hidden.variables[variable], Constant(float(end))))
        options.append(Logic(LogicOp.AND, tuple(bounds)) if bounds else Constant(True))
    return options[0] if len(options) == 1 else Logic(LogicOp.OR, tuple(options))


def _holds(pieces: Runs, number: int, joint: Sequence[int], values: Sequence[Value | None]) -> bool:
    """Whether a witness has its values in a piece."""
    return all(
        isinstance(value, float) and pieces.low[number, variable] <= value <= pieces.high[number, variable]
        for variable, value in zip(joint, values, strict=True)
    )
