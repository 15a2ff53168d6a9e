"""`scenicq match`: the frames of a dataset that match a scenario."""

from __future__ import annotations

import contextlib
import itertools
import shlex
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from scenicq.query.export import EXPORTS, Exporter
from scenicq.query.near import near_results
from scenicq.query.results import Result, record
from scenicq.query.run import Query, read_program
from scenicq.report.write import check_target, write_report
from scenicq.store.dataset import open_dataset

from .formats import FORMATS, make_writer
from .funnel import show_funnel
from .main import NOTHING
from .options import DEFAULTS, query_options
from .output import ProgressBar, choose_format, destination, writing
from .pieces import Shard, parse_shard, run_resumable, run_shard
from .plan import show_plan
from .report import show_few

__all__ = ["match"]


def _kept(results: Iterable[Result], into: list[Result] | None) -> Iterator[Result]:
    """The results, kept for a report if there is to be one."""
    for result in results:
        if into is not None:
            into.append(result)
        yield result


def _near(query: Query, count: int | None) -> Iterator[Result]:
    """The frames that come closest, looked for once the matches are there."""
    if count is not None:
        yield from near_results(query, count)


# fmt: off
@click.command(
    epilog="\b\nExamples:\n"
    "  scenicq match crossing.scenic dataset --tolerance position=0.25,heading=5deg\n"
    "  scenicq match crossing.scenic dataset --format ids | head\n"
    "  scenicq match crossing.scenic dataset -o matches.parquet --summary\n"
    "  seq 16 | xargs -P 4 -I{} scenicq match crossing.scenic dataset --shard {}/16 -o pieces --exit-zero"
)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option("--tolerance", metavar="LIST",
              help="How far labels may be off: position=0.25,heading=5deg, or x=, y=, heading=. Lengths in metres, "
              "angles in deg or rad.  [default: 1e-3 m, 1e-3 rad]")
@click.option("--classes", type=click.Choice(["fine", "coarse"]), default="fine",
              help="coarse folds all vehicles into Car and all people into Pedestrian.")
@click.option("--ego", type=click.Choice(["label", "any"]), default="label",
              help="Whether the scenario's ego is the recording vehicle, or any object of its class.")
@click.option("--radius", metavar="M", type=click.FloatRange(0, min_open=True),
              help="Ignore objects and map farther than this from the ego, in metres.")
@click.option("--enforce", metavar="LIST", help="Built-in requirements to enforce besides visibility: containment, "
              "collision; `none` switches visibility off.")
@click.option("--exact", is_flag=True, help="Every object of the frame must have a role.")
@click.option("--solver", metavar="NAME", default="auto",
              help="auto, dreal, portable, or a command that reads SMT-LIB 2, such as 'z3 -in'.")
@click.option("--method", type=click.Choice(["auto", "smt", "monolithic"]), default="auto",
              help="smt sends everything to the solver; monolithic as one formula. The verdicts are the same.")
@click.option("--prefilter/--no-prefilter", default=True,
              help="Whether SQL narrows the frames first. The matches are the same.")
@click.option("--jobs", metavar="N", type=click.IntRange(1), default=1, help="Processes that match.")
@click.option("--timeout", metavar="S", type=click.FloatRange(0, min_open=True), default=DEFAULTS.timeout_s,
              help="Seconds for one question to the solver; then the frame is unknown.")
@click.option("--budget", metavar="N", type=click.IntRange(1), default=DEFAULTS.budget,
              help="Steps of the search for a correspondence in one frame; then the frame is unknown.")
@click.option("--limit", metavar="N", type=click.IntRange(1), help="Stop after so many matches.")
@click.option("--all", "every", is_flag=True, help="Show frames that do not match, too, each with its cause.")
@click.option("--all-matches", is_flag=True, help="One line for each correspondence by which a frame matches, "
              "interchangeable objects in one order only.")
@click.option("--near", metavar="K", type=click.IntRange(1), help="Show the K frames, too, that do not match but come "
              "closest, each with the tolerance under which it would.")
@click.option("--format", "format_", metavar="NAME", type=click.Choice(FORMATS),
              help="table, jsonl, csv, parquet or ids.  [default: by the extension of FILE, else table on a terminal "
              "and jsonl in a pipe]")
@click.option("-o", "--output", metavar="FILE", type=click.Path(path_type=Path),
              help="Write to a file, which appears when it is complete; `-` is standard output.")
@click.option("--shard", metavar="I/N", callback=parse_shard, help="Match only piece I of N; -o names the folder for "
              "the pieces, which `scenicq gather` puts together.")
