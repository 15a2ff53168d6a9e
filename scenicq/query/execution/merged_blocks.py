"""Blocks that were decided anywhere, put together in the order of the store: results and the counts of the funnel."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import DeadlineError
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown
from scenicq.query.execution.block_matcher import BlockOutcome
from scenicq.query.execution.results import Funnel, Result
from scenicq.query.prefilter.plan import Plan

__all__ = ["merge_frames", "merge_intervals", "until_deadline"]

_Item = TypeVar("_Item")


def until_deadline(found: Iterable[_Item], funnel: Funnel) -> Iterator[_Item]:
    """What comes before the time is over."""
    try:
        yield from found
    except DeadlineError:
        funnel.cut = True


def _excluded(plan: Plan, block: BlockOutcome, start: int, end: int) -> Iterator[Result]:
    """The frames between two candidates."""
    numbers: list[int] = block.missed[start:end].tolist()
    for (frame, recording, time), number in zip(block.names[start:end], numbers, strict=True):
        step = plan.steps[number]
        yield Result(frame, recording, time, NoMatch(Cause(step.what, step.detail, step.span)))


def _count_excluded(plan: Plan, missed: NDArray[np.int16], funnel: Funnel, *, reasons: bool) -> None:
    """Count frames that the plan excludes, by the step that does if somebody reads that."""
    if not reasons:
        funnel.frames += int((missed >= 0).sum())
        return
    for step, count in enumerate(np.bincount(missed[missed >= 0], minlength=len(plan.steps)).tolist()):
        if count:
            funnel.exclude(plan.steps[step].what, count)


def merge_frames(
    plan: Plan, decided: Iterable[BlockOutcome], funnel: Funnel, progress: Callable[[int], None], *, every: bool,
    reasons: bool,
) -> Generator[Result]:  # fmt: skip
    """The results of blocks in their order, counted as far as they are taken.

    Args:
        plan: The prefilter, which names what it excludes.
        decided: The blocks.
        funnel: Where frames are counted.
        progress: Called with the number of frames decided since the last call.
        every: Whether frames that do not match are results too.
        reasons: Whether somebody reads what frames fail at.
    """
    for block in until_deadline(decided, funnel):
        found = iter(block.found)
        start = 0
        try:
            for place in np.flatnonzero(block.missed < 0).tolist():
                if every:
                    yield from _excluded(plan, block, start, place)
                try:
                    verdicts = next(found, None)
                except DeadlineError:
                    verdicts = None
                if verdicts is None:
                    # the time was over, here or in another process
                    funnel.cut = True
                    return
                first, *more = verdicts
                funnel.count(first.verdict)
                progress(place + 1 - start)
                start = place + 1
                if every or not isinstance(first.verdict, NoMatch):
                    yield first
                yield from more
            if every:
                yield from _excluded(plan, block, start, len(block.missed))
            progress(len(block.missed) - start)
            start = len(block.missed)
        finally:
            # as far as results were taken
            _count_excluded(plan, block.missed[:start], funnel, reasons=reasons)


def merge_intervals(
    plan: Plan, decided: Iterable[BlockOutcome], funnel: Funnel, progress: Callable[[int], None], *, every: bool,
    reasons: bool,
) -> Generator[Result]:  # fmt: skip
    """The intervals of blocks of whole recordings; arguments as of `merge_frames`."""
    for block in until_deadline(decided, funnel):
        assert block.recordings is not None
        _count_excluded(plan, block.missed, funnel, reasons=reasons)
        funnel.frames += int((block.missed < 0).sum())
        funnel.candidates += int((block.missed < 0).sum())
        funnel.over_time.update(block.recordings.counts)
        if reasons:
            funnel.excluded.update(block.recordings.failed)
            funnel.broken.update(block.recordings.broken)
        for result in block.recordings.results:
            funnel.count_interval(result.verdict)
            if every or isinstance(result.verdict, Match | Unknown):
                yield result
        progress(len(block.missed))
