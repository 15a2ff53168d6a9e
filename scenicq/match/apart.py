"""Groups that fall apart once one random number is known: each part is decided by itself.

A row of cars that follow a road, each at a distance of its own but all shifted to the side by the same random number,
is one group. Its parts are small, and what one of them excludes is excluded. The number that they share is taken from
where single parts want it, or else is narrowed down by halving.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from scenicq.forest.bounds import Interval
from scenicq.forest.condition import condition
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Index, Leaf, Node, Range, TruncatedNormal, Value
from scenicq.forest.walk import leaves, postorder
from scenicq.match.ground import holds, replay
from scenicq.match.interval import ends
from scenicq.match.ladder import LINEAR_SLACK, Item, Maybe, No, Outcome, Yes, decide, ground_cause
from scenicq.match.narrowing import narrowed, within
from scenicq.match.options import Tolerance
from scenicq.match.shooting import shoot

__all__ = ["decide_apart"]

_TIGHT = 0.05
"""Share of the tolerance with which a part is asked first, so that its witness suits the others, too."""
_MOST_HALVES = 60
_PATIENCE = 8
"""Parts of a group along a field that are put to the ladder at most; what is open then is for a solver."""


@dataclass(slots=True)
class _Patience:
    """How many parts may still be put to the ladder."""

    left: int = _PATIENCE


def decide_apart(items: list[Item], tolerance: Tolerance) -> Outcome:
    """Decide a group without a solver, part by part where it has parts; `Maybe` where a solver is needed.

    Args:
        items: The group's constraints, conditioned.
        tolerance: Per feature.
    """
    return _apart(items, tolerance, _Patience())


def _apart(items: list[Item], tolerance: Tolerance, patience: _Patience) -> Outcome:
    left: list[Item] = []
    for item in items:
        if not isinstance(item[1], Constant):
            left.append(item)
        elif not holds(item[0], item[1].value, item[2], tolerance):
            return No(item[0], ground_cause(item))
    wide: tuple[Identity, Interval] | None = None
    turning = any(isinstance(node, DirectionAt) for node in postorder([node for _, node, _ in left]))
    if turning:
        narrower = narrowed(left, tolerance)
        if isinstance(narrower, tuple):
            return No(narrower[0])
        left, wide = narrower.items, narrower.wide
    used = {id(item): {leaf.identity: leaf for leaf in leaves(item[1])} for item in left}
    alone = _components(left, used, None)
    if len(alone) > 1:
        return _all(alone, items, tolerance, patience)
    shared = _shared(left, used)
    if shared is not None:
        return _Sharing(items, left, *shared, tolerance, patience).decide()
    choice = next((leaf for item in left for leaf in used[id(item)].values() if isinstance(leaf, Index)), None)
    if choice is not None and turning:
        return _either(
            left[0],
            (
                (_given(left, {choice.identity: float(n)}), {choice.identity: float(n)})
                for n in range(len(choice.weights))
            ),
            tolerance,
            patience,
        )
    guessed = shoot(left, tolerance) if turning else None
    if guessed is not None:
        return guessed
    if wide is not None:
        identity, (low, high) = wide
        middle = (low + high) / 2
        halves = ((low, middle), (middle, high))
        return _either(left[0], ((within(left, {identity: half}), {}) for half in halves), tolerance, patience)
    if turning:
        if patience.left <= 0:
            return Maybe(items[0][0], "nonlinear")
        patience.left -= 1
    return decide(left, tolerance)


def _either(
    first: Item,
    cases: Iterator[tuple[list[Item], Mapping[Identity, Value]]],
    tolerance: Tolerance,
    patience: _Patience,
) -> Outcome:
    """Cases of a group, one of which must be satisfied; with each the values that it chooses."""
    found: Outcome | None = None
    for items, given in cases:
        outcome = _apart(items, tolerance, patience)
        if isinstance(outcome, Yes):
            return Yes({**given, **outcome.values})
        found = outcome if found is None or isinstance(outcome, Maybe) else found
    return found or No(first[0])


def _given(items: Sequence[Item], given: Mapping[Identity, Value]) -> list[Item]:
    memo: dict[int, Node] = {}
    return [(c, condition(node, {}, given, memo), seen) for c, node, seen in items]


def _all(parts: Sequence[list[Item]], items: list[Item], tolerance: Tolerance, patience: _Patience) -> Outcome:
    """Parts that have no random variable in common."""
    values: dict[Identity, Value] = {}
    doubt: Maybe | None = None
    for part in parts:
        outcome = _apart(part, tolerance, patience)
        if isinstance(outcome, No):
            return outcome
        if isinstance(outcome, Maybe):
            doubt = doubt or outcome
        else:
            values.update(outcome.values)
    if doubt is not None:
        return doubt
    return Yes(values) if replay(items, values, tolerance, LINEAR_SLACK) else Maybe(items[0][0], "nonlinear")


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
        patience: _Patience,
    ) -> None:
        self.patience = patience
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
            outcome = _apart(part, self.tolerance, self.patience)
            if isinstance(outcome, No):
                return outcome
            tight = _apart(part, _scaled(self.tolerance, _TIGHT), self.patience)
            witness = tight if isinstance(tight, Yes) else outcome
            value = witness.values.get(self.identity) if isinstance(witness, Yes) else None
            if isinstance(value, float):
                wanted.append(value)
        for value in _candidates(wanted):
            found = self._with(value)
            if found is not None:
                return found
        return self._halved()

    def _with(self, value: float) -> Yes | None:
        """A solution in which the shared number has a value."""
        if value in self.tried:
            return None
        self.tried.add(value)
        given: dict[Identity, Value] = {self.identity: value}
        outcome = _apart(_given(self.left, given), self.tolerance, self.patience)
        if not isinstance(outcome, Yes):
            return None
        values = given | dict(outcome.values)
        return Yes(values) if replay(self.items, values, self.tolerance, LINEAR_SLACK) else None

    def _halved(self) -> Outcome:
        """The range of the shared number halved again and again, without what some part excludes."""
        todo = [self.limits]
        blamed: Outcome = No(self.items[0][0])
        for _ in range(_MOST_HALVES):
            if not todo:
                return blamed
            low, high = todo.pop()
            here = {self.identity: (low, high)}
            outcomes = (_apart(within(part, here), self.tolerance, self.patience) for part in self.parts)
            excluded = next((outcome for outcome in outcomes if isinstance(outcome, No)), None)
            if excluded is not None:
                blamed = excluded
                continue
            middle = (low + high) / 2
            found = self._with(middle)
            if found is not None:
                return found
            todo += [(low, middle), (middle, high)]
        return Maybe(self.items[0][0], "nonlinear")


def _candidates(wanted: Sequence[float]) -> Iterator[float]:
    if wanted:
        yield sorted(wanted)[len(wanted) // 2]
        yield sum(wanted) / len(wanted)
        yield (min(wanted) + max(wanted)) / 2
        yield from wanted


def _scaled(tolerance: Tolerance, factor: float) -> Tolerance:
    def times(value: float | None) -> float | None:
        return None if value is None else value * factor

    return replace(
        tolerance,
        x=times(tolerance.x),
        y=times(tolerance.y),
        position=tolerance.position * factor,
        heading=tolerance.heading * factor,
        other=tolerance.other * factor,
    )
