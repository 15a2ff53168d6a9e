"""Running `scenicq match` piece by piece: one shard of many, or all of them with a place to go on from."""

from __future__ import annotations

import shutil
from pathlib import Path

import click

from scenicq.query.partitions import Partition, fingerprint, gather, is_done, partitions, write_partition
from scenicq.query.results import Funnel, record
from scenicq.query.run import Query

from .formats import make_writer
from .output import ProgressBar, destination, writing

__all__ = ["Shard", "parse_shard", "run_resumable", "run_shard", "write_gathered"]

Shard = tuple[int, int]
"""Which piece, from 1, of how many."""

_PIECE_FRAMES = 20_000
"""Frames of a piece of a resumable run, about: what an interruption can lose."""


def parse_shard(_ctx: click.Context, _parameter: click.Parameter, text: str | None) -> Shard | None:
    """Read `I/N`."""
    if text is None:
        return None
    left, slash, right = text.partition("/")
    if not (slash and left.isdecimal() and right.isdecimal() and 1 <= int(left) <= int(right)):
        raise click.BadParameter("write I/N with 1 <= I <= N, as in 3/16")
    return int(left), int(right)


def _run(query: Query, piece: Partition, folder: Path, question: str, bar: ProgressBar) -> None:
    """Match one piece and write it."""
    one = Query(query.dataset, query.source, query.options, recordings=piece.recordings)
    write_partition(folder, question, piece, (record(result) for result in one.results(bar.advance)), one.funnel)
    for warning in one.funnel.warnings:
        if warning not in query.funnel.warnings:
            query.funnel.warnings.append(warning)


def run_shard(query: Query, shard: Shard, folder: Path, *, quiet: bool) -> Funnel:
    """Match one shard into a folder, unless it is there already; what it found is counted."""
    number, count = shard
    question = fingerprint(query.dataset, query.source.text, query.options)
    pieces = partitions(query.dataset, count)
    if number > len(pieces):
        return Funnel()  # fewer recordings than shards: nothing is left for this one
    piece = pieces[number - 1]
    if not is_done(folder, question, piece.number, piece.count):
        with ProgressBar(piece.frames, quiet=quiet) as bar:
            _run(query, piece, folder, question, bar)
    return gather(folder, question, only=piece.number).funnel


def run_resumable(query: Query, file: Path, chosen: str, *, quiet: bool) -> Funnel:
    """Match everything piece by piece, going on where an earlier run stopped, then write the one file."""
    folder = file.with_name(f".{file.name}.pieces")
    question = fingerprint(query.dataset, query.source.text, query.options)
    frames = query.dataset.manifest.total.frames
    with ProgressBar(frames, quiet=quiet) as bar:
        for piece in partitions(query.dataset, max(1, frames // _PIECE_FRAMES)):
            if is_done(folder, question, piece.number, piece.count):
                bar.advance(piece.frames)
            else:
                _run(query, piece, folder, question, bar)
    funnel = write_gathered(folder, question, file, chosen)
    shutil.rmtree(folder)
    return funnel


def write_gathered(folder: Path, question: str | None, file: Path | None, chosen: str) -> Funnel:
    """Put the pieces of a folder together into one file, or on standard output."""
    gathered = gather(folder, question)
    with destination(file) as sink, writing(file):
        writer = make_writer(chosen, sink)
        for each in gathered.records():
            writer.write(each)
        writer.finish()
    return gathered.funnel
