"""`scenicq info`: what a dataset holds, where it comes from and what was left out of it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import closing

import click

from scenicq.errors import printable_json
from scenicq.store.dataset import Dataset
from scenicq.store.manifest import Counts, Manifest
from scenicq.store.map_fit import MapFit, map_fits, misfits
from scenicq.store.motion import LONGEST_GAP_US
from scenicq.store.observed_motion import ObservedMotion, observed_motion
from scenicq.store.said_values import SaidValues, said_attributes, said_params
from scenicq.store.schema import SCHEMAS
from scenicq.store.soundness import check_dataset
from scenicq.store.verification import verify_computed

from .datasets import open_checked
from .ingest import defects
from .manual import Manual
from .report import columns, count, is_date, moment, printable, show_few
from .streams import say

__all__ = ["info"]

_VERIFIED = ("every checksum is right, and every value is sound",)
_TOP = 10
"""Recordings, classes of the source and names of what labels say that are listed."""
_FEW, _WIDEST = 5, 24
"""Values of one name that are listed, and how many characters of each."""


def _counted(title: str, counts: Mapping[str, Counts]) -> list[str]:
    ranked = sorted(counts.items(), key=lambda item: (-item[1].frames, item[0]))
    rows = [(name, f"{each.frames:,}", f"{each.objects:,}") for name, each in ranked[:_TOP]]
    more = [f"  and {len(ranked) - _TOP:,} more"] if len(ranked) > _TOP else []
    return [*columns([(title, "frames", "objects"), *rows], right=frozenset({1, 2}), indent=""), *more, ""]


def _said(title: str, what: str, said: Mapping[str, SaidValues]) -> list[str]:
    """What labels say beside the columns, by name."""
    if not said:
        return []
    rows = [(name, f"{each.count:,}", _values(each)) for name, each in [*said.items()][:_TOP]]
    more = [f"  and {len(said) - _TOP:,} more"] if len(said) > _TOP else []
    return [*columns([(title, what, "values"), *rows], right=frozenset({1}), indent=""), *more, ""]


def _values(said: SaidValues) -> str:
    """The values of one name, the most frequent first."""
    told = [] if said.numbers is None else [" to ".join(dict.fromkeys(f"{each:.6g}" for each in said.numbers))]
    shown = [f"{_short(text)} {number:,}" for text, number in [*said.others.items()][:_FEW]]
    more = [f"{len(said.others) - _FEW:,} more"] if len(said.others) > _FEW else []
    return ", ".join([*told, *shown, *more])


def _short(text: str) -> str:
    told = printable(text).replace("\n", " ")
    return told if len(told) <= _WIDEST else f"{told[: _WIDEST - 3]}..."


def _classes(dataset: Dataset) -> list[str]:
    """How many objects of each class there are, and in how many frames it is the ego's."""
    with closing(dataset.connect()) as connection:
        egos: dict[str, int] = dict(
            connection.execute("SELECT ego_class, count(*) FROM labels WHERE ego_class <> '' GROUP BY ALL").fetchall()
        )
    objects = dataset.manifest.by_class
    names = sorted({*objects, *egos}, key=lambda name: (-objects.get(name, 0), name))
    rows = [(name, f"{objects.get(name, 0):,}", f"{egos[name]:,}" if name in egos else "") for name in names]
    head = ("CLASS", "objects", "frames with such an ego")
    return [*columns([head, *rows], right=frozenset({1, 2}), indent=""), ""]


def _questions(dataset: Dataset, observed: ObservedMotion) -> list[str]:
    """Say what can be asked of the dataset, and what cannot."""
    manifest = dataset.manifest
    rows = {name: sum(part.rows for part in parts) for name, parts in manifest.tables.items()}
    without_map = sorted(set(manifest.by_map) - set(manifest.maps))
    if observed.steps is None:
        over_time = "no, as no recording has two labels"
    elif not manifest.tracks:
        over_time = "for the ego alone, as objects have no tracks"
    else:
        over_time = f"yes, by {count(manifest.tracks, 'track')}"
    roads = f"yes, {count(rows['lanes'], 'lane')}" if rows["lanes"] else "no, as there is no map with lanes"
    if rows["lanes"] and without_map:
        roads += f"; not for {', '.join(without_map)}, which have no map"
    known = observed.known.get("velocity of objects")
    share = (known.own + known.derived) / known.total if known is not None and known.total else 0.0
    told = [
        ("what happens over time", over_time),
        ("roads and lanes", roads),
        ("speeds of objects", f"yes, of {share:.0%}" if share else "no, as none is known"),
        ("sensor files", f"yes, {count(rows['sensors'], 'path')}" if rows["sensors"] else "no, as none is named"),
    ]
    return [*columns([("CAN BE ASKED", ""), *told], indent=""), ""]


