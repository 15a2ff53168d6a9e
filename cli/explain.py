"""`scenicq explain`: why one frame matches a scenario, or what keeps it from matching."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import click

from scenicq.errors import DataError, Diagnostic
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.option_texts import QUERY_OPTIONS
from scenicq.query.execution.run import Query
from scenicq.query.explain.frame_explanation import explain as explain_label
from scenicq.query.explain.frame_explanation import show_explanation
from scenicq.query.explain.interval_explanation import explain_beginning, explain_recording
from scenicq.query.explain.moments import named_frame, named_moment
from scenicq.store.atomic_files import whole_folder, write_whole
from scenicq.store.remote_path import AnyPath, RemotePath
from scenicq.store.targets import target_of

from .datasets import open_checked
from .main import NOTHING, UNDECIDED
from .manual import Manual
from .options import ONE_FRAME, OVER_TIME, SHARED, add_options, query_options
from .path_type import ANY_PATH
from .programs import PROGRAM_TEXT, SCENARIO, given_program
from .remarks import remarks, show_remarks
from .report import printable
from .streams import say

__all__ = ["explain"]


@click.command(
    cls=Manual,
    arguments={
        "SCENARIO": SCENARIO,
        "DATASET": "A folder that `scenicq ingest` made.",
        "FRAME": "The name of a frame as `scenicq match` prints it, or a part of it that no other frame has. For a "
        "program about time: the first frame of the interval, or RECORDING, or RECORDING@TIME for the interval that "
        "begins then (a timestamp, or seconds from the start of the recording, as in `@3.5s`). Intervals that begin "
        "earlier and contain the frame are named, too.",
    },
    exits={
        0: "the frame or recording matches",
        1: "it does not match (with --exit-zero: 0)",
        3: "that is unknown (with --exit-zero: 0)",
    },
    topics={"What counts as a match": SHARED, "Over time": OVER_TIME},
    epilog="\b\nExamples:\n"
    "  scenicq explain crossing.scenic dataset 1a2b3c\n"
    "  scenicq explain crossing.scenic dataset 1a2b3c --tolerance position=0.5,heading=5deg --smt2 formulas\n"
    "  scenicq explain cut_in.scenic dataset scene-0061@1532402928147847\n"
    "  scenicq explain cut_in.scenic dataset scene-0061@3.5s\n"
    "  scenicq explain following.scenic dataset scene-0061 --min-duration 5",
)
@click.argument("scenario", metavar="SCENARIO", type=click.Path(), required=False)
@click.argument("dataset", metavar="DATASET", type=click.Path(), required=False)
@click.argument("frame", metavar="FRAME", required=False)
@PROGRAM_TEXT
@click.option("--smt2", metavar="DIR", type=ANY_PATH,
              help="Write the formula of each group as SMT-LIB 2 into a folder, here or elsewhere.")  # fmt: skip
@click.option("--exit-zero", is_flag=True, help="Exit with 0 also where the frame does not match.")
@add_options(QUERY_OPTIONS, *SHARED, *OVER_TIME)
@click.pass_context
def explain(
    ctx: click.Context, scenario: str | None, dataset: str | None, frame: str | None, *, program: str | None,
    smt2: AnyPath | None, exit_zero: bool, **given: Any
) -> None:  # fmt: skip
    """Say why a frame or recording matches, or what prevents it and which change would make it match.

    The explanation names the feature or requirement, its place in the program, and the label's value.
    """
    source, (target, named), model = given_program(ctx, program, (scenario, dataset, frame), 2)
    query = Query(open_checked(str(target)), source, query_options({**ONE_FRAME, **given, "model": model}))
    over_time = query.is_over_time()
    if over_time and (moment := named_moment(query.dataset, str(named))) is not None:
        with LazySolver(query.options.solver) as solver:
            about = explain_recording(query, solver, *moment)
        say(printable(about.text()))
        if not about.matches and not exit_zero:
            ctx.exit(UNDECIDED if about.is_unknown else NOTHING)
        return
    label = named_frame(query.dataset, str(named))
    show_remarks(query, *remarks(query, [label.map]))
    with LazySolver(query.options.solver) as solver:
        matcher = Matcher(query.compile(label.map)[0], query.options.match, solver)
        explanation = explain_label(matcher, label, formulas=smt2 is not None)
        verdict, told = explanation.verdict, show_explanation(explanation)
        if over_time:
            verdict, told = explain_beginning(query, solver, label)
    say(printable(told))
    if smt2 is not None:
        try:
            with _folder_to_fill(smt2) as folder:
                for formula in explanation.formulas:
                    write_whole(folder / f"{formula.name}.smt2", formula.text)
        except OSError as error:
            raise DataError(Diagnostic("target-unwritable", f"{smt2} cannot be written: {error.strerror}")) from None
    if not isinstance(verdict, Match) and not exit_zero:
        ctx.exit(UNDECIDED if isinstance(verdict, Unknown) else NOTHING)


@contextmanager
def _folder_to_fill(path: AnyPath) -> Generator[AnyPath]:
    """A folder to write files in: one that is there, or a new one, which is there when all are in it."""
    if isinstance(path, RemotePath) or path.exists():
        with target_of(path).made_folder():
            yield path
    else:
        with whole_folder(path) as work:
            yield work
