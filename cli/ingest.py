"""`scenicq ingest`: make a dataset from a source."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Generator
from pathlib import Path

import click

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.ingest import IngestSummary
from scenicq.importers.ingest import ingest as make_dataset
from scenicq.option_values import Count
from scenicq.store.atomic_files import whole_folder
from scenicq.store.manifest import MANIFEST, Omission
from scenicq.store.remote_path import AnyPath, RemotePath
from scenicq.store.targets import target_of

from .manual import Manual
from .option_type import OptionType
from .output import ProgressBar
from .path_type import ANY_PATH, LOCAL_PATH, check_here
from .report import columns, count, show_few
from .sources import remember
from .user_folders import map_cache

__all__ = ["defects", "ingest"]


def defects(left_out: tuple[Omission, ...]) -> list[str]:
    """Lines that say what was left out of a dataset, or kept with a defect; none where all is well."""
    lines: list[str] = []
    for kept, title in ((False, "left out"), (True, "kept with a defect")):
        entries = [entry for entry in left_out if entry.kept == kept]
        rows = [(f"{each.count:,}", each.what, each.code, each.name) for each in entries]
        if rows:
            lines += [f"{title}:", *columns(rows, right=frozenset({0}))]
    return lines


def _lines(target: AnyPath, summary: IngestSummary, elapsed_s: float) -> list[str]:
    rows = sorted(summary.by_class.items(), key=lambda item: (-item[1], item[0]))
    return [
        f"{target}: {count(summary.frames, 'frame')}, {count(summary.objects, 'object')}, "
        f"{count(summary.tracks, 'track')} in {count(summary.recordings, 'recording')}, "
        f"read as {summary.importer} in {elapsed_s:.1f} s",
        *columns([(name, f"{number:,}") for name, number in rows], right=frozenset({1})),
        *defects(summary.left_out),
    ]


def _check_new(dataset: RemotePath, *, force: bool, update: bool) -> None:
    """Before the work, refuse a place elsewhere that is not new or cannot be written."""
    if force or update:
        message = f"{dataset} lies elsewhere, where a dataset is made new, and neither replaced nor updated"
        hint = "update it on this machine, and copy it there, `dataset.json` last"
        raise DataError(Diagnostic("option-invalid", message, hints=(hint,)))
    if target_of(dataset).is_taken():
        hint = "choose another name: nothing elsewhere is replaced"
        raise DataError(Diagnostic("target-exists", f"{dataset} exists", hints=(hint,)))
    target_of(dataset).check_writable()


@contextlib.contextmanager
def _target(dataset: AnyPath) -> Generator[Path]:
    """Give a folder to make the dataset in; for a place elsewhere one here, which is sent in the end, manifest last."""
    if isinstance(dataset, Path):
        yield dataset
        return
    with whole_folder(dataset, MANIFEST) as folder:
        folder.rmdir()  # ingest makes it
        yield folder


@click.command(
    cls=Manual,
    arguments={
        "SOURCE": "A folder or file of recordings; its format is recognised.",
        "DATASET": "The folder to be made, here or elsewhere (s3://...): there it must be new.",
    },
    epilog="\b\nExamples:\n"
    "  scenicq ingest sample_data/crossroads dataset\n"
    "  scenicq ingest recordings dataset --map town=town.geojson --jobs 4",
)
@click.argument("source", type=LOCAL_PATH)
@click.argument("dataset", type=ANY_PATH)
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
    type=LOCAL_PATH,
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
def ingest(source: Path, dataset: AnyPath, *, format_: str | None, maps: tuple[str, ...], class_map: Path | None,
           ego: str | None, strict: bool, jobs: int | None, force: bool, update: bool,
           quiet: bool) -> None:  # fmt: skip
    """Make a dataset from a source, such as a nuScenes folder.

    The dataset appears when it is complete: an error or an interrupt leaves what was there before.
    """
    started = time.perf_counter()
    for each in maps:
        check_here(each.partition("=")[2] or each)
    if isinstance(dataset, RemotePath):
        _check_new(dataset, force=force, update=update)
    with ProgressBar(quiet=quiet) as bar, map_cache() as cache, _target(dataset) as target:
        summary = make_dataset(
            source,
            target,
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
    if isinstance(dataset, Path):
        remember(dataset, source)
    if not quiet:
        show_few(summary.diagnostics)
        click.echo("\n".join(_lines(dataset, summary, time.perf_counter() - started)), err=True)
