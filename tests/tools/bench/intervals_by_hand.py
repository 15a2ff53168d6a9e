"""Questions over time beside the same written by hand: the same intervals, processor time, long recordings.

    python tests/tools/bench/intervals_by_hand.py [--frames 20000] [--only TEXT]

By hand is one query that reads the columns and NumPy over all tracks side by side. Both run in one process, in turns,
when everything is loaded and compiled. Then each question is asked of the same samples in recordings that are a hundred
times as long, once with tracks of their own in each piece, and once with tracks that go on all over. Numbers go to
bench-results/.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from intervals import HEAD, QUESTIONS, recordings

from scenicq.errors import Source
from scenicq.garbage import collect_seldom
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.columns import RecordingColumns
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

RESULTS = Path(__file__).parents[3] / "bench-results"
ROUNDS = 2
MOST, MOST_LONG = 4.0, 1.5
"""How many times the processor time by hand a question may take, and over long recordings that over short ones."""
Found = set[tuple[str, str, int, int]]
"""Recording, track, first and last time in microseconds."""


class Tracks:
    """The columns of all tracks, one after the other, each in order of time."""

    def __init__(self, dataset: Dataset) -> None:
        with dataset.connect() as connection:
            rows = connection.execute(
                "SELECT o.recording, track, o.timestamp_us AS t, ego_ahead AS ahead, -ego_right AS left, "
                "acceleration AS a, "
                "sqrt(o.motion_vx ** 2 + o.motion_vy ** 2) AS v, "
                "sqrt(l.ego_motion_vx ** 2 + l.ego_motion_vy ** 2) AS ego_v, ego_distance AS distance "
                "FROM objects o JOIN labels l ON l.frame = o.frame ORDER BY o.recording, track, t"
            ).fetchnumpy()
        self.columns = {
            name: np.ma.filled(each, np.nan) if name in "a v ego_v" else each for name, each in rows.items()
        }
        names, recordings_ = (
            np.unique(rows[name].astype(str), return_inverse=True)[1] for name in ("track", "recording")
        )
        self.of = recordings_.ravel() * (int(names.max()) + 1) + names.ravel()
        last = np.append(np.flatnonzero(np.diff(self.of)), len(self.of) - 1)
        self.last = last[np.searchsorted(last, np.arange(len(self.of)))]
        self.t = self.columns["t"].astype(np.int64)

    def __getattr__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def first(self, holds: np.ndarray) -> np.ndarray:
        """For each sample the next one at which something holds; one beyond the last of its track if there is none."""
        places = np.where(holds, np.arange(len(holds)), len(holds))
        return np.minimum(np.minimum.accumulate(places[::-1])[::-1], self.last + 1)

    def after(self, seconds: float) -> np.ndarray:
        """The first sample so many seconds later, one beyond the last of its track if there is none."""
        key = self.of * (int(self.t.max()) * 2 + 10**9) + self.t
        return np.minimum(np.searchsorted(key, key + round(seconds * 1e6)), self.last + 1)

    def runs(self, holds: np.ndarray, seconds: float) -> Found:
        """The longest stretches of samples at which something holds."""
        ends = self.first(~holds) - 1
        begins = holds & np.append(True, (self.of[1:] != self.of[:-1]) | ~holds[:-1])
        return self.told(np.flatnonzero(begins), ends[begins], seconds)

    def told(self, starts: np.ndarray, ends: np.ndarray, seconds: float = 0.0) -> Found:
        """The longest of overlapping intervals of each track, the earliest of equals."""
        fit = self.t[ends] - self.t[starts] >= seconds * 1e6
        starts, ends = starts[fit], ends[fit]
        found, taken = set(), np.zeros(len(self.t), np.bool_)
        for number in np.lexsort((starts, self.t[starts] - self.t[ends])).tolist():
            i, j = int(starts[number]), int(ends[number])
            if not taken[i] and not taken[j]:
                taken[i : j + 1] = True
                found.add((str(self.recording[i]), str(self.track[i]), int(self.t[i]), int(self.t[j])))
        return found


def ended(tracks: Tracks, starts: np.ndarray, ends: np.ndarray, holds: np.ndarray, seconds: float = 0.0) -> Found:
    """Runs from starts that end within their tracks and for which something holds."""
    mine = np.flatnonzero(starts & (ends <= tracks.last) & holds)
    return tracks.told(mine, ends[mine], seconds)


def stopped(x: Tracks) -> Found:
    return x.runs((x.v < 0.5) & (x.ahead > 0) & (x.ahead < 20) & (abs(x.left) < 1.5), 2.0)


def cut_in(x: Tracks) -> Found:
    start = (x.left > -5) & (x.left < -2) & (x.ahead > 0) & (x.ahead < 10)
    inside = x.first(abs(x.left) < 0.5)
    ends = np.minimum(inside, x.after(4.0))
    return ended(x, start, ends, (inside == ends) & (x.first(x.ahead <= 0) > ends))


def follows(x: Tracks) -> Found:
    return x.runs((x.ahead > 0) & (x.ahead < 2 * x.ego_v) & (abs(x.left) < 1.5) & (x.ego_v > 2), 5.0)


def brakes(x: Tracks) -> Found:
    start = (x.ahead > 0) & (x.ahead < 30) & (abs(x.left) < 2) & (x.v > 5)
    ends = x.first(x.v < 1)
    return ended(x, start, ends, x.first(x.a < -4) <= ends)


def passes(x: Tracks) -> Found:
    start = (x.left > -6) & (x.left < -2) & (x.ahead > -15) & (x.ahead < -5)
    ends = x.first(x.ahead > 5)
    return ended(x, start, ends, x.first(abs(x.left) >= 6) > ends)


def nested(x: Tracks) -> Found:
    """Up to the last sample behind which no speed above 5 waits for one below 5."""
    start = (x.ahead > 0) & (x.ahead < 30) & (abs(x.left) < 2)
    fast, slow = x.v > 5, x.v < 5
    places = np.arange(len(x.t))
    head = np.append(True, x.of[1:] != x.of[:-1])
    since = np.maximum.accumulate(np.where(head, places, 0))
    last_fast = np.maximum.accumulate(np.where(fast, places, -1))
    last_slow = np.maximum.accumulate(np.where(slow, places, -1))
    last_fast, last_slow = (np.where(each >= since, each, -1) for each in (last_fast, last_slow))
    # a run may end where the last fast sample is followed by a slow one
    answered = _last_in_track(x, last_slow > last_fast)
    ends = np.where(answered >= places, answered, -1)
    # else as far as nothing was fast
    calm = x.first(fast) - 1
    ends = np.maximum(ends, np.where(calm >= places, calm, -1))
    mine = np.flatnonzero(start & (ends >= 0))
    return x.told(mine, ends[mine])


def _last_in_track(x: Tracks, holds: np.ndarray) -> np.ndarray:
    """For each sample the last one of its track at which something holds; -1 if there is none."""
    places = np.where(holds, np.arange(len(holds)), -1)
    firsts = np.flatnonzero(np.append(True, x.of[1:] != x.of[:-1]))
    most = np.maximum.reduceat(places, firsts)
    return np.repeat(most, np.diff(np.append(firsts, len(holds))))


def window(x: Tracks, combine: np.ufunc, values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The least or greatest value from each sample to an end, by doubling; ends beyond the track count as its last."""
    ends = np.minimum(ends, x.last)
    length = ends - np.arange(len(ends)) + 1
    found, table, size = values.copy(), values, 1
    while True:
        mine = np.flatnonzero((length >= size) & (length < 2 * size))
        found[mine] = combine(table[mine], table[ends[mine] + 1 - size])
        if 2 * size > int(length.max()):
            return found
        table = combine(table[:-size], table[size:])
        size *= 2


