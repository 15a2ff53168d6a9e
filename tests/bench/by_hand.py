"""Queries beside the same questions written by hand in SQL, over the same Parquet files.

`python tests/bench/by_hand.py [--frames N] [--stores DIR]`. The questions are those of `sample_data/scenarios` that SQL
can say over the columns of a store, and a needle. Both run in one process, in turns, when everything is loaded and
compiled: what is compared is the processor time beyond the start. The frames that both find must be the same. The
numbers go to bench-results/.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

from fleet import NEEDLE, Fleet, write_store

from scenicq.errors import Source
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match
from scenicq.query.execution.results import record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "bench-results"
ROUNDS = 3
MOST_IDS, MOST_WITNESSES = 3.0, 10.0
"""How many times the processor time of the hand-written SQL a query may take: without and with proofs written out."""

VEHICLES = "('Car', 'Truck', 'Bicycle')"
"""Classes of the fleet that `--classes coarse` takes for cars."""
MACROS = (
    f"CREATE MACRO turned(a, b) AS least(abs(a - b) % {math.tau}, {math.tau} - abs(a - b) % {math.tau})",
    "CREATE MACRO along(heading, directions, away) AS "
    "len(list_filter(directions, lambda d: turned(heading, d) <= away)) > 0",
    # metres from a point to a rectangle whose sides are parallel to the axes
    "CREATE MACRO off(x, y, x0, x1, y0, y1) AS "
    "sqrt(greatest(x0 - x, x - x1, 0) ** 2 + greatest(y0 - y, y - y1, 0) ** 2)",
)
EGO = f"""
ego AS (
    SELECT * FROM labels WHERE ego_class IN {VEHICLES} AND along(ego_heading, ego_road_directions, radians(20))
    AND frame IN (SELECT frame FROM memberships
                  WHERE object = 'ego' AND kind IN ('lane', 'intersection') AND distance <= 0.25)
)"""
QUESTIONS = {
    "01_pedestrian_facing_ego": f"""
WITH {EGO}
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
JOIN memberships m ON m.frame = a.frame AND m.object = a.id
WHERE a.class = 'Adult' AND a.ego_distance <= 50 AND abs(a.relative_heading) > radians(70)
AND m.kind IN ('lane', 'intersection') AND m.distance <= 0.25""",
    "04_two_lane_traffic": f"""
WITH {EGO},
car AS (SELECT a.*, ego.ego_length FROM objects a JOIN ego USING (frame)
        WHERE a.class IN {VEHICLES} AND a.ego_distance <= 50),
follower AS (SELECT * FROM car WHERE along(heading, road_directions, radians(20))),
leader AS (SELECT * FROM follower
           WHERE off(ego_right, ego_ahead, -1, 1, (ego_length + length) / 2, (ego_length + length) / 2 + 40) <= 0.25),
oncoming AS (SELECT * FROM car
             WHERE off(ego_right, ego_ahead, -10, -1, 0, 50) <= 0.25 AND turned(relative_heading, pi()) <= radians(45))
SELECT DISTINCT o.frame FROM oncoming o JOIN follower s ON s.frame = o.frame AND s.id <> o.id
JOIN leader l ON l.frame = o.frame AND l.id <> o.id AND l.id <> s.id
WHERE off((s.x - o.x) * cos(o.heading) + (s.y - o.y) * sin(o.heading),
          (s.y - o.y) * cos(o.heading) - (s.x - o.x) * sin(o.heading),
          -1, 1, (o.length + s.length) / 2, (o.length + s.length) / 2 + 40) <= 0.25""",
    "needle": """
SELECT DISTINCT a.frame FROM objects a JOIN labels l USING (frame)
WHERE l.ego_class = 'Car' AND along(l.ego_heading, l.ego_road_directions, radians(5))
AND a.class = 'Truck'
AND len(list_filter(a.road_directions, lambda d: turned(a.heading - radians(90), d) <= radians(15))) > 0
AND off(a.ego_right, a.ego_ahead, 0, 0, (l.ego_length + a.length) / 2 + 4, (l.ego_length + a.length) / 2 + 8) <= 0.25
AND l.frame IN (SELECT frame FROM memberships WHERE object = 'ego' AND distance <= 0.25
                AND kind IN ('lane', 'road', 'intersection', 'drivable'))""",
}


def by_hand(dataset: Dataset, sql: str) -> tuple[float, set[str]]:
    """CPU seconds of SQL, and the frames that it finds."""
    connection = dataset.connect()
    for macro in MACROS:
        connection.execute(macro)
    started = time.process_time()
    rows = connection.execute(sql).fetchall()
    used = time.process_time() - started
    connection.close()
    return used, {frame for (frame,) in rows}


def ours(dataset: Dataset, text: str, options: MatchOptions, *, witnesses: bool) -> tuple[float, set[str]]:
    """CPU seconds of a query that is compiled, and the frames that it finds."""
    query = Query(dataset, Source("p.scenic", text), QueryOptions(options))
    for plan in query.plans():
        query.blocks(plan.map)
    query.coverage()
    found: set[str] = set()
    started = time.process_time()
    for result in query.results():
        if isinstance(result.verdict, Match):
            found.add(result.frame)
            if witnesses:
                json.dumps(record(result))
    return time.process_time() - started, found


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--stores", type=Path)
    given = parser.parse_args()
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as temporary:
        store = (given.stores or Path(temporary)) / f"{given.frames}"
        if not (store / "dataset.json").exists():
            store.parent.mkdir(parents=True, exist_ok=True)
            write_store(Fleet(given.frames, 0, needle=True), store, 2)
        dataset = open_dataset(store, check=False)
        print("  question                      matches  by hand s  ids s  ratio  with proofs s  ratio")
        for name, sql in QUESTIONS.items():
            file = ROOT / "sample_data" / "scenarios" / f"{name}.scenic"
            text = NEEDLE if name == "needle" else file.read_text()
            tolerance = parse_tolerance("position=0.25,heading=5deg")
            options = MatchOptions(tolerance)
            if name != "needle":
                options = MatchOptions(tolerance, classes="coarse", radius=50.0)
            hand, ids, proofs = math.inf, math.inf, math.inf
            for _ in range(ROUNDS):
                used, expected = by_hand(dataset, sql)
                hand = min(hand, used)
                used, found = ours(dataset, text, options, witnesses=False)
                ids = min(ids, used)
                proofs = min(proofs, ours(dataset, text, options, witnesses=True)[0])
                if found != expected:
                    odd = sorted(found ^ expected)
                    sys.exit(f"{name}: {len(found)} frames here, {len(expected)} by hand; {odd[:3]}")
            rows.append({"question": name, "matches": len(found), "by hand": hand, "ids": ids, "proofs": proofs})
            print(
                f"  {name:28} {len(found):>8,} {hand:10.2f} {ids:6.2f} {ids / hand:6.1f} {proofs:14.2f}"
                f" {proofs / hand:6.1f}",
                flush=True,
            )
    for row in rows:
        for what, most in (("ids", MOST_IDS), ("proofs", MOST_WITNESSES)):
            ratio = float(str(row[what])) / float(str(row["by hand"]))
            met = "pass" if ratio <= most else "FAIL"
            print(f"  {met}  {row['question']}, {what}: {ratio:.1f} times, at most {most:.0f}")
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {"time": now.isoformat(), "python": platform.python_version(), "frames": given.frames, "results": rows}
    (RESULTS / f"by-hand-{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
