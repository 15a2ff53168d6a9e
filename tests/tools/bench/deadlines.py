"""Long recordings: the time that two programs take by number of samples, and when a command with a deadline ends.

    python tests/tools/bench/deadlines.py [--samples 1000 10000 100000] [--only TEXT]

Time in recordings shall be linear in their samples, and a query with a deadline of 1 s over before 2 s, whatever it
asks. All is processor time, that of the deadline too, so that a busy machine changes nothing. Programs are those of the
tests of deadlines, of the cookbook over time, of the samples, and those that are written by hand elsewhere. Numbers go
to bench-results/deadlines.json.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from intervals import HEAD, recordings
from intervals_by_hand import ASKED, glued

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "units" / "temporal")]

from programs_over_time import HEADER, PROGRAMS  # noqa: E402
from test_cookbook import OVER_TIME  # noqa: E402

from scenicq import budget  # noqa: E402
from scenicq.budget import DeadlineError  # noqa: E402
from scenicq.errors import ScenarioError, Source  # noqa: E402
from scenicq.garbage import collect_seldom  # noqa: E402
from scenicq.query.execution.run import Query, QueryOptions  # noqa: E402
from scenicq.store.columns import MemberColumns, RecordingColumns  # noqa: E402
from scenicq.store.dataset import open_dataset  # noqa: E402
from scenicq.store.writer import write_dataset  # noqa: E402
from scenicq.temporal.interval_options import IntervalOptions  # noqa: E402

DEADLINE_S, OVER_BY_S = 1, 2.0
MOST_GROWTH = 1.5
"""How many times the time of a sample in a short recording one in a longer recording may take."""
GROWING = {"next": 1, "a point": 1}
"""Programs whose time once was the square of the samples, with how many cars beside the ego."""


def one_recording(samples: int, cars: int) -> RecordingColumns:
    """One recording at 10 Hz: an ego that stands, and cars that go to and fro ahead of it at changing speeds."""
    k, place = np.repeat(np.arange(samples), cars), np.tile(np.arange(cars), samples)
    tracks, n = [f"car-{each}" for each in place.tolist()], samples * cars
    blank, zero, none = np.full(samples, np.nan), np.zeros(samples), [None] * samples
    objects = MemberColumns(
        id=tracks, category=["Car"] * n, source_class=["car"] * n, x=3.0 * place - 3,
        y=10 + 20 * place + 30 * np.sin(k / (20 + place)), heading=np.zeros(n), width=np.full(n, 2.0),
        length=np.full(n, 4.5), height=np.full(n, np.nan), vx=np.zeros(n), vy=((k + place) % 7).astype(float),
        track=tracks, attributes=[None] * n,
    )  # fmt: skip
    egos = MemberColumns(
        id=["ego"] * samples, category=["Car"] * samples, source_class=["car"] * samples, x=zero, y=zero, heading=zero,
        width=np.full(samples, 2.0), length=np.full(samples, 4.5), height=blank, vx=zero, vy=zero, track=none,
        attributes=none,
    )  # fmt: skip
    return RecordingColumns(
        name="r", map="none", frames=[f"{number:07}" for number in range(samples)],
        times_us=[100_000 * number for number in range(samples)], params=none, egos=egos, objects=objects,
        object_counts=np.full(samples, cars), sensor_counts=np.zeros(samples, np.int64), channels=[], paths=[],
    )  # fmt: skip


def driving_on(samples: int) -> Iterator[RecordingColumns]:
    """Recordings of traffic, each of which begins where the ego of the last one ended."""
    for number, each in enumerate(recordings(samples)):
        egos, objects = each.egos, each.objects
        ahead = number * (float(egos.y[-1]) + 1)
        yield replace(each, egos=replace(egos, y=egos.y + ahead), objects=replace(objects, y=objects.y + ahead))


def programs() -> Iterator[tuple[str, str, float | None]]:
    """Name, text and least duration of each program that runs against a deadline."""
    for name, text in PROGRAMS.items():
        yield name, HEADER + text, None
    for name, asked in ASKED.items():
        yield name, HEAD + asked.text, asked.least_s
    for recipe in OVER_TIME:
        least = recipe["least"]
        yield recipe["title"], recipe["program"], None if least is None else float(least)
    for file in sorted((ROOT / "sample_data" / "over_time").glob("*.scenic")):
        yield file.name, file.read_text(encoding="utf-8"), 5.0


def growth(folder: Path, name: str, samples: int) -> dict[str, object]:
    """Processor seconds of a program over one recording."""
    cars = GROWING[name]
    made = folder / f"{cars}-{samples}"
    if not made.exists():
        write_dataset(made, [one_recording(samples, cars)], {}, name=made.name)
    query = Query(open_dataset(made), Source("bench.scenic", HEADER + PROGRAMS[name]), QueryOptions())
    query.coverage()
    began = time.process_time()
    found = sum(1 for _ in query.results())
    return {"program": name, "samples": samples, "cpu_s": round(time.process_time() - began, 3), "results": found}


class ProcessorClock:
    """A clock that stands still while this process waits, so that whatever else the machine does changes nothing."""

    monotonic = perf_counter = thread_time = staticmethod(time.process_time)


def over_deadline(
    folder: Path, few: Path, many: Path, name: str, text: str, least_s: float | None
) -> dict[str, object]:
    """How much processor time a query takes that has a second, when what it needs is loaded."""
    source, time_ = Source(str(folder / "program.scenic"), text), IntervalOptions(min_duration_s=least_s)
    with patch.object(budget, "time", ProcessorClock):
        for dataset, seconds in ((few, OVER_BY_S), (many, DEADLINE_S)):
            began = time.process_time()
            query = Query(open_dataset(dataset), source, QueryOptions(time=time_, until=began + seconds))
            try:
                found = sum(1 for _ in query.results())
            except DeadlineError:
                found = 0
            except ScenarioError as error:
                return {"program": name, "needs": error.diagnostics[0].code}
    used = time.process_time() - began
    return {"program": name, "cpu_s": round(used, 2), "results": found, "cut": query.funnel.cut}


def main() -> None:
    """Measure, print and keep; exits with 1 where something takes too long."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, nargs="+", default=[1000, 10_000, 100_000])
    parser.add_argument("--only", default="", help="programs with this in their names")
    given = parser.parse_args()
    collect_seldom()
    grown: list[dict[str, object]] = []
    ended: list[dict[str, object]] = []
    late = False
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for program in GROWING:
            if given.only not in program:
                continue
            base = math.inf
            growth(folder, program, given.samples[0])  # loads and compiles
            for samples in given.samples:
                row = growth(folder, program, samples)
                each_us = 1e6 * float(str(row["cpu_s"])) / samples
                base = min(base, each_us)
                late |= each_us > MOST_GROWTH * base
                grown.append(row)
                verdict = "pass" if each_us <= MOST_GROWTH * base else "FAIL"
                print(
                    f"  {verdict}  {program:10} {samples:>8,} samples  {row['cpu_s']} s, {each_us:.1f} us each",
                    flush=True,
                )
        longest = max(given.samples)
        pieces = max(longest // 200, 1)
        traffic = glued(driving_on(200 * pieces), pieces, apart=False)
        made = {"few": [one_recording(40, 8)], "cars": [one_recording(longest, 8)], "little": recordings(200),
                "traffic": traffic}  # fmt: skip
        for what, some in made.items():
            write_dataset(folder / what, some, {}, name=what)
        for program, text, least_s in programs():
            if given.only not in program:
                continue
            few, many = (folder / name for name in (("few", "cars") if program in PROGRAMS else ("little", "traffic")))
            row = over_deadline(folder, few, many, program, text, least_s)
            ended.append(row)
            over = float(str(row.get("cpu_s", 0))) >= OVER_BY_S
            late |= over
            print(
                f"  {'FAIL' if over else 'pass'}  " + "  ".join(f"{key} {value}" for key, value in row.items()),
                flush=True,
            )
    results = ROOT / "bench-results"
    results.mkdir(exist_ok=True)
    content = {"python": platform.python_version(), "growth": grown, "deadline": ended}
    (results / "deadlines.json").write_text(json.dumps(content, indent=1) + "\n")
    sys.exit(late)


if __name__ == "__main__":
    main()
