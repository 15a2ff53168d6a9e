"""Runs whose conditions depend on random variables of the scene: for each start, the best that any values give."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
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
from scenicq.temporal.atoms import AtomColumns, UnclearVariable
from scenicq.temporal.hidden import value_between
from scenicq.temporal.hidden_bounds import PossibleValues
from scenicq.temporal.hidden_conditions import HiddenConditions
from scenicq.temporal.hidden_examples import Example, Examples, InitialScene, StartLabel
from scenicq.temporal.outcomes import place_of
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Runs
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["HiddenRuns", "StartLabel"]

Numbers = NDArray[np.float64]
_THIN = 4e-12
"""Relative width of a piece of values below which rounding may decide: there, a run is followed again with a value."""


@dataclass(frozen=True, eq=False, slots=True)
class HiddenRuns:
    """What decides runs with hidden random variables.

    Attributes:
        machine: What the program says about time.
        initial: What the labels of starts are matched with.
        reasons: Whether somebody reads what runs fail at.
    """

    machine: RunMachine
    initial: InitialScene
    reasons: bool = True

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.initial.scenario

    @property
    def match(self) -> MatchOptions:
        """Options of the matcher."""
        return self.initial.match

    def follow(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], StartLabel],
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
            parts.append(own.renumbered(np.arange(int(mine.start), int(mine.stop)), whole))
        return Runs.joined(parts)

    def _of_stretch(
        self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], StartLabel],
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
            parts.append(own.renumbered(np.array([start]), every))
        return Runs.joined(parts)

    def _by_values(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], StartLabel],
    ) -> Runs:  # fmt: skip
        """The runs by the values of hidden numbers."""
        hidden = HiddenConditions(columns, expanded)
        if self.reasons:
            return self._within(stretches, columns, expanded, remember, hidden, None)
        possible = PossibleValues.of(self.machine, stretches, columns.reader(expanded), hidden)
        which = possible.any
        if which.all():
            return self._within(stretches, columns, expanded, remember, hidden, (possible.low, possible.high))
        lost = Runs.failed_at_start(stretches.starts).some(~which)
        if not which.any():
            return lost
        some, chosen = stretches.only(which)
        own = AtomColumns(self.scenario, some.places, start=some.heads())
        limits = possible.low[which], possible.high[which]
        part = self._within(some, own, expanded, remember, HiddenConditions(own, expanded), limits)
        return Runs.joined([part.renumbered(np.flatnonzero(which), chosen), lost])

    def _within(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], StartLabel], hidden: HiddenConditions, possible: tuple[Numbers, Numbers] | None,
    ) -> Runs:  # fmt: skip
        """The runs by those values of hidden numbers with which they may match, or by all."""
        pieces = follow_runs(self.machine, stretches, columns.reader(expanded), hidden, possible)
        look()
        shared = {leaf.identity for leaf in leaves(*roots_of(replace(self.scenario, dynamics=None)))}
        joint = [place for place, leaf in enumerate(hidden.variables) if leaf.identity in shared]
        thin = _thin(pieces)
        doubted = thin & (pieces.truth == TRUE)
        if not joint:
            # where other values prove the same, nothing depends on these
            end = pieces.owner * (int(pieces.ends.max(initial=0)) + 1) + pieces.ends
            doubted &= ~np.isin(end, end[~thin & (pieces.truth == TRUE)])
        self._confirm(pieces, np.flatnonzero(doubted), stretches, expanded, hidden)
        look()
        order = np.lexsort((*pieces.low.T[::-1], thin, -pieces.ends, -pieces.truth.astype(np.int64), pieces.owner))
        firsts = np.flatnonzero(np.diff(pieces.owner[order], prepend=-1))
        every = np.arange(len(stretches.starts))
        if joint:
            found = self._again(pieces, order, firsts, hidden, joint, stretches, remember)
            return found.renumbered(every, np.arange(len(stretches)))
        matches = order[pieces.truth[order] == TRUE]
        # one piece for each end
        new = (np.diff(pieces.owner[matches], prepend=-1) != 0) | (np.diff(pieces.ends[matches], prepend=-1) != 0)
        kept = np.zeros(len(pieces), np.bool_)
        kept[order[firsts]] = kept[matches[new]] = True
        for number, each in enumerate(cast("list[int]", matches[new].tolist())):
            if not number % 10_000:
                look()
            pieces.details[each] = "", _Witness(hidden, pieces, each)
        look()
        return pieces.some(order[kept[order]]).renumbered(every, np.arange(len(stretches)))

    def _confirm(
        self, pieces: Runs, doubted: NDArray[np.intp], stretches: Stretches, expanded: Sequence[Node],
        hidden: HiddenConditions,
    ) -> None:  # fmt: skip
        """Follow some runs again with a value each; what is no match then is none."""
        for each in cast("list[int]", doubted.tolist()):
            look()
            start = int(pieces.owner[each])
            one = stretches.alone(start)
            own = AtomColumns(self.scenario, one.places, _values(hidden, pieces, each), start=one.heads())
            run = self._run(one, own, expanded, {})
            first = int(stretches.starts[start]) - int(one.starts[0])
            if run.truth[0] != TRUE or run.ends[0] + first != pieces.ends[each]:
                pieces.truth[each] = FALSE

    def _by_examples(
        self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], start: StartLabel, unclear: str
    ) -> Runs:
        """The matches of a start by what its label says of the variables, the longest first, else why there is none."""
        hanging = {number: each for number, each in enumerate(expanded) if any(True for _ in leaves(each))}

        def decide(known: Mapping[int, Truth]) -> Runs:
            return self._run(one, columns, expanded, known)

        first = int(one.starts[0])
        asked = Examples(self.initial, start, columns, hanging, first, decide)
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
        self, pieces: Runs, order: NDArray[np.int64], firsts: NDArray[np.int64], hidden: HiddenConditions,
        joint: Sequence[int], stretches: Stretches, remember: Callable[[int], StartLabel],
    ) -> Runs:  # fmt: skip
        """Match starts again with the values of random variables that the initial scene has, too.

        Args:
            pieces: The runs.
            order: Their order, those of each start from the best one on.
            firsts: Where in it each start's begin.
            hidden: What depends on hidden numbers.
            joint: Those numbers that the initial scene has, too.
            stretches: Stretches with their starts.
            remember: The label of a start by its number.
        """
        best = order[firsts]
        open_ = np.flatnonzero(pieces.truth[best] != FALSE)
        stretch_of = np.searchsorted(stretches.bounds, stretches.starts[pieces.owner[best[open_]]], side="right")
        before = np.arange(len(open_)) - np.searchsorted(stretch_of, stretch_of)
        asked = open_[before < LIMITS.joint_starts]
        rest = open_[before >= LIMITS.joint_starts]
        found = [
            pieces.some(best[pieces.truth[best] == FALSE]),
            pieces.some(best[rest]).with_detail("budget", truth=int(UNKNOWN)),
        ]
        ends = np.append(firsts[1:], len(order))
        for each in cast("list[int]", asked.tolist()):
            look()
            group = order[firsts[each] : ends[each]]
            number = int(stretches.numbers[pieces.owner[group[0]]])
            found.append(self._jointly(remember(number), pieces, group, hidden, joint))
        runs = Runs.joined(found)
        return runs.some(np.argsort(runs.owner, kind="stable"))

    def _jointly(
        self, start: StartLabel, pieces: Runs, group: NDArray[np.int64], hidden: HiddenConditions, joint: Sequence[int]
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
            finding = self.initial.examine(start, within)
            verdict = finding.verdict
            if isinstance(verdict, Match):
                known = finding.values()
                values = [known.get(hidden.variables[variable].identity) for variable in joint]
                held = next((each for each in same if _holds(pieces, each, joint, values)), same[0])
                found.append(pieces.some(np.array([held])).with_detail("", _Witness(hidden, pieces, held)))
            if isinstance(verdict, Unknown) and undecided is None:
                undecided = pieces.some(np.array(same[:1])).with_detail(verdict.reason, truth=int(UNKNOWN))
        if found:
            return Runs.joined(found)
        return pieces.some(group[-1:]).with_detail("", truth=int(FALSE)) if undecided is None else undecided


def _thin(pieces: Runs) -> NDArray[np.bool_]:
    """Whether so few values are in a piece that rounding may decide, for each."""
    with np.errstate(invalid="ignore"):
        narrow: NDArray[np.bool_] = pieces.high - pieces.low <= _THIN * (1 + np.abs(pieces.low))
    return np.any(narrow, axis=1)


def _one_each(matches: Sequence[Runs]) -> list[Runs]:
    """The runs of one start, the longest first, one for each end."""
    found = {int(each.ends[0]): each for each in reversed(matches)}
    return [found[end] for end in sorted(found, reverse=True)]


def _values(hidden: HiddenConditions, pieces: Runs, number: int) -> dict[Identity, Value]:
    """A value of each hidden number in a piece."""
    ends = zip(pieces.low[number].tolist(), pieces.high[number].tolist(), strict=True)
    return {leaf.identity: value_between(*each) for leaf, each in zip(hidden.variables, ends, strict=True)}


@dataclass(frozen=True, eq=False, slots=True)
class _Witness(Mapping[str, WitnessValue]):
    """A value of each hidden number in a piece, by its place in the program; worked out where somebody reads it.

    Attributes:
        hidden: The hidden numbers.
        pieces: The runs.
        number: Which of them.
    """

    hidden: HiddenConditions
    pieces: Runs
    number: int

    def __getitem__(self, place: str) -> WitnessValue:
        """The value of the number at a place."""
        return self._values()[place]

    def __iter__(self) -> Iterator[str]:
        """The places."""
        return iter(self._values())

    def __len__(self) -> int:
        """How many there are."""
        return len(self._values())

    def _values(self) -> dict[str, WitnessValue]:
        values = _values(self.hidden, self.pieces, self.number)
        return {place_of(leaf): cast("float", values[leaf.identity]) for leaf in self.hidden.variables}


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
