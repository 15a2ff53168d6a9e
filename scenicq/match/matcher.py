"""Algorithm 1 of the query paper: does a label match a scenario?

    for each way to give the scenario's objects distinct label objects (search/):
        for each group of jointly dependent features, in dependency order (search/group_plan):
            put in what the label observes and decide whether the rest can be satisfied (decide/, else a solver)

Labels of a batch that match in the first way that is tried are found side by side (search/first_fit). `Matcher.match`
is a pure function of scenario, label and options, but for the solver it may ask. Unknown never becomes no: a group
that nothing decides leaves the label undecided unless another correspondence matches.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import InitVar, dataclass, field, replace
from typing import TYPE_CHECKING

from scenicq.budget import Exhausted, limited
from scenicq.forest.scenario import Scenario
from scenicq.match.correspondences import correspondences
from scenicq.match.decide.solver_step import ask
from scenicq.match.explanation import Finding
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import Candidates, possible_egos, prepare_label
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import Outcome, Undecided
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.search.backtracking import Reporter
from scenicq.match.search.batch_lookups import look_up_positions
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.search.plan_cache import PlanCache
from scenicq.match.search.verdict_builder import VerdictBuilder
from scenicq.match.verdict import Cause, Match, Unknown, Verdict
from scenicq.store.labels import Label

if TYPE_CHECKING:  # takes long to load
    from scenicq.smt.answer import Solver

__all__ = ["Matcher"]

LabelAndCandidates = tuple[Label, Candidates | None]
"""A label of the map that the scenario was compiled for, and the candidates of its roles where they are known."""


@dataclass(eq=False)
class Matcher:
    """A scenario made ready to be matched against labels of one map.

    Attributes:
        scenario: The scenario, made ready to be matched.
        options: The options.
        solver: Decides what nothing of our own decides, or everything; None for the built-in solver.
        plans: The analysis of the scenario, made for the first label of a kind and kept.
    """

    scenario: Scenario
    options: MatchOptions = MatchOptions()
    solver: Solver | None = None
    known: InitVar[PlanCache | None] = None
    plans: PlanCache = field(init=False, repr=False)
    _verdicts: VerdictBuilder = field(init=False, repr=False)

    def __post_init__(self, known: PlanCache | None) -> None:
        """Rewrite the scenario and tie the tolerance to its objects."""
        self.scenario = prepare_scenario(self.scenario)
        self.options = replace(self.options, tolerance=self.options.tolerance.for_scenario(self.scenario))
        self.plans = known or PlanCache(self.scenario, self.options)
        self._verdicts = VerdictBuilder(self.scenario, self.options)

    def match(
        self,
        label: Label,
        reporter: Reporter | None = None,
        *,
        fixed_roles: Mapping[str, str] | None = None,
        candidates: Candidates | None = None,
    ) -> Verdict:
        """Decide one label: a batch of one.

        Args:
            label: The label, of the map that the scenario was compiled for.
            reporter: Watches the correspondence search.
            fixed_roles: Ids of the label objects that play certain roles, by the names of the roles.
            candidates: Candidates of the roles, where they are known already.
        """
        return next(self._decided([(label, candidates)], MapLookups(), reporter, fixed_roles or {}))

    def match_all(self, labels: Sequence[LabelAndCandidates], *, details: bool = True) -> Iterator[Verdict]:
        """Decide labels, each as `match` does; without details, a no says only which constraint fails."""
        lookups = look_up_positions(self.plans.plans.values(), self.scenario.ego, labels)
        return self._decided(labels, lookups, None, {}, details=details)

    def matches(self, label: Label, *, candidates: Candidates | None = None) -> Iterator[Match]:
        """The correspondences by which a label matches; interchangeable objects come in one order only."""
        found = (finding.verdict for finding in self.findings(label, candidates=candidates))
        return (verdict for verdict in found if isinstance(verdict, Match))

    def findings(
        self, label: Label, *, candidates: Candidates | None = None, every_open: bool = False
    ) -> Iterator[Finding]:
        """The matches, then one undecided correspondence, or every one; if there is neither, what `examine` gives."""
        found = self._findings((label, candidates), every_open=every_open)
        time_for_all = limited(self.options.timeout_s)
        while True:
            with time_for_all:
                if (finding := next(found, None)) is None:
                    return
            yield finding

    def examine(self, label: Label, fixed_roles: Mapping[str, str] | None = None) -> Finding:
        """Decide one label and keep what the verdict rests on; arguments as of `match`."""
        with limited(self.options.timeout_s):
            return next(self._findings((label, None), fixed_roles=fixed_roles))

    def relaxed(self, options: MatchOptions) -> Matcher:
        """The same matcher with options that differ in tolerance and patience only; the analysis is shared.

        Raises:
            DataError: option-invalid: the tolerance names what the scenario does not have.
        """
        # what may be swapped or decided once for many is what one scope compares
        alike = options.tolerance.for_scenario(self.scenario).same_scopes(self.options.tolerance)
        return Matcher(self.scenario, options, self.solver, self.plans if alike else None)

    def ask(self, items: Sequence[Sequence[Item]], doubt: Undecided | None = None) -> Outcome:
        """Decide groups together by the solver; the doubt is what the built-in one has left undecided."""
        return ask(items, self.options, self.solver, doubt)

    def _decided(
        self, labels: Sequence[LabelAndCandidates], lookups: MapLookups, reporter: Reporter | None,
        fixed_roles: Mapping[str, str], *, details: bool = True,
    ) -> Iterator[Verdict]:  # fmt: skip
        """The verdicts of labels: by first fit side by side, else each by a search of its own."""
        found: dict[int, Verdict] = {}
        time_for_all = limited(self.options.timeout_s * len(labels))
        with suppress(Exhausted), time_for_all, limited(self.options.timeout_s * len(labels) / 2):
            for fit, rows in self.plans.first_fits(labels, fixed_roles).items():
                for batch in fit.fill(rows, self.options, lookups):
                    found.update(self._verdicts.batch_verdicts(fit, batch, lookups if details else None))
        for number, label in enumerate(labels):
            verdict = found.get(number)
            if verdict is None:
                with time_for_all, limited(self.options.timeout_s):
                    verdict = next(self._findings(label, lookups, reporter, fixed_roles)).verdict
            yield verdict

    def _findings(
        self, task: LabelAndCandidates, lookups: MapLookups | None = None, reporter: Reporter | None = None,
        fixed_roles: Mapping[str, str] | None = None, *, every_open: bool = False,
    ) -> Iterator[Finding]:  # fmt: skip
        """Algorithm 1: the matches, then what is undecided; if there is neither, the one verdict that outweighs."""
        (label, candidates), reported, rest = task, 0, list[tuple[int, Finding]]()
        for ego in possible_egos(self.scenario, label, self.options):
            roles = prepare_label(self.scenario, label, ego, self.options, fixed_roles or {}, candidates)
            if isinstance(roles, Cause):
                rest.append((0, Finding(self._verdicts.without_candidates(label, ego, roles))))
                continue
            search = LabelSearch(self.scenario, self.options, roles, self.ask, reporter, lookups or MapLookups())
            ended: Exhausted | None = None
            try:
                for finding in correspondences(label, search, self.plans, self._verdicts, every_open=every_open):
                    reported += 1
                    if reported > self.options.correspondences:
                        raise Exhausted("budget", f"more than {self.options.correspondences:,} correspondences")
                    yield finding
            except Exhausted as error:
                ended = error
            weight, verdict = self._verdicts.weigh_failed_search(label, search, ended)
            rest.append((weight, Finding(verdict, search)))
            if reported > self.options.correspondences:
                break
        if not reported:
            # an unknown outweighs every no; among equals, what came furthest
            yield max(rest, key=lambda each: each[0], default=(0, Finding(self._verdicts.without_ego())))[1]
        else:
            yield from (finding for _, finding in rest if isinstance(finding.verdict, Unknown))
