"""Runs whose conditions hang on random variables of the scene: the best that any values of these make of each start."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import TypeVarTuple, cast

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
from scenicq.temporal.hidden_examples import ExampleOutcome, Examples, Remembered, examine_start
from scenicq.temporal.outcomes import place_of
from scenicq.temporal.run_lanes import Pieces, follow_pieces, follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Run, Runs
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["Detail", "HiddenFound", "HiddenRuns", "Remembered"]

_Rest = TypeVarTuple("_Rest")
Numbers = NDArray[np.float64]
Detail = tuple[str, Mapping[str, WitnessValue]]
"""Why a run is unknown, and the values of random variables of conditions over time."""

_THIN = 4e-12
"""Relative width of a piece of values below which rounding may decide: there, a run is followed again with a value."""


@dataclass(frozen=True, eq=False, slots=True)
class HiddenFound:
    """What became of runs whose conditions hang on random variables.

    Attributes:
        runs: The best that any values make of each start.
        others: What other values make of some starts, or may make: the number of the start among all, the end, and
            whether it matches.
        details: By the number of a start in its table and the last place of its run.
    """

    runs: Runs
    others: list[tuple[int, int, int]] = field(default_factory=list[tuple[int, int, int]])
    details: dict[tuple[int, int], Detail] = field(default_factory=dict["tuple[int, int]", Detail])

    def put(self, start: int, number: int, found: Sequence[tuple[Run, Detail]]) -> None:
        """Write down what became of a start, the best first.

        Args:
            start: Its number among all.
            number: That in its table.
            found: What became of it.
        """
        for run, detail in found:
            self.details[number, run.end] = detail
        self.runs.put(start, found[0][0])
        self.others.extend((start, run.end, run.truth) for run, _ in found[1:])

    def add(self, found: HiddenFound, starts: NDArray[np.int64], places: NDArray[np.int64]) -> None:
        """Write down what became of some starts.

        Args:
            found: What became of them.
            starts: Their numbers among all.
            places: The places that it is about.
        """
        found.runs.ends[:] = places[found.runs.ends]
        self.runs.replace(starts, found.runs)
        self.others.extend((int(starts[number]), int(places[end]), truth) for number, end, truth in found.others)
        self.details.update({(number, int(places[end])): detail for (number, end), detail in found.details.items()})


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
    ) -> HiddenFound:  # fmt: skip
        """What becomes of the runs from all starts.

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
        found = HiddenFound(Runs.unknown(stretches.ends()))
        for places, mine in stretches.apart():
            whole = np.arange(int(places.start), int(places.stop), dtype=np.int64)
            one = stretches.some(whole)
            own = self._of_stretch(one, AtomColumns(self.scenario, one.places, start=one.heads()), expanded, remember)
            found.add(own, np.arange(int(mine.start), int(mine.stop)), whole)
        return found

    def _of_stretch(
        self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered],
    ) -> HiddenFound:  # fmt: skip
        """The runs of one stretch."""
        try:
            with limited(self.match.timeout_s):
                return self._by_values(stretch, columns, expanded, remember)
        except (UnclearVariable, Exhausted) as error:
            unclear = error
        reason = str(unclear)
        found = HiddenFound(Runs.unknown(stretch.ends()))
        for start, number in enumerate(cast("list[int]", stretch.numbers.tolist())):
            if isinstance(unclear, UnclearVariable):
                # what the initial scene says of the variables may be enough
                one = stretch.beginning(start)
                found.put(start, number, self._by_examples(one, columns, expanded, remember(number), reason))
            else:
                found.details[number, int(found.runs.ends[start])] = reason, {}
        return found

    def _by_values(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered],
    ) -> HiddenFound:  # fmt: skip
        """The runs by the values of hidden numbers."""
        hidden = HiddenConditions(columns, expanded)
        if self.reasons:
            return self._within(stretches, columns, expanded, remember, hidden, None)
        possible = PossibleValues.of(self.machine, stretches, columns.reader(expanded), hidden)
        which = possible.any
        if which.all():
            return self._within(stretches, columns, expanded, remember, hidden, (possible.low, possible.high))
        found = HiddenFound(Runs.lost(stretches.starts.copy()))
        if which.any():
            some, chosen = stretches.only(which)
            own = AtomColumns(self.scenario, some.places, start=some.heads())
            limits = possible.low[which], possible.high[which]
            part = self._within(some, own, expanded, remember, HiddenConditions(own, expanded), limits)
            found.add(part, np.flatnonzero(which), chosen)
        return found

    def _within(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered], hidden: HiddenConditions, possible: tuple[Numbers, Numbers] | None,
    ) -> HiddenFound:  # fmt: skip
        """The runs by those values of hidden numbers with which they may match, or by all."""
        pieces = follow_pieces(self.machine, stretches, columns.reader(expanded), hidden, possible)
        self._confirm(pieces, stretches, columns, expanded, hidden)
        runs, numbers = pieces.runs, cast("list[int]", stretches.numbers.tolist())
        order = np.lexsort((*pieces.low.T[::-1], -runs.ends, -runs.truth.astype(np.int64), pieces.of))
        shared = {leaf.identity for leaf in leaves(*roots_of(replace(self.scenario, dynamics=None)))}
        joint = [place for place, leaf in enumerate(hidden.variables) if leaf.identity in shared]
        firsts = np.flatnonzero(np.diff(pieces.of[order], prepend=-1))
        found = HiddenFound(runs.some(order[firsts]))
        if joint:
            self._again(found, pieces, np.split(order, firsts[1:]), hidden, joint, stretches, remember)
            return found
        matches = order[runs.truth[order] == TRUE]
        # one piece for each end
        new = (np.diff(pieces.of[matches], prepend=-1) != 0) | (np.diff(runs.ends[matches], prepend=-1) != 0)
        best = np.zeros(len(pieces.of), np.bool_)
        best[order[firsts]] = True
        for each in cast("list[int]", matches[new].tolist()):
            start, end = int(pieces.of[each]), int(runs.ends[each])
            found.details[numbers[start], end] = "", _witness(hidden, pieces, each)
            if not best[each]:
                found.others.append((start, end, int(TRUE)))
        return found

    def _confirm(
        self, pieces: Pieces, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        hidden: HiddenConditions,
    ) -> None:  # fmt: skip
        """Follow runs again with a value each where so few values match that rounding may decide."""
        with np.errstate(invalid="ignore"):
            narrow: NDArray[np.bool_] = pieces.high - pieces.low <= _THIN * (1 + np.abs(pieces.low))
        thin = np.any(narrow, axis=1)
        runs = pieces.runs
        for each in np.flatnonzero(thin & (runs.truth == TRUE)).tolist():
            look()
            start = int(pieces.of[each])
            one = stretches.alone(start)
            own = AtomColumns(self.scenario, one.places, _values(hidden, pieces, each), start=one.heads())
            run = self._run(one, own, expanded, {})
            first = int(stretches.starts[start]) - int(one.starts[0])
            if run.truth != TRUE or run.end + first != runs.ends[each]:
                runs.truth[each] = FALSE

    def _by_examples(
        self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], start: Remembered, unclear: str
    ) -> list[tuple[Run, Detail]]:
        """The matches of a start by what its label says of the variables, the longest first, else why there is none."""
        hanging = {number: each for number, each in enumerate(expanded) if any(True for _ in leaves(each))}
        first = int(one.starts[0])

        def decide(known: Mapping[int, Truth]) -> Run:
            return self._run(one, columns, expanded, known)

        asked = Examples(self.scenario, self.match, self.solver, start, columns, hanging, first, decide)
        outcomes: list[ExampleOutcome] | None = None
        try:
            with limited(self.match.timeout_s):
                outcomes = asked.outcomes()
        except (UnclearVariable, Exhausted):
            pass
        if outcomes and all(each.run.truth == FALSE for each in outcomes):
            return [(max((each.run for each in outcomes), key=lambda run: (run.cut_off, run.end)), ("", {}))]
        none = Run(first, len(one.labels) - 1, int(UNKNOWN)), (unclear, dict[str, WitnessValue]())
        undecided = [none] if outcomes is None else [
            (each.run, none[1]) for each in outcomes if each.run.truth == UNKNOWN
        ]  # fmt: skip
        # an example is a proof, whatever else there may be
        outcomes = [*(outcomes or ()), *(ExampleOutcome(decide(each.truth), each) for each in asked.found)]
        proven = [(each.run, ("", each.example.witness)) for each in outcomes if each.run.truth == TRUE]
        proven.sort(key=lambda each: -each[0].end)
        told = _one_each(proven)
        ends = {run.end for run, _ in told}
        return [*told, *_one_each([each for each in undecided if each[0].end not in ends])] if told else [none]

    def _run(self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], known: Mapping[int, Truth]) -> Run:
        """The run of one start, given some conditions at each sample."""
        return follow_runs(self.machine, one, columns.reader(expanded, known)).run(0, int(one.starts[0]))

    def _again(
        self, found: HiddenFound, pieces: Pieces, groups: Sequence[NDArray[np.int64]], hidden: HiddenConditions,
        joint: Sequence[int], stretches: Stretches, remember: Callable[[int], Remembered],
    ) -> None:  # fmt: skip
        """Match starts again with the values of random variables that the initial scene has, too."""
        numbers = cast("list[int]", stretches.numbers.tolist())
        stretch_of = np.searchsorted(stretches.bounds, stretches.starts, side="right")
        asked: Counter[int] = Counter()
        for group in groups:
            start = int(pieces.of[group[0]])
            best = pieces.runs.run(int(group[0]), int(stretches.starts[start]))
            witness = _witness(hidden, pieces, int(group[0]))
            if best.truth == FALSE:
                found.put(start, numbers[start], [(best, ("", witness))])
                continue
            asked[int(stretch_of[start])] += 1
            if asked[int(stretch_of[start])] > LIMITS.joint_starts:
                unknown = replace(best, truth=int(UNKNOWN))
                found.put(start, numbers[start], [(unknown, ("budget", witness))])
                continue
            again = self._jointly(remember(numbers[start]), pieces, group, hidden, joint, int(stretches.starts[start]))
            found.put(start, numbers[start], again)

    def _jointly(
        self, start: Remembered, pieces: Pieces, group: NDArray[np.int64], hidden: HiddenConditions,
        joint: Sequence[int], place: int,
    ) -> list[tuple[Run, Detail]]:  # fmt: skip
        """The best runs of a start, given its pieces in order."""
        undecided: tuple[Run, Detail] | None = None
        found: list[tuple[Run, Detail]] = []
        ranked = [(pieces.runs.run(each, place), each) for each in cast("list[int]", group.tolist())]
        for (truth, _), some in groupby(ranked, key=lambda each: (each[0].truth, each[0].end)):
            same = list(some)
            if truth == FALSE or (found and truth == UNKNOWN):
                break
            within = _within(hidden, pieces, joint, [each for _, each in same])
            finding = examine_start(self.scenario, self.match, self.solver, start, within)
            verdict = finding.verdict
            if isinstance(verdict, Match):
                known = finding.values()
                values = [known.get(hidden.variables[variable].identity) for variable in joint]
                held = next((each for each in same if _holds(pieces, each[1], joint, values)), same[0])
                found.append((held[0], ("", _witness(hidden, pieces, held[1]))))
            if isinstance(verdict, Unknown) and undecided is None:
                witness = _witness(hidden, pieces, same[0][1])
                undecided = replace(same[0][0], truth=int(UNKNOWN)), (verdict.reason, witness)
        run, last = ranked[-1]
        return found or [undecided or (replace(run, truth=int(FALSE)), ("", _witness(hidden, pieces, last)))]


