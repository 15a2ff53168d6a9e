"""The candidates of each role: the label objects that may play it by their class and their distance from the ego.

A role is an object of the scenario. Label objects go by their number in the label: 0 is the label's ego, 1 the first of
its other objects. Positions and requirements are not looked at here; the search (`match/search`) does that.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from scenicq.forest.among import LabelElements
from scenicq.forest.nodes import COURSE, LaneCourse, Value
from scenicq.forest.scenario import Scenario
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.options import MatchOptions
from scenicq.match.problem.bipartite_matching import Slot, matchable
from scenicq.match.problem.constraints import Signature
from scenicq.match.problem.observation import (
    course_rules,
    observe,
    observe_course,
    observe_params,
    rule_of_courses,
)
from scenicq.match.verdict import Cause
from scenicq.store.classes import Granularity, class_matches
from scenicq.store.labels import Label

__all__ = [
    "Candidates",
    "LabelProblem",
    "candidates_of",
    "possible_egos",
    "prepare_label",
    "rank_by_distance",
    "sort_by_distance",
]

Candidates = Mapping[int, tuple[int, ...]]
"""For roles, by the object's index in the scenario, the numbers of the label objects that may play them."""


def rank_by_distance(label: Label, ego: int, candidates: Iterable[Iterable[int]]) -> dict[int, int]:
    """The rank of each candidate by its distance from the ego, 0 for the nearest; equally near ones go by their ids.

    Args:
        label: The label.
        ego: Number of the label object that plays the ego.
        candidates: Numbers of label objects, for each role.
    """
    objects = (label.ego, *label.objects)
    x, y = objects[ego].x, objects[ego].y

    def key(number: int) -> tuple[float, str, int]:
        each = objects[number]
        dx, dy = each.x - x, each.y - y
        return dx * dx + dy * dy, each.id, number

    ordered = sorted({number for numbers in candidates for number in numbers}, key=key)
    return {number: rank for rank, number in enumerate(ordered)}


def sort_by_distance(label: Label, ego: int, candidates: Candidates) -> Candidates:
    """The candidates of each role, the nearest to the ego first: the order in which they are tried."""
    if all(len(numbers) < 2 for numbers in candidates.values()):
        return candidates
    rank = rank_by_distance(label, ego, candidates.values()).__getitem__
    return {index: tuple(sorted(numbers, key=rank)) for index, numbers in candidates.items()}


_Observed = tuple[frozenset[str], tuple[int, ...]]
"""Names of properties, and the numbers of label objects of which these are observed."""


@dataclass(slots=True, eq=False)
class LabelProblem:
    """What the search for a correspondence needs of one label, for one choice of the ego.

    Attributes:
        label: The label.
        ego: Number of the label object that plays the scenario's ego.
        seen: What is observed of each label object, by its number.
        params: What is observed of the frame.
        candidates: The candidates of each role but the ego, in the order in which they are tried.
        ranks: Place of each candidate in that order.
        disc: Centre and radius of the area that is looked at, metres; None for everywhere.
        classes: How finely classes are compared.
        courses: How courses are made, if the scenario asks for any.
        elements: The label objects for conditions that go through all of them, made when one first asks.
    """

    label: Label
    ego: int
    seen: tuple[Mapping[str, Value], ...]
    params: Mapping[str, Value]
    candidates: Mapping[int, tuple[int, ...]]
    ranks: Mapping[int, int]
    disc: tuple[tuple[float, float], float] | None
    classes: Granularity = "fine"
    courses: LaneCourse | None = None
    elements: LabelElements | None = None

    def signatures(
        self, relevant: tuple[frozenset[str], ...]
    ) -> Iterator[tuple[Signature, dict[int, tuple[int, ...]]]]:
        """Split the candidates by which relevant properties are observed of them.

        Most datasets observe the same of all objects: then there is one signature with all candidates.

        Args:
            relevant: For each role, the properties whose being observed makes a difference.

        Yields:
            A signature, with the candidates of each role that have it.

        Raises:
            Exhausted: There are too many combinations.
        """
        choices: list[list[_Observed]] = []
        splits: dict[_Observed, list[_Observed]] = {}
        for index, names in enumerate(relevant):
            key = names, self.candidates.get(index, (self.ego,))
            if key not in splits:
                splits[key] = self._split(*key)
            choices.append(splits[key])
        params = frozenset(self.params)
        for count, chosen in enumerate(itertools.product(*choices)):
            if count >= LIMITS.signatures:
                raise limit_exceeded("signatures")
            signature = (*(names for names, _ in chosen), params)
            yield signature, {index: numbers for index, (_, numbers) in enumerate(chosen)}

    def _split(self, names: frozenset[str], candidates: tuple[int, ...]) -> list[_Observed]:
        """Group candidates by which of some properties are observed of them; the most completely observed first.

        The order is one of properties, not of candidates: it must not depend on candidates that drop out anyway.
        """
        groups: dict[frozenset[str], list[int]] = {}
        for number in candidates:
            groups.setdefault(names.intersection(self.seen[number]), []).append(number)
        ordered = sorted(groups, key=lambda group: (-len(group), sorted(group))) if len(groups) > 1 else groups
        return [(group, tuple(groups[group])) for group in ordered]


