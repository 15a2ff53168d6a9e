"""Time of a picture, and of a report of five hundred matches, in processor seconds of this machine.

Runs on the recordings beside this checkout where there are any, else on the sample data several times over. Prints a
table and writes the numbers to bench-results/.
"""

from __future__ import annotations

import json
import platform
import shutil
import statistics
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

from scenicq.errors import Source
from scenicq.importers.ingest import ingest
from scenicq.match.matcher import Matcher
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.report.backdrop import Backdrop
from scenicq.report.picture import Shot, draw
from scenicq.report.write import write_report
from scenicq.store.dataset import Dataset, open_dataset

ROOT = Path(__file__).parents[3]
RECORDINGS = ROOT.parent / "shared" / "data" / "boston"
RESULTS = ROOT / "bench-results"
MATCHES = 500
PICTURES = 200
PROGRAM = """\
model scenic.domains.driving.model
ego = new Car on network.laneRegion.union(network.intersectionRegion), facing Range(-180, 180) deg
"""
"""Has most frames of any dataset, and tints the roads of its map."""


def sample(folder: Path) -> Path:
    """The sample recordings under several names, as a source."""
    source = folder / "source"
    shutil.copytree(ROOT / "sample_data" / "crossroads", source)
    labels = [json.loads(line) for line in (source / "labels.jsonl").read_text().splitlines()]
    again = [
        {**label, "id": f"{number}/{label['id']}", "recording": f"{number}-{label['recording']}"}
        for number in range(4)
        for label in labels
    ]
    (source / "labels.jsonl").write_text("\n".join(map(json.dumps, again)) + "\n")
    return source


def pictures(dataset: Dataset, query: Query, frames: list[str]) -> list[float]:
    """Milliseconds of each picture, the map and the match apart."""
    found: list[float] = []
    backdrops: dict[str, tuple[Matcher, Backdrop]] = {}
    for label in dataset.labels(frames):
        if label.map not in backdrops:
            scenario, network = query.compile(label.map)
            backdrops[label.map] = Matcher(scenario, query.options.match), Backdrop(network)
        matcher, backdrop = backdrops[label.map]
        shot = Shot(label, matcher.scenario, matcher.match(label))
        draw(shot, backdrop)
        started = time.process_time()
        draw(shot, backdrop)
        found.append(1000 * (time.process_time() - started))
    return found


def main() -> None:
    """Measure, print and keep."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = RECORDINGS if RECORDINGS.is_dir() else sample(folder)
        ingest(source, folder / "dataset")
        dataset = open_dataset(folder / "dataset")
        query = Query(dataset, Source("any.scenic", PROGRAM), QueryOptions(limit=MATCHES))
        results = list(query.results())
        each = pictures(dataset, query, [result.frame for result in results[:PICTURES]])
        started = time.process_time()
        page = write_report(query, results, folder / "report")
        seconds = time.process_time() - started
        size = sum(file.stat().st_size for file in page.parent.rglob("*") if file.is_file())
    found = {
        "picture, median ms": statistics.median(each),
        "picture, slowest ms": max(each),
        "report, s": seconds,
        "report, matches": len(results),
        "report, MB": size / 1e6,
    }
    for what, number in found.items():
        print(f"  {what:22} {number:8.2f}")
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {"time": now.isoformat(), "python": platform.python_version(), "results": found}
    (RESULTS / "pictures.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
