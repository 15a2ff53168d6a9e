"""Names from a dataset are shown on a terminal as text: they cannot colour it, clear it or pose as another line."""

import json
import shutil
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq_cli.report import printable

EVIL = "\x1b[31mcar\x07\nX\u202e"
SHOWN = r"\x1b[31mcar\x07\nX\u202e"


@pytest.fixture(scope="module")
def evil(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evil")
    shutil.copytree(Path(__file__).parents[3] / "sample_data" / "crossroads", folder / "source")
    labels = folder / "source" / "labels.jsonl"
    text = labels.read_text().replace("car-left-1", json.dumps(EVIL)[1:-1])
    labels.write_text(text.replace("03-busy-intersection", json.dumps("\x1b[2J")[1:-1]))
    ingest(folder / "source", folder / "dataset")
    return folder / "dataset"


def _clean(text):
    return "\x1b" not in text and "\x07" not in text and "\u202e" not in text


def test_control_characters_are_shown():
    assert printable("a\tb\x9b\x7f\n\u2028c") == "a\\tb\\x9b\\x7f\n\\u2028c"
    assert printable("Straße 道路") == "Straße 道路"


@pytest.mark.slow
def test_tables_explanations_and_comparisons(run, evil, scenarios, tmp_path):
    scenario = scenarios / "02_crossing_cars.scenic"
    table = run("match", scenario, evil, "--format", "table", "--limit", "1", "-o", tmp_path / "t", "--summary")
    lines = (tmp_path / "t").read_text().splitlines()
    assert len(lines) == 2
    assert SHOWN in lines[1]
    assert _clean(lines[1] + table.output)
    (name,) = run("match", scenario, evil, "--format", "ids", "--limit", "1").stdout.splitlines()
    for args in (("explain", scenario, evil, name), ("info", evil), ("show", evil, name + EVIL)):
        done = run(*args)
        assert _clean(done.output), args
        assert "\\x1b" in done.output, args
    one, two = tmp_path / "1.jsonl", tmp_path / "2.jsonl"
    run("match", scenario, evil, "-o", one)
    run("match", scenario, evil, "-o", two, "--limit", "1")
    compared = run("report", one, two).stdout
    assert _clean(compared)
    assert compared.count(SHOWN) == 4
