"""Runs whose conditions hang on random variables of the scene: the best that any values of these make of each start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

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
from scenicq.temporal.hidden_examples import Examples, Remembered, examine_start
from scenicq.temporal.run_columns import RunColumns, Runs
from scenicq.temporal.runs import Run
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.thresholds import thresholds_of
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["Details", "HiddenRuns", "Remembered"]

Details = dict[int, tuple[str, Mapping[str, WitnessValue]]]
"""By the number of a start why its run is unknown, and the values of random variables of conditions over time."""

_MOST_JOINT = 32
"""Starts of one binding that are matched again with values of random variables that the initial scene has, too."""


@dataclass(frozen=True, eq=False, slots=True)
class HiddenRuns:
    """What decides runs with hidden random variables.

    Attributes:
        runs: What the program says about time.
        scenario: The scenario.
        match: Options of the matcher.
        solver: Decides what is not decided otherwise.
    """

    runs: RunColumns
    scenario: Scenario
    match: MatchOptions
    solver: Solver | None

    def follow(
        self, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node],
        remember: Callable[[int], Remembered],
    ) -> tuple[Runs, Details]:  # fmt: skip
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
        found = Runs.unknown(stretches.starts.copy())
        details: Details = {}
        thin = np.ones(len(stretches.starts), np.bool_)
        if known is not None:
            found, thin = known.runs, known.thin
            for number, value in zip(stretches.numbers.tolist(), known.values.tolist(), strict=True):
                details[number] = "", {_place(variables[0]): value}
        for places, mine in stretches.apart():
            if not thin[mine].any():
                continue
            one = stretches.some(np.arange(int(places.start), int(places.stop), dtype=np.int64))
            own = AtomColumns(self.scenario, one.places, start=one.heads())
            found.put(mine, [*self._of_binding(one, own, expanded, variables, joint, remember, details)], places.start)
        return found, details

    def _of_binding(
        self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node], variables: Sequence[Leaf],
        joint: Sequence[Leaf], remember: Callable[[int], Remembered], details: Details,
    ) -> Iterator[Run]:  # fmt: skip
        """The runs of one stretch, by cells of values."""
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
                run, why, witness = self._by_examples(one, columns, expanded, remember(number), str(error))
                details[number] = why, witness
                yield run
            return
        except (HiddenVariable, TimeIsUp) as error:
            reason = "timeout" if isinstance(error, TimeIsUp) else str(error) or "a hidden random variable over time"
            for number, start in zip(numbers, starts, strict=True):
                details[number] = reason, {}
                yield Run(start, len(stretch.labels) - 1, int(UNKNOWN))
            return
        for number, (run, cell, reason) in zip(numbers, best, strict=True):
            values = {_place(leaf): cell.values[leaf.identity] for leaf in variables}
            details[number] = reason, {key: value for key, value in values.items() if isinstance(value, float)}
            yield run

    def _over_cells(
        self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node], joint: Sequence[Leaf],
        remember: Callable[[int], Remembered],
    ) -> Iterator[tuple[Run, Cell, str]]:  # fmt: skip
        """The best that any cell makes of each start."""
        starts = stretch.starts.tolist()
        found: list[list[tuple[Run, Cell]]] = [[] for _ in starts]
        for cell in cells(columns, expanded):
            look()
            runs = self._in_cell(stretch, columns.assigned(cell.values), expanded)
            for mine, start, end, truth, broken, cut_off in zip(
                found, starts, runs.ends.tolist(), runs.truth.tolist(), runs.broken, runs.cut_off.tolist(), strict=True
            ):
                mine.append((Run(start, end, truth, broken, cut_off), cell))
        matched_again = 0
        for number, mine in zip(stretch.numbers.tolist(), found, strict=True):
            ranked = sorted(mine, key=lambda each: (-each[0].truth, -each[0].end))
            best, cell = ranked[0]
            if not joint or best.truth == FALSE:
                yield best, cell, ""
                continue
            matched_again += 1
            if matched_again > _MOST_JOINT:
                yield replace(best, truth=int(UNKNOWN)), cell, "budget"
            else:
                yield self._jointly(remember(number), joint, ranked)

    def _by_examples(
        self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], start: Remembered, unclear: str
    ) -> tuple[Run, str, Mapping[str, WitnessValue]]:
        """The run of one start by what its label says of the variables, else why it is unknown."""
        hanging = {number: each for number, each in enumerate(expanded) if any(True for _ in leaves(each))}
        first = int(one.starts[0])
        asked = Examples(self.scenario, self.match, self.solver, start, columns, hanging, first)
        try:
            with limited(self.match.timeout_s):
                certain = asked.certain()
                runs = None if certain is None else self._run(one, columns, expanded, certain)
                if runs is not None and runs.truth != UNKNOWN:
                    return runs, "", asked.found[0].witness if runs.truth == TRUE else {}
        except (HiddenVariable, TimeIsUp):
            pass
        # an example is a proof, although others may be longer
        found = [(self._run(one, columns, expanded, each.truth), each) for each in asked.found]
        matches = [(run, each) for run, each in found if run.truth == TRUE]
        if not matches:
            return Run(first, len(one.labels) - 1, int(UNKNOWN)), unclear, {}
        run, example = max(matches, key=lambda each: each[0].end)
        return run, "", example.witness

    def _run(self, one: Stretches, columns: AtomColumns, expanded: Sequence[Node], known: Mapping[int, Truth]) -> Run:
        """The run of one start, given some conditions at each sample."""
        values = dict(known)

        def atom(each: Atom) -> Truth:
            if each.number not in values:
                values[each.number] = columns.truth_of(expanded[each.number])
            return values[each.number]

        runs = self.runs.follow(one, atom)
        start, end = int(one.starts[0]), int(runs.ends[0])
        return Run(start, end, int(runs.truth[0]), runs.broken[0], bool(runs.cut_off[0]))

    def _in_cell(self, stretch: Stretches, columns: AtomColumns, expanded: Sequence[Node]) -> Runs:
        known: dict[int, Truth] = {}

        def atom(each: Atom) -> Truth:
            if each.number not in known:
                known[each.number] = columns.truth_of(expanded[each.number])
            return known[each.number]

        return self.runs.follow(stretch, atom)

    def _jointly(
        self, start: Remembered, joint: Sequence[Leaf], ranked: Sequence[tuple[Run, Cell]]
    ) -> tuple[Run, Cell, str]:
        """The best run whose values of random variables the initial scene has, too."""
        undecided: tuple[Run, Cell, str] | None = None
        for (_, _), group in groupby(ranked, key=lambda each: (each[0].truth, each[0].end)):
            same = list(group)
            if same[0][0].truth == FALSE:
                break
            within = _within(joint, [cell for _, cell in same])
            finding = examine_start(self.scenario, self.match, self.solver, start, within)
            verdict = finding.verdict
            if isinstance(verdict, Match):
                known = finding.values()
                values = [known.get(leaf.identity) for leaf in joint]
                held = next((each for each in same if _holds(each[1], joint, values)), same[0])
                return *held, ""
            if isinstance(verdict, Unknown) and undecided is None:
                undecided = replace(same[0][0], truth=int(UNKNOWN)), same[0][1], verdict.reason
        run, cell = ranked[-1]
        return undecided or (replace(run, truth=int(FALSE)), cell, "")


def _place(leaf: Leaf) -> str:
    return leaf.span.mark if leaf.span else type(leaf).__name__


def _within(joint: Sequence[Leaf], some: Sequence[Cell]) -> Node:
    """That random variables have values of some cells."""
    options: list[Node] = []
    for cell in some:
        bounds: list[Node] = []
        for leaf in joint:
            low, high = cell.ranges[leaf.identity]
            for op, end in ((CompareOp.GE, low), (CompareOp.LE, high)):
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
