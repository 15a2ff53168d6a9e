"""How a label was decided, for explanations and reports: they import nothing else of what lies below the matcher."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from scenicq.forest.nodes import Identity, Value
from scenicq.match.decide.decomposition import decide_decomposed
from scenicq.match.decide.solver_step import encode_groups
from scenicq.match.problem.conditioned import Item, condition_items
from scenicq.match.problem.constraints import describe_constraint
from scenicq.match.problem.evaluation import show_value
from scenicq.match.problem.observation import observe
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided
from scenicq.match.search.group_plan import MatchPlan
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.verdict import Verdict

__all__ = [
    "Finding",
    "Item",
    "LabelSearch",
    "MatchPlan",
    "Outcome",
    "Refuted",
    "Satisfied",
    "Undecided",
    "condition_items",
    "decide_decomposed",
    "describe_constraint",
    "encode_groups",
    "observe",
    "show_value",
]


@dataclass(frozen=True, slots=True)
class Finding:
    """A verdict with what it rests on.

    Attributes:
        verdict: The verdict.
        search: The search that led to it; None if there were no candidates to search among.
        plan: The scenario's groups for what was observed; None without a match.
        assignment: The correspondence, numbers of label objects by index of the object; partial without a match.
        satisfied: How each group was satisfied; none without a match.
    """

    verdict: Verdict
    search: LabelSearch | None = None
    plan: MatchPlan | None = None
    assignment: Mapping[int, int] = field(default_factory=dict[int, int])
    satisfied: tuple[Satisfied, ...] = ()

    def values(self) -> Mapping[Identity, Value]:
        """The witness of a match: the value of each random variable of its groups."""
        return {identity: value for outcome in self.satisfied for identity, value in outcome.values.items()}
