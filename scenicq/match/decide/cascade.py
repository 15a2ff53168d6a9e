"""The cascade of deciders of one group after conditioning: the first step that decides it.

Ground constraints are evaluated; discrete variables are enumerated; a single affine feature is inverted; affine systems
go to a linear program. Every step is exact or says that it does not know.
"""

from __future__ import annotations

from collections.abc import Iterator

from scenicq.budget import Exhausted, look
from scenicq.errors import CannotEvaluate
from scenicq.forest.groups import Comparison, Constraint
from scenicq.forest.nodes import (
    Constant,
    Identity,
    Leaf,
    Value,
)
from scenicq.forest.walk import deciding_first, leaves
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.linear.affine_forms import affine_scalar, affine_vector
from scenicq.match.linear.affine_reach import Reach, reach_heading, reach_number, reach_position
from scenicq.match.linear.linear_relaxation import solve_affine
from scenicq.match.problem.conditioned import Item, condition_items, options_of
from scenicq.match.problem.evaluation import ground_cause, holds, replay
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["decide"]


def decide(items: list[Item], tolerance: Tolerance) -> Outcome:
    """Decide a group without a solver; `Undecided` with reason "nonlinear" where one is needed."""
    if not items:
        # what evaluation has decided needs no time, of which none may be left
        return Satisfied({})
    try:
        return _Cascade(tolerance).decide(items, {}, 0)
    except Exhausted as error:
        return Undecided.by(items[0][0], error)


class _Cascade:
    """One decision: the tolerance, and how many branches it may take."""

    def __init__(self, tolerance: Tolerance) -> None:
        self.tolerance = tolerance
        self.branches = 0
        self.programs = 0

    def decide(self, items: list[Item], given: dict[Identity, Value], depth: int) -> Outcome:
        """Decide constraints, given values of discrete variables.

        Args:
            items: The constraints.
            given: Values of discrete variables chosen so far.
            depth: How many of these there are.
        """
        look()
        open_items: list[Item] = []
        for item in items:
            if not isinstance(item[1], Constant):
                open_items.append(item)
            elif not holds(item[0], item[1].value, item[2], self.tolerance):
                return Refuted(item[0], ground_cause(item))
        if not open_items:
            return Satisfied(given)
        if depth > LIMITS.cascade_nesting:
            raise limit_exceeded("cascade_nesting")
        for leaf in deciding_first([node for _, node, _ in open_items]):
            options = options_of(leaf)
            if options is not None:
                return self._try_each(items, leaf, options, given, depth + 1)
        if len(open_items) == 1 and isinstance(open_items[0][0], Comparison):
            reached = self._invert(open_items[0])
            if reached.possible and all(leaf.identity in reached.values for leaf in leaves(open_items[0][1])):
                return Satisfied(given | dict(reached.values))
            if reached.possible is False:
                return Refuted(open_items[0][0])
        return self._linear(open_items, given)

    def _branch(self, constraint: Constraint, outcomes: Iterator[Outcome]) -> Outcome:
        blamed: Outcome = Refuted(constraint)
        for number, outcome in enumerate(outcomes):
            self.branches += 1
            if isinstance(outcome, Satisfied):
                return outcome
            if isinstance(outcome, Undecided) or (number == 0 and isinstance(blamed, Refuted)):
                blamed = outcome
            if self.branches > LIMITS.cascade_outcomes:
                raise limit_exceeded("cascade_outcomes")
        return blamed

    def _try_each(
        self,
        items: list[Item],
        leaf: Leaf,
        options: range,
        given: dict[Identity, Value],
        depth: int,
    ) -> Outcome:
        def outcomes() -> Iterator[Outcome]:
            for option in options:
                chosen: dict[Identity, Value] = {leaf.identity: float(option)}
                yield self.decide(condition_items(items, chosen), given | chosen, depth)

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

    def _linear(self, items: list[Item], given: dict[Identity, Value]) -> Outcome:
        constraint = items[0][0]
        self.programs += 1
        if self.programs > LIMITS.cascade_programs:
            raise limit_exceeded("cascade_programs")
        try:
            found = solve_affine(items, [], self.tolerance)
        except CannotEvaluate:
            return Undecided(constraint, "nonlinear")
        if found is None:
            return Refuted(constraint)
        values = given | found
        holding = replay(items, values, self.tolerance, SLACK)
        return Satisfied(values) if holding else Undecided(constraint, "nonlinear")
