"""Something changed: an ingest ends with a dataset or with a `DataError`, in bounded time, never otherwise.

`fuzzing/fuzz.py` does the same for as long as one wants, with limits and a guard; these are some of its cases.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from random import Random

import pytest
from fuzz import FORMATS, prepare, run_case

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest

SAMPLES = Path(__file__).parents[3] / "sample_data"


@pytest.mark.skipif(sys.platform == "win32", reason="makes pipes and names that are no text")
@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.one_in(16)
def test_something_changed(tmp_path: Path, name: str) -> None:
    for seed in range(12):
        folder = tmp_path / str(seed)
        folder.mkdir()
        (folder / "outside.txt").write_text('{"outside": 1}')
        random = Random(f"{name} {seed}")
        prepare(name, folder, random)
        assert run_case(name, folder, random) in ("sound", "told", "refused")


@pytest.mark.parametrize("junk", [b"", b"\0" * 100, b"\xff\xfe", b"[" * 100_000, b"<a>" * 50_000, b"null", b"\n" * 10])
@pytest.mark.parametrize("name", sorted(set(FORMATS) - {"crossroads", "nuscenes_tiny", "street.xodr"}))
def test_junk_as_the_largest_file(tmp_path: Path, name: str, junk: bytes) -> None:
    root = Path(shutil.copytree(SAMPLES / name, tmp_path / "source"))
    for file in root.rglob("*"):
        if file.is_file():
            file.write_bytes(junk)
    with pytest.raises(DataError) as error:
        ingest(root, tmp_path / "d", format=FORMATS[name])
    assert "Traceback" not in str(error.value)
    assert not (tmp_path / "d").exists()
