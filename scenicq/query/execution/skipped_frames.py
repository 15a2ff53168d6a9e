"""Which frames a query has not looked at, and the summary of its results."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from contextlib import closing
from typing import TYPE_CHECKING

from msgspec import UNSET, UnsetType

from scenicq.query.execution.result_summary import RESULT_VERSION, End, ResultCount, ResultSummary, Stretch
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import MAP_LACKS, Query
from scenicq.query.execution.variable_texts import variable_texts

if TYPE_CHECKING:
    import duckdb

__all__ = ["summarize"]

_Run = tuple[str, str, int]
"""A map, a recording, and how many frames it has there."""


def summarize(query: Query, count: ResultCount) -> ResultSummary:
    """What the results of a query say of themselves.

    Args:
        query: After its results were taken.
        count: The number of the results that are there.
    """
    funnel, options = query.funnel, query.options
    skipped = tuple(_skipped(query)) if funnel.cut or funnel.limited is not None else ()
    sample, unknown = funnel.sample, count.unknown
    complete = not skipped
    if sample is not None:
        complete = complete and sample.shown >= sample.of and not sample.unknown
        unknown = sample.unknown
    chosen = funnel.chosen
    return ResultSummary(
        version=RESULT_VERSION,
        complete=complete and not (chosen and chosen.left_out),
        results=count.results,
        frames=sum(query.frames(name) for name in query.dataset.maps),
        unknown=dict(sorted(unknown.items())),
        all_matches=options.all_matches,
        limit=(chosen.limit if chosen else options.limit) or UNSET,
        sample=UNSET if sample is None else sample.shown,
        sampled_from=UNSET if sample is None else sample.of,
        where=(chosen.where if chosen else "") or UNSET,
        sort=(chosen.sort if chosen else "") or UNSET,
        left_out=chosen.left_out if chosen else 0,
        skipped=skipped,
        variables=_variables(query) if count.results else {},
    )


def _variables(query: Query) -> dict[str, str]:
    """The texts of the random variables that are the author's own, and not those of a library."""
    compiled = next(query.fitting(), None)
    texts = {} if compiled is None else variable_texts(compiled.scenario)
    own = f"{query.source.file_name}:"
    return {place: texts[place] for place in sorted(texts) if place.startswith(own) or not place.startswith("<")}


def _skipped(query: Query) -> Iterator[Stretch]:
    """The frames behind the last one that the query has looked at, in the order of names and not of maps."""
    with closing(query.dataset.connect(threads=1, views=False)) as connection:
        yield from _Order(query, connection).skipped()


class _Order:
    """The frames in the order in which a query looks at them."""

    def __init__(self, query: Query, connection: duckdb.DuckDBPyConnection) -> None:
        self._query, self._connection = query, connection
        self._labels = query.dataset.scan("labels")
        self._runs = list(self._recordings())

    def _recordings(self) -> Iterator[_Run]:
        """The recordings in order; of a map that lacks what the program needs there is none."""
        query = self._query
        fitting = set(query.fitting_maps())
        counted = f"SELECT map, recording, count(*) FROM {self._labels} GROUP BY ALL"
        for name, recording, frames in sorted(self._connection.execute(counted).fetchall()):
            chosen = None if query.recordings is None else query.recordings.get(name)
            if name in fitting and (query.recordings is None or (chosen and chosen.first <= recording <= chosen.last)):
                yield name, recording, frames

    def _frames(self, run: _Run) -> list[tuple[int, str]]:
        """The timestamp and name of each frame of a recording, in order."""
        named = f"SELECT timestamp_us, frame FROM {self._labels} WHERE map = ? AND recording = ? ORDER BY ALL"
        return self._connection.execute(named, run[:2]).fetchall()

    def skipped(self) -> Iterator[Stretch]:
        """The frames behind the last one that was looked at."""
        last = self._query.funnel.limited
        why: End = "deadline" if last is None else "limit"
        seen = _seen(self._query) if last is None else self._seen_until(last)
        left: dict[str, int] = {}
        begun: tuple[_Run, int] | None = None
        for run in self._runs:
            _, recording, frames = run
            if seen < frames:
                left[recording] = left.get(recording, 0) + frames - max(seen, 0)
                begun = (run, seen) if seen > 0 else begun
            seen -= frames
        names = sorted(self._query.dataset.manifest.by_recording)
        for stretch in _consecutive(names, sorted(left), "" if begun is None else begun[0][1]):
            time_us: int | UnsetType = UNSET
            frame: str | UnsetType = UNSET
            if begun is not None and stretch[0] == begun[0][1]:
                time_us, frame = self._frames(begun[0])[begun[1]]
            number = sum(left[name] for name in stretch)
            yield Stretch(
                why=why, frames=number, first=stretch[0], last=stretch[-1], from_us=time_us, from_frame=frame
            )  # fmt: skip

    def _seen_until(self, last: Result) -> int:
        """How many frames are before the end that a limit has put: the last one may have more correspondences."""
        before = 0
        for run in self._runs:
            if run[1] == last.recording:
                if last.interval is not None:
                    return before  # other intervals of the recording may begin at the same time
                frames, place = self._frames(run), (last.timestamp_us, last.frame)
                number = bisect_left(frames, place)
                if number < len(frames) and frames[number] == place:
                    return before + number + (not self._query.options.all_matches)
            before += run[2]
        return before


def _seen(query: Query) -> int:
    """How many frames were looked at before the time was over; those of other maps are counted at once."""
    lacking = sum(query.funnel.excluded[f"{MAP_LACKS}{name}"] for name in query.dataset.maps)
    return query.funnel.frames - lacking


def _consecutive(names: list[str], left: list[str], begun: str) -> Iterator[list[str]]:
    """Recordings of which frames are left, those together between whose names no other name lies.

    Args:
        names: The names of all recordings, sorted.
        left: Those that are left, sorted.
        begun: The one of which frames were looked at: it comes first of those that are together.
    """
    number = {name: place for place, name in enumerate(names)}
    together: list[str] = []
    for name in left:
        if together and (number[name] != number[together[-1]] + 1 or name == begun):
            yield together
            together = []
        together.append(name)
    if together:
        yield together
