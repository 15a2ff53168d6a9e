"""Progress of blocks that other processes decide: frames count when they are decided, not when their block arrives."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["FramesAhead", "telling"]

_EVERY_S = 0.3
"""Seconds between what a process tells."""

Told = tuple[int, int, int]
"""First and last frame of a block, and how many of its frames are decided."""

_Verdicts = TypeVar("_Verdicts")


class FramesAhead:
    """Counts each frame once for the progress: when a worker announces it, otherwise when its result arrives."""

    def __init__(self, progress: Callable[[int], None] | None) -> None:
        """Take the function that shows progress, if any; it gets the number of frames decided since its last call."""
        self._progress = progress
        self._told: dict[tuple[int, int], int] = {}
        self._ahead = 0

    def told(self, told: Told) -> None:
        """Count what another process has decided; a block that is begun again counts once."""
        first, end, frames = told
        more = frames - self._told.get((first, end), 0)
        if more > 0:
            self._told[first, end] = frames
            self._ahead += more
            self._show(more)

    def taken(self, frames: int) -> None:
        """Count frames whose results are taken."""
        if self._ahead:
            covered = min(frames, self._ahead)
            self._ahead -= covered
            frames -= covered
        if frames and self._progress is not None:
            self._progress(frames)

    def _show(self, frames: int) -> None:
        if self._progress is not None:
            self._progress(frames)


def telling(
    found: Iterable[_Verdicts], missed: NDArray[np.int16], block: tuple[int, int], tell: Callable[[Told], None],
    every_s: float = _EVERY_S,
) -> Iterator[_Verdicts]:  # fmt: skip
    """The verdicts of a block's candidates as they come, telling now and then how far they are.

    Args:
        found: What was found of each frame that the prefilter leaves.
        missed: The step of the prefilter that excludes each frame of the block, negative where none does.
        block: First and last frame.
        tell: Takes it to whoever shows progress.
        every_s: Seconds between what it takes.
    """
    last = time.monotonic()
    for place, verdicts in zip(np.flatnonzero(missed < 0).tolist(), found, strict=False):
        yield verdicts
        if time.monotonic() - last > every_s:
            last = time.monotonic()
            tell((*block, place + 1))
