"""`scenicq match --explain`: which frames SQL leaves out, and how many are left for the matcher."""

from __future__ import annotations

from scenicq.query.execution.run import Query
from scenicq.query.explain.prefilter_counts import prefilter_counts

from .report import columns
from .streams import say

__all__ = ["show_plan"]


def show_plan(query: Query) -> None:
    """Print the prefilter of each map: its conditions in order, with the frames left after each, and its SQL.

    An estimate comes from a sample; then every step is counted.
    """
    for found in prefilter_counts(query):
        plan, left = found.plan, found.left
        rows = [
            (f"{estimated:,}", f"{frames:,}", step.what, step.span.place if step.span else "")
            for estimated, frames, step in zip(found.estimated[1:], left[1:], plan.steps, strict=True)
        ]
        say(f"map {plan.map}: {left[0]:,} frames, {left[-1]:,} left for the matcher")
        lines = columns([("estimated", "left", "after", "place"), *rows], right=frozenset({0, 1}))
        say("\n".join([*lines, ""]))
        for statement in plan.statements:
            say(f"  {statement};")
        say()
