"""Groups that closed forms decide: one comparison whose random variables are independent, or one known condition.

What most features look like once the label is known: a point of a region, an offset by ranges in a known frame, a
heading within ranges of a known one, a value that is known altogether. The formulas are worked out once per scenario; a
label costs a few operations of arithmetic. Only clear answers are given: whatever is close to a boundary is left to the
decision ladder.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

import numpy as np

from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.groups import PARAMS, Comparison, Condition, Group
from scenicq.forest.nodes import (
    Constant,
    DirectionAt,
    Feature,
    Identity,
    Index,
    PointIn,
    Rotate,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import postorder
from scenicq.geometry.regions import Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.decide.compiled_expressions import (
    Column,
    Columns,
    CompiledExpressions,
    Exact,
    Form,
    Get,
    UnclearError,
    clipped,
    spread,
    truth,
    turned,
)
from scenicq.match.problem.evaluation import unlike
from scenicq.match.problem.map_lookups import XY, Disc, MapLookups
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied
from scenicq.match.tolerance import SLACK, Margin, Tolerance

__all__ = ["Certified", "ClosedForm", "closed_form_of"]

_MOST_CHOICES = 8

Certified: TypeAlias = "tuple[Sequence[bool], Mapping[Identity, Column | Sequence[Value]]]"
"""Which of many labels surely satisfy a group, and a witness for each of them; for the others it means nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """A group's closed form.

    Attributes:
        decide: From the observed values, the area looked at, the tolerance and what is known of places to the outcome;
            None where it is not clear.
        field: The field that it asks at the position of `index`.
        region: The region that it asks for the position of `index`.
        index: The object whose position matters to field or region.
        narrow: The answer where a position is missed by less than its tolerance would reach in another direction.
        satisfied: The same question about many labels at once, with the area of each; None if they are to be asked one
            by one. Where `decide` says yes it does too, with the same witness. It may raise `UnclearError`.
    """

    decide: Callable[[Get, Disc | None, Tolerance, MapLookups], Outcome | None]
    field: RoadDirection | None = None
    region: Region | None = None
    index: int = -1
    narrow: Refuted | None = None
    satisfied: Callable[[Columns, Sequence[Disc | None], Tolerance, MapLookups], Certified] | None = None


def closed_form_of(group: Group) -> ClosedForm | None:
    """The closed form of a group, None if it has none."""
    if len(group.constraints) != 1:
        return None
    item = group.constraints[0]
    node = item.expression
    found: ClosedForm | None = None
    if isinstance(item, Condition):
        found = _condition(item)
    elif item.object != PARAMS and item.property == "position":
        found = _point(item, node) if isinstance(node, PointIn) else _place(item) or _offset(item)
    elif item.object != PARAMS and item.property == "heading":
        found = _heading(item)
    return found


def _decided(
    decide: Callable[[Get, Disc | None, Tolerance, MapLookups], Outcome | None],
) -> Callable[[Get, Disc | None, Tolerance, MapLookups], Outcome | None]:
    """A decision that says nothing where a formula has no value."""

    def guarded(get: Get, disc: Disc | None, tolerance: Tolerance, places: MapLookups) -> Outcome | None:
        try:
            return decide(get, disc, tolerance, places)
        except (UnclearError, CannotEvaluate):
            return None

    return guarded


def _condition(item: Condition) -> ClosedForm | None:
    holds = truth(item.expression)
    if holds is None:
        return None
    yes, no = Satisfied({}), Refuted(item, "does not hold")

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: MapLookups) -> Outcome | None:
        return yes if holds(get) else no

    return ClosedForm(decide)


def _place(item: Comparison) -> ClosedForm | None:
    """A position that is known."""
    exact = CompiledExpressions({}).exact(item.expression)
    if exact is None:
        return None
    index, yes = item.object, Satisfied({})

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: MapLookups) -> Outcome | None:
        (x, y), (px, py) = cast(XY, exact(get)), cast(XY, get(index, "position"))
        off, margin = math.hypot(x - px, y - py), tolerance.of(index, "position")
        if off > margin.reach + SLACK and math.isfinite(off):
            return Refuted(item, unlike("position", (x, y), (px, py)))
        return yes if off <= _surely(margin) else None

    def satisfied(get: Columns, discs: Sequence[Disc | None], tolerance: Tolerance, places: MapLookups) -> Certified:
        (x, y), (px, py) = cast(XY, exact(get)), cast(XY, get(index, "position"))
        return _close(x - px, y - py, tolerance.of(index, "position")), {}

    return ClosedForm(decide, satisfied=satisfied)


