"""Computing anew gives what was there."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset
from scenicq.store.rebuild import rebuild

SAMPLES = Path(__file__).parents[3] / "sample_data"


def contents(dataset: Path) -> dict[str, bytes]:
    return {str(path.relative_to(dataset)): path.read_bytes() for path in dataset.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", ["crossroads", "nuscenes_tiny"])
@pytest.mark.one_in(2)
def test_rebuilding_changes_no_byte(tmp_path: Path, name: str) -> None:
    ingest(SAMPLES / name, tmp_path / "d", segment_objects=100)
    before = contents(tmp_path / "d")
    seen: list[int] = []
    manifest = rebuild(open_dataset(tmp_path / "d"), seen.append)
    assert contents(tmp_path / "d") == before
    assert sum(seen) == manifest.total.frames > 0


def test_computed_columns_are_computed_from_the_rest(tmp_path: Path) -> None:
    ingest(SAMPLES / "crossroads", tmp_path / "good")
    shutil.copytree(tmp_path / "good", tmp_path / "d")
    memberships = next((tmp_path / "d" / "memberships").iterdir())
    memberships.write_bytes(b"x" * memberships.stat().st_size)
    rebuild(open_dataset(tmp_path / "d", check=False))
    assert contents(tmp_path / "d") == contents(tmp_path / "good")


def test_without_descriptions_nothing_is_changed(tmp_path: Path) -> None:
    ingest(SAMPLES / "crossroads", tmp_path / "d")
    shutil.rmtree(tmp_path / "d" / "segments")
    before = contents(tmp_path / "d")
    with pytest.raises(DataError) as error:
        rebuild(open_dataset(tmp_path / "d"))
    assert error.value.diagnostics[0].code == "store-damaged"
    assert contents(tmp_path / "d") == before
