"""`--where` and `--sort`: what is said of matches of which a condition is not known."""

from __future__ import annotations

from scenicq.errors import Diagnostic
from scenicq.query.execution.result_selection import ResultSelection

from .report import count, show

__all__ = ["tell_unclear"]


def tell_unclear(selection: ResultSelection) -> None:
    """Say that a condition is not known of some matches."""
    what = f"of {count(selection.unclear, 'match')} it is not known whether --where holds"
    message = f"{what}, as what is recorded is null: left out"
    hints = ("`unrecorded` of results says why",)
    show([Diagnostic("results-incomplete", message, hints=hints, severity="warning")])
