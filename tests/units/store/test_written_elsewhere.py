"""What is written elsewhere: the bytes that are written here, whole or not at all, whatever goes wrong on the way."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.store import remote
from scenicq.store.atomic_files import COMPLETE, whole_file, whole_folder, write_whole
from scenicq.store.manifest import MANIFEST
from scenicq.store.remote_path import RemotePath, any_path

pytest.importorskip("s3fs", reason="scenicq[s3] is not installed")

ROOT = Path(__file__).parents[3]
SAMPLES = ROOT / "sample_data"
PROGRAM = SAMPLES / "scenarios" / "02_crossing_cars.scenic"
FRAME = "03-busy-intersection/09"
MATCH = ("match", PROGRAM, "TOWN", "--classes", "coarse")


@pytest.fixture(autouse=True)
def staged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which lies what is to be sent; nothing is left there unless a message says so."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.chdir(tmp_path)
    return folder


@pytest.fixture
def place(bucket: Any, tmp_path: Path) -> Iterator[str]:
    """A folder of its own in the bucket."""
    name = f"fleet/{tmp_path.name}"
    yield f"s3://{name}"
    clear(bucket, name)


def clear(bucket: Any, address: str) -> None:
    """Remove all that lies in a folder of the bucket."""
    bucket.invalidate_cache()
    for each in bucket.find(address.removeprefix("s3://")):
        bucket.rm_file(each)


def there(bucket: Any, address: str) -> dict[str, bytes]:
    """What lies in a folder of the bucket, or below."""
    root = address.removeprefix("s3://")
    bucket.invalidate_cache()
    return {name.removeprefix(f"{root}/"): bucket.cat_file(name) for name in bucket.find(root)}


def here(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


OUTPUTS: dict[str, tuple[object, ...]] = {
    "lines": (*MATCH, "-o", "OUT/found.jsonl"),
    "csv": (*MATCH, "-o", "OUT/found.csv"),
    "parquet": (*MATCH, "-o", "OUT/found.parquet"),
    "a format": (*MATCH, "--format", "ids", "-o", "OUT/found"),
    "resumed": (*MATCH, "--resume", "-o", "OUT/found.jsonl"),
    "interchange": (*MATCH, "--export", "interchange", "OUT/handed"),
    "openlabel": (*MATCH, "--export", "openlabel", "OUT/handed"),
    "paths": (*MATCH, "--export", "paths", "OUT/handed"),
    "shard": (*MATCH, "--shard", "1/1", "-o", "OUT"),
    "scenes": ("sample", PROGRAM, "-n", "2", "-o", "OUT/scenes"),
    "formulas": ("explain", PROGRAM, "TOWN", FRAME, "--smt2", "OUT/formulas"),
    "picture": ("show", "TOWN", FRAME, "-o", "OUT/frame.svg"),
    "page": ("show", "TOWN", FRAME, "-o", "OUT/frame.html"),
    "report": (*MATCH, "--report", "OUT/report"),
    "dataset": ("ingest", SAMPLES / "crossroads", "OUT/town"),
}
"""What is written, with `OUT` in place of the folder and `TOWN` of the dataset."""
FOLDERS = {"interchange": "handed", "openlabel": "handed", "paths": "handed", "scenes": "scenes", "report": "report"}
"""Outputs that are folders, with their names."""


def words(name: str, out: object, town: Path) -> list[object]:
    given = {"OUT": str(out), "TOWN": str(town)}
    return [str(out) + word[3:] if isinstance(word, str) and word.startswith("OUT") else given.get(str(word), word)
            for word in OUTPUTS[name]]  # fmt: skip


@pytest.mark.parametrize("name", OUTPUTS)
@pytest.mark.parametrize("bad_days", [0, 2])
@pytest.mark.one_in(30)
def test_the_bytes_are_those_that_are_written_here(
    name: str, bad_days: int, run: Any, crossroads: Path, bucket: Any, place: str, faults: Any, staged: Path,
    tmp_path: Path,
) -> None:  # fmt: skip
    """A store that asks for patience now and then changes nothing."""
    (tmp_path / "local").mkdir()
    done = run(*words(name, tmp_path / "local", crossroads))
    assert done.exit_code == 0, done.stderr
    faults.set("503", after=1, times=bad_days)
    sent = run(*words(name, place, crossroads))
    assert (sent.exit_code, sent.stdout) == (0, done.stdout), sent.stderr
    expected, found = here(tmp_path / "local"), there(bucket, place)
    if name in FOLDERS:
        expected[f"{FOLDERS[name]}/{COMPLETE}"] = b""
    assert found.keys() == {each for each in expected if not each.startswith(".")} != set()
    for each, content in expected.items():
        if each.endswith(MANIFEST) and name == "dataset":
            first, second = json.loads(content), json.loads(found[each])
            assert first["provenance"].pop("time") <= second["provenance"].pop("time")
            assert first == second
        elif each == "report/index.html":
            assert len(found[each]) > 1000  # the command and the time stand in it
        elif "segments/" not in each:
            assert found[each] == content, each
    assert not list(staged.iterdir())
    assert not list(tmp_path.rglob("s3:*"))


def test_what_lies_elsewhere_is_gathered_compared_and_read(
    run: Any, crossroads: Path, bucket: Any, place: str, tmp_path: Path
) -> None:
    given = (*MATCH[:2], crossroads, *MATCH[3:])
    whole = run(*given, "--format", "jsonl").stdout
    assert whole
    for number in (2, 3):
        run(*given, "--shard", f"{number}/3", "-o", f"{place}/pieces")
    missing = run("gather", f"{place}/pieces")
    assert (missing.exit_code, "1 of 3 pieces are missing: 1" in missing.stderr) == (2, True)
    run(*given, "--shard", "1/3", "-o", f"{place}/pieces")
    assert run("gather", f"{place}/pieces").stdout == whole
    assert run("gather", f"{place}/pieces", "-o", f"{place}/gathered.parquet").exit_code == 0
    assert run("gather", f"{place}/pieces", "--report", f"{place}/report").exit_code == 0
    assert {"index.html", COMPLETE} <= there(bucket, f"{place}/report").keys()
    run(*given, "-o", f"{place}/found.jsonl")
    alike = run("report", f"{place}/found.jsonl", f"{place}/gathered.parquet")
    assert (alike.exit_code, "0 came" in alike.stdout or "stayed" in alike.stdout) == (0, True), alike.output
    nothing = run("gather", f"{place}/nowhere")
    assert (nothing.exit_code, nothing.stderr.count("error[")) == (2, 1)
    assert "holds no piece" in nothing.stderr
    lost = run("report", f"{place}/found.jsonl", f"{place}/nowhere.jsonl")
    assert (lost.exit_code, lost.stderr.startswith("error[file-missing]")) == (2, True)
    assert f"{place}/nowhere.jsonl" in lost.stderr


def test_scenes_that_are_fetched_are_ingested(run: Any, bucket: Any, place: str, tmp_path: Path) -> None:
    assert run("sample", PROGRAM, "-n", "2", "-o", f"{place}/scenes").exit_code == 0
    for name, content in there(bucket, f"{place}/scenes").items():
        (tmp_path / "fetched" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "fetched" / name).write_bytes(content)
    assert (tmp_path / "fetched" / COMPLETE).exists()
    done = run("ingest", tmp_path / "fetched", tmp_path / "town")
    assert (done.exit_code, "2 frames" in done.stderr, COMPLETE in done.stderr) == (0, True, False), done.stderr


def test_a_dataset_that_is_written_elsewhere_is_read_there(run: Any, crossroads: Path, bucket: Any, place: str) -> None:
    assert run("ingest", SAMPLES / "crossroads", f"{place}/town").exit_code == 0
    given = ("match", PROGRAM, "--classes", "coarse", "--format", "ids")
    assert run(*given, "--", f"{place}/town").stdout == run(*given, "--", crossroads).stdout != ""
    assert run("info", f"{place}/town", "--verify").exit_code == 0
    for more, code in (((), "target-exists"), (("--force",), "option-invalid"), (("--update",), "option-invalid")):
        again = run("ingest", SAMPLES / "crossroads", f"{place}/town", *more)
        assert (again.exit_code, again.stderr.startswith(f"error[{code}]: {place}/town")) == (2, True), again.stderr


@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_elsewhere_is_never_replaced(name: str, run: Any, crossroads: Path, bucket: Any, place: str) -> None:
    bucket.pipe_file(f"{place}/{FOLDERS[name]}/mine".removeprefix("s3://"), b"mine")
    done = run(*words(name, place, crossroads))
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("error[target-exists]")
    assert there(bucket, place) == {f"{FOLDERS[name]}/mine": b"mine"}


WORDS = {
    "503": "cannot be written: ",
    "slow": "nothing answers within 3 s",
    "cut": "cannot be written: ",
    "denied": "cannot be written with these credentials: ",
    "expired": "cannot be written with these credentials: ",
    "unknown key": "cannot be written with these credentials: ",
}


def fails(done: Any, fault: str, place: str) -> None:
    """It is told in one diagnostic, which names credentials where these are the cause."""
    assert done.exit_code == 2, done.output
    assert done.stderr.count("error[") == 1, done.stderr
    assert f"error[target-unwritable]: {place}" in done.stderr
    assert WORDS[fault] in done.stderr
    assert ("AWS_ACCESS_KEY_ID" in done.stderr) == ("credentials" in WORDS[fault])


@pytest.mark.parametrize("fault", WORDS)
@pytest.mark.parametrize("name", ["lines", "resumed", "interchange", "shard", "report", "dataset"])
@pytest.mark.one_in(22)
def test_what_cannot_be_written_is_told_before_the_work(
    name: str, fault: str, run: Any, crossroads: Path, bucket: Any, place: str, faults: Any, staged: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(remote, "_PATIENCE_S", 3)
    faults.set(fault)
    began = time.monotonic()
    done = run(*words(name, place, crossroads))
    assert time.monotonic() - began < 60
    fails(done, fault, place)
    assert done.stdout == ""
    assert "what was to be written" not in done.stderr
    faults.set(None)
    assert there(bucket, place) == {}
    assert not list(staged.iterdir())


@pytest.mark.parametrize("fault", ["503", "cut", "expired"])
@pytest.mark.parametrize("name", ["lines", "shard", "interchange", "report", "dataset", "resumed", "scenes"])
@pytest.mark.one_in(20)
def test_each_file_has_its_turn_to_fail(
    name: str, fault: str, run: Any, crossroads: Path, bucket: Any, place: str, faults: Any, staged: Path, rounds: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Nothing else is there then but whole files, of folders none, and what was to be written is still here."""
    monkeypatch.setattr(remote, "_PATIENCE_S", 1)
    faults.set(None)
    assert run(*words(name, place, crossroads)).exit_code == 0
    requests, whole = faults.seen, there(bucket, place)
    assert requests > 1
    for number in sorted({1 + (requests - 2) * part // 12 for part in range(0, 13, 12 // rounds(12))}):
        clear(bucket, place)
        faults.set(fault, after=number)
        done = run(*words(name, place, crossroads))
        fails(done, fault, place)
        faults.set(None)
        found = there(bucket, place)
        if name in FOLDERS or name == "dataset":
            assert found == {}
        assert found.keys() <= whole.keys() or name == "resumed"
        assert "what was to be written lies in " in done.stderr
        (left,) = staged.iterdir()
        assert str(left) in done.stderr
        shutil.rmtree(left)
        if name == "resumed" or name == "shard":
            again = run(*words(name, place, crossroads))
            assert again.exit_code == 0, again.stderr
            assert there(bucket, place) == whole
    assert not list(staged.iterdir())


@pytest.mark.parametrize("name", [*FOLDERS, "dataset"])
@pytest.mark.one_in(6)
def test_where_nothing_answers_any_more_no_half_looks_whole(
    name: str, run: Any, crossroads: Path, bucket: Any, place: str, faults: Any, staged: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Nobody can take back then what has been sent: the last file is what says that all are there."""
    monkeypatch.setattr(remote, "_PATIENCE_S", 1)
    # a trial comes and goes before the work
    faults.set("cut", after=3, methods=("PUT", "POST", "DELETE"))
    done = run(*words(name, place, crossroads))
    assert done.exit_code == 2
    faults.set(None)
    found = there(bucket, place)
    assert len(found) == 1
    assert not [each for each in found if Path(each).name == (MANIFEST if name == "dataset" else COMPLETE)]
    shutil.rmtree(next(staged.iterdir()))
    again = run(*words(name, place, crossroads))
    assert again.stderr.startswith("error[target-exists]")


def test_without_credentials_they_are_named(run: Any, crossroads: Path, place: str, tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("AWS_")}
    environment |= {"AWS_ENDPOINT_URL": os.environ["AWS_ENDPOINT_URL"], "AWS_EC2_METADATA_DISABLED": "true",
                    "HOME": str(tmp_path), "AWS_DEFAULT_REGION": "us-east-1"}  # fmt: skip
    command = [str(Path(sys.executable).with_name("scenicq")), *map(str, words("lines", place, crossroads))]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=200)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error[target-unwritable]: {place}/found.jsonl cannot be written with these cred")
    assert "AWS_ACCESS_KEY_ID" in done.stderr


RESUMED = """
from scenicq.query.execution import executors
executors.PIECE_FRAMES = 20
from scenicq_cli.main import main
if __name__ == "__main__":
    main()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kills", [1, 10])
@pytest.mark.slow
def test_a_resumed_run_that_is_killed(
    kills: int, run: Any, crossroads: Path, bucket: Any, place: str, tmp_path: Path
) -> None:
    given = [*words("resumed", place, crossroads), "--all", "--no-prefilter", "--jobs", "1"]
    local = [str(tmp_path / "whole.jsonl") if word == f"{place}/found.jsonl" else word for word in given]
    assert run(*local).exit_code == 0
    expected = (tmp_path / "whole.jsonl").read_bytes()
    (tmp_path / "program.py").write_text(RESUMED)

    def start() -> subprocess.Popen[bytes]:
        command = [sys.executable, tmp_path / "program.py", *given]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        return subprocess.Popen([str(word) for word in command], env=environment, stderr=subprocess.DEVNULL)

    pieces, most = 0, 0
    for _ in range(kills):
        process = start()
        while process.poll() is None:
            bucket.invalidate_cache()
            now = len([each for each in bucket.find(place.removeprefix("s3://")) if ".pieces/" in each])
            if now > pieces:
                pieces, most = now, max(most, now)
                process.send_signal(signal.SIGKILL)
            time.sleep(0.02)
        process.wait()
        assert there(bucket, place).get("found.jsonl", expected) == expected
    assert most >= min(2, kills)
    assert start().wait() == 0
    assert there(bucket, place) == {"found.jsonl": expected}


def test_a_block_that_fails_writes_nothing(bucket: Any, place: str, staged: Path) -> None:
    def interrupted(target: Any) -> None:
        if isinstance(target, Path):
            (target / "y").touch()
        raise KeyboardInterrupt

    for whole in (whole_file, whole_folder):
        with pytest.raises(KeyboardInterrupt), whole(any_path(f"{place}/x")) as target:
            interrupted(target)
    assert there(bucket, place) == {}
    assert not list(staged.iterdir())


@pytest.mark.parametrize("large", [1, pytest.param(120_000_000, marks=pytest.mark.slow)])
def test_a_file_is_replaced_at_once_and_a_large_one_comes_in_parts(large: int, bucket: Any, place: str) -> None:
    target = any_path(f"{place}/x y?#%.txt")
    assert isinstance(target, RemotePath)
    for content in ("first", "second", "x" * large):
        write_whole(target, content)
        assert target.read_bytes() == content.encode()
    assert target.with_name("z").address == f"{place}/z"
    assert [each.name for each in any_path(place).iterdir()] == ["x y?#%.txt"]


@pytest.mark.parametrize("address", ["s3://", "s3:///", "laserdisc://a/b"])
def test_what_is_no_place(address: str, bucket: Any) -> None:
    with pytest.raises(DataError) as error:
        any_path(address)
    (told,) = error.value.diagnostics
    assert (told.code, told.message.startswith(address)) == ("option-invalid", True)


def test_a_file_address_is_a_path(run: Any, crossroads: Path, tmp_path: Path) -> None:
    for number, form in enumerate((str, Path.as_uri)):
        assert run(*words("lines", form(tmp_path / f"local {number}?"), crossroads)).exit_code in (0, 2)
    (tmp_path / "a b?").mkdir()
    done = run(*words("lines", (tmp_path / "a b?").as_uri(), crossroads))
    assert done.exit_code == 0, done.stderr
    assert (tmp_path / "a b?" / "found.jsonl").is_file()
