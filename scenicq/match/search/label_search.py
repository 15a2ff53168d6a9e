"""One label with one of its label objects as the ego: the body of algorithm 1.

Conditions about one object and the ego leave each object its candidates; necessary conditions of pairs thin them out;
the search then finds correspondences that satisfy the groups about several objects.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TypeAlias, cast

from scenicq.budget import Exhausted
from scenicq.errors import CannotEvaluate
from scenicq.forest.groups import Constraint, Group
from scenicq.forest.scenario import Scenario
from scenicq.limits import LIMITS
from scenicq.match.decide.decomposition import search_decomposed
from scenicq.match.decide.solver_step import AskSolver
from scenicq.match.options import MatchOptions
from scenicq.match.problem.bipartite_matching import Slot
from scenicq.match.problem.candidates import LabelProblem
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.constraints import Signature
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import Outcome, Patience, Refuted, Satisfied, Search, Undecided
from scenicq.match.problem.symmetry import sort_interchangeable
from scenicq.match.search.arc_consistency import arc_consistent
from scenicq.match.search.backtracking import Consistency, Reporter, find_assignments
from scenicq.match.search.group_cache import POSTPONED, GroupCache, possible_outcome, rename_variables
from scenicq.match.search.group_plan import GroupPlan, MatchPlan

__all__ = ["Failure", "LabelSearch", "Solution"]


@dataclass(frozen=True, slots=True)
class Solution:
    """A correspondence that satisfies all groups.

    Attributes:
        assignment: The number of the label object of each object of the scenario, by its index.
        outcomes: How each group was satisfied.
    """

    assignment: Mapping[int, int]
    outcomes: tuple[tuple[GroupPlan, Satisfied], ...]


@dataclass(frozen=True, slots=True)
class Failure:
    """What excluded a partial correspondence, or left it open.

    Attributes:
        depth: How far the correspondence had come.
        group: The group that was not satisfied.
        outcome: What was found of it.
        assignment: The partial correspondence.
    """

    depth: int
    group: Group
    outcome: Refuted | Undecided
    assignment: Mapping[int, int]

    @property
    def constraint(self) -> Constraint:
        """The constraint to blame."""
        return self.outcome.constraint


_Found: TypeAlias = Iterator[tuple[MatchPlan, Solution]]
_Judged: TypeAlias = tuple[list[Slot], set[tuple[int, int]] | None]
"""Objects with their candidates, and which of these are undecided; None in place of the latter where the ego is."""


@dataclass(eq=False)
class LabelSearch:
    """The search for correspondences of one label.

    Attributes:
        scenario: The scenario.
        options: The options.
        problem: The label and who may play whom.
        ask: The solver.
        reporter: Watches the search.
        lookups: What is known of the map.
        failure: What excluded the correspondence that came furthest.
        undecided: What kept a correspondence that was not excluded from being a match, where one is enough.
    """

    scenario: Scenario
    options: MatchOptions
    problem: LabelProblem
    ask: AskSolver
    reporter: Reporter | None = None
    lookups: MapLookups = field(default_factory=MapLookups)
    failure: Failure | None = None
    undecided: Failure | None = None
    _open: bool = field(default=False, repr=False)
    _asked: list[tuple[MatchPlan, _Judged | None, Mapping[int, int]]] = field(
        default_factory=list["tuple[MatchPlan, _Judged | None, Mapping[int, int]]"], repr=False
    )
    _left: dict[MatchPlan, list[Failure]] = field(default_factory=dict["MatchPlan", "list[Failure]"], repr=False)
    _orders: set[frozenset[tuple[int, int]]] = field(default_factory=set[frozenset[tuple[int, int]]], repr=False)
    _decisions: GroupCache = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Begin with nothing decided."""
        self._decisions = GroupCache(self.options, self.problem, self.ask, self.lookups)

    def solutions(
        self, plan_of: Callable[[Signature], MatchPlan], relevant: tuple[frozenset[str], ...], twins: Mapping[int, int]
    ) -> Iterator[tuple[MatchPlan, Solution]]:
        """Every correspondence that matches, the nearest first, interchangeable objects in one order.

        Role by role in the order of the program, label objects come in the order of their ranks, whatever is observed
        of them; only what takes long comes last.

        Args:
            plan_of: Gives the scenario's groups for what is observed of candidates.
            relevant: For each object, the properties for which it matters whether they are observed.
            twins: Objects that are interchangeable in every label: for each, an earlier one.

        Raises:
            Exhausted: The search takes more steps than it may.
        """
        # what has not begun stands where it can begin at the earliest
        waiting: list[tuple[tuple[int, ...], int, tuple[MatchPlan, Solution] | None, _Found]] = []
        ended: Exhausted | None = None
        try:
            for number, (signature, candidates) in enumerate(self.problem.signatures(relevant)):
                first = {index: numbers[0] for index, numbers in candidates.items()}
                found = self._solutions(plan_of, signature, candidates, twins)
                waiting.append((self._place(first), number, None, found))
        except Exhausted as error:
            ended = error
        heapq.heapify(waiting)
        while waiting:
            _, number, solution, found = heapq.heappop(waiting)
            if solution is not None and self._is_new(solution[1].assignment, twins):
                yield solution
            try:
                following = next(found, None)
            except Exhausted as error:
                ended, following = ended or error, None
            if following is not None:
                heapq.heappush(waiting, (self._place(following[1].assignment), number, following, found))
        if ended is not None:
            raise ended

    def _place(self, assignment: Mapping[int, int]) -> tuple[int, ...]:
        """Where a correspondence stands among others: label objects by role in the order of the program."""
        ranks, ego = self.problem.ranks, self.scenario.ego
        return tuple(ranks[number] for index, number in sorted(assignment.items()) if index != ego)

    def _solutions(
        self, plan_of: Callable[[Signature], MatchPlan], signature: Signature,
        candidates: Mapping[int, tuple[int, ...]], twins: Mapping[int, int],
    ) -> _Found:  # fmt: skip
        """The solutions of one signature, some perhaps more than once; see `solutions`."""
        plan = plan_of(signature)
        monolithic = self.options.method == "monolithic"
        judged: _Judged | None = None
        # what is cheap may settle a label before what takes long is looked at
        for patience in Patience if self.options.method == "auto" else (Patience.ALL,):
            self._decisions.patience = patience
            judged = None if monolithic else self._slots(plan, candidates)
            found = self._monolithic(plan, candidates) if monolithic else self._modular(plan, judged)
            try:
                for solution in found:
                    self._decisions.patience = Patience.ALL
                    yield plan, solution
                    self._decisions.patience = patience
                if not self._decisions.has_postponed() or next(self._modular_open(plan, judged), None) is None:
                    break
            except Exhausted as error:
                if error.reason != "budget" or not self._decisions.has_postponed():
                    raise
        self._decisions.patience = Patience.ALL
        self._asked.append((plan, judged, twins))

    def open_ones(self) -> Iterator[tuple[MatchPlan, Failure]]:
        """Every correspondence that nothing excludes but something keeps from being a match, of what was asked for.

        All matches come before. Errors are those of `solutions`.
        """
        for plan, judged, twins in self._asked if self._open else ():
            monolithic = self.options.method == "monolithic"
            for failure in self._left.get(plan, ()) if monolithic else self._modular_open(plan, judged):
                if self._is_new(failure.assignment, twins):
                    yield plan, failure

    def _is_new(self, assignment: Mapping[int, int], twins: Mapping[int, int]) -> bool:
        """Whether a correspondence is told for the first time, in whatever order interchangeable objects are."""
        # objects of which a label tells more or less come in another order in another signature
        order = sort_interchangeable(assignment, twins)
        if order in self._orders:
            return False
        self._orders.add(order)
        return True

    # --- deciding groups

    def items(self, group: Group, assignment: Mapping[int, int]) -> list[Item]:
        """The constraints of a group given the label (algorithm 1, line 11).

        Raises:
            CannotEvaluate: Geometry cannot tell the value of an expression.
        """
        return self._decisions.items(group, assignment)

    def decide(self, plan: GroupPlan, assignment: Mapping[int, int]) -> Outcome:
        """Decide a group for the label objects in its roles, or remember what was decided for them."""
        return rename_variables(self._decisions.of(plan, assignment), plan.group)

    def _judge(self, plan: GroupPlan, assignment: Mapping[int, int], depth: int) -> Consistency:
        """Decide a group, and remember what failed furthest."""
        decided = self._decisions.of(plan, assignment)
        if isinstance(decided[1], Satisfied):
            return Consistency.YES
        if isinstance(decided[1], Undecided):
            self._open = self._open or decided[1].reason != POSTPONED
            return Consistency.UNKNOWN
        if self.failure is None or depth > self.failure.depth:
            self.failure = Failure(
                depth, plan.group, cast("Refuted", rename_variables(decided, plan.group)), dict(assignment)
            )
        return Consistency.NO

    def _fail(self, failure: Failure) -> None:
        if self.failure is None or failure.depth > self.failure.depth:
            self.failure = failure

    # --- the query paper's algorithm 1

    def _modular(self, plan: MatchPlan, judged: _Judged | None) -> Iterator[Solution]:
        if judged is not None and judged[1] is not None:
            ego = {self.scenario.ego: self.problem.ego}
            for assignment in self._in_order(plan, _without(judged[0], judged[1]), ego, accept_unknown=False):
                yield self._solution(plan, assignment)

    def _modular_open(self, plan: MatchPlan, judged: _Judged | None) -> Iterator[Failure]:
        if judged is not None:
            ego = {self.scenario.ego: self.problem.ego}
            for assignment in self._in_order(plan, judged[0], ego, accept_unknown=True):
                if (failure := self._first_open(plan, assignment)) is not None:
                    yield failure

    def _slots(self, plan: MatchPlan, candidates: Mapping[int, tuple[int, ...]]) -> _Judged | None:
        """Objects with their candidates; None where nobody is left."""
        ego = {self.scenario.ego: self.problem.ego}
        answers = [self._judge(group, ego, 1) for group in plan.ego_only]
        if Consistency.NO in answers:
            return None
        judged = self._filter(plan, {i: numbers for i, numbers in candidates.items() if i != self.scenario.ego}, ego)
        return (judged[0], None) if judged is not None and Consistency.UNKNOWN in answers else judged

    def _filter(
        self, plan: MatchPlan, wanted: Mapping[int, tuple[int, ...]], ego: Mapping[int, int]
    ) -> tuple[list[Slot], set[tuple[int, int]]] | None:
        """Candidates that pass the groups about them and the ego alone, and those for which some are undecided."""
        left = wanted
        # where closed forms decide one role, what comes furthest is told by them, as first fit does
        closed = len(wanted) <= 1 and all(group.closed_form for group in plan.groups)
        if self.options.method == "auto" and not closed:
            left, failed = arc_consistent(plan, wanted, self.problem, self.scenario.ego, self.options.tolerance)
            if failed is not None:
                self._explain_thinning(*failed, wanted, ego)
                return None
        slots: list[Slot] = []
        undecided: set[tuple[int, int]] = set()
        known: dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[tuple[int, ...], tuple[int, ...]]] = {}
        for index, numbers in left.items():
            groups = plan.unary.get(index, ())
            # of objects about which the same is asked one is enough
            key = tuple([group.kind for group in groups]), numbers
            if key not in known:
                answers = [(number, self._passes(groups, {**ego, index: number})) for number in numbers]
                known[key] = (
                    tuple([number for number, answer in answers if answer is not Consistency.NO]),
                    tuple([number for number, answer in answers if answer is Consistency.UNKNOWN]),
                )
            kept, open_ones = known[key]
            if not kept:
                return None
            undecided.update((index, number) for number in open_ones)
            slots.append(Slot(index, kept))
        return slots, undecided

    def _explain_thinning(
        self, index: int, blamed: GroupPlan, candidates: Mapping[int, tuple[int, ...]], ego: Mapping[int, int]
    ) -> None:
        """Note why an object has no candidate left; for the wording the first one is looked at without a solver."""
        if len(blamed.roles) > 1:
            outcome = Refuted(blamed.group.constraints[0], "no pair of label objects comes close")
            self._fail(Failure(9, blamed.group, outcome, ego))
            return
        assignment = {**ego, index: candidates[index][0]}
        try:
            steps = search_decomposed(self.items(blamed.group, assignment), self.options.tolerance)
            found = Search(steps).within(Patience.LITTLE)
        except CannotEvaluate:
            found = None
        outcome = found if isinstance(found, Refuted) else Refuted(blamed.group.constraints[0])
        self._fail(Failure(2, blamed.group, outcome, assignment))

    def _passes(self, groups: Sequence[GroupPlan], assignment: Mapping[int, int]) -> Consistency:
        answer = Consistency.YES
        for depth, group in enumerate(groups):
            one = self._judge(group, assignment, 2 + depth)
            if one is Consistency.NO:
                return one
            answer = one if one is Consistency.UNKNOWN else answer
        return answer

    def _in_order(
        self, plan: MatchPlan, slots: list[Slot], ego: Mapping[int, int], *, accept_unknown: bool
    ) -> Iterator[dict[int, int]]:
        """Correspondences of which no group fails, each once, in the order of objects and of their candidates.

        In two stages: few objects are searched for in the order of the program. Where that takes more than a few steps,
        or there are many objects, the most constrained ones come first, again and again among what comes before what
        was found (`_first`), and then among what comes after it.
        """
        slots = sorted(slots, key=lambda slot: slot.name)
        options = {slot.name: slot.candidates for slot in slots}
        twins = {one: other for one, other in plan.twins.items() if options[one] == options[other]}

        def search(space: list[Slot], *, budget: int | None = None, in_order: bool = False) -> Iterator[dict[int, int]]:
            return self._search(
                plan, space, ego, twins, accept_unknown=accept_unknown, budget=budget, in_order=in_order
            )

        spaces = [slots]
        if len(slots) <= LIMITS.ordered_slots:
            last: dict[int, int] | None = None
            try:
                for last in search(slots, budget=LIMITS.ordered_steps, in_order=True):
                    yield last
                return
            except Exhausted as error:
                if error.reason != "budget":
                    raise
                spaces = spaces if last is None else _behind(slots, last)
        while spaces:
            space = spaces.pop()
            found = _first(space, search)
            if found is not None:
                yield found
                spaces += _behind(space, found)

    def _search(
        self,
        plan: MatchPlan,
        slots: list[Slot],
        ego: Mapping[int, int],
        twins: Mapping[int, int],
        *,
        accept_unknown: bool,
        budget: int | None = None,
        in_order: bool = False,
    ) -> Iterator[dict[int, int]]:
        """Correspondences of which no group fails.

        Args:
            plan: The groups.
            slots: The objects with their candidates.
            ego: Number of the label object that plays the ego.
            twins: For an object, an earlier one that is interchangeable with it.
            accept_unknown: Whether groups may be undecided.
            budget: Steps; what the options say if not given.
            in_order: Whether objects are assigned in the order of the program.

        Raises:
            Exhausted: The budget is used up.
        """
        due: dict[int, list[tuple[GroupPlan, frozenset[int]]]] = {}
        parts: dict[int, list[tuple[int, GroupPlan, frozenset[int]]]] = {}
        refuted: set[int] = set()
        if self.options.method == "auto":
            for group in plan.joint:
                for part in group.parts:
                    for index in part.roles:
                        parts.setdefault(index, []).append((group.kind, part, frozenset(part.roles)))
        for group in plan.joint:
            for index in group.roles:
                due.setdefault(index, []).append((group, frozenset(group.roles)))

        def check(slot: int, assignment: Mapping[int, int]) -> tuple[Consistency, frozenset[int]]:
            for whole, part, roles in parts.get(slot, ()):
                ready = whole in refuted and roles <= assignment.keys()
                if ready and self._judge(part, assignment, 10 + len(assignment)) is Consistency.NO:
                    return Consistency.NO, roles
            for group, roles in due.get(slot, ()):
                if roles <= assignment.keys():
                    answer = self._judge(group, assignment, 10 + len(assignment))
                    if answer is Consistency.NO:
                        # from now on its parts are looked at first
                        refuted.add(group.kind)
                        return answer, roles
                    if answer is Consistency.UNKNOWN and not accept_unknown:
                        return Consistency.NO, roles
            return Consistency.YES, frozenset()

        return find_assignments(
            slots,
            check,
            fixed=ego,
            twins=twins,
            links=plan.links,
            ranks=self.problem.ranks,
            budget=self.options.budget if budget is None else min(budget, self.options.budget),
            reporter=self.reporter,
            in_order=in_order,
        )

    def _solution(self, plan: MatchPlan, assignment: Mapping[int, int]) -> Solution:
        outcomes = [(group, self.decide(group, assignment)) for group in plan.groups]
        return Solution(assignment, tuple((group, found) for group, found in outcomes if isinstance(found, Satisfied)))

    def _first_open(self, plan: MatchPlan, assignment: Mapping[int, int]) -> Failure | None:
        for group in plan.groups:
            outcome = self.decide(group, assignment)
            if isinstance(outcome, Undecided):
                return Failure(0, group.group, outcome, assignment)
        return None

    # --- the query paper's baseline (section 5.1): one formula for all features of each correspondence

    def _monolithic(self, plan: MatchPlan, candidates: Mapping[int, tuple[int, ...]]) -> Iterator[Solution]:
        ego = {self.scenario.ego: self.problem.ego}
        slots = [Slot(index, options) for index, options in candidates.items() if index != self.scenario.ego]
        ranks = self.problem.ranks
        for assignment in find_assignments(
            slots, _accept, fixed=ego, ranks=ranks, budget=self.options.budget, in_order=True
        ):
            outcome = self._together(plan, assignment)
            if isinstance(outcome, Satisfied):
                yield Solution(assignment, tuple((group, outcome) for group in plan.groups))
                continue
            group = next(each.group for each in plan.groups if outcome.constraint in _all_of(each.group))
            failure = Failure(1, group, outcome, assignment)
            if isinstance(outcome, Refuted):
                self._fail(failure)
                continue
            self._open = True
            mine = self._left.setdefault(plan, [])
            # a caller takes no more of them
            if len(mine) <= self.options.correspondences:
                mine.append(failure)

    def _together(self, plan: MatchPlan, assignment: Mapping[int, int]) -> Outcome:
        if not plan.groups:
            return Satisfied({})
        try:
            outcome = self.ask([self.items(each.group, assignment) for each in plan.groups])
            groups = [each.group for each in plan.groups]
            doubtful = [group for group in groups if group.doubtful or self._decisions.has_doubts(group, assignment)]
            if doubtful and isinstance(outcome, Satisfied):
                items = [self._decisions.items(group.certain_group, assignment, certain=True) for group in groups]
                outcome = possible_outcome(doubtful[0], self.ask(items))
            return outcome
        except CannotEvaluate as error:
            return Undecided(plan.groups[0].group.constraints[0], f"unsupported: {error}")


