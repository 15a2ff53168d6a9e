"""A program on a dataset, frame by frame: what the prefilter leaves, decided beside the whole label."""

from __future__ import annotations

import random
import signal
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import ScenicqError
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.execution.block_matcher import CompiledMap, every_label
from scenicq.query.execution.records import record
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.prefilter.executor import Block, blocks, extents, run_prefilter
from scenicq.query.prefilter.survivors import Candidate, candidates
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label

_BATCH = 16
"""Frames whose places are looked up together."""


@dataclass
class Compared:
    """What came of comparing.

    Attributes:
        programs: How many were compared, those that both refuse among them.
        refused: Programs that do not fit the map, or are not supported, either way.
        frames, passed: Frames that were compared, and those of them that the prefilter passed.
        matches: Frames that match either way.
        unknown: Frames that prove nothing, as one of the two did not know.
        disagreements: What is told of each frame for which the two disagree.
        stopped: Programs that took too long: some of their frames were passed over.
    """

    programs: int = 0
    refused: int = 0
    frames: int = 0
    passed: int = 0
    matches: int = 0
    unknown: int = 0
    disagreements: list[str] = field(default_factory=list)
    stopped: list[str] = field(default_factory=list)


class _TimeUpError(BaseException):
    """No exception that anybody handles."""


@contextmanager
def _at_most(seconds: float) -> Generator[None]:
    """Raise `_TimeUpError` in what takes more processor time than that, wherever it is."""
    armed = True

    def stop(*_: object) -> None:
        if armed:
            raise _TimeUpError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.1)  # again and again, as Python drops what callbacks raise
    try:
        yield
    finally:
        armed = False
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@dataclass
class SideBySide:
    """Compares programs on a dataset.

    Of the frames that the prefilter passes, and of those that each of its steps excludes, some are looked at, evenly
    spread over the dataset, in an order drawn at random: what is compared of a program that takes too long is a spread
    as well.

    Attributes:
        dataset: The dataset.
        frames: Of those that pass, and of those that fail at each step, so many at most.
        seconds: Processor time for a program.
        found: What came of it so far.
    """

    dataset: Dataset
    frames: int
    seconds: float
    found: Compared = field(default_factory=Compared)
    _labels: dict[tuple[Block, bool], list[Label]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Connect once: with a small dataset, this takes longer than a query."""
        self._connection = self.dataset.connect(threads=1)
        self._extents = extents(self.dataset, self._connection)

    def __enter__(self) -> SideBySide:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def compare(self, name: str, narrowed: Query, whole: Query) -> None:
        """Compare a query with a prefilter and the same without one."""
        self.found.programs += 1
        try:
            with _at_most(self.seconds):
                self._compare(name, narrowed, whole)
        except _TimeUpError:
            self.found.stopped.append(name)
        except Exception as error:
            self.found.disagreements.append(f"{name}: {type(error).__name__}: {error}")

    def _compare(self, name: str, narrowed: Query, whole: Query) -> None:
        for map_name in self.dataset.maps:
            worlds = [_world(query, map_name) for query in (narrowed, whole)]
            if not all(isinstance(world, CompiledMap) for world in worlds):
                self.found.refused += 1
                if worlds[0] != worlds[1]:
                    self.found.disagreements.append(f"{name}: {worlds[0]} is not {worlds[1]}")
                return
            matchers = [Matcher(world.scenario, narrowed.options.match) for world in worlds]
            for block in blocks(self._extents, map_name):
                missed, left = self._prefiltered(worlds[0], block)
                self._decide(name, matchers, self._of(block, motion=worlds[0].motion), missed, left)

    def _of(self, block: Block, *, motion: bool) -> list[Label]:
        if (block, motion) not in self._labels:
            self._labels[block, motion] = list(every_label(self.dataset, block, motion=motion))
        return self._labels[block, motion]

    def _prefiltered(self, world: CompiledMap, block: Block) -> tuple[NDArray[np.int16], dict[str, Candidate]]:
        """The step that excludes each frame, -1 for none; and what is left, by frame."""
        if not world.plan.stages:
            labels = self._of(block, motion=world.motion)
            return np.full(len(labels), -1, np.int16), {label.frame: Candidate(label, None) for label in labels}
        missed = run_prefilter(self.dataset, self._connection, world.plan, block)
        if not (missed < 0).any():
            return missed, {}
        recorded, whole = self.dataset.recorded, world.whole
        left = candidates(self._connection, world.plan, motion=world.motion, recorded=recorded, whole=whole)
        return missed, {each.label.frame: each for each in left}

    def _decide(
        self,
        name: str,
        matchers: list[Matcher],
        labels: list[Label],
        missed: NDArray[np.int16],
        left: dict[str, Candidate],
    ) -> None:
        passing = [labels[row].frame for row in np.flatnonzero(missed < 0)]
        if len(labels) != len(missed) or sorted(passing) != sorted(left):
            self.found.disagreements.append(f"{name}: {len(left)} labels are left of {len(passing)} frames")
            return
        rows = [row for step in np.unique(missed) for row in _spread(np.flatnonzero(missed == step), self.frames)]
        random.Random(len(rows)).shuffle(rows)
        for batch in (rows[start : start + _BATCH] for start in range(0, len(rows), _BATCH)):
            everything = [Candidate(labels[row], None) for row in batch]
            narrowed = [left[labels[row].frame] for row in batch if missed[row] < 0]
            shown = _decided(matchers[0], narrowed), _decided(matchers[1], everything)
            for row in batch:
                with_it = next(shown[0]) if missed[row] < 0 else None
                self._judge(name, labels[row].frame, with_it, next(shown[1]))

    def _judge(self, name: str, frame: str, with_it: Result | None, without: Result) -> None:
        self.found.frames += 1
        self.found.passed += with_it is not None
        if any(each is not None and isinstance(each.verdict, Unknown) for each in (with_it, without)):
            self.found.unknown += 1
            return
        same = isinstance(without.verdict, NoMatch)
        if with_it is not None and not (same and isinstance(with_it.verdict, NoMatch)):
            # what excludes a frame is told of the objects that are left: of those only the verdict must be the same
            same = record(with_it) == record(without)
            self.found.matches += same and isinstance(without.verdict, Match)
        if not same:
            told = "nothing" if with_it is None else record(with_it)
            self.found.disagreements.append(f"{name}, {frame}: {told} is not {record(without)}")


def _world(query: Query, map_name: str) -> CompiledMap | str:
    try:
        return query.compiled_map(map_name)
    except ScenicqError as error:
        return str(error)


def _spread(rows: NDArray[np.intp], most: int) -> Iterable[int]:
    """At most so many of them, evenly spread, the first and the last among them."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).round().astype(int))].tolist()


def _decided(matcher: Matcher, batch: list[Candidate]) -> Iterator[Result]:
    """Decide labels as a query does."""
    verdicts = matcher.match_all([(each.label, each.among) for each in batch])
    for each, verdict in zip(batch, verdicts, strict=True):
        label = each.label
        yield Result(label.frame, label.recording, label.timestamp_us, verdict, label.sensors)
