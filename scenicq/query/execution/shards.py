"""Pieces of a query side by side, each in a process of its own; results in the order of the pieces."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from scenicq.errors import Source
from scenicq.match.verdict import Match
from scenicq.processes import Lost, Workers, as_many_as_pay
from scenicq.query.execution.partitions import Partition, gather, is_done, partitions, write_partition
from scenicq.query.execution.program_files import SiblingFiles
from scenicq.query.execution.question_notes import name_question
from scenicq.query.execution.records import read_record, record
from scenicq.query.execution.results import Funnel, Result
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import DatasetReference

__all__ = [
    "Asked",
    "Done",
    "Engine",
    "Progress",
    "Question",
    "alone",
    "in_order",
    "kept",
    "run_here",
    "run_shard",
    "shards_of",
]

PIECE_FRAMES = 20_000
"""Frames of a piece, about: what an interruption can lose."""

Done = tuple[list[Result], Funnel]
"""What a piece gave."""


@dataclass(frozen=True, slots=True)
class Question:
    """A query as it is sent to other processes, perhaps on other machines.

    Attributes:
        dataset: The dataset.
        fingerprint: Of dataset, program and options.
        source: The program.
        files: What reads the files that it imports.
        options: The options.
    """

    dataset: DatasetReference
    fingerprint: str
    source: Source
    files: SiblingFiles
    options: QueryOptions

    @classmethod
    def of(cls, query: Query) -> Question:
        """The question of a query, for processes that have one thread of work each."""
        return cls(
            dataset=query.dataset.reference,
            fingerprint=name_question(query),
            source=query.source,
            files=query.siblings,
            options=replace(query.options, jobs=1),
        )

    def query(self) -> Query:
        """The query.

        Raises:
            DataError: store-missing, or store-damaged where the dataset is not the one that was asked about.
        """
        return Query(self.dataset.open(), self.source, self.options, files=self.files)


Asked = tuple[Question, Partition]
Progress = Callable[[int], None]
"""Called with the number of frames decided since the last call."""
Engine = Callable[[Query, Iterable[Partition], Progress], Generator[tuple[Partition, Done]]]
"""Runs pieces of a query; they come in their order."""


def shards_of(query: Query, least: int = 1) -> tuple[Partition, ...]:
    """The pieces that a query is run in.

    Args:
        query: The query.
        least: How many there are at least if the dataset has as many recordings.
    """
    return partitions(query.dataset, max(least, query.dataset.manifest.total.frames // PIECE_FRAMES))


def run_shard(query: Query, piece: Partition, progress: Progress | None = None) -> Done:
    """Run one piece here."""
    query.recordings, query.funnel = piece.recordings, Funnel()
    return list(query.results(progress)), query.funnel


def run_here(query: Query, pieces: Iterable[Partition], progress: Progress) -> Generator[tuple[Partition, Done]]:
    """Run pieces on this machine, in as many processes as the query's options say.

    A process that dies costs the time of its piece. A piece that kills every process is run frame by frame where need
    be, so that only the frames that kill are unknown.
    """
    jobs = query.options.jobs
    if jobs is None:
        worthwhile = query.dataset.manifest.total.frames // PIECE_FRAMES
        jobs = max(1, min(as_many_as_pay(), worthwhile))
    if jobs <= 1:
        own = replace(query, options=replace(query.options, jobs=1))
        for piece in pieces:
            yield piece, run_shard(own, piece, progress)
        return
    question = Question.of(query)
    asked = ((question, piece) for piece in pieces)
    workers: Workers[Asked, Done] = Workers(jobs, _start)
    with workers:
        for (_, piece), done in workers.run(asked):
            yield piece, alone(query, piece) if isinstance(done, Lost) else done
            progress(piece.frames)


def alone(query: Query, piece: Partition) -> Done:
    """Run a piece that kills the processes which take it."""
    return run_shard(replace(query, options=replace(query.options, jobs=2)), piece)


def kept(engine: Engine, folder: Path) -> Engine:
    """An engine that keeps pieces in a folder, and takes from there what is done already.

    Args:
        engine: Who runs the others.
        folder: Made if need be.
    """

    def run(query: Query, pieces: Iterable[Partition], progress: Progress) -> Generator[tuple[Partition, Done]]:
        question = name_question(query)
        every = tuple(pieces)
        missing = {piece.number for piece in every if not is_done(folder, question, piece.number, piece.count)}
        for piece in every:
            if piece.number not in missing:
                progress(piece.frames)
        running = engine(query, [piece for piece in every if piece.number in missing], progress)
        with contextlib.closing(running):
            for piece in every:
                if piece.number in missing:
                    _, (results, funnel) = next(running)
                    if funnel.cut:
                        # only whole pieces are kept
                        yield piece, (results, funnel)
                        return
                    asked = replace(query, recordings=piece.recordings, funnel=funnel)
                    write_partition(folder, question, piece, map(record, results), asked)
                    yield piece, (results, funnel)
                else:
                    found = gather(folder, question, only=piece.number)
                    yield piece, ([read_record(each, query.source) for each in found.records()], found.funnel)

    return run


def in_order(query: Query, engine: Engine, pieces: Iterable[Partition], progress: Progress) -> Generator[Result]:
    """The results of a query that an engine runs, as `Query.results` gives them.

    Args:
        query: The query; its funnel is filled.
        engine: Who runs the pieces.
        pieces: All of them.
        progress: Called with the number of frames decided since the last call.
    """
    left = query.options.limit
    for _, (results, funnel) in engine(query, pieces, progress):
        query.funnel.add(funnel)
        for result in results:
            yield result
            if isinstance(result.verdict, Match) and left is not None:
                left -= 1
                if left <= 0:
                    query.funnel.limited = result
                    return
        if funnel.cut:
            return


def _start() -> Callable[[Asked, Callable[[object], None]], Done]:
    known: dict[str, Query] = {}

    def work(asked: Asked, _tell: Callable[[object], None]) -> Done:
        question, piece = asked
        if question.fingerprint not in known:
            known[question.fingerprint] = question.query()
        return run_shard(known[question.fingerprint], piece)

    return work
