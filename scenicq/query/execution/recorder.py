"""What a program records of its matches: the values of expressions on the labels, under the correspondence.

Values are those of conditions over time (`temporal/atoms`): what labels observe, exact, at each sample. One that hangs
on a hidden random variable is that of the witness. Where there is none, it is None, with the reason counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.forest.columns import DEFINED, UNDEFINED, value_reader
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Identity, Kind, Node, Value
from scenicq.forest.scenario import RecordedValue, Scenario
from scenicq.forest.unobserved import is_only_observed
from scenicq.forest.walk import features, leaves
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.problem.conditioned import options_of
from scenicq.match.verdict import Match, WitnessValue
from scenicq.query.execution.members import Members, fill_by_recording
from scenicq.query.execution.results import Recorded, RecordedCell, Result
from scenicq.store.dataset import Dataset
from scenicq.store.track_block import TrackBlock
from scenicq.temporal.atoms import AtomColumns, UnclearVariable
from scenicq.temporal.samples import MOVING, BoundSamples

__all__ = ["Recorder"]

_PLACES = 50_000
"""Samples of results whose values are worked out together."""
_CHANCE, _NO_VALUE, _NOT_OBSERVED = "hangs on chance", "no value", "not observed"
_SEVERAL, _TOO_MUCH = "several directions", "too much to work out"


@dataclass(frozen=True, eq=False, slots=True)
class _Placed:
    """A result with its samples.

    Attributes:
        result: The result.
        first, end: Its labels in the block, the end left out.
        members: Who plays each object at each of them; -1 where it is not seen.
    """

    result: Result
    first: int
    end: int
    members: Mapping[int, NDArray[np.int64]]


@dataclass(eq=False)
class Recorder:
    """Works out what results carry.

    Attributes:
        dataset: The dataset.
        scenario: The scenario, which records something.
        options: Options of the matcher.
    """

    dataset: Dataset
    scenario: Scenario
    options: MatchOptions

    def __post_init__(self) -> None:
        """Find what the values read of labels that a program may say in their place."""
        self._indices = {owner.name: owner.index for owner in self.scenario.objects}
        found: dict[tuple[int, str], None] = {}
        todo = list(features(*(each.value for each in self.scenario.records)))
        while todo:
            index, name = todo.pop()
            if index < 0 or name in MOVING or (index, name) in found or is_only_observed(self.scenario, index, name):
                continue
            found[index, name] = None
            todo += features(self.scenario.objects[index].properties[name].value)
        self._steady = sorted(found)

    def fill(self, results: Sequence[Result]) -> list[Result]:
        """The same results, in which matches carry what is recorded."""
        return list(fill_by_recording(results, self._of_recording))

    def _of_recording(self, recording: str, results: list[Result]) -> Iterator[Result]:
        with Members.of_recording(self.dataset, recording) as members:
            placed = [self._placed(members, each) for each in results if isinstance(each.verdict, Match)]
            recorded: list[Mapping[str, Recorded]] = []
            for some in _in_pieces(placed):
                recorded += self._recorded(members.block, some)
        told = iter(recorded)
        for each in results:
            yield replace(each, recorded=next(told)) if isinstance(each.verdict, Match) else each

    def _placed(self, members: Members, result: Result) -> _Placed:
        first = members.numbers[result.frame]
        end = first + (1 if result.interval is None else result.interval.count)
        roles = cast(Match, result.verdict).correspondence
        who = members.at if result.interval is None else members.along
        return _Placed(
            result, first, end, {self._indices[name]: who(named, first, end) for name, named in roles.items()}
        )

    def _recorded(self, block: TrackBlock, placed: Sequence[_Placed]) -> list[Mapping[str, Recorded]]:
        """What some results carry, by the name of the value."""
        sizes = np.array([each.end - each.first for each in placed])
        starts = np.cumsum(sizes) - sizes
        labels = np.concatenate([np.arange(each.first, each.end) for each in placed])
        members = {
            index: np.concatenate([each.members.get(index, np.full(each.end - each.first, -1)) for each in placed])
            for index in self._indices.values()
        }
        samples = BoundSamples(block, members, len(labels), labels, self.options.classes)
        found: list[dict[str, Recorded]] = [{} for _ in placed]
        # what the program says in place of what no sample of a result has is the same whatever other results are there
        for numbers in self._alike(samples, starts, len(placed)):
            own = _Stretches(samples, starts, sizes, numbers)
            columns = own.columns(self.scenario)
            for each in self.scenario.records:
                look()
                value = columns.expanded(each.value)
                marks = {leaf.span.mark for leaf in leaves(value) if leaf.span is not None}
                if any(not marks.isdisjoint(_proof(placed[number])) for number in numbers):
                    for number in numbers:
                        alone = _Stretches(samples, starts, sizes, [number])
                        given = alone.columns(self.scenario).assigned(_assignment(value, _proof(placed[number])))
                        found[number][each.name] = next(alone.told(each, *_values(given, value)))
                else:
                    for number, told in zip(numbers, own.told(each, *_values(columns, value)), strict=True):
                        found[number][each.name] = told
        # in the order of the program
        return [{each.name: mine[each.name] for each in self.scenario.records} for mine in found]

    def _alike(self, samples: BoundSamples, starts: NDArray[np.int64], count: int) -> list[list[int]]:
        """The results, those together of which labels observe the same that does not change."""
        if not self._steady:
            return [list(range(count))]
        seen = [np.logical_or.reduceat(_is_seen(samples, index, name), starts).tolist() for index, name in self._steady]
        groups: dict[tuple[bool, ...], list[int]] = {}
        for number in range(count):
            groups.setdefault(tuple(each[number] for each in seen), []).append(number)
        return list(groups.values())


@dataclass(frozen=True, eq=False, slots=True)
class _Stretches:
    """The samples of some results among those of all.

    Attributes:
        samples: All samples.
        starts, sizes: Where those of each result begin, and how many they are.
        numbers: Which results.
    """

    samples: BoundSamples
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    numbers: Sequence[int]

    def columns(self, scenario: Scenario) -> AtomColumns:
        """What is read at these samples, each from the start of its result."""
        sizes = self.sizes[self.numbers]
        begins = np.cumsum(sizes) - sizes
        begin_of, size_of = self.starts.tolist(), self.sizes.tolist()
        chosen: NDArray[np.int64] = np.concatenate(
            [np.arange(begin_of[n], begin_of[n] + size_of[n], dtype=np.int64) for n in self.numbers]
        )
        return AtomColumns(scenario, self.samples.at(chosen), start=np.repeat(begins, sizes))

    def told(
        self, value: RecordedValue, cells: Sequence[RecordedCell], lacking: Sequence[str]
    ) -> Iterator[Recorded]:  # fmt: skip
        """What each result carries of a value, given that at each sample and why there is none."""
        begin = 0
        for size in self.sizes[self.numbers].tolist():
            chosen = slice(begin, begin + size)
            if value.when != "always":
                place = begin if value.when == "initial" else begin + size - 1
                chosen = slice(place, place + 1)
            reasons = Counter(reason for reason in lacking[chosen] if reason)
            yield Recorded(tuple(cells[chosen]), value.when == "always", dict(sorted(reasons.items())))
            begin += size


def _proof(placed: _Placed) -> Mapping[str, WitnessValue]:
    return cast(Match, placed.result.verdict).witness


def _values(columns: AtomColumns, value: Node) -> tuple[list[RecordedCell], list[str]]:
    """A value at each sample, None where there is none, and the reason for that.

    What hangs on a choice without a value, such as which of several lanes is meant, is known where all options that
    there are agree.
    """
    size, found = len(columns.samples), list[tuple[list[RecordedCell], list[str]]]()
    choices = [leaf for leaf in leaves(value) if leaf.identity not in columns.assignment]
    options = [options_of(leaf) for leaf in choices]
    known = [each for each in options if each is not None]
    if len(known) < len(options) or math.prod(map(len, known)) > LIMITS.outcomes_over_time:
        return [None] * size, [_CHANCE] * size
    for picked in product(*known):
        look()
        given = dict(zip((leaf.identity for leaf in choices), map(float, picked), strict=True))
        found.append(_with_choices(columns.assigned({**columns.assignment, **given}) if given else columns, value))
    if len(found) == 1:
        return found[0]
    told = [_agreed(each) for each in zip(*(zip(*each, strict=True) for each in found), strict=True)]
    return [cell for cell, _ in told], [reason for _, reason in told]


def _agreed(outcomes: Sequence[tuple[RecordedCell, str]]) -> tuple[RecordedCell, str]:
    """The value in which options agree, those left out that are not there."""
    there = {each for each in outcomes if each[1] != _NO_VALUE}
    if len(there) == 1:
        return there.pop()
    return None, _CHANCE if there else _NO_VALUE


def _with_choices(columns: AtomColumns, value: Node) -> tuple[list[RecordedCell], list[str]]:
    """As `_values`, all choices made."""
    size = len(columns.samples)
    try:
        column, several = columns.with_first_directions(value)
    except UnclearVariable:
        return [None] * size, [_CHANCE] * size
    except CannotEvaluate:
        return [None] * size, [_TOO_MUCH] * size
    status = np.broadcast_to(column.status, size)
    reasons = np.where(status == DEFINED, "", np.where(status == UNDEFINED, _NO_VALUE, _NOT_OBSERVED)).astype(object)
    reasons[(status == DEFINED) & several] = _SEVERAL
    read, kind = value_reader(column.data, (size,)) if (reasons == "").any() else None, kind_of(value)
    cells: list[RecordedCell] = []
    for place, reason in enumerate(reasons.tolist()):
        cell = None if reason or read is None else _cell(read(place), kind)
        if cell is None and not reason:
            reasons[place] = _NO_VALUE
        cells.append(cell)
    return cells, reasons.tolist()


def _cell(value: Value, kind: Kind) -> RecordedCell:
    if kind == "boolean" and isinstance(value, float):
        # beside options that are not there, truth values are numbers
        return bool(value)
    if isinstance(value, bool | str) or (isinstance(value, float) and np.isfinite(value)):
        return value
    if isinstance(value, tuple) and bool(np.isfinite(value).all()):
        return value
    return None


def _assignment(value: Node, witness: Mapping[str, WitnessValue]) -> dict[Identity, Value]:
    """The values that a witness gives to random variables, where it names them without doubt."""
    places: dict[str, set[Identity]] = {}
    for leaf in leaves(value):
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
