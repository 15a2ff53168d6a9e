"""Groups that fall apart once one random number is known: each part is decided by itself.

A row of cars that follow a road, each at a distance of its own but all shifted to the side by the same random number,
is one group. Its parts are small, and what one of them excludes is excluded. The number that they share is taken from
where single parts want it, or else is narrowed down by halving.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from scenicq.forest.bounds import Interval
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Leaf, Node, Range, TruncatedNormal, Value
from scenicq.forest.walk import leaves, postorder, transform
from scenicq.match.decide.cascade import decide
from scenicq.match.decide.case_split import Picked, picked
from scenicq.match.fields.field_solver import decide_directions
from scenicq.match.linear.affine_reach import ends
from scenicq.match.problem.conditioned import Item, conditioned
from scenicq.match.problem.evaluation import ground_cause, holds, replay
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["decide_decomposed"]

_TIGHT = 0.05
"""Share of the tolerance with which a part is asked first, so that its witness suits the others, too."""
_MOST_HALVES = 60
_FEW = 2
"""Fields at hidden points whose cells the ladder may go through one by one."""


def decide_decomposed(items: list[Item], tolerance: Tolerance) -> Outcome:
    """Decide a group without a solver, part by part where it has parts; `Maybe` where a solver is needed.

    Args:
        items: The group's constraints, conditioned.
        tolerance: Per feature.
    """
    left: list[Item] = []
    for item in items:
        if not isinstance(item[1], Constant):
            left.append(item)
        elif not holds(item[0], item[1].value, item[2], tolerance):
            return Refuted(item[0], ground_cause(item))
    used = {id(item): {leaf.identity: leaf for leaf in leaves(item[1])} for item in left}
    alone = _components(left, used, None)
    if len(alone) > 1:
        return _all(alone, items, tolerance)
    cases = picked(left, tolerance)
    if cases is not None:
        return _any(cases, items, tolerance)
    fields = _fields([node for _, node, _ in left])
    shared = _shared(left, used)
    if fields:
        parts, number = ([left], None) if shared is None else (shared[2], shared[0].identity)
        found = decide_directions(parts, number, tolerance)
        return decide(left, tolerance) if isinstance(found, Undecided) and fields <= _FEW else found
    if shared is not None:
        return _Sharing(items, left, *shared, tolerance).decide()
    return decide(left, tolerance)


def _fields(nodes: list[Node]) -> int:
    """At how many hidden points fields are asked for; the ranks of one look-up ask for one and the same."""
    return len({id(node.point) for node in postorder(nodes) if isinstance(node, DirectionAt)})


def _all(parts: Sequence[list[Item]], items: list[Item], tolerance: Tolerance) -> Outcome:
    """Parts that have no random variable in common."""
    values: dict[Identity, Value] = {}
    doubt: Undecided | None = None
    for part in parts:
        outcome = decide_decomposed(part, tolerance)
        if isinstance(outcome, Refuted):
            return outcome
        if isinstance(outcome, Undecided):
            doubt = doubt or outcome
        else:
            values.update(outcome.values)
    if doubt is not None:
        return doubt
    return Satisfied(values) if replay(items, values, tolerance, SLACK) else Undecided(items[0][0], "nonlinear")


def _any(cases: Sequence[Picked], items: list[Item], tolerance: Tolerance) -> Outcome:
    """Whether a solution is left in one of some cases."""
    first = items[0][0]
    blamed: Outcome = Refuted(first)
    for case in cases:
        outcome = decide_decomposed(case.items, tolerance)
        if isinstance(outcome, Satisfied):
            values = {**case.given, **outcome.values}
            if replay(items, values, tolerance, SLACK):
                return Satisfied(values)
        if not isinstance(outcome, Refuted):
            blamed = Undecided(first, "nonlinear")
    return blamed


def _components(
    items: Sequence[Item], used: Mapping[int, Mapping[Identity, Leaf]], without: Identity | None
) -> list[list[Item]]:
    """The items in parts that share no random variable but one."""
    found: list[tuple[set[Identity], list[Item]]] = []
    for item in items:
        own = set(used[id(item)]) - {without}
        joined = [item]
        for part in [part for part in found if part[0] & own]:
            found.remove(part)
            own |= part[0]
            joined = part[1] + joined
        found.append((own, joined))
    return [part for _, part in found]


def _shared(
    items: Sequence[Item], used: Mapping[int, Mapping[Identity, Leaf]]
) -> tuple[Leaf, tuple[float, float], list[list[Item]]] | None:
    """The random number without which the parts are smallest, its ends, and the parts."""
    counts: dict[Identity, int] = {}
    known: dict[Identity, Leaf] = {}
    for item in items:
        for identity, leaf in used[id(item)].items():
            counts[identity] = counts.get(identity, 0) + 1
            known[identity] = leaf
    best: tuple[int, Leaf, tuple[float, float], list[list[Item]]] | None = None
    for identity, count in counts.items():
        leaf = known[identity]
        limits = ends(leaf) if count > 1 and isinstance(leaf, Range | TruncatedNormal) else None
        if limits is None:
            continue
        parts = _components(items, used, identity)
        largest = max(map(len, parts))
        own = [any(used[id(item)].keys() - {identity} for item in part) for part in parts]
        if sum(own) > 1 and (best is None or largest < best[0]):
            best = (largest, leaf, limits, parts)
    return None if best is None else best[1:]


def _within(items: Sequence[Item], identity: Identity, limits: Interval) -> list[Item]:
    """The items with a random number kept in a narrower range."""
    low, high = limits

    def step(node: Node) -> Node:
        if isinstance(node, Range | TruncatedNormal) and node.identity == identity:
            return replace(node, low=Constant(low, span=node.low.span), high=Constant(high, span=node.high.span))
        return node

    memo: dict[int, Node] = {}
    return [(c, transform(node, step, memo), seen) for c, node, seen in items]


class _Sharing:
    """Parts that have one random number in common."""

    def __init__(
        self,
        items: list[Item],
        left: list[Item],
        leaf: Leaf,
        limits: tuple[float, float],
        parts: list[list[Item]],
        tolerance: Tolerance,
    ) -> None:
        self.items = items
        self.left = left
        self.identity = leaf.identity
        self.limits = limits
        self.parts = parts
        self.tolerance = tolerance
        self.tried: set[float] = set()

    def decide(self) -> Outcome:
        wanted: list[float] = []
        for part in self.parts:
            outcome = decide_decomposed(part, self.tolerance)
            if isinstance(outcome, Refuted):
                return outcome
            tight = decide_decomposed(part, self.tolerance.scaled(_TIGHT))
            witness = tight if isinstance(tight, Satisfied) else outcome
            value = witness.values.get(self.identity) if isinstance(witness, Satisfied) else None
            if isinstance(value, float):
                wanted.append(value)
        for value in _candidates(wanted):
            found = self._with(value)
            if found is not None:
                return found
        return self._halved()

    def _with(self, value: float) -> Satisfied | None:
        """A solution in which the shared number has a value."""
        if value in self.tried:
            return None
        self.tried.add(value)
        given: dict[Identity, Value] = {self.identity: value}
        outcome = decide_decomposed(conditioned(self.left, given), self.tolerance)
        if not isinstance(outcome, Satisfied):
            return None
        values = given | dict(outcome.values)
        return Satisfied(values) if replay(self.items, values, self.tolerance, SLACK) else None

    def _halved(self) -> Outcome:
        """The range of the shared number halved again and again, without what some part excludes."""
        todo = [self.limits]
        blamed: Outcome = Refuted(self.items[0][0])
        for _ in range(_MOST_HALVES):
            if not todo:
                return blamed
            low, high = todo.pop()
            outcomes = (
                decide_decomposed(_within(part, self.identity, (low, high)), self.tolerance) for part in self.parts
            )
            excluded = next((outcome for outcome in outcomes if isinstance(outcome, Refuted)), None)
            if excluded is not None:
                blamed = excluded
                continue
            middle = (low + high) / 2
            found = self._with(middle)
            if found is not None:
                return found
            todo += [(low, middle), (middle, high)]
        return Undecided(self.items[0][0], "nonlinear")


def _candidates(wanted: Sequence[float]) -> Iterator[float]:
    if wanted:
        yield sorted(wanted)[len(wanted) // 2]
        yield sum(wanted) / len(wanted)
        yield (min(wanted) + max(wanted)) / 2
        yield from wanted