def gap(x: Tracks) -> Found:
    start = (x.ahead > 0) & (x.ahead < 30) & (abs(x.left) < 1.5)
    ends = x.after(3.0)
    least = window(x, np.minimum, x.distance, ends)
    # some gap with least - 1 < gap < least
    return ended(x, start, ends, np.maximum(least - 1, 3) < np.minimum(least, 12))


def hidden_end(x: Tracks) -> Found:
    """Ends at the first sample at which the speed is more than 1 m/s below the limit, which it is above at first."""
    start = (x.ahead > 0) & (x.ahead < 60) & (abs(x.left) < 2) & (x.v > 4)
    found: list[tuple[np.ndarray, np.ndarray]] = []
    least = np.where(start, np.minimum(x.v, 9), np.nan)
    for step in range(1, 31):
        ends = np.arange(len(x.t)) + step
        there = start & (ends <= np.minimum(x.after(3.0), x.last))
        at = np.minimum(ends, len(x.t) - 1)
        # some limit more than 1 m/s above this speed, below that of the start, at most 1 m/s above all before
        fit = there & (np.maximum(x.v[at] + 1, 4) < least)
        found.append((np.flatnonzero(fit), ends[fit]))
        least = np.where(there, np.minimum(least, x.v[at] + 1), np.nan)
    starts, ends = (np.concatenate([each[part] for each in found]) for part in (0, 1))
    return x.told(starts, ends, 0.5)


