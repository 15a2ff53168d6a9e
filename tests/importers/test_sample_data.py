"""The committed sample data is what its generators write, and small."""

from __future__ import annotations

import runpy
from pathlib import Path

SAMPLES = Path(__file__).parents[2] / "sample_data"


def test_generators_write_what_is_there(tmp_path: Path) -> None:
    for script in ("generate.py", "generate_nuscenes.py"):
        runpy.run_path(str(SAMPLES / script))["main"](tmp_path)
    for name in ("crossroads", "nuscenes_tiny"):
        here, there = (
            {path.relative_to(root): path.read_bytes() for path in (root / name).rglob("*") if path.is_file()}
            for root in (SAMPLES, tmp_path)
        )
        assert here == there
        assert here


def test_sample_data_is_small() -> None:
    assert sum(path.stat().st_size for path in SAMPLES.rglob("*") if path.is_file()) < 300_000
