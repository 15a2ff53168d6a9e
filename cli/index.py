"""`scenicq index`: compute anew what is derived in a dataset."""

from __future__ import annotations

import click

from scenicq.store.dataset import open_dataset
from scenicq.store.rebuild import rebuild

from .manual import Manual
from .output import ProgressBar
from .report import count
from .sources import recorded_source, remember

__all__ = ["index"]


@click.command(
    cls=Manual,
    arguments={"DATASET": "A folder that `scenicq ingest` made."},
    epilog="\b\nExample:\n  scenicq index demo/crossroads",
)
@click.argument("dataset", type=click.Path())
@click.option("-q", "--quiet", is_flag=True, help="No progress, no summary.")
def index(dataset: str, *, quiet: bool) -> None:
    """Compute anew what a dataset holds beside the labels.

    Lanes, road directions, memberships, positions relative to the ego, observed motion and counts are replaced, all at
    once. Labels, objects, sensor paths and maps stay as they are. A dataset of an older version is brought up to date.
    """
    opened = open_dataset(dataset, older=True, check=False)
    source = recorded_source(opened)
    with ProgressBar(opened.manifest.total.frames, quiet=quiet) as bar:
        manifest = rebuild(opened, bar.advance)
    if source is not None:
        remember(opened.path, source)
    if not quiet:
        click.echo(f"{dataset}: {count(manifest.total.frames, 'frame')} indexed", err=True)
