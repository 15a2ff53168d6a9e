"""`scenicq gather`: put the shards of a query together."""

from __future__ import annotations

from pathlib import Path

import click

from scenicq.exporters.forms import FORMS
from scenicq.query.execution.pieces import Gathered
from scenicq.query.execution.pieces import gather as find_pieces
from scenicq.query.execution.question_notes import noted_question
from scenicq.query.execution.recorded_columns import columns_of_records
from scenicq.query.execution.records import FrameRecord, IntervalRecord, read_record
from scenicq.query.execution.result_tables import roles_of
from scenicq.store.remote_path import AnyPath

from .deliver import Wanted, deliver, exit_code
from .formats import FORMATS, make_writer
from .manual import OPEN, Manual
from .output import ProgressBar, choose_format, destination, writing
from .path_type import ANY_PATH, chosen_file
from .sources import SENSORS

__all__ = ["gather"]


@click.command(
    cls=Manual,
    arguments={"FOLDER": "Where `scenicq match --shard` put the pieces, here or elsewhere."},
    exits={0: "something matched", 1: "nothing matched (with --exit-zero: 0)", 3: f"{OPEN} (with --exit-zero: 0)"},
    epilog="\b\nExample:\n  scenicq gather pieces -o matches.parquet",
)
@click.argument("folder", type=ANY_PATH)
@click.option("--format", "format_", metavar="NAME", type=click.Choice(FORMATS),
              help="table, jsonl, csv, spreadsheet, parquet or ids.  [default: as for `match`]")  # fmt: skip
@click.option("-o", "--output", metavar="FILE", type=ANY_PATH, help="Write to a file, also to s3://...")
@click.option("--export", metavar="FORM DIR", type=(click.Choice(FORMS), ANY_PATH),
              help="Hand the matching frames on, too, in a new folder DIR; as for `match`.")  # fmt: skip
@click.option("--report", metavar="DIR", type=ANY_PATH,
              help="Write a page with pictures of the matches, too: DIR/index.html.")  # fmt: skip
@SENSORS
@click.option("--exit-zero", is_flag=True, help="Exit with 0 also where nothing matches, or something is undecided.")
@click.pass_context
def gather(ctx: click.Context, folder: AnyPath, *, format_: str | None, output: AnyPath | None,
           export: tuple[str, AnyPath] | None, report: AnyPath | None, sensors: Path | None,
           exit_zero: bool) -> None:  # fmt: skip
    """Put the shards of a query together, in the order of the dataset.

    A shard that is missing or damaged is named. For an export or a report, dataset and scenario are read where they
    were when the shards were run. Exit codes as of `match`.
    """
    file = chosen_file(output)
    form = choose_format(format_, file)
    gathered = find_pieces(folder)
    if export is None and report is None:
        _write(gathered, file, form)
    else:
        query = noted_question(folder, gathered.question)
        query.funnel = gathered.funnel
        results = (read_record(each, query.source) for each in gathered.records())
        deliver(query, results, (), Wanted(file, form, export, report, sensors=sensors), ProgressBar(quiet=True))
    if not exit_zero:
        ctx.exit(exit_code(gathered.funnel, gathered.summary))


def _write(gathered: Gathered, file: AnyPath | None, form: str) -> None:
    with destination(file) as sink, writing(file):
        first = next(gathered.records(), None)
        origin, over_time = (first and first.dataset) or "", isinstance(first, IntervalRecord)
        every = isinstance(first, FrameRecord) and first.all_matches is True
        writer = make_writer(form, sink, lambda: roles_of(gathered.records()),
                             recorded=lambda: columns_of_records(gathered.records()), origin=origin,
                             over_time=over_time, every=every)  # fmt: skip
        for each in gathered.records():
            writer.write(each)
        writer.finish(gathered.summary)
