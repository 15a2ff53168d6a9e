"""Which of the intervals of one binding are reported."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar

from numpy import float64
from numpy.typing import NDArray

from scenicq.temporal.interval_options import Intervals

__all__ = ["chosen"]


class Stretch(Protocol):
    """What is chosen among: an interval of samples, both ends included, and how sure it is that it matches."""

    @property
    def start(self) -> int: ...

    @property
    def end(self) -> int: ...

    @property
    def truth(self) -> int: ...


AnyStretch = TypeVar("AnyStretch", bound=Stretch)


def chosen(
    found: Iterable[AnyStretch], seconds: NDArray[float64], intervals: Intervals, min_duration_s: float
) -> Sequence[AnyStretch]:
    """The intervals to report, in order of time.

    One that is not sure counts only where no match overlaps it.

    Args:
        found: Intervals that match, or may.
        seconds: Time of each sample of the recording.
        intervals: Which.
        min_duration_s: How long they must be at least.
    """
    long = [each for each in found if seconds[each.end] - seconds[each.start] >= min_duration_s - 1e-6]
    if intervals == "all":
        return sorted(long, key=lambda each: (each.start, each.end))
    ranked = sorted(long, key=lambda each: (-each.truth, seconds[each.start] - seconds[each.end], each.start))
    kept: list[AnyStretch] = []
    for each in ranked:
        if all(each.end < other.start or other.end < each.start for other in kept):
            kept.append(each)
    return sorted(kept, key=lambda each: each.start)