def _surely(margin: Margin) -> float:
    """How far off a value is within tolerance whatever the direction."""
    return max(0.0, margin.sure - SLACK)


def _point(item: Comparison, node: PointIn) -> ClosedForm | None:
    if not isinstance(node.region, Constant):
        return None
    region, index = cast(Region, node.region.value), item.object

    def is_in(place: XY, disc: Disc | None, places: MapLookups) -> bool:
        if disc is not None and math.dist(place, disc[0]) > disc[1] - SLACK:
            return False
        return places.within(region, place)

    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: MapLookups) -> Outcome | None:
        place = cast(XY, get(index, "position"))
        return Satisfied({node.identity: place}) if is_in(place, disc, places) else None

    def satisfied(get: Columns, discs: Sequence[Disc | None], tolerance: Tolerance, places: MapLookups) -> Certified:
        where = _pairs(get, index)
        return [is_in(place, disc, places) for place, disc in zip(where, discs, strict=True)], {node.identity: where}

    return ClosedForm(decide, region=region, index=index, satisfied=satisfied)


def _pairs(get: Columns, index: int) -> list[XY]:
    """The positions of an object in many labels."""
    x, y = cast("tuple[Column, Column]", get(index, "position"))
    return list(zip(x.tolist(), y.tolist(), strict=True))


def _misses(margin: Margin, sides: tuple[float, float, float, float], turn: float) -> bool:
    """Whether a box along the map's axes around an observed position surely misses a rectangle.

    Args:
        margin: A box; else nothing is said.
        sides: Of the rectangle, from the observed position, in a frame of its own: west, east, south, north.
        turn: The angle of that frame.
    """
    if margin.kind != "box" or not all(map(math.isfinite, sides)):
        return False
    c, s = math.cos(turn), math.sin(turn)
    west, east, south, north = sides
    corners = [(u * c - v * s, u * s + v * c) for u in (west, east) for v in (south, north)]
    across, along = abs(c) * margin.size + abs(s) * margin.y, abs(s) * margin.size + abs(c) * margin.y
    gaps = (
        max(west, -east) - across,
        max(south, -north) - along,
        max(min(p for p, _ in corners), -max(p for p, _ in corners)) - margin.size,
        max(min(q for _, q in corners), -max(q for _, q in corners)) - margin.y,
    )
    return max(gaps) > SLACK


def _offset(item: Comparison) -> ClosedForm | None:
    formulas = CompiledExpressions({})
    steps: list[tuple[bool, Exact]] = []
    node = item.expression
    while not isinstance(node, VectorOf):
        match node:
            case VectorSum():
                sides = ((node.left, node.right), (node.right, node.left))
                known = next(((one, rest) for part, rest in sides if (one := formulas.exact(part))), None)
                if known is None:
                    return None
                steps.append((True, known[0]))
                node = known[1]
            case Rotate() if (angle := formulas.exact(node.angle)) is not None:
                steps.append((False, angle))
                node = node.vector
            case _:
                return None
    x, y = formulas.form(node.x), formulas.form(node.y)
    if x is None or y is None or x.fields or y.fields or not (x.terms or y.terms) or set(x.terms) & set(y.terms):
        return None
    index = item.object
    no, narrow = Refuted(item), Refuted(item)

    def seen(get: Get) -> tuple[XY, XY, XY, float]:
        """The position in the frame of the offset, the offset's known part and what comes nearest; the frame's turn."""
        px, py = cast(XY, get(index, "position"))
        turn = 0.0
        for shift, exact in steps:
            if shift:
                qx, qy = cast(XY, exact(get))
                px, py = px - qx, py - qy
            else:
                angle = cast(float, exact(get))
                turn = turn + angle
                c, s = turned(angle)
                px, py = px * c + py * s, py * c - px * s
        a, b = x.known(get), y.known(get)
        return (px, py), (a, b), (clipped(px, a + x.low, a + x.high), clipped(py, b + y.low, b + y.high)), turn

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: MapLookups) -> Outcome | None:
        (px, py), (a, b), (u, v), turn = seen(get)
        off, margin = math.hypot(u - px, v - py), tolerance.of(index, "position")
        if off > margin.reach + SLACK and math.isfinite(off):
            return no
        if not off <= _surely(margin):
            sides = a + x.low - px, a + x.high - px, b + y.low - py, b + y.high - py
            return narrow if _misses(margin, sides, turn) else None
        return Satisfied({**spread(x, u - a), **spread(y, v - b)})

    def satisfied(get: Columns, discs: Sequence[Disc | None], tolerance: Tolerance, places: MapLookups) -> Certified:
        (px, py), (a, b), (u, v), _ = seen(get)
        values = {**spread(x, u - a), **spread(y, v - b)}
        return _close(u - px, v - py, tolerance.of(index, "position")), cast("Mapping[Identity, Column]", values)

    return ClosedForm(decide, narrow=narrow, satisfied=satisfied)


