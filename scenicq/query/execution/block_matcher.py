"""One block of a query decided: prefilter, then the matcher on what is left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import DeadlineError
from scenicq.forest.among import properties_of_others
from scenicq.forest.scenario import Scenario
from scenicq.forest.unobserved import MOTION
from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import relevant_properties
from scenicq.match.problem.outcome import UNOBSERVED as REASON
from scenicq.match.verdict import Cause, Match, Unknown, Verdict
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.results import Result
from scenicq.query.execution.sql_deadline import SqlWatch, sql_deadline
from scenicq.query.prefilter.condition_reader import course_column
from scenicq.query.prefilter.decision import MATCHING, UNOBSERVED, decided_frames
from scenicq.query.prefilter.executor import Block, keep_players, names, object_rows, run_players, run_prefilter
from scenicq.query.prefilter.plan import LABELS, Plan, make_plan
from scenicq.query.prefilter.survivors import Candidate, CandidateRows, candidate_rows, candidates
from scenicq.recent import Recent
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.temporal.interval_options import IntervalOptions

if TYPE_CHECKING:  # they take long to load, and not every query needs the last two
    import duckdb

    from scenicq.match.matcher import Matcher
    from scenicq.match.problem.candidates import Candidates
    from scenicq.query.execution.own_lanes import OwnLanes
    from scenicq.query.execution.recorder import Recorder
    from scenicq.query.execution.recording_matcher import DecidedRecordings, RecordingMatcher, Survivors
    from scenicq.query.execution.timelines import Timelines
    from scenicq.query.execution.variant_matcher import VariantMatcher

_FIRST_BATCH, _BATCH = 16, 2048
"""Labels whose places are looked up together: few until it is known what matters."""
MAPS_KEPT = 8
"""Maps of which a process keeps what it needs to match: each is a few megabytes, and labels come map by map."""
__all__ = ["MAPS_KEPT", "BlockOutcome", "CompiledMap", "Decider", "every_label", "has_timelines"]


@dataclass(frozen=True, slots=True)
class CompiledMap:
    """A scenario over one map.

    Attributes:
        scenario: The scenario.
        network: The map.
        plan: The prefilter.
        motion: Whether the scenario reads observed motion.
        observed: The properties of label objects that matter; None for all.
        whole: Whether all label objects matter, not only those that may play a role.
        on_course: Whether it matters where label objects are on the ego's course.
        anywhere: Whether all but the network is the same over any map of the same traits.
    """

    scenario: Scenario
    network: Network
    plan: Plan
    motion: bool = True
    observed: frozenset[str] | None = None
    whole: bool = False
    on_course: bool = False
    anywhere: bool = False

    @classmethod
    def of(
        cls, scenario: Scenario, network: Network, options: MatchOptions, *, prefilter: bool, proofs: bool = True,
        reasons: bool = True,
    ) -> CompiledMap:  # fmt: skip
        """With its prefilter, or with one that excludes nothing.

        Without proofs the prefilter says what surely matches, too; without reasons it blames any step.
        """
        plan = Plan(network.name, (), "", (), None)
        if prefilter:
            plan = make_plan(scenario, network, options, deciding=not proofs, counting=reasons)
        asked = properties_of_others(scenario)
        every = (scenario, *scenario.variants)
        relevant = [names for each in every for names in relevant_properties(each, options)]
        observed = frozenset[str](asked or ()).union(*relevant)
        motion, whole = not MOTION.isdisjoint(observed), asked is not None or bool(scenario.variants)
        on_course = any(course_column(each) for each in every)
        return cls(scenario, network, plan, motion, observed, whole, on_course, not network.is_read)

    def over(self, scenario: Scenario, network: Network) -> CompiledMap:
        """Make the compiled map of another map with the same traits, from the scenario over that map."""
        variants = tuple(replace(each, map=network.name) for each in scenario.variants)
        named = replace(scenario, map=network.name, variants=variants)
        return replace(self, scenario=named, network=network, plan=replace(self.plan, map=network.name))


@dataclass(frozen=True, slots=True)
class BlockOutcome:
    """What became of a block.

    Attributes:
        missed: For each frame in order the number of the plan's step that excludes it, -1 for candidates.
        found: For each candidate in order its results, at least one.
        names: Frame, recording and timestamp of every frame, if asked for.
        recordings: What became of the recordings, for a query over time; then nothing is found of single candidates.
    """

    missed: NDArray[np.int16]
    found: Iterator[list[Result]] | list[list[Result]]
    names: list[tuple[str, str, int]]
    recordings: DecidedRecordings | None = None


@dataclass(slots=True)
class Decider:
    """What a process keeps between blocks.

    Attributes:
        dataset: The dataset.
        options: Options of the matcher.
        solver: By name.
        plan_map: Gives the program over a map, or over one that differs in nothing that the prefilter asks for.
        compile_map: Gives the program over a map; what is not asked for again soon is not kept.
        threads: Threads of the database.
        all_matches: Whether every correspondence is a result.
        every: Whether the names of excluded frames are wanted.
        proofs: Whether somebody reads the values that prove matches over time.
        reasons: Whether somebody reads what frames and bindings fail at in a query over time.
        timelines: Whether somebody reads what roles do from when to when in a query over time.
        time: Options of a query over time.
        until: When the time is over; see `budget.deadline`.
    """

    dataset: Dataset
    options: MatchOptions
    solver: str
    plan_map: Callable[[str], CompiledMap]
    compile_map: Callable[[str], CompiledMap]
    threads: int | None
    all_matches: bool
    every: bool
    proofs: bool = True
    reasons: bool = True
    timelines: bool = False
    time: IntervalOptions = field(default_factory=IntervalOptions)
    until: float | None = None
    _recorders: Recent[str, Recorder] = field(default_factory=lambda: Recent(MAPS_KEPT))
    _timelines: Recent[str, Timelines] = field(default_factory=lambda: Recent(MAPS_KEPT))
    _own_lanes: Recent[str, OwnLanes | None] = field(default_factory=lambda: Recent(MAPS_KEPT))
    _matchers: Recent[str, Matcher] = field(default_factory=lambda: Recent(MAPS_KEPT))
    _over_time: Recent[str, RecordingMatcher | VariantMatcher] = field(default_factory=lambda: Recent(MAPS_KEPT))
    _open: ExitStack = field(default_factory=ExitStack)
    _connection: duckdb.DuckDBPyConnection | None = None
    _solver: LazySolver | None = None

    def __enter__(self) -> Decider:
        """Connect when needed."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let go of the database and the solver."""
        self._open.close()

    @property
    def connection(self) -> duckdb.DuckDBPyConnection:
        """To the dataset, without views."""
        if self._connection is None:
            self._connection = self.dataset.connect(threads=self.threads, views=False)
            self._open.callback(self._connection.close)
            self._open.enter_context(SqlWatch(self._connection, self.until))
            self._solver = self._open.enter_context(LazySolver(self.solver))
        return self._connection

    def decide(self, block: Block) -> BlockOutcome:
        """Decide a block; its results come while they are taken, before the next block.

        Raises:
            ScenarioError: The program does not fit the map.
            DeadlineError: The time is over; while results are taken, too.
        """
        with sql_deadline(self.until):
            decided = self._decide(block)
        if self.until is not None:
            decided = replace(decided, found=self._in_time(iter(decided.found)))
        recorder = self._recorder(block.map)
        if recorder is None:
            return decided
        # what was found in time is recorded, however late it is then
        if decided.recordings is not None:
            decided.recordings.results = recorder.fill(decided.recordings.results)
            return decided
        return replace(decided, found=_with_records(recorder, iter(decided.found)))

    def _in_time(self, found: Iterator[list[Result]]) -> Iterator[list[Result]]:
        """What is found before the time is over, which is looked at while each is looked for."""
        while True:
            with sql_deadline(self.until):
                each = next(found, None)
            if each is None:
                return
            yield each

    def _decide(self, block: Block) -> BlockOutcome:
        connection, compiled = self.connection, self.plan_map(block.map)
        if block.runs:
            return self._recordings(compiled, block)
        if not compiled.plan.stages:
            labels = [Candidate(label, None) for label in every_label(self.dataset, block, motion=compiled.motion)]
            return BlockOutcome(np.full(len(labels), -1, np.int16), self._matched(iter(labels)), [])
        missed = run_prefilter(self.dataset, connection, compiled.plan, block)
        named = names(self.dataset, connection, block) if self.every else []
        if not (missed < 0).any():
            return BlockOutcome(missed, [], named)
        if compiled.plan.decision and not self.all_matches:
            return BlockOutcome(missed, self._partly_decided(compiled), named)
        return BlockOutcome(missed, self._matched(self._left(compiled, observed=compiled.observed)), named)

    def _partly_decided(self, compiled: CompiledMap) -> Iterator[list[Result]]:
        """The results of the frames that the prefilter has left, where SQL tells some of them."""
        rows = decided_frames(self.connection, compiled.plan.decision, LABELS, compiled.plan.left)
        left = np.array([number for number, told, *_ in rows if not told], dtype=np.int64)
        asked = self._matched(self._left(compiled, left, observed=compiled.observed) if len(left) else iter(()))
        verdicts: dict[int, Verdict] = {MATCHING: Match({}, {}), UNOBSERVED: Unknown(REASON, Cause(""))}
        none = dict[str, str]()
        for _, told, frame, recording, time in rows:
            yield [Result(frame, recording, time, verdicts[told], none)] if told else next(asked)

    def _left(
        self, compiled: CompiledMap, among: NDArray[np.int64] | None = None, *, observed: frozenset[str] | None
    ) -> Iterator[Candidate]:
        """The labels that the prefilter has left, with as much of each as the matcher looks at."""
        return candidates(
            self.connection,
            compiled.plan,
            motion=compiled.motion,
            observed=observed,
            among=among,
            recorded=self.dataset.recorded,
            whole=compiled.whole,
            on_course=compiled.on_course,
        )

    def _recordings(self, compiled: CompiledMap, block: Block) -> BlockOutcome:
        """Decide a block of whole recordings over time."""
        # takes long to load
        from scenicq.query.execution.recording_matcher import DecidedRecordings, Survivors  # noqa: PLC0415

        connection, plan = self.connection, compiled.plan
        rows: CandidateRows | None = None
        every = np.concatenate([np.arange(*run) for run in block.runs])
        if not plan.stages:
            missed = np.full(len(every), -1, np.int16)

            def read(wanted: NDArray[np.int64]) -> Iterator[Candidate]:
                labels = self.dataset.labels_in(block.part, wanted, motion=compiled.motion)
                return (Candidate(label, None) for label in labels)
        elif plan.players:
            missed, players = self._players(plan, block, every)
            rows = CandidateRows.of(players, len(plan.roles or ()))
            kept: list[bool] = []

            def read(wanted: NDArray[np.int64]) -> Iterator[Candidate]:
                if not kept:
                    keep_players(self.dataset, connection, plan, block, players)
                    kept.append(True)
                return self._left(compiled, wanted, observed=None)
        else:
            missed = run_prefilter(self.dataset, connection, plan, block)
            if plan.roles and (missed < 0).any():
                rows = candidate_rows(connection, plan)

            def read(wanted: NDArray[np.int64]) -> Iterator[Candidate]:
                return self._left(compiled, wanted, observed=None)

        left = Survivors(every[missed < 0], rows, plan.roles or (), read)
        if not len(left.labels):
            return BlockOutcome(missed, [], [], DecidedRecordings.nothing(block))
        parts, found = block.by_map(), DecidedRecordings()
        objects = object_rows(self.dataset, connection, block) if len(parts) > 1 else {}
        for part in parts:
            mine = left.within(part, objects.get(part.map))
            found.add(self._on_map(part, mine) if len(mine.labels) else DecidedRecordings.nothing(part))
        return BlockOutcome(missed, [], [], found)

    def _on_map(self, block: Block, left: Survivors) -> DecidedRecordings:
        """Decide recordings of one map, some labels of which the prefilter has left."""
        found = self._recording_matcher(block.map).decide(block, left)
        if (own_lanes := self._lanes_of(block.map)) is not None:
            found.results = [*own_lanes.at_the_start(self.dataset, found.results)]
        if self.timelines and (filler := self._timelines_of(block.map)) is not None:
            found.results = filler.fill(found.results)
        return found

    def _recorder(self, map_name: str) -> Recorder | None:
        """What works out what the program records; None where nobody reads that."""
        if not (self.proofs and self.plan_map(map_name).scenario.records):
            return None
        # takes long to load
        from scenicq.query.execution.recorder import Recorder  # noqa: PLC0415

        def make() -> Recorder:
            return Recorder(self.dataset, self.compile_map(map_name).scenario, self.options)

        return self._recorders.get(map_name, make)

    def _lanes_of(self, map_name: str) -> OwnLanes | None:
        """What names the lanes of roles; None where nobody reads them, or the program asks for none."""
        if not self.proofs:
            return None
        # takes long to load
        from scenicq.query.execution.own_lanes import OwnLanes  # noqa: PLC0415

        def make() -> OwnLanes | None:
            planned = self.plan_map(map_name)
            return OwnLanes(self.compile_map(map_name).scenario) if OwnLanes(planned.scenario).asked else None

        return self._own_lanes.get(map_name, make)

    def _timelines_of(self, map_name: str) -> Timelines | None:
        """What works out what roles do from when to when; None where the program does not say."""
        if not has_timelines(self.plan_map(map_name).scenario):
            return None
        # takes long to load
        from scenicq.query.execution.timelines import Timelines  # noqa: PLC0415

        def make() -> Timelines:
            compiled = self.compile_map(map_name)
            return Timelines(self.dataset, compiled.scenario, map_name, self.options)

        return self._timelines.get(map_name, make)

    def _players(
        self, plan: Plan, block: Block, frames: NDArray[np.int64]
    ) -> tuple[NDArray[np.int16], Mapping[str, NDArray[Any]]]:
        """Which frames of a block a plan without stages excludes, and the candidates of each role in the others."""
        found = run_players(self.dataset, self.connection, plan, block)
        place = np.searchsorted(frames, found["f"])
        roles = [
            np.bincount(place[found[f"r{number}"]], minlength=len(frames)) for number in range(len(plan.roles or ()))
        ]
        left = np.logical_and.reduce(
            [np.bincount(place, minlength=len(frames)) >= len(roles), *(each > 0 for each in roles)]
        )
        missed = np.where(left, -1, 0).astype(np.int16)
        return missed, {name: each[left[place]] for name, each in found.items()}

    def _recording_matcher(self, map_name: str) -> RecordingMatcher | VariantMatcher:
        # take long to load
        from scenicq.match.matcher import Matcher  # noqa: PLC0415
        from scenicq.query.execution.recording_matcher import RecordingMatcher  # noqa: PLC0415
        from scenicq.query.execution.variant_matcher import VariantMatcher  # noqa: PLC0415
        from scenicq.temporal.intervals import IntervalMatcher  # noqa: PLC0415

        def made(scenario: Scenario, matcher: Matcher) -> RecordingMatcher:
            intervals = IntervalMatcher(scenario, self.options, self.time, self._solver, self.reasons)
            return RecordingMatcher(self.dataset, matcher, intervals, self.every, self.proofs, self.reasons)

        def make() -> RecordingMatcher | VariantMatcher:
            scenario = self.compile_map(map_name).scenario
            if not scenario.variants:
                return made(scenario, self._matcher(map_name))
            return VariantMatcher([made(one, Matcher(one, self.options, self._solver)) for one in scenario.variants])

        return self._over_time.get(map_name, make)

    def _matcher(self, map_name: str) -> Matcher:
        """The matcher of a map, where SQL has not decided everything."""
        # takes long to load
        from scenicq.match.matcher import Matcher  # noqa: PLC0415

        def make() -> Matcher:
            return Matcher(self.compile_map(map_name).scenario, self.options, self._solver)

        return self._matchers.get(map_name, make)

    def _matched(self, left: Iterator[Candidate]) -> Iterator[list[Result]]:
        """The results of labels, whose places are looked up so many at a time."""
        size = _FIRST_BATCH
        for map_name, mine in groupby(left, key=lambda each: each.label.map):
            matcher, own_lanes = self._matcher(map_name), self._lanes_of(map_name)
            while batch := list(islice(mine, size)):
                if self.all_matches:
                    for label, among in batch:
                        yield [_result(label, verdict, own_lanes) for verdict in _every_match(matcher, label, among)]
                else:
                    for (label, _), verdict in zip(batch, matcher.match_all(batch, details=self.every), strict=True):
                        yield [_result(label, verdict, own_lanes)]
                size = _BATCH


