"""What a program records of its matches: the values of expressions on the labels, under the correspondence.

Values are those of conditions over time (`temporal/atoms`): what labels observe, exact, at each sample. One that hangs
on a hidden random variable is that of the witness. Where there is none, it is None, with the reason counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import cast

import numpy as np

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.forest.columns import DEFINED, UNDEFINED, value_reader
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Kind, Node, Value
from scenicq.forest.scenario import RecordedValue, Scenario
from scenicq.forest.walk import leaves
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.problem.conditioned import options_of
from scenicq.match.verdict import Match
from scenicq.query.execution.members import Members, fill_by_recording
from scenicq.query.execution.result_samples import ResultSamples, ResultStretches, assignment_of
from scenicq.query.execution.results import CarriedValue, RecordedCell, Result
from scenicq.store.dataset import Dataset
from scenicq.temporal.atoms import AtomColumns, UnclearVariable

__all__ = ["Recorder"]

_CHANCE, _NO_VALUE, _NOT_OBSERVED = "hangs on chance", "no value", "not observed"
_SEVERAL, _TOO_MUCH = "several directions", "too much to work out"


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
    _samples: ResultSamples = field(init=False)

    def __post_init__(self) -> None:
        """Read of which objects the values are."""
        self._samples = ResultSamples(
            self.scenario, self.options, tuple([each.value for each in self.scenario.records])
        )

    def fill(self, results: Sequence[Result]) -> list[Result]:
        """Put the recorded values into the results that match."""
        return list(fill_by_recording(results, self._of_recording))

    def _of_recording(self, recording: str, results: list[Result]) -> Iterator[Result]:
        matches = [each for each in results if isinstance(each.verdict, Match)]
        recorded: dict[int, Mapping[str, CarriedValue]] = {}
        with Members.of_recording(self.dataset, recording) as members:
            for own in self._samples.stretches(members, matches):
                recorded.update(zip(own.numbers, self._recorded(own, matches), strict=True))
        told = iter(recorded[number] for number in range(len(matches)))
        for each in results:
            yield replace(each, recorded=next(told)) if isinstance(each.verdict, Match) else each

    def _recorded(self, own: ResultStretches, matches: Sequence[Result]) -> list[Mapping[str, CarriedValue]]:
        """What some results carry, by the name of the value."""
        found: list[dict[str, CarriedValue]] = [{} for _ in own.numbers]
        columns = own.columns(self.scenario)
        proofs = [cast(Match, matches[number].verdict).witness for number in own.numbers]
        for each in self.scenario.records:
            look()
            value = columns.expanded(each.value)
            marks = {leaf.span.mark for leaf in leaves(value) if leaf.span is not None}
            if any(not marks.isdisjoint(proof) for proof in proofs):
                for place, proof in enumerate(proofs):
                    alone = own.select([place])
                    given = alone.columns(self.scenario).assigned(assignment_of((value,), proof))
                    found[place][each.name] = next(_told(alone, each, *_values(given, value)))
            else:
                for place, told in enumerate(_told(own, each, *_values(columns, value))):
                    found[place][each.name] = told
        # in the order of the program
        return [{each.name: mine[each.name] for each in self.scenario.records} for mine in found]


def _told(
    own: ResultStretches, value: RecordedValue, cells: Sequence[RecordedCell], lacking: Sequence[str]
) -> Iterator[CarriedValue]:
    """What each result carries of a value, given that at each sample and why there is none."""
    for chosen in own.slices():
        mine = chosen
        if value.when != "always":
            place = mine.start if value.when == "initial" else mine.stop - 1
            mine = slice(place, place + 1)
        reasons = Counter(reason for reason in lacking[mine] if reason)
        yield CarriedValue(tuple(cells[mine]), value.when == "always", dict(sorted(reasons.items())))


def _values(columns: AtomColumns, value: Node) -> tuple[list[RecordedCell], list[str]]:
    """A value at each sample, None where there is none, and the reason for that.

    What depends on a choice without a value, such as which of several lanes is meant, is known where all options that
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