def _tables(manifest: Manifest, *, named: bool) -> list[str]:
    rows = [("TABLE", "rows", "files", "MB")]
    for name, parts in manifest.tables.items():
        size = sum(part.bytes for part in parts) / 1e6
        rows.append((name, f"{sum(part.rows for part in parts):,}", f"{len(parts):,}", f"{size:,.2f}"))
    every = [part for parts in manifest.tables.values() for part in parts]
    rows.append(("all", "", f"{len(every):,}", f"{sum(part.bytes for part in every) / 1e6:,.2f}"))
    found = [*columns(rows, right=frozenset({1, 2, 3}), indent=""), ""]
    if not named:
        return [*found[:-1], "`--columns` lists the columns that SQL can ask", ""]
    width = max(map(len, SCHEMAS)) + 2
    listed: list[str] = []
    for name in manifest.tables:
        indent = " " * width
        listed += textwrap.wrap(", ".join(SCHEMAS[name].names), 110, initial_indent=name.ljust(width),
                               subsequent_indent=indent, break_on_hyphens=False)  # fmt: skip
    return [*found, f"{'TABLE'.ljust(width)}columns", *listed, ""]


def _rate(observed: ObservedMotion) -> str:
    """Say how often there is a label."""
    steps = observed.steps
    if steps is None:
        return "no recording has two labels: nothing can be matched over time"
    between = f"{steps.median:.3g} s from one to the next ({steps.shortest:.3g} to {steps.longest:.3g})"
    return f"{1 / steps.median:.3g} labels a second: {between}"


def _motion(dataset: Dataset, observed: ObservedMotion) -> list[str]:
    rows = [("MOTION", "labels' own", "from tracks", "unknown")]
    for name, known in observed.known.items():
        own, derived, unknown = (f"{each / known.total:.1%}" for each in (known.own, known.derived, known.unknown))
        rows.append((name, own, derived, unknown))
    found = columns(rows, right=frozenset({1, 2, 3}), indent="") if len(rows) > 1 else []
    facts = dataset.manifest.provenance.facts
    if "velocity" in facts:
        found.append(f"velocity of labels: {facts['velocity']}")
    gaps = observed.gaps
    found.append(
        f"over {LONGEST_GAP_US / 1e6:g} s without a label: {count(gaps.recordings, 'gap')} in recordings, "
        f"{count(gaps.tracks, 'gap')} in tracks"
    )
    if observed.without_track:
        found.append(f"{count(observed.without_track, 'object')} without a track")
    return [*found, ""]


def _fit(fits: Sequence[MapFit], maps: int) -> list[str]:
    """Say how well maps fit the labels."""
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


def _lines(dataset: Dataset, fits: Sequence[MapFit], *, named: bool) -> list[str]:
    manifest, observed = dataset.manifest, observed_motion(dataset)
    span = manifest.span_us
    made = manifest.provenance
    versions = ", ".join(f"{name} {number}" for name, number in made.versions.items())
    clock = "UTC" if span is None or is_date(span[0]) else "by the source's own clock, which tells no date"
    without_map = sorted(set(manifest.by_map) - set(manifest.maps))
    return [
        f"{manifest.name}: {count(manifest.total.frames, 'frame')}, {count(manifest.total.objects, 'object')}, "
        f"{count(manifest.tracks, 'track')} in {count(len(manifest.by_recording), 'recording')}",
        *([f"from {moment(span[0])} to {moment(span[1])} ({clock})"] if span else []),
        _rate(observed),
        f"read as {manifest.importer} from {made.source} on {made.time}",
        f"with {versions}",
        "",
        *_questions(dataset, observed),
        *_classes(dataset),
        *_said("ATTRIBUTE", "objects", said_attributes(dataset)),
        *_said("PARAMETER", "frames", said_params(dataset)),
        *_counted("MAP", manifest.by_map),
        *([f"no map for: {', '.join(without_map)}", ""] if without_map else []),
        *_fit(fits, len(dataset.maps)),
        *_counted("RECORDING", manifest.by_recording),
        *_motion(dataset, observed),
        *_tables(manifest, named=named),
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
@click.option("--columns", "named", is_flag=True, help="List the columns of the tables, too.")
@click.option("--format", "format_", type=click.Choice(["text", "json"]), default="text",
              help="json gives the whole manifest.")  # fmt: skip
def info(dataset: str, *, verify: bool, named: bool, format_: str) -> None:
    """Say what a dataset holds and what was left out of it."""
    opened = open_checked(dataset)
    if verify:
        with opened.blamed():
            opened.verify()
            check_dataset(opened.place, opened.manifest)
            verify_computed(opened)
    if format_ == "json":
        say(printable_json(opened.manifest.to_json()), nl=False)
    else:
        with opened.blamed():
            fits = map_fits(opened)
            lines = [*_lines(opened, fits, named=named)]
        show_few(misfits(fits))
        lines += ["every checksum is right, and every value is sound"] if verify else []
        say(printable("\n".join(lines)))
