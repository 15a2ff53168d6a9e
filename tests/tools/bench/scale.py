"""Queries at the scale of a fleet: the five sample scenarios and a needle over stores of growing size.

`python tests/tools/bench/scale.py [--frames 10000 100000 1000000] [--jobs N] [--stores DIR]`. Each store is made once
(by `fleet.py`) and kept in DIR if that is given. Prints, for every query, the seconds of the whole command, its CPU
seconds, its peak memory, and the CPU time of the prefilter against a bare scan of the columns that it reads; then
each bar with pass or fail. A store that was not made by the command is checked whole when it is first opened: that is
measured by itself. The numbers go to bench-results/. CPU time counts where others use the machine: a bar in
seconds is met if the CPU seconds, spread over the processors used, are below it.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

import duckdb
from clock import Used, run
from fleet import NEEDLE, Fleet, write_store

from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.prefilter.executor import run_prefilter
from scenicq.query.prefilter.plan import LABELS, MEMBERSHIPS, OBJECTS
from scenicq.store.dataset import Dataset, open_dataset

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "bench-results"
COMMAND = str(Path(sys.executable).with_name("scenicq"))
TOLERANCE = "x=0.25,y=0.25,heading=5deg"
SETTING = ("--classes", "coarse", "--radius", "50")
CORES = 2
MOST_S, MOST_NEEDLE_S, MOST_MIB, MOST_SCANS = 20.0, 5.0, 2048, 3.0
BARS_FROM = 1_000_000
"""Frames from which the bars in seconds count."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One query over one store.

    Attributes:
        scenario, frames: Which.
        wall_s, cpu_s: Of the whole command, with all its processes.
        peak_mib: Of its largest process.
        matches: How many.
        prefilter_s, scan_s: CPU seconds of the prefilter alone and of a bare scan of the columns that it reads.
    """

    scenario: str
    frames: int
    wall_s: float
    cpu_s: float
    peak_mib: float
    matches: int
    prefilter_s: float
    scan_s: float

    @property
    def ratio(self) -> float:
        """The prefilter against the bare scan."""
        return self.prefilter_s / self.scan_s


def command(dataset: Path, scenario: Path, *options: str) -> tuple[Used, int]:
    """What `scenicq match` takes, and its matches."""
    with tempfile.TemporaryFile() as output:
        used = run(
            [COMMAND, "match", str(scenario), str(dataset), "--exit-zero", "--format", "jsonl", *options], output
        )
        output.seek(0)
        return used, sum(1 for _ in output)


def prefilter(dataset: Dataset, scenario: Path, options: MatchOptions) -> tuple[float, float]:
    """CPU seconds of the prefilter, and of a bare scan of its columns, on one connection in turns."""
    query = Query(dataset, read_program(scenario), QueryOptions(options))
    sifted_s = scanned_s = 0.0
    with closing(dataset.connect(threads=1)) as connection:
        for plan in query.plans():
            columns = dict(scanned(plan.sql))
            for block in query.blocks(plan.map):
                started = time.process_time()
                run_prefilter(dataset, connection, plan, block)
                sifted_s += time.process_time() - started
                started = time.process_time()
                for view, names in columns.items():
                    connection.execute(f"SELECT {bare(connection, view, names)} FROM {view}").fetchall()
                scanned_s += time.process_time() - started
    return sifted_s, scanned_s


def bare(connection: duckdb.DuckDBPyConnection, view: str, names: list[str]) -> str:
    """Aggregates that need every value of some columns; the least or greatest would be read off the statistics."""
    kinds = {name: kind for name, kind, *_ in connection.execute(f"DESCRIBE {view}").fetchall()}
    forms = {"VARCHAR": "max(strlen({}))", "DOUBLE[]": "sum(len({}))"}
    return ", ".join(forms.get(kinds[name], "sum({})").format(name) for name in names)


def scanned(sql: str) -> Iterator[tuple[str, list[str]]]:
    """The views that a plan reads, with the columns of each."""
    text = re.sub(r"'[^']*'", "''", sql)
    if OBJECTS in text:
        yield OBJECTS, sorted({"frame", *re.findall(r"\ba\.(\w+)", text)} - {"f", "row", "number", *_roles(text)})
    if MEMBERSHIPS in text:
        yield MEMBERSHIPS, ["frame", "object", "kind", "distance", *(["region"] if "region IN" in text else [])]
    yield LABELS, sorted({"frame", "map", *re.findall(r"\bego\.(\w+)", text)} - {"f", "number", "missed"})


def _roles(text: str) -> set[str]:
    return set(re.findall(r"\ba\.(r\d+)\b", text))


def measure(store: Path, jobs: int, only: set[str]) -> list[Measured]:
    """All queries over one store."""
    dataset = open_dataset(store)
    frames = dataset.manifest.total.frames
    found: list[Measured] = []
    with tempfile.TemporaryDirectory() as folder:
        needle = Path(folder) / "needle.scenic"
        needle.write_text(NEEDLE)
        for scenario in [*sorted((ROOT / "sample_data" / "scenarios").glob("0*.scenic")), needle]:
            if only and scenario.stem not in only and scenario.stem[:2] not in only:
                continue
            plain = scenario == needle
            setting = () if plain else SETTING
            used, matches = command(store, scenario, "--tolerance", TOLERANCE, "--jobs", str(jobs), *setting)
            tolerance = parse_tolerance(TOLERANCE)
            options = MatchOptions(tolerance) if plain else MatchOptions(tolerance, classes="coarse", radius=50.0)
            ran = (used.wall_s, used.cpu_s, used.peak_mib, matches)
            found.append(Measured(scenario.stem, frames, *ran, *prefilter(dataset, scenario, options)))
            show(found[-1])
    return found


def show(one: Measured) -> None:
    """Print one line."""
    print(
        f"  {one.scenario:24} {one.frames:>9,} {one.wall_s:8.1f} {one.cpu_s:8.1f} {one.peak_mib:8.0f} {one.matches:>8,}"
        f" {one.prefilter_s:10.2f} {one.scan_s:8.2f} {one.ratio:6.2f}",
        flush=True,
    )


def bars(found: list[Measured], jobs: int) -> Iterator[tuple[str, bool]]:
    """What is asked, and whether it is met."""
    cores = min(CORES, jobs) if jobs > 1 else 1
    for one in found:
        at = f"{one.scenario} over {one.frames:,} frames"
        if one.frames >= BARS_FROM:
            most = MOST_NEEDLE_S if one.scenario == "needle" else MOST_S
            seconds = min(one.wall_s, one.cpu_s / cores)
            yield f"{at}: {seconds:.1f} s on {cores} cores, at most {most:.0f}", seconds < most
        yield f"{at}: {one.peak_mib:.0f} MiB, at most {MOST_MIB}", one.peak_mib <= MOST_MIB
        # a hundredth of a second says nothing
        if one.scan_s > 0.05:
            yield (
                f"{at}: prefilter {one.ratio:.1f} times a bare scan, at most {MOST_SCANS:.0f}",
                one.ratio <= MOST_SCANS,
            )
        if one.scenario == "needle":
            yield f"{at}: {one.matches} match, exactly 1", one.matches == 1
    least, most_ = min(one.frames for one in found), max(one.frames for one in found)
    for name in dict.fromkeys(one.scenario for one in found) if least < most_ else ():
        small, large = (next(o for o in found if (o.scenario, o.frames) == (name, n)) for n in (least, most_))
        growth, size = large.cpu_s / small.cpu_s, large.frames / small.frames
        yield f"{name}: {size:.0f} times the frames cost {growth:.1f} times as much", growth <= 1.1 * size


def main() -> None:
    """Make the stores, measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs="+", default=[10_000, 100_000])
    parser.add_argument("--jobs", type=int, default=CORES)
    parser.add_argument("--stores", type=Path)
    parser.add_argument("--only", nargs="+", default=[])
    given = parser.parse_args()
    found: list[Measured] = []
    with tempfile.TemporaryDirectory() as temporary:
        for frames in sorted(given.frames):
            store = (given.stores or Path(temporary)) / f"{frames}"
            if not (store / "dataset.json").exists():
                started = time.perf_counter()
                store.parent.mkdir(parents=True, exist_ok=True)
                write_store(Fleet(frames, 0, needle=True), store, CORES)
                print(f"store of {frames:,} frames made in {time.perf_counter() - started:.0f} s", flush=True)
            looked = run([COMMAND, "info", str(store)])
            print(f"store of {frames:,} frames opened first: {looked.cpu_s:.1f} s of CPU, {looked.peak_mib:.0f} MiB")
            print("  scenario                    frames   wall s    CPU s      MiB  matches  prefilter     scan  ratio")
            found += measure(store, given.jobs, set(given.only))
    judged = list(bars(found, given.jobs))
    for what, met in judged:
        print(f"  {'pass' if met else 'FAIL'}  {what}")
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {
        "time": now.isoformat(),
        "python": platform.python_version(),
        "jobs": given.jobs,
        "results": [asdict(one) for one in found],
        "bars": [{"bar": what, "met": met} for what, met in judged],
    }
    (RESULTS / f"scale-{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
