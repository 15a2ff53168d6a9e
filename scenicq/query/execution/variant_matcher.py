"""Recordings decided where runs of a program have other objects than others: each variant by a matcher of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.query.execution.recording_matcher import DecidedRecordings, RecordingMatcher, Survivors
from scenicq.query.execution.results import Result
from scenicq.query.prefilter.executor import Block
from scenicq.query.prefilter.survivors import Candidate

__all__ = ["VariantMatcher"]


@dataclass(frozen=True, slots=True)
class VariantMatcher:
    """What a process keeps between blocks.

    Attributes:
        variants: What decides each variant.
    """

    variants: Sequence[RecordingMatcher]

    def decide(self, rows: Block, left: Survivors) -> DecidedRecordings:
        """Decide a block of whole recordings; of intervals that say less than others within them only these are told.

        Args:
            rows: The block.
            left: Its labels that may be starts of some variant.
        """

        def whole(wanted: NDArray[np.int64]) -> Iterator[Candidate]:
            # who may play the roles that all variants have says nothing of the others
            return (Candidate(each.label, None) for each in left.read(wanted))

        mine = Survivors(left.labels, None, (), whole)
        parts = [each.decide(rows, mine) for each in self.variants]
        found = DecidedRecordings.nothing(rows)
        for name in ("starts", "bindings", "cut off"):
            found.counts[name] = sum(each.counts[name] for each in parts)
        for each in parts:
            found.failed.update(each.failed)
            found.broken.update(each.broken)
        results = [result for each in parts for result in each.results]
        results.sort(key=lambda each: (each.recording, each.timestamp_us, _end_us(each)))
        for _, several in groupby(results, lambda each: each.recording):
            mine = list(several)
            found.results += [each for each in mine if not any(_says_more(other, each) for other in mine)]
        return found


def _says_more(other: Result, result: Result) -> bool:
    """Whether a result has the roles of another one and more, over all of its samples, and is as sure."""
    roles, more = (_roles(each.verdict).items() for each in (result, other))
    within = other.timestamp_us <= result.timestamp_us and _end_us(result) <= _end_us(other)
    return roles < more and within and _rank(other.verdict) >= _rank(result.verdict)


def _roles(verdict: Verdict) -> dict[str, str]:
    return dict(verdict.partial if isinstance(verdict, NoMatch) else verdict.correspondence)


def _end_us(result: Result) -> int:
    return result.timestamp_us if result.interval is None else result.interval.end_us


def _rank(verdict: Verdict) -> int:
    return 2 if isinstance(verdict, Match) else 1 if isinstance(verdict, Unknown) else 0
