"""Importers of other packages stand beside the built-in ones."""

from __future__ import annotations

import importlib.metadata
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.importers import registry
from scenicq.importers.base import ImportOptions, OpenedSource
from scenicq.importers.report import Report

SAMPLES = Path(__file__).parents[3] / "sample_data"
SLOW = [
    *("shapely", "duckdb", "pyarrow.compute", "numpy.ma", "multiprocessing"),
    *("scenicq.geometry.shapes", "scenicq.importers.interchange", "scenicq.importers.waymo"),
]
"""Modules that take long to load, or read other formats."""


class Greedy:
    """Recognises everything."""

    name = "greedy"
    layout = "anything"

    def recognises(self, path: Path) -> bool:
        return True

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        raise NotImplementedError


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def entry_points(group: str) -> list[Any]:
        assert group == "scenicq.importers"
        built_in = SimpleNamespace(name="interchange", value="other:Thing", load=lambda: pytest.fail("not needed"))
        return [SimpleNamespace(name="greedy", value="other:Greedy", load=lambda: Greedy), built_in]

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)


def test_built_in_importers_are_always_there() -> None:
    assert {"interchange", "nuscenes"} <= set(registry.importers())


@pytest.mark.usefixtures("installed")
def test_an_installed_importer_is_found_and_may_be_ambiguous(tmp_path: Path) -> None:
    names = list(registry.importers())
    assert names[:2] == ["interchange", "nuscenes"]
    assert names[-1] == "greedy"
    assert names.count("interchange") == 1
    assert registry.choose_importer(tmp_path).name == "greedy"
    (tmp_path / "dataset.json").write_text('{"interchange": 1}')
    with pytest.raises(DataError, match="recognised by `interchange` and `greedy`") as error:
        registry.choose_importer(tmp_path)
    assert error.value.diagnostics[0].code == "dataset-ambiguous"
    assert registry.choose_importer(tmp_path, "greedy").name == "greedy"


def test_nothing_recognised_says_what_was_looked_for(tmp_path: Path) -> None:
    with pytest.raises(DataError) as error:
        registry.choose_importer(tmp_path)
    assert error.value.diagnostics[0].code == "dataset-unrecognised"
    assert "labels.jsonl" in str(error.value)
    assert "scene.json" in str(error.value)


def test_a_source_without_maps_loads_little(tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(SAMPLES / "nuscenes_tiny" / "v1.0-tiny", source / "v1.0-tiny")
    program = (
        # Arrow and DuckDB load pandas, and with it much else, where it is installed
        "import sys\nclass WithoutPandas:\n def find_spec(self, name, *_):\n"
        "  if name == 'pandas': raise ModuleNotFoundError(name)\nsys.meta_path.insert(0, WithoutPandas())\n"
        "from scenicq.importers.ingest import ingest\n"
        f"print(ingest({str(source)!r}, {str(tmp_path / 'dataset')!r}).objects)\n"
        f"print(*sorted(set(sys.modules) & {set(SLOW)!r}))"
    )
    done = subprocess.run([sys.executable, "-I", "-c", program], capture_output=True, text=True, check=True)
    objects, loaded = done.stdout.splitlines()
    assert int(objects) > 0
    # courses of egos are made without a map, too
    assert set(loaded.split()) <= {"numpy.ma", "scenicq.geometry.shapes", "shapely"}


@pytest.mark.parametrize("name", list(registry.importers()))
def test_a_built_in_importer_is_found_under_its_own_name(name: str) -> None:
    assert registry.importers()[name].name == name
