"""Groups decided for given label objects, each question once.

The answers are kept by the shape of the group and the label objects in its roles: what is decided for one pedestrian of
forty-eight holds for all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from scenicq.budget import Exhausted, Trials, look
from scenicq.errors import CannotEvaluate
from scenicq.forest.among import asks_others
from scenicq.forest.groups import PARAMS, Group
from scenicq.forest.nodes import Among, Feature, Value
from scenicq.forest.unobserved import certain_and_possible
from scenicq.limits import LIMITS
from scenicq.match.decide.decomposition import chooses_apart, search_decomposed
from scenicq.match.decide.solver_step import AskSolver
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import LabelProblem
from scenicq.match.problem.conditioned import Item, LabelNodes, uses_field
from scenicq.match.problem.label_elements import observe_roles
from scenicq.match.problem.likely_values import likely_group
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import (
    UNOBSERVED,
    Outcome,
    Patience,
    Refuted,
    Satisfied,
    Search,
    SearchSteps,
    Undecided,
)
from scenicq.match.problem.radius import within_radius
from scenicq.match.search.choice_search import AtLast, search_choices
from scenicq.match.search.group_plan import GroupPlan

if TYPE_CHECKING:  # takes long to load
    from scenicq.match.fields.heading_propagation import DirectedCases, KnownCases

__all__ = ["POSTPONED", "GroupCache", "possible_outcome", "rename_variables"]

POSTPONED = "postponed"
"""The reason of what is undecided for want of patience alone."""


@dataclass(eq=False, slots=True)
class GroupCache:
    """What has been decided of one label.

    Attributes:
        options: The options.
        problem: The label and who may play whom.
        ask: The solver.
        lookups: What is known of the map.
        trials: How often all searches for witnesses may try in vain.
        patience: What may take long now; the rest goes on when there is more.
    """

    options: MatchOptions
    problem: LabelProblem
    ask: AskSolver
    lookups: MapLookups
    trials: Trials = field(default_factory=lambda: Trials(LIMITS.witness_trials))
    patience: Patience = Patience.ALL
    _last: tuple[tuple[Group, tuple[int, ...]], list[Item]] | None = None
    _nodes: LabelNodes = field(default_factory=LabelNodes)
    _cases: KnownCases = field(default_factory=dict["tuple[object, ...]", "DirectedCases"])
    _known: dict[tuple[int, tuple[int, ...]], tuple[Group, Search]] = field(
        default_factory=dict["tuple[int, tuple[int, ...]]", "tuple[Group, Search]"]
    )

    def has_postponed(self) -> bool:
        """Whether a question takes more patience."""
        return not all(search.is_finished for _, search in self._known.values())

    def items(self, group: Group, assignment: Mapping[int, int], *, certain: bool = False) -> list[Item]:
        """The constraints of a group given the label (algorithm 1, line 11).

        Args:
            group: The group.
            assignment: The label object of each role.
            certain: What is not known of label objects without a role is taken for what breaks a constraint; else for
                what fulfils it.

        Raises:
            CannotEvaluate: Geometry cannot tell the value of an expression.
        """
        items = self._conditioned(group, assignment)
        if _asks_others(group):
            items = [(item, certain_and_possible(node, _is_among)[not certain], seen) for item, node, seen in items]
        return items if self.problem.disc is None else within_radius(items, *self.problem.disc)

    def has_doubts(self, group: Group, assignment: Mapping[int, int]) -> bool:
        """Whether a group asks of label objects without a role what is not known."""
        return _asks_others(group) and asks_others(*(node for _, node, _ in self._conditioned(group, assignment)))

    def _conditioned(self, group: Group, assignment: Mapping[int, int]) -> list[Item]:
        """The constraints with what is observed put in."""
        asks = _asks_others(group)
        key = group, tuple([assignment[index] for index in group.objects])
        if asks and self._last is not None and self._last[0] == key:
            return self._last[1]
        observed: dict[tuple[int, str], Value] = {
            (index, name): value
            for index in group.objects
            for name, value in self.problem.seen[assignment[index]].items()
        }
        observed.update({(PARAMS, name): value for name, value in self.problem.params.items()})
        if not asks:
            return self._nodes.items(group, observed, assignment)
        observed.update(observe_roles(self.problem, assignment))
        items = self._nodes.items(group, observed, assignment)
        # those are asked for twice
        self._last = key, items
        return items

    def of(self, plan: GroupPlan, assignment: Mapping[int, int]) -> tuple[Group, Outcome]:
        """What is decided for the label objects in a group's roles: the group of its shape, and the outcome for that.

        `rename_variables` makes it the outcome of the group.
        """
        key = (plan.kind, tuple([assignment[index] for index in plan.roles]))
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = (plan.group, Search(self._steps(plan, dict(assignment))))
        group, search = known
        with self.trials:
            outcome = search.within(self.patience)
        return group, Undecided(group.constraints[0], POSTPONED) if outcome is None else outcome

    def _steps(self, plan: GroupPlan, assignment: Mapping[int, int]) -> SearchSteps:
        group = plan.group
        outcome = self._in_closed_form(plan, assignment) or (yield from self._by_cascade(group, assignment))
        if not isinstance(outcome, Satisfied) or not (group.doubtful or self.has_doubts(group, assignment)):
            return outcome
        return possible_outcome(group, (yield from self._by_cascade(group.certain_group, assignment, certain=True)))

    def _in_closed_form(self, plan: GroupPlan, assignment: Mapping[int, int]) -> Outcome | None:
        """What a closed form says, if it is clear."""
        if plan.closed_form is None or self.options.method != "auto":
            return None
        seen = self.problem.seen
        return plan.closed_form.decide(lambda index, name: seen[assignment[index]][name], self.options, self.lookups)

    def _by_cascade(self, group: Group, assignment: Mapping[int, int], *, certain: bool = False) -> SearchSteps:
        try:
            look()
            if self.options.method == "smt":
                return self.ask([self.items(group, assignment, certain=certain)])
            likely = likely_group(group)
            if likely is not None:
                found = yield from self._decided(self.items(likely.group, assignment, certain=certain), self._searched)
                if isinstance(found, Satisfied):
                    return likely.restored(found)
                yield Patience.ALL
            return (yield from self._decided(self.items(group, assignment, certain=certain), self._at_last))
        except CannotEvaluate as error:
            return Undecided(group.constraints[0], f"unsupported: {error}")
        except Exhausted as error:
            return Undecided.by(group.constraints[0], error)

    def _decided(self, items: list[Item], at_last: AtLast) -> SearchSteps:
        """What the cascade says of constraints, and where it says nothing, what is asked at last."""
        tolerance = self.options.tolerance
        if chooses_apart(items):
            found = yield from search_decomposed(items, tolerance, self._cases)
            if not isinstance(found, Undecided):
                return found
        chosen = yield from search_choices(items, tolerance, lambda left: search_decomposed(left, tolerance), at_last)
        if chosen is not None:
            return chosen
        outcome = yield from search_decomposed(items, tolerance, self._cases)
        return (yield from at_last([items])) if isinstance(outcome, Undecided) else outcome

    def _searched(self, items: Sequence[Sequence[Item]]) -> SearchSteps:
        """What comes of boxes; where fields are, these were looked at already."""
        yield Patience.LIKELY
        flat = [item for group in items for item in group]
        if uses_field(flat):
            return Undecided(flat[0][0], "nonlinear")
        from scenicq.match.fields.branch_and_prune import branch_and_prune  # noqa: PLC0415 - takes long to load

        return branch_and_prune(flat, self.options.tolerance)

    def _at_last(self, items: Sequence[Sequence[Item]]) -> SearchSteps:
        """What nothing else decides: branch and prune, then the solver."""
        found = yield from self._searched(items)
        return self.ask(items, found) if isinstance(found, Undecided) else found


def rename_variables(decided: tuple[Group, Outcome], target: Group) -> Outcome:
    """What was decided for a group, said of another one of the same shape."""
    source, outcome = decided
    if source is target:
        return outcome
    if isinstance(outcome, Satisfied):
        pairs = zip(source.variables, target.variables, strict=True)
        return Satisfied(
            {new.identity: outcome.values[old.identity] for old, new in pairs if old.identity in outcome.values}
        )
    sources, targets = ((*each.doubtful, *each.constraints, *each.certain) for each in (source, target))
    constraint = targets[sources.index(outcome.constraint)]
    return (
        Refuted(constraint, outcome.detail) if isinstance(outcome, Refuted) else replace(outcome, constraint=constraint)
    )


def possible_outcome(group: Group, sure: Outcome) -> Outcome:
    """The outcome of a group that may be satisfied, from that of its `certain_group`."""
    if not isinstance(sure, Refuted):
        return sure
    return Undecided(group.doubtful[0] if group.doubtful else sure.constraint, UNOBSERVED)


@lru_cache(maxsize=256)
def _asks_others(group: Group) -> bool:
    return asks_others(*(each.expression for each in (*group.constraints, *group.certain)))


def _is_among(node: Feature | Among) -> bool:
    return isinstance(node, Among)
