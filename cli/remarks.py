"""Warn before the results of what in the program is never compared, and of what is hardly meant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import click

from scenicq.errors import Diagnostic, ScenarioError
from scenicq.lint.program import lint_query
from scenicq.query.execution.run import Query

from .report import count, printable, show

__all__ = ["remarks", "show_remarks"]

_LINES = 5


def remarks(query: Query, maps: Sequence[str] | None = None) -> tuple[list[Diagnostic], list[Diagnostic]]:
    """Collect warnings: what is never compared or lacking on maps, and what compiles but is hardly meant.

    Args:
        query: The query.
        maps: The program is compiled over these; over all by default.

    Raises:
        ScenarioError: The program is wrong, or the options are strict and there is anything to be said.
    """
    unseen = [*(query.misfits() if maps is None else ()), *query.notes(maps), *query.coverage(maps).warnings]
    found = lint_query(query, maps)
    if query.options.strict and found:
        raise ScenarioError([replace(each, severity="error") for each in found])
    return unseen, found


def show_remarks(query: Query, unseen: Iterable[Diagnostic], found: Sequence[Diagnostic]) -> None:
    """Print these warnings on standard error: the first kind whole, a line for each of the second.

    All is said at once of a program that is no file.

    Args:
        query: The query.
        unseen: The first list that `remarks` gives.
        found: The second.
    """
    show(unseen)
    if query.source.name.startswith("<"):  # it is no file that `check` could be given
        show(found)
        return
    for each in found[:_LINES]:
        place = f"{each.span.place}: " if each.span is not None else ""
        kind = click.style(f"{each.severity}[{each.code}]", fg="yellow", bold=True)
        click.echo(f"{kind}: {place}{printable(each.message)}", err=True)
    if found:
        more = f"{count(len(found) - _LINES, 'more warning')}: " if len(found) > _LINES else ""
        click.echo(f"  = hint: {more}`scenicq check {printable(query.source.name)}` says what to write", err=True)
