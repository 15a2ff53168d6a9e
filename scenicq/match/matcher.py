"""Algorithm 1 of the query paper: does a label match a scenario?

    for each way to give the scenario's objects distinct label objects (search):
        for each group of jointly dependent features, in dependency order (planning):
            put in what the label observes and decide whether the rest can be satisfied (ladder, else a solver)

`Matcher.match` is a pure function of scenario, label and options, but for the solver it may ask. Unknown never becomes
no: a group that nothing decides leaves the label undecided unless another correspondence matches.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

from scenicq.budget import TimeIsUp, limited
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Leaf
from scenicq.forest.scenario import Scenario
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.decide.closed_form import ClosedForm
from scenicq.match.decide.solver_step import ask
from scenicq.match.options import Exhausted, MatchOptions
from scenicq.match.problem.candidates import Candidates, candidates_of, egos, find_candidates
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.constraints import Signature, describe_constraint
from scenicq.match.problem.map_lookups import Disc, MapLookups
from scenicq.match.problem.outcome import Outcome, Refuted
from scenicq.match.problem.preprocess import ready
from scenicq.match.search.backtracking import Reporter
from scenicq.match.search.columnar_first_fit import Assignment, firsts, together
from scenicq.match.search.first_fit import Casting, FirstFit, first_fit_of, signature_of
from scenicq.match.search.group_plan import MatchPlan, make_plan, relevant_properties
from scenicq.match.search.label_search import Failure, LabelSearch, Solution
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.smt.answer import Solver
from scenicq.store.labels import Label

__all__ = ["Finding", "Matcher"]


_SEARCH = "correspondence search"


@dataclass(frozen=True, slots=True)
class Finding:
    """A verdict with what it rests on, for explanations.

    Attributes:
        verdict: The verdict.
        attempt: The search that led to it; None if there was no cast to search with.
        plan: The scenario's groups for what was observed; None without a match.
        assignment: The correspondence, numbers of things by index of the object; partial without a match.
    """

    verdict: Verdict
    attempt: LabelSearch | None = None
    plan: MatchPlan | None = None
    assignment: Mapping[int, int] = field(default_factory=dict[int, int])


@dataclass(eq=False)
class Matcher:
    """A scenario made ready to be matched against labels of one map.

    Attributes:
        scenario: The scenario, made ready to be matched.
        options: The options.
        solver: Decides what the ladder does not; None makes those groups unknown.
    """

    scenario: Scenario
    options: MatchOptions = MatchOptions()
    solver: Solver | None = None
    _plans: dict[Signature, MatchPlan] = field(default_factory=dict["Signature", "MatchPlan"], repr=False)
    _kinds: dict[Hashable, int] = field(default_factory=dict["Hashable", int], repr=False)
    _directs: dict[MatchPlan, FirstFit | None] = field(default_factory=dict["MatchPlan", "FirstFit | None"], repr=False)
    _places: dict[Leaf, str] = field(default_factory=dict["Leaf", "str"], repr=False)
    _relevant: tuple[frozenset[str], ...] = field(init=False, repr=False)
    _plain: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Rewrite the scenario, tie the tolerance to its objects, and find out what matters of a label."""
        self.scenario = ready(self.scenario)
        self.options = replace(self.options, tolerance=self.options.tolerance.for_scenario(self.scenario))
        self._relevant = relevant_properties(self.scenario, self.options)
        options = self.options
        self._plain = options.method == "auto" and not options.exact and options.ego == "label"

    def match(
        self,
        label: Label,
        reporter: Reporter | None = None,
        *,
        given: Mapping[str, str] | None = None,
        among: Candidates | None = None,
        places: MapLookups | None = None,
    ) -> Verdict:
        """Decide one label.

        Args:
            label: The label, of the map that the scenario was compiled for.
            reporter: Watches the correspondence search.
            given: Ids of label objects that are known to play objects, by the objects' names.
            among: What is known of who may play whom.
            places: What is known of places of the map; see `look_up`.
        """
        with limited(self.options.timeout_s):
            if reporter is None and not given:
                try:
                    found = self._direct(label, among, places or MapLookups())
                except TimeIsUp:
                    found = None
                if found is not None:
                    return found
            return next(self._findings(label, reporter, given or {}, among, places)).verdict

    def match_all(self, labels: Sequence[tuple[Label, Candidates | None]], places: MapLookups) -> Iterator[Verdict]:
        """Decide labels, each as `match` does; those that match in the first way that is tried are found together.

        Args:
            labels: Labels, each with what is known of who may play whom.
            places: What is known of places of the map; see `look_up`.
        """
        casts: dict[FirstFit, list[tuple[int, Assignment]]] = {}
        for place, (label, among) in enumerate(labels):
            if among is None or not self._plain or not label.has_ego:
                continue
            direct = self._direct_for(label, among)
            numbers = None if direct is None else firsts(direct, among)
            if direct is not None and numbers is not None:
                casts.setdefault(direct, []).append((place, Assignment(label, numbers, self._disc(label))))
        found: dict[int, Match] = {}
        for direct, mine in casts.items():
            decided = together(direct, [each for _, each in mine], self.options.tolerance, places)
            keys = self._keys(decided.variables)
            for (place, each), values in zip(mine, decided.witnesses, strict=True):
                if values is not None:
                    assignment = dict(zip(direct.order, each.numbers, strict=True))
                    witness = cast("dict[str, WitnessValue]", dict(zip(keys, values, strict=True)))
                    found[place] = Match(self._names(each.label, 0, assignment), witness)
        for place, (label, among) in enumerate(labels):
            yield found.get(place) or self.match(label, among=among, places=places)

    def _direct_for(self, label: Label, among: Candidates) -> FirstFit | None:
        """How a label of a plain query can be decided without a search, if it can."""
        signature = signature_of(label, self.scenario.ego, among, self._relevant)
        if signature is None:
            return None
        plan = self.plan(signature)
        if plan not in self._directs:
            self._directs[plan] = first_fit_of(plan, self.scenario)
        return self._directs[plan]

    def _disc(self, label: Label) -> Disc | None:
        radius = self.options.radius
        return None if radius is None else ((label.ego.x, label.ego.y), radius)

    def _direct(self, label: Label, among: Candidates | None, places: MapLookups) -> Match | NoMatch | None:
        """What is found without a search, if it is clear."""
        if not self._plain or not label.has_ego:
            return None
        options, ego = self.options, self.scenario.ego
        roles = candidates_of(self.scenario, label, 0, options, {}) if among is None else among
        direct = self._direct_for(label, roles)
        if direct is None:
            return None
        casting = Casting(direct, options, label, ego, roles, self._disc(label), places)
        found = casting.solve()
        if isinstance(found, Failure):
            # of roles that nothing is known of there may be too few candidates, which comes first
            if among is None or not (direct.words and casting.words):
                return None
            return NoMatch(self._cause(found), self._names(label, 0, found.assignment))
        return None if found is None else self._match(label, 0, found)

    def examine(self, label: Label) -> Finding:
        """Decide one label and keep what the verdict rests on."""
        with limited(self.options.timeout_s):
            return next(self._findings(label, None, {}))

    def findings(
        self, label: Label, *, among: Candidates | None = None, places: MapLookups | None = None
    ) -> Iterator[Finding]:
        """Every correspondence by which a label matches; of interchangeable objects, one order only.

        Then, or where there is none, what is not a match: one finding for each choice of the ego that leaves something
        undecided, and where nothing matches the one finding of `examine`.

        Args:
            label: The label.
            among: What is known of who may play whom.
            places: What is known of places of the map; see `look_up`.
        """
        found = self._findings(label, None, {}, among, places, rest_too=True)
        while True:
            with limited(self.options.timeout_s):
                finding = next(found, None)
            if finding is None:
                return
            yield finding

    def relaxed(self, options: MatchOptions) -> Matcher:
        """The same matcher with options that differ in tolerance and patience only; the analysis is shared.

        Raises:
            DataError: option-invalid: the tolerance names what the scenario does not have.
        """
        bound = options.tolerance.for_scenario(self.scenario)
        if not bound.same_scopes(self.options.tolerance):
            # what may be swapped or decided once for many is what one scope compares
            return Matcher(self.scenario, options, self.solver)
        return Matcher(self.scenario, options, self.solver, self._plans, self._kinds)

    def look_up(self, labels: Iterable[tuple[Label, Candidates | None]]) -> MapLookups:
        """What the map says of the places of labels, as far as earlier labels have shown that it matters.

        Args:
            labels: Labels, each with what is known of who may play whom.
        """
        asked: dict[int, list[ClosedForm]] = {}
        for plan in self._plans.values():
            for group in plan.groups:
                if group.quick is not None and group.quick.index >= 0:
                    asked.setdefault(group.quick.index, []).append(group.quick)
        where: dict[int, list[tuple[float, float]]] = {index: [] for index in asked}
        for label, among in labels:
            for index, found in where.items():
                if index == self.scenario.ego:
                    found.append((label.ego.x, label.ego.y))
                else:
                    numbers = range(1, len(label.objects) + 1) if among is None else among.get(index, ())
                    found += [(label.objects[number - 1].x, label.objects[number - 1].y) for number in numbers]
        places = MapLookups()
        fields: dict[RoadDirection, list[tuple[float, float]]] = {}
        for index, quicks in asked.items():
            for quick in quicks:
                if quick.field is not None:
                    fields.setdefault(quick.field, []).extend(where[index])
                if quick.region is not None:
                    places.look_up((), (quick.region,), where[index])
        for flow, positions in fields.items():
            places.look_up((flow,), (), positions)
        return places

    def matches(
        self,
        label: Label,
        *,
        given: Mapping[str, str] | None = None,
        among: Candidates | None = None,
        places: MapLookups | None = None,
    ) -> Iterator[Match]:
        """Every correspondence by which a label matches; of interchangeable objects, one order only.

        Stops early where the budget of the options is used up, or one takes too long to be found.

        Args:
            label: The label.
            given: As of `match`.
            among: As of `match`.
            places: As of `match`.
        """
        found = self._findings(label, None, given or {}, among, places)
        while True:
            with limited(self.options.timeout_s):
                finding = next(found, None)
            if finding is None:
                return
            if isinstance(finding.verdict, Match):
                yield finding.verdict

    def plan(self, signature: Signature) -> MatchPlan:
        """The groups for a signature, analysed once."""
        if signature not in self._plans:
            self._plans[signature] = make_plan(self.scenario, signature, self.options, self._kinds)
        return self._plans[signature]

    def ask(self, items: Sequence[Sequence[Item]]) -> Outcome:
        """Decide groups together by the solver."""
        return ask(items, self.options, self.solver)

    def _findings(
        self,
        label: Label,
        reporter: Reporter | None,
        given: Mapping[str, str],
        among: Candidates | None = None,
        places: MapLookups | None = None,
        *,
        rest_too: bool = False,
    ) -> Iterator[Finding]:
        """Matches, or else the one verdict that there is; after matches, what is undecided, if that is wanted, too."""
        matched = False
        rest: list[tuple[int, Finding]] = []
        for ego in egos(self.scenario, label, self.options):
            cast_ = find_candidates(self.scenario, label, ego, self.options, given, among)
            if isinstance(cast_, Cause):
                rest.append((0, Finding(NoMatch(cast_, self._names(label, ego, {})))))
                continue
            attempt = LabelSearch(self.scenario, self.options, cast_, self.ask, reporter, places or MapLookups())
            exhausted: Unknown | None = None
            try:
                for signature, candidates in cast_.signatures(self._relevant):
                    plan = self.plan(signature)
                    for solution in attempt.solutions(plan, candidates):
                        matched = True
                        yield Finding(self._match(label, ego, solution), attempt, plan, solution.assignment)
            except Exhausted:
                exhausted = Unknown("budget", Cause(_SEARCH, f"more than {self.options.budget:,} steps"))
            except TimeIsUp:
                exhausted = Unknown("timeout", Cause(_SEARCH, f"more than {self.options.timeout_s:g} s"))
            weight, verdict = self._rest(label, attempt, exhausted)
            rest.append((weight, Finding(verdict, attempt)))
        if not matched:
            # an unknown outweighs every no; among equals, what came furthest
            yield max(rest, key=lambda each: each[0], default=(0, Finding(NoMatch(self._without_ego()))))[1]
        elif rest_too:
            yield from (finding for _, finding in rest if isinstance(finding.verdict, Unknown))

    def _without_ego(self) -> Cause:
        thing = self.scenario.objects[self.scenario.ego]
        detail = "the source has no ego" if self.options.ego == "label" else f"no {thing.category}"
        return Cause(f"{thing.name}.class", detail, thing.span, (thing.index,))

    def _rest(self, label: Label, attempt: LabelSearch, exhausted: Unknown | None) -> tuple[int, Verdict]:
        """The verdict of an attempt without a match, and its weight."""
        ego, failure = attempt.cast.ego, attempt.failure
        if attempt.undecided is not None:
            found = attempt.undecided
            reason = "" if isinstance(found.outcome, Refuted) else found.outcome.reason
            return 2_000_000, Unknown(reason, self._cause(found), self._names(label, ego, found.assignment))
        if exhausted is not None:
            return 1_000_000, exhausted
        if failure is None:
            cause = Cause("correspondence", "no distinct label objects for all objects")
            return 0, NoMatch(cause, self._names(label, ego, {}))
        return failure.depth, NoMatch(self._cause(failure), self._names(label, ego, failure.assignment))

    def _cause(self, failure: Failure) -> Cause:
        constraint = failure.constraint
        about = (constraint.object,) if isinstance(constraint, Comparison) else constraint.requirement.objects
        detail = failure.outcome.detail if isinstance(failure.outcome, Refuted) else ""
        return Cause(describe_constraint(self.scenario, constraint), detail, constraint.span, about)

    def _names(self, label: Label, ego: int, assignment: Mapping[int, int]) -> dict[str, str]:
        things = (label.ego, *label.objects)
        shown = {self.scenario.ego: ego, **assignment}
        return {
            self.scenario.objects[index].name: "ego" if number == 0 else things[number].id
            for index, number in sorted(shown.items())
        }

    def _match(self, label: Label, ego: int, solution: Solution) -> Match:
        known = [
            (leaf, value)
            for group, outcome in solution.outcomes
            for leaf in group.group.variables
            if (value := outcome.values.get(leaf.identity)) is not None
        ]
        keys = self._keys([leaf for leaf, _ in known])
        witness = {key: cast("WitnessValue", value) for key, (_, value) in zip(keys, known, strict=True)}
        return Match(self._names(label, ego, solution.assignment), witness)

    def _keys(self, variables: Sequence[Leaf]) -> list[str]:
        """What a witness calls random variables: their places in the program, numbered where several share one."""
        keys: list[str] = []
        counts: dict[str, int] = {}
        for leaf in variables:
            place = self._places.get(leaf)
            if place is None:
                place = self._places[leaf] = leaf.span.mark if leaf.span else type(leaf).__name__
            counts[place] = counts.get(place, 0) + 1
            keys.append(place if counts[place] == 1 else f"{place}#{counts[place]}")
        return keys
