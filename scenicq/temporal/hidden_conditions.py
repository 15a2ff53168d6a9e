"""Conditions that depend on hidden variables: at each sample, on which side of some thresholds a variable must be.

A comparison that is affine in one hidden variable changes its outcome at one value of it at each sample, a *cut*.
Values from the cut on are its *upper side*. Between the cuts every condition is constant, so it has one column for each
choice of sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.columns import DEFINED, UNDEFINED, Column
from scenicq.forest.columns import UNKNOWN as UNOBSERVED
from scenicq.forest.nodes import Compare, CompareOp, Leaf, Logic, Node
from scenicq.forest.walk import children, leaves
from scenicq.limits import LIMITS
from scenicq.temporal.atoms import AtomColumns, UnclearVariable
from scenicq.temporal.hidden import affine_sides, comparisons_of, random_variables, support
from scenicq.temporal.truth import FALSE, Truth

__all__ = ["Cut", "HiddenConditions"]

_ROUNDING = 1e-12
"""Relative difference of two values below which they are one."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Cut:
    """The threshold of a hidden variable at each sample: a comparison changes its outcome there.

    Attributes:
        variable: The number of the variable.
        at: The least value on the upper side, shape (n,); infinite where all values are on one side.
    """

    variable: int
    at: Numbers


@dataclass(slots=True)
class _Difference:
    """The left operand of a comparison minus the right one, at each sample, as a line over a hidden variable.

    Attributes:
        variable: The number of the variable.
        at_zero: The difference if the variable is 0.
        slope: By how much the difference grows with the variable.
        unknown: Where the difference is not known.
        root: The value of the variable at which both operands are equal; not finite if there is none.
    """

    variable: int
    at_zero: Numbers
    slope: Numbers
    unknown: NDArray[np.bool_]
    root: Numbers = field(init=False)

    def __post_init__(self) -> None:
        """Find where both operands are equal."""
        with np.errstate(all="ignore"):
            self.root = -self.at_zero / self.slope


@dataclass(frozen=True, slots=True)
class _Comparison:
    """A comparison with a hidden variable.

    Attributes:
        node: The comparison.
        cuts: The numbers of its cuts, the lower one first.
        values: Its value below the first cut, from the first on, and from the second on.
        status: Where it is known, undefined or unobserved.
    """

    node: Compare
    cuts: tuple[int, ...]
    values: Sequence[NDArray[np.bool_]]
    status: NDArray[np.int8]


