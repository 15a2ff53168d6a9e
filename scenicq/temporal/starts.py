"""The labels of a block that match the initial scene, as far as arrays can tell: all candidates side by side.

Plain requirements on what is observed are decided first (`temporal.atoms`); then the closed forms of what is left, as
`match.search.first_fit` decides them. Whatever is not clear, or has no closed form, is left to the matcher: this is a
way to be fast, not another meaning.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.forest.groups import PARAMS, Condition
from scenicq.forest.nodes import Value
from scenicq.forest.scenario import Requirement
from scenicq.forest.walk import features, leaves
from scenicq.limits import LIMITS
from scenicq.match.decide.closed_form import ClosedForm
from scenicq.match.decide.range_forms import Columns, FloatColumn, Lookup
from scenicq.match.matcher import Matcher
from scenicq.match.problem.constraints import Signature, describe_constraint, relevant_properties
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.problem.symmetry import classes_of_twins
from scenicq.match.search.group_plan import MatchPlan
from scenicq.match.search.plan_cache import PlanCache
from scenicq.number_ranges import expand_ranges
from scenicq.store.track_block import TrackBlock
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.outcomes import Outcome
from scenicq.temporal.presence import group_by_observed, observed_properties
from scenicq.temporal.samples import WITH_COLUMNS, BoundSamples
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["RoleCandidates", "StartMatchers", "StartSearch", "Starts", "narrow_candidates"]

Members = NDArray[np.int64]
_AT_ONCE = 16_384
_SCALARS = frozenset({"heading", "width", "length", "height"})


@dataclass(frozen=True, slots=True)
class RoleCandidates:
    """The candidates of each role in the labels of a block.

    Attributes:
        labels: The labels in question, in order.
        members: Label objects that may play a role, in order.
        may: By object of the scenario but the ego, whether each may play it.
    """

    labels: Members
    members: Members
    may: Mapping[int, NDArray[np.bool_]]


@dataclass(frozen=True, slots=True)
class Starts:
    """What the arrays tell of labels.

    Attributes:
        members: For each role, its member at each start.
        left: The labels that the matcher must decide.
        sure: Whether the plain requirements on what is observed are known to hold, for each of these labels.
        failed: What the labels that are excluded failed at.
    """

    members: Mapping[int, Members]
    left: RoleCandidates
    sure: NDArray[np.bool_]
    failed: Counter[str]


@dataclass(eq=False)
class _Derived(PlanCache):
    """The plans of a scenario that is made from another one: what told objects apart there still does.

    Attributes:
        whole: The plans of the other one.
    """

    whole: PlanCache = field(kw_only=True)

    def __post_init__(self) -> None:
        """What matters of a label is what mattered before."""
        self.relevant = self.whole.relevant

    @property
    def always_twins(self) -> Mapping[int, int]:
        """Those of the other scenario."""
        return self.whole.always_twins

    def plan(self, signature: Signature) -> MatchPlan:
        """The groups for a signature."""
        if signature not in self.plans:
            self.plans[signature] = replace(super().plan(signature), twins=self.whole.plan(signature).twins)
        return self.plans[signature]


@dataclass(eq=False)
class StartMatchers:
    """What decides single labels where they are starts, with each outcome of the choices over time.

    Interchangeable objects take one order in all labels.

    Attributes:
        matcher: Decides labels of the scenario in which the choices are open.
        outcomes: The outcomes.
        whole: Decides starts of that scenario.
    """

    matcher: Matcher
    outcomes: Sequence[Outcome]
    whole: Matcher = field(init=False)
    _made: dict[int, Matcher] = field(init=False, default_factory=dict[int, Matcher])

    def __post_init__(self) -> None:
        """Make ready what all outcomes share."""
        matcher = self.matcher
        plans = PlanCache(matcher.scenario, matcher.options, one_order=True)
        self.whole = Matcher(matcher.scenario, matcher.options, matcher.solver, plans)

    def __getitem__(self, outcome: int) -> Matcher:
        """What decides starts with an outcome, by its number."""
        told = self.outcomes[outcome]
        if told.same_start:
            return self.whole
        if outcome not in self._made:
            scenario = prepare_scenario(told.scenario)
            derived = _Derived(scenario, self.matcher.options, whole=self.whole.plans)
            self._made[outcome] = Matcher(scenario, self.matcher.options, self.matcher.solver, derived)
        return self._made[outcome]


@dataclass(eq=False)
class StartSearch:
    """A scenario made ready.

    Attributes:
        matcher: Decides single labels.
        rest: Decides those whose plain requirements on what is observed are known to hold.
        plain: These requirements, by the one object that they are about beside the ego; by the ego if there is none.
    """

    matcher: Matcher
    rest: Matcher = field(init=False)
    plain: dict[int, list[Requirement]] = field(init=False, default_factory=dict[int, list[Requirement]])

    def __post_init__(self) -> None:
        """Choose what is decided in arrays."""
        scenario, options = self.matcher.scenario, self.matcher.options
        self.rest = self.matcher
        self._arrays = options.ego == "label" and options.method == "auto" and not options.exact
        if options.ego == "label" and options.method == "auto":
            for requirement in scenario.requirements:
                about = {index for index, _ in features(requirement.condition)}
                roles = about - {scenario.ego}
                noisy = any(scenario.objects[index].mutated for index in about if index != PARAMS)
                if requirement.built_in is not None or PARAMS in about or len(roles) > 1 or noisy:
                    continue
                if not leaves(requirement.condition):
                    self.plain.setdefault(min(roles, default=scenario.ego), []).append(requirement)
        if self.plain:
            mine = {id(requirement) for found in self.plain.values() for requirement in found}
            left = tuple(each for each in scenario.requirements if id(each) not in mine)
            left_over = replace(scenario, requirements=left)
            plans = _Derived(left_over, options, whole=self.matcher.plans)
            self.rest = Matcher(left_over, options, self.matcher.solver, plans)
        compared = {name for name, given in scenario.params.items() if given.explicit}
        # parameters are the labels' own, and not in arrays
        self._arrays = self._arrays and not compared - options.ignore_params
        self._relevant = relevant_properties(scenario, options)

    def decide(self, block: TrackBlock, candidates: RoleCandidates) -> Starts:
        """Find the labels that are starts.

        Args:
            block: The recordings.
            candidates: The labels, each with an ego, and who may play whom.
        """
        scenario = self.matcher.scenario
        label_of = block.label_of[candidates.members]
        place = np.searchsorted(candidates.labels, label_of)
        n = len(candidates.labels)
        failed: Counter[str] = Counter()
        out, sure = np.zeros(n, np.bool_), np.ones(n, np.bool_)
        may = dict(candidates.may)
        for role, requirements in self.plain.items():
            chosen = np.empty(0, np.int64)
            if role == scenario.ego:
                members, where = {role: block.ego(candidates.labels)}, np.arange(n)
            else:
                chosen = np.flatnonzero(may[role] & ~out[place])
                where = place[chosen]
                members = {scenario.ego: block.ego(label_of[chosen]), role: candidates.members[chosen]}
            holds, first_broken = self.plain_truth(
                BoundSamples(block, members, len(where), classes=self.matcher.options.classes), requirements
            )
            kept = np.zeros(n, np.bool_)
            kept[where[holds > FALSE]] = True
            sure[where[holds == UNKNOWN]] = False
            if role != scenario.ego:
                still = np.zeros(len(candidates.members), np.bool_)
                still[chosen[holds > FALSE]] = True
                may[role] = still
            # what a label is excluded by is what its first candidate fails at
            gone = np.flatnonzero(~kept & ~out)
            first = np.full(n, -1)
            first[where[::-1]] = first_broken[::-1]
            for number, requirement in enumerate(requirements):
                mine = gone[first[gone] == number]
                if len(mine):
                    condition = Condition(requirement, requirement.condition)
                    failed[describe_constraint(scenario, condition)] += len(mine)
                    out[mine] = True
        candidates = RoleCandidates(candidates.labels, candidates.members, may)
        starts, decided = self._correspondences(block, candidates, np.flatnonzero(sure & ~out))
        left = ~out
        left[decided] = False
        return Starts(starts, narrow_candidates(candidates, left, place), sure[left], failed)

    def plain_truth(self, places: BoundSamples, requirements: Sequence[Requirement]) -> tuple[Truth, NDArray[np.int64]]:
        """Whether all requirements hold at each place, and the number of the first that does not, -1 if none."""
        holds = np.full(len(places), TRUE)
        broken = np.full(len(places), -1)
        for number, requirement in enumerate(requirements):
            # what one requirement excludes is not asked about the next
            left = np.flatnonzero(holds > FALSE)
            asked = places if len(left) == len(places) else places.at(left)
            truth = np.full(len(left), UNKNOWN)
            for chosen in group_by_observed(asked, requirement.condition):
                columns = AtomColumns(self.matcher.scenario, asked.at(chosen))
                expanded = columns.expanded(requirement.condition)
                # what is random where the label does not tell is the matcher's
                if not leaves(expanded):
                    truth[chosen] = columns.truth_of(expanded)
            broken[left[truth == FALSE]] = number
            holds[left] = np.minimum(holds[left], truth)
        return holds, broken

    # --- what is left, in closed form

    def _correspondences(
        self, block: TrackBlock, candidates: RoleCandidates, labels: NDArray[np.int64]
    ) -> tuple[dict[int, Members], NDArray[np.int64]]:
        """The starts that some labels make, and the labels that are decided; labels by their place among them."""
        none = {owner.index: np.empty(0, np.int64) for owner in self.matcher.scenario.objects}
        if not self._arrays or not len(labels) or self._odd(block):
            return none, np.empty(0, np.int64)
        where, members = self._tuples(block, candidates, labels)
        holds, fails, members = self.in_closed_form(block, members, len(where))
        unclear = np.unique(where[~holds & ~fails])
        clear = np.flatnonzero(holds & ~np.isin(where, unclear))
        decided = np.unique(where[clear])
        # interchangeable objects are there in each order
        indices = list(members)
        _, once = np.unique(np.column_stack([members[index][clear] for index in indices]), axis=0, return_index=True)
        clear = clear[np.sort(once)]
        return {index: members[index][clear] for index in indices}, decided

    @staticmethod
    def _odd(block: TrackBlock) -> bool:
        """Whether labels say beside the columns what has a column."""
        return any(name in WITH_COLUMNS for answer in block.said()[1] for name in answer)

    def _tuples(
        self, block: TrackBlock, candidates: RoleCandidates, labels: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], dict[int, Members]]:
        """Every choice of label objects of some labels that are not too many."""
        scenario, options = self.matcher.scenario, self.matcher.options
        of_label = np.searchsorted(candidates.labels, block.label_of[candidates.members])
        wanted = np.zeros(len(candidates.labels), np.bool_)
        wanted[labels] = True
        egos = block.ego(candidates.labels)
        roles: dict[int, NDArray[np.int64]] = {}
        count = np.ones(len(candidates.labels))
        for index, may in candidates.may.items():
            chosen = np.flatnonzero(may & wanted[of_label])
            if options.radius is not None:
                x, y = block.numbers("x"), block.numbers("y")
                mine, ego = candidates.members[chosen], egos[of_label[chosen]]
                near = (x[mine] - x[ego]) ** 2 + (y[mine] - y[ego]) ** 2 <= options.radius * options.radius
                chosen = chosen[near]
            roles[index] = chosen
            count *= np.bincount(of_label[chosen], minlength=len(candidates.labels))
        where = labels[(count[labels] <= LIMITS.start_tuples) & (count[labels] > 0)]
        members: dict[int, Members] = {}
        for index, chosen in roles.items():
            # each choice so far with each label object of its label
            sizes = np.bincount(of_label[chosen], minlength=len(candidates.labels))
            firsts = np.cumsum(sizes) - sizes
            repeats = sizes[where]
            picked = candidates.members[chosen[expand_ranges(firsts[where], repeats)]]
            members = {other: np.repeat(mine, repeats) for other, mine in members.items()}
            where = np.repeat(where, repeats)
            distinct = np.ones(len(where), np.bool_)
            for mine in members.values():
                distinct &= mine != picked
            where = where[distinct]
            members = {other: mine[distinct] for other, mine in members.items()} | {index: picked[distinct]}
        return where, {scenario.ego: egos[where], **members}

    def in_closed_form(
        self, block: TrackBlock, members: Mapping[int, Members], size: int
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_], dict[int, Members]]:
        """Whether each choice of label objects surely matches, and whether it surely does not.

        Interchangeable objects are given back in the order of their tracks.
        """
        holds, fails = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
        places, ordered = BoundSamples(block, members, size), {index: mine.copy() for index, mine in members.items()}
        for signature, chosen in observed_properties(places, self._relevant):
            plan = self.rest.plans.plan((*signature, frozenset()))
            forms = [group.closed_form for group in plan.groups if group.closed_form is not None]
            if len(forms) < len(plan.groups) or not _in_order(block, plan, ordered, chosen):
                continue
            for first in range(0, len(chosen), _AT_ONCE):
                look()
                some = chosen[first : first + _AT_ONCE]
                holds[some], fails[some] = self._decided(places.at(some), forms)
        return holds, fails, ordered

    def _decided(
        self, places: BoundSamples, forms: Iterable[ClosedForm]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        size = len(places)
        holds, fails = np.ones(size, np.bool_), np.zeros(size, np.bool_)
        columns = Columns(size, lambda index, name: _column(places, index, name))
        lookups = MapLookups()
        for form in forms:
            if form.index >= 0 and (form.field is not None or form.regions):
                x, y = places.observed(form.index, "position") or ((), ())
                xy = list(zip(np.asarray(x).tolist(), np.asarray(y).tolist(), strict=True))
                lookups.look_up(() if form.field is None else (form.field,), form.regions, xy)
            found = form.evaluate_many(lambda number: _getter(places, number), columns, self.rest.options, lookups)
            holds &= np.asarray(found.holds, np.bool_)
            fails |= np.asarray(found.fails, np.bool_)
        return holds, fails


def _in_order(block: TrackBlock, plan: MatchPlan, members: dict[int, Members], chosen: NDArray[np.int64]) -> bool:
    """Put interchangeable objects in the order of their tracks; false where some have none."""
    for twins in classes_of_twins(plan.twins):
        mine = np.column_stack([members[index][chosen] for index in sorted(twins)])
        if not block.tracked(mine.ravel()):
            return False
        order = np.argsort(block.ranks(mine.ravel()).reshape(mine.shape), axis=1, kind="stable")
        for index, column in zip(sorted(twins), np.take_along_axis(mine, order, axis=1).T, strict=True):
            members[index][chosen] = column
    return True


def narrow_candidates(candidates: RoleCandidates, kept: NDArray[np.bool_], place: NDArray[np.int64]) -> RoleCandidates:
    """The candidates of some of its labels; `place` is the label of each of its members."""
    mine = kept[place]
    return RoleCandidates(
        candidates.labels[kept], candidates.members[mine], {index: may[mine] for index, may in candidates.may.items()}
    )


def _column(places: BoundSamples, index: int, name: str) -> FloatColumn | tuple[FloatColumn, FloatColumn]:
    """The values of a property as closed forms read them."""
    if name != "position" and name not in _SCALARS:
        raise CannotEvaluate("what a closed form does not say")
    found = places.observed(index, name)
    if not isinstance(found, tuple):
        raise CannotEvaluate("what a closed form does not say")
    return (found[0], found[1]) if len(found) == 2 else found[0]


def _getter(places: BoundSamples, number: int) -> Lookup:
    """The observed values of one choice of label objects."""

    def get(index: int, name: str) -> Value:
        found = places.at(np.array([number])).observed(index, name)
        if isinstance(found, tuple):
            return (float(found[0][0]), float(found[1][0])) if len(found) == 2 else float(found[0][0])
        if found is None:
            raise CannotEvaluate("what a closed form does not say")
        value = found[0]
        return value if isinstance(value, str | bool) else float(value)  # type: ignore[arg-type]

    return get
