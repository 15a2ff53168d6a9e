"""Deliver what a query finds: as results, as an export and as a report."""

from __future__ import annotations

import contextlib
import itertools
import shlex
import sys
import time
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import click

from scenicq.match.verdict import NoMatch
from scenicq.query.execution.records import record
from scenicq.query.execution.result_origin import name_origin
from scenicq.query.execution.result_summary import ResultCount, ResultSummary
from scenicq.query.execution.results import Funnel, Result
from scenicq.query.execution.run import Query
from scenicq.query.execution.skipped_frames import summarize
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

from .formats import make_writer
from .main import NOTHING, UNDECIDED
from .output import ProgressBar, destination, writing
from .report import count, show_few
from .sources import sensor_root

__all__ = ["Destination", "deliver", "exit_code"]


@dataclass(frozen=True, slots=True)
class Destination:
    """Where results go.

    Attributes:
        file: A file; standard output if None.
        form: Name of the format.
        export: Form and folder of an export.
        report: Folder of a report.
        work: Folder for what is not complete yet; beside the file by default.
        sensors: Folder that the paths of sensor files start from, for the report.
        ranked: Whether results have a density.
    """

    file: AnyPath | None
    form: str
    export: tuple[str, AnyPath] | None = None
    report: AnyPath | None = None
    work: AnyPath | None = None
    sensors: Path | None = None
    ranked: bool = False


def deliver(
    query: Query, results: Generator[Result], near: Iterable[Result], wanted: Destination, bar: ProgressBar
) -> ResultSummary:
    """Write the results of a query, then the near misses, wherever they are wanted.

    Returns:
        What the results say of themselves.

    Raises:
        DataError: target-exists, target-busy or target-unwritable.
    """
    if wanted.report is None:
        return _deliver(query, results, near, wanted, bar)
    from scenicq.report.write import check_target  # noqa: PLC0415 - takes long to load

    check_target(wanted.report)
    with target_of(wanted.report).sole_writer():
        return _deliver(query, results, near, wanted, bar)


def _deliver(
    query: Query, results: Generator[Result], near: Iterable[Result], wanted: Destination, bar: ProgressBar
) -> ResultSummary:
    started = time.perf_counter()
    unlisted, counted = 0, ResultCount()
    file, report = wanted.file, wanted.report
    origin = name_origin(query.dataset)
    exporter = None
    if wanted.export is not None:
        from scenicq.exporters.export import Exporter  # noqa: PLC0415 - takes long to load

        exporter = Exporter(wanted.export[0], query.dataset, wanted.export[1], Path(query.source.name).stem)
    shown: list[Result] | None = None if report is None else []
    close: list[Result] | None = None if report is None else []
    with destination(file, wanted.work) as sink, bar, contextlib.closing(results):
        with writing(file):
            writer = make_writer(
                wanted.form,
                sink,
                query.roles,
                query.dataset.short_names,
                query.recorded_columns,
                origin=origin,
                ranked=wanted.ranked,
                over_time=query.is_over_time(),
                every=query.options.all_matches,
                timelines=lambda: query.options.timelines and query.has_timelines(),
            )
        try:
            for result in itertools.chain(_kept(results, shown), _kept(near, close)):
                told = record(result, origin, every=query.options.all_matches)
                with bar.aside(), writing(file):
                    writer.write(told)
                counted.add(told)
                unlisted += wanted.form == "ids" and isinstance(result.verdict, NoMatch)
                if exporter is not None:
                    exporter.add(result)
        except BaseException:
            with contextlib.suppress(OSError):
                writer.stop()
            raise
        summary = summarize(query, counted)
        with bar.aside(), writing(file):
            writer.finish(summary)
        if unlisted:
            what = "interval" if query.is_over_time() else "frame"
            told = f"`ids` lists {what}s that match: {count(unlisted, f'other {what}')} left out"
            with bar.aside():
                click.echo(told, err=True)
        if exporter is not None:
            with bar.aside():
                show_few(exporter.finish(summary).left_out)
    if report is not None:
        from scenicq.report.write import write_report  # noqa: PLC0415 - takes long to load

        command = shlex.join(["scenicq", *sys.argv[1:]])
        elapsed_s = time.perf_counter() - started
        write_report(
            query,
            shown or (),
            report,
            near=close or (),
            command=command,
            elapsed_s=elapsed_s,
            sensors=sensor_root(query.dataset, wanted.sensors),
        )
    return summary


def _kept(results: Iterable[Result], into: list[Result] | None) -> Iterator[Result]:
    """Pass results on, and keep them if there is to be a report."""
    for result in results:
        if into is not None:
            into.append(result)
        yield result


def exit_code(funnel: Funnel, summary: ResultSummary | None) -> int:
    """Choose the exit code of a query: 0 for matches, 1 for none, 3 where something is undecided.

    Args:
        funnel: Its counts.
        summary: What its results say of themselves; None of shards that an older version wrote.
    """
    if funnel.unknowns or (summary is not None and summary.skipped):
        return UNDECIDED
    chosen = funnel.chosen
    if chosen is not None and chosen.unclear:
        return UNDECIDED
    return 0 if (funnel.matches if chosen is None else chosen.shown) else NOTHING
