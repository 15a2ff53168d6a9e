"""`scenicq index` and `ingest --update`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from scenicq.store.dataset import open_dataset

ROOT = Path(__file__).parents[3]


def tables(path: Path) -> dict[str, list[str]]:
    manifest = open_dataset(path).manifest
    return {name: [part.sha256 for part in parts] for name, parts in manifest.tables.items()}


def test_an_index_made_anew_is_the_same(run, crossroads, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(crossroads, copy)
    found = run("index", copy)
    assert found.exit_code == 0, found.stderr
    assert tables(copy) == tables(crossroads)
    assert "156 frames indexed" in found.stderr


def test_an_update_adds_what_is_new(run, crossroads, tmp_path):
    source = tmp_path / "source"
    shutil.copytree(ROOT / "sample_data" / "crossroads", source)
    lines = (source / "labels.jsonl").read_text().splitlines(keepends=True)
    recordings = sorted({json.loads(line)["recording"] for line in lines})
    early = [line for line in lines if json.loads(line)["recording"] in recordings[:4]]
    (source / "labels.jsonl").write_text("".join(early))
    assert run("ingest", source, tmp_path / "dataset").exit_code == 0
    (source / "labels.jsonl").write_text("".join(lines))
    found = run("ingest", source, tmp_path / "dataset", "--update")
    assert found.exit_code == 0, found.stderr
    updated, fresh = (list(open_dataset(path).labels()) for path in (tmp_path / "dataset", crossroads))
    assert updated == fresh


def test_a_dataset_without_an_ego_asks_for_any(run, scenarios, tmp_path):
    made = run("ingest", ROOT / "sample_data" / "interaction_tiny", tmp_path / "dataset", "--ego", "none")
    assert made.exit_code == 0, made.stderr
    program = scenarios / "03_against_traffic.scenic"
    refused = run("match", program, tmp_path / "dataset")
    assert refused.exit_code == 2
    assert "without an ego" in refused.stderr
    assert "--ego any" in refused.stderr
