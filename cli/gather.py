"""`scenicq gather`: put the shards of a query together."""

from __future__ import annotations

from pathlib import Path

import click

from .formats import FORMATS
from .main import NOTHING
from .output import choose_format
from .pieces import write_gathered

__all__ = ["gather"]


@click.command(epilog="\b\nExample:\n  scenicq gather pieces -o matches.parquet")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--format", "format_", metavar="NAME", type=click.Choice(FORMATS),
              help="table, jsonl, csv, parquet or ids.  [default: as for `match`]")  # fmt: skip
@click.option("-o", "--output", metavar="FILE", type=click.Path(path_type=Path), help="Write to a file.")
@click.option("--exit-zero", is_flag=True, help="Exit with 0 also where nothing matches.")
@click.pass_context
def gather(ctx: click.Context, folder: Path, *, format_: str | None, output: Path | None, exit_zero: bool) -> None:
    """Put the shards of a query together, in the order of the dataset.

    A shard that is missing or damaged is named. Exit codes as of `match`.
    """
    file = None if output is None or str(output) == "-" else output
    funnel = write_gathered(folder, None, file, choose_format(format_, file))
    if funnel.matches == 0 and not exit_zero:
        ctx.exit(NOTHING)