@click.option("--resume", is_flag=True, help="Go on where an interrupted run with the same -o FILE stopped.")
@click.option("--export", metavar="FORM DIR", type=(click.Choice(list(EXPORTS)), click.Path(path_type=Path)),
              help="Hand the matching frames on, too, in a new folder DIR: nuscenes-tokens, argoverse2, paths (of "
              "sensor files), interchange (to ingest elsewhere) or openlabel.")
@click.option("--explain", is_flag=True,
              help="Print what SQL decides and what stays for the matcher, and match nothing.")
@click.option("--report", metavar="DIR", type=click.Path(path_type=Path),
              help="Write a page with pictures of the matches, too: DIR/index.html.")
@click.option("--scenic", type=click.Choice(["1", "2", "3"]), help="Version of Scenic.  [default: inferred]")
@click.option("--initial", is_flag=True, help="Ignore behaviors and other dynamic parts: match the initial scene.")
@click.option("--ignore-params", metavar="LIST", help="Global parameters that are not compared.")
@click.option("--exit-zero", is_flag=True, help="Exit with 0 also where nothing matches.")
@click.option("--summary", is_flag=True, help="Print the summary also where stderr is not a terminal.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no summary.")
@click.pass_context
def match(ctx: click.Context, scenario: Path, dataset: Path, *, format_: str | None, output: Path | None,
          export: tuple[str, Path] | None, near: int | None, report: Path | None, shard: Shard | None, resume: bool,
          explain: bool, exit_zero: bool, summary: bool, quiet: bool, **given: Any) -> None:
    # fmt: on
    """Find the frames of a dataset that match a scenario.

    Results go to standard output. Exit code 0: something matched; 1: nothing; 2: an error.
    """
    started = time.perf_counter()
    file = None if output is None or str(output) == "-" else output
    chosen = choose_format(format_, None if shard else file)
    query = Query(open_dataset(dataset), read_program(scenario), query_options(given))
    if explain:
        show_plan(query)
        return
    if shard or resume:
        _in_pieces(ctx, query, shard, file, chosen, quiet=quiet)
        _conclude(ctx, query, time.perf_counter() - started, summary=summary, quiet=quiet, exit_zero=exit_zero)
        return
    exporter = None if export is None else Exporter(export[0], query.dataset, export[1], scenario.stem)
    if report is not None:
        check_target(report)
    shown: list[Result] | None = None if report is None else []
    close: list[Result] | None = None if report is None else []
    bar = ProgressBar(query.dataset.manifest.total.frames, quiet=quiet)
    results = query.results(bar.advance)
    with destination(file) as sink, bar, contextlib.closing(results):
        with writing(file):
            writer = make_writer(chosen, sink)
        for result in itertools.chain(_kept(results, shown), _kept(_near(query, near), close)):
            with bar.aside(), writing(file):
                writer.write(record(result))
            if exporter is not None:
                exporter.add(result)
        with bar.aside(), writing(file):
            writer.finish()
        if exporter is not None:
            with bar.aside():
                show_few(exporter.finish().left_out)
    elapsed_s = time.perf_counter() - started
    if report is not None:
        command = shlex.join(["scenicq", *sys.argv[1:]])
        write_report(query, shown or (), report, near=close or (), command=command, elapsed_s=elapsed_s)
    _conclude(ctx, query, elapsed_s, summary=summary, quiet=quiet, exit_zero=exit_zero)


def _in_pieces(
    ctx: click.Context, query: Query, shard: Shard | None, file: Path | None, chosen: str, *, quiet: bool
) -> None:
    """Run one shard, or all pieces with a place to go on from."""
    single = [name for name in ("near", "report", "export", "limit") if ctx.params.get(name) is not None]
    if single or file is None:
        what = "need -o" if file is None else f"cannot be had with --{single[0]}"
        raise click.UsageError(f"--shard and --resume {what}", ctx)
    if shard is None:
        run = run_resumable(query, file, chosen, quiet=quiet)
    else:
        run = run_shard(query, shard, file, quiet=quiet)
    query.funnel = replace(run, warnings=query.funnel.warnings)


def _conclude(
    ctx: click.Context, query: Query, elapsed_s: float, *, summary: bool, quiet: bool, exit_zero: bool
) -> None:
    """Print the summary and choose the exit code."""
    if summary or (sys.stderr.isatty() and not quiet):
        show_funnel(query, elapsed_s)
    if query.funnel.matches == 0 and not exit_zero:
        ctx.exit(NOTHING)
