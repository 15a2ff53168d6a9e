"""Measures queries over time on invented recordings of 20 s at 10 Hz: processor seconds and memory by number of frames.

    python tests/tools/bench/intervals.py [--frames 100000 1000000] [--jobs 2]

Numbers go to bench-results/intervals.json.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scenicq.errors import Source
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.columns import MemberColumns, RecordingColumns
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

SAMPLES, HZ = 200, 10
HEAD = """from math import cos, sin
def left(thing):
    return (distance from ego to thing) * sin((angle from ego to thing) - ego.heading)
def ahead(thing):
    return (distance from ego to thing) * cos((angle from ego to thing) - ego.heading)
class Anywhere:
    position: (Range(-9999, 9999), Range(-9999, 9999))
    heading: Range(-180, 180) deg
ego = new Anywhere
other = new Anywhere
"""
QUESTIONS: dict[str, tuple[str, float | None]] = {
    "stopped car ahead for 2 s": (
        "require other.speed < 0.5 and ahead(other) > 0 and ahead(other) < 20 and abs(left(other)) < 1.5\n", 2.0,
    ),
    "cut-in": (
        "require -5 < left(other) < -2 and 0 < ahead(other) < 10\nrequire always ahead(other) > 0\n"
        "terminate when abs(left(other)) < 0.5\nterminate after 4 seconds\n"
        "require eventually abs(left(other)) < 0.5\n", None,
    ),
    "follows at under 2 s": (
        "require 0 < ahead(other) < 2 * ego.speed and abs(left(other)) < 1.5 and ego.speed > 2\n", 5.0,
    ),
    "hard braking of a car ahead": (
        "require 0 < ahead(other) < 30 and abs(left(other)) < 2 and other.speed > 5\n"
        "require eventually other.acceleration < -4\nterminate when other.speed < 1\n", None,
    ),
    "passes": (
        "require -6 < left(other) < -2 and -15 < ahead(other) < -5\nterminate when ahead(other) > 5\n"
        "require always abs(left(other)) < 6\n", None,
    ),
    "a gap that is hidden": (
        "gap = Range(3, 12)\nrequire 0 < ahead(other) < 30 and abs(left(other)) < 1.5\n"
        "require always (distance to other) > gap\nrequire eventually (distance to other) < gap + 1\n"
        "terminate after 3 seconds\n", None,
    ),
}  # fmt: skip


def recordings(frames: int, seed: int = 1) -> Iterator[RecordingColumns]:
    """Recordings of a straight road with three lanes: cars that keep their lane, change it, follow, brake and stand."""
    draw = np.random.default_rng(seed)
    t = np.arange(SAMPLES) / HZ
    for number in range(frames // SAMPLES):
        count = int(draw.integers(20, 41))
        speed = draw.choice([0.0, 5, 8, 10, 12], count) + draw.normal(0, 0.5, count)
        lane = draw.integers(-1, 2, count) * 3.5
        start, change = draw.uniform(-60, 120, count), draw.choice([0.0, 3.5, -3.5], count, p=[0.8, 0.1, 0.1])
        when, brakes = draw.uniform(2, 16, count), draw.random(count) < 0.1
        # each brakes at its time, if it does
        v = np.where(
            brakes[:, None], np.maximum(0, speed[:, None] - 5 * np.maximum(0, t - when[:, None])), speed[:, None]
        )
        y = start[:, None] + np.cumsum(np.maximum(v, 0), axis=1) / HZ
        x = lane[:, None] + change[:, None] * np.clip((t - when[:, None]) / 3, 0, 1)
        ego = 9.0 * t
        n = SAMPLES * count
        nan, none = np.full(n, np.nan), [None] * n
        objects = MemberColumns(
            id=[f"o{i}" for _ in range(SAMPLES) for i in range(count)],
            category=["Car"] * n, source_class=["car"] * n, x=x.T.ravel(), y=y.T.ravel(), heading=np.zeros(n),
            width=np.full(n, 2.0), length=np.full(n, 4.5), height=nan, vx=nan, vy=nan,
            track=[f"o{i}" for _ in range(SAMPLES) for i in range(count)], attributes=none,
        )  # fmt: skip
        blank = np.full(SAMPLES, np.nan)
        egos = MemberColumns(
            id=["ego"] * SAMPLES, category=["Car"] * SAMPLES, source_class=["car"] * SAMPLES,
            x=np.zeros(SAMPLES), y=ego,
            heading=np.zeros(SAMPLES), width=np.full(SAMPLES, 2.0), length=np.full(SAMPLES, 4.5),
            height=blank, vx=blank, vy=blank, track=[None] * SAMPLES, attributes=[None] * SAMPLES,
        )  # fmt: skip
        name = f"r{number:06}"
        yield RecordingColumns(
            name=name, map="none", frames=[f"{name}-{k:03}" for k in range(SAMPLES)],
            times_us=[round(1e6 * each) for each in t], params=[None] * SAMPLES, egos=egos, objects=objects,
            object_counts=np.full(SAMPLES, count), sensor_counts=np.zeros(SAMPLES, np.int64), channels=[], paths=[],
        )  # fmt: skip


def main() -> None:
    """Make datasets, ask, write down."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--frames", type=int, nargs="+", default=[20_000, 100_000])
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args()
    found: list[dict[str, object]] = []
    for frames in asked.frames:
        with tempfile.TemporaryDirectory() as folder:
            began = time.process_time()
            write_dataset(Path(folder) / "d", recordings(frames), {}, name="d")
            print(f"{frames:>9,} frames written in {time.process_time() - began:.1f} s")
            dataset = open_dataset(Path(folder) / "d")
            for name, (text, least_s) in QUESTIONS.items():
                options = QueryOptions(time=IntervalOptions(min_duration_s=least_s), jobs=asked.jobs)
                query = Query(dataset, Source("bench.scenic", HEAD + text), options)
                began, cpu = time.monotonic(), _cpu()
                matches = sum(1 for _ in query.results())
                row: dict[str, object] = {
                    "frames": frames, "question": name, "matches": matches, "unknowns": query.funnel.unknowns,
                    "candidates": query.funnel.candidates, "bindings": query.funnel.over_time["bindings"],
                    "wall_s": round(time.monotonic() - began, 2), "cpu_s": round(_cpu() - cpu, 2),
                    "peak_mb": _peak_mb(resource.RUSAGE_SELF), "worker_peak_mb": _peak_mb(resource.RUSAGE_CHILDREN),
                }  # fmt: skip
                found.append(row)
                print("  " + "  ".join(f"{key} {value}" for key, value in row.items() if key != "frames"))
    results = Path("bench-results")
    results.mkdir(exist_ok=True)
    (results / "intervals.json").write_text(json.dumps({"processors": os.cpu_count(), "rows": found}, indent=1) + "\n")


def _peak_mb(who: int) -> int:
    """The most memory that this process, or any of those that have ended, has had."""
    return round(resource.getrusage(who).ru_maxrss / 1024)


def _cpu() -> float:
    """Processor seconds of this process and of those that have ended."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


if __name__ == "__main__":
    main()
