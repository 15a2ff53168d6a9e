"""Groups with a closed form: one comparison whose random variables are independent, or one ground condition.

What most features look like once the label is known: a point of a region, or of what a known object sees of it, an
offset by ranges in a known frame, a heading within ranges of a known one, a number within ranges, a condition that is
known altogether. The formulas are worked out once per scenario, and hold for one assignment of label objects (floats)
and for many (columns) alike. Only clear answers are given: whatever is close to a boundary is left to the cascade.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias, cast

import numpy as np

from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.groups import PARAMS, Comparison, Condition, Group
from scenicq.forest.nodes import (
    Constant,
    DirectionAt,
    Feature,
    Identity,
    Index,
    Node,
    PointIn,
    RegionIntersection,
    Rotate,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import postorder
from scenicq.geometry.membership import contains
from scenicq.geometry.regions import Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.decide.compiled_expressions import (
    Columns,
    CompiledExpressions,
    CompiledVector,
    FloatColumn,
    Form,
    Get,
    Scalar,
    UnclearError,
    clipped,
    computed,
    spread,
    truth,
    turned,
)
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import unlike
from scenicq.match.problem.map_lookups import XY, MapLookups
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied
from scenicq.match.tolerance import SLACK, Margin

__all__ = ["ClosedForm", "Evaluated", "closed_form_of"]

_MOST_CHOICES = 8
_STRAIGHT = (0.0,)
"""The direction that is added where no field is asked."""


class Evaluated(NamedTuple):
    """A group under one assignment of label objects, or under many.

    Attributes:
        holds: Whether it is surely satisfied; of many assignments, one truth value each.
        fails: Whether it surely cannot be. Where neither is true nothing is said.
        values: A witness for where it holds; elsewhere it means nothing.
    """

    holds: bool | Sequence[bool]
    fails: bool | Sequence[bool]
    values: Mapping[Identity, Value | FloatColumn | list[Value]]


_UNCLEAR = Evaluated(False, False, {})
Evaluate: TypeAlias = Callable[[Get, MatchOptions, MapLookups], Evaluated]


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """A group's closed form.

    Attributes:
        constraint: Its one constraint.
        evaluate: From the observed values, tolerance and radius, and what is known of the map, to what is clear.
            It may raise `UnclearError` or `CannotEvaluate`, of columns where single values would do.
        field: The field that it asks at the position of `index`.
        region: The region that it asks for the position of `index`.
        index: The object whose position matters to field or region.
        detail: What a refutation says.
    """

    constraint: Comparison | Condition
    evaluate: Evaluate
    field: RoadDirection | None = None
    region: Region | None = None
    index: int = -1
    detail: Callable[[Get, MapLookups], str] | None = None

    def decide(self, get: Get, options: MatchOptions, lookups: MapLookups) -> Outcome | None:
        """Decide one assignment.

        Args:
            get: Its observed values.
            options: Tolerance and radius.
            lookups: What is known of the map.

        Returns:
            None where it is not clear.
        """
        found = self.evaluate_one(get, options, lookups)
        if found.holds:
            return Satisfied(cast("Mapping[Identity, Value]", found.values))
        if found.fails:
            try:
                return Refuted(self.constraint, "" if self.detail is None else self.detail(get, lookups))
            except (UnclearError, CannotEvaluate):
                pass
        return None

    def evaluate_one(self, get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        """The same without words; nothing is said where an expression has no value."""
        try:
            return self.evaluate(get, options, lookups)
        except (UnclearError, CannotEvaluate):
            return _UNCLEAR

    def evaluate_many(
        self, row: Callable[[int], Get], columns: Columns, options: MatchOptions, lookups: MapLookups
    ) -> Evaluated:
        """Evaluate many assignments, each as `evaluate_one` does.

        Args:
            row: The observed values of each, by its number.
            columns: The same, side by side.
            options: Tolerance and radius.
            lookups: What is known of the map.
        """
        try:
            with np.errstate(all="ignore"):
                return self.evaluate(columns, options, lookups)
        except (UnclearError, CannotEvaluate):
            return self._one_by_one([row(number) for number in range(columns.size)], options, lookups)

    def _one_by_one(self, rows: Sequence[Get], options: MatchOptions, lookups: MapLookups) -> Evaluated:
        """Where columns do not do; nothing is said of those whose witness has other variables than the first one's."""
        outcomes = [self.decide(get, options, lookups) for get in rows]
        witnesses = [outcome.values if isinstance(outcome, Satisfied) else None for outcome in outcomes]
        known = next((values.keys() for values in witnesses if values is not None), frozenset[Identity]())
        kept = [values if values is not None and values.keys() == known else None for values in witnesses]
        return Evaluated(
            [values is not None for values in kept],
            [isinstance(outcome, Refuted) for outcome in outcomes],
            {identity: [math.nan if values is None else values[identity] for values in kept] for identity in known},
        )


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
    if item.object != PARAMS and item.property == "position":
        node = item.expression
        return _point(item, node, ego) if isinstance(node, PointIn) else _known_position(item) or _offset(item)
    if item.object == PARAMS:
        return None
    return _heading(item) if item.property == "heading" else _number(item)


