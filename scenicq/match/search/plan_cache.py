"""What is worked out once for a scenario, however many labels are matched: plans by signature, and their first fits."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from scenicq.forest.scenario import Scenario
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import Candidates, candidates_of, sort_by_distance
from scenicq.match.problem.constraints import Signature, build_groups, relevant_properties
from scenicq.match.problem.observation import rule_of_courses
from scenicq.match.problem.symmetry import interchangeable, shape_of
from scenicq.match.search.first_fit import FirstFit, LabelRow, first_fit_of, signature_of
from scenicq.match.search.group_plan import MatchPlan, make_plan
from scenicq.store.labels import Label

__all__ = ["PlanCache"]


@dataclass(eq=False)
class PlanCache:
    """The plans of one scenario.

    Attributes:
        scenario: The scenario, made ready to be matched.
        options: What holds of all labels, of the tolerance its scopes alone.
        relevant: For each object, the properties for which it matters whether a label observes them.
        plans: By what is observed.
        one_order: Whether interchangeable objects take one order in all labels, whatever is observed of them.
    """

    scenario: Scenario
    options: MatchOptions
    relevant: tuple[frozenset[str], ...] = field(init=False)
    plans: dict[Signature, MatchPlan] = field(default_factory=dict["Signature", "MatchPlan"])
    one_order: bool = False
    _kinds: dict[Hashable, int] = field(default_factory=dict["Hashable", int])
    _always_twins: Mapping[int, int] | None = None
    _fits: dict[MatchPlan, FirstFit | None] = field(default_factory=dict["MatchPlan", "FirstFit | None"])

    def __post_init__(self) -> None:
        """Find out what matters of a label."""
        self.relevant = relevant_properties(self.scenario, self.options)

    def plan(self, signature: Signature) -> MatchPlan:
        """The groups for a signature, analysed once."""
        if signature not in self.plans:
            plan = make_plan(self.scenario, signature, self.options, self._kinds)
            self.plans[signature] = replace(plan, twins=self._twins(plan))
        return self.plans[signature]

    @property
    def always_twins(self) -> Mapping[int, int]:
        """Objects that are interchangeable in every label: for each, an earlier one."""
        if self._always_twins is None:
            every = (*self.relevant, frozenset(self.scenario.params))
            groups = build_groups(self.scenario, every, self.options)
            shapes = [shape_of(group, self.scenario.ego, self.options.tolerance) for group in groups]
            self._always_twins = interchangeable(
                self.scenario, groups, shapes, self.options.tolerance, used=self.relevant
            )
        return self._always_twins

    def _twins(self, plan: MatchPlan) -> Mapping[int, int]:
        """Interchangeable objects: those that the program treats alike, and for one label those of which it knows so.

        What the program treats alike in all that it says is alike in every label. What it treats alike in what a label
        tells is so only where it asks the same of both, and the label tells as much of one as of the other.
        """
        if self.one_order:
            return self.always_twins
        here = {
            one: other
            for one, other in plan.twins.items()
            if self.relevant[one] == self.relevant[other] and plan.signature[one] == plan.signature[other]
        }
        return {**self.always_twins, **here}

    def first_fits(
        self, labels: Iterable[tuple[Label, Candidates | None]], fixed_roles: Mapping[str, str]
    ) -> dict[FirstFit, list[LabelRow]]:
        """The labels that first fit can decide, by their plans.

        Args:
            labels: Labels, each with the candidates of its roles, where they are known already.
            fixed_roles: Ids of the label objects that play certain roles, by the names of the roles.
        """
        options = self.options
        courses = rule_of_courses(self.scenario)
        found: dict[FirstFit, list[LabelRow]] = {}
        if options.method != "auto" or options.exact or options.ego != "label":
            return found
        for number, (label, known) in enumerate(labels):
            if label.has_ego:
                roles = known
                if roles is None or fixed_roles:
                    roles = candidates_of(self.scenario, label, 0, options, fixed_roles, known)
                signature = signature_of(label, self.scenario.ego, roles, self.relevant)
                fit = None if signature is None else self._first_fit(self.plan(signature))
                if fit is not None:
                    found.setdefault(fit, []).append(
                        LabelRow(number, label, sort_by_distance(label, 0, roles), {}, courses)
                    )
        return found

    def _first_fit(self, plan: MatchPlan) -> FirstFit | None:
        if plan not in self._fits:
            self._fits[plan] = first_fit_of(plan, self.scenario)
        return self._fits[plan]
