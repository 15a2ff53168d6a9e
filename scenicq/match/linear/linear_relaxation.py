"""Groups that are affine: linear programs, one per combination of map cells and whole turns.

A random point in a region becomes one alternative per convex cell near where the point can be; on a curb one per
segment, in a list of points one per point. Discs, also those that sectors are cut from, are taken between two polygons:
what the outer one excludes is out, what the inner one allows is in, and the rest is left to a solver.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

from scenicq.forest.bounds import Box, leaf_boxes, scalar_bounds
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Constant,
    Contains,
    Identity,
    Leaf,
    Node,
    Norm,
    PointIn,
    Value,
)
from scenicq.forest.proximity_pruning import close_boxes
from scenicq.forest.walk import conjuncts, leaves
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import (
    Disc,
    IntersectionOf,
    Region,
    Sector,
)
from scenicq.limits import LIMITS
from scenicq.match.linear.affine_forms import Affine, AffineVector, VariableAxis, affine_scalar, affine_vector
from scenicq.match.linear.affine_reach import ends
from scenicq.match.linear.linear_program import LinearSystem, Row, not_linear
from scenicq.match.linear.region_rows import Alternative, disc_rows, region_rows, sector_rows
from scenicq.match.problem.conditioned import Item
from scenicq.match.tolerance import ROUNDING, SLACK, Tolerance

__all__ = ["extent_affine", "position_boxes", "solve_affine"]


def position_boxes(items: Sequence[Item], tolerance: Tolerance, rows: Sequence[Row] = ()) -> dict[Identity, Box]:
    """Where each random point can lie, from the positions that it leads to and what it must be close to.

    A little too much, never too little.

    Args:
        items: The constraints after conditioning.
        tolerance: Per feature.
        rows: Linear facts that hold besides: those about one coordinate alone count.
    """
    targets: list[tuple[Node, Box]] = []
    for constraint, node, observed in items:
        if isinstance(constraint, Comparison) and constraint.property == "position":
            x, y = cast("tuple[float, float]", observed)
            reach = tolerance.of(constraint.object, "position").reach + SLACK
            targets.append((node, ((x - reach, x + reach), (y - reach, y + reach))))
        elif not isinstance(constraint, Comparison):
            targets += close_boxes(node)
    boxes = leaf_boxes(targets)
    for row in rows:
        if len(row.form.terms) == 1:
            _narrow(boxes, row)
    return boxes


def _narrow(boxes: dict[Identity, Box], row: Row) -> None:
    """Keep a point within what a row says of one of its coordinates."""
    (((identity, axis), factor),) = row.form.terms.items()
    if factor == 0:
        return
    ends = sorted(((limit - row.form.constant) / factor) for limit in (row.low, row.high))
    limits = list(boxes.get(identity, ((-math.inf, math.inf), (-math.inf, math.inf))))
    low, high = limits[axis]
    limits[axis] = (max(low, ends[0] - SLACK), min(high, ends[1] + SLACK))
    boxes[identity] = (limits[0], limits[1])


def solve_affine(
    items: Sequence[Item],
    rows: Sequence[Row],
    tolerance: Tolerance,
    places: Sequence[Node] = (),
    alternatives: Sequence[Alternative] = (),
) -> dict[Identity, Value] | None:
    """Values of the random variables that satisfy affine constraints, or None if there are none.

    Args:
        items: The constraints after conditioning.
        rows: Linear facts that hold besides.
        tolerance: Per feature.
        places: Points that need values, too.
        alternatives: Sets of facts, one of which holds, for each alternative.

    Raises:
        CannotEvaluate: Something is not affine, or lies between the inner and the outer polygons.
    """
    problem, variables = _problem(items, rows, tolerance, places, alternatives)
    found = problem.solve()
    if found is None:
        return None
    return {
        identity: (found.get((identity, 0), 0.0), found.get((identity, 1), 0.0))
        if isinstance(leaf, PointIn)
        else found.get((identity, 0), 0.0)
        for identity, leaf in variables.items()
    }


def extent_affine(
    items: Sequence[Item],
    rows: Sequence[Row],
    tolerance: Tolerance,
    places: Sequence[Node],
    alternatives: Sequence[Alternative],
    number: Identity,
) -> tuple[float, float] | None:
    """Between which values a random number lies where affine constraints are satisfied; None if they never are.

    A little too much, never too little. Arguments and errors as of `solve_affine`.
    """
    problem, _ = _problem(items, rows, tolerance, places, alternatives)
    return problem.extent((number, 0))


def _problem(
    items: Sequence[Item],
    rows: Sequence[Row],
    tolerance: Tolerance,
    places: Sequence[Node],
    alternatives: Sequence[Alternative],
) -> tuple[_Problem, dict[Identity, Leaf]]:
    problem = _Problem(tolerance, position_boxes(items, tolerance, rows), LinearSystem(list(rows)), list(alternatives))
    for item in items:
        problem.add(item)
    variables = {leaf.identity: leaf for leaf in leaves(*(node for _, node, _ in items), *places)}
    for leaf in variables.values():
        problem.add_leaf(leaf)
    return problem, variables


@dataclass(slots=True)
class _Problem:
    """Rows that all hold, alternatives of which one row set each holds, and vectors that stay in discs."""

    tolerance: Tolerance
    boxes: Mapping[Identity, Box]
    system: LinearSystem
    alternatives: list[Alternative] = field(default_factory=list["Alternative"])
    discs: list[tuple[Affine, Affine, float]] = field(default_factory=list[tuple[Affine, Affine, float]])

    def add(self, item: Item) -> None:
        """Add a constraint."""
        constraint, node, observed = item
        if not isinstance(constraint, Comparison):
            for part in conjuncts(node):
                self._add_condition(part)
        elif isinstance(observed, tuple):
            self._add_vector(constraint, node, observed)
        else:
            self._add_number(constraint, node, observed)

    def _add_vector(self, constraint: Comparison, node: Node, observed: tuple[float, float]) -> None:
        form = affine_vector(node)
        if form is None:
            raise not_linear()
        x, y = (part.plus(Affine(value, {}), -1.0) for part, value in zip(form, observed, strict=True))
        margin = self.tolerance.of(constraint.object, constraint.property)
        if margin.kind == "box":
            self.system.rows += [Row(x, -margin.size, margin.size), Row(y, -margin.y, margin.y)]
        else:
            self.discs.append((x, y, margin.size))

    def _add_number(self, constraint: Comparison, node: Node, observed: Value) -> None:
        form = affine_scalar(node)
        if form is None or not isinstance(observed, float):
            raise not_linear()
        off = form.plus(Affine(observed, {}), -1.0)
        margin = self.tolerance.of(constraint.object, constraint.property)
        allowed = margin.size
        if margin.kind != "arc":
            self.system.rows.append(Row(off, -allowed, allowed))
            return
        low, high = scalar_bounds(node)
        if not (math.isfinite(low) and math.isfinite(high)):
            raise not_linear()
        first = math.ceil((low - observed - allowed) / math.tau - ROUNDING)
        last = math.floor((high - observed + allowed) / math.tau + ROUNDING)
        turns = range(first, last + 1)
        self.alternatives.append([[Row(off, math.tau * k - allowed, math.tau * k + allowed)] for k in turns])

    def _add_condition(self, node: Node) -> None:
        match node:
            case Contains() if isinstance(node.region, Constant):
                place = affine_vector(node.point)
                if place is None:
                    raise not_linear()
                self._add_place(cast(Region, node.region.value), place, None)
            case Compare(CompareOp.LT | CompareOp.LE, Norm() as norm, Constant(value=float() as radius)) | Compare(
                CompareOp.GT | CompareOp.GE, Constant(value=float() as radius), Norm() as norm
            ) if radius > 0 and (line := affine_vector(norm.vector)) is not None:
                self.discs.append((*line, radius))
            case Compare() if node.op not in (CompareOp.EQ, CompareOp.NE):
                left, right = affine_scalar(node.left), affine_scalar(node.right)
                if left is None or right is None:
                    raise not_linear()
                below = node.op in (CompareOp.LT, CompareOp.LE)
                limits = (-math.inf, 0.0) if below else (0.0, math.inf)
                strict = node.op in (CompareOp.LT, CompareOp.GT)
                self.system.rows.append(Row(left.plus(right, -1.0), *limits, strict))
            case Constant() if node.value is True:
                pass
            case _:
                raise not_linear()

    def add_leaf(self, leaf: Leaf) -> None:
        """Keep a random variable in its support."""
        if isinstance(leaf, PointIn):
            if not isinstance(leaf.region, Constant):
                raise not_linear()
            x, y = (Affine(0.0, {(leaf.identity, axis): 1.0}) for axis in (0, 1))
            self._add_place(cast(Region, leaf.region.value), (x, y), self.boxes.get(leaf.identity))
            return
        limits = ends(leaf)
        if limits is None:
            raise not_linear()
        self.system.rows.append(Row(Affine(0.0, {(leaf.identity, 0): 1.0}), *limits))

    def _add_place(self, region: Region, place: AffineVector, box: Box | None) -> None:
        """Keep a point in a region: cells, segments or points, possibly cut to discs."""
        met = region.parts if isinstance(region, IntersectionOf) else (region,)
        others = [part for part in met if not isinstance(part, Disc | Sector)]
        if len(others) > 1:
            raise not_linear()
        x, y = place
        for part in met:
            if isinstance(part, Disc | Sector):
                cx, cy = part.center
                away = x.plus(Affine(-cx, {})), y.plus(Affine(-cy, {}))
                self.discs.append((*away, part.radius))
                if isinstance(part, Sector):
                    self.alternatives.append(sector_rows(away, part))
        if others:
            west, south, east, north = region_bounds(region)
            (x0, x1), (y0, y1) = box or ((west, east), (south, north))
            limits = (max(x0, west), max(y0, south), min(x1, east), min(y1, north))
            empty = limits[0] > limits[2] or limits[1] > limits[3]
            self.alternatives.append([] if empty else region_rows(others[0], limits, place))

    def solve(self) -> Mapping[tuple[Identity, int], float] | None:
        """A solution, or None if there is none."""
        ordered = sorted(self.alternatives, key=len)
        found = _search(self.system, ordered, [*disc_rows(self.discs, outer=True)])
        if found is not None and self.discs:
            found = _search(self.system, ordered, [*disc_rows(self.discs, outer=False)])
            if found is None:
                raise not_linear()
        return found

    def extent(self, variable: VariableAxis) -> tuple[float, float] | None:
        """The ends of a variable over all solutions, discs taken too large."""
        around = [*disc_rows(self.discs, outer=True)]
        if math.prod(map(len, self.alternatives)) > LIMITS.extent_combinations:
            raise not_linear()
        found: tuple[float, float] | None = None
        for chosen in itertools.product(*self.alternatives):
            own = self.system.extent([*around, *itertools.chain.from_iterable(chosen)], variable)
            if own is not None:
                found = own if found is None else (min(found[0], own[0]), max(found[1], own[1]))
        return found


def _search(
    system: LinearSystem, alternatives: list[Alternative], rows: list[Row]
) -> Mapping[tuple[Identity, int], float] | None:
    """A solution under one choice of each alternative, depth first with early failure."""
    opened = [(0, rows)]
    while opened:
        chosen, rows = opened.pop()
        left = len(alternatives) - chosen
        # with one alternative left, each of its choices fails as soon as this would
        found = None if left == 1 else system.solve(rows)
        if left == 0 and found is not None:
            return found
        if left == 1 or (left and found is not None):
            opened += [(chosen + 1, [*rows, *choice]) for choice in reversed(alternatives[chosen])]
    return None
