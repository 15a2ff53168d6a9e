"""Conditions on label objects without a role, of many labels side by side: for which labels they surely hold.

Nothing is said of a label alone, and where they do not surely hold: a search of its own tells.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.among import LABEL_OBJECTS, LabelElements, among_column, asks_others
from scenicq.forest.clear_columns import ClearColumns
from scenicq.forest.column_domain import first_direction
from scenicq.forest.columns import DEFINED, Column, Data, constant_column, truth_of
from scenicq.forest.groups import Condition, Group
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.nodes import COURSE, Constant, DirectionAt, Feature
from scenicq.forest.walk import is_leaf, postorder
from scenicq.match.decide.closed_form import ClosedForm, GroupEvaluation
from scenicq.match.decide.range_forms import Columns, Lookup
from scenicq.match.options import MatchOptions
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.store.classes import Granularity

__all__ = ["COURSES", "others_form_of"]

COURSES = "courses"
"""The column of the courses of label objects, which other forms than those here do not take: they are no numbers."""


def others_form_of(group: Group) -> ClosedForm | None:
    """The form of a group that is one condition on others of what is observed; None for any other."""
    if group.doubtful or len(group.constraints) != 1:
        return None
    (item,) = group.constraints
    if not isinstance(item, Condition) or not asks_others(item.expression):
        return None
    nodes = list(postorder((item.expression,)))
    # where several directions are allowed, any of them will do
    if any(is_leaf(node) or isinstance(node, DirectionAt) for node in nodes):
        return None
    known = {id(node): constant_column(node.value) for node in nodes if isinstance(node, Constant)}
    steps = steps_of(item.expression, known=known)

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        if not isinstance(get, Columns):
            raise CannotEvaluate("others of a label alone")
        of_classes = cast("Callable[[Granularity], LabelElements]", get(*LABEL_OBJECTS))
        elements = of_classes(options.classes)

        def observed(node: Feature) -> Column:
            name = COURSES if node.property == COURSE else node.property
            return Column(cast("Data", get(node.object, name)), np.full(1, DEFINED))

        def drawn(*_: object) -> Column:
            raise CannotEvaluate("a random variable")

        domain = ClearColumns(
            observed, drawn, first_direction, others=lambda node, args: among_column(node, args, elements)
        )
        data, status = interpret(steps, domain, known)[id(item.expression)]
        holds = np.broadcast_to(truth_of(data) & np.equal(status, DEFINED), get.size)
        return GroupEvaluation(holds.tolist(), [False] * get.size, {})

    return ClosedForm(item, evaluate)
