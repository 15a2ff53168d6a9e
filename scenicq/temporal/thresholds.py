"""One hidden number in comparisons that are affine in it: for which values of it a run matches, for all runs at once.

At each sample such a comparison holds for all numbers on one side of a threshold. What must hold always holds for the
numbers that do at every sample, an interval; what must hold once, for those that do at some, an interval if all
thresholds bound from the same side. A run matches if some number of its distribution is in all these intervals. Where
an answer hangs on less than rounding, or a program has another form, `hidden_runs` tries values instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import Compare, CompareOp, DiscreteRange, Index, Leaf, Logic, LogicOp, Node
from scenicq.forest.temporal import And, Atom, Formula, Not, Or, operands
from scenicq.forest.walk import leaves
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.folding import folded
from scenicq.temporal.hidden import UnclearVariable, affine_sides, inside, support
from scenicq.temporal.occurrences import Clause, FormulaPart, PartKind, bounds
from scenicq.temporal.run_columns import RunColumns, ends_of
from scenicq.temporal.runs import Runs
from scenicq.temporal.stretches import Stretches
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["Thresholds", "thresholds_of"]

_THIN = 1e-9
"""Relative width of an interval of values below which rounding may decide."""
Numbers = NDArray[np.float64]
Places = NDArray[np.int64]


class _Side(Enum):
    """Which form sets of numbers have."""

    ALL_OR_NONE = auto()
    FROM = auto()
    UP_TO = auto()
    BETWEEN = auto()


class _NoInterval(Exception):
    """Numbers that make no interval."""


@dataclass(frozen=True, slots=True)
class _Sets:
    """A closed interval of numbers at each place; empty where its ends are the wrong way round."""

    low: Numbers
    high: Numbers
    side: _Side = _Side.ALL_OR_NONE

    @classmethod
    def where(cls, holds: NDArray[np.bool_]) -> _Sets:
        """All numbers, or none."""
        return cls(np.where(holds, -np.inf, np.inf), np.where(holds, np.inf, -np.inf))

    def both(self, other: _Sets) -> _Sets:
        """Intersections."""
        return _Sets(np.maximum(self.low, other.low), np.minimum(self.high, other.high), _mixed(self.side, other.side))

    def either(self, other: _Sets) -> _Sets:
        """Unions, of intervals that are bounded from the same side."""
        side = _mixed(self.side, other.side)
        if side is _Side.BETWEEN:
            raise _NoInterval
        return _Sets(np.minimum(self.low, other.low), np.maximum(self.high, other.high), side)

    def others(self) -> _Sets:
        """Complements, of intervals that are bounded from one side."""
        if self.side is _Side.BETWEEN:
            raise _NoInterval
        none = self.low > self.high
        every = np.isneginf(self.low) & np.isposinf(self.high)
        low = np.where(np.isposinf(self.high), -np.inf, np.nextafter(self.high, np.inf))
        high = np.where(np.isposinf(self.high), np.nextafter(self.low, -np.inf), np.inf)
        side = {_Side.FROM: _Side.UP_TO, _Side.UP_TO: _Side.FROM}.get(self.side, self.side)
        low = np.where(none, -np.inf, np.where(every, np.inf, low))
        return _Sets(low, np.where(none, np.inf, np.where(every, -np.inf, high)), side)

    def at(self, places: Places) -> _Sets:
        """Those at some places."""
        return _Sets(self.low[places], self.high[places], self.side)


def _mixed(one: _Side, other: _Side) -> _Side:
    if one is _Side.ALL_OR_NONE or one is other:
        return other
    return one if other is _Side.ALL_OR_NONE else _Side.BETWEEN


@dataclass(frozen=True, slots=True)
class Thresholds:
    """What became of runs.

    Attributes:
        runs: The runs.
        values: A value of the number for each that matches.
        thin: For which of them rounding may decide, or something else is not clear.
    """

    runs: Runs
    values: Numbers
    thin: NDArray[np.bool_]


def thresholds_of(
    runs: RunColumns, stretches: Stretches, columns: AtomColumns, expanded: Sequence[Node], variables: Sequence[Leaf]
) -> Thresholds | None:
    """What becomes of the runs from all starts; None if the program has another form.

    Args:
        runs: What the program says about time.
        stretches: Stretches with their starts.
        columns: Over their places.
        expanded: Conditions over time.
        variables: Their random variables.
    """
    ended = [each.condition for each in runs.dynamics.terminations if each.condition is not None]
    if len(variables) != 1 or isinstance(variables[0], Index | DiscreteRange) or not runs.dynamics.terminates:
        return None
    if runs.clauses is None or runs.together is None or leaves(*(expanded[each.number] for each in ended)):
        return None
    reader = _Reader(columns, expanded, variables[0])
    try:
        low, high = support(variables[0])
        ends, over, unclear = ends_of(runs.dynamics, stretches, reader.truth)
        starts = stretches.starts
        n = len(starts)
        truth, values = np.full(n, FALSE), np.full(n, math.nan)
        thin = np.zeros(n, np.bool_)
        for level in (UNKNOWN, TRUE):
            for clause in runs.together:
                found = reader.clause(clause, int(level), starts, ends)
                found = found.both(_Sets(np.full(n, low), np.full(n, high)))
                width = found.high - found.low
                with np.errstate(all="ignore"):
                    thin |= np.isfinite(width) & (np.abs(width) <= _THIN * (1 + np.abs(found.low)))
                truth[(width >= 0) & ~over] = level
                for place in np.flatnonzero((width >= 0) & np.isnan(values)).tolist() if level == TRUE else ():
                    values[place] = inside(float(found.low[place]), float(found.high[place]))
        broken = np.full(n, None, dtype=object)
        left = np.flatnonzero((truth == FALSE) & ~over)
        for requirement, clauses in zip(runs.dynamics.requirements, runs.clauses, strict=True):
            fits = np.zeros(len(left), np.bool_)
            for clause in clauses:
                found = reader.clause(clause, int(UNKNOWN), starts[left], ends[left])
                fits |= np.minimum(found.high, high) >= np.maximum(found.low, low)
            broken[left[~fits]] = requirement.span
            left = left[fits]
        if runs.dynamics.requirements:
            # each can hold, but not all with one number
            broken[left] = runs.dynamics.requirements[-1].span
    except (_NoInterval, UnclearVariable):
        return None
    runs_ = Runs(ends, truth, broken, over, *np.zeros((2, len(ends)), np.bool_))
    return Thresholds(runs_, values, unclear | (thin & ~over))


@dataclass(eq=False, slots=True)
class _Reader:
    """Reads sets of numbers off conditions."""

    columns: AtomColumns
    expanded: Sequence[Node]
    leaf: Leaf

    def truth(self, atom: Atom) -> Truth:
        """The value of an atom that does not hang on the number."""
        return self.columns.truth_of(self.expanded[atom.number])

    def clause(self, clause: Clause, level: int, starts: Places, ends: Places) -> _Sets:
        """The numbers for which all parts of a clause hold of runs."""
        found = _Sets.where(np.ones(len(starts), np.bool_))
        for part in clause:
            found = found.both(self._part(part, level, starts, ends))
        return found

    def _part(self, part: FormulaPart, level: int, starts: Places, ends: Places) -> _Sets:
        formulas = [part.formula, *([] if part.before is None else [part.before])]
        if not leaves(*(self.expanded[atom.number] for each in formulas for atom in _atoms(each))):
            low, high = bounds(part, self.truth, level, starts)
            return _Sets.where((low <= ends) & (ends <= high))
        sets = self._formula(part.formula, level, positive=part.positive)
        match part.kind:
            case PartKind.NOW:
                return sets.at(starts)
            case PartKind.ALWAYS:
                low, high = _between(np.maximum, sets.low, starts, ends), _between(np.minimum, sets.high, starts, ends)
                return _Sets(low, high, sets.side)
            case PartKind.EVENTUALLY:
                if sets.side is _Side.BETWEEN:
                    raise _NoInterval
                low, high = _between(np.minimum, sets.low, starts, ends), _between(np.maximum, sets.high, starts, ends)
                return _Sets(low, high, sets.side)
            case PartKind.NEXT | PartKind.IF_NEXT:
                last = starts == ends
                following = sets.at(np.where(last, starts, starts + 1))
                beyond = _Sets.where(np.full(len(starts), part.kind is PartKind.IF_NEXT))
                return _Sets(
                    np.where(last, beyond.low, following.low), np.where(last, beyond.high, following.high), sets.side
                )
            case _:
                raise _NoInterval

    def _formula(self, formula: Formula, level: int, *, positive: bool) -> _Sets:
        """The numbers for which a formula without operators of time has at least a truth value at each place."""
        # of a negation the other level is asked: it holds as surely as what it negates fails
        least = level if positive else int(TRUE) + 1 - level

        def below(asked: tuple[Formula, int]) -> list[tuple[Formula, int]]:
            node, wanted = asked
            return [(part, int(TRUE) + 1 - wanted if isinstance(node, Not) else wanted) for part in operands(node)]

        def sets(asked: tuple[Formula, int], parts: list[_Sets]) -> _Sets:
            node, wanted = asked
            match node:
                case Atom():
                    return self._condition(self.expanded[node.number], wanted)
                case Not():
                    return parts[0].others()
                case And() | Or():
                    return _combined(parts, _Sets.both if isinstance(node, And) else _Sets.either)
                case _:
                    raise _NoInterval

        found = folded((formula, least), below, sets)
        return found if positive else found.others()

    def _condition(self, root: Node, level: int) -> _Sets:
        """The same for a condition; what is undefined is undefined negated, too."""

        def below(asked: tuple[Node, bool]) -> list[tuple[Node, bool]]:
            node, positive = asked
            if not isinstance(node, Logic) or not leaves(node):
                return []
            return [(part, positive != (node.op is LogicOp.NOT)) for part in node.args]

        def sets(asked: tuple[Node, bool], parts: list[_Sets]) -> _Sets:
            node, positive = asked
            if not leaves(node):
                truth = self.columns.truth_of(node if positive else Logic(LogicOp.NOT, (node,)))
                return _Sets.where(truth >= level)
            if isinstance(node, Compare):
                return self._comparison(node, level, positive=positive)
            if not isinstance(node, Logic):
                raise _NoInterval
            if node.op is LogicOp.NOT:
                return parts[0]
            return _combined(parts, _Sets.both if (node.op is LogicOp.AND) == positive else _Sets.either)

        return folded((root, True), below, sets)

    def _comparison(self, node: Compare, level: int, *, positive: bool) -> _Sets:
        if node.op in (CompareOp.EQ, CompareOp.NE):
            raise _NoInterval
        at_0, slope, unknown = affine_sides(self.columns, self.leaf, node)
        greater = (node.op in (CompareOp.GT, CompareOp.GE)) == positive
        closed = (node.op in (CompareOp.GE, CompareOp.LE)) == positive
        with np.errstate(all="ignore"):
            threshold = -at_0 / slope
            holds = (at_0 >= 0 if closed else at_0 > 0) if greater else (at_0 <= 0 if closed else at_0 < 0)
        rising = slope > 0
        if (slope > 0).any() and (slope < 0).any():
            side = _Side.BETWEEN
        elif (slope != 0).any():
            side = _Side.FROM if bool((slope > 0).any()) == greater else _Side.UP_TO
        else:
            side = _Side.ALL_OR_NONE
        starts_there = rising == greater
        low = np.where(starts_there, threshold if closed else np.nextafter(threshold, np.inf), -np.inf)
        high = np.where(starts_there, np.inf, threshold if closed else np.nextafter(threshold, -np.inf))
        fixed = _Sets.where(holds)
        low, high = np.where(slope == 0, fixed.low, low), np.where(slope == 0, fixed.high, high)
        lost = _Sets.where(unknown & (level <= UNKNOWN))
        there = np.isfinite(at_0) & np.isfinite(slope) & ~unknown
        return _Sets(np.where(there, low, lost.low), np.where(there, high, lost.high), side)


def _combined(parts: Sequence[_Sets], combine: Callable[[_Sets, _Sets], _Sets]) -> _Sets:
    found = parts[0]
    for part in parts[1:]:
        found = combine(found, part)
    return found


def _atoms(formula: Formula) -> list[Atom]:
    found: list[Atom] = []
    stack = [formula]
    while stack:
        node = stack.pop()
        stack.extend(operands(node))
        if isinstance(node, Atom):
            found.append(node)
    return found


def _between(combine: np.ufunc, values: Numbers, starts: Places, ends: Places) -> Numbers:
    """What the values from each start to its end make together, both included, by doubling."""
    level = np.frexp((ends - starts + 1).astype(np.float64))[1] - 1
    found = np.empty(len(starts))
    table, size = values, 1
    for power in range(int(level.max(initial=0)) + 1):
        mine = level == power
        found[mine] = combine(table[starts[mine]], table[ends[mine] + 1 - size])
        if len(table) > size:
            table = combine(table[:-size], table[size:])
        size *= 2
    return found
