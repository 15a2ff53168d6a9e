"""Runs whose conditions hang on random variables of the scene: the best that any values of these make of each start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import TypeVarTuple

import numpy as np

from scenicq.budget import TimeIsUp, limited, look
from scenicq.forest.nodes import Compare, CompareOp, Constant, Leaf, Logic, LogicOp, Node, Value
from scenicq.forest.scenario import Scenario
from scenicq.forest.simplify import roots_of
from scenicq.forest.temporal import Atom
from scenicq.forest.walk import leaves
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown, WitnessValue
from scenicq.smt.answer import Solver
from scenicq.temporal.atoms import AtomColumns, HiddenVariable
from scenicq.temporal.hidden import Cell, UnclearVariable, cells, random_variables
from scenicq.temporal.hidden_examples import ExampleOutcome, Examples, Remembered, examine_start
from scenicq.temporal.run_columns import RunColumns
from scenicq.temporal.runs import Run, Runs
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.thresholds import thresholds_of
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["Detail", "HiddenFound", "HiddenRuns", "Remembered"]

_Rest = TypeVarTuple("_Rest")
Detail = tuple[str, Mapping[str, WitnessValue]]
"""Why a run is unknown, and the values of random variables of conditions over time."""

_MOST_JOINT = 32
"""Starts of one binding that are matched again with values of random variables that the initial scene has, too."""


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


@dataclass(frozen=True, eq=False, slots=True)
class HiddenRuns:
    """What decides runs with hidden random variables.

    Attributes:
        runs: What the program says about time.
        scenario: The scenario.
        match: Options of the matcher.
        solver: Decides what is not decided otherwise.
        every: Whether all matches of a start are wanted, not only the longest.
    """

    runs: RunColumns
    scenario: Scenario
    match: MatchOptions
    solver: Solver | None
    every: bool = False

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
        variables = random_variables(expanded)
        shared = {leaf.identity for leaf in leaves(*roots_of(replace(self.scenario, dynamics=None)))}
        joint = [leaf for leaf in variables if leaf.identity in shared]
        known = None if joint else thresholds_of(self.runs, stretches, columns, expanded, variables)
        found = HiddenFound(Runs.unknown(stretches.starts.copy()) if known is None else known.runs)
        thin = np.ones(len(stretches.starts), np.bool_) if known is None else known.thin
        numbers: list[int] = stretches.numbers.tolist()
        if known is not None:
            # where it ends hangs on no variable, so that a start has one end
            ends: list[int] = known.runs.ends.tolist()
            for number, end, value in zip(numbers, ends, known.values.tolist(), strict=True):
                found.details[number, end] = "", {_place(variables[0]): value}
        for places, mine in stretches.apart():
            if not thin[mine].any():
                continue
            one = stretches.some(np.arange(int(places.start), int(places.stop), dtype=np.int64))
            own = AtomColumns(self.scenario, one.places, start=one.heads())
            outcomes = list(self._of_binding(one, own, expanded, variables, joint, remember))
            found.runs.put(mine, [each[0][0] for each in outcomes], places.start)
            for start, each in zip(range(mine.start, mine.stop), outcomes, strict=True):
                for run, detail in each:
                    found.details[numbers[start], places.start + run.end] = detail
                found.others.extend((start, places.start + run.end, run.truth) for run, _ in each[1:])
        return found

    def _of_binding(
        self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node], variables: Sequence[Leaf],
        joint: Sequence[Leaf], remember: Callable[[int], Remembered],
    ) -> Iterator[list[tuple[Run, Detail]]]:  # fmt: skip
        """The runs of one stretch, by cells of values: of each start the best, then other matches."""
        numbers, starts = stretch.numbers.tolist(), stretch.starts.tolist()
        try:
            with limited(self.match.timeout_s):
                best = list(self._over_cells(stretch, columns, expanded, joint, remember))
        except UnclearVariable as error:
            for start, number in enumerate(numbers):
                # what the initial scene says of the variables may be enough
                one = replace(
                    stretch, starts=stretch.starts[start : start + 1], numbers=stretch.numbers[start : start + 1]
                )
                yield self._by_examples(one, columns, expanded, remember(number), str(error))
            return
        except (HiddenVariable, TimeIsUp) as error:
            reason = "timeout" if isinstance(error, TimeIsUp) else str(error) or "a hidden random variable over time"
            for start in starts:
                yield [(Run(start, len(stretch.labels) - 1, int(UNKNOWN)), (reason, {}))]
            return
        for outcomes in best:
            found: list[tuple[Run, Detail]] = []
            for run, cell, reason in outcomes:
                values = {_place(leaf): cell.values[leaf.identity] for leaf in variables}
                witness = {key: value for key, value in values.items() if isinstance(value, float)}
                found.append((run, (reason, witness)))
            yield found

    def _over_cells(
        self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node], joint: Sequence[Leaf],
        remember: Callable[[int], Remembered],
    ) -> Iterator[list[tuple[Run, Cell, str]]]:  # fmt: skip
        """What cells make of each start: the best, then other matches if they are wanted."""
        starts = stretch.starts.tolist()
        found: list[list[tuple[Run, Cell]]] = [[] for _ in starts]
        for cell in cells(columns, expanded):
            look()
            runs = self._in_cell(stretch, columns.assigned(cell.values), expanded)
            for number, (mine, start) in enumerate(zip(found, starts, strict=True)):
                mine.append((runs.run(number, start), cell))
        matched_again = 0
        for number, mine in zip(stretch.numbers.tolist(), found, strict=True):
            ranked = sorted(mine, key=lambda each: (-each[0].truth, -each[0].end))
            best, cell = ranked[0]
            if not joint or best.truth == FALSE:
                matches = [(run, own, "") for run, own in ranked if run.truth == TRUE]
                yield _one_each(matches, every=self.every) or [(best, cell, "")]
                continue
            matched_again += 1
            if matched_again > _MOST_JOINT:
                yield [(replace(best, truth=int(UNKNOWN)), cell, "budget")]
            else:
                yield self._jointly(remember(number), joint, ranked)

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
        except (HiddenVariable, TimeIsUp):
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
        told = _one_each(proven, every=self.every)
        ends = {run.end for run, _ in told}
        further = [each for each in undecided if each[0].end not in ends] if self.every else []
        return [*told, *_one_each(further, every=True)] if told else [none]

    def _run(self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], known: Mapping[int, Truth]) -> Run:
        """The run of one start, given some conditions at each sample."""
        values = dict(known)

        def atom(each: Atom) -> Truth:
            if each.number not in values:
                values[each.number] = columns.truth_of(expanded[each.number])
            return values[each.number]

        return self.runs.follow(one, atom).run(0, int(one.starts[0]))

    def _in_cell(self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node]) -> Runs:
        known: dict[int, Truth] = {}

        def atom(each: Atom) -> Truth:
            if each.number not in known:
                known[each.number] = columns.truth_of(expanded[each.number])
            return known[each.number]

        return self.runs.follow(stretch, atom)

    def _jointly(
        self, start: Remembered, joint: Sequence[Leaf], ranked: Sequence[tuple[Run, Cell]]
    ) -> list[tuple[Run, Cell, str]]:
        """The best runs whose values of random variables the initial scene has, too."""
        undecided: tuple[Run, Cell, str] | None = None
        found: list[tuple[Run, Cell, str]] = []
        for (truth, _), group in groupby(ranked, key=lambda each: (each[0].truth, each[0].end)):
            same = list(group)
            if truth == FALSE or (found and (truth == UNKNOWN or not self.every)):
                break
            within = _within(joint, [cell for _, cell in same])
            finding = examine_start(self.scenario, self.match, self.solver, start, within)
            verdict = finding.verdict
            if isinstance(verdict, Match):
                known = finding.values()
                values = [known.get(leaf.identity) for leaf in joint]
                held = next((each for each in same if _holds(each[1], joint, values)), same[0])
                found.append((*held, ""))
            if isinstance(verdict, Unknown) and undecided is None:
                undecided = replace(same[0][0], truth=int(UNKNOWN)), same[0][1], verdict.reason
        run, cell = ranked[-1]
        return found or [undecided or (replace(run, truth=int(FALSE)), cell, "")]


def _one_each(matches: Sequence[tuple[Run, *_Rest]], *, every: bool) -> list[tuple[Run, *_Rest]]:
    """The matches of one start, the longest first, one for each end, or the first alone."""
    found = {each[0].end: each for each in reversed(matches)}
    ordered = sorted(found.values(), key=lambda each: -each[0].end)
    return ordered if every else ordered[:1]


def _place(leaf: Leaf) -> str:
    return leaf.span.mark if leaf.span else type(leaf).__name__


def _within(joint: Sequence[Leaf], some: Sequence[Cell]) -> Node:
    """That random variables have values of some cells."""
    options: list[Node] = []
    for cell in some:
        bounds: list[Node] = []
        for leaf in joint:
            low, high = cell.ranges[leaf.identity]
            # a cell of more than one value has not its ends
            ops = (CompareOp.GE, CompareOp.LE) if low == high else (CompareOp.GT, CompareOp.LT)
            for op, end in zip(ops, (low, high), strict=True):
                if np.isfinite(end):
                    bounds.append(Compare(op, leaf, Constant(float(end))))
        options.append(Logic(LogicOp.AND, tuple(bounds)) if bounds else Constant(True))
    return options[0] if len(options) == 1 else Logic(LogicOp.OR, tuple(options))


def _holds(cell: Cell, joint: Sequence[Leaf], values: Sequence[Value | None]) -> bool:
    """Whether a witness has its values in a cell."""
    return all(
        isinstance(value, float) and cell.ranges[leaf.identity][0] <= value <= cell.ranges[leaf.identity][1]
        for leaf, value in zip(joint, values, strict=True)
    )
