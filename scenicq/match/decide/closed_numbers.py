"""Closed forms of headings, other numbers and texts: sums of ranges around what is known, and a few choices."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Constant, DirectionAt, Feature, Identity, Index, Node, Select, Value
from scenicq.forest.walk import postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.road_direction import RoadDirection
from scenicq.limits import LIMITS
from scenicq.match.decide.closed_form import ClosedForm, GroupEvaluation, each_position
from scenicq.match.decide.compiled_expressions import CompiledExpressions
from scenicq.match.decide.range_forms import Columns, FloatColumn, Form, Lookup, Scalar, by_option, clip, spread
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import unlike
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.tolerance import SLACK

__all__ = ["heading", "number", "text"]

_STRAIGHT = (0.0,)
"""The direction that is added where no field is asked."""


class _Case(NamedTuple):
    """An expression under one way that its choices come out.

    Attributes:
        chosen: The options.
        form: The expression.
    """

    chosen: dict[Identity, Value]
    form: Form


def _cases(root: Node, known: Mapping[Identity, float]) -> list[_Case]:
    """The ways in which the choices of an expression come out; none where there are many, or one has no form.

    Args:
        root: The expression.
        known: The number of the option of choices that are no cases.
    """
    indices = [node for node in postorder((root,)) if isinstance(node, Index) and node.identity not in known]
    if math.prod(len(node.weights) for node in indices) > LIMITS.closed_form_choices:
        return []
    cases: list[_Case] = []
    for picked in itertools.product(*(range(len(node.weights)) for node in indices)):
        chosen = {node.identity: float(option) for node, option in zip(indices, picked, strict=True)}
        form = CompiledExpressions({**known, **chosen}).form(root)
        if form is None:
            return []
        cases.append(_Case(cast("dict[Identity, Value]", chosen), form))
    return cases


def number(item: Comparison, known: Mapping[Identity, float]) -> ClosedForm | None:
    """A number that is no heading, given the number of the option of some choices."""
    cases, index, name = _cases(item.expression, known), item.object, item.property
    if not cases or any(case.form.fields for case in cases):
        return None

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        margin, seen = options.tolerance.of(index, name), get(index, name)
        many, fails = isinstance(get, Columns), True
        if (many and len(cases) > 1) or not isinstance(seen, float | np.ndarray):
            raise CannotEvaluate("what a closed form does not say")
        for chosen, form in cases:
            known = form.known(get)
            value = clip(seen, known + form.low, known + form.high)
            off = abs(value - seen)
            holds, misses = off <= margin.sure, off > margin.reach + SLACK
            if many or holds:
                return GroupEvaluation(holds, misses, chosen | spread(form, value - known))
            fails = fails and misses
        return GroupEvaluation(False, fails, {})

    first = cases[0].form

    def detail(get: Lookup, lookups: MapLookups) -> str:
        # what the cascade tries first is what it words
        return "" if first.terms else unlike(name, first.known(get), get(index, name))

    return ClosedForm(item, evaluate, detail=detail)


def text(item: Comparison) -> ClosedForm | None:
    """A value that is no number, or one of some, each of which must be the label's own."""
    node = item.expression
    if isinstance(node, Constant):
        options: list[tuple[dict[Identity, Value], Value]] = [({}, node.value)]
    elif isinstance(node, Select) and isinstance(node.index, Index):
        options = [
            ({node.index.identity: float(place)}, option.value)
            for place, option in enumerate(node.options)
            if isinstance(option, Constant)
        ]
        if len(options) < len(node.options):
            return None
    else:
        return None
    if not all(isinstance(value, str | bool) for _, value in options):
        return None
    index, name = item.object, item.property

    def evaluate(get: Lookup, options_: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        if isinstance(get, Columns):
            raise CannotEvaluate("what a closed form does not say")
        seen = get(index, name)
        for chosen, value in options:
            if value == seen:
                return GroupEvaluation(True, False, chosen)
        return GroupEvaluation(False, True, {})

    return ClosedForm(item, evaluate, detail=lambda get, _: unlike(name, options[0][1], get(index, name)))


def heading(item: Comparison, known: Mapping[Identity, float]) -> ClosedForm | None:
    """A heading, possibly along the lanes or roads where something observed is.

    Args:
        item: The comparison.
        known: The number of the option of choices that are no choices here.
    """
    choices: list[tuple[dict[Identity, Value], Form, float, float]] = []
    for chosen, form in _cases(item.expression, known):
        middle = 0.0 if form.unbounded else (form.low + form.high) / 2
        choices.append((chosen, form, middle, (form.high - form.low) / 2))
    fields = {id(node): node for _, form, *_ in choices for node in form.fields}
    if not choices or len(fields) > 1 or any(len(form.fields) != len(fields) for _, form, *_ in choices):
        return None
    along = next(iter(fields.values()), None)
    directions = None if along is None else _directions(along, known)
    if along is not None and directions is None:
        return None
    index, first = item.object, choices[0][1]
    flow = along.field.value if along is not None and isinstance(along.field, Constant) else None
    where = cast(Feature, along.point).object if flow is not None and along is not None else -1

    def evaluate(get: Lookup, options: MatchOptions, lookups: MapLookups) -> GroupEvaluation:
        margin, seen = options.tolerance.of(index, "heading"), cast(float, get(index, "heading"))
        many, fails = isinstance(get, Columns), True
        if many and len(choices) > 1:
            raise CannotEvaluate("what a closed form does not say")
        allowed = None if directions is None else directions(get, lookups)
        for chosen, form, middle, half in choices:
            rest = seen - form.known(get) - middle
            if isinstance(rest, np.ndarray) and allowed is None:
                column = cast(FloatColumn, rest)
                whole = np.zeros(1) if math.isinf(half) else np.rint(column / math.tau)
                off = cast(float, column - math.tau * whole)
            elif isinstance(rest, np.ndarray):
                rests: list[float] = cast(FloatColumn, rest).tolist()
                each = cast("list[tuple[float, ...]]", allowed)
                offs = [_turn(*pair, half, margin.sure) for pair in zip(rests, each, strict=True)]
                off = cast(float, np.array(offs))
            else:
                off = _turn(rest, _STRAIGHT if allowed is None else allowed[0], half, margin.sure)
            beyond = abs(off) - half
            holds, misses = beyond <= margin.sure, beyond > margin.reach + SLACK
            if many or holds:
                values = spread(form, middle + clip(off, -half, half))
                return GroupEvaluation(holds, misses, chosen | values if chosen else values)
            fails = fails and misses
        return GroupEvaluation(False, fails, {})

    def detail(get: Lookup, lookups: MapLookups) -> str:
        # what the cascade tries first is what it words
        if first.terms:
            return ""
        direction = 0.0 if directions is None else directions(get, lookups)[0][0]
        seen = cast(float, get(index, "heading"))
        return unlike("heading", first.known(get) + direction, seen)

    return ClosedForm(item, evaluate, field=cast("RoadDirection | None", flow), index=where, detail=detail)


def _turn(angle: float, allowed: Sequence[float], half: float, sure: float) -> float:
    """How far an angle is turned from the first direction that it is within reach of, or else from the nearest one.

    Args:
        angle: In radians.
        allowed: The directions; without any the answer is NaN.
        half: Half the range that is allowed besides; unbounded, the first direction does.
        sure: How much further is within reach.
    """
    nearest = math.nan
    for direction in allowed:
        if math.isinf(half):
            return angle - direction
        off = math.remainder(angle - direction, math.tau)
        if abs(off) - half <= sure:
            return off
        if not abs(off) >= abs(nearest):
            nearest = off
    return nearest


def _directions(
    node: DirectionAt, known: Mapping[Identity, float]
) -> Callable[[Lookup, MapLookups], list[tuple[float, ...]]] | None:
    """The directions of roads, or of the lane that is meant, at an observed position; None for other fields."""
    if not isinstance(node.point, Feature) or node.point.property != "position":
        return None
    where = node.point.object
    if isinstance(node.field, Constant) and isinstance(node.field.value, RoadDirection):
        flow = node.field.value
        return lambda get, lookups: lookups.allowed(flow, each_position(get(where, "position")))
    number_ = CompiledExpressions(known).exact(node.field.index) if isinstance(node.field, Select) else None
    if not isinstance(node.field, Select) or number_ is None:
        return None
    picked = cast(Scalar, number_)
    fields = [each.value for each in node.field.options if isinstance(each, Constant)]
    if len(fields) < len(node.field.options):
        return None

    def directions(get: Lookup, lookups: MapLookups) -> list[tuple[float, ...]]:
        places = each_position(get(where, "position"))
        found: list[tuple[float, ...]] = [()] * len(places)
        for option, mine in by_option(picked, get, len(places)):
            field = fields[option]
            if isinstance(field, VectorField):
                values = field.values_many(np.array(places)[mine])
                for place, value in zip(mine.tolist(), values, strict=True):
                    found[place] = value
        return found

    return directions