def slow(x: Tracks) -> Found:
    start = (x.left < -1.5) & (x.ahead > 0) & (x.ahead < 60)
    ends = x.first(x.left > -0.5)
    return ended(x, start, ends, x.first((x.v >= 2) | (x.ahead <= 0)) > ends)


def stops(x: Tracks) -> Found:
    """Over five seconds with braking, behind the last of which something is slow."""
    start = (x.ahead > 0) & (x.ahead < 40) & (abs(x.left) < 2) & (x.v > 3)
    ends, places = x.after(5.0), np.arange(len(x.t))
    braked, slow_ = (np.maximum.accumulate(np.where(each, places, -1)) for each in (x.a < -2, x.v < 1))
    at = np.minimum(ends, x.last)
    return ended(x, start, ends, (braked[at] >= places) & (slow_[at] >= braked[at]))


def slows(x: Tracks) -> Found:
    start = (x.ahead > 0) & (x.ahead < 60) & (abs(x.left) < 2)
    ends = np.minimum(x.first(x.v < 0.5), x.after(3.0))
    most, least = window(x, np.maximum, x.v, ends), window(x, np.minimum, x.v, ends)
    # some limit above all speeds, less than 1 m/s above the greatest and more than 4 m/s above the least
    return ended(x, start, ends, np.maximum(most, least + 4) < np.minimum(most + 1, 9), 0.5)


@dataclass(frozen=True, slots=True)
class Asked:
    """A question: the program behind `HEAD`, how long intervals last at least, and the same by hand."""

    text: str
    least_s: float | None
    by_hand: Callable[[Tracks], Found]


ASKED = {
    **{
        name: Asked(*QUESTIONS[name], by_hand)
        for name, by_hand in {
            "stopped car ahead for 2 s": stopped, "cut-in": cut_in, "follows at under 2 s": follows,
            "hard braking of a car ahead": brakes, "passes": passes, "a gap that is hidden": gap,
        }.items()
    },
    "something slow crosses ahead": Asked(
        "require left(other) < -1.5 and 0 < ahead(other) < 60\n"
        "require always (other.speed < 2 and ahead(other) > 0)\nterminate when left(other) > -0.5\n", None, slow,
    ),
    "who brakes comes to a stop": Asked(
        "require 0 < ahead(other) < 40 and abs(left(other)) < 2 and other.speed > 3\n"
        "require always (other.acceleration < -2 implies eventually other.speed < 1)\n"
        "require eventually other.acceleration < -2\nterminate after 5 seconds\n", None, stops,
    ),
    "slows by 4 m/s from a hidden speed": Asked(
        "limit = Range(4, 9)\nrequire 0 < ahead(other) < 60 and abs(left(other)) < 2\n"
        "require always other.speed < limit\nrequire eventually other.speed > limit - 1\n"
        "require eventually other.speed < limit - 4\n"
        "terminate when other.speed < 0.5\nterminate after 3 seconds\n", 0.5, slows,
    ),
    "nested, without an end": Asked(
        "require 0 < ahead(other) < 30 and abs(left(other)) < 2\n"
        "require always (other.speed > 5 implies eventually other.speed < 5)\n", None, nested,
    ),
    "ends below a hidden speed": Asked(
        "limit = Range(4, 9)\nrequire 0 < ahead(other) < 60 and abs(left(other)) < 2\nrequire other.speed > limit\n"
        "terminate when other.speed < limit - 1\nterminate after 3 seconds\n"
        "require eventually other.speed < limit - 1\n",
        0.5, hidden_end,
    ),
}  # fmt: skip