def _condition(item: Condition) -> ClosedForm | None:
    holds = truth(item.expression)
    if holds is None:
        return None

    def evaluate(get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        found = holds(get)
        return Evaluated(found, not found, {})

    return ClosedForm(item, evaluate, detail=lambda get, lookups: "does not hold")


def _known_position(item: Comparison) -> ClosedForm | None:
    exact = CompiledExpressions({}).exact(item.expression)
    if exact is None:
        return None
    index = item.object

    def evaluate(get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        (x, y), (px, py) = cast(XY, exact(get)), cast(XY, get(index, "position"))
        return Evaluated(*_close(x - px, y - py, options.tolerance.of(index, "position")), {})

    def detail(get: Get, lookups: MapLookups) -> str:
        return unlike("position", cast(XY, exact(get)), cast(XY, get(index, "position")))

    return ClosedForm(item, evaluate, detail=detail)


def _close(dx: float, dy: float, margin: Margin) -> tuple[bool, bool]:
    """Whether a position that is off by a vector is surely within tolerance, or surely not; of columns, each."""
    off = _length(dx, dy)
    return off <= margin.sure, (off > margin.reach + SLACK) & (off < math.inf)


def _apart(middle: XY, half: XY, turn: XY, margin: Margin) -> bool:
    """Whether a rectangle surely misses a box of tolerance: some side of either separates them; of columns, each.

    Args:
        middle: The rectangle's, from the box's, along the rectangle's sides.
        half: Half its sides; of unbounded ones nothing is said.
        turn: Cosine and sine of the angle from the box's sides to the rectangle's.
        margin: The box.
    """
    (u, v), (w, h), (c, s), across, along = middle, half, turn, margin.size + SLACK, margin.y + SLACK
    return (
        (abs(u) > w + abs(c) * across + abs(s) * along)
        | (abs(v) > h + abs(s) * across + abs(c) * along)
        | (abs(u * c - v * s) > abs(c) * w + abs(s) * h + across)
        | (abs(u * s + v * c) > abs(s) * w + abs(c) * h + along)
    )


def _length(x: float, y: float) -> float:
    """The length of a vector; of columns, a column of the same numbers to the last bit."""
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
        pairs = zip(cast(FloatColumn, x).tolist(), cast(FloatColumn, y).tolist(), strict=True)
        return cast(float, np.array([math.hypot(*pair) for pair in pairs]))
    return math.hypot(x, y)


def _point(item: Comparison, node: PointIn, ego: int) -> ClosedForm | None:
    known: list[Region] = []
    others: list[Callable[[Get], Value]] = []
    for part in _parts(node.region):
        if isinstance(part, Constant):
            known.append(cast(Region, part.value))
        elif (found := computed(part)) is not None:
            others.append(found)
        else:
            return None
    index = item.object

    def evaluate(get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        if others and isinstance(get, Columns):
            raise UnclearError
        places = _each(get(index, "position"))
        holds = [all(lookups.within(region, place) for region in known) for place in places]
        for region in others:
            holds = [
                held and contains(cast(Region, region(get)), *place) for held, place in zip(holds, places, strict=True)
            ]
        if options.radius is not None:
            near, centres = options.radius - SLACK, _each(get(ego, "position"))
            distances = itertools.starmap(math.dist, zip(places, centres, strict=True))
            holds = [held and distance <= near for held, distance in zip(holds, distances, strict=True)]
        if isinstance(get, Columns):
            return Evaluated(holds, [False] * get.size, {node.identity: cast("list[Value]", places)})
        return Evaluated(holds[0], False, {node.identity: places[0]})

    return ClosedForm(item, evaluate, region=known[0] if known else None, index=index)


def _parts(region: Node) -> list[Node]:
    """What a point of a region must lie in: the parts of intersections."""
    left, found = [region], list[Node]()
    while left:
        node = left.pop()
        if isinstance(node, RegionIntersection):
            left += reversed(node.parts)
        else:
            found.append(node)
    return found


def _each(position: Value) -> list[XY]:
    """The positions that a pair of columns has; of one position, it alone."""
    x, y = cast(XY, position)
    if isinstance(x, np.ndarray):
        return list(zip(cast(FloatColumn, x).tolist(), cast(FloatColumn, y).tolist(), strict=True))
    return [(x, y)]


def _offset(item: Comparison) -> ClosedForm | None:
    formulas = CompiledExpressions({})
    steps: list[tuple[CompiledVector | None, Scalar | None]] = []
    node = item.expression
    while not isinstance(node, VectorOf):
        match node:
            case VectorSum():
                sides = ((node.left, node.right), (node.right, node.left))
                known = next(((one, rest) for part, rest in sides if (one := formulas.exact(part))), None)
                if known is None:
                    return None
                steps.append((cast(CompiledVector, known[0]), None))
                node = known[1]
            case Rotate() if (angle := formulas.exact(node.angle)) is not None:
                steps.append((None, cast(Scalar, angle)))
                node = node.vector
            case _:
                return None
    x, y = formulas.form(node.x), formulas.form(node.y)
    if x is None or y is None or x.fields or y.fields or not (x.terms or y.terms) or set(x.terms) & set(y.terms):
        return None
    index = item.object

    def evaluate(get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        px, py = cast(XY, get(index, "position"))
        margin, turn = options.tolerance.of(index, "position"), (1.0, 0.0)
        # into the frame of the offset
        for shift, angle in steps:
            if shift is not None:
                qx, qy = shift(get)
                px, py = px - qx, py - qy
            elif angle is not None:
                c, s = turned(angle(get))
                px, py = px * c + py * s, py * c - px * s
                turn = turn[0] * c - turn[1] * s, turn[1] * c + turn[0] * s
        a, b = x.known(get), y.known(get)
        u, v = clipped(px, a + x.low, a + x.high), clipped(py, b + y.low, b + y.high)
        holds, fails = _close(u - px, v - py, margin)
        if margin.kind == "box" and holds is not True and fails is not True:
            middle = a + (x.low + x.high) / 2 - px, b + (y.low + y.high) / 2 - py
            fails |= _apart(middle, ((x.high - x.low) / 2, (y.high - y.low) / 2), turn, margin)
        if holds is False:
            return Evaluated(holds, fails, {})
        return Evaluated(holds, fails, spread(x, u - a) | spread(y, v - b))

    return ClosedForm(item, evaluate)


def _heading(item: Comparison) -> ClosedForm | None:
    indices = [node for node in postorder((item.expression,)) if isinstance(node, Index)]
    if math.prod(len(node.weights) for node in indices) > _MOST_CHOICES:
        return None
    choices: list[tuple[dict[Identity, Value], Form, float, float]] = []
    for picked in itertools.product(*(range(len(node.weights)) for node in indices)):
        chosen = {node.identity: float(option) for node, option in zip(indices, picked, strict=True)}
        form = CompiledExpressions(chosen).form(item.expression)
        if form is None:
            return None
        middle = 0.0 if form.unbounded else (form.low + form.high) / 2
        choices.append((cast("dict[Identity, Value]", chosen), form, middle, (form.high - form.low) / 2))
    fields = {id(node): node for _, form, *_ in choices for node in form.fields}
    if len(fields) > 1 or any(len(form.fields) != len(fields) for _, form, *_ in choices):
        return None
    along = next(iter(fields.values()), None)
    if along is not None and not _asks_for_roads(along):
        return None
    index, first = item.object, choices[0][1]
    flow = cast(RoadDirection, cast(Constant, along.field).value) if along is not None else None
    where = cast(Feature, along.point).object if along is not None else -1

    def directions(get: Get, lookups: MapLookups) -> list[tuple[float, ...]]:
        return [lookups.allowed(cast(RoadDirection, flow), place) for place in _each(get(where, "position"))]

    def evaluate(get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        margin, seen = options.tolerance.of(index, "heading"), cast(float, get(index, "heading"))
        many, fails = isinstance(get, Columns), True
        if many and len(choices) > 1:
            raise UnclearError
        allowed = None if flow is None else directions(get, lookups)
        for chosen, form, middle, half in choices:
            rest = seen - form.known(get) - middle
            if isinstance(rest, np.ndarray):
                rests: list[float] = cast(FloatColumn, rest).tolist()
                each = [_STRAIGHT] * len(rests) if allowed is None else allowed
                offs = [_turn(*pair, half, margin.sure) for pair in zip(rests, each, strict=True)]
                off = cast(float, np.array(offs))
            else:
                off = _turn(rest, _STRAIGHT if allowed is None else allowed[0], half, margin.sure)
            beyond = abs(off) - half
            holds, misses = beyond <= margin.sure, beyond > margin.reach + SLACK
            if many or holds:
                values = spread(form, middle + clipped(off, -half, half))
                return Evaluated(holds, misses, chosen | values if chosen else values)
            fails = fails and misses
        return Evaluated(False, fails, {})

    def detail(get: Get, lookups: MapLookups) -> str:
        # what the cascade tries first is what it words
        if first.terms:
            return ""
        direction = 0.0 if flow is None else directions(get, lookups)[0][0]
        seen = cast(float, get(index, "heading"))
        return unlike("heading", first.known(get) + direction, seen)

    return ClosedForm(item, evaluate, field=flow, index=where, detail=detail)


def _number(item: Comparison) -> ClosedForm | None:
    form, index, name = CompiledExpressions({}).form(item.expression), item.object, item.property
    if form is None or form.fields:
        return None

    def evaluate(get: Get, options: MatchOptions, lookups: MapLookups) -> Evaluated:
        seen, margin = get(index, name), options.tolerance.of(index, name)
        if margin.kind != "interval" or not isinstance(seen, float | np.ndarray):
            raise UnclearError
        rest = seen - form.known(get)
        value = clipped(rest, form.low, form.high)
        off = abs(rest - value)
        holds, fails = off <= margin.sure, off > margin.reach + SLACK
        return Evaluated(holds, fails, spread(form, value) if form.terms else {})

    def detail(get: Get, lookups: MapLookups) -> str:
        # what the cascade tries first is what it words
        return "" if form.terms else unlike(name, form.known(get), get(index, name))

    return ClosedForm(item, evaluate, detail=detail)


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


def _asks_for_roads(node: DirectionAt) -> bool:
    """Whether a field is asked for the direction of roads at an observed position."""
    return (
        isinstance(node.field, Constant)
        and isinstance(node.field.value, RoadDirection)
        and isinstance(node.point, Feature)
        and node.point.property == "position"
    )
