"""Objects that come later: scenarios that make objects after the first sample, and the tracks that may play these.

Such a role is bound from the sample on at which its scenario begins. What a scenario asks of that sample is asked of
its label, as the initial scene is of the first one: the objects that are there already are as the label shows them,
those that come have the properties that the program gives them, and what it draws has any value that it may have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.forest.nodes import Constant, Node, PointIn, Range
from scenicq.forest.scenario import Property, Scenario, ScenarioObject
from scenicq.forest.simplify import roots_of
from scenicq.forest.walk import leaves
from scenicq.geometry.regions import Everywhere
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import relevant_properties
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.verdict import Match, NoMatch
from scenicq.number_ranges import expand_ranges
from scenicq.smt.answer import Solver
from scenicq.store.classes import class_matches
from scenicq.store.labels import Label
from scenicq.store.track_block import TrackBlock
from scenicq.temporal.samples import BoundSamples
from scenicq.temporal.starts import StartSearch
from scenicq.temporal.stretches import StartTable, TrackSpans
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["Arrivals", "LabelOf"]

Members = NDArray[np.int64]
LabelOf = Callable[[Scenario, Mapping[int, int], Sequence[frozenset[str]]], tuple[Label, Mapping[str, str]]]
"""The label with only the objects that play a role, which properties are relevant, and the correspondence."""
_AT_ONCE = 200_000
"""Places in memory."""


@dataclass(eq=False)
class _Scene:
    """What is asked where one scenario begins.

    Attributes:
        search: Decides labels.
        first, end: The objects that come: their numbers, the last left out.
        sure: Whether a label that matches says all; what it draws may be read elsewhere, too.
    """

    search: StartSearch
    first: int
    end: int
    sure: bool

    @property
    def scenario(self) -> Scenario:
        """The scenario of the objects that are there then."""
        return self.search.matcher.scenario


@dataclass(eq=False)
class _Lives:
    """The lives of the tracks of label objects of a block: stretches without a gap that ends them.

    Attributes:
        member: A member of each.
        track: Its track.
        recording: Its recording.
        start, last: Its first and its last label.
    """

    member: Members
    track: Members
    recording: Members
    start: Members
    last: Members

    @classmethod
    def of(cls, block: TrackBlock, gap_s: float) -> _Lives:
        """Those of a block."""
        members = np.arange(block.object_count)
        tracks, labels = block.tracks(members), block.label_of[members]
        order = np.lexsort((labels, tracks))
        later = np.diff(block.times_us[labels[order]]) > round(gap_s * 1e6)
        new = np.concatenate(([True], (np.diff(tracks[order]) != 0) | later))[: len(order)]
        heads = np.flatnonzero(new)
        ends = np.append(heads[1:], len(order)) - 1
        first = order[heads]
        return cls(first, tracks[first], block.recording_of[labels[first]], labels[first], labels[order[ends]])


@dataclass(eq=False)
class Arrivals:
    """What a scenario says of objects that come later, made ready.

    Attributes:
        scenario: The scenario.
        match: Options of the matcher.
        solver: Decides what is not decided otherwise.
    """

    scenario: Scenario
    match: MatchOptions
    solver: Solver | None = None
    _scenes: list[_Scene] = field(init=False, default_factory=list["_Scene"])
    _asked: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        """Say what is asked where each scenario begins."""
        scenario = self.scenario
        own = {leaf.identity for leaf in leaves(*roots_of(scenario))}
        first = len(scenario.objects)
        options = replace(self.match, exact=False)
        for each in scenario.arrivals:
            there = tuple(map(_as_shown, scenario.every_object[:first]))
            scene = replace(
                scenario, objects=(*there, *each.objects), requirements=each.requirements, params={}, solid=(), soft=(),
                dynamics=None, records=(), variants=(), arrivals=(), as_written=None,
            )  # fmt: skip
            said = [given.value for owner in each.objects for given in owner.properties.values()]
            drawn = {leaf.identity for leaf in leaves(*said, *(one.condition for one in each.requirements))}
            search = StartSearch(Matcher(prepare_scenario(scene), options, self.solver))
            end = first + len(each.objects)
            self._scenes.append(_Scene(search, first, end, not drawn & own))
            first = end

    def widened(self, table: StartTable, gap_s: float, label: LabelOf | None) -> tuple[StartTable, Members]:
        """The starts with each choice of tracks for the objects that come later, and the number of the start of each.

        Args:
            table: The starts.
            gap_s: Seconds without a label after which a track's life ends.
            label: Makes labels, for what arrays do not decide.

        Raises:
            Exhausted: There are too many.
        """
        block = table.block
        indices = sorted(table.members)
        rows = np.column_stack([block.tracks(table.members[index]) for index in indices])
        bindings, binding = np.unique(rows, axis=0, return_inverse=True)
        binding = binding.ravel()
        first_label = np.full(len(bindings), len(block))
        np.minimum.at(first_label, binding, table.labels)
        lives = _Lives.of(block, gap_s)
        # of each combination the binding, and the life of each object that has come
        of: Members = np.arange(len(bindings))
        chosen: list[Members] = []
        for scene in self._scenes:
            for index in range(scene.first, scene.end):
                fit = self._candidates(block, lives, scene.scenario.objects[index].category)
                of, chosen = self._joined(block, lives, fit, of, chosen, bindings, first_label)
            kept = self._may_begin(scene, block, lives, of, chosen, bindings, indices, first_label, gap_s, label)
            of, chosen = of[kept], [each[kept] for each in chosen]
        order = np.argsort(of, kind="stable")
        counts = np.bincount(of, minlength=len(bindings))
        starts = np.cumsum(counts) - counts
        repeats = counts[binding]
        if int(repeats.sum()) > LIMITS.arrival_combinations:
            raise limit_exceeded("arrival_combinations")
        origin = np.repeat(np.arange(len(table)), repeats)
        combination = order[expand_ranges(starts[binding], repeats)]
        # who comes later is not over before
        fits = np.ones(len(origin), np.bool_)
        for life in chosen:
            fits &= lives.last[life[combination]] > table.labels[origin]
        origin, combination = origin[fits], combination[fits]
        found = table.chosen(origin)
        late = {len(indices) + place: lives.member[life[combination]] for place, life in enumerate(chosen)}
        return replace(found, members={**found.members, **late}), origin

    def _candidates(self, block: TrackBlock, lives: _Lives, category: str) -> Members:
        """The lives of tracks of a class."""
        codes, names = block.categories()
        fits = np.array([bool(name) and class_matches(category, name, self.match.classes) for name in names], np.bool_)
        return np.flatnonzero(np.append(fits, False)[codes[lives.member]])

    @staticmethod
    def _joined(
        block: TrackBlock, lives: _Lives, fit: Members, of: Members, chosen: list[Members], bindings: Members,
        first_label: Members,
    ) -> tuple[Members, list[Members]]:  # fmt: skip
        """Combinations with each life of the same recording that is no other object's, and not over before."""
        order = fit[np.argsort(lives.recording[fit], kind="stable")]
        recording = block.recording_of[first_label[of]]
        low = np.searchsorted(lives.recording[order], recording)
        counts = np.searchsorted(lives.recording[order], recording, side="right") - low
        if int(counts.sum()) > LIMITS.arrival_combinations:
            raise limit_exceeded("arrival_combinations")
        which = np.repeat(np.arange(len(of)), counts)
        life = order[expand_ranges(low, counts)]
        keeps = lives.last[life] > first_label[of[which]]
        keeps &= (bindings[of[which]] != lives.track[life][:, None]).all(axis=1)
        for other in chosen:
            keeps &= lives.track[other[which]] != lives.track[life]
        which, life = which[keeps], life[keeps]
        return of[which], [*(other[which] for other in chosen), life]

    def _may_begin(
        self, scene: _Scene, block: TrackBlock, lives: _Lives, of: Members, chosen: list[Members], bindings: Members,
        indices: Sequence[int], first_label: Members, gap_s: float, label: LabelOf | None,
    ) -> NDArray[np.bool_]:  # fmt: skip
        """Whether the scenario may begin at some sample, for each combination."""
        kept = np.zeros(len(of), np.bool_)
        if not len(of):
            return kept
        tracks = np.unique(np.concatenate((bindings.ravel(), *(lives.track[each] for each in chosen))))
        seen = TrackSpans(block, tracks, gap_s)
        newest = chosen[scene.first - len(indices) : scene.end - len(indices)]
        low = np.maximum.reduce([first_label[of] + 1, *(lives.start[each] for each in newest)])
        high = np.minimum.reduce([lives.last[each] for each in newest])
        sizes = np.maximum(high - low + 1, 0)
        total = np.cumsum(sizes)
        first = 0
        while first < len(of):
            look()
            before = total[first - 1] if first else 0
            end = max(first + 1, int(np.searchsorted(total, before + _AT_ONCE, side="right")))
            mine = np.arange(first, end)
            which = np.repeat(mine, sizes[mine])
            at = expand_ranges(low[mine], sizes[mine])
            members = {index: seen.members(bindings[of[which], place], at) for place, index in enumerate(indices)}
            for place, each in enumerate(chosen):
                members[len(indices) + place] = seen.members(lives.track[each[which]], at)
            truth = self._truth(scene, BoundSamples(block, members, len(at), at, self.match.classes), label)
            kept[which[truth > FALSE]] = True
            first = end
        return kept

    def truths(self, places: BoundSamples, bounds: Members, label: LabelOf | None) -> dict[int, Truth]:
        """For each condition that stands for the beginning of a scenario whether it may begin at each place.

        Args:
            places: The places.
            bounds: Where each stretch begins, and where the last ends.
            label: See `Arrivals.widened`.
        """
        found: dict[int, Truth] = {}
        for arrival, scene in zip(self.scenario.arrivals, self._scenes, strict=True):
            look()
            truth = self._truth(scene, places, label)
            # who is not seen between two samples may still be there
            for index in range(scene.first, scene.end):
                truth[_within(places.members[index] >= 0, bounds) & (places.members[index] < 0)] = UNKNOWN
            found.update(dict.fromkeys(arrival.conditions, truth))
        return found

    def _truth(self, scene: _Scene, places: BoundSamples, label: LabelOf | None) -> Truth:
        """Whether a scenario may begin at each place; it may not where the objects that it makes are not seen."""
        found = np.full(len(places), FALSE)
        members = {index: places.members[index] for index in range(scene.end)}
        come = np.logical_and.reduce([members[index] >= 0 for index in range(scene.first, scene.end)])
        shown = come & np.logical_and.reduce([members[index] >= 0 for index in range(scene.first)])
        headings = places.block.numbers("heading")
        for index in range(scene.first):
            shown &= ~np.isnan(headings[members[index]])
        found[come & ~shown] = UNKNOWN
        at = np.flatnonzero(shown)
        if not len(at):
            return found
        there = {index: each[at] for index, each in members.items()}
        mine = BoundSamples(places.block, there, len(at), None, self.match.classes)
        truth, search = np.full(len(at), TRUE), scene.search
        for requirements in search.plain.values():
            truth = np.minimum(truth, search.plain_truth(mine, requirements)[0])
        left = np.flatnonzero(truth > FALSE)
        some = {index: each[left] for index, each in mine.members.items()}
        holds, fails = search.in_closed_form(places.block, some, len(left))[:2]
        truth[left[fails]] = FALSE
        for number in np.flatnonzero(~holds & ~fails).tolist():
            one = {index: int(each[number]) for index, each in some.items()}
            truth[left[number]] = min(int(truth[left[number]]), self._decided(scene, one, label))
        found[at] = truth if scene.sure else np.where(truth == TRUE, UNKNOWN, truth)
        return found

    def _decided(self, scene: _Scene, members: Mapping[int, int], label: LabelOf | None) -> int:
        """Whether the label of a place matches, by the matcher."""
        self._asked += 1
        if label is None or self._asked > LIMITS.arrival_questions:
            return int(UNKNOWN)
        look()
        matcher = scene.search.rest
        shown, names = label(scene.scenario, members, relevant_properties(scene.scenario, self.match))
        verdict = matcher.match(shown, fixed_roles=dict(names))
        return int(TRUE if isinstance(verdict, Match) else FALSE if isinstance(verdict, NoMatch) else UNKNOWN)


def _as_shown(owner: ScenarioObject) -> ScenarioObject:
    """An object that is there already: a label may show it anywhere."""
    free: dict[str, Node] = {
        "position": PointIn(Constant(Everywhere())), "heading": Range(Constant(-math.pi), Constant(math.pi)),
    }  # fmt: skip
    properties = {
        name: Property(free.get(name, given.value), explicit=False, span=given.span)
        for name, given in owner.properties.items()
    }
    return replace(owner, properties=properties, mutated=frozenset(), uncomparable={})


def _within(seen: NDArray[np.bool_], bounds: Members) -> NDArray[np.bool_]:
    """Between two places of a stretch at which something is seen."""
    found = np.zeros(len(seen), np.bool_)
    where = np.flatnonzero(seen)
    low, high = np.searchsorted(where, bounds[:-1]), np.searchsorted(where, bounds[1:]) - 1
    for first, last in zip(low[high >= low].tolist(), high[high >= low].tolist(), strict=True):
        found[where[first] : where[last] + 1] = True
    return found
