"""The samples of results as columns: those of many results of one recording together, where they observe alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import Identity, Node, Value
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import features, leaves
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, WitnessValue
from scenicq.number_ranges import expand_ranges
from scenicq.query.execution.members import Members
from scenicq.query.execution.results import Result
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.samples import MOVING, BoundSamples

__all__ = ["ResultSamples", "ResultStretches", "assignment_of"]

_PLACES = 50_000
"""Samples of results whose values are worked out together."""


@dataclass(frozen=True, eq=False, slots=True)
class _Placed:
    """A result with its samples.

    Attributes:
        first, end: Its labels in the block, the end left out.
        members: Who plays each object at each of them; -1 where it is not seen.
    """

    first: int
    end: int
    members: Mapping[int, NDArray[np.int64]]


@dataclass(frozen=True, eq=False, slots=True)
class ResultStretches:
    """The samples of some results among those of several.

    Attributes:
        samples: All samples.
        starts, sizes: Where those of each result begin, and how many they are.
        numbers: Which results, among all.
        first: The number of the first one whose samples are there.
    """

    samples: BoundSamples
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    numbers: Sequence[int]
    first: int

    def chosen(self, places: Sequence[int]) -> ResultStretches:
        """The samples of some of them."""
        return replace(self, numbers=[self.numbers[place] for place in places])

    def labels(self) -> NDArray[np.int64]:
        """The labels of their samples."""
        assert self.samples.labels is not None
        return self.samples.labels[self.places()]

    def places(self) -> NDArray[np.int64]:
        """The numbers of their samples, result by result."""
        own = np.array(self.numbers) - self.first
        return expand_ranges(self.starts[own], self.sizes[own])

    def bounds(self) -> NDArray[np.int64]:
        """Where the samples of each begin among `places`, and where the last ones end."""
        return np.concatenate(([0], np.cumsum(self.sizes[np.array(self.numbers) - self.first])))

    def slices(self) -> Iterator[slice]:
        """The samples of each among `places`."""
        ends = cast("list[int]", self.bounds().tolist())
        return map(slice, ends[:-1], ends[1:])

    def columns(self, scenario: Scenario) -> AtomColumns:
        """What is read at these samples, each from the start of its result."""
        ends = self.bounds()
        return AtomColumns(scenario, self.samples.at(self.places()), start=np.repeat(ends[:-1], np.diff(ends)))


@dataclass(eq=False)
class ResultSamples:
    """Reads the samples of results.

    Attributes:
        scenario: The scenario.
        options: Options of the matcher.
        values: What is read at each sample.
    """

    scenario: Scenario
    options: MatchOptions
    values: tuple[Node, ...]
    _indices: dict[str, int] = field(init=False)
    _steady: list[tuple[int, str]] = field(init=False)

    def __post_init__(self) -> None:
        """Find what the values read of labels that a program may say in their place."""
        owners = self.scenario.every_object
        self._indices = {owner.name: owner.index for owner in owners}
        found: dict[tuple[int, str], None] = {}
        todo = list(features(*self.values))
        while todo:
            index, name = todo.pop()
            given = (
                None if index < 0 or name in MOVING or (index, name) in found else owners[index].properties.get(name)
            )
            if given is None:
                continue
            found[index, name] = None
            todo += features(given.value)
        self._steady = sorted(found)

    def stretches(self, members: Members, matches: Sequence[Result]) -> Iterator[ResultStretches]:
        """The samples of matches of a recording, of those together in which labels observe the same."""
        first = 0
        for some in _in_pieces([self._placed(members, each) for each in matches]):
            sizes = np.array([each.end - each.first for each in some])
            starts = np.cumsum(sizes) - sizes
            labels = expand_ranges(np.array([each.first for each in some]), sizes)
            playing = {
                index: np.concatenate([each.members.get(index, np.full(each.end - each.first, -1)) for each in some])
                for index in self._indices.values()
            }
            samples = BoundSamples(members.block, playing, len(labels), labels, self.options.classes)
            # what the program says in place of what no sample of a result has is the same whatever others are there
            for numbers in self._alike(samples, starts, len(some)):
                yield ResultStretches(samples, starts, sizes, [first + number for number in numbers], first)
            first += len(some)

    def _placed(self, members: Members, result: Result) -> _Placed:
        first = members.numbers[result.frame]
        end = first + (1 if result.interval is None else result.interval.count)
        roles = cast(Match, result.verdict).correspondence
        who = members.at if result.interval is None else members.along
        return _Placed(first, end, {self._indices[name]: who(named, first, end) for name, named in roles.items()})

    def _alike(self, samples: BoundSamples, starts: NDArray[np.int64], count: int) -> list[list[int]]:
        """The results, those together of which labels observe the same that does not change."""
        if not self._steady:
            return [list(range(count))]
        seen = [np.logical_or.reduceat(_is_seen(samples, index, name), starts).tolist() for index, name in self._steady]
        groups: dict[tuple[bool, ...], list[int]] = {}
        for number in range(count):
            groups.setdefault(tuple(each[number] for each in seen), []).append(number)
        return list(groups.values())


def assignment_of(values: Sequence[Node], witness: Mapping[str, WitnessValue]) -> dict[Identity, Value]:
    """The values that a witness gives to random variables, where it names them without doubt."""
    places: dict[str, set[Identity]] = {}
    for leaf in leaves(*values):
        if leaf.span is not None:
            places.setdefault(leaf.span.mark, set()).add(leaf.identity)
    return {
        next(iter(identities)): witness[place]
        for place, identities in places.items()
        if len(identities) == 1 and place in witness and f"{place}#2" not in witness
    }


def _is_seen(samples: BoundSamples, index: int, name: str) -> NDArray[np.bool_]:
    """At which samples a property is observed."""
    seen = samples.observed(index, name)
    if seen is None:
        return np.zeros(len(samples), np.bool_)
    if isinstance(seen, list):
        return np.array([each is not None for each in seen], dtype=np.bool_)
    return ~np.isnan(seen[0])


def _in_pieces(placed: Sequence[_Placed]) -> Iterator[list[_Placed]]:
    """Results with not too many samples together."""
    some, size = list[_Placed](), 0
    for each in placed:
        if some and size + each.end - each.first > _PLACES:
            yield some
            some, size = [], 0
        some.append(each)
        size += each.end - each.first
    if some:
        yield some
