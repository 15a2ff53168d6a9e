"""What older versions wrote of `sample_data` is read: datasets of `nuscenes_tiny`, results on `crossroads`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.query.execution.records import json_text
from scenicq.query.execution.result_files import read_records
from scenicq.store.dataset import open_dataset
from scenicq.store.segment import read_segments

OLDER = Path(__file__).with_name("older")
SAMPLES = Path(__file__).parents[3] / "sample_data"


def tables(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.parquet"))}


@pytest.mark.parametrize("name", ["tiny", "tiny5", "tiny6", "tiny7", "tiny8"])
def test_a_dataset_is_refused_with_what_brings_it_up_and_what_it_says_is_kept(run, tmp_path, name):
    with pytest.raises(DataError, match="`scenicq index"):
        open_dataset(OLDER / name, check=True)
    said = json.loads((OLDER / name / "dataset.json").read_text())
    older = open_dataset(OLDER / name, older=True, check=False)
    # the first of them say nothing of maps
    assert json.loads(older.manifest.to_json()) == {"map_groups": [], **said}
    shutil.copytree(OLDER / name, tmp_path / "d")
    assert run("index", tmp_path / "d").exit_code == 0
    dataset = open_dataset(tmp_path / "d", check=True)
    dataset.verify()
    now = json.loads(dataset.manifest.to_json())
    assert {name for name in said if now[name] != said[name]} == {"schema", "tables"}
    assert len(list(dataset.labels())) == said["total"]["frames"] == 6


@pytest.mark.parametrize("name", ["tiny", "tiny5", "tiny6", "tiny7", "tiny8"])
def test_index_makes_of_it_what_an_ingest_makes(run, tmp_path, name):
    shutil.copytree(OLDER / name, tmp_path / "d")
    assert run("index", tmp_path / "d").exit_code == 0
    assert run("info", tmp_path / "d", "--verify").exit_code == 0
    ingest(SAMPLES / "nuscenes_tiny", tmp_path / "new")
    assert tables(tmp_path / "d") == tables(tmp_path / "new")


def test_its_segments_are_taken_over():
    (segment,) = read_segments(OLDER / "tiny").values()
    assert (segment.objects, segment.recordings["scene-0001"].frames, segment.tracks) == (12, 3, 4)


@pytest.mark.parametrize("name", ["frames", "intervals"])
def test_results_are_read_alike_from_all_formats(name):
    lines, cells, columns = (list(read_records(OLDER / f"{name}.{form}")) for form in ("jsonl", "csv", "parquet"))
    assert lines == cells == columns
    written = [json.loads(line) for line in (OLDER / f"{name}.jsonl").read_text().splitlines()]
    assert [json.loads(json_text(each)) for each in lines] == written
