"""`scenicq match`: the frames of a dataset that match a scenario."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections import Counter
from collections.abc import Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from scenicq.errors import Diagnostic
from scenicq.exporters.forms import FORMS
from scenicq.match.verdict import Match, Unknown
from scenicq.option_values import Amount, Count
from scenicq.query.execution.executors import Executor, local_executor, ordered_results, resumable, usual_pieces
from scenicq.query.execution.option_texts import QUERY_OPTIONS
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.results import Result, Sample
from scenicq.query.execution.run import Query
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

from .advise import advise, is_nearly_empty
from .combinations import check_combination, check_over_time
from .datasets import open_checked
from .deliver import Destination, deliver, exit_code
from .engine import parse_engine
from .formats import FORMATS, SPREADSHEET_HELP
from .funnel import MatchSample, show_funnel
from .main import INTERRUPTS, UNDECIDED
from .manual import OPEN, Manual
from .option_type import OptionType
from .options import OVER_TIME, SHARED, add_options, by_topic, query_options
from .output import ProgressBar, choose_format
from .path_type import ANY_PATH, chosen_file
from .pieces import LateShardError, Shard, parse_shard, run_shard
from .plan import show_plan
from .programs import PROGRAM_TEXT, SCENARIO, given_program
from .remarks import remarks, show_remarks
from .report import show
from .selections import tell_unclear
from .sources import SENSORS

__all__ = ["match"]


def _near(query: Query, count: int | None) -> Iterator[Result]:
    """Look for the frames or recordings that come closest, after the matches."""
    if count is None or query.funnel.cut:
        return
    if query.is_over_time():
        from scenicq.query.explain.nearest_interval import nearest_intervals  # noqa: PLC0415 - takes long to load

        yield from nearest_intervals(query, count)
    else:
        from scenicq.query.explain.nearest_miss import nearest_misses  # noqa: PLC0415

        yield from nearest_misses(query, count)


# fmt: off
@click.command(
    cls=Manual,
    arguments={
        "SCENARIO": SCENARIO,
        "DATASET": "A folder that `scenicq ingest` made.",
    },
    exits={0: "something matched", 1: "nothing matched (with --exit-zero: 0)", 3: f"{OPEN} (with --exit-zero: 0)"},
    topics=by_topic(QUERY_OPTIONS, {
        "What counts as a match": (),
        "Over time": (),
        "How it is decided": {"engine"},
        "What comes out": {
            "near", "rank", "sample", "diverse", "advised", "format_", "output", "report", "sensors", "export",
            "explain",
        },
        "Long runs": {"shard", "resume"},
        "Messages and exit code": {"exit_zero", "summary", "quiet", "help"},
    }),
    epilog="\b\nExamples:\n"
    "  scenicq match crossing.scenic dataset --tolerance position=0.5,ego.heading=15deg\n"
    "  scenicq match crossing.scenic dataset --format ids | head\n"
    "  scenicq match crossing.scenic dataset -o matches.parquet --summary\n"
    "  scenicq match -e 'ego = new Car; new Pedestrian ahead of ego by Range(0, 20)' dataset --tolerance position=2\n"
    "  seq 16 | xargs -P 4 -I{} scenicq match crossing.scenic dataset --shard {}/16 -o pieces --exit-zero"
)
@click.argument("scenario", metavar="SCENARIO", type=click.Path(), required=False)
@click.argument("dataset", metavar="DATASET", type=click.Path(), required=False)
@PROGRAM_TEXT
@add_options(QUERY_OPTIONS, *SHARED, *OVER_TIME, "intervals", "prefilter", "jobs", "limit")
@click.option("--deadline", metavar="S", type=OptionType(Amount("s", above=True)),
              help="Stop after S seconds, or 5min, 2h. "
              "What is decided by then is written, and the rest is counted; `--resume` goes on.")
@add_options(QUERY_OPTIONS, "every", "all_matches")
@click.option("--near", metavar="K", type=OptionType(Count()), help="Also show the K frames that come "
              "closest to a match, each with the tolerance under which it would match. Over time: the K recordings "
              "that come closest, each with a tolerance, a number of the program or a duration that would do.")
@add_options(QUERY_OPTIONS, "where", "sort")
@click.option("--rank", is_flag=True, help="Order matches from typical to borderline: by the density with which the "
              "program generates what the label observes.")
@click.option("--sample", metavar="N", type=OptionType(Count()), help="Show N of the matches, drawn at random.")
@click.option("--diverse", is_flag=True, help="With --sample: matches that spread over recordings and over the "
              "program's random variables.")
@click.option("--advise", "advised", is_flag=True, help="Say which condition excludes most frames, and how "
              "many would match after each single change of the program. Where hardly any frame matches, this is said "
              "without the option, too.")
@click.option("--format", "format_", metavar="NAME", type=click.Choice(FORMATS),
              help="table, jsonl, csv, spreadsheet, parquet or ids.  [default: by the extension of FILE, else table on "
              f"a terminal and jsonl in a pipe]  {SPREADSHEET_HELP}")
@click.option("-o", "--output", metavar="FILE", type=ANY_PATH,
              help="Write to a file, also to s3://..., which appears when it is complete; `-` is standard output.")
@click.option("--shard", metavar="I/N", callback=parse_shard, help="Match only piece I of N; -o names the folder for "
              "the pieces, which `scenicq gather` puts together.")
@click.option("--engine", metavar="dask[=ADDRESS]", callback=parse_engine, help="Match in pieces on Dask: in processes "
              "on this machine (--jobs of them, or one a processor), or on the cluster whose scheduler is at ADDRESS.")
@click.option("--resume", is_flag=True, help="Go on where an interrupted run with the same -o FILE stopped.")
@click.option("--export", metavar="FORM DIR", type=(click.Choice(FORMS), ANY_PATH),
              help="Also export the matching frames to a new folder DIR, also s3://..., as nuscenes-tokens, "
              "argoverse2, paths (of sensor files), interchange (to ingest elsewhere) or openlabel.")
@click.option("--explain", is_flag=True,
              help="Print what SQL decides and what is left for the matcher; match nothing.")
@click.option("--report", metavar="DIR", type=ANY_PATH,
              help="Also write a page with pictures of the matches: DIR/index.html, also in s3://...")
@SENSORS
@click.option("--exit-zero", is_flag=True, help="Exit with 0 also if nothing matches, or if something is undecided.")
@click.option("--summary", is_flag=True, help="Print the summary also if stderr is not a terminal.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no summary.")
@click.pass_context
def match(ctx: click.Context, scenario: str | None, dataset: str | None, *, program: str | None, format_: str | None,
          output: AnyPath | None, export: tuple[str, AnyPath] | None, near: int | None, deadline: float | None,
          report: AnyPath | None, shard: Shard | None, resume: bool, sensors: Path | None, engine: Executor | None,
          explain: bool, advised: bool, rank: bool, sample: int | None,
          diverse: bool, exit_zero: bool, summary: bool, quiet: bool, **given: Any) -> None:
    # fmt: on
    """Find the frames or intervals of a dataset that match a scenario.

    Results go to standard output, one a line; progress and summary to standard error. Each match comes with the label
    object of every role and with values of the random variables that prove it.
    """
    started = time.perf_counter()
    file = chosen_file(output)
    chosen = choose_format(format_, None if shard else file)
    if shard is not None:
        given["jobs"] = given["jobs"] or 1  # whoever runs shards runs several
    together = {**ctx.params, "output": file, "advise": advised}
    check_combination(ctx, together)
    source, (target,), model = given_program(ctx, program, (scenario, dataset), 1)
    options = query_options({**given, "model": model})
    reads = report or export or rank or sample or shard or engine or resume or options.all_matches or options.selects
    if chosen == "ids" and not reads:
        options = replace(options, proofs=False)
    # for names alone nobody reads what roles do, unless the results are put together elsewhere
    options = replace(options, timelines=bool(chosen != "ids" or report or shard or engine or resume))
    summarized = summary or (sys.stderr.isatty() and not quiet)
    if not (summarized or explain or report or near or shard or engine or resume):
        # of frames, advice reads it, too
        options = replace(options, interval_reasons=False, reasons=advised or not quiet)
    if deadline is not None:
        options = replace(options, until=time.monotonic() + deadline)
    query = Query(open_checked(str(target)), source, options)
    check_over_time(ctx, together, query.is_over_time)
    selection = query.selection()
    if explain:
        show_plan(query)
        return
    with ProgressBar(query.dataset.manifest.total.frames, quiet=quiet) as bar:
        told, found = remarks(query)
        with bar.aside():
            show_remarks(query, told, found)
    if shard is not None and file is not None:
        try:
            funnel, said = run_shard(query, shard, file, quiet=quiet)
        except LateShardError as error:
            show(error.diagnostics)
            ctx.exit(0 if exit_zero else UNDECIDED)
        query.funnel = replace(funnel, warnings=query.funnel.warnings)
        _conclude(ctx, query, told, said, time.perf_counter() - started, summarized=summarized, exit_zero=exit_zero)
        return
    pieces = None
    again = "the same command goes on from here" if resume else "`--resume` keeps what is done until it stops"
    INTERRUPTS.advice = f"  = hint: {again if file is not None else f'with `-o FILE`, {again}'}"
    if resume and file is not None:
        real = Path(os.path.realpath(file)) if isinstance(file, Path) else file
        pieces = real.with_name(f".{real.name}.pieces")
        engine = resumable(pieces, engine or local_executor(query))
    bar = ProgressBar(query.dataset.manifest.total.frames, quiet=quiet)
    if engine is None:
        results = query.results(bar.advance)
    else:
        results = ordered_results(query, engine, usual_pieces(query, 16), bar.advance)
    wanted = Destination(file, chosen, export, report, pieces, sensors, ranked=rank)

    def drawn(found: Generator[Result]) -> Generator[Result]:
        return _selected(query, found, sample, rank=rank, diverse=diverse) if rank or sample is not None else found

    results = drawn(results) if selection is None else selection.applied(results, query.funnel, drawn)
    matching = MatchSample()
    if summarized:
        results = matching.gathered(results)
    came_close: list[str] = []
    with contextlib.nullcontext() if pieces is None else target_of(pieces).sole_writer():
        try:
            said = deliver(query, results, _noted(_near(query, near), came_close), wanted, bar)
        except BaseException:
            if isinstance(pieces, Path):
                with contextlib.suppress(OSError):
                    pieces.rmdir()  # if nothing is done yet
            raise
        if pieces is not None and not query.funnel.cut:
            target_of(pieces).remove_folder()
    INTERRUPTS.advice = "  = hint: all results are written"
    if query.funnel.cut:
        _tell_cut(query, resume=resume)
    elif near is not None and not came_close:
        _tell_far(query)
    if selection is not None and selection.unclear:
        tell_unclear(selection)
    cut = [each for each in query.funnel.warnings if each.code in ("ranking-cut", "no-density")]
    show(cut)
    whole = not said.skipped and not query.funnel.over_time
    if advised or (not quiet and whole and is_nearly_empty(query)):
        advise(query, asked=advised, near=near is not None)
    told = [*told, *cut]
    elapsed_s = time.perf_counter() - started
    _conclude(ctx, query, told, said, elapsed_s, matching, summarized=summarized, exit_zero=exit_zero)


def _noted(found: Iterable[Result], recordings: list[str]) -> Iterator[Result]:
    """Pass results on, and note the recording of each in the list."""
    for result in found:
        recordings.append(result.recording)
        yield result


def _tell_far(query: Query) -> None:
    """Say that nothing came close."""
    what = "recording" if query.is_over_time() else "frame"
    message = f"--near shows nothing: no {what} that was looked at would match with a wider tolerance"
    hints = ("tolerances do not apply to requirements: `--advise` says which change of the program would help",)
    show([Diagnostic("option-invalid", message, hints=hints, severity="warning")])


def _tell_cut(query: Query, *, resume: bool) -> None:
    """Say that the deadline ended the query, even where no summary is printed."""
    done, total = query.funnel.frames, query.dataset.manifest.total.frames
    message = f"the deadline passed: {done:,} of {total:,} frames are decided, and the others are not in the results"
    again = "the same command goes on from here" if resume else "`--resume` with `-o FILE` keeps what is done"
    show([Diagnostic("deadline-passed", message, hints=(again,), severity="warning")])


def _selected(
    query: Query, results: Generator[Result], sample: int | None, *, rank: bool, diverse: bool
) -> Generator[Result]:
    """Sample or rank the matches, once all are there."""
    from scenicq.evaluate.ranking import rank_results, sample_diverse, sample_plain  # noqa: PLC0415 - takes long to load

    with contextlib.closing(results):
        found = list(results)
    if sample is not None:
        unknown = Counter(each.verdict.reason for each in found if isinstance(each.verdict, Unknown))
        matching = [each for each in found if isinstance(each.verdict, Match)]
        found = sample_diverse(matching, sample) if diverse else sample_plain(matching, sample)
        query.funnel.sample = Sample(len(found), len(matching), unknown)
    if rank:
        found = rank_results(query, found)
        query.funnel.warnings += _without_density(found)
    yield from found


def _without_density(found: Sequence[Result]) -> Iterator[Diagnostic]:
    """Say how many matches have no density, and why."""
    reasons = Counter(each.density.reason for each in found if each.density is not None and each.density.log is None)
    for reason, number in reasons.most_common():
        message = f"{number} of {len(found)} matches have no density and come last: {reason}"
        yield Diagnostic("no-density", message, severity="warning")


def _conclude(
    ctx: click.Context,
    query: Query,
    told: Collection[Diagnostic],
    said: ResultSummary | None,
    elapsed_s: float,
    matching: MatchSample | None = None,
    *,
    summarized: bool,
    exit_zero: bool,
) -> None:
    """Print the summary and choose the exit code."""
    if summarized:
        show_funnel(query, elapsed_s, told, matching or MatchSample())
    if not exit_zero:
        ctx.exit(exit_code(query.funnel, said))
