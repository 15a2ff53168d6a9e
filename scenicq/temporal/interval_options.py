"""How intervals are looked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["DEFAULT_GAP_S", "IntervalOptions", "Intervals"]

Intervals = Literal["longest", "all"]
"""Which overlapping intervals are told: the longest, the earliest of equals; or all."""

DEFAULT_GAP_S = 1.5
"""Seconds without a label after which a track's life ends."""


@dataclass(frozen=True, slots=True)
class IntervalOptions:
    """How intervals are looked for.

    Attributes:
        intervals: Whether to report the longest of overlapping intervals, or all.
        min_duration_s: How long an interval must be at least; None for a static program that is matched frame by frame.
        gap_s: Seconds without a label after which a track's life ends.
    """

    intervals: Intervals = "longest"
    min_duration_s: float | None = None
    gap_s: float = DEFAULT_GAP_S
