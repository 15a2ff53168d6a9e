"""`scenicq info`."""

import json
import shutil

import pytest


def test_it_says_what_there_is(run, crossroads):
    result = run("info", crossroads, "--verify", "--columns")
    lines = [line.split() for line in result.stdout.splitlines()]
    assert (result.exit_code, result.stderr) == (0, "")
    assert "156 frames, 676 objects, 26 tracks in 6 recordings" in result.stdout
    assert ["Car", "286", "156"] in lines
    assert any(line[:1] == ["Adult"] and len(line) == 2 for line in lines)
    assert ["what", "happens", "over", "time", "yes,", "by", "26", "tracks"] in lines
    assert any(line[:5] == ["roads", "and", "lanes", "yes,", "26"] for line in lines)
    assert result.stdout.index("2 labels a second") < result.stdout.index("CLASS")
    assert ["crossroads", "156", "676"] in lines
    assert ["06-cut-in", "26", "104"] in lines
    assert any(line[:3] == ["objects", "676", "1"] for line in lines)
    assert any(line[:2] == ["all", "8"] for line in lines)
    assert any(line[:2] == ["frame_index", "hash,"] for line in lines)
    assert "ego_road_directions" in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 120
    assert "nothing was left out" in result.stdout
    assert "every checksum is right" in result.stdout


def test_columns_are_told_on_demand(run, crossroads):
    plain = run("info", crossroads).stdout
    assert "ego_road_directions" not in plain
    assert "--columns" in plain


def test_it_says_what_cannot_be_asked(run, tmp_path):
    source = tmp_path / "source"
    source.mkdir()
    header = {"name": "d", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (source / "dataset.json").write_text(json.dumps(header))
    box = {"position": [0, 0], "heading": 0, "width": 2, "length": 4}
    label = {"id": "f", "recording": "r", "timestamp_us": 0, "map": "", "ego": box,
             "objects": [{**box, "id": "o", "class": "Car"}]}  # fmt: skip
    (source / "labels.jsonl").write_text(json.dumps({name: each for name, each in label.items() if name != "map"}))
    assert run("ingest", source, tmp_path / "d", "-q").exit_code == 0
    told = run("info", tmp_path / "d").stdout
    for what, why in (
        ("what happens over time", "no, as no recording has two labels"),
        ("roads and lanes", "no, as there is no map with lanes"),
        ("speeds of objects", "no, as none is known"),
        ("sensor files", "no, as none is named"),
    ):
        assert f"{what} {why}" in " ".join(told.split()), told


def test_json_is_the_manifest(run, crossroads):
    assert json.loads(run("info", crossroads, "--format", "json").stdout) == json.loads(
        (crossroads / "dataset.json").read_text()
    )


@pytest.mark.slow
def test_verify_finds_a_change_that_keeps_the_size(run, crossroads, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(crossroads, copy)
    file = next((copy / "objects").rglob("*.parquet"))
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    result = run("info", copy, "--verify")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("error[store-damaged]")
    # without it, only what is read can be seen to be damaged
    result = run("info", copy)
    assert result.exit_code == 0 or result.stderr.startswith("error[store-damaged]")


def test_what_is_no_dataset(run, tmp_path):
    result = run("info", tmp_path)
    assert (result.exit_code, result.stderr.partition("]")[0]) == (2, "error[store-missing")
