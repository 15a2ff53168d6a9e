"""Which label objects may play which role, before anything about positions is looked at: class, radius, number."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from scenicq.forest.among import LabelElements
from scenicq.forest.nodes import Value
from scenicq.forest.scenario import Scenario
from scenicq.limits import LIMITS, exhausted
from scenicq.match.options import MatchOptions
from scenicq.match.problem.bipartite_matching import Slot, matchable
from scenicq.match.problem.constraints import Signature
from scenicq.match.problem.observation import observe, observe_params
from scenicq.match.verdict import Cause
from scenicq.store.classes import Granularity, class_matches
from scenicq.store.labels import Label

__all__ = ["Candidates", "LabelProblem", "candidates_of", "egos", "find_candidates", "nearest_first", "ranks"]

Candidates = Mapping[int, tuple[int, ...]]
"""For objects of the scenario, the numbers of the label objects that may play them: all others are excluded."""


def ranks(label: Label, ego: int, candidates: Iterable[Iterable[int]]) -> dict[int, int]:
    """In which order label objects are tried: the nearest to the ego first, of equally near ones by their ids.

    Args:
        label: The label.
        ego: Number of the label object that plays the ego.
        candidates: Numbers of label objects, for each object of the scenario.
    """
    objects = (label.ego, *label.objects)
    x, y = objects[ego].x, objects[ego].y

    def key(number: int) -> tuple[float, str, int]:
        each = objects[number]
        dx, dy = each.x - x, each.y - y
        return dx * dx + dy * dy, each.id, number

    ordered = sorted({number for numbers in candidates for number in numbers}, key=key)
    return {number: rank for rank, number in enumerate(ordered)}


def nearest_first(label: Label, ego: int, candidates: Candidates) -> Candidates:
    """Candidates in the order in which they are tried; arguments as of `ranks`."""
    if all(len(numbers) < 2 for numbers in candidates.values()):
        return candidates
    rank = ranks(label, ego, candidates.values()).__getitem__
    return {index: tuple(sorted(numbers, key=rank)) for index, numbers in candidates.items()}


@dataclass(slots=True, eq=False)
class LabelProblem:
    """A label made ready: its label objects by number (0 is the label's ego) and who may play whom.

    Attributes:
        label: The label.
        ego: Number of the label object that plays the scenario's ego.
        seen: What is observed of each label object.
        params: What is observed of the frame.
        candidates: For each object of the scenario but the ego, the numbers of the label objects of its class, in the
            order in which they are tried.
        ranks: That order.
        disc: The area that is looked at, if it is limited: centre and radius.
        classes: How classes are compared.
        elements: The label objects for conditions that go through all of them, once one has been asked.
    """

    label: Label
    ego: int
    seen: tuple[Mapping[str, Value], ...]
    params: Mapping[str, Value]
    candidates: Mapping[int, tuple[int, ...]]
    ranks: Mapping[int, int]
    disc: tuple[tuple[float, float], float] | None
    classes: Granularity = "fine"
    elements: LabelElements | None = None

    def signatures(
        self, relevant: tuple[frozenset[str], ...]
    ) -> Iterator[tuple[Signature, dict[int, tuple[int, ...]]]]:
        """Candidates split by what is observed of them, as far as it matters; one signature in most datasets.

        Raises:
            Exhausted: There are too many combinations.
        """
        choices: list[list[tuple[frozenset[str], tuple[int, ...]]]] = []
        split: dict[tuple[frozenset[str], tuple[int, ...]], list[tuple[frozenset[str], tuple[int, ...]]]] = {}
        for index, names in enumerate(relevant):
            key = names, self.candidates.get(index, (self.ego,))
            if key not in split:
                by_set: dict[frozenset[str], list[int]] = {}
                for number in key[1]:
                    by_set.setdefault(names.intersection(self.seen[number]), []).append(number)
                # what is observed most completely first: the order must not depend on candidates that drop out anyway
                ordered = sorted(by_set.items(), key=_completeness) if len(by_set) > 1 else by_set.items()
                split[key] = [(names_, tuple(numbers)) for names_, numbers in ordered]
            choices.append(split[key])
        params = frozenset(self.params)
        for count, chosen in enumerate(itertools.product(*choices)):
            if count >= LIMITS.signatures:
                raise exhausted("signatures")
            yield (*(names for names, _ in chosen), params), {i: numbers for i, (_, numbers) in enumerate(chosen)}


def _completeness(entry: tuple[frozenset[str], list[int]]) -> tuple[int, list[str]]:
    return -len(entry[0]), sorted(entry[0])


def egos(scenario: Scenario, label: Label, options: MatchOptions) -> list[int]:
    """Numbers of the label objects that may play the ego: the label's own, or any of its class, if there are any."""
    own = [0] if label.has_ego else []
    if options.ego == "label":
        return own
    wanted = scenario.objects[scenario.ego].category
    return own + [
        number for number, each in enumerate(label.objects, 1) if class_matches(wanted, each.category, options.classes)
    ]


def find_candidates(
    scenario: Scenario,
    label: Label,
    ego: int,
    options: MatchOptions,
    given: Mapping[str, str],
    among: Candidates | None = None,
) -> LabelProblem | Cause:
    """Who may play whom for one choice of ego, or what is lacking.

    Args:
        scenario: The scenario.
        label: The label.
        ego: Number of the label object that plays the ego.
        options: The options.
        given: Ids of label objects that are known to play objects, by the objects' names.
        among: What is known of who may play whom, for the label's own ego.
    """
    candidates = candidates_of(scenario, label, ego, options, given, among)
    short = _short(candidates)
    if short is not None:
        owner, count = scenario.objects[short], len(candidates[short])
        detail = f"only {count} {owner.category}" if count else f"no {owner.category}"
        return Cause(f"{owner.name}.class", detail, owner.span, (short,))
    if options.exact:
        spare = len(_free(label, ego, options)) - len(candidates)
        if spare:
            return Cause("--exact", f"{spare} label objects are left over")
    label_objects = (label.ego, *label.objects)
    disc = None if options.radius is None else ((label_objects[ego].x, label_objects[ego].y), options.radius)
    order = ranks(label, ego, candidates.values())
    candidates = {index: tuple(sorted(numbers, key=order.__getitem__)) for index, numbers in candidates.items()}
    seen = tuple(map(observe, label_objects))
    return LabelProblem(label, ego, seen, observe_params(label), candidates, order, disc, options.classes)


def candidates_of(
    scenario: Scenario,
    label: Label,
    ego: int,
    options: MatchOptions,
    given: Mapping[str, str],
    among: Candidates | None = None,
) -> dict[int, tuple[int, ...]]:
    """For each object but the scenario's ego, the numbers of the label objects of its class; as `find_candidates`."""
    free = _free(label, ego, options)
    of_class: dict[str, tuple[int, ...]] = {}
    candidates: dict[int, tuple[int, ...]] = {}
    for owner in scenario.objects:
        if owner.index == scenario.ego:
            continue
        found = of_class.get(owner.category)
        if found is None:
            found = tuple([number for number, kind in free if class_matches(owner.category, kind, options.classes)])
            of_class[owner.category] = found
        if owner.name in given:
            wanted = given[owner.name]
            found = tuple([number for number in found if number and label.objects[number - 1].id == wanted])
        if among is not None and owner.index in among:
            found = tuple([number for number in among[owner.index] if number in found])
        candidates[owner.index] = found
    return candidates


def _free(label: Label, ego: int, options: MatchOptions) -> list[tuple[int, str]]:
    """The numbers and classes of the label objects within the radius that may play others than the ego."""
    label_objects = (label.ego, *label.objects)
    first = 1 if options.ego == "label" or not label.has_ego else 0
    numbers = [number for number in range(first, len(label_objects)) if number != ego]
    if options.radius is not None:
        x, y, reach = label_objects[ego].x, label_objects[ego].y, options.radius
        numbers = [n for n in numbers if (label_objects[n].x - x) ** 2 + (label_objects[n].y - y) ** 2 <= reach * reach]
    return [(number, label_objects[number].category) for number in numbers]


def _short(candidates: Mapping[int, tuple[int, ...]]) -> int | None:
    """An object for which there is no label object left, if there is one."""
    slots = [Slot(index, options) for index, options in candidates.items()]
    empty = next((slot.name for slot in slots if not slot.candidates), None)
    if empty is None and matchable(slots) is None:
        return min(candidates, key=lambda index: len(candidates[index]))
    return empty