def _one_each(matches: Sequence[tuple[Run, *_Rest]]) -> list[tuple[Run, *_Rest]]:
    """The matches of one start, the longest first, one for each end."""
    found = {each[0].end: each for each in reversed(matches)}
    return sorted(found.values(), key=lambda each: -each[0].end)


def _values(hidden: HiddenConditions, pieces: Pieces, number: int) -> dict[Identity, Value]:
    """A value of each hidden number in a piece."""
    ends = zip(pieces.low[number].tolist(), pieces.high[number].tolist(), strict=True)
    return {leaf.identity: inside(*each) for leaf, each in zip(hidden.variables, ends, strict=True)}


def _witness(hidden: HiddenConditions, pieces: Pieces, number: int) -> dict[str, WitnessValue]:
    """The same by their places in the program."""
    values = _values(hidden, pieces, number)
    return {place_of(leaf): cast("float", values[leaf.identity]) for leaf in hidden.variables}


def _within(hidden: HiddenConditions, pieces: Pieces, joint: Sequence[int], some: Sequence[int]) -> Node:
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


def _holds(pieces: Pieces, number: int, joint: Sequence[int], values: Sequence[Value | None]) -> bool:
    """Whether a witness has its values in a piece."""
    return all(
        isinstance(value, float) and pieces.low[number, variable] <= value <= pieces.high[number, variable]
        for variable, value in zip(joint, values, strict=True)
    )
