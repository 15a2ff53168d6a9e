"""Running a query: compile per map, prefilter, match the candidates, in the order of the store.

The dataset is worked through block by block, in this process or in workers; results come out in order either way.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scenicq.budget import DeadlineError
from scenicq.compiler.absent import check_enforced
from scenicq.compiler.element_lookups import LaneRule
from scenicq.compiler.program import compile_scenario
from scenicq.compiler.temporal import REACTION_S, Behaviors
from scenicq.errors import DataError, Diagnostic, ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.abstract_map import AbstractNetwork, NeedsMapError
from scenicq.geometry.map_traits import MapTraits
from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.verdict import Cause, NoMatch
from scenicq.query.execution.block_executor import BlockExecutor
from scenicq.query.execution.block_matcher import MAPS_KEPT, BlockOutcome, CompiledMap, Decider, has_timelines
from scenicq.query.execution.frames_ahead import FramesAhead, telling
from scenicq.query.execution.merged_blocks import merge_frames, merge_intervals, until_deadline
from scenicq.query.execution.never_compared import Coverage, coverage
from scenicq.query.execution.program_files import SiblingFiles
from scenicq.query.execution.program_map import (
    about_dataset,
    is_about_map,
    map_remark,
    misfit_remarks,
    program_remarks,
)
from scenicq.query.execution.recorded_columns import RecordedColumn, columns_of
from scenicq.query.execution.result_selection import ResultSelection
from scenicq.query.execution.results import Funnel, Result, limit_matches
from scenicq.query.execution.scenario_copies import ScenarioCopies
from scenicq.query.execution.sql_deadline import sql_deadline
from scenicq.query.prefilter.executor import Block, Extent, blocks, blocks_of, extents, names, whole_recordings
from scenicq.query.prefilter.plan import Plan
from scenicq.recent import Recent
from scenicq.store.dataset import Dataset, DatasetReference
from scenicq.store.manifest import Counts
from scenicq.store.said_values import said_types
from scenicq.temporal.interval_options import IntervalOptions

if TYPE_CHECKING:
    import duckdb

    from scenicq.query.execution.timelines import Timelines

__all__ = ["MAP_LACKS", "Query", "QueryOptions", "RecordingRange"]

MAP_LACKS = "map "
"""How the name of what excludes frames begins where it is their map; the map's follows."""


@dataclass(frozen=True, slots=True)
class QueryOptions:
    """How to run a query.

    Attributes:
        match: Options of the matcher.
        solver: Which solver, as `scenicq.smt.solver.open_solver` takes it.
        version: The version of Scenic; inferred if None.
        initial: Whether dynamic parts of the program are ignored.
        map_defaults: Whether the world model's classes place and turn their objects as the map has it.
        lanes: Which of several lanes that contain an object are its own.
        prefilter: Whether SQL narrows the frames first; the results are the same.
        jobs: Processes that match; None for as many as pays.
        limit: Matches after which to stop; None for all.
        where, sort: Which of the matches are shown and in what order, by what the program records (`selected`).
        every: Whether frames that do not match are results too.
        all_matches: Whether every correspondence of a frame is a result of its own.
        behaviors: What becomes of the behaviors of a program over time.
        reaction_s: Seconds that an object has to do what its behavior says, at each change.
        time: Options of intervals.
        model: The world model of a program that imports none.
        run_scenario: Which scenario of the program runs, by its name.
        params: Values of global parameters, whatever the program says.
        strict: Whether what the program sets and no label has is an error.
        proofs: Whether somebody reads how frames match; if not, a match that SQL decides names nobody and nothing.
        reasons: Whether somebody reads what frames fail at first; if not, the funnel does not say it of those that the
            prefilter excludes.
        interval_reasons: Whether somebody reads what frames and bindings fail at in a query over time; if not, the
            funnel does not say it, and counts of starts and bindings only those that the prefilter leaves.
        timelines: Whether somebody reads what roles do from when to when in a query over time.
        until: When the time is over, as of `time.monotonic`; None for never. What is decided by then are the results.
    """

    match: MatchOptions = MatchOptions()
    solver: str = "auto"
    version: Literal[1, 2, 3] | None = None
    initial: bool = False
    map_defaults: bool = True
    lanes: LaneRule = "along"
    prefilter: bool = True
    jobs: int | None = 1
    limit: int | None = None
    where: str | None = None
    sort: str | None = None
    every: bool = False
    all_matches: bool = False
    behaviors: Behaviors = "motion"
    reaction_s: float = REACTION_S
    time: IntervalOptions = field(default_factory=IntervalOptions)
    model: str | None = None
    run_scenario: str | None = None
    params: tuple[tuple[str, float | str], ...] = ()
    strict: bool = False
    proofs: bool = True
    reasons: bool = True
    interval_reasons: bool = True
    timelines: bool = False
    until: float | None = None

    @property
    def selects(self) -> bool:
        """Whether what the program records says which matches are shown, or in what order."""
        return self.where is not None or self.sort is not None