@dataclass(eq=False, slots=True)
class HiddenConditions:
    """The conditions of a program over time that depend on hidden variables, over some samples.

    Attributes:
        columns: What is observed at the samples.
        expanded: All conditions over time.
        variables: Their random variables.
        low, high: The range of each variable.
        cuts: All cuts.
        cuts_of: For each condition with a hidden variable, by the condition's number: the numbers of its cuts.

    Raises:
        UnclearVariable: A condition is not affine in a variable, or depends on two at once.
    """

    columns: AtomColumns
    expanded: Sequence[Node]
    variables: Sequence[Leaf] = field(init=False)
    low: Numbers = field(init=False)
    high: Numbers = field(init=False)
    cuts: list[Cut] = field(init=False, default_factory=list[Cut])
    cuts_of: dict[int, tuple[int, ...]] = field(init=False, default_factory=dict[int, tuple[int, ...]])
    _differences: dict[int, _Difference] = field(init=False, default_factory=dict["int", "_Difference"])
    _comparison_of: dict[int, _Comparison] = field(init=False, default_factory=dict["int", "_Comparison"])
    _comparisons_of: dict[int, list[_Comparison]] = field(init=False, default_factory=dict["int", "list[_Comparison]"])
    _truths: dict[tuple[int, int], Truth] = field(init=False, default_factory=dict["tuple[int, int]", Truth])
    _observed_parts: dict[int, Mapping[int, Column]] = field(
        init=False, default_factory=dict["int", "Mapping[int, Column]"]
    )

    def __post_init__(self) -> None:
        """Find the cuts."""
        self.variables = random_variables(self.expanded)
        ends = [support(leaf) for leaf in self.variables]
        self.low, self.high = (np.array([each[side] for each in ends]) for side in (0, 1))
        inside = [self._comparisons_in(condition) for condition in self.expanded]
        differences = {id(each): difference for found in inside for each, difference in found}
        for variable, (low, high) in enumerate(ends):
            mine = [each for each in differences.values() if each.variable == variable]
            for each, root in zip(mine, _merge_close([each.root for each in mine], (low, high)), strict=True):
                each.root = root
        made = {id(each): self._comparison(each, differences[id(each)]) for found in inside for each, _ in found}
        for number, found in enumerate(inside):
            if found:
                self._comparisons_of[number] = [made[key] for key in dict.fromkeys(id(each) for each, _ in found)]
                self.cuts_of[number] = tuple(cut for each in self._comparisons_of[number] for cut in each.cuts)
                if len(self.cuts_of[number]) > LIMITS.condition_cuts:
                    raise UnclearVariable("too many values of random variables to tell apart")

    def truth(self, number: int, places: NDArray[np.int64] | slice, sides: Mapping[int, NDArray[np.bool_]]) -> Truth:
        """The value of a condition at some samples.

        Args:
            number: The number of the condition.
            places: The samples.
            sides: For each of its cuts whether the variable is on the upper side, at each of these samples.
        """
        cuts = self.cuts_of[number]
        pattern = np.zeros(len(sides[cuts[0]]), np.int64)
        for place, cut in enumerate(cuts):
            pattern += sides[cut].astype(np.int64) << place
        found = np.full(len(pattern), FALSE)
        for each in np.unique(pattern).tolist():
            mine = pattern == each
            found[mine] = self._column(number, each)[places][mine]
        return found

    def possible_range(self, number: int) -> tuple[int, Numbers, Numbers] | None:
        """The variable of a condition, and the range of its values for which the condition may hold at each sample.

        Both ends are included; an empty range has its lower end above the upper one. None for several variables.

        Args:
            number: The number of the condition.
        """
        cuts = sorted(self.cuts_of[number])
        variables = {self.cuts[cut].variable for cut in cuts}
        if len(variables) > 1 or len(cuts) > LIMITS.jump_cuts:
            return None
        places = [self.cuts[cut].at for cut in cuts]
        infinite = np.full(len(places[0]), np.inf)
        ends = [-infinite, *np.sort(np.stack(places), axis=0), infinite]
        low, high = infinite.copy(), -infinite
        for lower, upper in pairwise(ends):
            sides = {cut: at <= lower for cut, at in zip(cuts, places, strict=True)}
            holds = (self.truth(number, slice(None), sides) > FALSE) & (lower < upper)
            low = np.where(holds, np.minimum(low, lower), low)
            high = np.where(holds, np.where(upper == np.inf, np.inf, np.nextafter(upper, -np.inf)), high)
        return variables.pop(), low, high

    def _column(self, number: int, pattern: int) -> Truth:
        """The value of a condition at all samples; a bit of the pattern says that its cut's upper side is meant."""
        if (number, pattern) not in self._truths:
            upper = {cut for place, cut in enumerate(self.cuts_of[number]) if pattern >> place & 1}
            given = {**self._observed_parts_of(number)}
            for each in self._comparisons_of[number]:
                value = each.values[sum(cut in upper for cut in each.cuts)]
                given[id(each.node)] = Column(value, each.status)
            self._truths[number, pattern] = self.columns.assuming(given).truth_of(self.expanded[number])
        return self._truths[number, pattern]

    def _observed_parts_of(self, number: int) -> Mapping[int, Column]:
        """The values of the parts of a condition that depend on no hidden variable, by the ids of their nodes."""
        if number not in self._observed_parts:
            found: dict[int, Column] = {}
            stack = [self.expanded[number]]
            while stack:
                node = stack.pop()
                if not leaves(node):
                    # where a field allows several directions, each is tried
                    if (column := self.columns.column(node)) is not None:
                        found[id(node)] = column
                elif isinstance(node, Logic):
                    stack += children(node)
            self._observed_parts[number] = found
        return self._observed_parts[number]

    def _comparisons_in(self, condition: Node) -> list[tuple[Compare, _Difference]]:
        """The comparisons of a condition with hidden variables."""
        found: list[tuple[Compare, _Difference]] = []
        for variable, leaf in enumerate(self.variables):
            for node in comparisons_of(leaf, [condition]):
                if any(each.identity is not leaf.identity for each in leaves(node)):
                    raise UnclearVariable("a comparison of two hidden random variables over time")
                if id(node) not in self._differences:
                    self._differences[id(node)] = _Difference(variable, *affine_sides(self.columns, leaf, node))
                found.append((node, self._differences[id(node)]))
        return found

    def _comparison(self, node: Compare, difference: _Difference) -> _Comparison:
        """Add the cuts of a comparison, and keep it with them."""
        if id(node) in self._comparison_of:
            return self._comparison_of[id(node)]
        at_zero, rising, beyond = difference.at_zero, difference.slope > 0, np.nextafter(difference.root, np.inf)
        there = np.isfinite(at_zero) & np.isfinite(difference.slope) & ~difference.unknown
        turns = there & (difference.slope != 0)
        if node.op in (CompareOp.EQ, CompareOp.NE):
            same = node.op is CompareOp.EQ
            constant = (at_zero == 0) == same
            ends = (difference.root, beyond)
            values = [np.full(len(at_zero), each) for each in (not same, same, not same)]
        else:
            # `>` and `<=` turn where both sides are no longer equal, `>=` and `<` where they are
            strict = node.op in (CompareOp.GT, CompareOp.LE)
            positive = node.op in (CompareOp.GT, CompareOp.GE)
            constant = (at_zero > 0 if strict else at_zero >= 0) == positive
            ends = (np.where(rising == strict, beyond, difference.root),)
            values = [~rising == positive, rising == positive]
        first = len(self.cuts)
        self.cuts += [Cut(difference.variable, np.where(turns, each, np.inf)) for each in ends]
        status = np.where(difference.unknown, UNOBSERVED, np.where(there, DEFINED, UNDEFINED))
        cuts = tuple(range(first, len(self.cuts)))
        self._comparison_of[id(node)] = _Comparison(
            node, cuts, [np.where(turns, each, constant) for each in values], status
        )
        return self._comparison_of[id(node)]


def _merge_close(values: Sequence[Numbers], ends: tuple[float, float]) -> list[Numbers]:
    """Replace values that differ only by rounding by one value, or by the end next to them.

    Args:
        values: The values.
        ends: The ends of the variable's range.
    """
    every = np.concatenate([*values, np.array(ends)])
    order = np.argsort(every, kind="stable")
    ordered = every[order]
    with np.errstate(invalid="ignore"):
        apart = ~(np.diff(ordered) <= _ROUNDING * (1 + np.abs(ordered[1:])))
    which = np.concatenate(([0], np.cumsum(apart)))
    common = ordered[np.concatenate(([True], apart))]
    place = np.empty(len(every), np.int64)
    place[order] = which
    for end in (-1, -2):
        common[place[end]] = every[end]
    snapped = common[place]
    return np.split(snapped[:-2], np.cumsum([len(each) for each in values])[:-1])
