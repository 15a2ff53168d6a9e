"""Labels that need no search to speak of: few candidates, and closed forms for every group.

The prefilter leaves such labels in the thousands. Roles are filled in the order of the program, each with the first
candidate that passes; what is not clear is left to `LabelSearch`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from scenicq.budget import look
from scenicq.forest.nodes import Value
from scenicq.forest.scenario import Scenario
from scenicq.match.decide.compiled_expressions import UnclearError
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.constraints import Signature
from scenicq.match.problem.map_lookups import Disc, MapLookups
from scenicq.match.problem.observation import observe, observe_params, observed_names
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.search.group_plan import GroupPlan, MatchPlan
from scenicq.match.search.label_search import Failure, Solution
from scenicq.store.labels import Label

__all__ = ["Casting", "FirstFit", "first_fit_of", "signature_of"]

_MOST_DECISIONS = 64
_MORE_DECISIONS = 16
"""For each role: what is given up costs as much as half a search at most."""


@dataclass(frozen=True, slots=True, eq=False)
class FirstFit:
    """A plan whose groups all have closed forms.

    Attributes:
        plan: The plan.
        ego_only: Groups about the ego alone.
        due: For each object but the ego, in program order, the groups that can be decided once it has a candidate.
        words: Whether it also tells what keeps a label from matching. Conditions on known values alone are left to
            `LabelSearch`, which tells what no candidate satisfies.
        order: The ego, then the objects of `due`.
        most_decisions: After how many decisions it is given up.
    """

    plan: MatchPlan
    ego_only: tuple[GroupPlan, ...]
    due: tuple[tuple[int, tuple[GroupPlan, ...]], ...]
    words: bool
    order: tuple[int, ...]
    most_decisions: int


def first_fit_of(plan: MatchPlan, scenario: Scenario) -> FirstFit | None:
    """The plan made ready; None if some group has no closed form."""
    if any(group.quick is None for group in plan.groups):
        return None
    order = [thing.index for thing in scenario.objects if thing.index != scenario.ego]
    due: dict[int, list[GroupPlan]] = {index: [] for index in order}
    for group in sorted(plan.groups, key=lambda each: len(each.roles)):
        if group.roles:
            due[max(group.roles, key=order.index)].append(group)
    words = all(group.group.variables for group in plan.groups)
    most = _MOST_DECISIONS + _MORE_DECISIONS * len(due)
    steps = tuple((index, tuple(due[index])) for index in order)
    return FirstFit(plan, plan.ego_only, steps, words, (scenario.ego, *order), most)


@dataclass(slots=True)
class Casting:
    """One label on its way.

    Attributes:
        direct: The plan.
        options: The options.
        label: The label.
        ego: Index of the ego in the scenario.
        among: The candidates.
        disc: The area that is looked at.
        places: What is known of places.
        words: Whether it also tells what keeps the label from matching: for a narrow miss `LabelSearch` looks at all
            candidates.
        failure: What excluded the correspondence that came furthest.
    """

    direct: FirstFit
    options: MatchOptions
    label: Label
    ego: int
    among: Candidates
    disc: Disc | None
    places: MapLookups
    words: bool = True
    failure: Failure | None = None
    assignment: dict[int, int] = field(default_factory=dict["int", "int"])
    _left: int = 0
    _seen: dict[int, Mapping[str, Value]] = field(default_factory=dict["int", "Mapping[str, Value]"])

    def get(self, index: int, name: str) -> Value:
        """The observed value of an object's property."""
        number = self.assignment[index]
        seen = self._seen.get(number)
        if seen is None:
            seen = self._seen[number] = observe(self.label.objects[number - 1] if number else self.label.ego)
        return seen[name]

    def _passes(self, group: GroupPlan) -> Satisfied | None:
        """How a group is satisfied; None, with what failed furthest kept, if it is not."""
        self._left -= 1
        outcome = None
        if self._left >= 0 and group.quick is not None:
            outcome = group.quick.decide(self.get, self.disc, self.options.tolerance, self.places)
        if outcome is None or group.quick is None:
            raise UnclearError
        if isinstance(outcome, Satisfied):
            return outcome
        if outcome is group.quick.narrow:
            self.words = False
        depth = len(self.assignment)
        if isinstance(outcome, Refuted) and (self.failure is None or depth > self.failure.depth):
            self.failure = Failure(depth, group.group, outcome, dict(self.assignment))
        return None

    def solve(self) -> Solution | Failure | None:
        """The first correspondence in the order of the program, or what kept all from matching; None if unclear."""
        found: dict[int, Satisfied] = {}
        self.assignment[self.ego] = 0
        self._left = self.direct.most_decisions
        try:
            for group in self.direct.ego_only:
                outcome = self._passes(group)
                if outcome is None:
                    return self.failure
                found[id(group)] = outcome
            if not self._fill(found):
                return self.failure
        except UnclearError:
            return None
        groups = self.direct.plan.groups
        return Solution(dict(self.assignment), tuple((group, found[id(group)]) for group in groups))

    def _fill(self, found: dict[int, Satisfied]) -> bool:
        """Fill the roles, depth first."""
        due = self.direct.due
        tries = [iter(self.among[due[0][0]])] if due else []
        while tries:
            index, groups = due[len(tries) - 1]
            for number in tries[-1]:
                look()
                self.assignment.pop(index, None)
                if number in self.assignment.values():
                    continue
                self.assignment[index] = number
                if self._all_pass(groups, found):
                    break
            else:
                self.assignment.pop(index, None)
                tries.pop()
                continue
            if len(tries) == len(due):
                return True
            tries.append(iter(self.among[due[len(tries)][0]]))
        return not due

    def _all_pass(self, groups: tuple[GroupPlan, ...], found: dict[int, Satisfied]) -> bool:
        for group in groups:
            outcome = self._passes(group)
            if outcome is None:
                return False
            found[id(group)] = outcome
        return True


def signature_of(label: Label, ego: int, among: Candidates, relevant: tuple[frozenset[str], ...]) -> Signature | None:
    """What is observed of all candidates, if it is the same for all of a role."""
    objects = label.objects
    numbers = {number for index, numbers in among.items() if index != ego for number in numbers}
    seen = {number: observed_names(objects[number - 1]) for number in numbers}
    params = frozenset(observe_params(label)) if label.params else frozenset[str]()
    own = observed_names(label.ego)
    if len(set(seen.values())) == 1 and all(among[index] for index in range(len(relevant)) if index != ego):
        return _signature(relevant, ego, own, next(iter(seen.values())), params)
    kinds: list[frozenset[str]] = []
    for index, names in enumerate(relevant):
        if index == ego:
            kinds.append(names & own)
            continue
        first, *others = {names & seen[number] for number in among[index]} or {None}
        if first is None or others:
            return None
        kinds.append(first)
    return (*kinds, params)


@lru_cache
def _signature(
    relevant: tuple[frozenset[str], ...],
    ego: int,
    own: frozenset[str],
    others: frozenset[str],
    params: frozenset[str],
) -> Signature:
    """Where the ego has some properties, and all others have the same."""
    return (*(names & (own if index == ego else others) for index, names in enumerate(relevant)), params)
