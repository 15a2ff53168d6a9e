"""The samples of results as columns, so that values at the samples of many results are computed at once.

A result that is a frame has one sample, and an interval has one for each of its frames. Results of one recording share
columns where their labels observe the same properties: then the program says the same in place of what they lack.
"""

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

_BATCH_SAMPLES = 50_000
"""Samples whose values are computed together, unless one result alone has more."""


@dataclass(frozen=True, eq=False, slots=True)
class _ResultRows:
    """Where a result lies in a block.

    Attributes:
        first, end: Its labels in the block, the end left out.
        members: For each role, the row of its label object at each of these labels; -1 where it is not observed.
    """

    first: int
    end: int
    members: Mapping[int, NDArray[np.int64]]


@dataclass(frozen=True, eq=False, slots=True)
class ResultStretches:
    """Some results of a recording, with their samples among those of a batch of results.

    Attributes:
        samples: The samples of the whole batch, result by result.
        starts, sizes: Where the samples of each result of the batch begin, and how many they are.
        numbers: The numbers of the selected results among all results of the recording.
        first: The number of the batch's first result.
    """

    samples: BoundSamples
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    numbers: Sequence[int]
    first: int

    def select(self, places: Sequence[int]) -> ResultStretches:
        """Select some of the results, by their places in `numbers`."""
        return replace(self, numbers=[self.numbers[place] for place in places])

    def labels(self) -> NDArray[np.int64]:
        """The row of the label of each sample of the selected results."""
        assert self.samples.labels is not None
        return self.samples.labels[self.places()]

    def places(self) -> NDArray[np.int64]:
        """The place in `samples` of each sample of the selected results, result by result."""
        own = np.array(self.numbers) - self.first
        return expand_ranges(self.starts[own], self.sizes[own])

    def bounds(self) -> NDArray[np.int64]:
        """Where the samples of each selected result begin in `places`, and the end of the last ones."""
        return np.concatenate(([0], np.cumsum(self.sizes[np.array(self.numbers) - self.first])))

    def slices(self) -> Iterator[slice]:
        """The samples of each selected result, as slices of `places`."""
        ends = cast("list[int]", self.bounds().tolist())
        return map(slice, ends[:-1], ends[1:])

    def columns(self, scenario: Scenario) -> AtomColumns:
        """Columns that evaluate expressions at these samples; each result begins at its own first sample."""
        ends = self.bounds()
        return AtomColumns(scenario, self.samples.at(self.places()), start=np.repeat(ends[:-1], np.diff(ends)))


@dataclass(eq=False)
class ResultSamples:
    """Reads the samples at which expressions are evaluated.

    Attributes:
        scenario: The scenario.
        options: Options of the matcher.
        values: The expressions.
    """

    scenario: Scenario
    options: MatchOptions
    values: tuple[Node, ...]
    _indices: dict[str, int] = field(init=False)
    _replaceable: list[tuple[int, str]] = field(init=False)

    def __post_init__(self) -> None:
        """Find properties that the expressions read, and for which the program has a value where labels lack them."""
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
        self._replaceable = sorted(found)

    def stretches(self, members: Members, matches: Sequence[Result]) -> Iterator[ResultStretches]:
        """The samples of the matches of a recording; matches whose labels observe the same properties come together."""
        first = 0
        for batch in _batches([self._rows_of(members, each) for each in matches]):
            sizes = np.array([each.end - each.first for each in batch])
            starts = np.cumsum(sizes) - sizes
            labels = expand_ranges(np.array([each.first for each in batch]), sizes)
            playing = {
                index: np.concatenate([each.members.get(index, np.full(each.end - each.first, -1)) for each in batch])
                for index in self._indices.values()
            }
            samples = BoundSamples(members.block, playing, len(labels), labels, self.options.classes)
            for numbers in self._group_by_observed(samples, starts, len(batch)):
                yield ResultStretches(samples, starts, sizes, [first + number for number in numbers], first)
            first += len(batch)

    def _rows_of(self, members: Members, result: Result) -> _ResultRows:
        first = members.numbers[result.frame]
        end = first + (1 if result.interval is None else result.interval.count)
        roles = cast(Match, result.verdict).correspondence
        find = members.at if result.interval is None else members.along
        return _ResultRows(first, end, {self._indices[name]: find(named, first, end) for name, named in roles.items()})

    def _group_by_observed(self, samples: BoundSamples, starts: NDArray[np.int64], count: int) -> list[list[int]]:
        """Group the results of a batch by which replaceable properties any of their samples observes."""
        if not self._replaceable:
            return [list(range(count))]
        seen = [
            np.logical_or.reduceat(_is_seen(samples, index, name), starts).tolist() for index, name in self._replaceable
        ]
        groups: dict[tuple[bool, ...], list[int]] = {}
        for number in range(count):
            groups.setdefault(tuple(each[number] for each in seen), []).append(number)
        return list(groups.values())


def assignment_of(values: Sequence[Node], witness: Mapping[str, WitnessValue]) -> dict[Identity, Value]:
    """The values that a witness gives to random variables; without those that share a place with another one."""
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


def _batches(results: Sequence[_ResultRows]) -> Iterator[list[_ResultRows]]:
    """Results in batches of at most `_BATCH_SAMPLES` samples; one that has more is a batch by itself."""
    batch, size = list[_ResultRows](), 0
    for each in results:
        if batch and size + each.end - each.first > _BATCH_SAMPLES:
            yield batch
            batch, size = [], 0
        batch.append(each)
        size += each.end - each.first
    if batch:
        yield batch