def _close(x: float, y: float, margin: Margin) -> list[bool]:
    """Whether positions that are off by columns are surely within tolerance."""
    sure = _surely(margin)
    offs = zip(cast(Column, x).tolist(), cast(Column, y).tolist(), strict=True)
    return [math.hypot(*off) <= sure for off in offs]


def _heading(item: Comparison) -> ClosedForm | None:
    indices = [node for node in postorder((item.expression,)) if isinstance(node, Index)]
    if math.prod(len(node.weights) for node in indices) > _MOST_CHOICES:
        return None
    ways: list[tuple[dict[Identity, Value], Form]] = []
    for picked in itertools.product(*(range(len(node.weights)) for node in indices)):
        chosen = {node.identity: float(option) for node, option in zip(indices, picked, strict=True)}
        form = CompiledExpressions(chosen).form(item.expression)
        if form is None:
            return None
        ways.append((cast("dict[Identity, Value]", chosen), form))
    fields = {id(node): node for _, form in ways for node in form.fields}
    if len(fields) > 1 or any(len(form.fields) != len(fields) for _, form in ways):
        return None
    along = next(iter(fields.values()), None)
    if along is not None and not _plain(along):
        return None
    index = item.object
    no = Refuted(item)
    # what the ladder tries first is what it words
    known_first = not ways[0][1].terms
    flow = cast(RoadDirection, cast(Constant, along.field).value) if along is not None else None
    where = cast(Feature, along.point).object if along is not None else -1

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: MapLookups) -> Outcome | None:
        seen = cast(float, get(index, "heading"))
        allowed: tuple[float, ...] = (0.0,)
        if flow is not None:
            allowed = places.allowed(flow, cast(XY, get(where, "position")))
            if not allowed:
                return None
        clear, margin = True, tolerance.of(index, "heading")
        for chosen, form in ways:
            if form.unbounded:
                return Satisfied({**chosen, **spread(form, seen - form.known(get) - allowed[0])})
            middle, half = (form.low + form.high) / 2, (form.high - form.low) / 2
            rest = seen - form.known(get) - middle
            for direction in allowed:
                off = math.remainder(rest - direction, math.tau)
                beyond = abs(off) - half
                if beyond <= _surely(margin):
                    return Satisfied({**chosen, **spread(form, middle + min(max(off, -half), half))})
                clear = clear and beyond > margin.reach + SLACK
        if not clear:
            return None
        return Refuted(item, unlike("heading", ways[0][1].known(get) + allowed[0], seen)) if known_first else no

    if len(ways) > 1 or ways[0][1].unbounded:
        return ClosedForm(decide, field=flow, index=where)
    form = ways[0][1]
    middle, half = (form.low + form.high) / 2, (form.high - form.low) / 2

    def satisfied(get: Columns, discs: Sequence[Disc | None], tolerance: Tolerance, places: MapLookups) -> Certified:
        seen = cast(Column, get(index, "heading"))
        sure = _surely(tolerance.of(index, "heading"))
        plain = [(0.0,)] * get.size
        directions = plain if flow is None else [places.allowed(flow, place) for place in _pairs(get, where)]
        offs: list[float] = []
        for rest, allowed in zip((seen - form.known(get) - middle).tolist(), directions, strict=True):
            turns = (math.remainder(rest - direction, math.tau) for direction in allowed)
            offs.append(next((off for off in turns if abs(off) - half <= sure), math.nan))
        values = spread(form, middle + clipped(cast(float, np.array(offs)), -half, half))
        return [not math.isnan(off) for off in offs], cast("Mapping[Identity, Column]", values)

    return ClosedForm(decide, field=flow, index=where, satisfied=satisfied)


def _plain(node: DirectionAt) -> bool:
    """Whether a field is asked for the direction of roads at an observed position."""
    field_, point = node.field, node.point
    return (
        isinstance(field_, Constant)
        and isinstance(field_.value, RoadDirection)
        and isinstance(point, Feature)
        and point.property == "position"
    )
