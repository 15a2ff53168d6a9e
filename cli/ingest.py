"""`scenicq ingest`: make a dataset from a source."""

from __future__ import annotations

import time
from pathlib import Path

import click

from scenicq.importers.ingest import IngestSummary
from scenicq.importers.ingest import ingest as make_dataset
from scenicq.option_values import Count
from scenicq.store.manifest import LeftOut

from .manual import Manual
from .option_type import OptionType
from .output import ProgressBar
from .report import columns, count, show_few
from .sources import remember
from .user_folders import map_cache

__all__ = ["defects", "ingest"]


def defects(left_out: tuple[LeftOut, ...]) -> list[str]:
    """What was left out of a dataset, or kept with a defect, as lines; nothing where all is well."""
    lines: list[str] = []
    for kept, title in ((False, "left out"), (True, "kept with a defect")):
        entries = [entry for entry in left_out if entry.kept == kept]
        rows = [(f"{each.count:,}", each.what, each.code, each.name) for each in entries]
        if rows:
            lines += [f"{title}:", *columns(rows, right=frozenset({0}))]
    return lines


def _lines(summary: IngestSummary, elapsed_s: float) -> list[str]:
    rows = sorted(summary.by_class.items(), key=lambda item: (-item[1], item[0]))
    return [
        f"{summary.target}: {count(summary.frames, 'frame')}, {count(summary.objects, 'object')}, "
        f"{count(summary.tracks, 'track')} in {count(summary.recordings, 'recording')}, "
        f"read as {summary.importer} in {elapsed_s:.1f} s",
        *columns([(name, f"{number:,}") for name, number in rows], right=frozenset({1})),
        *defects(summary.left_out),
    ]


@click.command(
    cls=Manual,
    arguments={
        "SOURCE": "A folder or file of recordings; its format is recognised.",
        "DATASET": "The folder to be made.",
    },
    epilog="\b\nExamples:\n"
    "  scenicq ingest sample_data/crossroads dataset\n"
    "  scenicq ingest recordings dataset --map town=town.geojson --jobs 4",
)
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option("--format", "format_", metavar="NAME", help="Format of the source.  [default: recognised]")
@click.option(
    "--map",
    "maps",
    metavar="FILE",
    multiple=True,
    help="A GeoJSON or OpenDRIVE map, FILE or NAME=FILE, in place of the source's own; may be given several times.",
)
@click.option(
    "--class-map",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="A JSON file {class of the source: class of the tree}.",
)
@click.option(
    "--ego",
    metavar="ID|nearest|none",
    help="Which track is the ego where the source has none; `nearest`: in each frame the vehicle in the middle; "
    "`none`: there is none, so match with `--ego any`.",
)
@click.option("--strict", is_flag=True, help="Stop at the first problem of the source.")
@click.option(
    "--jobs",
    metavar="N",
    type=OptionType(Count(most=4096)),
    help="Processes that read and compute.  [default: one a processor, at most 8]",
)
@click.option("--force", is_flag=True, help="Replace a dataset that is there already.")
@click.option("--update", is_flag=True, help="Add what is new in the source to the dataset that is there already.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no summary, no warnings.")
def ingest(source: Path, dataset: Path, *, format_: str | None, maps: tuple[str, ...], class_map: Path | None,
           ego: str | None, strict: bool, jobs: int | None, force: bool, update: bool,
           quiet: bool) -> None:  # fmt: skip
    """Make a dataset from a source, such as a nuScenes folder.

    The dataset appears when it is complete: an error or an interrupt leaves what was there before.
    """
    started = time.perf_counter()
    with ProgressBar(quiet=quiet) as bar, map_cache() as cache:
        summary = make_dataset(
            source,
            dataset,
            format=format_,
            maps=maps,
            class_map=class_map,
            ego=ego,
            map_cache=cache,
            strict=strict,
            force=force,
            update=update,
            jobs=jobs,
            progress=lambda progress: bar.reach(progress.frames, progress.total),
        )
    remember(dataset, source)
    if not quiet:
        show_few(summary.diagnostics)
        click.echo("\n".join(_lines(summary, time.perf_counter() - started)), err=True)
