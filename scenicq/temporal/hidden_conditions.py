"""Conditions that hang on hidden numbers: at each sample, which side of some thresholds a number must be on.

A comparison that is affine in one hidden number changes its outcome at one value of it at each sample, a *cut*. Between
the cuts every condition is constant, so it has one column for each choice of the sides.
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
    """At each place the least value of a hidden number that is on the upper side.

    Attributes:
        variable: The number of the variable.
        at: The values, shape (n,); infinite where all are on one side.
    """

    variable: int
    at: Numbers


@dataclass(slots=True)
class _Sides:
    """The left side of a comparison minus the right one, at each place.

    Attributes:
        variable: The number of the hidden number that it hangs on.
        at_0: The difference where that is 0.
        slope: By how much it grows with it.
        unknown: Where it is not known.
        equal: For which value both sides are equal; not finite where there is none.
    """

    variable: int
    at_0: Numbers
    slope: Numbers
    unknown: NDArray[np.bool_]
    equal: Numbers = field(init=False)

    def __post_init__(self) -> None:
        """Find where both sides are equal."""
        with np.errstate(all="ignore"):
            self.equal = -self.at_0 / self.slope


@dataclass(frozen=True, slots=True)
class _Comparison:
    """A comparison with a hidden number.

    Attributes:
        node: The comparison.
        cuts: The numbers of its cuts, the lower one first.
        values: Its value below the first cut, from it on, and from the second on.
        status: Where it is known, undefined or not observed.
    """

    node: Compare
    cuts: tuple[int, ...]
    values: Sequence[NDArray[np.bool_]]
    status: NDArray[np.int8]


@dataclass(eq=False, slots=True)
class HiddenConditions:
    """The conditions of a program over time that hang on hidden numbers, over some places.

    Attributes:
        columns: What is observed at the places.
        expanded: All conditions over time.
        variables: Their random variables.
        low, high: Ends of the values of each variable.
        cuts: All cuts.
        of: The cuts of each condition that hangs on a variable, by its number.

    Raises:
        UnclearVariable: A condition is not affine in a variable or hangs on two at once.
    """

    columns: AtomColumns
    expanded: Sequence[Node]
    variables: Sequence[Leaf] = field(init=False)
    low: Numbers = field(init=False)
    high: Numbers = field(init=False)
    cuts: list[Cut] = field(init=False, default_factory=list[Cut])
    of: dict[int, tuple[int, ...]] = field(init=False, default_factory=dict[int, tuple[int, ...]])
    _sides: dict[int, _Sides] = field(init=False, default_factory=dict["int", "_Sides"])
    _made: dict[int, _Comparison] = field(init=False, default_factory=dict["int", "_Comparison"])
    _inside: dict[int, list[_Comparison]] = field(init=False, default_factory=dict["int", "list[_Comparison]"])
    _known: dict[tuple[int, int], Truth] = field(init=False, default_factory=dict["tuple[int, int]", Truth])
    _beside: dict[int, Mapping[int, Column]] = field(init=False, default_factory=dict["int", "Mapping[int, Column]"])

    def __post_init__(self) -> None:
        """Find the cuts."""
        self.variables = random_variables(self.expanded)
        ends = [support(leaf) for leaf in self.variables]
        self.low, self.high = (np.array([each[side] for each in ends]) for side in (0, 1))
        inside = [self._comparisons_in(condition) for condition in self.expanded]
        sides = {id(each): side for found in inside for each, side in found}
        for variable, (low, high) in enumerate(ends):
            mine = [each for each in sides.values() if each.variable == variable]
            for each, equal in zip(mine, _snapped([each.equal for each in mine], (low, high)), strict=True):
                each.equal = equal
        made = {id(each): self._comparison(each, sides[id(each)]) for found in inside for each, _ in found}
        for number, found in enumerate(inside):
            if found:
                self._inside[number] = [made[key] for key in dict.fromkeys(id(each) for each, _ in found)]
                self.of[number] = tuple(cut for each in self._inside[number] for cut in each.cuts)
                if len(self.of[number]) > LIMITS.condition_cuts:
                    raise UnclearVariable("too many values of random variables to tell apart")

    def truth(self, number: int, places: NDArray[np.int64] | slice, sides: Mapping[int, NDArray[np.bool_]]) -> Truth:
        """The value of a condition at some places.

        Args:
            number: Its number.
            places: The places.
            sides: For each of its cuts whether the hidden number is on the upper side, at each of these places.
        """
        cuts = self.of[number]
        pattern = np.zeros(len(sides[cuts[0]]), np.int64)
        for place, cut in enumerate(cuts):
            pattern += sides[cut].astype(np.int64) << place
        found = np.full(len(pattern), FALSE)
        for each in np.unique(pattern).tolist():
            mine = pattern == each
            found[mine] = self._column(number, each)[places][mine]
        return found

    def possible(self, number: int) -> tuple[int, Numbers, Numbers] | None:
        """The variable of a condition, and between which values of it the condition may hold at each place.

        Both ends are included; the lower one is above the other where there are none. None where it hangs on several.

        Args:
            number: The condition's number.
        """
        cuts = sorted(self.of[number])
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
        """The value of a condition at all places, with its cuts' sides as bits."""
        if (number, pattern) not in self._known:
            upper = {cut for place, cut in enumerate(self.of[number]) if pattern >> place & 1}
            given = {**self._beside_of(number)}
            for each in self._inside[number]:
                value = each.values[sum(cut in upper for cut in each.cuts)]
                given[id(each.node)] = Column(value, each.status)
            self._known[number, pattern] = self.columns.assuming(given).truth_of(self.expanded[number])
        return self._known[number, pattern]

    def _beside_of(self, number: int) -> Mapping[int, Column]:
        """The values of the parts of a condition that hang on no hidden number, by the ids of their nodes."""
        if number not in self._beside:
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
            self._beside[number] = found
        return self._beside[number]

    def _comparisons_in(self, condition: Node) -> list[tuple[Compare, _Sides]]:
        """The comparisons of a condition with hidden numbers."""
        found: list[tuple[Compare, _Sides]] = []
        for variable, leaf in enumerate(self.variables):
            for node in comparisons_of(leaf, [condition]):
                if any(each.identity is not leaf.identity for each in leaves(node)):
                    raise UnclearVariable("a comparison of two hidden random variables over time")
                if id(node) not in self._sides:
                    self._sides[id(node)] = _Sides(variable, *affine_sides(self.columns, leaf, node))
                found.append((node, self._sides[id(node)]))
        return found

    def _comparison(self, node: Compare, sides: _Sides) -> _Comparison:
        """A comparison with its cuts, which are added."""
        if id(node) in self._made:
            return self._made[id(node)]
        at_0, rising, beyond = sides.at_0, sides.slope > 0, np.nextafter(sides.equal, np.inf)
        there = np.isfinite(at_0) & np.isfinite(sides.slope) & ~sides.unknown
        turns = there & (sides.slope != 0)
        if node.op in (CompareOp.EQ, CompareOp.NE):
            same = node.op is CompareOp.EQ
            constant = (at_0 == 0) == same
            ends = (sides.equal, beyond)
            values = [np.full(len(at_0), each) for each in (not same, same, not same)]
        else:
            # `>` and `<=` turn where both sides are no longer equal, `>=` and `<` where they are
            strict = node.op in (CompareOp.GT, CompareOp.LE)
            positive = node.op in (CompareOp.GT, CompareOp.GE)
            constant = (at_0 > 0 if strict else at_0 >= 0) == positive
            ends = (np.where(rising == strict, beyond, sides.equal),)
            values = [~rising == positive, rising == positive]
        first = len(self.cuts)
        self.cuts += [Cut(sides.variable, np.where(turns, each, np.inf)) for each in ends]
        status = np.where(sides.unknown, UNOBSERVED, np.where(there, DEFINED, UNDEFINED))
        cuts = tuple(range(first, len(self.cuts)))
        self._made[id(node)] = _Comparison(node, cuts, [np.where(turns, each, constant) for each in values], status)
        return self._made[id(node)]


def _snapped(values: Sequence[Numbers], ends: tuple[float, float]) -> list[Numbers]:
    """Numbers of which those become one that rounding alone tells apart, from each other or from the ends.

    Args:
        values: The numbers.
        ends: They take the place of what is next to them.
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
