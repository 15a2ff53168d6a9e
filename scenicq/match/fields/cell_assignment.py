"""A group with the heading of each field chosen, which makes it linear: decided by linear programs.

For each hidden point there is one map cell to choose, out of the few that are left where the point can be.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import cast

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import FloatInterval
from scenicq.forest.condition import condition
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Index, Leaf, Node, PointIn, Value
from scenicq.geometry.cell_guards import half_planes
from scenicq.geometry.fields import FieldCell, VectorField
from scenicq.geometry.occupancy import ElementAtPoint
from scenicq.geometry.road_direction import RoadDirection
from scenicq.geometry.shapes import Bounds
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.linear.affine_forms import Affine, AffineVector, affine_scalar, affine_vector
from scenicq.match.linear.linear_program import Row
from scenicq.match.linear.linear_relaxation import extent_affine, solve_affine
from scenicq.match.linear.region_rows import Alternative, polygon_rows
from scenicq.match.problem.conditioned import Item, condition_items
from scenicq.match.problem.evaluation import holds, replay
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["MARGIN", "SAME", "HeadingAssignment", "assignment_of", "extent", "solve_cells"]

MARGIN = 2e-6
"""Metres by which boxes are grown, so that rounding loses nothing."""
SAME = 2e-9
"""Radians by which the heading of a cell may differ from one that was rounded."""


@dataclass(frozen=True, slots=True)
class HeadingAssignment:
    """A part with all its directions chosen.

    Attributes:
        case: The case that it was made of.
        items: Its constraints with these directions, affine.
        places: The points of its fields.
        cells: For each of them where a border may matter, the cells that it may lie in.
        given: The options that were picked.
        headings: The directions that were chosen, by the id of the use of the field.
        limits: Where the number can be that it shares with other parts.
        middles: A value for each random variable, should nothing be said of it.
        exact: Whether it has no solution where its linear program has none.
        vague: The points of fields, no heading pinned, of which cells cover places where the field points otherwise.
    """

    case: BoxSet
    items: list[Item]
    places: list[Node]
    cells: list[Alternative]
    given: Mapping[Identity, Value]
    headings: Mapping[int, float]
    limits: FloatInterval
    middles: Mapping[Identity, Value]
    exact: bool
    vague: list[Node]


def solve_cells(
    way: HeadingAssignment, tolerance: Tolerance, known: Mapping[Identity, float] = MappingProxyType({})
) -> Outcome:
    """Whether a part has a solution in which the fields point as chosen.

    Args:
        way: The part.
        tolerance: Per feature.
        known: Values that some of its random numbers are to have.
    """
    fixed = [Row(Affine(0.0, {(key, 0): 1.0}), value, value) for key, value in known.items()]
    items = list(way.case.network.items)
    open_ended = Undecided(items[0][0], "nonlinear")
    values: dict[Identity, Value] = {**way.middles, **way.given}
    # a solution on the border of two cells may count to the other one: the second time it keeps away from borders
    for strict in (False, True):
        try:
            found = solve_affine(
                way.items, [*fixed, *_rows(way, strict=strict)], tolerance, way.places, _options(way, strict=strict)
            )
        except CannotEvaluate:
            return open_ended
        if found is None:
            return Refuted(items[0][0]) if way.exact and not strict else open_ended
        values.update(found)
        values.update(known)
        if replay(items, values, tolerance, SLACK, way.headings):
            return Satisfied(values)
    return open_ended


def extent(
    way: HeadingAssignment, tolerance: Tolerance, number: Identity, limits: FloatInterval
) -> FloatInterval | None:
    """Between which values a random number lies in the solutions of a part, if it lies in an interval.

    A little too much, never too little, but for what `HeadingAssignment.exact` excepts; None if there are none.
    """
    rows = [Row(Affine(0.0, {(number, 0): 1.0}), *limits), *_rows(way, strict=False)]
    try:
        return extent_affine(way.items, rows, tolerance, way.places, _options(way, strict=False), number)
    except CannotEvaluate:
        return limits


def _rows(way: HeadingAssignment, *, strict: bool) -> list[Row]:
    """What holds of the cells that there is no choice of."""
    return [row for options in way.cells if len(options) == 1 for row in _kept(options[0], strict=strict)]


def _options(way: HeadingAssignment, *, strict: bool) -> list[Alternative]:
    """The choices between cells."""
    return [[_kept(rows, strict=strict) for rows in options] for options in way.cells if len(options) > 1]


def _kept(rows: list[Row], *, strict: bool) -> list[Row]:
    return [replace(row, strict=row.low < row.high) for row in rows] if strict else rows


def assignment_of(cases: BoxSet, number: int, shared: Identity | None) -> HeadingAssignment | None:
    """A case in which all choices are made, as constraints; None if a field does not point so where its point is.

    Args:
        cases: Narrowed cases.
        number: Which of them.
        shared: The random number that several parts share, if any.
    """
    network = cases.network
    given: dict[Identity, Value] = {}
    headings: dict[int, float] = {}
    memo: dict[int, Node] = {}
    for node in network.choices:
        chosen = float(cases.chosen[id(node)][..., number].mean())
        if isinstance(node, Index):
            given[node.identity] = chosen
        else:
            headings[id(node)] = chosen
            memo[id(node)] = Constant(chosen, span=node.span)
    # most cases fail here, where no expression is rewritten yet
    pointing: list[tuple[DirectionAt, Bounds, list[FieldCell]]] = []
    for node in network.choices:
        if isinstance(node, Index):
            continue
        box, near = _cells(cases, number, node)
        if not near:
            return None
        pointing.append((node, box, near))
    items = condition_items(network.items, given, memo=memo)
    if any(isinstance(node, Constant) and not holds(c, node.value, seen, network.tolerance) for c, node, seen in items):
        return None
    exact = all(_is_affine(node, seen) for c, node, seen in items if isinstance(c, Comparison))
    cells: list[Alternative] = []
    pinned = {} if exact else _pinned(cases, number, items, cells)
    straight: list[Item] = [
        (c, condition(node, {}, None, pinned) if isinstance(seen, tuple) else node, seen) for c, node, seen in items
    ]
    places: list[Node] = []
    vague: list[Node] = []
    for node, box, near in pointing:
        point = condition(node.point, {}, given, memo)
        place = condition(point, {}, None, pinned)
        form = affine_vector(place)
        places.append(place)
        cells.append([[]] if form is None else [_within(form, cell, box) for cell in near])
        if form is None or any(cell.guards for cell in near):
            vague.append(point)
    limits = (-math.inf, math.inf)
    if shared in network.leaves:
        low, high = cases.ranges[shared][:, number].tolist()
        limits = (low, high)
    case = cases.take(np.array([number]))
    middles = {identity: _middle(leaf, cases, number) for identity, leaf in network.leaves.items()}
    return HeadingAssignment(case, straight, places, cells, given, headings, limits, middles, exact, vague)


def _is_affine(node: Node, seen: Value) -> bool:
    return (affine_vector(node) if isinstance(seen, tuple) else affine_scalar(node)) is not None


def _pinned(cases: BoxSet, number: int, items: list[Item], cells: list[Alternative]) -> dict[int, Node]:
    """Headings that the label observes, taken to be as observed: what hangs on them is then affine, too."""
    pinned: dict[int, Node] = {}
    for (constraint, node, seen), (_, whole, _) in zip(items, cases.network.items, strict=True):
        if not (isinstance(constraint, Comparison) and constraint.property == "heading" and isinstance(seen, float)):
            continue
        form = affine_scalar(node)
        if form is not None and form.terms:
            low, high = cases.value(whole)[:, number].tolist()
            # a heading that nothing bounds needs no whole turns
            middle = (low + high) / 2 if math.isfinite(low + high) else seen
            turns = math.tau * round((middle - seen) / math.tau)
            value = min(max(seen + turns, low), high)
            pinned[id(node)] = Constant(value, span=node.span)
            cells.append([[Row(form, value, value)]])
    return pinned


def _cells(cases: BoxSet, number: int, node: DirectionAt) -> tuple[Bounds, list[FieldCell]]:
    """The box of a field's point and where in it the field points as chosen."""
    (x0, x1), (y0, y1) = cases.place(node)[:, :, number].tolist()
    box = (x0 - MARGIN, y0 - MARGIN, x1 + MARGIN, y1 + MARGIN)
    heading = float(cases.chosen[id(node)][:, number].mean())
    # cases that differ in other choices ask the same again
    key, known = (id(node), heading, box), cases.network.cells
    if key not in known:
        known[key] = _cells_in(cast(VectorField, cast(Constant, node.field).value), heading, box)
    return box, known[key]


