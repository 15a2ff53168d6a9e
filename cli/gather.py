"""`scenicq gather`: put the shards of a query together."""

from __future__ import annotations

from pathlib import Path

import click
from msgspec import UNSET

from scenicq.exporters.forms import FORMS
from scenicq.query.execution.option_texts import QUERY_OPTIONS
from scenicq.query.execution.pieces import GatheredPieces
from scenicq.query.execution.pieces import gather as find_pieces
from scenicq.query.execution.question_notes import noted_question
from scenicq.query.execution.recorded_columns import columns_of_records
from scenicq.query.execution.records import FrameRecord, IntervalRecord, Record, read_record
from scenicq.query.execution.result_selection import ResultSelection
from scenicq.query.execution.result_summary import ResultCount
from scenicq.query.execution.result_tables import roles_of
from scenicq.store.remote_path import AnyPath

from .deliver import Destination, deliver, exit_code
from .formats import FORMATS, make_writer
from .manual import OPEN, Manual
from .options import add_options
from .output import ProgressBar, choose_format, destination, writing
from .path_type import ANY_PATH, chosen_file
from .selections import tell_unclear
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
              help="Also export the matching frames to a new folder DIR; as for `match`.")  # fmt: skip
@click.option("--report", metavar="DIR", type=ANY_PATH,
              help="Also write a page with pictures of the matches: DIR/index.html.")  # fmt: skip
@add_options(QUERY_OPTIONS, "where", "sort")
@SENSORS
@click.option("--exit-zero", is_flag=True, help="Exit with 0 also if nothing matches, or if something is undecided.")
@click.pass_context
def gather(ctx: click.Context, folder: AnyPath, *, format_: str | None, output: AnyPath | None,
           export: tuple[str, AnyPath] | None, report: AnyPath | None, sensors: Path | None,
           where: str | None, sort: str | None, exit_zero: bool) -> None:  # fmt: skip
    """Put the shards of a query together, in the order of the dataset or by what the program records.

    A shard that is missing or damaged is named. For an export or a report, dataset and scenario are read where they
    were when the shards were run. Exit codes as of `match`.
    """
    file = chosen_file(output)
    form = choose_format(format_, file)
    gathered = find_pieces(folder)
    selection = _selection(gathered, where, sort)
    if export is None and report is None:
        _write(gathered, file, form, selection)
    else:
        query = noted_question(folder, gathered.question)
        query.funnel = gathered.funnel
        results = (read_record(each, query.source) for each in gathered.records())
        if selection is not None:
            results = selection.applied(results, query.funnel, lambda found: found)
        deliver(query, results, (), Destination(file, form, export, report, sensors=sensors), ProgressBar(quiet=True))
    if selection is not None and selection.unclear:
        tell_unclear(selection)
    if not exit_zero:
        ctx.exit(exit_code(gathered.funnel, gathered.summary))


def _selection(gathered: GatheredPieces, where: str | None, sort: str | None) -> ResultSelection | None:
    if where is None and sort is None:
        return None
    return ResultSelection.read(where, sort, columns_of_records(gathered.records()))


def _has_timeline(record: Record) -> bool:
    return isinstance(record, IntervalRecord) and record.timeline is not UNSET


def _write(gathered: GatheredPieces, file: AnyPath | None, form: str, selection: ResultSelection | None) -> None:
    with destination(file) as sink, writing(file):
        first = next(gathered.records(), None)
        origin, over_time = (first and first.dataset) or "", isinstance(first, IntervalRecord)
        every = isinstance(first, FrameRecord) and first.all_matches is True
        writer = make_writer(form, sink, lambda: roles_of(gathered.records()),
                             recorded=lambda: columns_of_records(gathered.records()), origin=origin,
                             over_time=over_time, every=every,
                             timelines=lambda: any(map(_has_timeline, gathered.records())))  # fmt: skip
        records, summary = gathered.records(), gathered.summary
        if selection is not None:
            records = selection.ordered(selection.filtered(records))
        counted = ResultCount()
        for each in counted.counted(records):
            writer.write(each)
        if selection is not None:
            gathered.funnel.chosen = selection.chosen()
            summary = None if summary is None else selection.summary_of(summary, counted.results)
        writer.finish(summary)
