"""The decision ladder: each group by the first step that decides it (conditioning done).

Ground facts are evaluated; discrete choices are tried one by one; a single affine feature is inverted in closed form;
affine systems go to a linear program, once per map cell; what is left goes to a solver. Every step is exact or says
that it does not know.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from scenicq.forest.bounds import Box, leaf_boxes, scalar_bounds, vector_bounds
from scenicq.forest.condition import condition
from scenicq.forest.evaluate import Observation
from scenicq.forest.groups import Comparison, Constraint, Group
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    DiscreteRange,
    Identity,
    Index,
    Leaf,
    Logic,
    LogicOp,
    Node,
    PointIn,
    Undefined,
    Value,
)
from scenicq.forest.walk import leaves, postorder
from scenicq.geometry.cells import convex_cells
from scenicq.geometry.fields import VectorField
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Disc, IntersectionOf, PolygonSet, Rectangle, Region, UnionOf
from scenicq.match.affine import Affine, affine_scalar, affine_vector
from scenicq.match.ground import holds, replay, show_value
from scenicq.match.interval import Reach, ends, reach_heading, reach_number, reach_position
from scenicq.match.options import Tolerance
from scenicq.match.program import LinearSystem, Row

__all__ = ["Item", "Maybe", "No", "Outcome", "Yes", "condition_group", "decide", "ground_cause"]

Item = tuple[Constraint, Node, Value]
"""A constraint, what conditioning left of its expression, and the label's value if it is a comparison."""


@dataclass(frozen=True, slots=True)
class Yes:
    """The group can be satisfied, by these values of its random variables."""

    values: Mapping[Identity, Value]


@dataclass(frozen=True, slots=True)
class No:
    """The group cannot be satisfied; `constraint` is the one to blame, or the first of several."""

    constraint: Constraint
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Maybe:
    """Not decided, and why."""

    constraint: Constraint
    reason: str


Outcome = Yes | No | Maybe

_MOST_BRANCHES = 4096
_SIDES = 32
"""Corners of the polygons around and inside a disc of tolerance."""


def condition_group(group: Group, observed: Observation, scope: Mapping[Identity, Value] | None = None) -> list[Item]:
    """A group's constraints given the label (algorithm 1, line 11); what they share stays shared."""
    items: list[Item] = []
    memo: dict[int, Node] = {}
    for constraint in group.constraints:
        node = condition(constraint.expression, observed, scope, memo)
        known: Value = None
        if isinstance(constraint, Comparison):
            known = observed[(constraint.object, constraint.property)]
        items.append((constraint, node, known))
    return items


def ground_cause(item: Item) -> str:
    """What a ground constraint that fails looks like, for a person."""
    constraint, node, observed = item
    value = cast(Constant, node).value
    if isinstance(constraint, Comparison):
        shown = show_value(constraint.property, value)
        return f"is {show_value(constraint.property, observed)}, not {shown}"
    return value.reason if isinstance(value, Undefined) else "does not hold"


def decide(items: list[Item], tolerance: Tolerance) -> Outcome:
    """Decide a group without a solver; `Maybe` with reason "nonlinear" where one is needed."""
    return _Ladder(tolerance).decide(items, {}, [], exact=True)


