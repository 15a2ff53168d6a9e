"""Ingests side by side, killed, resumed and repeated: always the dataset of one undisturbed ingest."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partialmethod
from pathlib import Path
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.importers import segments
from scenicq.importers.base import LabelChecker
from scenicq.importers.ingest import Progress, ingest
from scenicq.importers.interchange import LineReader
from scenicq.importers.report import Report
from scenicq.importers.segments import Job, RecordingTask, World, write_segments
from scenicq.processes import Workers
from scenicq.store.columns import RecordingColumns, columns_of
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Recording
from scenicq.store.manifest import MANIFEST
from scenicq.store.segment import SegmentWriter
from scenicq.store.verification import verify_computed

ROOT = Path(__file__).parents[3]
RECORDINGS, FRAMES = 24, 26
SEGMENT = 200
"""Small enough for several segments."""

PROGRAM = """
import sys
from scenicq.importers.ingest import ingest
if __name__ == "__main__":
    ingest(sys.argv[1], sys.argv[2], jobs=int(sys.argv[3]), segment_objects=int(sys.argv[4]))
"""


def line(recording: str, number: int, seed: int = 0) -> str:
    chance = random.Random(f"{recording}{number}{seed}")
    members = [
        {
            "id": f"o{n}",
            "class": chance.choice(["Car", "Truck", "Adult"]),
            "track": f"o{n}",
            "position": [round(chance.uniform(-150, 150), 3), round(chance.uniform(-8, 8), 3)],
            "heading": round(chance.uniform(-3, 3), 4),
        }
        for n in range(3)
    ]
    label = {"id": f"{recording}/{number:02}", "recording": recording, "timestamp_us": number * 100_000}
    label |= {"map": "crossroads", "ego": {"position": [0.0, 0.0], "heading": 0.0}, "objects": members}
    return json.dumps(label) + "\n"


def write_source(folder: Path, names: list[str], seeds: dict[str, int] | None = None, frames: int = FRAMES) -> Path:
    shutil.copytree(ROOT / "sample_data" / "crossroads" / "maps", folder / "maps", dirs_exist_ok=True)
    header = {"name": "many", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header))
    lines = [line(name, number, (seeds or {}).get(name, 0)) for name in names for number in range(frames)]
    (folder / "labels.jsonl").write_text("".join(lines))
    return folder


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return write_source(tmp_path / "source", [f"r{number:02}" for number in range(RECORDINGS)])


def contents(dataset: Path) -> dict[str, bytes]:
    """Every file but the manifest's provenance."""
    files = {str(path.relative_to(dataset)): path.read_bytes() for path in dataset.rglob("*") if path.is_file()}
    manifest = json.loads(files[MANIFEST])
    del manifest["provenance"]
    return files | {MANIFEST: json.dumps(manifest).encode()}


@pytest.mark.slow
def test_the_number_of_processes_does_not_matter(source: Path, tmp_path: Path) -> None:
    for jobs in (1, 2, 3):
        ingest(source, tmp_path / f"d{jobs}", jobs=jobs, segment_objects=SEGMENT)
    first = contents(tmp_path / "d1")
    assert len([name for name in first if name.startswith("objects/")]) > 5
    assert contents(tmp_path / "d2") == first
    assert contents(tmp_path / "d3") == first


@pytest.mark.slow
def test_labels_do_not_depend_on_the_parts(source: Path, tmp_path: Path) -> None:
    ingest(source, tmp_path / "many", segment_objects=SEGMENT)
    ingest(source, tmp_path / "one")
    many, one = open_dataset(tmp_path / "many"), open_dataset(tmp_path / "one")
    assert len(one.files("objects")) == 1
    assert list(many.labels()) == list(one.labels())
    chosen = ["r20/03", "r03/25", "nowhere", "r03/00", "r11/07"]
    assert [label.frame for label in many.labels(chosen)] == ["r03/00", "r03/25", "r11/07", "r20/03"]
    rows = "SELECT * FROM memberships ORDER BY ALL"
    assert many.connect().sql(rows).fetchall() == one.connect().sql(rows).fetchall()