def possible_egos(scenario: Scenario, label: Label, options: MatchOptions) -> list[int]:
    """Numbers of the label objects that may play the ego: the label's own, and with `--ego any` all of its class."""
    own = [0] if label.has_ego else []
    if options.ego == "label":
        return own
    category = scenario.objects[scenario.ego].category
    return own + [
        number
        for number, each in enumerate(label.objects, 1)
        if class_matches(category, each.category, options.classes)
    ]


def prepare_label(
    scenario: Scenario,
    label: Label,
    ego: int,
    options: MatchOptions,
    fixed_roles: Mapping[str, str],
    allowed: Candidates | None = None,
) -> LabelProblem | Cause:
    """State the problem of one label for one choice of its ego, or say which role cannot be filled.

    Args:
        scenario: The scenario.
        label: The label.
        ego: Number of the label object that plays the ego.
        options: The options.
        fixed_roles: Ids of the label objects that play certain roles, by the names of the roles.
        allowed: Candidates that are known already, for the label's own ego; roles that it lacks may have any.
    """
    candidates = candidates_of(scenario, label, ego, options, fixed_roles, allowed)
    unfilled = _find_unfilled_role(candidates)
    if unfilled is not None:
        role, count = scenario.objects[unfilled], len(candidates[unfilled])
        detail = f"only {count} {role.category}" if count else f"no {role.category}"
        return Cause(f"{role.name}.class", detail, role.span, (unfilled,))
    if options.exact:
        spare = len(_label_objects_in_reach(label, ego, options)) - len(candidates)
        if spare:
            return Cause("--exact", f"{spare} label objects are left over")
    label_objects = (label.ego, *label.objects)
    disc = None if options.radius is None else ((label_objects[ego].x, label_objects[ego].y), options.radius)
    ranks = rank_by_distance(label, ego, candidates.values())
    candidates = {index: tuple(sorted(numbers, key=ranks.__getitem__)) for index, numbers in candidates.items()}
    seen = [*map(observe, label_objects)]
    for index, rules in course_rules(scenario).items():
        for number in candidates.get(index, (ego,)):
            course = observe_course(label, label_objects[number], rules)
            if course is not None:
                seen[number] = {**seen[number], COURSE: course}
    return LabelProblem(
        label, ego, tuple(seen), observe_params(label), candidates, ranks, disc, options.classes,
        rule_of_courses(scenario),
    )  # fmt: skip


def candidates_of(
    scenario: Scenario,
    label: Label,
    ego: int,
    options: MatchOptions,
    fixed_roles: Mapping[str, str],
    allowed: Candidates | None = None,
) -> dict[int, tuple[int, ...]]:
    """The candidates of each role but the ego: label objects of its class in reach; arguments as of `prepare_label`."""
    in_reach = _label_objects_in_reach(label, ego, options)
    of_class: dict[str, tuple[int, ...]] = {}
    candidates: dict[int, tuple[int, ...]] = {}
    for role in scenario.objects:
        if role.index == scenario.ego:
            continue
        numbers = of_class.get(role.category)
        if numbers is None:
            numbers = tuple([n for n, category in in_reach if class_matches(role.category, category, options.classes)])
            of_class[role.category] = numbers
        if role.name in fixed_roles:
            id_ = fixed_roles[role.name]
            numbers = tuple([number for number in numbers if number and label.objects[number - 1].id == id_])
        if allowed is not None and role.index in allowed:
            numbers = tuple([number for number in allowed[role.index] if number in numbers])
        candidates[role.index] = numbers
    return candidates


def _label_objects_in_reach(label: Label, ego: int, options: MatchOptions) -> list[tuple[int, str]]:
    """Numbers and classes of the label objects that may play other roles than the ego: all within `--radius` of it."""
    label_objects = (label.ego, *label.objects)
    first = 1 if options.ego == "label" or not label.has_ego else 0
    numbers = [number for number in range(first, len(label_objects)) if number != ego]
    if options.radius is not None:
        x, y, reach = label_objects[ego].x, label_objects[ego].y, options.radius
        numbers = [n for n in numbers if (label_objects[n].x - x) ** 2 + (label_objects[n].y - y) ** 2 <= reach * reach]
    return [(number, label_objects[number].category) for number in numbers]


def _find_unfilled_role(candidates: Mapping[int, tuple[int, ...]]) -> int | None:
    """A role that no label object is left for, when each plays one role at most; None if all can be filled."""
    slots = [Slot(index, numbers) for index, numbers in candidates.items()]
    empty = next((slot.name for slot in slots if not slot.candidates), None)
    if empty is None and matchable(slots) is None:
        return min(candidates, key=lambda index: len(candidates[index]))
    return empty