class _Ladder:
    """One decision: the tolerance, and how many branches it may take."""

    def __init__(self, tolerance: Tolerance) -> None:
        self.tolerance = tolerance
        self.branches = 0

    def decide(self, items: list[Item], given: dict[Identity, Value], rows: list[Row], *, exact: bool) -> Outcome:
        """Decide constraints, given values of discrete variables and linear facts about the rest.

        Args:
            items: The constraints.
            given: Values chosen so far.
            rows: Facts that came with cells chosen so far.
            exact: Whether those cells hold nothing but points where the field has their heading.
        """
        open_items: list[Item] = []
        for item in items:
            if not isinstance(item[1], Constant):
                open_items.append(item)
            elif not holds(item[0], item[1].value, item[2], self.tolerance):
                return No(item[0], ground_cause(item))
        if not open_items:
            return Yes(given)
        for leaf in leaves(*(node for _, node, _ in open_items)):
            options = _options(leaf)
            if options is not None:
                return self._try_each(items, leaf, options, given, rows, exact=exact)
        if len(open_items) == 1 and not rows and isinstance(open_items[0][0], Comparison):
            reached = self._invert(open_items[0])
            if reached.possible:
                return Yes(given | dict(reached.values))
            if reached.possible is False:
                return No(open_items[0][0])
        field = _free_direction(open_items)
        if field is not None:
            return self._try_cells(items, field, given, rows, exact=exact)
        return self._linear(open_items, given, rows, exact=exact)

    def _branch(self, constraint: Constraint, outcomes: Iterator[Outcome]) -> Outcome:
        blamed: Outcome = No(constraint)
        for number, outcome in enumerate(outcomes):
            self.branches += 1
            if isinstance(outcome, Yes):
                return outcome
            if isinstance(outcome, Maybe) or (number == 0 and isinstance(blamed, No)):
                blamed = outcome
            if self.branches > _MOST_BRANCHES:
                return Maybe(constraint, "nonlinear")
        return blamed

    def _try_each(
        self,
        items: list[Item],
        leaf: Leaf,
        options: range,
        given: dict[Identity, Value],
        rows: list[Row],
        *,
        exact: bool,
    ) -> Outcome:
        def outcomes() -> Iterator[Outcome]:
            for option in options:
                chosen = {leaf.identity: float(option)}
                memo: dict[int, Node] = {}
                fixed = [(c, condition(node, {}, chosen, memo), value) for c, node, value in items]
                yield self.decide(fixed, given | chosen, rows, exact=exact)

        return self._branch(items[0][0], outcomes())

    def _invert(self, item: Item) -> Reach:
        constraint, node, observed = item
        assert isinstance(constraint, Comparison)
        variables = {leaf.identity: leaf for leaf in leaves(node)}
        if isinstance(observed, tuple):
            form = affine_vector(node)
            if form is None or constraint.property != "position":
                return Reach(None, {})
            return reach_position(form, variables, observed, self.tolerance)
        scalar = affine_scalar(node)
        if scalar is None or not isinstance(observed, float):
            return Reach(None, {})
        if constraint.property == "heading":
            return reach_heading(scalar, variables, observed, self.tolerance.heading)
        return reach_number(scalar, variables, observed, self.tolerance.other)

    def _boxes(self, items: list[Item]) -> dict[Identity, Box]:
        reach = self.tolerance.reach
        targets: list[tuple[Node, Box]] = []
        for constraint, node, observed in items:
            if isinstance(constraint, Comparison) and constraint.property == "position":
                x, y = cast("tuple[float, float]", observed)
                targets.append((node, ((x - reach, x + reach), (y - reach, y + reach))))
        return leaf_boxes(targets)

    def _try_cells(
        self, items: list[Item], field: DirectionAt, given: dict[Identity, Value], rows: list[Row], *, exact: bool
    ) -> Outcome:
        """A field at a random point: one branch per cell near where the point can be."""
        constraint = items[0][0]
        place = affine_vector(field.point)
        if place is None or not isinstance(field.field, Constant):
            return Maybe(constraint, "nonlinear")
        (x0, x1), (y0, y1) = vector_bounds(field.point, self._boxes(items))
        if not all(map(math.isfinite, (x0, x1, y0, y1))):
            return Maybe(constraint, "nonlinear")
        vector_field = cast(VectorField, field.field.value)

        def outcomes() -> Iterator[Outcome]:
            for cell in vector_field.cells((x0, y0, x1, y1)):
                memo: dict[int, Node] = {id(field): Constant(cell.heading, span=field.span)}
                fixed = [(c, condition(node, {}, None, memo), value) for c, node, value in items]
                inside = _inside(place, cell.polygon)
                yield self.decide(fixed, given, [*rows, *inside], exact=exact and cell.exact)

        return self._branch(constraint, outcomes())

    def _linear(self, items: list[Item], given: dict[Identity, Value], rows: list[Row], *, exact: bool) -> Outcome:
        """Affine constraints: linear programs, one per combination of map cells and turns."""
        constraint = items[0][0]
        system = LinearSystem(list(rows))
        alternatives: list[list[list[Row]]] = []
        round_rows: list[tuple[Affine, Affine, float]] = []
        for item in items:
            if not self._add(item, system, alternatives, round_rows):
                return Maybe(constraint, "nonlinear")
        variables = {leaf.identity: leaf for leaf in leaves(*(node for _, node, _ in items))}
        boxes = self._boxes(items)
        for leaf in variables.values():
            if isinstance(leaf, PointIn):
                cells, discs = _cells(leaf, boxes.get(leaf.identity))
                if cells is None:
                    return Maybe(constraint, "nonlinear")
                x, y = (Affine(0.0, {(leaf.identity, axis): 1.0}) for axis in (0, 1))
                alternatives.append([_inside((x, y), cell) for cell in cells])
                for disc in discs:
                    cx, cy = disc.center
                    round_rows.append((x.plus(Affine(-cx, {})), y.plus(Affine(-cy, {})), disc.radius))
            else:
                limits = ends(leaf)
                if limits is None:
                    return Maybe(constraint, "nonlinear")
                system.rows.append(Row(Affine(0.0, {(leaf.identity, 0): 1.0}), *limits))
        outer = [*_discs(round_rows, outer=True)]
        found = _search(system, sorted(alternatives, key=len), outer)
        if found is None:
            return No(constraint)
        if round_rows:
            found = _search(system, sorted(alternatives, key=len), [*_discs(round_rows, outer=False)])
        if found is None:
            return Maybe(constraint, "nonlinear")
        values = given | _values(variables, found)
        if not replay(items, values, self.tolerance, 1e-6):
            return Maybe(constraint, "nonlinear")
        return Yes(values) if exact or replay(items, values, self.tolerance, 0.0) else Maybe(constraint, "nonlinear")

    def _add(
        self,
        item: Item,
        system: LinearSystem,
        alternatives: list[list[list[Row]]],
        round_rows: list[tuple[Affine, Affine, float]],
    ) -> bool:
        """Add a constraint's rows to a system; False if it is not linear."""
        constraint, node, observed = item
        if not isinstance(constraint, Comparison):
            return _add_condition(node, system)
        if isinstance(observed, tuple):
            form = affine_vector(node)
            if form is None:
                return False
            x, y = (part.plus(Affine(value, {}), -1.0) for part, value in zip(form, observed, strict=True))
            tolerance = self.tolerance
            if constraint.property == "position" and tolerance.x is not None and tolerance.y is not None:
                system.rows += [Row(x, -tolerance.x, tolerance.x), Row(y, -tolerance.y, tolerance.y)]
            else:
                radius = tolerance.position if constraint.property == "position" else tolerance.other
                round_rows.append((x, y, radius))
            return True
        scalar = affine_scalar(node)
        if scalar is None or not isinstance(observed, float):
            return False
        off = scalar.plus(Affine(observed, {}), -1.0)
        if constraint.property != "heading":
            system.rows.append(Row(off, -self.tolerance.other, self.tolerance.other))
            return True
        low, high = scalar_bounds(node)
        allowed = self.tolerance.heading
        if not (math.isfinite(low) and math.isfinite(high)):
            return False
        turns = range(
            math.ceil((low - observed - allowed) / math.tau), math.floor((high - observed + allowed) / math.tau) + 1
        )
        alternatives.append([[Row(off, math.tau * k - allowed, math.tau * k + allowed)] for k in turns])
        return True


