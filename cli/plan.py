"""`scenicq match --explain`: what the database decides of a query, and what stays for the matcher."""

from __future__ import annotations

import contextlib

import click

from scenicq.query.run import Query

from .report import columns

__all__ = ["show_plan"]


def show_plan(query: Query) -> None:
    """Print the prefilter of each map: its conditions in order, with the frames left after each, and its SQL."""
    for plan in query.plans():
        with contextlib.closing(query.dataset.connect()) as connection:
            left = plan.left(connection)
        rows = [
            (f"{frames:,}", step.what, step.span.place if step.span else "")
            for frames, step in zip(left[1:], plan.steps, strict=True)
        ]
        click.echo(f"map {plan.map}: {left[0]:,} frames, {left[-1]:,} left for the matcher")
        lines = columns([("left", "after", "place"), *rows], right=frozenset({0}))
        click.echo("\n".join([*lines, "", f"  {plan.sql}", ""]))
