"""What the prefilter leaves after each step: estimated from a sample, and counted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scenicq.limits import LIMITS
from scenicq.query.execution.run import Query
from scenicq.query.prefilter.executor import Block, run_prefilter
from scenicq.query.prefilter.plan import Plan

if TYPE_CHECKING:
    import duckdb

__all__ = ["PrefilterCounts", "prefilter_counts", "spots"]

_SPOTS, _SPOT_FRAMES = 8, 256
"""The sample: so many runs of so many frames, evenly over the dataset."""


@dataclass(frozen=True, slots=True)
class PrefilterCounts:
    """The prefilter of one map with its numbers.

    Attributes:
        plan: The prefilter.
        estimated: Frames left before the first step and after each, as a sample of the dataset has it.
        left: The same, counted.
    """

    plan: Plan
    estimated: tuple[int, ...]
    left: tuple[int, ...]


def prefilter_counts(query: Query) -> Iterator[PrefilterCounts]:
    """Run the prefilter of each map, matching nothing.

    Args:
        query: The query.

    Raises:
        ScenarioError: The program is wrong or not supported.
    """
    with closing(query.dataset.connect()) as connection:
        for plan in query.plans():
            blocks = query.blocks(plan.map)
            sampled = _missed(query, connection, plan, spots(blocks))
            counted = _missed(query, connection, plan, blocks)
            share = sum(counted) / max(1, sum(sampled))
            yield PrefilterCounts(plan, tuple(round(share * n) for n in _left(sampled)), tuple(_left(counted)))


def spots(blocks: list[Block], most: int = _SPOTS) -> Iterator[Block]:
    """Short runs of frames, evenly over the blocks.

    Args:
        blocks: The blocks.
        most: How many runs there may be.
    """
    count = min(most, len(blocks)) if len(blocks) > 1 else 1
    each = max(1, most // count)
    for place in range(count):
        block = blocks[place * len(blocks) // count]
        step = max(1, (block.end - block.first) // each)
        for first in range(block.first, block.end, step):
            # what would be looked at as a whole is enough for a sample
            frames = min(_SPOT_FRAMES, step, LIMITS.advice_frames)
            yield replace(block, first=first, end=min(first + frames, block.end))


def _missed(query: Query, connection: duckdb.DuckDBPyConnection, plan: Plan, blocks: Iterable[Block]) -> list[int]:
    """How many frames miss each step first, and last how many miss none."""
    total = np.zeros(len(plan.steps) + 1, np.int64)
    for block in blocks:
        missed = run_prefilter(query.dataset, connection, plan, block)
        total += np.bincount(np.where(missed < 0, len(plan.steps), missed), minlength=len(total))
    return total.tolist()


def _left(missed: list[int]) -> list[int]:
    left = [sum(missed)]
    for count in missed[:-1]:
        left.append(left[-1] - count)
    return left