@dataclass(frozen=True, slots=True)
class RecordingRange:
    """Recordings of a map that follow each other in the order of their names.

    Attributes:
        first, last: The same name for one recording.
        frames: How many frames they have.
    """

    first: str
    last: str
    frames: int


@dataclass(slots=True)
class _Known:
    """What a query has found out once, for it and its copies with other recordings.

    Attributes:
        compiled: The program over maps that it has read, and one of each of those that are alike.
        recent: The program over others of these.
        alike: The program over any map of the same traits, or over one of them where it asks for nothing else.
        tried: The traits for which that was looked for over any map.
        copies: What makes the program over others of these.
        lacking: What maps lack that the program needs.
        scenarios: The program over all maps that it fits, one of those that are alike.
        extents: Where the frames of each map are.
        coverage: What is compared.
        attributes: The types of what labels say, by the names of attributes.
        timelines: What works out what roles do, by the map; None where the program does not say.
    """

    compiled: dict[str, CompiledMap] = field(default_factory=dict["str", CompiledMap])
    recent: Recent[str, CompiledMap] = field(default_factory=lambda: Recent(MAPS_KEPT))
    alike: dict[MapTraits, CompiledMap] = field(default_factory=dict[MapTraits, CompiledMap])
    tried: set[MapTraits] = field(default_factory=set[MapTraits])
    copies: dict[MapTraits, ScenarioCopies] = field(default_factory=dict[MapTraits, ScenarioCopies])
    lacking: dict[str, ScenarioError] = field(default_factory=dict["str", "ScenarioError"])
    scenarios: list[Scenario] | None = None
    extents: dict[str, list[Extent]] | None = None
    coverage: Coverage | None = None
    attributes: Mapping[str, frozenset[type]] | None = None
    timelines: dict[str, Timelines | None] = field(default_factory=dict["str", "Timelines | None"])


