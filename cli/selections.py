"""`--where` and `--sort`: the options, and what is said of matches of which a condition is not known."""

from __future__ import annotations

import click

from scenicq.errors import Diagnostic
from scenicq.query.execution.result_selection import ResultSelection

from .report import count, show

__all__ = ["SORT", "WHERE", "tell_unclear"]

WHERE = click.option(
    "--where",
    metavar="CONDITION",
    help="Show only matches that meet a condition on what the program records (`record (distance to lead) as gap`): "
    "'gap < 5', over time 'gap.minimum < 5'; also `and`, `or`, `not`. Where a value is null it is not known: such "
    "matches are left out, and counted.",
)
"""Which matches are shown."""
SORT = click.option(
    "--sort",
    metavar="NAME[:desc]",
    help="Order matches by a value that the program records, the least first, those without one last; with --limit no "
    "more than so many are kept in memory.",
)
"""In what order."""


def tell_unclear(selection: ResultSelection) -> None:
    """Say that a condition is not known of some matches."""
    what = f"of {count(selection.unclear, 'match')} it is not known whether --where holds"
    message = f"{what}, as what is recorded is null: left out"
    hints = ("`unrecorded` of results says why",)
    show([Diagnostic("results-incomplete", message, hints=hints, severity="warning")])
