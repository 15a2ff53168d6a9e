"""Groups with random choices: their outcomes are searched as roles are, and what is left is decided without choices.

Each tree of choices is a slot whose candidates are its outcomes. Constraints on one slot alone leave it few of them (by
boxes, for all outcomes together); choices that several slots share must come out the same in all; then the search of
`backtracking` goes through what is left, fewest candidates first, and goes back to what is to blame. A look-up at a
hidden place is a choice, too: that the place has the element is one more constraint.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from scenicq.budget import Exhausted
from scenicq.forest import build
from scenicq.forest.groups import Constraint
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    CompareOp,
    Constant,
    Identity,
    Node,
    Value,
)
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.problem.bipartite_matching import Slot
from scenicq.match.problem.conditioned import Item, condition_items, fact, item_conjuncts, uses_far_field
from scenicq.match.problem.evaluation import ground_cause, holds
from scenicq.match.problem.outcome import Outcome, Patience, Refuted, Satisfied, Search, SearchSteps, Undecided
from scenicq.match.search.backtracking import Consistency, find_assignments
from scenicq.match.search.choice_problem import ChoiceProblem, ConstraintChoices
from scenicq.match.search.outcome_bounds import possible_outcomes
from scenicq.match.tolerance import Tolerance

__all__ = ["AtLast", "search_choices"]


_SEVERAL = 8
"""Combinations of outcomes from which on a witness is looked for over all of them, however cheap each is."""

_MANY_USES = 16
"""Uses of fields at hidden points from which on each is costly, so that two are enough."""

Decide = Callable[[list[Item]], SearchSteps]
"""Decides constraints that hold no choices."""


AtLast = Callable[[Sequence[Sequence[Item]]], SearchSteps]
"""Decides them where nothing else does."""


def search_choices(
    items: Sequence[Item], tolerance: Tolerance, decide: Decide, at_last: AtLast | None = None, depth: int = 0
) -> Generator[Patience, None, Outcome | None]:
    """Decide a group that random choices are part of; None if there are none.

    Args:
        items: The group's constraints, conditioned.
        tolerance: Per feature.
        decide: Decides what is left when all choices have come out.
        at_last: Decides it where that does not.
        depth: In how many other searches it is asked for.

    Raises:
        Exhausted: The time is up.
    """
    parts = [part for item in items for part in item_conjuncts(item)]
    try:
        found = [ConstraintChoices(item) for item in parts]
    except Exhausted as error:
        return Undecided.by(items[0][0], error)
    if not any(part.trees for part in found):
        return None
    if depth > LIMITS.choice_nesting:
        return Undecided.by(items[0][0], limit_exceeded("choice_nesting"))
    for part in found:
        if any(not tree.results for tree in part.trees.values()):
            return Refuted(part.item[0])
    for constraint, node, seen in parts:
        if isinstance(node, Constant) and not holds(constraint, node.value, seen, tolerance):
            return Refuted(constraint, ground_cause((constraint, node, seen)))
    return (yield from _ChoiceSearch(list(items), found, tolerance, decide, at_last, depth).steps())


class _ChoiceSearch:
    """The search for one group and one label."""

    def __init__(
        self,
        items: list[Item],
        parts: list[ConstraintChoices],
        tolerance: Tolerance,
        decide: Decide,
        at_last: AtLast | None,
        depth: int,
    ) -> None:
        self.patience = Patience.LITTLE
        self.items = items
        self.constraints = [constraint for constraint, _, _ in items]
        self.parts = parts
        self.tolerance = tolerance
        self.decide = decide
        self.at_last = at_last
        self.depth = depth
        self.blamed: tuple[int, Refuted] | None = None
        self.doubt: Undecided | None = None
        self.is_postponed = False
        self.known: dict[tuple[int, tuple[tuple[int, int], ...]], Search] = {}
        problem = ChoiceProblem(parts)
        self.domains = problem.domains
        self.slot_of = problem.slot_of
        self.columns = problem.columns
        self.components = problem.components

    def steps(self) -> SearchSteps:
        """Decide the group."""
        excluded = self._narrow()
        if excluded is not None:
            return excluded
        for patience in Patience:
            self.patience, self.is_postponed, self.doubt = patience, False, None
            found = self._search_witness() or self._through_outcomes()
            if not self.is_postponed or isinstance(found, Refuted | Satisfied):
                return found
            yield Patience(patience + 1)
        raise AssertionError("no step takes more than all patience")

    def _through_outcomes(self) -> Outcome:
        """What comes of it outcome by outcome, as far as patience goes."""
        unsettled: Undecided | None = None
        for number, component in enumerate(self.components):
            if not component.slots:
                outcome = self._together(number, {})
                if isinstance(outcome, Refuted):
                    return outcome
                if isinstance(outcome, Undecided):
                    unsettled = outcome
        try:
            for assignment in self._assignments():
                return unsettled or self._values(assignment)
        except Exhausted as error:
            return Undecided.by(self.items[0][0], error)
        if self.doubt is not None:
            return self.doubt
        return Refuted(self.items[0][0]) if self.blamed is None else self.blamed[1]

    def _search_witness(self) -> Satisfied | None:
        """A witness over all outcomes together, where fields at hidden points make each of them costly to decide."""
        outcomes, uses = math.prod(len(domain.rows) for domain in self.domains), uses_far_field(self.items)
        cheap = self.patience is Patience.LITTLE and outcomes < _SEVERAL and uses < _MANY_USES
        if self.depth or outcomes < 2 or not uses or cheap:
            return None
        from scenicq.match.fields.witness_search import AGAIN, QUICK, search_witness  # noqa: PLC0415 - takes long to load

        little = (QUICK, QUICK) if uses >= _MANY_USES else (QUICK,)
        efforts = little if self.patience is Patience.LITTLE else AGAIN
        seed = len(AGAIN) * self.patience
        tables = [(domain.outcomes.variables, domain.outcomes.picks[domain.rows]) for domain in self.domains]
        return search_witness(self.items, self.tolerance, *efforts, outcomes=tables, seed=seed)

    # --- domains

    def _narrow(self) -> Refuted | None:
        """Leave out outcomes that a constraint excludes by itself, or that do not agree with what is left elsewhere."""
        for part in sorted(self.parts, key=lambda part: len(part.slots)):
            for slot in {self.slot_of[id(tree.outcomes)] for tree in part.trees.values()}:
                domain = self.domains[slot]
                chosen = {
                    key: (tree, domain.rows, True) if self.slot_of[id(tree.outcomes)] == slot
                    else (tree, self.domains[self.slot_of[id(tree.outcomes)]].rows, False)
                    for key, tree in part.trees.items()
                }  # fmt: skip
                domain.rows = domain.rows[possible_outcomes(part.item, chosen, len(domain.rows), self.tolerance)]
                if not len(domain.rows):
                    return Refuted(part.item[0])
        changed = True
        while changed:
            changed = False
            for places in self.columns.values():
                for (one, column), (other, place) in itertools.permutations(places, 2):
                    mine, theirs = self.domains[one], self.domains[other]
                    allowed = theirs.outcomes.picks[theirs.rows, place]
                    if (allowed < 0).any():
                        continue
                    own = mine.outcomes.picks[mine.rows, column]
                    kept = (own < 0) | np.isin(own, allowed)
                    if not kept.all():
                        changed = True
                        mine.rows = mine.rows[kept]
                        if not len(mine.rows):
                            return Refuted(self._about(one))
        return None

    def _about(self, slot: int) -> Constraint:
        """A constraint that depends on a slot."""
        return next((part.item[0] for part in self.parts if slot in part.slots), self.items[0][0])

    # --- the search

    def _assignments(self) -> Iterator[dict[int, int]]:
        slots = [
            Slot(number, tuple((domain.rows + domain.first).tolist())) for number, domain in enumerate(self.domains)
        ]
        together = [part.slots for part in self.parts] + [
            frozenset(slot for slot, _ in places) for places in self.columns.values()
        ]
        links: dict[int, set[int]] = {}
        for group in together:
            for slot in group:
                links.setdefault(slot, set()).update(group - {slot})
        return find_assignments(
            slots, self._check, links=links, budget=LIMITS.choice_tries, spent=limit_exceeded("choice_tries")
        )

    def _check(self, slot: int, assignment: Mapping[int, int]) -> tuple[Consistency, frozenset[int]]:
        domain = self.domains[slot]
        picks = domain.outcomes.picks[assignment[slot] - domain.first]
        for variable, pick in zip(domain.outcomes.variables, picks.tolist(), strict=True):
            if pick < 0:
                continue
            for other, column in self.columns[variable]:
                if other != slot and other in assignment:
                    theirs = self.domains[other]
                    own = theirs.outcomes.picks[assignment[other] - theirs.first, column]
                    if own >= 0 and own != pick:
                        return Consistency.NO, frozenset((slot, other))
        answer = Consistency.YES
        assigned = assignment.keys()
        for number, component in enumerate(self.components):
            if slot not in component.slots:
                continue
            if component.slots <= assigned:
                outcome = self._together(number, assignment)
                if isinstance(outcome, Refuted):
                    return self._refuted(outcome, component.slots, assignment)
                if isinstance(outcome, Undecided):
                    self.doubt = self.doubt or outcome
                    answer = Consistency.NO
                continue
            # what already depends on nothing open may be unsatisfiable together
            ready = [part for part in component.parts if part.slots <= assigned]
            if len(ready) > 1 and any(slot in part.slots for part in ready):
                slots = frozenset(each for part in ready for each in part.slots)
                outcome = self._of(number + len(self.components), ready, [], slots, assignment, self.decide)
                if isinstance(outcome, Refuted):
                    return self._refuted(outcome, slots, assignment)
        return answer, frozenset(assigned)

    def _refuted(
        self, outcome: Refuted, slots: frozenset[int], assignment: Mapping[int, int]
    ) -> tuple[Consistency, frozenset[int]]:
        if self.blamed is None or len(assignment) > self.blamed[0]:
            self.blamed = (len(assignment), outcome)
        return Consistency.NO, slots

    def _of(
        self,
        number: int,
        parts: Sequence[ConstraintChoices],
        lookups: Sequence[Node],
        slots: frozenset[int],
        assignment: Mapping[int, int],
        decide: Decide,
    ) -> Outcome:
        """What is decided of constraints for the outcomes of their slots, as far as patience goes."""
        key = (number, tuple([(slot, assignment[slot]) for slot in sorted(slots)]))
        if key not in self.known:
            self.known[key] = Search(self._decided(parts, lookups, slots, dict(assignment), decide))
        outcome = self.known[key].within(self.patience)
        if outcome is None:
            self.is_postponed = True
            return Undecided(self.items[0][0], "postponed")
        return outcome

    def _together(self, number: int, assignment: Mapping[int, int]) -> Outcome:
        """What is decided of a component all of whose slots are assigned."""
        one = self.components[number]
        return self._of(number, one.parts, one.lookups, one.slots, assignment, self._by_all_means)

    def _by_all_means(self, items: list[Item]) -> SearchSteps:
        outcome = yield from self.decide(items)
        if isinstance(outcome, Undecided) and self.at_last is not None:
            return (yield from self.at_last([items]))
        return outcome

    def _decided(
        self,
        parts: Sequence[ConstraintChoices],
        lookups: Sequence[Node],
        slots: frozenset[int],
        assignment: Mapping[int, int],
        decide: Decide,
    ) -> SearchSteps:
        given, taken = self._given(slots, assignment)
        asked = {id(lookup) for lookup in lookups}
        memo: dict[int, Node] = {id(node): Constant(float(pick), span=node.span) for node, pick in taken}
        left = condition_items([part.item for part in parts], given, memo=dict(memo))
        for node, pick in taken:
            if id(node) in asked:
                inner = {key: value for key, value in memo.items() if key != id(node)}
                (placed,) = condition_items([fact(_is(node, pick))], given, memo=inner)
                left.append(placed)
        for constraint, node, seen in left:
            if isinstance(node, Constant) and not holds(constraint, node.value, seen, self.tolerance):
                blamed = constraint if constraint in self.constraints else self.items[0][0]
                return Refuted(blamed, ground_cause((constraint, node, seen)))
        left = [item for item in left if not isinstance(item[1], Constant)]
        if not left:
            return Satisfied({})
        found = yield from search_choices(left, self.tolerance, decide, depth=self.depth + 1)
        found = found or (yield from decide(left))
        if isinstance(found, Satisfied) or found.constraint in self.constraints:
            return found
        return replace(found, constraint=self.items[0][0] if not parts else parts[0].item[0])

    def _given(
        self, slots: frozenset[int], assignment: Mapping[int, int]
    ) -> tuple[dict[Identity, Value], list[tuple[Node, int]]]:
        """Values of random choices, and the options that expressions take."""
        given: dict[Identity, Value] = {}
        taken: dict[int, tuple[Node, int]] = {}
        for slot in slots:
            domain = self.domains[slot]
            for variable, pick in domain.outcomes.given(assignment[slot] - domain.first):
                if isinstance(variable, Identity):
                    given[variable] = float(pick)
                else:
                    taken[id(variable)] = (variable, pick)
        return given, list(taken.values())

    def _values(self, assignment: Mapping[int, int]) -> Satisfied:
        """Values of all random variables."""
        found: dict[Identity, Value] = {}
        for number in range(len(self.components)):
            outcome = self._together(number, assignment)
            if isinstance(outcome, Satisfied):
                found.update(outcome.values)
        given, _ = self._given(frozenset(range(len(self.domains))), assignment)
        return Satisfied({**found, **given})


def _is(index: Node, pick: int) -> Node:
    """The condition that an index takes an option."""
    if kind_of(index) == "boolean":
        return index if pick else build.opposite(index)
    return build.compare(CompareOp.EQ, index, Constant(float(pick), span=index.span), index.span)
