"""The label objects of one label as the elements that conditions on others go through, and who of them plays a role."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.among import LABEL_OBJECTS, LabelElements
from scenicq.forest.columns import Column, column_of
from scenicq.forest.nodes import IDENTITY, RANK, TRACK, Value
from scenicq.match.problem.candidates import LabelProblem
from scenicq.store.classes import class_truth

__all__ = ["who_plays"]

_WHO = (IDENTITY, TRACK)


def who_plays(problem: LabelProblem, assignment: Mapping[int, int]) -> dict[tuple[int, str], Value]:
    """All label objects of a label, and which of them play the scenario's objects, as what is observed of it.

    Args:
        problem: The label.
        assignment: The number of the label object of each object.
    """
    if problem.elements is None:
        problem.elements = _elements(problem)
    ranks = cast("NDArray[np.float64]", problem.elements.observed(RANK).data)
    found: dict[tuple[int, str], Value] = {LABEL_OBJECTS: cast(Value, problem.elements)}
    for index, number in assignment.items():
        found.update({(index, name): float(number) for name in _WHO})
        # a label without an ego has no row for it
        found[index, RANK] = float(ranks[number - (len(problem.seen) - len(ranks))])
    return found


def _elements(problem: LabelProblem) -> LabelElements:
    label = problem.label
    first = 0 if label.has_ego else 1
    numbers = range(first, len(problem.seen))
    objects = (label.ego, *label.objects)[first:]
    by_id = {number: rank for rank, number in enumerate(sorted(range(len(objects)), key=lambda n: objects[n].id))}
    ranks = np.array([by_id[number] for number in range(len(objects))], dtype=np.float64)

    @cache
    def belongs(category: str) -> NDArray[np.int8]:
        return np.array([class_truth(category, each.category, problem.classes) for each in objects], dtype=np.int8)

    @cache
    def observed(name: str) -> Column:
        if name in (RANK, *_WHO):
            return Column(ranks if name == RANK else np.array(numbers, np.float64), np.zeros(len(objects), np.int8))
        return column_of([problem.seen[number].get(name) for number in numbers])

    return LabelElements(
        np.zeros(len(objects), np.intp), np.ones(1, np.bool_), np.array(numbers, np.float64), belongs, observed
    )
