"""Speed and memory of `scenicq ingest`: generated interchange recordings of growing number, and nuScenes.

`python tests/tools/bench/ingest.py [--frames 2000 20000] [--jobs 1 2] [--nuscenes DIR] [--sources DIR]`. Sources are
made by `fleet.py` and kept in DIR if that is given. Prints, for each source and number of processes, label objects, CPU
seconds of the importing alone and of the whole command, objects a CPU second of both, and the peak memory of its
largest process; then each bar with pass or fail. The numbers go to bench-results/. A CPU second is one of one core,
however many work and whoever else uses the machine; as others slow down its caches, the least of several short runs
counts.
"""

from __future__ import annotations

import argparse
import json
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from clock import Used, cpu_s, run
from fleet import Fleet, write_interchange

from scenicq.importers.ingest import IngestSummary, ingest

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "bench-results"
COMMAND = str(Path(sys.executable).with_name("scenicq"))
NUSCENES = ROOT.parent / "shared" / "data" / "nuscenes-mini"
LEAST_RATE, MOST_GROWTH = 50_000, 1.25
SHORT_S, ROUNDS = 2.0, 10
GENERATED, IMPORTING = "fleet-", "importing"
WHOLE_FROM = 1_000_000
RECORDINGS, SHORT = 10_000, 4
"""Recordings, and frames of each, of a source of many short recordings."""
MOST_OF_WHOLE, MOST_MEMORY, MOST_VERIFY_GROWTH = {"large": 0.3, "many": 0.1}, 1.5, 1.6
"""CPU seconds and memory of an update by one recording, of those of a whole ingest (it reads and writes one segment
again, which is all of the large one), and how many times as much memory ten times as many frames may take to verify."""
BARS_FROM = 10_000
"""Objects from which a rate says something, and frames from which memory may no longer grow."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One source, ingested by so many processes.

    Attributes:
        source, frames, objects, jobs: What.
        import_s, command_s: CPU seconds of the importing alone and of the whole command.
        wall_s: Of the whole command.
        peak_mib: Of the command's largest process.
    """

    source: str
    frames: int
    objects: int
    jobs: int
    import_s: float
    command_s: float
    wall_s: float
    peak_mib: float

    @property
    def rates(self) -> dict[str, float]:
        """Objects a CPU second of the importing and of the whole command."""
        return {IMPORTING: self.objects / self.import_s, "the command": self.objects / self.command_s}


def command(source: Path, target: Path, jobs: int) -> Used:
    """What `scenicq ingest` takes, with all its processes."""
    return run([COMMAND, "ingest", str(source), str(target), "--force", "--quiet", "--jobs", str(jobs)])


def measure(source: Path, jobs: int, folder: Path) -> Measured:
    """Ingest a source as a command, then in this process, where start-up is not counted."""
    runs: list[tuple[Used, float, IngestSummary]] = []
    while not runs or (runs[0][0].cpu_s < SHORT_S and len(runs) < ROUNDS):
        used = command(source, folder / "command", jobs)
        before = cpu_s()
        summary = ingest(source, folder / "here", jobs=jobs, force=True)
        runs.append((used, cpu_s() - before, summary))
    used = min((used for used, _, _ in runs), key=lambda used: used.cpu_s)
    import_s, summary = min(import_s for _, import_s, _ in runs), runs[0][2]
    one = Measured(source.name, summary.frames, summary.objects, jobs, import_s, used.cpu_s, used.wall_s, used.peak_mib)
    print(
        f"  {one.source:14}  {one.frames:>9,} {one.objects:>11,} {jobs:>5} {import_s:>9.2f} {one.command_s:>9.2f}"
        f" {' '.join(f'{rate:>9,.0f}' for rate in one.rates.values())} {one.peak_mib:>7.0f}",
        flush=True,
    )
    return one


def one_more(source: Path, folder: Path) -> tuple[Used, Used, Used]:
    """What an ingest, an update by one recording more, and `info --verify` take."""
    target, grown = folder / "updated", folder / "grown"
    folder.mkdir()
    whole = command(source, target, 1)
    shutil.copytree(source, grown)
    # line by line: what this process holds counts as memory of those that it starts
    with (source / "labels.jsonl").open() as lines, (grown / "labels.jsonl").open("a") as labels:
        first = (line for line in lines if f'"{GENERATED}000001"' in line)
        labels.writelines(line.replace(f"{GENERATED}000001", f"{GENERATED}000001x") for line in first)
    update = run([COMMAND, "ingest", str(grown), str(target), "--update", "--quiet", "--jobs", "1"])
    return whole, update, run([COMMAND, "info", str(target), "--verify"])


