"""Datasets that change, go, lead elsewhere or do not fit their map, through the installed command."""

import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

SAMPLES = Path(__file__).parents[3] / "sample_data"
PROGRAM = SAMPLES / "scenarios" / "02_crossing_cars.scenic"
ALL = ("--all", "--no-prefilter", "--method", "smt", "--exit-zero")
NAMES = ("labels", "objects", "memberships", "sensors", "regions", "lanes", "links", "frame_index", "segments")


def run(*words, **more):
    return subprocess.run([*map(str, words)], capture_output=True, text=True, check=False, **more)


def changed_sample(folder, change):
    """The sample recordings, each label changed in place."""
    shutil.copytree(SAMPLES / "crossroads", folder)
    lines = [json.loads(line) for line in (folder / "labels.jsonl").read_text().splitlines()]
    for label in lines:
        change(label)
    (folder / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in lines))
    return folder


def renamed(label):
    label["id"], label["recording"] = f"other-{label['id']}", f"other-{label['recording']}"


def mirrored(label):
    for each in (label["ego"], *label["objects"]):
        each["position"][0] *= -1
        if each.get("heading") is not None:
            each["heading"] *= -1


@pytest.mark.parametrize("way", [("--jobs", "2"), ("--jobs", "1"), ("--jobs", "1", "--resume")])
@pytest.mark.parametrize("how", ["ingest over it", "swap"])
@pytest.mark.one_in(24)
@pytest.mark.slow
def test_rows_are_of_the_dataset_that_was_asked_about(way, how, command, crossroads, tmp_path):
    """It is replaced at a random moment; results are of the old one, or there are none."""
    other = changed_sample(tmp_path / "other", renamed)
    assert run(command, "ingest", other, tmp_path / "new", "-q").returncode == 0
    chance = random.Random(f"{way}{how}")
    for number in range(3):
        dataset, out = tmp_path / f"d{number}", tmp_path / f"{number}.jsonl"
        shutil.copytree(crossroads, dataset)
        words = [command, "match", PROGRAM, dataset, *ALL, *way, "-o", out]
        with subprocess.Popen([*map(str, words)], stderr=subprocess.PIPE, text=True) as process:
            time.sleep(chance.uniform(0.2, 2.0))
            if how == "swap":
                dataset.rename(tmp_path / f"before{number}")
                shutil.copytree(tmp_path / "new", dataset)
            else:
                assert run(command, "ingest", other, dataset, "--force", "-q").returncode == 0
            _, told = process.communicate(timeout=250)
        assert process.returncode in (0, 2), told
        assert "internal error" not in told
        if process.returncode == 0:
            frames = {json.loads(line)["frame"] for line in out.read_text().splitlines()}
            assert len(frames) == 156
            assert len({frame.startswith("other-") for frame in frames}) == 1
        else:
            assert not out.exists()
            assert re.match(r"error\[store-(damaged|missing|unreachable)\]", told), told


