"""The programs that Scenic's repository publishes, over recordings: is every label decided, and how soon?

    python tests/tools/bench/published.py CHECKOUT DATASET... [--labels N] [--only TEXT]

Each dynamic or static program of `examples/driving` and `examples/carla` of a checkout is compiled on the maps of the
datasets, as `--initial`, and matched with labels spread evenly over each dataset, without a prefilter. Prints for each
program the verdicts, the processor time of compiling it and of its labels (median and worst), worst first, and what
reading the maps took; writes `published.json` to bench-results/. What a map lacks for a program is said.
"""

from __future__ import annotations

import argparse
import itertools
import json
import platform
import statistics
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "tests" / "tools" / "conformance"))

from patience import OutOfPatienceError, patience  # noqa: E402

from scenicq.compiler.named_map import named_map  # noqa: E402
from scenicq.compiler.program import compile_scenario  # noqa: E402
from scenicq.errors import ScenarioError, Source  # noqa: E402
from scenicq.geometry.network import Network  # noqa: E402
from scenicq.match.matcher import Matcher  # noqa: E402
from scenicq.match.options import MatchOptions  # noqa: E402
from scenicq.store.dataset import open_dataset  # noqa: E402
from scenicq.store.labels import Label  # noqa: E402

FOLDERS = ("examples/driving", "examples/carla")
LIMIT_S = 20.0
"""Processor time after which a label counts as late."""


def programs(checkout: Path) -> list[Path]:
    """The published programs; what names no map is a library of theirs."""
    paths = sorted(path for folder in FOLDERS for path in (checkout / folder).rglob("*.scenic"))
    return [path for path in paths if named_map(Source(path.name, path.read_text(encoding="utf-8"))) is not None]


def spread(dataset: Path, count: int) -> list[Label]:
    """Labels at even distances."""
    opened = open_dataset(dataset)
    step = max(1, sum(1 for _ in opened.labels()) // count)
    return list(itertools.islice(opened.labels(), 0, step * count, step))


def networks(dataset: Path, labels: list[Label]) -> tuple[dict[str, Network], float]:
    """The maps of some labels, and the processor time that reading them takes."""
    opened, started = open_dataset(dataset), time.process_time()
    found = {name: opened.network(name) for name in dict.fromkeys(label.map for label in labels)}
    return found, time.process_time() - started


def measured(path: Path, labels: list[Label], maps: dict[str, Network]) -> dict[str, Any]:
    """What comes of one program on the labels of one dataset."""
    source = Source(str(path), path.read_text(encoding="utf-8"))
    matchers: dict[str, Matcher] = {}
    compiling, verdicts, times = 0.0, Counter[str](), list[float]()
    for name, network in maps.items():
        started = time.process_time()
        try:
            scenario = compile_scenario(source, network, initial=True)
        except ScenarioError as error:
            return {"refused": str(error).splitlines()[0]}
        compiling = max(compiling, time.process_time() - started)
        matchers[name] = Matcher(scenario, MatchOptions(classes="coarse"))
    for label in labels:
        started = time.process_time()
        try:
            with patience(LIMIT_S):
                verdicts[type(matchers[label.map].match(label)).__name__] += 1
        except OutOfPatienceError:
            verdicts["late"] += 1
        times.append(time.process_time() - started)
    worst = max(times, default=0.0)
    return {"compile": compiling, "median": statistics.median(times), "worst": worst, "verdicts": dict(verdicts)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path, help="a checkout of Scenic's repository")
    parser.add_argument("datasets", type=Path, nargs="+", help="datasets with maps, as `scenicq ingest` makes them")
    parser.add_argument("--labels", type=int, default=20, help="labels of each dataset")
    parser.add_argument("--only", default="", metavar="TEXT", help="programs whose path has this in it")
    arguments = parser.parse_args()
    wanted = [path for path in programs(arguments.checkout) if arguments.only in str(path)]
    found: dict[str, Any] = {"machine": platform.platform(), "labels": arguments.labels}
    for dataset in arguments.datasets:
        labels = spread(dataset, arguments.labels)
        maps, reading = networks(dataset, labels)
        rows = {str(path.relative_to(arguments.checkout)): measured(path, labels, maps) for path in wanted}
        found[dataset.name] = {"map": reading, "programs": rows}
        print(f"{dataset.name}: {len(labels)} labels, maps read in {reading:.2f} s")
        for name, row in sorted(rows.items(), key=lambda item: -item[1].get("worst", 0.0)):
            if "refused" in row:
                print(f"  {name:<62} {row['refused']}")
            else:
                times = f"compile {row['compile']:.2f} median {row['median']:.4f} worst {row['worst']:.3f}"
                print(f"  {name:<62} {times} {row['verdicts']}", flush=True)
    results = ROOT / "bench-results"
    results.mkdir(exist_ok=True)
    (results / "published.json").write_text(json.dumps(found, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