def update_bars(sources: list[Path], folder: Path) -> Iterator[tuple[str, bool]]:
    """The same of two sizes and of many short recordings, as ratios."""
    many = folder / f"{GENERATED}many"
    write_interchange(Fleet(RECORDINGS * SHORT, 0, needle=False, length=SHORT), many)
    asked = {"small": sources[0], "large": sources[-1], "many": many}
    found = {name: one_more(source, folder / f"of-{name}") for name, source in asked.items()}
    for name in ("large", "many"):
        whole, update, _ = found[name]
        share = update.cpu_s / whole.cpu_s
        told = f"{update.cpu_s:.1f} of {whole.cpu_s:.1f} CPU s, {share:.2f}, at most {MOST_OF_WHOLE[name]}"
        yield f"{asked[name].name}: one recording more by --update takes {told}", share <= MOST_OF_WHOLE[name]
        share = update.peak_mib / whole.peak_mib
        told = f"{update.peak_mib:.0f} of {whole.peak_mib:.0f} MiB, {share:.2f}, at most {MOST_MEMORY}"
        yield f"{asked[name].name}: one recording more by --update takes {told}", share <= MOST_MEMORY
    sizes = [found[name][2].peak_mib for name in ("small", "large")]
    told = f"{sizes[1] / sizes[0]:.2f} times the memory ({sizes[1]:.0f} MiB)"
    yield (
        f"info --verify of {asked['large'].name} takes {told} of {asked['small'].name}",
        (sizes[1] / sizes[0] < MOST_VERIFY_GROWTH),
    )


def is_whole(one: Measured) -> bool:
    """Whether the start of the command counts: not for generated frames that are few, which any start outweighs."""
    return not one.source.startswith(GENERATED) or one.frames >= WHOLE_FROM


def bars(found: list[Measured]) -> Iterator[tuple[str, bool]]:
    """What is asked, and whether it is met."""
    for one in found:
        for what, rate in one.rates.items():
            if one.objects >= BARS_FROM and (what == IMPORTING or is_whole(one)):
                told = f"{rate:,.0f} objects a CPU second, at least {LEAST_RATE:,}"
                yield f"{one.source}, --jobs {one.jobs}, {what}: {told}", rate >= LEAST_RATE
    generated = [one for one in found if one.source.startswith(GENERATED) and one.frames >= BARS_FROM]
    for jobs in dict.fromkeys(one.jobs for one in generated):
        by_size = sorted((one for one in generated if one.jobs == jobs), key=lambda one: one.frames)
        growth = by_size[-1].peak_mib / by_size[0].peak_mib
        size = by_size[-1].frames / by_size[0].frames
        if size > 1:
            yield f"--jobs {jobs}: {size:.0f} times the frames take {growth:.2f} times the memory", growth < MOST_GROWTH


def main() -> None:
    """Make the sources, measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs="*", default=[2_000, 20_000])
    parser.add_argument("--jobs", type=int, nargs="+", default=[1])
    parser.add_argument("--nuscenes", type=Path, default=NUSCENES)
    parser.add_argument("--sources", type=Path)
    given = parser.parse_args()
    found: list[Measured] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        sources = [given.nuscenes] if given.nuscenes.is_dir() else []
        for frames in sorted(given.frames):
            source = (given.sources or folder) / f"{GENERATED}{frames}"
            if not source.exists():
                write_interchange(Fleet(frames, 0, needle=False), source)
            sources.append(source)
        print("  source             frames     objects  jobs  import s command s  objects/s of both      MiB")
        found += [measure(source, jobs, folder) for source in sources for jobs in given.jobs]
        fleets = [source for source in sources if source.name.startswith(GENERATED)]
        updates = list(update_bars(fleets, folder)) if len(fleets) > 1 else []
    judged = [*bars(found), *updates]
    for what, met in judged:
        print(f"  {'pass' if met else 'FAIL'}  {what}")
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {
        "time": now.isoformat(),
        "python": platform.python_version(),
        "results": [asdict(one) for one in found],
        "bars": [{"bar": what, "met": met} for what, met in judged],
    }
    (RESULTS / f"ingest-{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
