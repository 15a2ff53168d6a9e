"""`scenicq report`: two result files of one dataset side by side."""

from __future__ import annotations

import click

from scenicq.query.execution.result_files import read_results
from scenicq.report.changes import changes, changes_page, changes_text, check_complete, check_datasets
from scenicq.store.remote_path import AnyPath

from .manual import Manual
from .output import destination, writing
from .path_type import ANY_PATH
from .report import printable, show
from .streams import say

__all__ = ["report"]


@click.command(
    name="report",
    cls=Manual,
    arguments={"A, B": "Result files of one dataset that `scenicq match -o` wrote: .jsonl, .csv or .parquet."},
    epilog="\b\nExamples:\n"
    "  scenicq report before.jsonl after.jsonl\n"
    "  scenicq report before.jsonl after.jsonl --all -o changes.html",
)
@click.argument("before", metavar="A", type=ANY_PATH)
@click.argument("after", metavar="B", type=ANY_PATH)
@click.option("--all", "every", is_flag=True, help="List the frames that stayed, too.")
@click.option("-o", "--output", metavar="FILE", type=ANY_PATH, help="Write a page of HTML to a file, also to s3://...")
def report(before: AnyPath, after: AnyPath, *, every: bool, output: AnyPath | None) -> None:
    """Say which matches came, went and stayed between two result files.

    This shows what a changed line of a program did. With `match --all` the files also say why a frame does not match.
    What one leaves open (a frame that is unknown, or that --limit, --deadline, --sample or --where left out) is
    undecided.
    """
    old, new = read_results(before), read_results(after)
    doubt = check_datasets(old.records, new.records)
    found = changes(old, new)
    doubts = [*([] if doubt is None else [doubt]), *check_complete(found, old, new)]
    show(doubts)
    if output is None or str(output) == "-":
        say(printable(changes_text(found, every=every)))
        return
    with destination(output) as sink, writing(output):
        sink.write(changes_page(found, (str(before), str(after)), doubts).encode())