def start(source: Path, target: Path, jobs: int) -> subprocess.Popen[bytes]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    script = target.parent / "program.py"
    script.write_text(PROGRAM)
    arguments = [sys.executable, str(script), str(source), str(target), str(jobs), str(SEGMENT)]
    return subprocess.Popen(arguments, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def kill_often(source: Path, tmp_path: Path, kills: int, jobs: int) -> None:
    ingest(source, tmp_path / "undisturbed", segment_objects=SEGMENT)
    target = tmp_path / "d"
    began = time.monotonic()
    with start(source, tmp_path / "timed", jobs) as process:
        assert process.wait() == 0
    whole_s = time.monotonic() - began
    chance = random.Random(kills)
    for _ in range(kills):
        process = start(source, target, jobs)
        time.sleep(chance.uniform(0.2, 1.0) * whole_s)
        process.kill()
        process.wait()
        if target.exists():  # it was quicker than the kill
            assert contents(target) == contents(tmp_path / "undisturbed")
            shutil.rmtree(target)
    ingest(source, target, segment_objects=SEGMENT)
    assert contents(target) == contents(tmp_path / "undisturbed")
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.slow
def test_three_kills(source: Path, tmp_path: Path) -> None:
    kill_often(source, tmp_path, 3, jobs=1)


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("kills", [1, 20])
@pytest.mark.slow
def test_processes_that_are_killed_are_replaced(
    source: Path, tmp_path: Path, kills: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # by chance the same segment may be hit more often than one that kills its processes itself is given
    monkeypatch.setattr(Workers, "run", partialmethod(Workers.run, tries=kills + 1))
    ingest(source, tmp_path / "undisturbed", segment_objects=SEGMENT)
    killed: list[int] = []
    reached: list[int] = []

    def kill(progress: Progress) -> None:
        reached.append(progress.frames)
        children = [child.pid for child in multiprocessing.active_children() if child.pid not in killed]
        if len(killed) < kills and children:
            killed.append(random.choice(children))
            os.kill(killed[-1], signal.SIGKILL)

    ingest(source, tmp_path / "d", jobs=2, segment_objects=SEGMENT, progress=kill)
    assert len(killed) == kills
    assert contents(tmp_path / "d") == contents(tmp_path / "undisturbed")
    assert reached == sorted(reached)
    assert reached[-1] == RECORDINGS * FRAMES


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.slow
def test_a_recording_that_kills_is_named(tmp_path: Path) -> None:
    jobs = [Job(number, (RecordingTask(f"r{number}", "", Deadly()),), str(number)) for number in range(2)]
    (tmp_path / "d").mkdir()
    world = World(tmp_path / "d", {})
    with pytest.raises(DataError, match=r"3 processes .* from `r0` on .* killed"):
        list(write_segments(world, jobs, 2, lambda _, __: None))


class Deadly:
    """A reader that ends its process."""

    def recordings(self, labels: LabelChecker, report: Report) -> Iterator[RecordingColumns]:
        os.kill(os.getpid(), signal.SIGKILL)
        yield columns_of(Recording("never", "", ()))


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("jobs", [1, 2])
def test_eight_kills(source: Path, tmp_path: Path, jobs: int) -> None:
    kill_often(source, tmp_path, 8, jobs)


def killed(source: Path, target: Path, after: int) -> None:
    """An ingest that is killed after some recordings."""
    program = PROGRAM.replace(
        "jobs=int(sys.argv[3])",
        f"progress=lambda p: p.frames >= {after * FRAMES} and os.kill(os.getpid(), 9), jobs=int(sys.argv[3])",
    )
    arguments = [sys.executable, "-c", "import os" + program, str(source), str(target), "1", str(SEGMENT)]
    process = subprocess.run(arguments, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False)
    assert process.returncode == -9
    assert not target.exists()
    assert target.with_name(f".{target.name}.partial").is_dir()


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.slow
def test_finished_recordings_are_not_done_again(source: Path, tmp_path: Path) -> None:
    killed(source, tmp_path / "d", 20)
    summary = ingest(source, tmp_path / "d", segment_objects=SEGMENT)
    assert 15 <= summary.reused <= 20
    assert summary.recordings == RECORDINGS
    ingest(source, tmp_path / "undisturbed", segment_objects=SEGMENT)
    assert contents(tmp_path / "d") == contents(tmp_path / "undisturbed")


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("how", ["force", "other source", "other options"])
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_what_a_killed_ingest_left_is_discarded(source: Path, tmp_path: Path, how: str) -> None:
    killed(source, tmp_path / "d", 20)
    if how == "force":
        summary = ingest(source, tmp_path / "d", force=True, segment_objects=SEGMENT)
    elif how == "other source":
        other = write_source(tmp_path / "other", [f"r{number:02}" for number in range(5)], {"r00": 1, "r04": 1})
        summary = ingest(other, tmp_path / "d", segment_objects=SEGMENT)
    else:
        summary = ingest(source, tmp_path / "d", strict=True, segment_objects=SEGMENT)
    assert summary.reused == 0 if how != "other source" else summary.reused < 5
    assert sorted(path.name for path in tmp_path.iterdir() if path.name.startswith(".")) == []
    assert len(list(open_dataset(tmp_path / "d").labels())) == summary.frames


@pytest.mark.slow
def test_update_reads_what_is_new_or_has_changed(tmp_path: Path) -> None:
    names = [f"r{number:02}" for number in range(RECORDINGS)]
    source = write_source(tmp_path / "source", names[:-2])
    ingest(source, tmp_path / "d", segment_objects=SEGMENT)
    with pytest.raises(DataError, match="exists"):
        ingest(source, tmp_path / "d", segment_objects=SEGMENT)
    write_source(source, ["a", *names], {"r12": 7})
    summary = ingest(source, tmp_path / "d", update=True, segment_objects=SEGMENT)
    assert RECORDINGS / 2 < summary.reused < RECORDINGS
    ingest(source, tmp_path / "fresh", segment_objects=SEGMENT)
    assert contents(tmp_path / "d") == contents(tmp_path / "fresh")
    open_dataset(tmp_path / "d").verify()
    again = ingest(source, tmp_path / "d", update=True, segment_objects=SEGMENT)
    assert again.reused == again.recordings == RECORDINGS + 1


def test_an_update_reads_recordings_of_a_segment_that_are_new_or_have_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All lie in one segment, whose other recordings are copied with what was told of them."""
    names = [f"r{number:02}" for number in range(8)]
    source = write_source(tmp_path / "source", names)
    lines = (source / "labels.jsonl").read_text().splitlines(keepends=True)
    lines[FRAMES * 3] = lines[FRAMES * 3].replace('"id"', '"more": 1, "id"', 1)
    unsound = '{"recording": "r01x", "id": "odd"}\n'
    (source / "labels.jsonl").write_text("".join([unsound, *lines]))
    ingest(source, tmp_path / "d")
    changed = [line for line in lines if '"recording": "r05"' not in line]
    changed = [
        line.replace('"heading": 0.0', '"heading": 0.1') if '"recording": "r06"' in line else line for line in changed
    ]
    new = [line.replace("r02", "r02n") for line in lines if '"recording": "r02"' in line]
    (source / "labels.jsonl").write_text("".join([unsound, *changed, *new]).replace("r00/00", "r07/00"))
    read: list[str] = []
    original = LineReader.recordings

    def recordings(self: LineReader, labels: LabelChecker, report: Report) -> Iterator[RecordingColumns]:
        read.extend(self.lines.runs)
        yield from original(self, labels, report)

    monkeypatch.setattr(LineReader, "recordings", recordings)
    summary = ingest(source, tmp_path / "d", update=True)
    assert {*read} == {"r00", "r02n", "r06", "r07"}  # r07 again, as a label of r00 has the name of one of its own
    ingest(source, tmp_path / "fresh")
    assert contents(tmp_path / "d") == contents(tmp_path / "fresh")
    assert len(open_dataset(tmp_path / "d").files("objects")) == 1
    assert summary.reused == 4
    assert {"record-invalid", "not-read"} <= {each.code for each in summary.left_out}
    verify_computed(open_dataset(tmp_path / "d"))


@pytest.mark.parametrize("largest", [15, 60, 10_000])
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_any_row_of_updates_gives_what_a_fresh_ingest_gives(
    largest: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rounds: Callable[[int], int]
) -> None:
    """Recordings come, go and change anywhere; some are empty, or use each other's frames; some updates are killed."""
    chance = random.Random(largest)
    there = {f"r{chance.randrange(1000):03}": 0 for _ in range(8)}
    copied: list[int] = []
    original = SegmentWriter.copy

    def copy(self: SegmentWriter, recordings: Mapping[str, Sequence[int]], rows: Mapping[str, Any]) -> None:
        copied.append(len(recordings))
        original(self, recordings, rows)

    monkeypatch.setattr(SegmentWriter, "copy", copy)
    for number in range(rounds(16)):
        monkeypatch.setattr(segments, "_COPIED", chance.choice([1, 25, 1000]))
        for _ in range(chance.randrange(3) if number else 0):
            there[f"r{chance.randrange(1000):03}"] = 0
            del there[chance.choice(sorted(there))]
            there[chance.choice(sorted(there))] = number
        source = write_source(tmp_path / "source", sorted(there), there, frames=3)
        with (source / "labels.jsonl").open("a") as labels:
            for name in chance.sample(sorted(there), 2):
                other = chance.choice(sorted(there))
                unsound = json.dumps({"recording": f"{name}x", "id": "odd"}) + "\n"
                labels.write(chance.choice(["", unsound, line(name, 7).replace(f"{name}/07", f"{other}/01")]))
        if number and chance.random() < 0.3:
            update_and_kill(source, tmp_path / "d", chance.randrange(3 * len(there)), largest)
        ingest(source, tmp_path / "d", update=bool(number), segment_objects=largest)
        ingest(source, tmp_path / "fresh", force=True, segment_objects=largest)
        assert without_lines(contents(tmp_path / "d")) == without_lines(contents(tmp_path / "fresh"))
        verify_computed(open_dataset(tmp_path / "d"))
    assert max(copied) > (largest > 15)


def without_lines(files: dict[str, bytes]) -> dict[str, bytes]:
    """Messages about what is not read again name lines as they were."""
    return {name: re.sub(rb"(labels\.jsonl):\d+", rb"\1", content) for name, content in files.items()}


def update_and_kill(source: Path, target: Path, after: int, largest: int) -> None:
    """An update that is killed after some frames, or is done before."""
    killing = f"update=True, progress=lambda p: p.frames < {after} or os.kill(os.getpid(), 9), jobs="
    arguments = [sys.executable, "-c", "import os" + PROGRAM.replace("jobs=", killing)]
    arguments += [str(source), str(target), "1", str(largest)]
    run = subprocess.run(arguments, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False)
    assert run.returncode in (0, -9)


def test_an_update_reads_recordings_whose_map_has_changed(tmp_path: Path) -> None:
    """Each recording has a map of its own."""

    def write(numbers: range, shifted: int | None = None) -> Path:
        folder = write_source(tmp_path / "source", [])
        street = json.loads(next((folder / "maps").glob("*.geojson")).read_text())
        lines: list[str] = []
        for number in numbers:
            features = street["features"][number == shifted :]
            (folder / "maps" / f"m{number}.geojson").write_text(json.dumps({**street, "features": features}))
            lines += [line(f"r{number}", frame).replace('"crossroads"', f'"m{number}"') for frame in range(FRAMES)]
        (folder / "labels.jsonl").write_text("".join(lines))
        return folder

    def updated(source: Path, name: str) -> int:
        reused = ingest(source, tmp_path / "d", update=True, segment_objects=SEGMENT).reused
        ingest(source, tmp_path / name, segment_objects=SEGMENT)
        assert contents(tmp_path / "d") == contents(tmp_path / name)
        return reused

    assert updated(write(range(2)), "two") == 0
    assert updated(write(range(3)), "three") == 2
    assert updated(write(range(3), shifted=1), "shifted") == 2
    (tmp_path / "source" / "maps" / "m2.geojson").unlink()
    assert updated(tmp_path / "source", "gone") == 2
    assert updated(write(range(3), shifted=1), "again") == 2


def test_an_update_copies_nothing_of_a_file_that_has_changed(tmp_path: Path) -> None:
    source = write_source(tmp_path / "source", ["a", "b"])
    ingest(source, tmp_path / "d")
    (file,) = (tmp_path / "d" / "objects").iterdir()
    content = bytearray(file.read_bytes())
    content[len(content) // 3] ^= 1
    file.write_bytes(content)
    write_source(source, ["a", "b", "c"])
    summary = ingest(source, tmp_path / "d", update=True)
    assert summary.reused == 0
    ingest(source, tmp_path / "fresh")
    assert contents(tmp_path / "d") == contents(tmp_path / "fresh")


def test_an_interrupted_update_changes_nothing(source: Path, tmp_path: Path) -> None:
    ingest(source, tmp_path / "d", segment_objects=SEGMENT)
    before = contents(tmp_path / "d")
    write_source(source, ["new", *(f"r{number:02}" for number in range(RECORDINGS))])

    def interrupt(progress: Progress) -> None:
        if progress.frames > 5 * FRAMES:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ingest(source, tmp_path / "d", update=True, progress=interrupt, segment_objects=SEGMENT)
    assert contents(tmp_path / "d") == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d", "source"]


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.one_in(2)
@pytest.mark.slow
def test_a_frame_name_that_two_recordings_use(source: Path, tmp_path: Path, jobs: int) -> None:
    text = (source / "labels.jsonl").read_text()
    (source / "labels.jsonl").write_text(text.replace('"id": "r20/05"', '"id": "r02/07"'))
    summary = ingest(source, tmp_path / "d", jobs=jobs, segment_objects=SEGMENT)
    assert summary.frames == RECORDINGS * FRAMES - 1
    (told,) = (each for each in summary.diagnostics if each.code == "record-invalid")
    assert "label id `r02/07` is used twice" in told.message
    assert [label.recording for label in open_dataset(tmp_path / "d").labels(["r02/07"])] == ["r02"]
    with pytest.raises(DataError, match="used twice"):
        ingest(source, tmp_path / "e", jobs=jobs, segment_objects=SEGMENT, strict=True)