def _add_condition(node: Node, system: LinearSystem) -> bool:
    if isinstance(node, Logic) and node.op is LogicOp.AND:
        return all(_add_condition(part, system) for part in node.args)
    if isinstance(node, Constant):
        return node.value is True
    if not isinstance(node, Compare) or node.op in (CompareOp.EQ, CompareOp.NE):
        return False
    left, right = affine_scalar(node.left), affine_scalar(node.right)
    if left is None or right is None:
        return False
    off = left.plus(right, -1.0)
    strict = node.op in (CompareOp.LT, CompareOp.GT)
    below = node.op in (CompareOp.LT, CompareOp.LE)
    system.rows.append(Row(off, -math.inf if below else 0.0, 0.0 if below else math.inf, strict))
    return True


def _options(leaf: Leaf) -> range | None:
    match leaf:
        case Index():
            return range(len(leaf.weights))
        case DiscreteRange() if isinstance(leaf.low, Constant) and isinstance(leaf.high, Constant):
            low, high = cast(float, leaf.low.value), cast(float, leaf.high.value)
            return range(math.ceil(low), math.floor(high) + 1)
        case _:
            return None


def _free_direction(items: list[Item]) -> DirectionAt | None:
    for node in postorder([node for _, node, _ in items]):
        if isinstance(node, DirectionAt) and not isinstance(node.point, Constant):
            return node
    return None


