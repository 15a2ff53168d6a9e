"""Groups that closed forms decide: one comparison whose random variables are independent, or one known condition.

What most features look like once the label is known: a point of a region, an offset by ranges in a known frame, a
heading within ranges of a known one, a value that is known altogether. The formulas are worked out once per scenario; a
label costs a few operations of arithmetic. Only clear answers are given: whatever is close to a boundary is left to the
decision ladder.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import cast

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
from scenicq.geometry.membership import contains, contains_many
from scenicq.geometry.regions import Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.formulas import Exact, Form, Formulas, Get, UnclearError, spread, truth
from scenicq.match.ground import unlike
from scenicq.match.ladder import No, Outcome, Yes
from scenicq.match.options import Tolerance

__all__ = ["Disc", "Places", "Quick", "quick_of"]

_MARGIN = 1e-7
"""Metres or radians from a boundary within which nothing is decided here."""
_MOST_CHOICES = 8

Disc = tuple[tuple[float, float], float]
"""The area that is looked at: centre and radius."""
XY = tuple[float, float]


@dataclass(eq=False, slots=True)
class Places:
    """What the map says of places, looked up for many of them together.

    Attributes:
        directions: The headings that each field allows, by place.
        inside: Whether a place lies in each region.
    """

    directions: dict[RoadDirection, dict[XY, tuple[float, ...]]] = field(
        default_factory=dict["RoadDirection", "dict[XY, tuple[float, ...]]"]
    )
    inside: dict[int, tuple[Region, dict[XY, bool]]] = field(
        default_factory=dict["int", "tuple[Region, dict[XY, bool]]"]
    )

    def look_up(self, fields: Iterable[RoadDirection], regions: Iterable[Region], places: Iterable[XY]) -> None:
        """Look up places in fields and regions."""
        wanted = list(dict.fromkeys(places))
        if not wanted:
            return
        xy = np.array(wanted)
        for one in fields:
            self.directions.setdefault(one, {}).update(zip(wanted, one.values_many(xy), strict=True))
        for region in regions:
            found = contains_many(region, xy).tolist()
            self.inside.setdefault(id(region), (region, {}))[1].update(zip(wanted, found, strict=True))

    def allowed(self, one: RoadDirection, place: XY) -> tuple[float, ...]:
        """The headings that a field allows at a place."""
        known = self.directions.setdefault(one, {})
        if place not in known:
            known[place] = one.values(*place)
        return known[place]

    def within(self, region: Region, place: XY) -> bool:
        """Whether a place lies in a region."""
        known = self.inside.setdefault(id(region), (region, {}))[1]
        if place not in known:
            known[place] = contains(region, *place)
        return known[place]


@dataclass(frozen=True, slots=True, eq=False)
class Quick:
    """A group's closed form.

    Attributes:
        decide: From the observed values, the area looked at, the tolerance and what is known of places to the outcome;
            None where it is not clear.
        field: The field that it asks at the position of `index`.
        region: The region that it asks for the position of `index`.
        index: The object whose position matters to field or region.
        narrow: The answer where a position is missed by less than its tolerance would reach in another direction.
    """

    decide: Callable[[Get, Disc | None, Tolerance, Places], Outcome | None]
    field: RoadDirection | None = None
    region: Region | None = None
    index: int = -1
    narrow: No | None = None


def quick_of(group: Group) -> Quick | None:
    """The closed form of a group, None if it has none."""
    if len(group.constraints) != 1:
        return None
    item = group.constraints[0]
    node = item.expression
    found: Quick | None = None
    if isinstance(item, Condition):
        found = _condition(item)
    elif item.object != PARAMS and item.property == "position":
        found = _point(item, node) if isinstance(node, PointIn) else _place(item) or _offset(item)
    elif item.object != PARAMS and item.property == "heading":
        found = _heading(item)
    return found


def _decided(
    decide: Callable[[Get, Disc | None, Tolerance, Places], Outcome | None],
) -> Callable[[Get, Disc | None, Tolerance, Places], Outcome | None]:
    """A decision that says nothing where a formula has no value."""

    def guarded(get: Get, disc: Disc | None, tolerance: Tolerance, places: Places) -> Outcome | None:
        try:
            return decide(get, disc, tolerance, places)
        except (UnclearError, CannotEvaluate):
            return None

    return guarded


def _condition(item: Condition) -> Quick | None:
    holds = truth(item.expression)
    if holds is None:
        return None
    yes, no = Yes({}), No(item, "does not hold")

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: Places) -> Outcome | None:
        return yes if holds(get) else no

    return Quick(decide)


def _place(item: Comparison) -> Quick | None:
    """A position that is known."""
    exact = Formulas({}).exact(item.expression)
    if exact is None:
        return None
    index, yes = item.object, Yes({})

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: Places) -> Outcome | None:
        (x, y), (px, py) = cast(XY, exact(get)), cast(XY, get(index, "position"))
        off = math.hypot(x - px, y - py)
        if off > tolerance.reach + _MARGIN and math.isfinite(off):
            return No(item, unlike("position", (x, y), (px, py)))
        return yes if off <= _surely(tolerance) else None

    return Quick(decide)


def _surely(tolerance: Tolerance) -> float:
    """How far off a position is within tolerance whatever the direction."""
    sure = tolerance.position if tolerance.x is None or tolerance.y is None else min(tolerance.x, tolerance.y)
    return max(0.0, sure - _MARGIN)


def _point(item: Comparison, node: PointIn) -> Quick | None:
    if not isinstance(node.region, Constant):
        return None
    region, index = cast(Region, node.region.value), item.object

    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: Places) -> Outcome | None:
        place = cast(XY, get(index, "position"))
        if disc is not None and math.dist(place, disc[0]) > disc[1] - _MARGIN:
            return None
        return Yes({node.identity: place}) if places.within(region, place) else None

    return Quick(decide, region=region, index=index)


def _misses(tolerance: Tolerance, sides: tuple[float, float, float, float], turn: float) -> bool:
    """Whether a box along the map's axes around an observed position surely misses a rectangle.

    Args:
        tolerance: Its `x` and `y` are half the box; else nothing is said.
        sides: Of the rectangle, from the observed position, in a frame of its own: west, east, south, north.
        turn: The angle of that frame.
    """
    if tolerance.x is None or tolerance.y is None or not all(map(math.isfinite, sides)):
        return False
    c, s = math.cos(turn), math.sin(turn)
    west, east, south, north = sides
    corners = [(u * c - v * s, u * s + v * c) for u in (west, east) for v in (south, north)]
    across, along = abs(c) * tolerance.x + abs(s) * tolerance.y, abs(s) * tolerance.x + abs(c) * tolerance.y
    gaps = (
        max(west, -east) - across,
        max(south, -north) - along,
        max(min(p for p, _ in corners), -max(p for p, _ in corners)) - tolerance.x,
        max(min(q for _, q in corners), -max(q for _, q in corners)) - tolerance.y,
    )
    return max(gaps) > _MARGIN


def _offset(item: Comparison) -> Quick | None:
    formulas = Formulas({})
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
    no, narrow = No(item), No(item)

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: Places) -> Outcome | None:
        px, py = cast(XY, get(index, "position"))
        turn = 0.0
        for shift, exact in steps:
            if shift:
                qx, qy = cast(XY, exact(get))
                px, py = px - qx, py - qy
            else:
                angle = cast(float, exact(get))
                turn += angle
                c, s = math.cos(angle), math.sin(angle)
                px, py = px * c + py * s, py * c - px * s
        a, b = x.known(get), y.known(get)
        u, v = min(max(px, a + x.low), a + x.high), min(max(py, b + y.low), b + y.high)
        off = math.hypot(u - px, v - py)
        if off > tolerance.reach + _MARGIN and math.isfinite(off):
            return no
        if not off <= _surely(tolerance):
            sides = a + x.low - px, a + x.high - px, b + y.low - py, b + y.high - py
            return narrow if _misses(tolerance, sides, turn) else None
        return Yes({**spread(x, u - a), **spread(y, v - b)})

    return Quick(decide, narrow=narrow)


def _heading(item: Comparison) -> Quick | None:
    indices = [node for node in postorder((item.expression,)) if isinstance(node, Index)]
    if math.prod(len(node.weights) for node in indices) > _MOST_CHOICES:
        return None
    ways: list[tuple[dict[Identity, Value], Form]] = []
    for picked in itertools.product(*(range(len(node.weights)) for node in indices)):
        chosen = {node.identity: float(option) for node, option in zip(indices, picked, strict=True)}
        form = Formulas(chosen).form(item.expression)
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
    no = No(item)
    # what the ladder tries first is what it words
    known_first = not ways[0][1].terms
    flow = cast(RoadDirection, cast(Constant, along.field).value) if along is not None else None
    where = cast(Feature, along.point).object if along is not None else -1

    @_decided
    def decide(get: Get, disc: Disc | None, tolerance: Tolerance, places: Places) -> Outcome | None:
        seen = cast(float, get(index, "heading"))
        allowed: tuple[float, ...] = (0.0,)
        if flow is not None:
            allowed = places.allowed(flow, cast(XY, get(where, "position")))
            if not allowed:
                return None
        clear = True
        for chosen, form in ways:
            if form.unbounded:
                return Yes({**chosen, **spread(form, seen - form.known(get) - allowed[0])})
            middle, half = (form.low + form.high) / 2, (form.high - form.low) / 2
            rest = seen - form.known(get) - middle
            for direction in allowed:
                off = math.remainder(rest - direction, math.tau)
                beyond = abs(off) - half
                if beyond <= max(0.0, tolerance.heading - _MARGIN):
                    return Yes({**chosen, **spread(form, middle + min(max(off, -half), half))})
                clear = clear and beyond > tolerance.heading + _MARGIN
        if not clear:
            return None
        return No(item, unlike("heading", ways[0][1].known(get) + allowed[0], seen)) if known_first else no

    return Quick(decide, field=flow, index=where)


def _plain(node: DirectionAt) -> bool:
    """Whether a field is asked for the direction of roads at an observed position."""
    field_, point = node.field, node.point
    return (
        isinstance(field_, Constant)
        and isinstance(field_.value, RoadDirection)
        and isinstance(point, Feature)
        and point.property == "position"
    )