def ours(dataset: Dataset, asked: Asked) -> tuple[float, Found]:
    """CPU seconds of a query that is compiled, and its matches."""
    time_ = IntervalOptions(min_duration_s=asked.least_s)
    options = QueryOptions(proofs=False, interval_reasons=False, time=time_)
    query = Query(dataset, Source("p.scenic", HEAD + asked.text), options)
    for plan in query.plans():
        query.blocks(plan.map)
    query.coverage()
    started = time.process_time()
    matches = [each for each in query.results() if isinstance(each.verdict, Match)]
    used = time.process_time() - started
    ends = [(each, each.interval.end_us) for each in matches if each.interval is not None]
    return used, {(a.recording, a.verdict.correspondence["other"], a.timestamp_us, end) for a, end in ends}


def by_hand(dataset: Dataset, asked: Asked) -> tuple[float, Found]:
    """CPU seconds by hand, and what is found."""
    started = time.process_time()
    with np.errstate(invalid="ignore"):
        found = asked.by_hand(Tracks(dataset))
    return time.process_time() - started, found


def glued(some: Iterator[RecordingColumns], pieces: int, *, apart: bool) -> Iterator[RecordingColumns]:
    """Long recordings, of short ones one after the other, each with tracks of its own or with those of the others."""
    parts: list[RecordingColumns] = []
    for each in some:
        parts.append(each)
        if len(parts) == pieces:
            yield _joined(parts, apart=apart)
            parts = []


def _joined(parts: list[RecordingColumns], *, apart: bool) -> RecordingColumns:
    def together(mine: list[object]) -> object:
        whole: dict[str, object] = {}
        for name in type(mine[0]).__dataclass_fields__:  # type: ignore[attr-defined]
            values = [getattr(each, name) for each in mine]
            if isinstance(values[0], np.ndarray):
                whole[name] = np.concatenate(values)
            else:
                whole[name] = [one for each in values for one in each] if isinstance(values[0], list) else values[0]
        return replace(mine[0], **whole)  # type: ignore[type-var]

    step = parts[0].times_us[1] - parts[0].times_us[0]
    names = [
        replace(each.objects, track=[f"{number}-{track}" for track in each.objects.track]) if apart else each.objects
        for number, each in enumerate(parts)
    ]
    found = together([replace(each, objects=mine) for each, mine in zip(parts, names, strict=True)])
    assert isinstance(found, RecordingColumns)
    count = len(found.frames)
    return replace(
        found, egos=together([each.egos for each in parts]), objects=together(list(names)),
        times_us=[step * number for number in range(count)],
    )  # fmt: skip


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--only", default="", help="questions with this in their names")
    given = parser.parse_args()
    collect_seldom()
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder:
        write_dataset(Path(folder) / "short", recordings(given.frames), {}, name="short")
        for kind, apart in (("long", True), ("going-on", False)):
            longer = glued(recordings(given.frames), max(given.frames // 1000, 1), apart=apart)
            write_dataset(Path(folder) / kind, longer, {}, name=kind)
        short, long, going_on = (open_dataset(Path(folder) / name) for name in ("short", "long", "going-on"))
        for name, asked in ASKED.items():
            if given.only not in name:
                continue
            hand, mine, later, further = (math.inf,) * 4
            for _ in range(ROUNDS):
                used, expected = by_hand(short, asked)
                hand = min(hand, used)
                used, found = ours(short, asked)
                mine = min(mine, used)
                later, further = min(later, ours(long, asked)[0]), min(further, ours(going_on, asked)[0])
                if found != expected:
                    odd = sorted(found ^ expected)
                    sys.exit(f"{name}: {len(found)} intervals here, {len(expected)} by hand; {odd[:3]}")
            rows.append(
                {
                    "question": name,
                    "intervals": len(found),
                    "by hand": hand,
                    "ours": mine,
                    "long": later,
                    "going on": further,
                }
            )
            print(
                f"  {name:28} {len(found):>7,} intervals, by hand {hand:5.2f} s, ours {mine:5.2f} s, "
                f"in long recordings {later:5.2f} s, with tracks that go on {further:5.2f} s",
                flush=True,
            )
            for ratio, most, what in ((mine / hand, MOST, "by hand"), (later / mine, MOST_LONG, "short recordings")):
                print(f"  {'pass' if ratio <= most else 'FAIL'}  {ratio:.1f} times {what}, at most {most}")
    peak = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {"time": now.isoformat(), "python": platform.python_version(), "peak_mib": peak, "results": rows}
    (RESULTS / f"intervals-by-hand-{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
