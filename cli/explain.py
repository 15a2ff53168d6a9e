"""`scenicq explain`: why one frame matches a scenario, or what keeps it from matching."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from scenicq.errors import DataError, Diagnostic
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.run import Query
from scenicq.query.explain.frame_explanation import explain as explain_label
from scenicq.query.explain.frame_explanation import show_explanation
from scenicq.query.explain.interval_explanation import explain_recording
from scenicq.store.frame_names import find_recording

from .datasets import open_checked
from .main import NOTHING, UNDECIDED
from .manual import Manual
from .match import match
from .options import ONE_FRAME, SHARED, query_options
from .programs import PROGRAM_TEXT, SCENARIO, given_program
from .remarks import remarks, show_remarks
from .report import plain
from .streams import say

__all__ = ["explain"]


def _recording(query: Query, named: str) -> tuple[str, int | float | None] | None:
    """The recording and the timestamp in microseconds, or seconds in it, that are named, if it is not a frame."""
    recordings = query.dataset.manifest.by_recording
    begun, at, time = named.rpartition("@")
    if at and named not in recordings and (name := find_recording(recordings, begun)) is not None:
        if time.isdecimal():
            return name, int(time)
        if re.fullmatch(r"\d+(\.\d+)? ?s", time, re.ASCII):
            return name, float(time.removesuffix("s"))
    name = find_recording(recordings, named)
    return None if name is None else (name, None)


@click.command(
    cls=Manual,
    arguments={
        "SCENARIO": SCENARIO,
        "DATASET": "A folder that `scenicq ingest` made.",
        "FRAME": "The name of a frame, as `scenicq match` prints it, or as much of it as no other frame has; of a "
        "program about what happens over time the frame in which the interval begins, or the name of a recording, and "
        "after `@` when the interval begins: a timestamp, or the seconds from where the recording begins (`@3.5s`).",
    },
    exits={
        0: "the frame or recording matches",
        1: "it does not match (with --exit-zero: 0)",
        3: "that is unknown (with --exit-zero: 0)",
    },
    topics={"What counts as a match": SHARED},
    epilog="\b\nExamples:\n"
    "  scenicq explain crossing.scenic dataset 1a2b3c\n"
    "  scenicq explain crossing.scenic dataset 1a2b3c --tolerance position=0.5,heading=5deg --smt2 formulas\n"
    "  scenicq explain cut_in.scenic dataset scene-0061@1532402928147847\n"
    "  scenicq explain cut_in.scenic dataset scene-0061@3.5s",
)
@click.argument("scenario", metavar="SCENARIO", type=click.Path(), required=False)
@click.argument("dataset", metavar="DATASET", type=click.Path(), required=False)
@click.argument("frame", metavar="FRAME", required=False)
@PROGRAM_TEXT
@click.option("--smt2", metavar="DIR", type=click.Path(path_type=Path, file_okay=False),
              help="Write the formula of each group as SMT-LIB 2 into a folder.")  # fmt: skip
@click.option("--exit-zero", is_flag=True, help="Exit with 0 also where the frame does not match.")
@click.pass_context
def explain(
    ctx: click.Context, scenario: str | None, dataset: str | None, frame: str | None, *, program: str | None,
    smt2: Path | None, exit_zero: bool, **given: Any
) -> None:  # fmt: skip
    """Say why a frame or recording matches, or what keeps it from it and what would do.

    The explanation names the feature or requirement, its place in the program, and the label's value.
    """
    source, (target, named), model = given_program(ctx, program, (scenario, dataset, frame), 2)
    query = Query(open_checked(str(target)), source, query_options({**given, **ONE_FRAME, "model": model}))
    if query.is_over_time() and (recording := _recording(query, str(named))) is not None:
        with LazySolver(query.options.solver) as solver:
            told = explain_recording(query, solver, *recording)
        say(plain(told.text()))
        if not told.matches and not exit_zero:
            ctx.exit(UNDECIDED if told.is_unknown else NOTHING)
        return
    label = query.dataset.label(str(named))
    show_remarks(query, *remarks(query, [label.map]))
    with LazySolver(query.options.solver) as solver:
        matcher = Matcher(query.compile(label.map)[0], query.options.match, solver)
        explanation = explain_label(matcher, label, formulas=smt2 is not None)
        matches, told = isinstance(explanation.verdict, Match), show_explanation(explanation)
        unknown = isinstance(explanation.verdict, Unknown)
        if query.is_over_time():
            begun = explain_recording(query, solver, label.recording, label.timestamp_us)
            # without a start, the frame itself is what keeps it from matching
            if begun.interval is None:
                matches = False
            else:
                matches, unknown, told = begun.matches, begun.is_unknown, begun.text()
    say(plain(told))
    if smt2 is not None:
        try:
            smt2.mkdir(parents=True, exist_ok=True)
            for formula in explanation.formulas:
                (smt2 / f"{formula.name}.smt2").write_text(formula.text, encoding="utf-8")
        except OSError as error:
            raise DataError(Diagnostic("target-unwritable", f"{smt2} cannot be written: {error.strerror}")) from None
    if not matches and not exit_zero:
        ctx.exit(UNDECIDED if unknown else NOTHING)


explain.params += [option for option in match.params if option.name in SHARED]
