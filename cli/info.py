"""`scenicq info`: what a dataset holds, where it comes from and what was left out of it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence

import click

from scenicq.errors import plain_json
from scenicq.store.dataset import Dataset
from scenicq.store.manifest import Counts, Manifest
from scenicq.store.map_fit import MapFit, map_fits, misfits
from scenicq.store.motion import LONGEST_GAP_US
from scenicq.store.observed_motion import observed_motion
from scenicq.store.schema import SCHEMAS
from scenicq.store.soundness import check_dataset
from scenicq.store.verification import verify_computed

from .datasets import open_checked
from .ingest import defects
from .manual import Manual
from .report import columns, count, is_date, moment, plain, show_few
from .streams import say

__all__ = ["info"]

_VERIFIED = ("every checksum is right, and every value is sound",)
_TOP = 10
"""Recordings and classes of the source that are listed."""


def _counted(title: str, counts: Mapping[str, Counts]) -> list[str]:
    ranked = sorted(counts.items(), key=lambda item: (-item[1].frames, item[0]))
    rows = [(name, f"{each.frames:,}", f"{each.objects:,}") for name, each in ranked[:_TOP]]
    more = [f"  and {len(ranked) - _TOP:,} more"] if len(ranked) > _TOP else []
    return [*columns([(title, "frames", "objects"), *rows], right=frozenset({1, 2}), indent=""), *more, ""]


def _classes(manifest: Manifest) -> list[str]:
    rows = sorted(manifest.by_class.items(), key=lambda item: (-item[1], item[0]))
    return [*columns([("CLASS", "objects"), *((n, f"{c:,}") for n, c in rows)], right=frozenset({1}), indent=""), ""]


def _tables(manifest: Manifest) -> list[str]:
    rows = [("TABLE", "rows", "files", "MB")]
    for name, parts in manifest.tables.items():
        size = sum(part.bytes for part in parts) / 1e6
        rows.append((name, f"{sum(part.rows for part in parts):,}", f"{len(parts):,}", f"{size:,.2f}"))
    every = [part for parts in manifest.tables.values() for part in parts]
    rows.append(("all", "", f"{len(every):,}", f"{sum(part.bytes for part in every) / 1e6:,.2f}"))
    width = max(map(len, SCHEMAS)) + 2
    named: list[str] = []
    for name in manifest.tables:
        indent = " " * width
        named += textwrap.wrap(", ".join(SCHEMAS[name].names), 110, initial_indent=name.ljust(width),
                               subsequent_indent=indent, break_on_hyphens=False)  # fmt: skip
    return [*columns(rows, right=frozenset({1, 2, 3}), indent=""), "", f"{'TABLE'.ljust(width)}columns", *named, ""]


def _motion(dataset: Dataset) -> list[str]:
    observed = observed_motion(dataset)
    rows = [("MOTION", "labels' own", "from tracks", "unknown")]
    for name, known in observed.known.items():
        own, derived, unknown = (f"{each / known.total:.1%}" for each in (known.own, known.derived, known.unknown))
        rows.append((name, own, derived, unknown))
    found = columns(rows, right=frozenset({1, 2, 3}), indent="") if len(rows) > 1 else []
    facts = dataset.manifest.provenance.facts
    if "velocity" in facts:
        found.append(f"velocity of labels: {facts['velocity']}")
    steps, gaps = observed.steps, observed.gaps
    if steps is None:
        found.append("no recording has two labels: nothing can be matched over time")
    else:
        between = f"{steps.median:.3g} s from one to the next ({steps.shortest:.3g} to {steps.longest:.3g})"
        found.append(f"{1 / steps.median:.3g} labels a second: {between}")
    found.append(
        f"over {LONGEST_GAP_US / 1e6:g} s without a label: {count(gaps.recordings, 'gap')} in recordings, "
        f"{count(gaps.tracks, 'gap')} in tracks"
    )
    if observed.without_track:
        found.append(f"{count(observed.without_track, 'object')} without a track")
    return [*found, ""]


def _fit(fits: Sequence[MapFit], maps: int) -> list[str]:
    """What was measured of the maps."""
    if not fits:
        return []

    def share(value: float | None) -> str:
        return "" if value is None else f"{value:.0%}"

    rows = [("MAP", "vehicles", "on lanes", "off their direction", "lane width", "fits")]
    for fit in fits[:_TOP]:
        deviation = "" if fit.deviation is None else f"{math.degrees(fit.deviation):.0f} deg"
        width = "" if fit.width_m is None else f"{fit.width_m:.3g} m"
        fits_so = "no" if fit.cause else "" if fit.on_lanes is None else "yes"
        rows.append((fit.map, f"{fit.vehicles:,}", share(fit.on_lanes), deviation, width, fits_so))
    more = [f"  and {len(fits) - _TOP:,} more"] if len(fits) > _TOP else []
    if maps > len(fits):
        more.append(f"looked at the {len(fits):,} maps of {maps:,} that have the most labels")
    return [*columns(rows, right=frozenset({1, 2, 3, 4}), indent=""), *more, ""]


def _lines(dataset: Dataset, fits: Sequence[MapFit]) -> list[str]:
    manifest = dataset.manifest
    span = manifest.span_us
    made = manifest.provenance
    versions = ", ".join(f"{name} {number}" for name, number in made.versions.items())
    clock = "UTC" if span is None or is_date(span[0]) else "by the source's own clock, which tells no date"
    without_map = sorted(set(manifest.by_map) - set(manifest.maps))
    return [
        f"{manifest.name}: {count(manifest.total.frames, 'frame')}, {count(manifest.total.objects, 'object')}, "
        f"{count(manifest.tracks, 'track')} in {count(len(manifest.by_recording), 'recording')}",
        *([f"from {moment(span[0])} to {moment(span[1])} ({clock})"] if span else []),
        f"read as {manifest.importer} from {made.source} on {made.time}",
        f"with {versions}",
        "",
        *_classes(manifest),
        *_counted("MAP", manifest.by_map),
        *([f"no map for: {', '.join(without_map)}", ""] if without_map else []),
        *_fit(fits, len(dataset.maps)),
        *_counted("RECORDING", manifest.by_recording),
        *_motion(dataset),
        *_tables(manifest),
        *(defects(manifest.left_out) or ["nothing was left out"]),
    ]


@click.command(
    cls=Manual,
    arguments={"DATASET": "A folder that `scenicq ingest` made."},
    epilog="\b\nExample:\n  scenicq info dataset --verify",
)
@click.argument("dataset", type=click.Path())
@click.option(
    "--verify",
    is_flag=True,
    help="Compare every file with its checksum, look at every value, and compute anew what was computed at ingest.",
)
@click.option("--format", "format_", type=click.Choice(["text", "json"]), default="text",
              help="json gives the whole manifest.")  # fmt: skip
def info(dataset: str, *, verify: bool, format_: str) -> None:
    """Say what a dataset holds and what was left out of it."""
    opened = open_checked(dataset)
    if verify:
        with opened.blamed():
            opened.verify()
            check_dataset(opened)
            verify_computed(opened)
    if format_ == "json":
        say(plain_json(opened.manifest.to_json()), nl=False)
    else:
        fits = map_fits(opened)
        show_few(misfits(fits))
        say(
            plain(
                "\n".join(
                    [
                        *_lines(opened, fits),
                        *(["every checksum is right, and every value is sound"] if verify else []),
                    ]
                )
            )
        )
