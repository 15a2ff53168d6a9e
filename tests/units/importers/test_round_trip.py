"""Every source, handed on as an interchange folder and read again, gives the same tables."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenicq.exporters.interchange import write_interchange
from scenicq.importers.ego_choice import WITHOUT_EGO
from scenicq.importers.ingest import ingest
from scenicq.importers.registry import choose_importer
from scenicq.store.dataset import open_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"
REAL = Path(__file__).parents[4] / "shared" / "data"
SOURCES = [*(SAMPLES / name for name in ("crossroads", *sorted(p.name for p in SAMPLES.glob("*_tiny")))), *(
    pytest.param(REAL / name, marks=pytest.mark.slow) for name in ("nuscenes-mini", "argoverse2", "boston")
)]  # fmt: skip
TABLES = ("labels", "objects", "regions", "memberships", "sensors")


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.name)
@pytest.mark.parametrize("ego", [None, "none"])
@pytest.mark.one_in(16)
def test_the_tables_are_the_same(source: Path, tmp_path: Path, ego: str | None) -> None:
    if not source.exists():
        pytest.skip(f"{source.name} is not on this machine")
    if ego is not None and choose_importer(source).name not in WITHOUT_EGO:
        pytest.skip("the source has an ego")
    ingest(source, tmp_path / "first", ego=ego)
    first = open_dataset(tmp_path / "first")
    if ego == "none" and all(label.has_ego for label in first.labels()):
        pytest.skip("the source has an ego")
    (tmp_path / "handed").mkdir()
    warnings = write_interchange(first, [label.frame for label in first.labels()], tmp_path / "handed")
    assert warnings == []
    summary = ingest(tmp_path / "handed", tmp_path / "second")
    assert not [entry for entry in summary.left_out if not entry.kept]
    second = open_dataset(tmp_path / "second")
    for table in TABLES:
        one, two = (dataset.connect().sql(f"SELECT * FROM {table}").fetchall() for dataset in (first, second))
        assert one == two, table
    assert first.maps == second.maps
