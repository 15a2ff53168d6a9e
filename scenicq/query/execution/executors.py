"""Executors run the pieces of a query: `run_here`, `processes`, `dask`, and `resumable`, which keeps what is done.

An executor is a function of a query, its pieces and whatever shows progress. It yields each piece with its results and
counts, in the order of the pieces, and begins none once the time is over. A process that dies costs the time of its
piece.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, replace

from scenicq.errors import Source
from scenicq.processes import LostTask, Workers, default_processes
from scenicq.query.execution.pieces import DatasetPiece, find_finished, gather, partitions, write_piece
from scenicq.query.execution.program_files import SiblingFiles
from scenicq.query.execution.question_notes import name_question
from scenicq.query.execution.records import read_record, record
from scenicq.query.execution.results import Funnel, Result, limit_matches
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import DatasetReference
from scenicq.store.remote_path import AnyPath

__all__ = [
    "Done",
    "Executor",
    "PieceQuestion",
    "Progress",
    "Question",
    "local_executor",
    "ordered_results",
    "processes",
    "resumable",
    "run_frame_by_frame",
    "run_here",
    "run_piece",
    "usual_pieces",
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
        fingerprint: Checksum of dataset, program and options.
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


PieceQuestion = tuple[Question, DatasetPiece]
Progress = Callable[[int], None]
"""Called with the number of frames decided since the last call."""
Executor = Callable[[Query, Iterable[DatasetPiece], Progress], Generator[tuple[DatasetPiece, Done]]]
"""Runs pieces of a query; they come in their order."""


def usual_pieces(query: Query, least: int = 1) -> tuple[DatasetPiece, ...]:
    """The pieces that a query is run in.

    Args:
        query: The query.
        least: How many there are at least if the dataset has as many recordings.
    """
    return partitions(query.dataset, max(least, query.dataset.manifest.total.frames // PIECE_FRAMES))


def run_piece(query: Query, piece: DatasetPiece, progress: Progress | None = None) -> Done:
    """Run one piece here."""
    query.recordings, query.funnel = piece.recordings, Funnel()
    return list(query.results(progress)), query.funnel


def run_here(query: Query, pieces: Iterable[DatasetPiece], progress: Progress) -> Generator[tuple[DatasetPiece, Done]]:
    """Run pieces in this process."""
    own = replace(query, options=replace(query.options, jobs=1))
    for piece in pieces:
        yield piece, run_piece(own, piece, progress)


def processes(count: int) -> Executor:
    """An executor that runs pieces in processes of this machine.

    Args:
        count: How many.
    """

    def run(query: Query, pieces: Iterable[DatasetPiece], progress: Progress) -> Generator[tuple[DatasetPiece, Done]]:
        question = Question.of(query)
        workers: Workers[PieceQuestion, Done] = Workers(count, _start)
        with workers:
            for (_, piece), answer in workers.run((question, piece) for piece in pieces):
                done = run_frame_by_frame(query, piece) if isinstance(answer, LostTask) else answer
                progress(piece.frames)
                yield piece, done

    return run


def local_executor(query: Query) -> Executor:
    """The executor that runs pieces here, or in as many processes as the query's options say or as pay."""
    jobs = query.options.jobs
    if jobs is None:
        jobs = min(default_processes(), query.dataset.manifest.total.frames // PIECE_FRAMES)
    return processes(jobs) if jobs > 1 else run_here


def run_frame_by_frame(query: Query, piece: DatasetPiece) -> Done:
    """Run a piece that kills the processes which take it: only the frames that kill are unknown."""
    return run_piece(replace(query, options=replace(query.options, jobs=2)), piece)


def resumable(folder: AnyPath, executor: Executor) -> Executor:
    """An executor that keeps pieces in a folder, and takes from there what is done already.

    Args:
        folder: Here, made if need be, or elsewhere.
        executor: Who runs the others.
    """

    def run(query: Query, pieces: Iterable[DatasetPiece], progress: Progress) -> Generator[tuple[DatasetPiece, Done]]:
        question = name_question(query)
        every = tuple(pieces)
        done = find_finished(folder, question, every)
        progress(sum(piece.frames for piece in every if piece.number in done))
        missing = [piece for piece in every if piece.number not in done]
        with contextlib.closing(executor(query, missing, progress)) as running:
            for piece in every:
                if piece.number not in done:
                    _, (results, funnel) = next(running)
                    if funnel.cut:
                        # only whole pieces are kept
                        yield piece, (results, funnel)
                        return
                    asked = replace(query, recordings=piece.recordings, funnel=funnel)
                    write_piece(folder, question, piece, map(record, results), asked)
                    yield piece, (results, funnel)
                else:
                    found = gather(folder, question, only=piece.number)
                    yield piece, ([read_record(each, query.source) for each in found.records()], found.funnel)

    return run


def ordered_results(
    query: Query, executor: Executor, pieces: Iterable[DatasetPiece], progress: Progress
) -> Generator[Result]:
    """The results of a query that an executor runs, as `Query.results` gives them.

    Args:
        query: The query; its funnel is filled.
        executor: Who runs the pieces.
        pieces: All of them.
        progress: Called with the number of frames decided since the last call.
    """
    return limit_matches(query.limit, _put_together(query, executor, pieces, progress), query.funnel)


def _put_together(
    query: Query, executor: Executor, pieces: Iterable[DatasetPiece], progress: Progress
) -> Generator[Result]:
    with contextlib.closing(executor(query, pieces, progress)) as running:
        for _, (results, funnel) in running:
            query.funnel.add(funnel)
            yield from results
            if funnel.cut:
                return


def _start() -> Callable[[PieceQuestion, Callable[[object], None]], Done]:
    known: dict[str, Query] = {}

    def work(asked: PieceQuestion, _tell: Callable[[object], None]) -> Done:
        question, piece = asked
        if question.fingerprint not in known:
            known[question.fingerprint] = question.query()
        return run_piece(known[question.fingerprint], piece)

    return work
