"""Places grouped by what is observed there: what is not has the program's own value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.groups import PARAMS
from scenicq.forest.nodes import COURSE, GOING, LAST_LANE, Node
from scenicq.forest.walk import features
from scenicq.temporal.samples import BoundSamples, is_moving

__all__ = ["by_presence", "observes"]

Chosen = NDArray[np.int64]


def by_presence(
    places: BoundSamples, *conditions: Node, stretches: NDArray[np.int64] | None = None
) -> Iterator[Chosen]:
    """Numbers of places, those together at which the same features of conditions are observed.

    Features that change from sample to sample do not count.

    Args:
        places: The places.
        conditions: The conditions.
        stretches: Numbers of places with which stretches begin: a feature that is observed somewhere in one counts as
            observed all over it. Without them each place is one of its own.
    """
    wanted = sorted({each for each in features(*conditions) if not is_moving(each[1]) and each[0] != PARAMS})
    seen = [_present(places, index, name) for index, name in wanted]
    if stretches is not None and len(stretches):
        lengths = np.diff(np.append(stretches, len(places)))
        seen = [np.repeat(np.logical_or.reduceat(each, stretches), lengths) for each in seen]
    yield from (chosen for _, chosen in _together(seen, len(places)))


def observes(
    places: BoundSamples, relevant: Sequence[frozenset[str]]
) -> Iterator[tuple[tuple[frozenset[str], ...], Chosen]]:
    """What is observed of each object of a scenario, with the places at which it is just that.

    Args:
        places: The places.
        relevant: The properties in question of each object.
    """
    wanted = [(index, name) for index, names in enumerate(relevant) for name in sorted(names)]
    seen = [_present(places, index, name) for index, name in wanted]
    for there, chosen in _together(seen, len(places)):
        found = [each for each, one in zip(wanted, there, strict=True) if one]
        yield tuple(frozenset(name for mine, name in found if mine == index) for index in range(len(relevant))), chosen


def _present(places: BoundSamples, index: int, name: str) -> NDArray[np.bool_]:
    if name in (COURSE, GOING, LAST_LANE):  # whoever is observed has one, if only that it has no heading
        return places.members[index] >= 0
    found = places.observed(index, name)
    if found is None:
        return np.zeros(len(places), np.bool_)
    if isinstance(found, tuple):
        return ~np.isnan(found[0])
    return np.array([value is not None for value in found], dtype=np.bool_)


def _together(seen: Sequence[NDArray[np.bool_]], size: int) -> Iterator[tuple[tuple[bool, ...], Chosen]]:
    """The places with equal truth values."""
    mixed = [number for number, each in enumerate(seen) if size and not (each.all() or not each.any())]
    sure = tuple(bool(size and each[0]) for each in seen)
    if not mixed:
        yield sure, np.arange(size)
        return
    table = np.column_stack([seen[number] for number in mixed])
    rows, which = np.unique(table, axis=0, return_inverse=True)
    for number, row in enumerate(rows.tolist()):
        known = dict(zip(mixed, row, strict=True))
        yield tuple(known.get(place, one) for place, one in enumerate(sure)), np.flatnonzero(which.ravel() == number)
