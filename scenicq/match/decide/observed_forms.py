"""Conditions on what is observed, also of label objects without a role: for which of many labels they surely hold.

Nothing is said of a label alone, and where they do not surely hold: a search of its own tells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.among import LABEL_OBJECTS, LabelElements, among_column
from scenicq.forest.clear_columns import ClearColumns
from scenicq.forest.column_domain import first_direction
from scenicq.forest.columns import DEFINED, Column, Data, constant_column, truth_of
from scenicq.forest.groups import Condition, Group
from scenicq.forest.interpret import interpret, steps_of
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
    """The form of a group that is one condition on what is observed; None for any other.

    What is known up to two ends, as along a course, holds if it does at both.
    """
    constraints = group.certain_group.constraints
    if len(constraints) != 1:
        return None
    (item,) = constraints
    if not isinstance(item, Condition):
        return None
    nodes = list(postorder((item.expression,)))
    # where several directions are allowed, any of them will do
    if any(is_leaf(node) or isinstance(node, DirectionAt) for node in nodes):
        return None
    # parameters are no column
    if any(isinstance(node, Feature) and node.object < 0 for node in nodes):
        return None
    known = {id(node): constant_column(node.value) for node in nodes if isinstance(node, Constant)}
    steps = steps_of(item.expression, known=known)

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

        domain = ClearColumns(observed, drawn, first_direction, others=among)
        data, status = interpret(steps, domain, known)[id(item.expression)]
        holds = np.broadcast_to(truth_of(data) & np.equal(status, DEFINED), get.size)
        return GroupEvaluation(holds.tolist(), [False] * get.size, {})

    return ClosedForm(item, evaluate)
