"""Paths with bytes that are not UTF-8, and an ASCII locale: one diagnostic, not one of what is inside."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq.query.execution.result_files import read_records

ROOT = Path(__file__).parents[3]
SOURCE = ROOT / "sample_data" / "crossroads"
PROGRAM = ROOT / "sample_data" / "scenarios" / "02_crossing_cars.scenic"
ASCII = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}


def run(*arguments: bytes | str | Path, env: dict[str, str]) -> tuple[int, str]:
    command = [Path(sys.executable).with_name("scenicq"), *arguments]
    done = subprocess.run(command, env={**os.environ, **env}, capture_output=True, timeout=100, check=False)
    return done.returncode, done.stderr.decode(errors="backslashreplace")


@pytest.mark.parametrize(("name", "env"), [(b"n\xff", {}), ("ünï".encode(), ASCII)])
@pytest.mark.one_in(2)
def test_a_dataset_at_a_path_that_is_no_text(name: bytes, env: dict[str, str], tmp_path: Path) -> None:
    place = os.fsencode(tmp_path) + b"/" + name
    code, told = run("ingest", SOURCE, place, env=env)
    assert (code, told.count("error[")) == (2, 1), told
    assert "error[target-unwritable]" in told
    assert "is not text in UTF-8" in told
    assert not os.path.exists(place)
    ingest(SOURCE, tmp_path / "d")
    shutil.move(os.fsencode(tmp_path / "d"), place)
    code, told = run("match", PROGRAM, place, env=env)
    assert (code, told.count("error[")) == (2, 1), told
    assert "error[store-missing]" in told
    assert "is not text in UTF-8" in told


@pytest.mark.parametrize(("name", "env"), [(b"n\xff", {}), ("ünï".encode(), ASCII)])
def test_a_source_at_such_a_path_is_read(name: bytes, env: dict[str, str], tmp_path: Path) -> None:
    place = os.fsencode(tmp_path) + b"/" + name
    shutil.copytree(os.fsencode(SOURCE), place)
    code, told = run("ingest", place, tmp_path / "d", env=env)
    assert code == 0, told


@pytest.mark.parametrize("form", ["jsonl", "csv", "parquet"])
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_results_name_a_program_at_such_a_path(form: str, tmp_path: Path) -> None:
    ingest(SOURCE, tmp_path / "d")
    program = os.fsencode(tmp_path) + b"/n\xff.scenic"
    Path(os.fsdecode(program)).write_text(
        "model scenic.domains.driving.model\nego = new Car\nrequire ego.speed > 1e6\n"
    )
    code, told = run("match", program, tmp_path / "d", "--all", "-o", tmp_path / f"r.{form}", env={})
    assert code == 1, told
    causes = {each.cause.place for each in read_records(tmp_path / f"r.{form}") if each.cause}
    assert "n\\udcff.scenic:3:1" in causes
