"""Groups decided for given label objects, each question once.

The answers are kept by the shape of the group and the label objects in its roles: what is decided for one pedestrian of
forty-eight holds for all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from scenicq.budget import Exhausted, Trials, look
from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.groups import PARAMS, Group
from scenicq.forest.nodes import Value
from scenicq.limits import LIMITS
from scenicq.match.decide.decomposition import decide_decomposed
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import LabelProblem
from scenicq.match.problem.conditioned import Item, condition_group, uses_field
from scenicq.match.problem.likely_values import likely_group
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import POSTPONED, UNOBSERVED, Outcome, Patience, Refuted, Satisfied, Undecided
from scenicq.match.problem.radius import within_radius
from scenicq.match.search.choice_search import Ask, decide_with_choices
from scenicq.match.search.group_plan import GroupPlan

__all__ = ["GroupCache", "known_of", "surely", "translated"]


@dataclass(eq=False, slots=True)
class GroupCache:
    """What has been decided of one label.

    Attributes:
        options: The options.
        problem: The label and who may play whom.
        ask: The solver.
        lookups: What is known of the map.
        trials: How often all searches for witnesses may try in vain.
        patience: What may take long now; the rest is postponed.
    """

    options: MatchOptions
    problem: LabelProblem
    ask: Ask
    lookups: MapLookups
    trials: Trials = field(default_factory=lambda: Trials(LIMITS.witness_trials))
    patience: Patience = Patience.ALL
    _known: dict[tuple[int, tuple[int, ...]], tuple[Group, Outcome]] = field(
        default_factory=dict["tuple[int, tuple[int, ...]]", "tuple[Group, Outcome]"]
    )

    def has_postponed(self) -> bool:
        """Whether a question is postponed."""
        return any(_is_postponed(outcome) for _, outcome in self._known.values())

    def have(self, patience: Patience) -> None:
        """Have more patience, or less: what is postponed may be decided anew."""
        self._known = {key: known for key, known in self._known.items() if not _is_postponed(known[1])}
        self.patience = patience

    def items(self, group: Group, assignment: Mapping[int, int]) -> list[Item]:
        """The constraints of a group given the label (algorithm 1, line 11).

        Raises:
            CannotEvaluate: Geometry cannot tell the value of an expression.
        """
        observed: dict[tuple[int, str], Value] = {
            (index, name): value
            for index in group.objects
            for name, value in self.problem.seen[assignment[index]].items()
        }
        observed.update({(PARAMS, name): value for name, value in self.problem.params.items()})
        items = condition_group(group, observed)
        return items if self.problem.disc is None else within_radius(items, *self.problem.disc)

    def of(self, plan: GroupPlan, assignment: Mapping[int, int]) -> tuple[Group, Outcome]:
        """What is decided for the label objects in a group's roles, said of a group of its shape (see `translated`)."""
        key = (plan.kind, tuple([assignment[index] for index in plan.roles]))
        known = self._known.get(key)
        if known is None:
            outcome = self._in_closed_form(plan, assignment) or self._by_cascade(plan.group, assignment)
            if plan.group.doubtful and isinstance(outcome, Satisfied):
                outcome = known_of(plan.group, self._by_cascade(surely(plan.group), assignment))
            known = self._known[key] = (plan.group, outcome)
        return known

    def _in_closed_form(self, plan: GroupPlan, assignment: Mapping[int, int]) -> Outcome | None:
        """What a closed form says, if it is clear."""
        if plan.closed_form is None or self.options.method != "auto":
            return None
        seen = self.problem.seen
        return plan.closed_form.decide(lambda index, name: seen[assignment[index]][name], self.options, self.lookups)

    def _by_cascade(self, group: Group, assignment: Mapping[int, int]) -> Outcome:
        try:
            look()
            if self.options.method == "smt":
                return self.ask([self.items(group, assignment)])
            with self.trials:
                likely = likely_group(group)
                if likely is not None:
                    found = self._decided(self.items(likely.group, assignment), self._searched)
                    if isinstance(found, Satisfied):
                        return likely.restored(found)
                    if self.patience < Patience.ALL:
                        return Undecided(group.constraints[0], POSTPONED)
                return self._decided(self.items(group, assignment), self._at_last)
        except CannotEvaluate as error:
            return Undecided(group.constraints[0], f"unsupported: {error}")
        except Exhausted as error:
            return Undecided.by(group.constraints[0], error)

    def _decided(self, items: list[Item], at_last: Ask) -> Outcome:
        """What the cascade says of constraints, and where it says nothing, what is asked at last."""
        tolerance, patience = self.options.tolerance, self.patience

        def decide(left: list[Item]) -> Outcome:
            return decide_decomposed(left, tolerance, patience)

        chosen = decide_with_choices(items, tolerance, decide, at_last, patience=patience)
        if chosen is not None:
            return chosen
        outcome = decide(items)
        return at_last([items]) if isinstance(outcome, Undecided) and not _is_postponed(outcome) else outcome

    def _searched(self, items: Sequence[Sequence[Item]]) -> Outcome:
        """What comes of boxes; where fields are, these were looked at already."""
        flat = [item for group in items for item in group]
        if uses_field(flat):
            return Undecided(flat[0][0], "nonlinear")
        from scenicq.match.fields.branch_and_prune import branch_and_prune  # noqa: PLC0415 - takes long to load

        return branch_and_prune(flat, self.options.tolerance)

    def _at_last(self, items: Sequence[Sequence[Item]]) -> Outcome:
        """What nothing else decides: branch and prune, then the solver."""
        if self.patience is Patience.LITTLE:
            return Undecided(items[0][0][0], POSTPONED)
        found = self._searched(items)
        return self.ask(items) if isinstance(found, Undecided) else found


def _is_postponed(outcome: Outcome) -> bool:
    return isinstance(outcome, Undecided) and outcome.reason == POSTPONED


def translated(decided: tuple[Group, Outcome], target: Group) -> Outcome:
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


def surely(group: Group) -> Group:
    """The group that only those satisfy who satisfy it whatever is not observed."""
    return replace(group, constraints=group.certain, doubtful=(), certain=())


def known_of(group: Group, sure: Outcome) -> Outcome:
    """The outcome of a group that may be satisfied, from that of `surely` of it."""
    return Undecided(group.doubtful[0], UNOBSERVED) if isinstance(sure, Refuted) else sure
