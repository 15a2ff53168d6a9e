"""`scenicq show`: a frame as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from scenicq.errors import DataError, Diagnostic
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Unknown
from scenicq.option_values import HALF, WIDTH
from scenicq.query.execution.interval_frames import verdict_at
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.option_texts import QUERY_OPTIONS
from scenicq.query.execution.run import Query
from scenicq.query.explain.frame_explanation import explain
from scenicq.query.explain.moments import intervals_around, named_frame
from scenicq.report.backdrop import Backdrop
from scenicq.report.frames import frame_page
from scenicq.report.picture import Shot, Style, draw
from scenicq.report.png import can_make_png, png
from scenicq.report.sensors import SensorFiles, can_make_thumbnails, roots_of
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.store.remote_path import AnyPath

from .datasets import open_checked
from .manual import Manual
from .option_type import OptionType
from .options import ONE_FRAME, OVER_TIME, SHARED, add_options, query_options
from .output import destination, writing
from .path_type import ANY_PATH, LOCAL_PATH, chosen_file
from .programs import read_scenario
from .remarks import remarks, show_remarks
from .sources import SENSORS, sensor_root
from .streams import results, say

__all__ = ["show"]

_STYLES: dict[str, Style] = {".svg": "adaptive", ".png": "light", ".html": "none"}
"""The formats, with the style that a picture needs for each."""


def _kind(output: AnyPath | None) -> str:
    """What to write, by the name of the file: SVG on standard output."""
    kind = ".svg" if output is None else output.suffix.lower()
    if kind not in _STYLES:
        hint = f"known are {', '.join(_STYLES)}"
        raise DataError(Diagnostic("option-invalid", f"the name {output} does not say which format", hints=(hint,)))
    if kind == ".png" and not can_make_png():
        png("")
    return kind


def _shot(dataset: Dataset, label: Label, scenario: Path | None, given: dict[str, Any]) -> tuple[Shot, Backdrop]:
    if scenario is None:
        return Shot(label), Backdrop(dataset.network(label.map))
    query = Query(dataset, read_scenario(scenario), query_options({**ONE_FRAME, **given}))
    show_remarks(query, *remarks(query, [label.map]))
    compiled, network = query.compile(label.map)
    if query.is_over_time() and (around := intervals_around(query, label)):
        return Shot(label, compiled, verdict_at(label, around[0])), Backdrop(network)
    with LazySolver(query.options.solver) as solver:
        matcher = Matcher(compiled, query.options.match, solver)
        verdict = matcher.match(label)
        why = None if isinstance(verdict, Unknown) else explain(matcher, label)
    return Shot(label, compiled, verdict, why), Backdrop(network)


@click.command(
    cls=Manual,
    arguments={
        "DATASET": "A folder that `scenicq ingest` made.",
        "FRAME": "The name of a frame as `scenicq match` prints it, or a part of it that no other frame has; or "
        "RECORDING@TIME (a timestamp, or seconds from the start of the recording, as in `@3.5s`).",
    },
    topics={"What counts as a match, with --scenario": SHARED, "Over time": OVER_TIME},
    epilog="\b\nExamples:\n"
    "  scenicq show dataset 1a2b3c -o frame.svg\n"
    "  scenicq show dataset 1a2b3c --scenario crossing.scenic -o frame.html\n"
    "  scenicq show dataset scene-0061@3.5s --scenario cut_in.scenic -o frame.svg\n"
    "  scenicq show dataset 1a2b3c --scenario crossing.scenic --half 30 -o frame.png",
)
@click.argument("dataset", type=click.Path())
@click.argument("frame")
@click.option(
    "--scenario",
    metavar="FILE",
    type=LOCAL_PATH,
    help="Show what this scenario says of the frame: roles, where each may be and which way it may face, hidden "
    "points, and in red what excludes it. Over time the roles are those of the interval in which the frame lies.",
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=ANY_PATH,
    help="Where to, here or elsewhere: .svg, .png (needs scenicq[png]) or .html.  [default: SVG to standard output]",
)
@click.option(
    "--half",
    metavar="M",
    type=OptionType(HALF),
    help="Metres from the ego to the edges of the picture.  [default: so that every role is seen]",
)
@click.option("--width", metavar="PX", type=OptionType(WIDTH), default=900, help="Width in pixels.")
@SENSORS
# --scenario names the program here
@add_options(QUERY_OPTIONS, *(SHARED | OVER_TIME) - {"run_scenario"})
def show(dataset: str, frame: str, *, scenario: Path | None, output: AnyPath | None, half: float | None,
         width: int, sensors: Path | None, **given: Any) -> None:  # fmt: skip
    """Draw one frame from above: map, boxes, and what a scenario says of it.

    The picture is drawn to scale with north up; the ego is in its middle.
    """
    file = chosen_file(output)
    kind = _kind(file)
    opened = open_checked(dataset)
    shot, backdrop = _shot(opened, named_frame(opened, frame), scenario, given)
    picture = draw(shot, backdrop, half=half, pixels=width, style=_STYLES[kind], captioned=kind != ".html")
    match kind:
        case ".png":
            data = png(picture)
        case ".html":
            beside = file.absolute().parent if isinstance(file, Path) else file or Path()
            roots = roots_of(opened, sensor_root(opened, sensors))
            work = beside if isinstance(beside, Path) else Path()  # one frame has all its images in the page
            files = SensorFiles(roots, beside, work, can_make_thumbnails(), inside=True)
            data = frame_page(shot, picture, files.find(shot.label.sensors)).encode()
        case _:
            data = picture.encode()
    with destination(file) as sink, writing(file):
        sink.write(data)
    if file is None and results().isatty():
        say()