def _all_of(group: Group) -> tuple[Constraint, ...]:
    """What may be to blame where a group is not satisfied."""
    return (*group.constraints, *group.doubtful, *group.certain)


def _without(slots: list[Slot], undecided: set[tuple[int, int]]) -> list[Slot]:
    """The slots without undecided candidates."""
    return [Slot(s.name, tuple(c for c in s.candidates if (s.name, c) not in undecided)) for s in slots]


def _first(slots: list[Slot], search: Callable[..., Iterator[dict[int, int]]]) -> dict[int, int] | None:
    """The first assignment in order; where that takes long, one of them.

    Args:
        slots: In order.
        search: Finds assignments of some slots, within a budget.
    """
    found = next(search(slots), None)
    if found is None:
        return None
    with suppress(Exhausted):
        for place, slot in enumerate(slots):
            while earlier := slot.candidates[: slot.candidates.index(found[slot.name])]:
                space = [*_pinned(slots[:place], found), Slot(slot.name, earlier), *slots[place + 1 :]]
                nearer = next(search(space, budget=LIMITS.nearer_steps), None)
                if nearer is None:
                    break
                found = nearer
    return found


def _behind(slots: list[Slot], found: Mapping[int, int]) -> list[list[Slot]]:
    """The slots in which there is what comes after an assignment in order, what comes next at the end."""
    spaces: list[list[Slot]] = []
    for place, slot in enumerate(slots):
        later = slot.candidates[slot.candidates.index(found[slot.name]) + 1 :]
        if later:
            spaces.append([*_pinned(slots[:place], found), Slot(slot.name, later), *slots[place + 1 :]])
    return spaces


def _pinned(slots: list[Slot], found: Mapping[int, int]) -> list[Slot]:
    """Slots with the candidates alone that they have in an assignment."""
    return [Slot(slot.name, (found[slot.name],)) for slot in slots]


def _accept(slot: int, assignment: Mapping[int, int]) -> tuple[Consistency, frozenset[int]]:
    return Consistency.YES, frozenset()
