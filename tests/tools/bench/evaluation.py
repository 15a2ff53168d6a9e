"""A model evaluated over a fleet: every label object detected, somewhat off, but for some that are missed; and false
boxes, so that 100,000 frames have more than 3 million predictions.

`python tests/tools/bench/evaluation.py [--frames N] [--stores DIR]`. The store is that of `scale.py`. Prints the
seconds of the whole command `scenicq evaluate`, its processor seconds and its memory, and whether they keep to the
bars.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import duckdb
from clock import run
from fleet import Fleet, write_store

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "bench-results"
COMMAND = str(Path(sys.executable).with_name("scenicq"))
SCENARIO = ROOT / "sample_data" / "scenarios" / "04_two_lane_traffic.scenic"
SETTING = ("--classes", "coarse", "--radius", "50", "--tolerance", "x=0.25,y=0.25,heading=5deg")
MOST_S, MOST_MIB, CORES = 60.0, 2048.0, 2
DETECTED = """
    COPY (
        SELECT frame, class, x + 0.3 * sin(hash(id) % 1000) AS x, y + 0.3 * cos(hash(frame) % 1000) AS y,
            heading + 0.02 AS heading, coalesce(width, 1.0) AS width, coalesce(length, 1.0) AS length,
            (hash(frame || id) % 997) / 1000.0 + 0.001 AS score
        FROM read_parquet($objects) WHERE hash(id || frame) % 10 > 0 AND heading IS NOT NULL
        UNION ALL
        SELECT frame, class, x + 7.0, y - 5.0, heading, coalesce(width, 1.0), coalesce(length, 1.0),
            (hash(id || frame) % 499) / 1000.0 + 0.001
        FROM read_parquet($objects) WHERE hash(frame || id) % 8 = 0 AND heading IS NOT NULL
    ) TO '{}' (FORMAT parquet)
"""


def main() -> None:
    """Make what is missing, measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--stores", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        store = (given.stores or Path(temporary)) / f"{given.frames}"
        if not (store / "dataset.json").exists():
            store.parent.mkdir(parents=True, exist_ok=True)
            write_store(Fleet(given.frames, 0, needle=True), store, CORES)
        predictions, results = (Path(temporary) / name for name in ("detected.parquet", "found.jsonl"))
        with duckdb.connect() as connection:
            connection.execute(DETECTED.format(predictions), {"objects": str(store / "objects" / "*.parquet")})
            counted = connection.execute("SELECT count(*) FROM read_parquet(?)", [str(predictions)]).fetchone()
        run([COMMAND, "match", str(SCENARIO), str(store), *SETTING, "-o", str(results), "-q"])
        used = run(
            [COMMAND, "evaluate", str(results), str(store), "--predictions", str(predictions), "--missing", "empty"]
        )
    count = 0 if counted is None else int(counted[0])
    print(f"{given.frames:,} frames, {count:,} predictions: {used.wall_s:.1f} s, {used.cpu_s:.1f} CPU s, "
          f"{used.peak_mib:.0f} MiB")  # fmt: skip
    for what, met in (
        (f"at most {MOST_S:.0f} s on {CORES} cores", min(used.wall_s, used.cpu_s / CORES) <= MOST_S),
        (f"at most {MOST_MIB:.0f} MiB", used.peak_mib <= MOST_MIB),
    ):
        print(f"  {'pass' if met else 'FAIL'}  {what}")
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {"time": now.isoformat(), "frames": given.frames, "predictions": count, **asdict(used)}
    (RESULTS / f"evaluation-{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
