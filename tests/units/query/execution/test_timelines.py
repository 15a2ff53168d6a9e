"""What results say of what roles do from when to when: the same in every format, and only where it is read."""

from __future__ import annotations

import csv
import io
import json

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import scenicq
from scenicq.query.execution.timelines import Timelines
from scenicq_cli.main import cli

PROGRAM = """model scenic.domains.driving.model
behavior Brakes():
    while self.speed > 0.5:
        take SetBrakeAction(1)
    wait
behavior Drives(who):
    try:
        do FollowLaneBehavior(target_speed=8)
    interrupt when (distance from self to who) < 20:
        do Brakes()
monitor Watches(car):
    while True:
        wait
walker = new Pedestrian
ego = new Car with behavior Drives(walker)
require monitor Watches(ego)
terminate after 8 seconds
"""
SCENARIOS = """model scenic.domains.driving.model
scenario Near(who):
    setup:
        terminate when (distance from ego to who) > 20
scenario Main():
    setup:
        ego = new Car
        walker = new Pedestrian
        terminate after 3 seconds
    compose:
        do Near(walker) for 1 seconds
        wait
"""


@pytest.fixture
def program(tmp_path):
    path = tmp_path / "drives.scenic"
    path.write_text(PROGRAM, encoding="utf-8")
    return path


def said(*words: object) -> str:
    done = CliRunner().invoke(cli, ["match", *map(str, words), "--behaviors", "guards", "--exit-zero", "-q"])
    assert done.exit_code == 0, done.output
    return done.stdout


def lines(*words: object) -> list[dict]:
    return [json.loads(line) for line in said(*words, "--format", "jsonl").splitlines()]


def test_a_line_says_who_does_what_from_when_to_when(program, crossroads):
    found = lines(program, crossroads)
    one = next(each for each in found if each["recording"] == "04-against-traffic")
    told = [
        (each["kind"], each["of"], each["mode"][-1]["what"], each["mode"][-1]["place"], each["frames"])
        for each in one["timeline"]
    ]
    assert told[0] == ("behavior", "ego", "FollowLaneBehavior(target_speed=8)", "drives.scenic:8:12", 10)
    assert told[1] == ("behavior", "ego", "take SetBrakeAction(1)", "drives.scenic:4:9", 6)
    assert told[2:] == [("monitor", "Watches(ego)", "wait", "drives.scenic:13:9", 16)]
    calls = [(each["what"], each["place"]) for each in one["timeline"][1]["mode"][:-1]]
    assert calls == [("Drives(walker)", "drives.scenic:15:29"), ("Brakes()", "drives.scenic:10:12")]
    # one goes on where the other one ends, to where the interval does
    first, second, monitor = one["timeline"]
    assert first["start_us"] == monitor["start_us"] == one["start_us"]
    assert second["start_us"] == first["end_us"]
    assert second["end_us"] == monitor["end_us"] == one["end_us"]


def test_all_formats_and_python_say_the_same(program, crossroads, tmp_path):
    expected = [each["timeline"] for each in lines(program, crossroads)]
    assert len(expected) > 2
    rows = csv.DictReader(io.StringIO(said(program, crossroads, "--format", "csv")))
    assert [json.loads(each["timeline"]) for each in rows] == expected
    said(program, crossroads, "-o", tmp_path / "m.parquet")
    assert pq.read_table(tmp_path / "m.parquet")["timeline"].to_pylist() == expected
    matches = scenicq.open(crossroads).match(program, behaviors="guards")
    assert [each.record["timeline"] for each in matches] == expected
    assert matches.to_arrow()["timeline"].to_pylist() == expected
    assert [each.of for each in matches[0].timeline] == [each["of"] for each in expected[0]]
    table = said(program, crossroads, "--format", "table")
    assert "ego: FollowLaneBehavior(target_speed=8) 5.0 s, take SetBrakeAction(1) 3.0 s" in table


def test_shards_keep_it(program, crossroads, tmp_path):
    whole = lines(program, crossroads)
    for number in (1, 2):
        said(program, crossroads, "--shard", f"{number}/2", "-o", tmp_path / "pieces")
    done = CliRunner().invoke(cli, ["gather", str(tmp_path / "pieces")])
    assert [json.loads(each)["timeline"] for each in done.stdout.splitlines()] == [each["timeline"] for each in whole]


def test_names_alone_are_found_without_it(program, crossroads, monkeypatch):
    def never(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(Timelines, "fill", never)
    assert len(said(program, crossroads, "--format", "ids").splitlines()) > 2
    matches = scenicq.open(crossroads).match(program, behaviors="guards")
    assert len(matches) > 2
    with pytest.raises(AssertionError):
        _ = matches[0].timeline


def test_scenarios_that_run_are_told(tmp_path, crossroads):
    path = tmp_path / "main.scenic"
    path.write_text(SCENARIOS, encoding="utf-8")
    (first, *_) = lines(path, crossroads, "--scenario", "Main")
    (near,) = first["timeline"]
    assert (near["kind"], near["of"], near["mode"][-1]["place"]) == ("scenario", "Near", "main.scenic:11:12")
    assert near["end_us"] - near["start_us"] <= 1_000_000


LATE = """model scenic.domains.driving.model
behavior Goes():
    while True:
        take SetSpeedAction(8)
scenario Sub():
    setup:
        other = new Car with behavior Goes()
        terminate after 2 seconds
scenario Main():
    setup:
        ego = new Car
    compose:
        while ego.speed < 3:
            wait
        do Sub()
"""


def test_who_comes_later_is_told_of_from_then_on(tmp_path, crossroads):
    path = tmp_path / "main.scenic"
    path.write_text(LATE, encoding="utf-8")
    found = lines(path, crossroads, "--scenario", "Main", "--limit", 2)
    assert found
    for each in found:
        behavior, scenario = each["timeline"]
        assert (behavior["of"], scenario["of"]) == ("other", "Sub")
        for told in (behavior, scenario):
            # two seconds before the end, where it ends
            assert (told["start_us"], told["end_us"]) == (each["end_us"] - 2_000_000, each["end_us"])


def test_a_program_without_any_says_nothing(crossroads):
    text = "model scenic.domains.driving.model; ego = new Car; require always ego.speed > 1"
    (first, *_) = lines("-e", text, crossroads)
    assert "timeline" not in first
    head = said("-e", text, crossroads, "--format", "csv").splitlines()[0]
    assert "timeline" not in head
