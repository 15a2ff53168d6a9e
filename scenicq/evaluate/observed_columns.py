"""What labels observe, as arrays over the labels."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.columns import Array, CodedValues, Data
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Value

__all__ = ["ANGLES", "ObservedColumns", "ObservedValues"]

ObservedValues = Mapping[tuple[int, str], Value]
"""What a label observes: values by object (`PARAMS` for parameters) and property."""

ANGLES = frozenset({"heading"})
"""Properties of which whole turns make no difference."""

_SLACK = 1e-3


class ObservedColumns:
    """What labels observe, as arrays of shape (labels, 1)."""

    def __init__(self, labels: Sequence[ObservedValues]) -> None:
        """Take labels that observe the same."""
        self._labels = labels
        self.values: dict[tuple[int, str], Data] = {}
        for key in labels[0] if labels else ():
            self.values[key] = _column([label[key] for label in labels])

    def first(self, count: int) -> ObservedColumns:
        """The first labels."""
        return ObservedColumns(self._labels[:count])

    def is_pair(self, each: Comparison) -> bool:
        """Whether a feature is a vector."""
        return isinstance(self.values[each.object, each.property], tuple)

    def targets(self, compared: Sequence[Comparison]) -> Iterator[tuple[Array, bool]]:
        """The coordinates of features, and whether each is an angle."""
        for each in compared:
            value = self.values[each.object, each.property]
            if isinstance(value, tuple):
                yield from ((axis, False) for axis in value)
            elif isinstance(value, np.ndarray):
                yield value, each.property in ANGLES
            else:
                raise CannotEvaluate(f"`{each.property}` is no number")

    def holds(self, each: Comparison, value: Data) -> Array:
        """Where a feature that depends on finite choices has the label's value."""
        own = self.values[each.object, each.property]
        if isinstance(own, tuple) and isinstance(value, tuple):
            return np.hypot(own[0] - value[0], own[1] - value[1]) <= _SLACK
        if isinstance(own, CodedValues) and isinstance(value, CodedValues):
            return np.array([[one == other for other in value.options] for one in own.options])[own.which, value.which]
        if isinstance(own, np.ndarray) and isinstance(value, np.ndarray):
            off = np.abs(own - value)
            if each.property in ANGLES:
                off = np.abs(np.mod(own - value + math.pi, math.tau) - math.pi)
            return off <= _SLACK
        raise CannotEvaluate(f"`{each.property}` is no number")


def _column(values: list[Value]) -> Data:
    if all(isinstance(value, tuple) for value in values):
        pairs = np.array(values, dtype=np.float64)
        return pairs[:, :1], pairs[:, 1:]
    if all(isinstance(value, bool | int | float) for value in values):
        return np.array(values, dtype=np.float64)[:, None]
    return CodedValues(np.arange(len(values))[:, None], tuple(values))
