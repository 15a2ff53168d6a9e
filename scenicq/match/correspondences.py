"""The correspondences of a label with one ego: those that match, then those that nothing excludes."""

from __future__ import annotations

from collections.abc import Iterator

from scenicq.match.explanation import Finding
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.search.plan_cache import PlanCache
from scenicq.match.search.verdict_builder import VerdictBuilder
from scenicq.store.labels import Label

__all__ = ["correspondences"]


def correspondences(
    label: Label, search: LabelSearch, plans: PlanCache, verdicts: VerdictBuilder, *, every_open: bool
) -> Iterator[Finding]:
    """The correspondences that match, then those that are open, each once.

    Args:
        label: The label.
        search: Its search with one ego.
        plans: The plans of the scenario.
        verdicts: What makes verdicts of its scenario.
        every_open: Whether all that are open are wanted; else the search notes the first one, and none is told.

    Raises:
        Exhausted: The search takes more steps, or more time, than it may.
    """
    for plan, solution in search.solutions(plans.plan, plans.relevant, plans.always_twins):
        satisfied = tuple(outcome for _, outcome in solution.outcomes)
        yield Finding(verdicts.match(label, solution), search, plan, solution.assignment, satisfied)
    for plan, failure in search.open_ones():
        if not every_open:
            search.undecided = failure
            return
        yield Finding(verdicts.undecided(label, search, failure), search, plan, failure.assignment)