def _cells_in(field: VectorField, heading: float, box: Bounds) -> list[FieldCell]:
    """Where in a box a field may have a heading."""
    found: list[FieldCell] = []
    for whole in (
        field.cells_of(heading, box) if isinstance(field, ElementAtPoint | RoadDirection) else field.cells(box)
    ):
        cell = whole.part(box) if abs(whole.heading - heading) <= SAME and _meets(whole, box) else None
        if cell is not None:
            found.append(cell)
    return found


def _within(place: AffineVector, cell: FieldCell, box: Bounds) -> list[Row]:
    """What holds of a place in a cell and a box."""
    x, y = place
    borders = [Row(x.times(a).plus(y, b), -math.inf, c) for a, b, c in half_planes(cell.guards, box)]
    return [*polygon_rows(place, cell.polygon), Row(x, box[0], box[2]), Row(y, box[1], box[3]), *borders]


def _middle(leaf: Leaf, cases: BoxSet, number: int) -> Value:
    limits = cases.ranges[leaf.identity][..., number]
    if isinstance(leaf, PointIn):
        return float(limits[0].mean()), float(limits[1].mean())
    low, high = limits.tolist()
    return (low + high) / 2 if np.isfinite(low + high) else 0.0


def _meets(cell: FieldCell, box: Bounds) -> bool:
    west, south, east, north = cell.bounds
    return west <= box[2] and east >= box[0] and south <= box[3] and north >= box[1]