@dataclass(eq=False)
class Query:
    """A scenario and a dataset, ready to run.

    Attributes:
        dataset: The dataset.
        source: The program.
        options: The options.
        recordings: What to look at on which map; everything if None.
        funnel: Filled while results are taken.
        files: What reads the files that it imports; those of the folder that the program is named in if None.
    """

    dataset: Dataset
    source: Source
    options: QueryOptions = QueryOptions()
    recordings: Mapping[str, RecordingRange] | None = None
    funnel: Funnel = field(default_factory=Funnel)
    files: SiblingFiles | None = None
    _known: _Known = field(default_factory=_Known, repr=False)

    @property
    def siblings(self) -> SiblingFiles:
        """What reads the files that the program imports."""
        if self.files is None:
            self.files = SiblingFiles(Path(self.source.name))
        return self.files

    def compile(self, map_name: str) -> tuple[Scenario, Network]:
        """The scenario over one of the dataset's maps, ready to be matched.

        Raises:
            ScenarioError: The program is wrong, or does not fit the map.
        """
        network = self.dataset.network(map_name)
        try:
            return self._compile_over(network), network
        except ScenarioError as error:
            raise about_dataset(error, self.dataset, map_name) from None

    def _compile_over(self, network: Network) -> Scenario:
        scenario = compile_scenario(
            self.source, network, version=self.options.version, initial=self.options.initial,
            behaviors=self.options.behaviors, reaction_s=self.options.reaction_s, loader=self.siblings,
            model=self.options.model, map_defaults=self.options.map_defaults, gap_s=self.options.time.gap_s,
            lanes=self.options.lanes, scenario=self.options.run_scenario, params=dict(self.options.params),
            label_attributes=self._label_attributes,
        )  # fmt: skip
        check_enforced(scenario, self.options.match.enforce)
        return prepare_scenario(scenario)

    def _label_attributes(self) -> Mapping[str, frozenset[type]]:
        if self._known.attributes is None:
            self._known.attributes = said_types(self.dataset)
        return self._known.attributes

    def _check_ego(self) -> None:
        """Refuse to take a stand-in for an ego that the source does not have."""
        ego = str(self.dataset.manifest.provenance.facts.get("ego", ""))
        if ego.startswith("none") and self.options.match.ego == "label":
            raise DataError(
                Diagnostic(
                    "option-invalid",
                    f"{self.dataset.name} was ingested without an ego",
                    hints=("`--ego any` lets the scenario's ego be any object of its class",),
                )
            )

    def compiled_map(self, map_name: str) -> CompiledMap:
        """The scenario over one of the dataset's maps, with its prefilter; kept if it is asked for again soon.

        Raises:
            ScenarioError: The program is wrong, or does not fit the map.
        """
        known = self._known
        if map_name in known.compiled:
            return known.compiled[map_name]
        compiled = known.recent.get(map_name, lambda: self._compile_map(map_name))
        traits = self.dataset.traits(map_name)
        if traits is None or traits not in known.alike:
            known.compiled[map_name] = compiled
        if traits is not None and compiled.anywhere:
            known.alike.setdefault(traits, compiled)
        return compiled

    def _compile_map(self, map_name: str) -> CompiledMap:
        known, traits = self._known, self.dataset.traits(map_name)
        alike = known.alike.get(traits) if traits is not None else None
        if traits is None or alike is None:
            return self._with_prefilter(*self.compile(map_name))
        if traits not in known.copies:
            known.copies[traits] = ScenarioCopies(alike.scenario, alike.network)
        network = self.dataset.network(map_name)
        copied = known.copies[traits].over(network)
        return alike.over(*((copied, network) if copied is not None else self.compile(map_name)))

    def _with_prefilter(self, scenario: Scenario, network: Network) -> CompiledMap:
        options = self.options
        how = {"prefilter": options.prefilter, "proofs": options.proofs, "reasons": self._reasons(scenario)}
        return CompiledMap.of(scenario, network, options.match, **how)

    def _alike(self, traits: MapTraits) -> CompiledMap | None:
        """The program over what stands for all maps of some traits; None where each has one of its own."""
        known = self._known
        if traits not in known.tried:
            known.tried.add(traits)
            if traits not in known.alike and (abstract := self._compile_abstract(traits)) is not None:
                known.alike[traits] = abstract
        return known.alike.get(traits)

    def _compile_abstract(self, traits: MapTraits) -> CompiledMap | None:
        """The program over any map of some traits; None where that says too little, or few maps have them."""
        if not self.options.prefilter or self.dataset.mapped.count_alike(traits) <= MAPS_KEPT:
            return None
        network = AbstractNetwork(traits)
        try:
            return self._with_prefilter(self._compile_over(network), network)
        except (NeedsMapError, ScenarioError):
            # what is wrong with the program, or lacking, is said of a map
            return None

    def planned_map(self, map_name: str) -> CompiledMap:
        """The scenario over a map, or over another from which it differs in no more than the network.

        Raises:
            ScenarioError: The program is wrong, or does not fit the map.
        """
        known = self._known
        if map_name in known.compiled:
            return known.compiled[map_name]
        if map_name in known.lacking:
            raise known.lacking[map_name].with_traceback(None)
        traits = self.dataset.traits(map_name)
        alike = None if traits is None else self._alike(traits)
        try:
            return self.compiled_map(map_name) if alike is None else alike
        except ScenarioError as error:
            if is_about_map(error):
                known.lacking[map_name] = error
            raise

    def _lacking_maps(self) -> dict[str, Diagnostic]:
        """What maps lack that the program needs, by the map; an error if it fits none."""
        self._check_ego()
        known = self._known
        self._scenarios()
        lacking = known.lacking
        if lacking and len(lacking) == len(self.dataset.maps):
            wrong = (error for error in lacking.values() if error.diagnostics[0].code != "map-lacks")
            raise next(wrong, None) or next(iter(lacking.values()))
        return {name: error.diagnostics[0] for name, error in lacking.items()}

    def _scenarios(self, maps: Iterable[str] | None = None) -> list[Scenario]:
        """The scenario over the maps that it fits, one of those that are alike; arguments as of `fitting`."""
        known = self._known
        if maps is None and known.scenarios is not None:
            return known.scenarios
        found: dict[int, Scenario] = {}
        for name in self.dataset.maps if maps is None else maps:
            try:
                scenario = self.planned_map(name).scenario
            except ScenarioError as error:
                if not is_about_map(error):
                    raise
            else:
                found.setdefault(id(scenario), scenario)
        scenarios = list(found.values())
        if maps is None:
            known.scenarios = scenarios
        return scenarios

    def misfits(self) -> list[Diagnostic]:
        """Warnings of the maps on which no frame can match, one for all that lack the same.

        Raises:
            ScenarioError: The program is wrong, or fits no map.
        """
        return list(misfit_remarks(self._lacking_maps(), self.dataset.manifest))

    def _warn(self, lacking: Mapping[str, Diagnostic]) -> None:
        """Note in the funnel what the author should know, and count the frames on maps that cannot match."""
        for name in lacking:
            if here := self.frames(name):
                self.funnel.frames += here
                self.funnel.excluded[f"{MAP_LACKS}{name}"] += here
        self.funnel.warnings += self.misfits()
        first = next((name for name in self.dataset.maps if name not in lacking), None)
        if first is not None:
            compared = self.coverage()
            self.funnel.warnings += [*compared.warnings, *program_remarks(self.planned_map(first).scenario)]
            self.funnel.missing.update(compared.missing)
            if remark := map_remark(self.source, self.options.version, self.dataset):
                self.funnel.warnings.append(remark)

    def notes(self, maps: Iterable[str] | None = None) -> list[Diagnostic]:
        """How the program is read where that depends on the dataset, and what it cannot record, each thing once.

        Arguments as of `fitting`.
        """
        scenarios = self._scenarios(maps)
        said = (each for scenario in scenarios for each in scenario.warnings)
        left_out = (each for scenario in scenarios for each in scenario.ignored if each.code == "not-recorded")
        by_place = {(each.message, each.span): each for each in left_out}
        return [*{each.code: each for each in said if each.severity == "note"}.values(), *by_place.values()]

    def fitting(self, maps: Iterable[str] | None = None) -> Iterator[CompiledMap]:
        """The scenario over each map that it fits.

        Args:
            maps: Only these; all by default.

        Raises:
            ScenarioError: The program is wrong.
        """
        for name in self.dataset.maps if maps is None else maps:
            try:
                yield self.compiled_map(name)
            except ScenarioError as error:
                if not is_about_map(error):
                    raise

    def fitting_maps(self) -> list[str]:
        """The maps that the program fits, in order; an error if it fits none."""
        lacking = self._lacking_maps()
        return [name for name in self.dataset.maps if name not in lacking]

    def coverage(self, maps: Sequence[str] | None = None) -> Coverage:
        """How much of what the program sets is compared with the labels; found out once.

        Args:
            maps: The program is compiled over these; over all by default.

        Raises:
            ScenarioError: The program is wrong; never-compared, where the options are strict.
        """
        self._check_ego()
        if self._known.coverage is None:
            scenarios = self._scenarios(maps)
            self._known.coverage = coverage(self.dataset, scenarios, self.options.match)
        found = self._known.coverage
        if self.options.strict and found.warnings:
            raise ScenarioError([replace(each, severity="error") for each in found.warnings])
        return found

    def alone(self, recording: str, map_name: str, compiled: CompiledMap, options: QueryOptions) -> Query:
        """This query of one recording, in this process, with another scenario or other options.

        Args:
            recording: Its name.
            map_name: The map that it is on.
            compiled: The scenario over that map, with its prefilter.
            options: The options.
        """
        known = replace(
            self._known,
            compiled={**self._known.compiled, map_name: compiled},
            alike=dict(self._known.alike),
            scenarios=None,
        )
        options = replace(options, jobs=1, limit=None, every=False)
        chosen = {map_name: RecordingRange(recording, recording, self.dataset.manifest.by_recording[recording].frames)}
        return Query(self.dataset, self.source, options, chosen, files=self.files, _known=known)

    def frames(self, map_name: str) -> int:
        """How many frames of a map are looked at."""
        if self.recordings is None:
            return self.dataset.manifest.by_map.get(map_name, Counts()).frames
        return self.recordings[map_name].frames if map_name in self.recordings else 0

    def _between(self, map_name: str) -> tuple[str, str] | None:
        """The first and the last recording of a map that are looked at; None for all."""
        return None if self.recordings is None else (self.recordings[map_name].first, self.recordings[map_name].last)

    def roles(self) -> tuple[str, ...]:
        """Names of the scenario's objects, of all maps that it fits."""
        self._lacking_maps()
        return tuple(dict.fromkeys(owner.name for scenario in self._scenarios() for owner in scenario.objects))

    def recorded_columns(self) -> tuple[RecordedColumn, ...]:
        """What the program records, over all maps that it fits."""
        self._lacking_maps()
        scenarios = self._scenarios()
        return columns_of(scenarios, over_time=any(map(self.over_time, scenarios)))

    def has_timelines(self) -> bool:
        """Whether results may say what roles do from when to when: the program has a behavior or the like."""
        self._lacking_maps()
        return any(map(has_timelines, self._scenarios()))

    def with_timelines(self, results: Sequence[Result]) -> list[Result]:
        """Put timelines into intervals that match: what their roles do from when to when.

        Args:
            results: The results, those of one recording together.
        """
        if not any(each.timeline is None and each.interval is not None for each in results) or not self.has_timelines():
            return list(results)
        # takes long to load
        from scenicq.query.execution.timelines import Timelines  # noqa: PLC0415

        found: list[Result] = []
        for _, several in groupby(results, lambda each: each.recording):
            mine = list(several)
            name = self.dataset.label(mine[0].frame).map
            if name not in self._known.timelines:
                scenario = self.compiled_map(name).scenario
                made = Timelines(self.dataset, scenario, name, self.options.match) if has_timelines(scenario) else None
                self._known.timelines[name] = made
            filler = self._known.timelines[name]
            found += mine if filler is None else filler.fill(mine)
        return found

    def plans(self) -> list[Plan]:
        """The prefilter on each map."""
        there = filter(self.frames, self.fitting_maps())
        return [replace(self.planned_map(name).plan, map=name) for name in there]

    def blocks(self, map_name: str, least: int = 1, connection: duckdb.DuckDBPyConnection | None = None) -> list[Block]:
        """The frames of a map that are looked at, cut into blocks in the order of the store.

        Args:
            map_name: The map.
            least: Blocks that there should be, unless they would become very small.
            connection: To the dataset, where there is one: each takes 15 ms.
        """
        where = self._extents(connection)
        return blocks(where, map_name, self._between(map_name), least=least, whole=self.options.prefilter)

    def _extents(self, connection: duckdb.DuckDBPyConnection | None) -> dict[str, list[Extent]]:
        """Where the frames of each map are; found out once."""
        if self._known.extents is None:
            there = nullcontext(connection) if connection else closing(self.dataset.connect(views=False))
            with there as opened:
                self._known.extents = extents(self.dataset, opened)
        return self._known.extents

    def _map_runs(self, lacking: Mapping[str, Diagnostic]) -> Iterator[list[str]]:
        """The maps that are looked at, in order, those together over which blocks may go."""
        run: list[str] = []
        last: CompiledMap | None = None
        for name in filter(self.frames, self.dataset.maps):
            here = None if name in lacking else self.planned_map(name)
            # what is recorded is of one map
            joins = here is not None and here is last and not here.scenario.records
            if run and not joins:
                yield run
                run = []
            run.append(name)
            last = here
        if run:
            yield run

    def decider(self, threads: int | None = None) -> Decider:
        """What decides the blocks of this query in one process; to be used in a `with` statement.

        Args:
            threads: Threads of the database; by default as many as it likes.
        """
        options = self.options
        return Decider(
            self.dataset,
            options.match,
            options.solver,
            self.planned_map,
            self.compiled_map,
            threads=threads,
            all_matches=options.all_matches,
            every=options.every,
            proofs=options.proofs,
            reasons=options.interval_reasons or options.every,
            timelines=options.timelines,
            time=options.time,
            until=options.until,
        )

    def over_time(self, scenario: Scenario) -> bool:
        """Whether intervals are looked for, and not frames."""
        return scenario.dynamics is not None or self.options.time.min_duration_s is not None

    def _reasons(self, scenario: Scenario) -> bool:
        """Whether somebody reads what frames and bindings fail at."""
        options = self.options
        return options.every or (options.interval_reasons if self.over_time(scenario) else options.reasons)

    def is_over_time(self) -> bool:
        """Whether the results are intervals, and not frames; the program is compiled for the first map that it fits.

        Raises:
            ScenarioError: The program is wrong.
        """
        for name in self.dataset.maps:
            if scenarios := self._scenarios([name]):
                return self.over_time(scenarios[0])
        return False

    @property
    def limit(self) -> int | None:
        """Matches after which to stop; None for all, as where it is chosen among all that match."""
        return None if self.options.selects else self.options.limit

    def selection(self) -> ResultSelection | None:
        """Which matches are shown and in what order, by what the program records; None where all are, as they come.

        Raises:
            DataError: option-invalid: there is no such value.
        """
        options = self.options
        if not options.selects:
            return None
        return ResultSelection.read(options.where, options.sort, self.recorded_columns(), options.limit)

    def results(self, progress: Callable[[int], None] | None = None) -> Generator[Result]:
        """Results in the order of recording, time and frame, map by map.

        Args:
            progress: Called with the number of frames decided since the last call.

        Raises:
            ScenarioError: The program is wrong or not supported.
        """
        return limit_matches(self.limit, self._all_results(progress), self.funnel)

    def _all_results(self, progress: Callable[[int], None] | None) -> Generator[Result]:
        lacking = self._lacking_maps()
        self._warn(lacking)
        ahead = FramesAhead(progress)
        with ExitStack() as stack:
            stack.enter_context(self.dataset.blamed())
            setup = (self.dataset.reference, self.source, self.options, self.siblings)
            decider = self.decider()
            executor = BlockExecutor(self.dataset, self.options.jobs, decider, _start_worker, setup)
            hands = stack.enter_context(executor)
            for maps in self._map_runs(lacking):
                if maps[0] in lacking:
                    yield from self._lacking(maps[0], lacking[maps[0]], ahead.taken)
                    continue
                there = self.planned_map(maps[0])
                over_time = self.over_time(there.scenario)
                try:
                    cut = self._cut(maps, decider, 4 * hands.jobs if hands.jobs > 1 else 1, whole=over_time)
                except DeadlineError:
                    self.funnel.cut = True
                    return
                every, reasons = self.options.every, self._reasons(there.scenario)
                merge = partial(merge_intervals if over_time else merge_frames, every=every, reasons=reasons)
                with closing(merge(there.plan, hands.decide(cut, ahead.told), self.funnel, ahead.taken)) as merged:
                    for result in merged:
                        self.funnel.count_recorded(result)
                        yield result
                if self.funnel.cut:
                    return

    def _cut(self, maps: Sequence[str], decider: Decider, least: int, *, whole: bool) -> list[Block]:
        """The frames of some maps that are looked at, cut into so many blocks at least, or where recordings end."""
        with sql_deadline(self.options.until):
            where, chosen = self._extents(decider.connection), {name: self._between(name) for name in maps}
            cut = blocks_of(where, chosen, least=least, whole=self.options.prefilter)
            return whole_recordings(self.dataset, decider.connection, cut) if whole else cut

    def _lacking(self, map_name: str, told: Diagnostic, progress: Callable[[int], None]) -> Iterator[Result]:
        """The frames of a map that lacks what the program needs, which are counted already."""
        if self.options.every:
            cause = Cause(f"{MAP_LACKS}{map_name}", told.message, told.span)
            with closing(self.dataset.connect()) as connection:
                for block in self.blocks(map_name):
                    for frame, recording, time in names(self.dataset, connection, block):
                        yield Result(frame, recording, time, NoMatch(cause))
        progress(self.frames(map_name))


def _start_worker(
    dataset: DatasetReference, source: Source, options: QueryOptions, files: SiblingFiles
) -> Callable[[Block, Callable[[object], None]], BlockOutcome]:
    """What a worker process keeps between blocks."""
    decider = Query(dataset.open(), source, options, files=files).decider(threads=1)

    def work(block: Block, tell: Callable[[object], None]) -> BlockOutcome:
        decided = decider.decide(block)
        found = telling(decided.found, decided.missed, (block.first, block.end), tell)
        return replace(decided, found=list(until_deadline(found, Funnel())))

    return work