def _inside(place: tuple[Affine, Affine], polygon: np.ndarray) -> list[Row]:
    """Rows that keep a point in a convex polygon whose corners run counter-clockwise."""
    rows: list[Row] = []
    x, y = place
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        length = math.hypot(bx - ax, by - ay)
        if length > 0:
            nx, ny = (by - ay) / length, (ax - bx) / length
            side = x.times(nx).plus(y, ny).plus(Affine(float(nx * ax + ny * ay), {}), -1.0)
            rows.append(Row(side, -math.inf, 0.0))
    return rows


def _cells(leaf: PointIn, box: Box | None) -> tuple[list[np.ndarray] | None, list[Disc]]:
    """Convex cells of the region near where the point can be, and discs that hold it as well.

    None for the cells if the region is anything but polygons, possibly cut to discs.
    """
    if not isinstance(leaf.region, Constant):
        return None, []
    region = cast(Region, leaf.region.value)
    met = region.parts if isinstance(region, IntersectionOf) else (region,)
    discs = [part for part in met if isinstance(part, Disc)]
    others = [part for part in met if not isinstance(part, Disc)]
    if len(others) != 1:
        return None, []
    base = others[0]
    parts = base.parts if isinstance(base, UnionOf) else (base,)
    if not all(isinstance(part, PolygonSet | Rectangle) for part in parts):
        return None, []
    west, south, east, north = region_bounds(region)
    (x0, x1), (y0, y1) = box or ((west, east), (south, north))
    limits = (max(x0, west), max(y0, south), min(x1, east), min(y1, north))
    if limits[0] > limits[2] or limits[1] > limits[3]:
        return [], discs
    return convex_cells(base, limits), discs


def _discs(
    rounds: list[tuple[Affine, Affine, float]], *, outer: bool
) -> Iterator[Row]:
    """Rows that keep vectors in a regular polygon around (outer) or inside their disc."""
    for x, y, radius in rounds:
        reach = radius if outer else radius * math.cos(math.pi / _SIDES)
        for side in range(_SIDES):
            angle = math.tau * side / _SIDES
            yield Row(x.times(math.cos(angle)).plus(y, math.sin(angle)), -math.inf, reach)


def _search(
    system: LinearSystem, alternatives: list[list[list[Row]]], rows: list[Row]
) -> Mapping[tuple[Identity, int], float] | None:
    """A solution under one choice of each alternative, depth first with early failure."""
    if not alternatives:
        return system.solve(rows)
    if len(alternatives) > 1 and system.solve(rows) is None:
        return None
    for choice in alternatives[0]:
        found = _search(system, alternatives[1:], [*rows, *choice])
        if found is not None:
            return found
    return None


def _values(
    variables: Mapping[Identity, Leaf], found: Mapping[tuple[Identity, int], float]
) -> dict[Identity, Value]:
    values: dict[Identity, Value] = {}
    for identity, leaf in variables.items():
        if isinstance(leaf, PointIn):
            values[identity] = (found.get((identity, 0), 0.0), found.get((identity, 1), 0.0))
        else:
            values[identity] = found.get((identity, 0), 0.0)
    return values
