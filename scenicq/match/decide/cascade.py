"""The decision ladder: each group by the first step that decides it (conditioning done).

Ground facts are evaluated; discrete choices are tried one by one; a single affine feature is inverted in closed form;
affine systems go to a linear program, once per map cell; what is left goes to a solver. Every step is exact or says
that it does not know.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import cast

from scenicq.budget import look
from scenicq.forest import build
from scenicq.forest.bounds import Box, vector_bounds
from scenicq.forest.condition import condition
from scenicq.forest.groups import Comparison, Constraint
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    DiscreteRange,
    Identity,
    Index,
    Leaf,
    LogicOp,
    Node,
    Select,
    Value,
)
from scenicq.forest.walk import deciding_first, leaves, postorder
from scenicq.geometry.fields import FieldCell, VectorField
from scenicq.match.linear.affine_forms import AffineVector, affine_scalar, affine_vector
from scenicq.match.linear.affine_reach import Reach, reach_heading, reach_number, reach_position
from scenicq.match.linear.linear_program import Row
from scenicq.match.linear.linear_relaxation import NotLinear, inside, position_boxes, solve_affine
from scenicq.match.problem.conditioned import Item, conditioned, fact
from scenicq.match.problem.evaluation import ground_cause, holds, replay
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["decide"]


_MOST_BRANCHES = 4096
_MOST_CHOSEN = 100
"""Discrete variables and cells that are chosen one below the other."""
_MOST_PARTS = 200
"""Parts of one cell that are looked at."""
_MOST_PROGRAMS = 20_000
"""Linear programs for one decision: some seconds, after which a solver does no worse."""


def decide(items: list[Item], tolerance: Tolerance) -> Outcome:
    """Decide a group without a solver; `Maybe` with reason "nonlinear" where one is needed."""
    try:
        return _Cascade(tolerance).decide(items, {}, [])
    except _Exhausted:
        return Undecided(items[0][0], "nonlinear")


class _Exhausted(Exception):
    """A decision has taken all the linear programs, or made all the choices, that it may."""


class _Cascade:
    """One decision: the tolerance, and how many branches it may take."""

    def __init__(self, tolerance: Tolerance) -> None:
        self.tolerance = tolerance
        self.branches = 0
        self.programs = 0
        self.places: list[Node] = []
        """The points for which a cell is chosen: they may occur nowhere else, and still need a value."""

    def decide(self, items: list[Item], given: dict[Identity, Value], rows: list[Row]) -> Outcome:
        """Decide constraints, given values of discrete variables and linear facts about the rest.

        Args:
            items: The constraints.
            given: Values chosen so far.
            rows: Facts that came with cells chosen so far.
        """
        look()
        open_items: list[Item] = []
        for item in items:
            if not isinstance(item[1], Constant):
                open_items.append(item)
            elif not holds(item[0], item[1].value, item[2], self.tolerance):
                return Refuted(item[0], ground_cause(item))
        if not open_items:
            return self._linear(items, given, rows) if self.places else Satisfied(given)
        if len(given) + len(self.places) > _MOST_CHOSEN:
            raise _Exhausted
        for leaf in deciding_first([node for _, node, _ in open_items]):
            options = _options(leaf)
            if options is not None:
                return self._try_each(items, leaf, options, given, rows)
        if len(open_items) == 1 and not rows and isinstance(open_items[0][0], Comparison):
            reached = self._invert(open_items[0])
            if reached.possible and all(leaf.identity in reached.values for leaf in leaves(open_items[0][1])):
                return Satisfied(given | dict(reached.values))
            if reached.possible is False:
                return Refuted(open_items[0][0])
        truth = _free_truth(open_items)
        if truth is not None:
            return self._try_both(items, truth, given, rows)
        field = _free_direction(open_items)
        if field is not None:
            return self._try_cells(items, field, given, rows)
        return self._linear(open_items, given, rows)

    def _branch(self, constraint: Constraint, outcomes: Iterator[Outcome]) -> Outcome:
        blamed: Outcome = Refuted(constraint)
        for number, outcome in enumerate(outcomes):
            self.branches += 1
            if isinstance(outcome, Satisfied):
                return outcome
            if isinstance(outcome, Undecided) or (number == 0 and isinstance(blamed, Refuted)):
                blamed = outcome
            if self.branches > _MOST_BRANCHES:
                return Undecided(constraint, "nonlinear")
        return blamed

    def _try_each(
        self,
        items: list[Item],
        leaf: Leaf,
        options: range,
        given: dict[Identity, Value],
        rows: list[Row],
    ) -> Outcome:
        def outcomes() -> Iterator[Outcome]:
            for option in options:
                chosen: dict[Identity, Value] = {leaf.identity: float(option)}
                yield self.decide(conditioned(items, chosen), given | chosen, rows)

        return self._branch(items[0][0], outcomes())

    def _try_both(self, items: list[Item], truth: Node, given: dict[Identity, Value], rows: list[Row]) -> Outcome:
        """A truth value that makes up another value: one branch in which it holds, one in which it does not."""

        def outcomes() -> Iterator[Outcome]:
            for value in (True, False):
                fixed = conditioned(items, memo={id(truth): Constant(value, span=truth.span)})
                yield self.decide([*fixed, fact(truth if value else _opposite(truth))], given, rows)

        return self._branch(items[0][0], outcomes())

    def _invert(self, item: Item) -> Reach:
        constraint, node, observed = item
        assert isinstance(constraint, Comparison)
        margin = self.tolerance.of(constraint.object, constraint.property)
        variables = {leaf.identity: leaf for leaf in leaves(node)}
        if isinstance(observed, tuple):
            form = affine_vector(node)
            if form is None or constraint.property != "position":
                return Reach(None, {})
            return reach_position(form, variables, observed, margin)
        scalar = affine_scalar(node)
        if scalar is None or not isinstance(observed, float):
            return Reach(None, {})
        reach = reach_heading if margin.kind == "arc" else reach_number
        return reach(scalar, variables, observed, margin.size)

    def _try_cells(
        self, items: list[Item], field: DirectionAt, given: dict[Identity, Value], rows: list[Row]
    ) -> Outcome:
        """A field at a random point: one branch per cell near where the point can be."""
        constraint = items[0][0]
        place = affine_vector(field.point)
        if place is None or not isinstance(field.field, Constant):
            return Undecided(constraint, "nonlinear")
        (x0, x1), (y0, y1) = vector_bounds(field.point, position_boxes(items, self.tolerance, rows))
        if not all(map(math.isfinite, (x0, x1, y0, y1))):
            return Undecided(constraint, "nonlinear")
        vector_field = cast(VectorField, field.field.value)

        given_heading: dict[float, tuple[list[Item], Box] | Refuted] = {}

        def outcomes() -> Iterator[Outcome]:
            for whole in vector_field.cells((x0, y0, x1, y1)):
                cell = None if _apart(whole, ((x0, x1), (y0, y1))) else whole.part((x0, y0, x1, y1))
                if cell is None:
                    continue
                known = given_heading.get(cell.heading)
                if known is None:
                    known = given_heading[cell.heading] = self._with_heading(items, field, cell.heading, rows)
                    if isinstance(known, Refuted):
                        yield known
                if isinstance(known, Refuted) or _apart(cell, known[1]):
                    continue
                fixed, _ = known
                west, south, east, north = cell.bounds
                box = (max(west, x0), min(east, x1)), (max(south, y0), min(north, y1))
                around = (Row(place[0], *box[0]), Row(place[1], *box[1]))
                more = [*rows, *inside(place, cell.polygon), *around]
                self.places.append(field.point)
                outcome = self.decide(fixed, given, more)
                if not cell.exact and not isinstance(outcome, Refuted) and not self._confirmed(items, outcome):
                    outcome = self._refine(items, fixed, given, more, place, cell, box)
                self.places.pop()
                yield outcome

        return self._branch(constraint, outcomes())

    def _with_heading(
        self, items: list[Item], field: DirectionAt, heading: float, rows: list[Row]
    ) -> tuple[list[Item], Box] | Refuted:
        """The constraints where the field has a heading, and where its point can then be."""
        fixed = conditioned(items, memo={id(field): Constant(heading, span=field.span)})
        for item in fixed:
            if isinstance(item[1], Constant) and not holds(item[0], item[1].value, item[2], self.tolerance):
                return Refuted(item[0], ground_cause(item))
        free = {leaf.identity for leaf in leaves(field.point)}
        if not rows and free.isdisjoint(leaf.identity for leaf in leaves(*(node for _, node, _ in fixed))):
            # the rest does not ask where the point is: what excludes it does so in every cell
            outcome = _Cascade(self.tolerance).decide(fixed, {}, [])
            if isinstance(outcome, Refuted):
                return outcome
        return fixed, vector_bounds(field.point, position_boxes(fixed, self.tolerance))

    def _confirmed(self, items: list[Item], outcome: Outcome) -> bool:
        """Whether a witness found in a cell that covers too much holds where the field is asked itself."""
        return isinstance(outcome, Satisfied) and replay(items, outcome.values, self.tolerance, SLACK)

    def _refine(
        self,
        items: list[Item],
        fixed: list[Item],
        given: dict[Identity, Value],
        rows: list[Row],
        place: AffineVector,
        cell: FieldCell,
        box: Box,
    ) -> Outcome:
        """A cell that covers too much, halved again and again: until a witness holds, or no part is left."""
        todo: deque[Box] = deque([box])
        for _ in range(_MOST_PARTS):
            if not todo:
                return Refuted(items[0][0])
            x, y = todo.popleft()
            if cell.part((x[0], y[0], x[1], y[1])) is None:
                continue
            here = [*rows, Row(place[0], *x), Row(place[1], *y)]
            outcome = self.decide(fixed, given, here)
            if self._confirmed(items, outcome):
                return outcome
            if not isinstance(outcome, Refuted):
                wide = x[1] - x[0] >= y[1] - y[0]
                low, high = x if wide else y
                for half in ((low, (low + high) / 2), ((low + high) / 2, high)):
                    todo.append((half, y) if wide else (x, half))
        return Undecided(items[0][0], "nonlinear")

    def _linear(self, items: list[Item], given: dict[Identity, Value], rows: list[Row]) -> Outcome:
        constraint = items[0][0]
        self.programs += 1
        if self.programs > _MOST_PROGRAMS:
            raise _Exhausted
        try:
            found = solve_affine(items, rows, self.tolerance, self.places)
        except NotLinear:
            return Undecided(constraint, "nonlinear")
        if found is None:
            return Refuted(constraint)
        values = given | found
        holding = replay(items, values, self.tolerance, SLACK)
        return Satisfied(values) if holding else Undecided(constraint, "nonlinear")


def _options(leaf: Leaf) -> range | None:
    match leaf:
        case Index():
            return range(len(leaf.weights))
        case DiscreteRange() if isinstance(leaf.low, Constant) and isinstance(leaf.high, Constant):
            low, high = cast(float, leaf.low.value), cast(float, leaf.high.value)
            return range(math.ceil(low), math.floor(high) + 1)
        case _:
            return None


def _free_truth(items: list[Item]) -> Node | None:
    """An unknown truth value that other values are made of, the innermost first."""
    for node in postorder([node for _, node, _ in items]):
        match node:
            case Select(index=Index()):
                continue
            case Select(index=truth) if kind_of(truth) == "boolean":
                return truth
            case Compare(CompareOp.EQ | CompareOp.NE, left, right):
                for side in (left, right):
                    if not isinstance(side, Constant) and kind_of(side) == "boolean":
                        return side
            case _:
                pass
    return None


_OPPOSITE = {
    CompareOp.LT: CompareOp.GE, CompareOp.LE: CompareOp.GT, CompareOp.GT: CompareOp.LE, CompareOp.GE: CompareOp.LT,
}  # fmt: skip


def _opposite(truth: Node) -> Node:
    if isinstance(truth, Compare) and truth.op in _OPPOSITE:
        return build.compare(_OPPOSITE[truth.op], truth.left, truth.right, truth.span)
    return build.logic(LogicOp.NOT, truth, span=truth.span)


def _free_direction(items: list[Item]) -> DirectionAt | None:
    """A field at a random point; first one that alone decides a constraint, because most of its cells are then out."""
    found: DirectionAt | None = None
    for _, node, _ in items:
        free = [
            each
            for each in postorder((node,))
            if isinstance(each, DirectionAt) and not isinstance(each.point, Constant)
        ]
        if len(free) == 1 and isinstance(condition(node, {}, None, {id(free[0]): Constant(0.0)}), Constant):
            return free[0]
        found = found or next(iter(free), None)
    return found


def _apart(cell: FieldCell, box: Box) -> bool:
    """Whether a cell lies outside of a box."""
    west, south, east, north = cell.bounds
    (x0, x1), (y0, y1) = box
    return west > x1 or east < x0 or south > y1 or north < y0
