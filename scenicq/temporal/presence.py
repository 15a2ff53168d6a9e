"""Group samples by which properties their labels observe.

Where a label lacks a property, the program's own value counts. So samples with the same observed properties share one
expression, and are evaluated together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.groups import PARAMS
from scenicq.forest.nodes import COURSE, GOING, LAST_LANE, Node
from scenicq.forest.walk import features
from scenicq.temporal.samples import BoundSamples, is_moving

__all__ = ["group_by_observed", "observed_properties"]

_Places = NDArray[np.int64]


def group_by_observed(
    places: BoundSamples, *conditions: Node, stretches: NDArray[np.int64] | None = None
) -> Iterator[_Places]:
    """Group samples by which features of some conditions are observed; yields the places of each group.

    Features that change from sample to sample do not count: where these are not observed, the condition is unknown.

    Args:
        places: The samples.
        conditions: The conditions.
        stretches: Places at which stretches begin. A feature that is observed somewhere in a stretch counts as observed
            in all of it. If None, each sample is a stretch of its own.
    """
    wanted = sorted({each for each in features(*conditions) if not is_moving(each[1]) and each[0] != PARAMS})
    seen = [_is_observed(places, index, name) for index, name in wanted]
    if stretches is not None and len(stretches):
        lengths = np.diff(np.append(stretches, len(places)))
        seen = [np.repeat(np.logical_or.reduceat(each, stretches), lengths) for each in seen]
    yield from (chosen for _, chosen in _group(seen, len(places)))


def observed_properties(
    places: BoundSamples, relevant: Sequence[frozenset[str]]
) -> Iterator[tuple[tuple[frozenset[str], ...], _Places]]:
    """Group samples by which relevant properties of each object are observed.

    Args:
        places: The samples.
        relevant: The properties that matter, for each object of the scenario.

    Yields:
        The observed properties of each object, and the places of the samples that observe just these.
    """
    wanted = [(index, name) for index, names in enumerate(relevant) for name in sorted(names)]
    seen = [_is_observed(places, index, name) for index, name in wanted]
    for there, chosen in _group(seen, len(places)):
        found = [each for each, one in zip(wanted, there, strict=True) if one]
        yield tuple(frozenset(name for mine, name in found if mine == index) for index in range(len(relevant))), chosen


def _is_observed(places: BoundSamples, index: int, name: str) -> NDArray[np.bool_]:
    if name in (COURSE, GOING, LAST_LANE):  # every observed object has these, even if only to say that it has none
        return places.members[index] >= 0
    found = places.observed(index, name)
    if found is None:
        return np.zeros(len(places), np.bool_)
    if isinstance(found, tuple):
        return ~np.isnan(found[0])
    return np.array([value is not None for value in found], dtype=np.bool_)


def _group(seen: Sequence[NDArray[np.bool_]], size: int) -> Iterator[tuple[tuple[bool, ...], _Places]]:
    """Group places by some truth values; yields the values and the places that have them."""
    mixed = [number for number, each in enumerate(seen) if size and not (each.all() or not each.any())]
    constant = tuple(bool(size and each[0]) for each in seen)
    if not mixed:
        yield constant, np.arange(size)
        return
    table = np.column_stack([seen[number] for number in mixed])
    rows, which = np.unique(table, axis=0, return_inverse=True)
    for number, row in enumerate(rows.tolist()):
        known = dict(zip(mixed, row, strict=True))
        yield (
            tuple(known.get(place, one) for place, one in enumerate(constant)),
            np.flatnonzero(which.ravel() == number),
        )
