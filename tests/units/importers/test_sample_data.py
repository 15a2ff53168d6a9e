"""The committed sample data is what its generators write, and small."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

SAMPLES = Path(__file__).parents[3] / "sample_data"


def content(path: Path) -> object:
    """What a file says; the bytes of Parquet depend on who wrote them."""
    return pq.read_table(path).to_pylist() if path.suffix == ".parquet" else path.read_bytes()


def test_generators_write_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(SAMPLES)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for script in ("generate.py", "generate_nuscenes.py", "generate_formats.py", "generate_parked.py"):
        runpy.run_path(str(SAMPLES / script))["main"](tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert {"crossroads", "nuscenes_tiny"} <= set(names)
    for name in names:
        here, there = (
            {path.relative_to(root): content(path) for path in (root / name).rglob("*") if path.is_file()}
            for root in (SAMPLES, tmp_path)
        )
        assert here == there
        assert here


def test_sample_data_is_small() -> None:
    files = [path for path in SAMPLES.rglob("*") if path.is_file() and path.parent.name != "__pycache__"]
    assert sum(path.stat().st_size for path in files) < 450_000
