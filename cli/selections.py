"""`--where` and `--sort`: what is said of matches of which a condition is not known."""

from __future__ import annotations

from scenicq.errors import Diagnostic
from scenicq.query.execution.result_selection import ResultSelection

from .report import count, show

__all__ = ["tell_unclear"]


def tell_unclear(selection: ResultSelection) -> None:
    """Say how many matches are left out because a condition on them is not known."""
    left_out = count(selection.unclear, "match")
    message = f"{left_out} left out: whether --where holds is not known, because a recorded value is null"
    hints = ("`unrecorded` in the results says why",)
    show([Diagnostic("results-incomplete", message, hints=hints, severity="warning")])
