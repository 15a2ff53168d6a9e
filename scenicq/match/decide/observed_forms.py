"""Conditions on what is observed, also of label objects without a role: for which of many labels they hold.

What is known up to two ends, as along a course, and what is asked of label objects of which not all is observed, may
hold without surely doing so: it is open. Where rounding may decide nothing is said: a search of its own tells.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import CannotEvaluate
from scenicq.forest.among import LABEL_OBJECTS, LabelElements, among_column, asks_each_once
from scenicq.forest.clear_columns import ClearColumns
from scenicq.forest.column_domain import first_direction
from scenicq.forest.columns import DEFINED, UNKNOWN, Column, Data, constant_column, truth_of
from scenicq.forest.groups import Condition, Group
from scenicq.forest.interpret import Steps, interpret, steps_of
from scenicq.forest.nodes import COURSE, Among, Constant, DirectionAt, Feature
from scenicq.forest.walk import is_leaf, postorder
from scenicq.match.decide.closed_form import ClosedForm, GroupEvaluation
from scenicq.match.decide.range_forms import Columns, Lookup
from scenicq.match.options import MatchOptions
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.store.classes import Granularity

__all__ = ["COURSES", "observed_form_of"]

COURSES = "courses"
"""The column of the courses of label objects, which other forms than those here do not take: they are no numbers."""


def observed_form_of(group: Group) -> ClosedForm | None:
    """The form of a group that is one condition on what is observed; None for any other."""
    if len(group.constraints) != 1:
        return None
    (possible,), (certain,) = group.constraints, group.certain_group.constraints
    if not isinstance(possible, Condition) or not isinstance(certain, Condition):
        return None
    roots = possible.expression, certain.expression
    nodes = list(postorder(roots))
    # where several directions are allowed, any of them will do
    if any(is_leaf(node) or isinstance(node, DirectionAt) for node in nodes):
        return None
    # parameters are no column
    if any(isinstance(node, Feature) and node.object < 0 for node in nodes):
        return None
    known = {id(node): constant_column(node.value) for node in nodes if isinstance(node, Constant)}
    steps = steps_of(*roots, known=known)
    # what two conditions on others have in common takes a search
    tells_open = all(map(asks_each_once, roots))

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        if not isinstance(get, Columns):
            raise CannotEvaluate("a label alone")

        def among(node: Among, args: Sequence[Column]) -> Column:
            of_classes = cast("Callable[[Granularity], LabelElements]", get(*LABEL_OBJECTS))
            return among_column(node, args, of_classes(options.classes))

        def observed(node: Feature) -> Column:
            name = COURSES if node.property == COURSE else node.property
            return Column(cast("Data", get(node.object, name)), np.full(1, DEFINED))

        def drawn(*_: object) -> Column:
            raise CannotEvaluate("a random variable")

        found = interpret(steps, ClearColumns(observed, drawn, first_direction, others=among), known)
        (may, told), (sure, decided) = (found[id(root)] for root in roots)
        holds = truth_of(sure) & np.equal(decided, DEFINED)
        fails = ~truth_of(may) & np.equal(told, DEFINED)
        left = (truth_of(may) | np.equal(told, UNKNOWN)) & (~truth_of(sure) | np.equal(decided, UNKNOWN))
        clear = np.equal(_unsure(steps, found), 0) & np.isin(told, _TOLD) & np.isin(decided, _TOLD)
        truths = holds, fails & ~holds, left & clear & ~holds & ~fails & tells_open
        lists = [np.broadcast_to(each, get.size).tolist() for each in truths]
        return GroupEvaluation(lists[0], lists[1], {}, lists[2])

    return ClosedForm(possible, evaluate, takes_columns=True)


_TOLD = (DEFINED, UNKNOWN)


def _unsure(steps: Steps, found: Mapping[int, Column]) -> NDArray[np.intp]:
    """How many values are not known at each place for another reason than that label objects are not observed."""
    count = np.zeros(1, np.intp)
    for node, below in steps:
        if not isinstance(node, Among):
            unknown = np.equal(found[id(node)].status, UNKNOWN)
            for each in below:
                unknown = unknown & np.not_equal(found[id(each)].status, UNKNOWN)
            count = count + unknown
    return count
