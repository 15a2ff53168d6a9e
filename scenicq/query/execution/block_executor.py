"""Who decides the blocks of a query: this process, others, or others once it is clear that it takes long."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np

from scenicq.limits import LIMITS
from scenicq.match.verdict import Cause, Unknown
from scenicq.processes import LostTask, Work, Workers, default_processes
from scenicq.query.execution.block_matcher import BlockOutcome, Decider, every_label
from scenicq.query.execution.results import Result
from scenicq.query.prefilter.executor import Block, join_first
from scenicq.store.dataset import Dataset

__all__ = ["BlockExecutor"]

_PAYS_S = 3.0
"""Seconds of work that must be left for processes to be worth starting: it takes each about one."""


class BlockExecutor:
    """Decides blocks here or in workers, and yields them in order; a context manager.

    A process that dies costs nothing but its block's time. Where a block kills every process which takes it,
    halving finds the frames that do so, and they are unknown.
    """

    def __init__(
        self, dataset: Dataset, jobs: int | None, decider: Decider, start: Callable[..., Work[Block, BlockOutcome]],
        setup: tuple[Any, ...],
    ) -> None:  # fmt: skip
        """Prepare; no process starts yet.

        Args:
            dataset: The dataset.
            jobs: Processes; 1 for this one alone, None for as many as pays.
            decider: Decides in this process.
            start: Makes what decides in another; see `Workers`.
            setup: Its arguments.
        """
        self.jobs = default_processes() if jobs is None else jobs
        self._asked = jobs is not None
        self._dataset, self._decider = dataset, decider
        self._workers: Workers[Block, BlockOutcome] = Workers(self.jobs, start, setup)
        self._started = False
        self._open = ExitStack()

    def __enter__(self) -> BlockExecutor:
        """Nothing is started yet."""
        self._open.enter_context(self._decider)
        self._open.enter_context(self._workers)
        return self

    def __exit__(self, *error: Any) -> None:
        """End all processes."""
        self._open.__exit__(*error)

    def decide(self, blocks: Sequence[Block], told: Callable[[Any], None] | None = None) -> Iterator[BlockOutcome]:
        """Decide blocks; each is to be taken before the next is asked for.

        Args:
            blocks: In the order of the store.
            told: Called with what other processes tell of the blocks that they decide.
        """
        alone = self.jobs <= 1 or not (self._asked or self._started)
        waiting, done, began = list(blocks), 0, time.monotonic()
        frames = sum(block.end - block.first for block in blocks)
        while alone and waiting:
            # each costs something: what was cut for several processes is put together again as long as it goes fast
            block = join_first(waiting, 2 * done)
            yield self._decider.decide(block)
            done += block.end - block.first
            left_s = (time.monotonic() - began) / done * (frames - done)
            alone = self.jobs <= 1 or left_s < _PAYS_S
        if waiting:
            self._started = True
            yield from self._elsewhere(waiting, told)

    def _elsewhere(
        self, blocks: Iterable[Block], told: Callable[[Any], None] | None = None, tries: int | None = None
    ) -> Iterator[BlockOutcome]:
        """Decide blocks side by side, a bounded number ahead."""
        for block, found in self._workers.run(blocks, told, tries=LIMITS.block_tries if tries is None else tries):
            yield from self._halves(block) if isinstance(found, LostTask) else (found,)

    def _halves(self, block: Block) -> Iterator[BlockOutcome]:
        if block.divisible:
            for half in block.halves():
                # a half is lost at once: only what is left to blame, a frame or recording, gets more chances
                yield from self._elsewhere([half], tries=1 if half.divisible else LIMITS.block_tries)
            return
        if block.runs:
            from scenicq.query.execution.recording_matcher import lost_recording  # noqa: PLC0415 - takes long to load

            yield BlockOutcome(
                np.full(block.end - block.first, -1, np.int16), [], [], lost_recording(self._dataset, block)
            )
            return
        for label in every_label(self._dataset, block):
            lost = Unknown("crash", Cause("process", "every process that matched this frame died"))
            result = Result(label.frame, label.recording, label.timestamp_us, lost, label.sensors)
            yield BlockOutcome(np.full(1, -1, np.int16), [[result]], [])
