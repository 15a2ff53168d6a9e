"""Queries beside the same questions written by hand in SQL, over the same Parquet files.

`python tests/tools/bench/by_hand.py [--frames N] [--stores DIR] [--only TEXT]`. The questions are those of
`sample_data/scenarios` that SQL can say over the columns of a store, a needle, and ten in the manner of programs that
others have published (`hand_sql.py`). Both run in one process, in turns, when everything is loaded and
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

from fleet import Fleet, write_store
from hand_sql import MACROS, QUESTIONS

from scenicq.errors import Source
from scenicq.garbage import collect_seldom
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match
from scenicq.query.execution.records import json_text, record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "bench-results"
ROUNDS = 3
LONG_S = 10.0
"""What takes longer is measured once."""
MOST_IDS, MOST_WITNESSES = 3.0, 10.0
"""How many times the processor time of the hand-written SQL a query may take: without and with proofs written out."""


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
    # what is written by hand takes any lane where the ego is
    query = Query(dataset, Source("p.scenic", text), QueryOptions(options, lanes="any", proofs=witnesses))
    for plan in query.plans():
        query.blocks(plan.map)
    query.coverage()
    found: set[str] = set()
    started = time.process_time()
    for result in query.results():
        if isinstance(result.verdict, Match):
            found.add(result.frame)
            if witnesses:
                json_text(record(result))  # as the command writes it
    return time.process_time() - started, found


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--stores", type=Path)
    parser.add_argument("--only", default="", help="questions with this in their names")
    given = parser.parse_args()
    # as in the process of the command
    collect_seldom()
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as temporary:
        store = (given.stores or Path(temporary)) / f"{given.frames}"
        if not (store / "dataset.json").exists():
            store.parent.mkdir(parents=True, exist_ok=True)
            write_store(Fleet(given.frames, 0, needle=True), store, 2)
        dataset = open_dataset(store, check=False)
        print("  question                      matches  by hand s  ids s  ratio  with proofs s  ratio")
        for name, question in QUESTIONS.items():
            if given.only not in name:
                continue
            text, options, sql = question.program, question.options, question.sql
            hand, ids, proofs = math.inf, math.inf, math.inf
            for number in range(ROUNDS):
                used, expected = by_hand(dataset, sql)
                hand = min(hand, used)
                used, found = ours(dataset, text, options, witnesses=False)
                ids = min(ids, used)
                if not number or proofs < LONG_S:
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
