"""Running a query: compile per map, prefilter, match the candidates, in the order of the store.

Candidates go through the matcher in batches, in this process or in workers; results come out in order either way.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, cast

from scenicq.compiler.program import compile_scenario
from scenicq.errors import DataError, Diagnostic, ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict
from scenicq.query.plan import Excluded, Plan, frames_sql, make_plan
from scenicq.query.results import Funnel, Result
from scenicq.query.solving import LazySolver
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label

__all__ = ["Query", "QueryOptions", "read_program"]

_BATCH = 256


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


@dataclass(eq=False)
class Query:
    """A scenario and a dataset, ready to run.

    Attributes:
        dataset: The dataset.
        source: The program.
        options: The options.
        recordings: The first and the last recording to look at, in order of their names; None for all.
        funnel: Filled while results are taken.
    """

    dataset: Dataset
    source: Source
    options: QueryOptions = QueryOptions()
    recordings: tuple[str, str] | None = None
    funnel: Funnel = field(default_factory=Funnel)

    def compile(self, map_name: str) -> tuple[Scenario, Network]:
        """The scenario over one of the dataset's maps.

        Raises:
            ScenarioError: The program is wrong, or does not fit the map.
        """
        network = self.dataset.network(map_name)
        options = self.options
        scenario = compile_scenario(
            self.source,
            network,
            version=options.version,
            initial=options.initial,
            loader=beside(Path(self.source.name)),
        )
        return scenario, network

    def _check_ego(self) -> None:
        """Refuse to take a stand-in for an ego that the source does not have."""
        facts = cast("dict[str, object]", self.dataset.manifest.provenance.get("facts") or {})
        said = str(facts.get("ego", ""))
        if said.startswith("none") and self.options.match.ego == "label":
            raise DataError(
                Diagnostic(
                    "option-invalid",
                    f"{self.dataset.path} was ingested without an ego",
                    hints=("`--ego any` lets the scenario's ego be any object of its class",),
                )
            )

    def _worlds(self) -> list[tuple[str, Scenario, Network]]:
        """The scenario over each map that it fits; an error if it fits none."""
        self._check_ego()
        found: list[tuple[str, Scenario, Network]] = []
        errors: list[ScenarioError] = []
        for name in self.dataset.maps:
            try:
                found.append((name, *self.compile(name)))
            except ScenarioError as error:
                if error.diagnostics[0].code != "map-lacks":
                    raise
                errors.append(error)
                frames = self.dataset.manifest.by_map.get(name)
                count = frames.frames if frames else 0
                message = f"{count} frames on map `{name}` cannot match: {error.diagnostics[0].message}"
                self.funnel.warnings.append(Diagnostic("map-lacks", message, severity="warning"))
                self.funnel.frames += count
                self.funnel.excluded[f"map {name}"] += count
        if errors and not found:
            raise errors[0]
        if found:
            self.funnel.warnings += _remarks(found[0][1])
        return found

    def plans(self) -> list[Plan]:
        """The prefilter on each map."""
        return [make_plan(s, network, self.options.match, self.recordings) for _, s, network in self._worlds()]

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
            pool = stack.enter_context(_Pool(self)) if self.options.jobs > 1 else None
            solver = stack.enter_context(LazySolver(self.options.solver))
            for name, scenario, network in worlds:
                matcher = Matcher(scenario, self.options.match, solver)
                for result, decided in self._on_map(name, matcher, network, pool):
                    if progress is not None:
                        progress(decided)
                    if result is None:
                        continue
                    yield result
                    if isinstance(result.verdict, Match) and left is not None:
                        left -= 1
                        if left <= 0:
                            return

    def _on_map(
        self, name: str, matcher: Matcher, network: Network, pool: _Pool | None
    ) -> Iterator[tuple[Result | None, int]]:
        connection = self.dataset.connect()
        try:
            if self.options.prefilter:
                plan = make_plan(matcher.scenario, network, self.options.match, self.recordings)
                rows = plan.run(connection)
            else:
                rows = _all_frames(connection, name, self.recordings)
            batches = _batches(rows)
            decided = pool.run(name, batches) if pool else ((b, _decide(self, matcher, b)) for b in batches)
            for batch, found in decided:
                yield from self._merge(batch, found)
        finally:
            connection.close()

    def _merge(self, batch: list[Excluded], found: dict[str, list[Result]]) -> Iterator[tuple[Result | None, int]]:
        for row in batch:
            if row.step is None:
                first, *more = found[row.frame]
                self.funnel.count(first.verdict)
                shown = self.options.every or isinstance(first.verdict, Match | Unknown)
                yield (first if shown else None), 1
                yield from ((result, 0) for result in more)
            else:
                self.funnel.exclude(row.step.what)
                excluded = None
                if self.options.every:
                    cause = Cause(row.step.what, row.step.detail, row.step.span)
                    excluded = Result(row.frame, row.recording, row.timestamp_us, NoMatch(cause))
                yield excluded, 1


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
        for span in scenario.soft
    ]
    return [*scenario.warnings, *scenario.ignored, *soft]


def _all_frames(connection: object, name: str, recordings: tuple[str, str] | None) -> Iterator[Excluded]:
    sql = (
        f"SELECT frame, recording, timestamp_us, NULL::INTEGER AS missed FROM ({frames_sql(name, recordings)}) "
        "ORDER BY recording, timestamp_us, frame"
    )
    return Plan(name, (), sql).run(connection)


def _batches(rows: Iterator[Excluded]) -> Iterator[list[Excluded]]:
    """Rows in order, cut where enough candidates have come together."""
    batch: list[Excluded] = []
    candidates = 0
    for row in rows:
        batch.append(row)
        candidates += row.step is None
        if candidates >= _BATCH or len(batch) >= 100 * _BATCH:
            yield batch
            batch, candidates = [], 0
    if batch:
        yield batch


def _decide(query: Query, matcher: Matcher, batch: Sequence[Excluded]) -> dict[str, list[Result]]:
    frames = [row.frame for row in batch if row.step is None]
    return {
        label.frame: [
            Result(label.frame, label.recording, label.timestamp_us, verdict, label.sensors)
            for verdict in _verdicts(query, matcher, label)
        ]
        for label in (query.dataset.labels(frames) if frames else ())
    }


def _verdicts(query: Query, matcher: Matcher, label: Label) -> list[Match] | list[Verdict]:
    """The verdict on a label, or one for each correspondence by which it matches."""
    return (list(matcher.matches(label)) if query.options.all_matches else []) or [matcher.match(label)]


class _Pool:
    """Worker processes that each hold the compiled scenario; batches come back in order."""

    def __init__(self, query: Query) -> None:
        context = multiprocessing.get_context("spawn")
        self.jobs = query.options.jobs
        state = (query.dataset.path, query.source, query.options)
        self.pool = ProcessPoolExecutor(self.jobs, context, initializer=_start_worker, initargs=state)

    def __enter__(self) -> _Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.pool.shutdown(wait=True, cancel_futures=True)

    def run(
        self, name: str, batches: Iterator[list[Excluded]]
    ) -> Iterator[tuple[list[Excluded], dict[str, list[Result]]]]:
        """Decide batches side by side, a bounded number ahead."""
        pending: deque[tuple[list[Excluded], Future[dict[str, list[Result]]]]] = deque()
        for batch in batches:
            frames = [row for row in batch if row.step is None]
            pending.append((batch, self.pool.submit(_work, name, frames)))
            if len(pending) > 2 * self.jobs:
                first, future = pending.popleft()
                yield first, future.result()
        for first, future in pending:
            yield first, future.result()


@dataclass(slots=True)
class _Worker:
    """What a worker process keeps between batches."""

    query: Query
    solver: LazySolver
    matchers: dict[str, Matcher] = field(default_factory=dict[str, Matcher])


_worker: list[_Worker] = []


def _start_worker(path: Path, source: Source, options: QueryOptions) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted, too, and ends the workers
    _worker[:] = [_Worker(Query(open_dataset(path), source, options), LazySolver(options.solver))]


def _work(name: str, frames: Sequence[Excluded]) -> dict[str, list[Result]]:
    (worker,) = _worker
    query = worker.query
    if name not in worker.matchers:
        worker.matchers[name] = Matcher(query.compile(name)[0], query.options.match, worker.solver)
    return _decide(query, worker.matchers[name], frames)
