"""Run one shard of a query: match a piece of the dataset, and write it into the folder of all shards."""

from __future__ import annotations

from collections.abc import Iterator

import click

from scenicq.errors import DataError, Diagnostic
from scenicq.query.execution.pieces import find_finished, gather, partitions, write_piece
from scenicq.query.execution.question_notes import name_question, note_question
from scenicq.query.execution.records import Record, record
from scenicq.query.execution.result_origin import name_origin
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.results import Funnel
from scenicq.query.execution.run import Query
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

from .output import ProgressBar

__all__ = ["LateShardError", "Shard", "parse_shard", "run_shard"]

Shard = tuple[int, int]
"""Which piece, from 1, of how many."""


class LateShardError(DataError):
    """The deadline came before a shard was finished."""


def parse_shard(_ctx: click.Context, _parameter: click.Parameter, text: str | None) -> Shard | None:
    """Read `I/N`."""
    if text is None:
        return None
    left, slash, right = text.partition("/")
    if not (slash and left.isdecimal() and right.isdecimal() and 1 <= int(left) <= int(right)):
        raise click.BadParameter("write I/N with 1 <= I <= N, as in 3/16")
    return int(left), int(right)


def _whole(query: Query, shard: Shard, folder: AnyPath, bar: ProgressBar) -> Iterator[Record]:
    """Yield the records of a shard, and fail in the end if the deadline cut them: a shard is kept whole or not at all.

    Raises:
        LateShardError: deadline-passed.
    """
    origin = name_origin(query.dataset)
    for result in query.results(bar.advance):
        yield record(result, origin, every=query.options.all_matches)
    if query.funnel.cut:
        number, count = shard
        message = f"shard {number}/{count} was not finished by the --deadline, and a shard is kept whole or not at all"
        hints = ("more shards are smaller; those that are finished are kept",)
        raise LateShardError(Diagnostic("deadline-passed", message, hints=hints))
    note_question(folder, query)


def run_shard(query: Query, shard: Shard, folder: AnyPath, *, quiet: bool) -> tuple[Funnel, ResultSummary | None]:
    """Match one shard into a folder, unless its file is there already; return its counts and its summary."""
    number, count = shard
    question = name_question(query)
    pieces = partitions(query.dataset, count)
    if number > len(pieces):
        return Funnel(), None  # fewer recordings than shards: nothing is left for this one
    piece = pieces[number - 1]
    if not find_finished(folder, question, [piece]):
        target_of(folder).check_writable()
        query.recordings = piece.recordings
        with ProgressBar(piece.frames, quiet=quiet) as bar:
            write_piece(folder, question, piece, _whole(query, shard, folder, bar), query)
    gathered = gather(folder, question, only=piece.number)
    return gathered.funnel, gathered.summary