def has_timelines(scenario: Scenario) -> bool:
    """Whether a program has a behavior, a monitor or a scenario that runs others."""
    return any(each.dynamics is not None and each.dynamics.processes for each in (scenario, *scenario.variants))


def _with_records(recorder: Recorder, found: Iterator[list[Result]]) -> Iterator[list[Result]]:
    """Results with what the program records, which is worked out of many together."""
    size, late = _FIRST_BATCH, False
    while not late:
        taken: list[list[Result]] = []
        try:
            taken.extend(islice(found, size))
        except DeadlineError:
            late = True
        told = iter(recorder.fill([each for several in taken for each in several]))
        for several in taken:
            yield list(islice(told, len(several)))
        if len(taken) < size and not late:
            return
        size = _BATCH
    raise DeadlineError


def _result(label: Label, verdict: Verdict, own_lanes: OwnLanes | None) -> Result:
    lanes = None
    if own_lanes is not None and isinstance(verdict, Match):
        lanes = own_lanes.of_label(label, verdict.correspondence)
    return Result(label.frame, label.recording, label.timestamp_us, verdict, label.sensors, lanes=lanes)


def _every_match(matcher: Matcher, label: Label, among: Candidates | None) -> list[Verdict]:
    """Every correspondence by which a label matches and whether there may be more, or else why none does."""
    return [finding.verdict for finding in matcher.findings(label, candidates=among)]


def every_label(dataset: Dataset, block: Block, *, motion: bool = False) -> Iterator[Label]:
    """The labels of a block, read without the database."""
    labels = dataset.labels_at(block.part, block.first, block.end, motion=motion)
    return (label for label in labels if block.has(label.map, label.recording))
