"""What each role of a match does from when to when: which behavior, monitor or scenario of the program runs, and where.

Runs are followed once more (`temporal/timeline`), with the values of random variables that prove the match.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import cast

from scenicq.budget import look
from scenicq.forest.condition import expand
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import Activity, Dynamics, Process
from scenicq.forest.walk import leaves
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, WitnessValue
from scenicq.query.execution.members import Members, fill_by_recording
from scenicq.query.execution.recording_starts import make_start_label
from scenicq.query.execution.result_samples import ResultSamples, ResultStretches, assignment_of
from scenicq.query.execution.results import ModeRecord, ProgramPlace, Result
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.temporal.arrivals import Arrivals
from scenicq.temporal.atoms import UnclearVariable
from scenicq.temporal.outcomes import Outcome, outcomes_of, steady_value
from scenicq.temporal.timeline import ModeSegment, timeline_of
from scenicq.temporal.truth import Truth

__all__ = ["Timelines"]

_KINDS = ("behavior", "scenario", "monitor")


@dataclass(eq=False)
class _Variant:
    """One of the scenarios that runs of a program may be of, made ready.

    Attributes:
        scenario: The scenario.
        options: Options of the matcher.
    """

    scenario: Scenario
    options: MatchOptions
    outcomes: tuple[Outcome, ...] = field(init=False)
    samples: ResultSamples = field(init=False)
    arrivals: Arrivals | None = field(init=False)
    _read: dict[int, list[str]] = field(init=False, default_factory=dict["int", "list[str]"])

    def __post_init__(self) -> None:
        """Read what it says over time."""
        dynamics = self.scenario.dynamics
        conditions = () if dynamics is None else dynamics.conditions
        self.outcomes = outcomes_of(self.scenario)
        self.samples = ResultSamples(self.scenario, self.options, conditions)
        self.arrivals = Arrivals(self.scenario, self.options) if self.scenario.arrivals else None

    @property
    def roles(self) -> frozenset[str]:
        """The names of its objects."""
        return frozenset(owner.name for owner in self.scenario.every_object)

    def read(self, outcome: int) -> list[str]:
        """The random variables that conditions over time depend on, with an outcome."""
        if outcome not in self._read:
            scenario = self.outcomes[outcome].scenario
            conditions = () if scenario.dynamics is None else scenario.dynamics.conditions
            written = [expand(each, lambda feature: steady_value(scenario, feature)) for each in conditions]
            self._read[outcome] = [leaf.span.mark for leaf in leaves(*written) if leaf.span is not None]
        return self._read[outcome]

    def outcome(self, witness: Mapping[str, WitnessValue]) -> int:
        """The number of the outcome of choices that a witness has."""
        fits = (
            number for number, each in enumerate(self.outcomes)
            if all(witness.get(place, value) == value for place, value in each.witness.items())
        )  # fmt: skip
        return next(fits, 0)


@dataclass(eq=False)
class Timelines:
    """Works out what roles of matches do from when to when.

    Attributes:
        dataset: The dataset.
        scenario: A scenario that says something over time.
        map_name: The map.
        options: Options of the matcher.
    """

    dataset: Dataset
    scenario: Scenario
    map_name: str
    options: MatchOptions
    _variants: list[_Variant] = field(init=False)

    def __post_init__(self) -> None:
        """Make its variants ready."""
        self._variants = [_Variant(each, self.options) for each in self.scenario.variants or (self.scenario,)]

    def fill(self, results: Sequence[Result]) -> list[Result]:
        """Put timelines into intervals that match."""
        return list(fill_by_recording(results, self._of_recording))

    def _of_recording(self, recording: str, results: list[Result]) -> Iterator[Result]:
        matches = [each for each in results if isinstance(each.verdict, Match)]
        told: dict[int, tuple[ModeRecord, ...]] = {}
        sure: set[int] = set()
        with Members.of_recording(self.dataset, recording) as members:
            for variant in self._variants:
                # a run may have the same objects whenever they come
                mine = [n for n, each in enumerate(matches) if n not in sure and variant.roles == _roles(each)]
                some = [matches[number] for number in mine]
                for own in variant.samples.stretches(members, some):
                    for number, modes, may_match in self._modes(variant, members, own, some):
                        if may_match or mine[number] not in told:
                            told[mine[number]] = modes
                        sure |= {mine[number]} if may_match else set()
        modes_of = iter(told.get(number, ()) for number in range(len(matches)))
        for each in results:
            yield replace(each, timeline=next(modes_of)) if isinstance(each.verdict, Match) else each

    def _modes(
        self, variant: _Variant, members: Members, own: ResultStretches, matches: Sequence[Result]
    ) -> Iterator[tuple[int, tuple[ModeRecord, ...], bool]]:
        """The modes of some matches, each with its number, and whether the run may be one that matches."""
        # matches with the same values of random variables are read together
        alike: dict[tuple[int, tuple[tuple[str, WitnessValue], ...]], list[int]] = {}
        for place, number in enumerate(own.numbers):
            witness = cast(Match, matches[number].verdict).witness
            outcome = variant.outcome(witness)
            read = variant.read(outcome)
            alike.setdefault((outcome, tuple((each, witness[each]) for each in read if each in witness)), []).append(
                place
            )
        times_us = members.block.times_us
        for (number, values), places in alike.items():
            look()
            scenario = variant.outcomes[number].scenario
            assert scenario.dynamics is not None
            some = own.select(places)
            truths = self._truths(variant, scenario, some, dict(values))
            labels = some.labels()
            for which, chosen in zip(some.numbers, some.slices(), strict=True):
                here = {each: truth[chosen] for each, truth in truths.items()}
                mine = times_us[labels[chosen]]
                run = timeline_of(scenario.dynamics, mine, here)
                yield which, _mode_records(scenario, run.segments, mine.tolist()), run.may_match

    def _truths(
        self, variant: _Variant, scenario: Scenario, own: ResultStretches, witness: Mapping[str, WitnessValue]
    ) -> dict[int, Truth]:
        """What is known of conditions at each sample, by their numbers."""
        columns, dynamics = own.columns(scenario), cast(Dynamics, scenario.dynamics)
        expanded = [columns.expanded(each) for each in dynamics.conditions]
        given = assignment_of(expanded, witness)
        columns = columns.assigned(given) if given else columns
        found: dict[int, Truth] = {}
        for number, condition in enumerate(expanded):
            with suppress(UnclearVariable):
                found[number] = columns.truth(condition)
        if variant.arrivals is not None:
            block = own.samples.block

            def label(
                scene: Scenario, members: Mapping[int, int], relevant: Sequence[frozenset[str]]
            ) -> tuple[Label, Mapping[str, str]]:
                return make_start_label(scene, block, members, self.map_name, relevant)

            found.update(variant.arrivals.truths(own.samples.at(own.places()), own.bounds(), label))
        return found


def _roles(result: Result) -> frozenset[str]:
    return frozenset(cast(Match, result.verdict).correspondence)


def _mode_records(
    scenario: Scenario, segments: Sequence[ModeSegment], times_us: Sequence[int]
) -> tuple[ModeRecord, ...]:
    """Modes as results have them.

    Args:
        scenario: The program.
        segments: The modes of a run.
        times_us: Times of its samples.
    """
    dynamics = cast(Dynamics, scenario.dynamics)
    found: list[ModeRecord] = []
    for each in segments:
        process = dynamics.processes[each.process]
        # what goes on goes on to the next sample, if there is one
        end_us = times_us[min(each.last + 1, len(times_us) - 1)]
        kind, of = _whose(scenario, process, each.activity)
        found.append(
            ModeRecord(kind, of, _places(each.activity), times_us[each.first], end_us, each.last - each.first + 1)
        )
    # roles first, then scenarios and monitors
    return tuple(sorted(found, key=lambda each: _KINDS.index(each.kind)))


def _whose(scenario: Scenario, process: Process, activity: Activity | None) -> tuple[str, str]:
    if process.composes:
        return "scenario", "" if activity is None else _text(activity.what.text).partition("(")[0]
    if process.object is not None:
        return "behavior", scenario.every_object[process.object].name
    return "monitor", _text(process.span.text).removeprefix("require monitor ")


def _places(activity: Activity | None) -> list[ProgramPlace]:
    if activity is None:
        return []
    return [ProgramPlace(_text(each.text), each.mark) for each in (*activity.calls, activity.what)]


def _text(text: str) -> str:
    return " ".join(text.split())
