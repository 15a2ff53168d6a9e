"""A group decided part by part: constraints that share no random variable are decided separately.

What one part excludes is excluded; distances of hidden points become areas; fields at hidden points go to heading
propagation, where parts that one random number alone joins stay parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING

from scenicq.forest.components import connected_components
from scenicq.forest.nodes import Constant, Identity, Index, Leaf, Range, TruncatedNormal, Value
from scenicq.forest.walk import leaves
from scenicq.match.decide.cascade import decide
from scenicq.match.decide.hidden_distances import with_areas
from scenicq.match.linear.affine_reach import ends
from scenicq.match.problem.conditioned import Item, item_conjuncts, uses_far_field, uses_field
from scenicq.match.problem.evaluation import ground_cause, holds, replay
from scenicq.match.problem.outcome import (
    Outcome,
    Refuted,
    Satisfied,
    SearchSteps,
    Undecided,
    finish,
    finish_together,
)
from scenicq.match.tolerance import SLACK, Tolerance

if TYPE_CHECKING:  # takes long to load
    from scenicq.match.fields.heading_propagation import KnownCases

__all__ = ["chooses_apart", "decide_decomposed", "search_decomposed"]

_FEW_OPTIONS = 8
"""Options of a choice up to which a part is looked at for all of them."""


def decide_decomposed(items: list[Item], tolerance: Tolerance) -> Outcome:
    """What `search_decomposed` finds, whatever it takes."""
    return finish(search_decomposed(items, tolerance))


def search_decomposed(items: list[Item], tolerance: Tolerance, known: KnownCases | None = None) -> SearchSteps:
    """Decide a group without a solver, part by part where it has parts; `Undecided` where a solver is needed.

    Args:
        items: The group's constraints, conditioned.
        tolerance: Per feature.
        known: As of `search_directions`.
    """
    left: list[Item] = []
    for item in chain.from_iterable(map(item_conjuncts, items)):
        if not isinstance(item[1], Constant):
            left.append(item)
        elif not holds(item[0], item[1].value, item[2], tolerance):
            return Refuted(item[0], ground_cause(item))
    used = {id(item): {leaf.identity: leaf for leaf in leaves(item[1])} for item in left}
    alone = _components(left, used, None)
    if len(alone) > 1:
        return (yield from _all(alone, items, tolerance, known))
    outlined = with_areas(left, tolerance)
    if outlined is not None:
        found = yield from search_decomposed(outlined, tolerance, known)
        if not isinstance(found, Satisfied) or replay(items, found.values, tolerance, SLACK):
            return found
        found = yield from search_decomposed(with_areas(left, tolerance, outer=False) or [], tolerance, known)
        sure = isinstance(found, Satisfied) and replay(items, found.values, tolerance, SLACK)
        return found if sure else Undecided(items[0][0], "nonlinear")
    if uses_field(left):
        from scenicq.match.fields.field_solver import search_directions  # noqa: PLC0415 - takes long to load

        shared = _shared(left, used)
        parts, number = ([left], None) if shared is None else (shared[2], shared[0].identity)
        return (yield from search_directions(parts, number, tolerance, known))
    return decide(left, tolerance)


def chooses_apart(items: Sequence[Item]) -> bool:
    """Whether fields are asked at hidden places in parts that share one number alone, each with few choices if any.

    There are as many combinations of outcomes as their numbers multiplied, but what each part comes to for its own ones
    is looked at once.
    """
    left = [part for item in items for part in item_conjuncts(item) if not isinstance(part[1], Constant)]
    used = {id(item): {leaf.identity: leaf for leaf in leaves(item[1])} for item in left}
    counts = [len(leaf.weights) for each in used.values() for leaf in each.values() if isinstance(leaf, Index)]
    few = bool(counts) and max(counts) <= _FEW_OPTIONS
    return few and uses_far_field(left) > 0 and _shared(left, used) is not None


def _all(parts: Sequence[list[Item]], items: list[Item], tolerance: Tolerance, known: KnownCases | None) -> SearchSteps:
    """Parts that have no random variable in common."""
    values: dict[Identity, Value] = {}
    doubt: Undecided | None = None
    for outcome in (yield from finish_together([search_decomposed(part, tolerance, known) for part in parts])):
        if isinstance(outcome, Refuted):
            return outcome
        if isinstance(outcome, Undecided):
            doubt = doubt or outcome
        else:
            values.update(outcome.values)
    if doubt is not None:
        return doubt
    return Satisfied(values) if replay(items, values, tolerance, SLACK) else Undecided(items[0][0], "nonlinear")


def _components(
    items: Sequence[Item], used: Mapping[int, Mapping[Identity, Leaf]], without: Identity | None
) -> list[list[Item]]:
    """The items in parts that share no random variable but one."""
    parts = connected_components([used[id(item)].keys() - {without} for item in items])
    return [[items[number] for number in part] for part in parts]


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