@pytest.mark.parametrize("what", [
    ("match", PROGRAM, "TOWN", *ALL), ("info", "TOWN", "--verify"), ("index", "TOWN"),
    ("explain", PROGRAM, "TOWN", "03-busy-intersection/09"),
    ("match", PROGRAM, "TOWN", "--export", "interchange", "out"),
], ids=lambda what: " ".join(map(str, what[:1])))  # fmt: skip
@pytest.mark.one_in(6)
@pytest.mark.slow
def test_a_dataset_that_is_removed_meanwhile_is_told_in_one_diagnostic(what, command, crossroads, tmp_path):
    chance = random.Random(str(what[0]))
    for number in range(4):
        town = tmp_path / f"town{number}"
        shutil.copytree(crossroads, town)
        words = [str(town if word == "TOWN" else word) for word in what]
        state = {**os.environ, "XDG_STATE_HOME": str(tmp_path / f"state{number}")}  # the first check is made, too
        with subprocess.Popen([command, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                              cwd=tmp_path, env=state) as process:  # fmt: skip
            time.sleep(chance.uniform(0.1, 1.5))
            shutil.rmtree(town, ignore_errors=True)
            _, told = process.communicate(timeout=250)
        assert process.returncode in (0, 1, 2), told
        assert "internal error" not in told
        assert "Traceback" not in told
        assert (told.count("error[") == 1) == (process.returncode == 2), told
        shutil.rmtree(tmp_path / "out", ignore_errors=True)


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.one_in(16)
def test_nothing_is_written_through_a_link(name, command, crossroads, tmp_path):
    dataset, outside = tmp_path / "d", tmp_path / "outside"
    shutil.copytree(crossroads, dataset)
    (dataset / name).rename(outside)
    (dataset / name).symlink_to(outside)
    before = {path: path.read_bytes() for path in outside.iterdir()}
    source = SAMPLES / "crossroads"
    for words in (("index", dataset), ("ingest", source, dataset, "--force"), ("ingest", source, dataset, "--update"),
                  ("match", PROGRAM, dataset), ("info", dataset)):  # fmt: skip
        done = run(command, *words)
        assert (done.returncode, done.stderr.count("error[")) == (2, 1), done.stderr
        assert "link" in done.stderr
        assert {path: path.read_bytes() for path in outside.iterdir()} == before


@pytest.mark.slow
def test_a_mirrored_source_is_told_at_ingest_and_by_info(command, tmp_path):
    source = changed_sample(tmp_path / "source", mirrored)
    made = run(command, "ingest", source, tmp_path / "d")
    told = run(command, "info", tmp_path / "d")
    fits = run(command, "ingest", SAMPLES / "crossroads", tmp_path / "right")
    for done in (made, told):
        assert done.returncode == 0
        assert "map-does-not-fit" in done.stderr + done.stdout
    assert (fits.returncode, "map-does-not-fit" in fits.stderr) == (0, False)


def test_what_an_ingest_writes_is_sound(command, tmp_path):
    """Names of any length: what no dataset may hold is left out and told."""

    def lengthened(label):
        label["objects"][0]["id"] = "x" * 5000
        label["objects"][0]["attributes"] = {"a" * 5000: "b" * 5000}

    source = changed_sample(tmp_path / "source", lengthened)
    made = run(command, "ingest", source, tmp_path / "d")
    assert made.returncode == 0
    assert "record-invalid" in made.stderr
    assert run(command, "info", tmp_path / "d", "--verify").returncode == 0


@pytest.mark.slow
def test_no_solver_command_is_sent_what_few_understand(command, tmp_path):
    seen, source = tmp_path / "seen", changed_sample(tmp_path / "source", lambda label: None)
    lines = (source / "labels.jsonl").read_text().splitlines()
    (source / "labels.jsonl").write_text(next(line for line in lines if "03-busy-intersection/09" in line))
    assert run(command, "ingest", source, tmp_path / "d", "-q").returncode == 0
    (tmp_path / "solver.sh").write_text(f"cat >> {seen}\necho unknown\n")
    (tmp_path / "p.scenic").write_text(
        "model scenic.domains.driving.model\nego = new Car\np = new Point in CircularRegion((3, 4), 2)\n"
        "c = new Car\nrequire abs(angle to p) < 1\nrequire abs((angle from c to p) - 0.3) < 0.5\n"
    )
    words = ("--method", "smt", "--solver", f"sh {tmp_path / 'solver.sh'}", "--no-prefilter", "--jobs", "1")
    done = run(command, "match", tmp_path / "p.scenic", tmp_path / "d", *words)
    assert done.returncode in (0, 1, 3), done.stderr
    assert "(check-sat)" in seen.read_text()
    assert "atan2" not in seen.read_text()


@pytest.mark.slow
def test_a_scheduler_without_workers_is_given_up(command, crossroads, tmp_path):
    pytest.importorskip("distributed", reason="scenicq[dask] is not installed")
    code = (
        "import asyncio, distributed\n"
        "async def main():\n"
        "    async with distributed.Scheduler(host='127.0.0.1', port=0, dashboard=False) as scheduler:\n"
        "        print(scheduler.address, flush=True)\n"
        "        await asyncio.sleep(500)\n"
        "asyncio.run(main())"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as scheduler:
        address = scheduler.stdout.readline().strip()
        try:
            done = run(command, "match", PROGRAM, crossroads, "--engine", f"dask={address}", timeout=250)
        finally:
            scheduler.kill()
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("error[engine-failed]") == done.stderr.count("error[") == 1
