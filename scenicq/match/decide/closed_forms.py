"""Find the closed form of a group: of comparisons with independent random variables, and of conditions.

Where elements of the map overlap, a random *rank* says which of them is meant at a place (`geometry/occupancy`). It
joins all constraints that look something up there into one group. At a place with only one element the rank makes no
difference, so such a group has the closed forms of its constraints; at other places, the closed form says nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.clear_columns import ClearColumns
from scenicq.forest.column_domain import first_direction
from scenicq.forest.columns import DEFINED, Column, constant_column, truth_of
from scenicq.forest.groups import PARAMS, Condition, Constraint, Group
from scenicq.forest.interpret import Steps, interpret, steps_of
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Constant, Feature, Identity, Index, Node, PointIn, Select, Value
from scenicq.forest.walk import children, leaves, postorder
from scenicq.match.decide.closed_form import ClosedForm, GroupEvaluation
from scenicq.match.decide.closed_numbers import heading, number, text
from scenicq.match.decide.closed_positions import known_vector, offset, point_in
from scenicq.match.decide.compiled_expressions import VECTORS, CompiledExpressions, compile_condition, element_field
from scenicq.match.decide.range_forms import Columns, FloatColumn, Lookup, Scalar
from scenicq.match.options import MatchOptions
from scenicq.match.problem.map_lookups import MapLookups

__all__ = ["closed_form_of"]


def closed_form_of(group: Group, ego: int) -> ClosedForm | None:
    """Find the closed form of a group; None if it has none.

    Args:
        group: The group.
        ego: Index of the object around which the radius is.
    """
    ranks = _find_ranks(group)
    chosen = {index.identity: 0.0 for index, _ in ranks}
    forms: list[ClosedForm] = []
    used: set[Identity] = set()
    for item in group.constraints:
        form, own = _form_of(item, ego, chosen), {leaf.identity for leaf in leaves(item.expression)} - chosen.keys()
        if form is None or used & own:
            return None
        used |= own
        forms.append(form)
    if not forms:
        return None
    return _without_overlaps(forms, ranks) if ranks else forms[0] if len(forms) == 1 else None


def _form_of(item: Constraint, ego: int, chosen: Mapping[Identity, float]) -> ClosedForm | None:
    if isinstance(item, Condition):
        return _condition_form(item, chosen)
    if item.object == PARAMS:
        return None
    node = item.expression
    if item.property == "heading":
        return heading(item, chosen)
    if item.property in VECTORS:
        if isinstance(node, PointIn) and item.property == "position":
            return point_in(item, node, ego, chosen)
        return known_vector(item) or offset(item)
    return number(item, chosen) if kind_of(node) == "scalar" else text(item)


def _condition_form(item: Condition, chosen: Mapping[Identity, float]) -> ClosedForm | None:
    holds = compile_condition(item.expression, chosen)
    if holds is None:
        return None
    known = {
        id(node): constant_column(node.value) for node in postorder([item.expression]) if isinstance(node, Constant)
    }
    steps = steps_of(item.expression, known=known)

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        if isinstance(get, Columns):
            return _evaluate_columns(item.expression, steps, known, get, chosen)
        found = holds(get)
        return GroupEvaluation(found, not found, {})

    return ClosedForm(item, evaluate, detail=lambda get, lookups: "does not hold")


def _evaluate_columns(
    root: Node, steps: Steps, known: Mapping[int, Column], get: Columns, chosen: Mapping[Identity, float]
) -> GroupEvaluation:  # fmt: skip
    """Evaluate a condition for many labels; it neither holds nor fails where it is undefined or rounding may decide."""

    def observed(node: Feature) -> Column:
        return Column(cast("NDArray[np.float64]", get(node.object, node.property)), np.full(1, DEFINED))

    domain = ClearColumns(observed, lambda leaf, _: constant_column(chosen[leaf.identity]), first_direction)
    data, status = interpret(steps, domain, known)[id(root)]
    held, told = (np.broadcast_to(each, get.size) for each in (truth_of(data), np.equal(status, DEFINED)))
    return GroupEvaluation((held & told).tolist(), (~held & told).tolist(), {})


def _find_ranks(group: Group) -> list[tuple[Index, Select]]:
    """The ranks of a group, with the look-ups that they are in; choices that decide anything else are none."""
    looked_up: list[tuple[Index, Select]] = []
    others: set[Identity] = set()
    for node in postorder([item.expression for item in group.constraints]):
        if isinstance(node, Select) and isinstance(node.index, Index) and all(map(_is_element, node.options)):
            looked_up.append((node.index, node))
        else:
            others |= {each.identity for each in children(node) if isinstance(each, Index)}
    return [(index, node) for index, node in looked_up if index.identity not in others]


def _is_element(node: Node) -> bool:
    """Whether a number says which element lies at a place."""
    return any(element_field(each) is not None for each in children(node))


def _without_overlaps(forms: Sequence[ClosedForm], ranks: Sequence[tuple[Index, Select]]) -> ClosedForm | None:
    """The conjunction of closed forms, which says nothing unless a single element lies at each place looked up."""
    numbers: list[list[Scalar]] = []
    for index, node in ranks:
        made = [CompiledExpressions({index.identity: float(rank)}).exact(node) for rank in range(len(index.weights))]
        known = [cast(Scalar, each) for each in made if each is not None]
        if len(known) < len(made):
            return None
        numbers.append(known)

    def alone(get: Lookup) -> NDArray[np.bool_]:
        found = np.ones(1, np.bool_)
        for options in numbers:
            first, *others = [np.asarray(each(get)) for each in options]
            for other in others:
                found = found & (first == other)
        return found

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        known = alone(get)
        values: dict[Identity, Value | FloatColumn | list[Value]] = {}
        holds, fails = known, np.zeros(1, np.bool_)
        for form in forms:
            found = form.evaluate(get, options, lookups)
            holds, fails = holds & np.asarray(found.holds), fails | (known & np.asarray(found.fails))
            values |= found.values
        values |= {index.identity: 0.0 for index, _ in ranks}
        if isinstance(get, Columns):
            truths = [np.broadcast_to(each, get.size).tolist() for each in (holds, fails)]
            return GroupEvaluation(truths[0], truths[1], values)
        return GroupEvaluation(bool(holds[0]), bool(fails[0]), values)

    asking = next((form for form in forms if form.index >= 0), forms[0])
    return ClosedForm(forms[0].constraint, evaluate, asking.field, asking.regions, asking.index, parts=tuple(forms))
