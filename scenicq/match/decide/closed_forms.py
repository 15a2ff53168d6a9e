"""The closed form of a group, if it has one: of one comparison with independent random variables, or one condition."""

from __future__ import annotations

from scenicq.forest.groups import PARAMS, Condition, Group
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import PointIn
from scenicq.match.decide.closed_form import ClosedForm, Evaluated
from scenicq.match.decide.closed_numbers import heading, number, text
from scenicq.match.decide.closed_positions import known_vector, offset, point_in
from scenicq.match.decide.compiled_expressions import VECTORS, truth
from scenicq.match.decide.range_forms import Get
from scenicq.match.options import MatchOptions
from scenicq.match.problem.map_lookups import MapLookups

__all__ = ["closed_form_of"]


def closed_form_of(group: Group, ego: int) -> ClosedForm | None:
    """The closed form of a group, None if it has none.

    Args:
        group: The group.
        ego: Index of the object around which the radius is.
    """
    if len(group.constraints) != 1:
        return None
    item = group.constraints[0]
    if isinstance(item, Condition):
        return _condition(item)
    if item.object == PARAMS:
        return None
    node = item.expression
    if item.property == "heading":
        return heading(item)
    if item.property in VECTORS:
        if isinstance(node, PointIn) and item.property == "position":
            return point_in(item, node, ego)
        return known_vector(item) or offset(item)
    return number(item) if kind_of(node) == "scalar" else text(item)


def _condition(item: Condition) -> ClosedForm | None:
    holds = truth(item.expression)
    if holds is None:
        return None

    def evaluate(get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        found = holds(get)
        return Evaluated(found, not found, {})

    return ClosedForm(item, evaluate, detail=lambda get, lookups: "does not hold")
