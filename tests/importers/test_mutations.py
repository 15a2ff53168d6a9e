"""Some bytes changed: an ingest ends with a dataset or with a `DataError`, in bounded time, never otherwise."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset

SAMPLES = Path(__file__).parents[2] / "sample_data"
FORMATS = {
    "argoverse2_tiny": "argoverse2",
    "forecasting_tiny": "argoverse2-forecasting",
    "waymo_tiny": "waymo",
    "commonroad_tiny": "commonroad",
    "kitti_tiny": "kitti",
    "openlabel_tiny": "openlabel",
    "interaction_tiny": "interaction",
}
TOKENS = [b"", b"\0", b"\xff" * 8, b"-1", b"1e999", b"nan", b"null", b"[]", b"{}", b'"', b"<", b">", b"\n", b",", b" "]
LONGEST_S = 20.0


def mutated(content: bytes, data: st.DataObject) -> bytes:
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, max(0, len(content) - 1)))
        length = data.draw(st.sampled_from([0, 1, 1, 2, 4, 8, 64, 10**9]))
        token = data.draw(st.sampled_from(TOKENS) | st.binary(max_size=8))
        content = content[:start] + token + content[start + length :]
    return content


@pytest.mark.parametrize("name", FORMATS)
@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(data=st.data())
def test_changed_bytes(tmp_path_factory: pytest.TempPathFactory, name: str, data: st.DataObject) -> None:
    folder = tmp_path_factory.mktemp(name)
    root = Path(shutil.copytree(SAMPLES / name, folder / "source"))
    file = data.draw(st.sampled_from(sorted(path for path in root.rglob("*") if path.is_file())))
    file.write_bytes(mutated(file.read_bytes(), data))
    started = time.monotonic()
    try:
        summary = ingest(root, folder / "d", format=FORMATS[name])
    except DataError as error:
        told = [diagnostic.message for diagnostic in error.diagnostics]
    else:
        told = [diagnostic.message for diagnostic in summary.diagnostics]
        assert len(list(open_dataset(folder / "d").labels())) == summary.frames
    assert all(told)
    assert all("Traceback" not in text for text in told)
    assert time.monotonic() - started < LONGEST_S
    shutil.rmtree(folder)


@pytest.mark.parametrize("junk", [b"", b"\0" * 100, b"\xff\xfe", b"[" * 100_000, b"<a>" * 50_000, b"null", b"\n" * 10])
@pytest.mark.parametrize("name", FORMATS)
def test_junk_as_the_largest_file(tmp_path: Path, name: str, junk: bytes) -> None:
    root = Path(shutil.copytree(SAMPLES / name, tmp_path / "source"))
    for file in root.rglob("*"):
        if file.is_file():
            file.write_bytes(junk)
    with pytest.raises(DataError) as error:
        ingest(root, tmp_path / "d", format=FORMATS[name])
    assert "Traceback" not in str(error.value)
    assert not (tmp_path / "d").exists()
