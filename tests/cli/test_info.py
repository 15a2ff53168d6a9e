"""`scenicq info`."""

import json
import shutil


def test_it_says_what_there_is(run, crossroads):
    result = run("info", crossroads, "--verify")
    lines = [line.split() for line in result.stdout.splitlines()]
    assert (result.exit_code, result.stderr) == (0, "")
    assert "156 frames, 676 objects, 26 tracks in 6 recordings" in result.stdout
    assert ["Car", "286"] in lines
    assert ["crossroads", "156", "676"] in lines
    assert ["06-cut-in", "26", "104"] in lines
    assert any(line[:3] == ["objects", "676", "1"] for line in lines)
    assert any(line[:2] == ["all", "7"] for line in lines)
    assert any(line[:2] == ["frame_index", "hash,"] for line in lines)
    assert "ego_road_directions" in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 120
    assert "nothing was left out" in result.stdout
    assert "every checksum is right" in result.stdout


def test_json_is_the_manifest(run, crossroads):
    assert json.loads(run("info", crossroads, "--format", "json").stdout) == json.loads(
        (crossroads / "dataset.json").read_text()
    )


def test_verify_finds_a_change_that_keeps_the_size(run, crossroads, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(crossroads, copy)
    file = next((copy / "objects").rglob("*.parquet"))
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    for more in ((), ("--verify",)):
        result = run("info", copy, *more)
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.startswith("error[store-damaged]")


def test_what_is_no_dataset(run, tmp_path):
    result = run("info", tmp_path)
    assert (result.exit_code, result.stderr.partition("]")[0]) == (2, "error[store-missing")
