"""Running a query: compile per map, prefilter, match the candidates, in the order of the store.

The dataset is worked through block by block, in this process or in workers; results come out in order either way.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from scenicq.compiler.program import compile_scenario
from scenicq.errors import DataError, Diagnostic, ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown
from scenicq.processes import Lost, Workers
from scenicq.query.deciding import Decided, Decider, World, every_label
from scenicq.query.maps import about_dataset, map_remark
from scenicq.query.plan import Plan
from scenicq.query.prefilter import Block, Extent, blocks, extents
from scenicq.query.results import Funnel, Result
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.manifest import Counts

__all__ = ["Query", "QueryOptions", "Stretch", "read_program"]


@dataclass(frozen=True, slots=True)
class QueryOptions:
    """How to run a query.

    Attributes:
        match: Options of the matcher.
        solver: Which solver, as `scenicq.smt.solver.open_solver` takes it.
        version: The version of Scenic; inferred if None.
        initial: Whether dynamic parts of the program are ignored.
        prefilter: Whether SQL narrows the frames first; the results are the same.
        jobs: Processes that match.
        limit: Matches after which to stop; None for all.
        every: Whether frames that do not match are results too.
        all_matches: Whether every correspondence of a frame is a result of its own.
    """

    match: MatchOptions = MatchOptions()
    solver: str = "auto"
    version: Literal[1, 2, 3] | None = None
    initial: bool = False
    prefilter: bool = True
    jobs: int = 1
    limit: int | None = None
    every: bool = False
    all_matches: bool = False


def read_program(path: str | Path) -> Source:
    """Read a scenario.

    Raises:
        DataError: file-missing, or file-invalid where it is not UTF-8 text.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from None
    try:
        return Source(str(path), data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise DataError(Diagnostic("file-invalid", f"{path} is not text in UTF-8")) from None


def beside(path: Path) -> Callable[[str], Source | None]:
    """Reads files that a program imports: those in its own folder, nothing else."""
    folder = path.resolve().parent

    def load(name: str) -> Source | None:
        file = (folder / name).resolve()
        if not file.is_relative_to(folder) or not file.is_file():
            return None
        return read_program(file)

    return load


@dataclass(frozen=True, slots=True)
class Stretch:
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
    """What a query has found out once, for it and its copies with other recordings."""

    worlds: dict[str, World] = field(default_factory=dict["str", "World"])
    extents: dict[str, list[Extent]] | None = None


@dataclass(eq=False)
class Query:
    """A scenario and a dataset, ready to run.

    Attributes:
        dataset: The dataset.
        source: The program.
        options: The options.
        recordings: What to look at on which map; everything if None.
        funnel: Filled while results are taken.
        file: Of the program, whose folder has the files that it imports; by its name if None.
    """

    dataset: Dataset
    source: Source
    options: QueryOptions = QueryOptions()
    recordings: Mapping[str, Stretch] | None = None
    funnel: Funnel = field(default_factory=Funnel)
    file: Path | None = None
    _known: _Known = field(default_factory=_Known, repr=False)

    def compile(self, map_name: str) -> tuple[Scenario, Network]:
        """The scenario over one of the dataset's maps.

        Raises:
            ScenarioError: The program is wrong, or does not fit the map.
        """
        network = self.dataset.network(map_name)
        options = self.options
        try:
            scenario = compile_scenario(
                self.source,
                network,
                version=options.version,
                initial=options.initial,
                loader=beside(self.file or Path(self.source.name)),
            )
        except ScenarioError as error:
            raise about_dataset(error, self.dataset, map_name) from None
        return scenario, network

    def _check_ego(self) -> None:
        """Refuse to take a stand-in for an ego that the source does not have."""
        facts = cast("dict[str, object]", self.dataset.manifest.provenance.get("facts") or {})
        said = str(facts.get("ego", ""))
        if said.startswith("none") and self.options.match.ego == "label":
            raise DataError(
                Diagnostic(
                    "option-invalid",
                    f"{self.dataset.name} was ingested without an ego",
                    hints=("`--ego any` lets the scenario's ego be any object of its class",),
                )
            )

    def world(self, map_name: str) -> World:
        """The scenario over one of the dataset's maps, with its prefilter; compiled once.

        Raises:
            ScenarioError: The program is wrong, or does not fit the map.
        """
        worlds = self._known.worlds
        if map_name not in worlds:
            options = self.options
            worlds[map_name] = World.of(*self.compile(map_name), options.match, prefilter=options.prefilter)
        return worlds[map_name]

    def _worlds(self) -> list[tuple[str, World]]:
        """The scenario over each map that it fits; an error if it fits none."""
        self._check_ego()
        found: list[tuple[str, World]] = []
        errors: list[ScenarioError] = []
        for name in self.dataset.maps:
            try:
                found.append((name, self.world(name)))
            except ScenarioError as error:
                if error.diagnostics[0].code != "map-lacks":
                    raise
                errors.append(error)
                count = self.dataset.manifest.by_map.get(name, Counts()).frames
                message = f"{count} frames on map `{name}` cannot match: {error.diagnostics[0].message}"
                self.funnel.warnings.append(Diagnostic("map-lacks", message, severity="warning"))
                if here := self._frames(name):
                    self.funnel.frames += here
                    self.funnel.excluded[f"map {name}"] += here
        if errors and not found:
            raise errors[0]
        if found:
            self.funnel.warnings += _remarks(found[0][1].scenario)
            if remark := map_remark(self.source, self.options.version, self.dataset):
                self.funnel.warnings.append(remark)
        return found

    def _frames(self, map_name: str) -> int:
        """How many frames of a map are looked at."""
        if self.recordings is None:
            return self.dataset.manifest.by_map.get(map_name, Counts()).frames
        return self.recordings[map_name].frames if map_name in self.recordings else 0

    def _between(self, map_name: str) -> tuple[str, str] | None:
        """The first and the last recording of a map that are looked at; None for all."""
        return None if self.recordings is None else (self.recordings[map_name].first, self.recordings[map_name].last)

    def plans(self) -> list[Plan]:
        """The prefilter on each map."""
        return [world.plan for name, world in self._worlds() if self._frames(name)]

    def blocks(self, map_name: str, least: int = 1) -> list[Block]:
        """The frames of a map that are looked at, cut into blocks in the order of the store.

        Args:
            map_name: The map.
            least: Blocks that there should be, unless they would become very small.
        """
        if self._known.extents is None:
            with closing(self.dataset.connect()) as connection:
                self._known.extents = extents(self.dataset, connection)
        return blocks(self._known.extents, map_name, self._between(map_name), least=least, whole=self.options.prefilter)

    def decider(self) -> Decider:
        """What decides the blocks of this query in one process; to be used in a `with` statement."""
        options = self.options
        return Decider(
            self.dataset,
            options.match,
            options.solver,
            self.world,
            threads=1 if options.jobs > 1 else None,
            all_matches=options.all_matches,
            every=options.every,
        )

    def results(self, progress: Callable[[int], None] | None = None) -> Generator[Result]:
        """Results in the order of recording, time and frame, map by map.

        Args:
            progress: Called with the number of frames decided since the last call.

        Raises:
            ScenarioError: The program is wrong or not supported.
        """
        worlds = self._worlds()
        left = self.options.limit
        with ExitStack() as stack:
            stack.enter_context(self.dataset.blamed())
            pool = stack.enter_context(_Pool(self)) if self.options.jobs > 1 else None
            decider = stack.enter_context(self.decider())
            for name, world in worlds:
                if not self._frames(name):
                    continue
                cut = self.blocks(name, 4 * self.options.jobs if pool else 1)
                decided = pool.run(cut) if pool else map(decider.decide, cut)
                for result in self._merge(world.plan, decided, progress or _ignore):
                    yield result
                    if isinstance(result.verdict, Match) and left is not None:
                        left -= 1
                        if left <= 0:
                            return

    def _merge(self, plan: Plan, decided: Iterable[Decided], progress: Callable[[int], None]) -> Iterator[Result]:
        for block in decided:
            found = iter(block.found)
            start = 0
            for place in np.flatnonzero(block.missed < 0).tolist():
                yield from self._excluded(plan, block, start, place)
                first, *more = next(found)
                self.funnel.count(first.verdict)
                progress(place + 1 - start)
                start = place + 1
                if self.options.every or isinstance(first.verdict, Match | Unknown):
                    yield first
                yield from more
            yield from self._excluded(plan, block, start, len(block.missed))
            progress(len(block.missed) - start)

    def _excluded(self, plan: Plan, block: Decided, start: int, end: int) -> Iterator[Result]:
        """Count the frames between two candidates."""
        if start == end:
            return
        missed = block.missed[start:end]
        for step, count in zip(*np.unique(missed, return_counts=True), strict=True):
            self.funnel.exclude(plan.steps[int(step)].what, int(count))
        if self.options.every:
            numbers: list[int] = missed.tolist()
            for (frame, recording, time), number in zip(block.names[start:end], numbers, strict=True):
                step = plan.steps[number]
                yield Result(frame, recording, time, NoMatch(Cause(step.what, step.detail, step.span)))


def _ignore(frames: int) -> None:
    """No progress is shown."""


def _remarks(scenario: Scenario) -> list[Diagnostic]:
    """What the author should know: parts that say nothing about whether a label matches."""
    soft = [
        Diagnostic(
            "soft-requirement",
            "this requirement excludes nothing",
            span,
            "holds only with a probability",
            hints=("a scene that breaks it is still possible: write `require` for a condition that must hold",),
            severity="warning",
        )
        for span in (requirement.span for requirement in scenario.soft)
    ]
    return [*scenario.warnings, *scenario.ignored, *soft]


_TRIES = 3
"""Processes that a block, and then a frame alone, may cost."""


class _Pool:
    """Worker processes that each hold the compiled scenario; blocks come back in order.

    A process that dies costs nothing but its block's time. Of a block that kills every process which takes it, the
    frames that do so are found by halving, and are unknown.
    """

    def __init__(self, query: Query) -> None:
        self.query = query
        setup = (query.dataset.address, query.source, query.options, query.file)
        self.workers: Workers[Block, Decided] = Workers(query.options.jobs, _start_worker, setup)

    def __enter__(self) -> _Pool:
        return self

    def __exit__(self, *error: Any) -> None:
        self.workers.__exit__(*error)

    def run(self, blocks_: Iterable[Block], *, tries: int = _TRIES) -> Iterator[Decided]:
        """Decide blocks side by side, a bounded number ahead."""
        for block, found in self.workers.run(blocks_, tries=tries):
            yield from self._halves(block) if isinstance(found, Lost) else (found,)

    def _halves(self, block: Block) -> Iterator[Decided]:
        if block.end - block.first > 1:
            for half in block.halves():
                # a half is lost at once: only what is left to blame, a frame, gets more chances
                yield from self.run([half], tries=1 if half.end - half.first > 1 else _TRIES)
            return
        for label in every_label(self.query.dataset, block):
            lost = Unknown("crash", Cause("process", "every process that matched this frame died"))
            result = Result(label.frame, label.recording, label.timestamp_us, lost, label.sensors)
            yield Decided(np.full(1, -1, np.int16), [[result]], [])


def _start_worker(
    dataset: str, source: Source, options: QueryOptions, file: Path | None
) -> Callable[[Block, Callable[[object], None]], Decided]:
    """What a worker process keeps between blocks."""
    decider = Query(open_dataset(dataset), source, options, file=file).decider()

    def work(block: Block, _tell: Callable[[object], None]) -> Decided:
        decided = decider.decide(block)
        return replace(decided, found=list(decided.found))

    return work
