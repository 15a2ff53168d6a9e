"""Fuzzes all importers and map readers for some minutes: `python fuzz.py --minutes 60 --seed 1 --crashes FOLDER`.

Each case is a sample source with a few changes, read in a process of its own with limits of time and memory. A case is
a crash if it ends with anything but a dataset that can be used or a `DataError`, takes more than 20 s or 1 GB, leaves
something behind, or opens a file outside of what it was given. Each crash is kept: the source, what it said and its
number; `--only N` runs one case again. Linux only. Maps in OpenDRIVE get as far as Scenic's parser where that is
installed, and else to the message that says so.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import random
import resource
import shutil
import sys
import sysconfig
import tempfile
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from source_mutations import mutate_source

from scenicq import read_program
from scenicq.errors import DataError, ScenicqError
from scenicq.exporters.export import Exporter
from scenicq.importers.ingest import ingest
from scenicq.query.execution.run import Query
from scenicq.store.dataset import open_dataset

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))
from rounds import Round, attend

REPOSITORY = Path(__file__).resolve().parents[3]
SAMPLES = REPOSITORY / "sample_data"
FORMATS = {
    "crossroads": "interchange",
    "nuscenes_tiny": "nuscenes",
    "argoverse2_tiny": "argoverse2",
    "forecasting_tiny": "argoverse2-forecasting",
    "waymo_tiny": "waymo",
    "commonroad_tiny": "commonroad",
    "kitti_tiny": "kitti",
    "openlabel_tiny": "openlabel",
    "interaction_tiny": "interaction",
    "street.xodr": "interchange",
}
"""The importer of each sample; of a map, that of the labels which lie on it."""
LONGEST_S = 20.0
MOST_BYTES = 1 << 30
# Processor time is what counts: a machine may be busy.
PATIENCE_S = 1800
EXPORTS = ("interchange", "openlabel", "paths")


class Outside(Exception):
    """A case touched what is none of its business."""


def prepare(name: str, folder: Path, random: random.Random) -> None:
    """Make the changed copy."""
    root = folder / "source"
    is_map = name.endswith(".xodr")
    shutil.copytree(SAMPLES / ("crossroads" if is_map else name), root)
    if is_map or name == "crossroads":
        _shrink(root, random)
    if is_map:
        root = folder / "given"
        root.mkdir()
        shutil.copy(Path(__file__).with_name(name), root)
    mutate_source(root, folder / "outside.txt", random)


def run_case(name: str, folder: Path, random: random.Random) -> str:
    """Ingest the changed copy and use what comes of it; the result is how it ended."""
    root = folder / "source"
    options: dict[str, Any] = {"format": FORMATS[name], "strict": random.random() < 0.1}
    if random.random() < 0.3:
        options["ego"] = random.choice(["nearest", "none", "1", "\ud800", "ego"])
    if random.random() < 0.1:
        given = Path(shutil.copy(SAMPLES / "crossroads" / "maps" / "crossroads.geojson", folder / "given.geojson"))
        options["maps"] = [f"{random.choice(['tiny-town', 'x', '../x', 'TINY_Street'])}={given}"]
    if name.endswith(".xodr"):
        options["maps"] = [f"crossroads={file}" for file in sorted((folder / "given").rglob("*")) or ["none.xodr"]]
    if random.random() < 0.05:
        options["format"] = None
    files = _files(root)
    target = folder / "out" / "d"
    target.parent.mkdir()
    try:
        summary = ingest(root, target, **options)
        told = [diagnostic.message for diagnostic in summary.diagnostics]
    except DataError as error:
        told = [diagnostic.message for diagnostic in error.diagnostics]
        assert not list(target.parent.iterdir()), "an ingest that failed left something behind"
        end = "refused"
    else:
        assert [path.name for path in target.parent.iterdir()] == ["d"], "the ingest left something beside the target"
        end = "told" if told else "sound"
        _use(target, summary.frames, folder / "again", random)
    assert _files(root) == files, "the source has changed"
    assert all(told), "a diagnostic says nothing"
    assert not any("Traceback" in text or "\x1b" in text for text in told), "a diagnostic is no text for people"
    return end


def _shrink(root: Path, random: random.Random) -> None:
    """A few labels in one of the spellings of the format: the whole town takes long, and tells no more."""
    file = root / "labels.jsonl"
    lines = file.read_bytes().splitlines(keepends=True)
    start = random.randrange(len(lines) - 20)
    kept = lines[start : start + 20]
    match random.randrange(4):
        case 0:
            file.unlink()
            (root / "labels.jsonl.gz").write_bytes(gzip.compress(b"".join(kept)))
        case 1:
            file.unlink()
            pq.write_table(pa.Table.from_pylist([json.loads(line) for line in kept]), root / "labels.parquet")
        case 2:
            file.unlink()
            (root / "labels-1.jsonl").write_bytes(b"".join(kept[::2]))
            (root / "labels-2.jsonl").write_bytes(b"".join(kept[1::2]))
        case _:
            file.write_bytes(b"".join(kept))


def _use(target: Path, frames: int, again: Path, random: random.Random) -> None:
    dataset = open_dataset(target)
    labels = list(dataset.labels())
    assert len(labels) == frames, "the dataset has another number of frames than it says"
    for name in dataset.maps:
        network = dataset.network(name)
        for label in labels[:3]:
            network.roadDirection.values(label.ego.x, label.ego.y)
    if random.random() < 0.2:
        scenario = random.choice(sorted((SAMPLES / "scenarios").glob("*.scenic")))
        kind = random.choice(EXPORTS)
        try:
            export = Exporter(kind, dataset, again, scenario.stem)
            for result in Query(dataset, read_program(scenario)).results():
                export.add(result)
            export.finish()
            if kind == "interchange" and export.matched:
                ingest(again, again.with_name("second"))
        except ScenicqError as error:
            told = str(error)
            assert "Traceback" not in told


def _files(root: Path) -> list[tuple[str, int, int]]:
    found = ((path, path.lstat()) for path in sorted(root.rglob("*")))
    return [(os.fsencode(path).hex(), state.st_size, state.st_mtime_ns) for path, state in found]


def _guard(folder: Path) -> None:
    """Raise where Python code opens or changes a file elsewhere, starts a process or opens a connection."""
    allowed = [folder, REPOSITORY, *(Path(sysconfig.get_path(key)) for key in ("stdlib", "platlib", "purelib"))]
    starts = tuple(str(path) for path in [*allowed, "/proc", "/sys", "/dev/null", "/usr", "/etc/localtime", sys.prefix])
    changes = {
        "os.mkdir",
        "os.rename",
        "os.remove",
        "os.rmdir",
        "os.link",
        "os.symlink",
        "os.truncate",
        "shutil.rmtree",
    }
    # Solvers run in processes of their own, with a Python of ours; nothing else may start any.
    never = {"os.system", "os.exec", "os.fork", "os.posix_spawn", "socket.connect", "socket.bind"}

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        if event in never or (event == "subprocess.Popen" and os.fspath(arguments[0]) != sys.executable):
            raise Outside(f"{event} {arguments}")
        if event != "open" and event not in changes:
            return
        if not isinstance(arguments[0], str | bytes | os.PathLike):
            return
        path = os.path.realpath(os.fsdecode(arguments[0]))
        writes = event in changes or (isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR))
        # A link is followed: it was made by whoever unpacked the source, and big ones are often kept elsewhere.
        if path != os.devnull and not path.startswith(str(folder) if writes else starts):
            raise Outside(f"{event} {path}")

    sys.addaudithook(watch)


def _child(name: str, folder: Path, seed: str) -> None:
    """Runs in the new process; ends it."""
    said = os.open(folder / "said.txt", os.O_WRONLY | os.O_CREAT)
    os.dup2(said, 1)
    os.dup2(said, 2)
    status = 1
    try:
        resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
        resource.setrlimit(resource.RLIMIT_CPU, (int(LONGEST_S) * 2, int(LONGEST_S) * 2))
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30, 1 << 30))
        tempfile.tempdir = str(folder)
        os.chdir(folder)
        chance = random.Random(seed)
        prepare(name, folder, chance)
        _guard(folder)
        print(run_case(name, folder, chance), flush=True)
        status = 0
    except BaseException:  # whatever it is, it is the finding
        traceback.print_exc()
        sys.stderr.flush()
    os._exit(status)


def main() -> int:
    """Run cases until the time is over; the exit code says whether there was a crash."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--only", type=int, help="run one case, and keep its folder")
    parser.add_argument("--sample", choices=FORMATS, help="one sample instead of all in turn")
    parser.add_argument("--crashes", type=Path, default=Path("crashes"))
    options = parser.parse_args()
    samples = [options.sample] if options.sample else list(FORMATS)
    ends: Counter[tuple[str, str]] = Counter()
    crashes = 0
    number = options.first if options.only is None else options.only

    def figures() -> str:
        lines = [f"{name:20} {end:8} {count}" for (name, end), count in sorted(ends.items())]
        return "\n".join([f"{ends.total()} cases, {crashes} crashes", *lines])

    attack = Round(options.minutes, figures)
    while attack.goes_on():
        name = samples[number % len(samples)]
        folder = Path(os.path.realpath(tempfile.mkdtemp(prefix="fuzz-")))
        (folder / "outside.txt").write_text('{"outside": 1}')
        child = os.fork()
        if child == 0:
            _child(name, folder, f"{options.seed}:{number}")
        status, usage, hung = attend(child, PATIENCE_S)
        spent = usage.ru_utime + usage.ru_stime
        attack.took(spent)
        said = (folder / "said.txt").read_text(errors="replace")
        why = "hang" if hung or spent > LONGEST_S else "memory" if usage.ru_maxrss * 1024 > MOST_BYTES else ""
        if why or status != 0:
            crashes += 1
            ends[name, "CRASH"] += 1
            print(
                f"case {number} ({name}): {why or 'crash'} {spent:.1f} s, {said.strip().splitlines()[-1:]}", flush=True
            )
            shutil.copytree(folder, options.crashes / f"{options.seed}-{number}-{name}", symlinks=True, ignore=_special)
        else:
            ends[name, said.strip().splitlines()[-1]] += 1
        if options.only is not None:
            print(said, folder)
            break
        shutil.rmtree(folder)
        number += 1
    return bool(crashes)


def _special(folder: str, names: list[str]) -> list[str]:
    """Pipes and the like, which cannot be copied."""
    paths = {name: Path(folder, name) for name in names}
    return [name for name, path in paths.items() if not (path.is_symlink() or path.is_file() or path.is_dir())]


if __name__ == "__main__":
    sys.exit(main())
