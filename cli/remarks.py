"""What a user should know of a program before its results: what is never compared, and what cannot be meant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import click

from scenicq.errors import Diagnostic, ScenarioError
from scenicq.lint.program import lint_query
from scenicq.query.execution.run import Query

from .report import count, plain, show

__all__ = ["remarks", "show_remarks"]

_LINES = 5


def remarks(query: Query, maps: Sequence[str] | None = None) -> tuple[list[Diagnostic], list[Diagnostic]]:
    """What is never compared, or what maps lack; and what compiles but cannot be meant.

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
    """Print on standard error what is never compared or lacking, and a line for each thing that cannot be meant.

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
        click.echo(f"{kind}: {place}{plain(each.message)}", err=True)
    if found:
        more = f"{count(len(found) - _LINES, 'more warning')}: " if len(found) > _LINES else ""
        click.echo(f"  = hint: {more}`scenicq check {plain(query.source.name)}` says what to write", err=True)
