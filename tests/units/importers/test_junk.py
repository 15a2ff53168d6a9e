"""Whatever stands in one place of a source, an ingest ends with a dataset or with a `DataError`, never otherwise."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"
JUNK = [None, True, 0, -1, 1.5, float("nan"), float("inf"), 10**400, "", "x", "\ud800", [], [None], [[]], {}, {"x": []}]
LINES = ["crossroads/labels.jsonl", "crossroads/maps/crossroads.geojson", "crossroads/dataset.json"]
TABLES = sorted(str(path.relative_to(SAMPLES)) for path in (SAMPLES / "nuscenes_tiny").rglob("*.json"))


def places(value: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a JSON value, the outermost first."""
    found: list[tuple[Any, Any]] = []
    stack = [value]
    while stack:
        container = stack.pop()
        if isinstance(container, dict | list):
            keys = list(container) if isinstance(container, dict) else range(len(container))
            found += [(container, key) for key in keys]
            stack += [container[key] for key in keys]
    return found


def spoil(text: str, draw: st.DataObject) -> str:
    whole = json.loads(text)
    found = places(whole)
    # Most places lie deep; the outer ones matter as much.
    container, key = draw.draw(st.sampled_from(found[:60]) | st.sampled_from(found))
    value = draw.draw(st.sampled_from(JUNK))
    if value == "x" and isinstance(container, dict):
        del container[key]
    else:
        container[key] = value
    return json.dumps(whole)


def check_messages(error: DataError) -> None:
    assert error.diagnostics
    assert all(diagnostic.message for diagnostic in error.diagnostics)


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(name=st.sampled_from(LINES * 3 + TABLES), draw=st.data())
def test_junk_in_one_place(tmp_path: Path, name: str, draw: st.DataObject) -> None:
    root = tmp_path / "source"
    shutil.rmtree(root, ignore_errors=True)
    shutil.copytree(SAMPLES / Path(name).parts[0], root)
    file = root.joinpath(*Path(name).parts[1:])
    if name.endswith("jsonl"):
        lines = file.read_text().splitlines()[:40]
        lines[3] = spoil(lines[3], draw)
        file.write_text("\n".join(lines))
    else:
        file.write_text(spoil(file.read_text(), draw))
    format = "nuscenes" if name.startswith("nuscenes") else "interchange"
    try:
        summary = ingest(root, tmp_path / "d", format=format, force=True)
    except DataError as error:
        check_messages(error)
    else:
        dataset = open_dataset(tmp_path / "d")
        assert len(list(dataset.labels())) == summary.frames
        assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize("junk", [b"", b"\x00" * 100, b"\xff\xfe", b"[" * 100_000, b"null", b'"x"'])
@pytest.mark.parametrize("name", [*LINES, "nuscenes_tiny/v1.0-tiny/log.json", "nuscenes_tiny/v1.0-tiny/sample.json"])
def test_junk_as_a_file(tmp_path: Path, name: str, junk: bytes) -> None:
    root = Path(shutil.copytree(SAMPLES / Path(name).parts[0], tmp_path / "source"))
    root.joinpath(*Path(name).parts[1:]).write_bytes(junk)
    with pytest.raises(DataError) as error:
        ingest(root, tmp_path / "d")
    assert "Traceback" not in str(error.value)
    assert not (tmp_path / "d").exists()
