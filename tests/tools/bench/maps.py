"""Queries over recordings with a map each, beside the same with one map.

`python tests/tools/bench/maps.py [--maps N]`. Recordings and map are of `sample_data/crossroads`, moved from one to the
next. What is compared is the processor time of a query that is compiled anew, and the most memory that it takes. The
numbers go to bench-results/.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from fleet import moved

from scenicq.errors import Source
from scenicq.garbage import collect_seldom
from scenicq.importers.ingest import ingest
from scenicq.query.execution.records import json_text, record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.columns import RecordingColumns, columns_of
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Recording
from scenicq.store.writer import DatasetWriter

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "bench-results"
MOST_MS, MOST_MB = 10.0, 40.0
"""Processor time a map, and memory in all, beyond those of one map."""

MODEL = "model scenic.domains.driving.model\nego = new Car\n"
QUESTIONS = {
    "beside the ego": f"{MODEL}other = new Car at ego offset by Range(-4, 4) @ Range(2, 30)",
    "on the road": f"{MODEL}other = new Car on road, facing Range(-20, 20) deg relative to roadDirection",
    "ahead in the lane of the ego": f"{MODEL}other = new Car on ego.lane, facing Range(-20, 20) deg relative to "
    "ego.heading\nrequire 5 < (distance to other) < 20",
    "in the lane of the ego": f"{MODEL}other = new Car on ego.lane\nrequire (distance to other) < 30",
}


def write_store(folder: Path, count: int) -> None:
    """A dataset of so many recordings with a map each."""
    folder.mkdir()
    ingest(ROOT / "sample_data/crossroads", folder / "source")
    source = open_dataset(folder / "source", check=False)
    features = source.features(source.maps[0])
    labels = list(source.labels())[::6]
    columns = columns_of(Recording("", "", tuple(labels)))
    places = {f"map{number:06}": (900.0 * (number % 40), 900.0 * (number // 40)) for number in range(count)}
    maps = {name: tuple(moved(each, "", *at) for each in features) for name, at in places.items()}
    with DatasetWriter(folder / f"maps-{count}", maps) as writer:
        for name, at in places.items():
            writer.add(_moved_recording(columns, name, *at))
        writer.finish(name="maps")


def _moved_recording(columns: RecordingColumns, name: str, dx: float, dy: float) -> RecordingColumns:
    members = {
        what: replace(each, x=each.x + dx, y=each.y + dy)
        for what, each in (("egos", columns.egos), ("objects", columns.objects))
    }
    frames = [f"{name}/{number}" for number in range(len(columns.frames))]
    times = range(0, 100_000 * len(frames), 100_000)
    return replace(columns, name=name, map=name, frames=frames, times_us=times, **members)


def ask(folder: Path, text: str, *, proofs: bool) -> None:
    """Ask a question, and print processor time, memory and matches."""
    collect_seldom()
    started, matches = time.process_time(), 0
    options = QueryOptions(proofs=proofs, reasons=proofs, interval_reasons=proofs)
    for result in Query(open_dataset(folder, check=False), Source("p.scenic", text), options).results():
        matches += 1
        if proofs:
            json_text(record(result))
    used = time.process_time() - started
    # what `resource` says is at least that of the process which has started this one
    peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    print(json.dumps({"seconds": used, "megabytes": int(peak.split()[1]) / 1024, "matches": matches}))


def asked(folder: Path, name: str, form: str) -> dict[str, float]:
    """The same in a process of its own."""
    command = [sys.executable, __file__, "--ask", str(folder), name, form]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=1000)
    parser.add_argument("--ask", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.ask:
        folder, name, form = given.ask
        ask(Path(folder), QUESTIONS[name], proofs=form == "proofs")
        return
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as temporary:
        for count in (1, given.maps):
            write_store(Path(temporary) / str(count), count)
        for name in QUESTIONS:
            for form in ("ids", "proofs"):
                one, many = (asked(Path(temporary) / str(n) / f"maps-{n}", name, form) for n in (1, given.maps))
                each_ms = (many["seconds"] - one["seconds"]) / (given.maps - 1) * 1000
                more_mb = many["megabytes"] - one["megabytes"]
                met = "pass" if each_ms <= MOST_MS and more_mb <= MOST_MB else "FAIL"
                print(f"  {met}  {name}, {form}: {each_ms:.2f} ms a map, {more_mb:.0f} MB more, {many['matches']:,}",
                      flush=True)  # fmt: skip
                rows.append({"question": name, "form": form, "ms": each_ms, "megabytes": more_mb})
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {"time": now.isoformat(), "python": platform.python_version(), "maps": given.maps, "results": rows}
    (RESULTS / f"maps-{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
