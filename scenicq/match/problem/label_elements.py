"""The label objects that conditions on other label objects go through, and which of them play a role."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.among import LABEL_OBJECTS, LabelElements
from scenicq.forest.columns import DEFINED, UNKNOWN, Column, column_of
from scenicq.forest.nodes import COURSE, IDENTITY, OPEN, RANK, TRACK, Value
from scenicq.match.problem.candidates import LabelProblem
from scenicq.match.problem.observation import course_without_role
from scenicq.store.classes import Granularity, class_truth
from scenicq.store.labels import Label, LabelObject

__all__ = ["elements_of", "observe_roles"]

_WHO = (IDENTITY, TRACK)


def observe_roles(problem: LabelProblem, assignment: Mapping[int, int]) -> dict[tuple[int, str], Value]:
    """Observe all label objects of a label, and which of them play the scenario's objects.

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
    objects = (label.ego, *label.objects)

    def course(_: int, number: int) -> Value:
        known = problem.seen[number].get(COURSE)
        return known or course_without_role(label, objects[number], problem.courses)

    return elements_of([label], lambda _, number: problem.seen[number], course, problem.classes)


def elements_of(
    labels: Sequence[Label],
    seen: Callable[[int, int], Mapping[str, Value]],
    course: Callable[[int, int], Value],
    classes: Granularity,
) -> LabelElements:
    """The label objects of labels, a place each.

    Args:
        labels: The labels.
        seen: What is observed of a label object, by the place of its label and its number there.
        course: The course of one likewise, asked for only where a condition asks for it.
        classes: How classes are compared.
    """
    firsts = [0 if label.has_ego else 1 for label in labels]
    of_each = [(label.ego, *label.objects)[first:] for label, first in zip(labels, firsts, strict=True)]
    counts = [len(each) for each in of_each]
    objects = [each for mine in of_each for each in mine]
    numbers = [first + n for first, count in zip(firsts, counts, strict=True) for n in range(count)]
    place = np.repeat(np.arange(len(labels)), counts)

    @cache
    def belongs(category: str) -> NDArray[np.int8]:
        truths = {kind: class_truth(category, kind, classes) for kind in {each.category for each in objects}}
        return np.array([truths[each.category] for each in objects], dtype=np.int8)

    @cache
    def observed(name: str) -> Column:
        if name in _WHO:
            return Column(np.array(numbers, np.float64), np.full(len(objects), DEFINED))
        if name == RANK:
            return Column(np.concatenate([*map(_ranks, of_each), np.empty(0)]), np.full(len(objects), DEFINED))
        if name == "position":
            x, y = np.array([(each.x, each.y) for each in objects], dtype=np.float64).reshape(-1, 2).T
            return Column((x, y), np.full(len(objects), DEFINED))
        if name == OPEN:
            return Column(np.zeros(len(objects)), np.full(len(objects), UNKNOWN))
        if name == COURSE:
            return column_of([course(*each) for each in zip(place.tolist(), numbers, strict=True)])
        return column_of([seen(*each).get(name) for each in zip(place.tolist(), numbers, strict=True)])

    known = np.ones(len(labels), np.bool_)
    return LabelElements(place.astype(np.intp), known, np.array(numbers, np.float64), belongs, observed)


def _ranks(objects: Sequence[LabelObject]) -> NDArray[np.float64]:
    """The place of each label object of a label among the ids of all."""
    found = np.empty(len(objects))
    found[sorted(range(len(objects)), key=lambda n: objects[n].id)] = np.arange(len(objects))
    return found
