"""The programs of `sample_data/over_time` find what was invented for them, however they are run."""

import csv
import io
import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from scenicq.importers.ingest import ingest
from scenicq_cli.main import cli

ROOT = Path(__file__).parents[3]
PROGRAMS = ROOT / "sample_data" / "over_time"
FOUND = {
    "01_pedestrian_crosses": [("02-pedestrian-crosses", 0, 18, {"walker": "walker-1"})],
    "02_cut_in": [("06-cut-in", 6, 14, {"other": "car-cutting"})],
    "03_waits_then_goes": [
        ("02-pedestrian-crosses", 0, 22, {"walker": "walker-1"}),
        ("02-pedestrian-crosses", 0, 22, {"walker": "walker-2"}),
    ],
    "04_follows": [("05-two-lane-traffic", 0, 25, {"leader": "car-leader"})],
    "05_parked": [("04-against-traffic", 0, 25, {"parked": "car-parked"})],
}
MORE_OPTIONS = {"04_follows": ["--min-duration", "5"], "05_parked": ["--min-duration", "12"]}


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """The sample recordings as a dataset."""
    folder = tmp_path_factory.mktemp("town") / "town"
    ingest(ROOT / "sample_data" / "crossroads", folder)
    return folder


def run(town, name, *options, output=None):
    """What the command prints, as text."""
    words = ["match", str(PROGRAMS / f"{name}.scenic"), str(town), "--tolerance", "position=0.25,heading=5deg"]
    done = CliRunner().invoke(cli, [*words, *MORE_OPTIONS.get(name, []), *options])
    assert done.exit_code == 0, done.output
    return done.stdout


def told(records):
    return [
        (
            each["recording"],
            int(each["frames"]["first"].rpartition("/")[2]),
            int(each["frames"]["last"].rpartition("/")[2]),
            {role: track for role, track in each["correspondence"].items() if role != "ego"},
        )
        for each in records
    ]


@pytest.mark.parametrize("name", FOUND)
@pytest.mark.one_in(2)
def test_each_program_finds_its_recording(town, name):
    records = [json.loads(line) for line in run(town, name).splitlines()]
    assert told(records) == FOUND[name]
    assert records[-1].pop("summary")["complete"]
    for each in records:
        # a timeline is of programs with behaviors, monitors or scenarios
        assert [key for key in each if key != "timeline"] == [
            "recording", "start_us", "end_us", "frames", "verdict", "correspondence", "witness", "open_ended", "dataset"
        ]  # fmt: skip
        assert ("timeline" in each) == ("monitor " in (PROGRAMS / f"{name}.scenic").read_text())
        assert each["verdict"] == "match"
        assert each["open_ended"] == (name in MORE_OPTIONS)
        assert each["end_us"] - each["start_us"] == (each["frames"]["count"] - 1) * 500_000


def test_every_program_is_listed():
    assert {path.stem for path in PROGRAMS.glob("*.scenic")} == set(FOUND)


@pytest.mark.parametrize("options", [["--no-prefilter"], ["--jobs", "2"]], ids=" ".join)
def test_how_it_is_run_changes_nothing(town, options):
    assert run(town, "01_pedestrian_crosses", *options) == run(town, "01_pedestrian_crosses")


def test_shards_and_an_interrupted_run_give_the_same(town, tmp_path):
    plain = run(town, "03_waits_then_goes")
    for number in (1, 2, 3):
        run(town, "03_waits_then_goes", "--shard", f"{number}/3", "-o", str(tmp_path / "pieces"), "--exit-zero")
    gathered = CliRunner().invoke(cli, ["gather", str(tmp_path / "pieces")])
    assert gathered.stdout == plain
    run(town, "03_waits_then_goes", "--resume", "-o", str(tmp_path / "found.jsonl"))
    assert (tmp_path / "found.jsonl").read_text() == plain


def test_all_formats_say_the_same(town, tmp_path):
    name = "03_waits_then_goes"
    records = [json.loads(line) for line in run(town, name).splitlines()]
    rows = list(csv.DictReader(io.StringIO(run(town, name, "--format", "csv"))))
    run(town, name, "-o", str(tmp_path / "found.parquet"))
    table = pq.read_table(tmp_path / "found.parquet").to_pylist()
    for record, row, cells in zip(records, rows, table, strict=True):
        assert json.loads(row["frames"]) == cells["frames"] == record["frames"]
        assert int(row["end_us"]) == cells["end_us"] == record["end_us"]
        assert cells["open_ended"] is False
    assert run(town, name, "--format", "ids").split() == [f"{r['recording']}@{r['start_us']}" for r in records]
    assert "23 from 02-pedestrian-crosses/00" in run(town, name, "--format", "table")


def test_limit_counts_intervals(town):
    assert len(run(town, "03_waits_then_goes", "--limit", "1", "--exit-zero").splitlines()) == 1


def test_all_tells_what_kept_a_binding_from_matching(town):
    records = [json.loads(line) for line in run(town, "01_pedestrian_crosses", "--all").splitlines()]
    causes = {each["correspondence"]["walker"]: each["cause"]["what"] for each in records if "cause" in each}
    # lost for good before the recordings end
    assert set(causes.values()) == {"require always (distance to walker) < 40"}


def test_an_export_has_the_frames_of_the_interval_with_the_objects_of_the_roles(town, tmp_path):
    run(town, "02_cut_in", "--export", "interchange", str(tmp_path / "out"))
    done = ingest(tmp_path / "out", tmp_path / "again")
    assert done.frames == 9


def explained(town, program, what):
    words = ["explain", str(program), str(town), what, "--tolerance", "position=0.25,heading=5deg"]
    return CliRunner().invoke(cli, words)


def test_a_match_is_explained_by_what_holds_when(town):
    done = explained(town, PROGRAMS / "02_cut_in.scenic", "06-cut-in")
    assert done.exit_code == 0
    assert "recording 06-cut-in matches from 3.0 s to 7.0 s (9 frames from 06-cut-in/06)" in done.output
    assert "correspondence: ego = ego, other = car-cutting" in done.output
    assert "abs(to_the_left(other)) < 0.5                     ........#" in done.output


def test_what_is_broken_is_said_with_its_place_time_and_margin(town, tmp_path):
    text = (PROGRAMS / "02_cut_in.scenic").read_text().replace("always ahead(other) > 0", "always ahead(other) > 3")
    program = tmp_path / "cut_in.scenic"
    program.write_text(text)
    done = explained(town, program, "06-cut-in")
    assert done.exit_code == 1
    assert "does not match" in done.output
    assert "require always ahead(other) > 3" in done.output
    assert "off by 0.8" in done.output


def test_a_recording_without_a_start_says_what_its_frames_fail_at(town):
    done = explained(town, PROGRAMS / "02_cut_in.scenic", "05-two-lane-traffic")
    assert done.exit_code == 1
    assert "no frame of 05-two-lane-traffic matches the initial scene" in done.output


def test_a_time_that_a_recording_does_not_have_is_refused(town):
    done = explained(town, PROGRAMS / "02_cut_in.scenic", "06-cut-in@5")
    assert done.exit_code == 2
    assert "has no frame at 5" in done.stderr
    assert "26 frames are at 1700018000000000 (0.0 s), " in done.stderr
    assert "has no frame at 99.5 s" in explained(town, PROGRAMS / "02_cut_in.scenic", "06-cut-in@99.5s").stderr


@pytest.mark.parametrize("when", ["1700018003000000", "3s", "3.0s", "3.04 s", "2.8s"])
def test_a_frame_is_named_by_its_timestamp_or_by_seconds(town, when):
    done = explained(town, PROGRAMS / "02_cut_in.scenic", f"06-cut-in@{when}")
    assert done.exit_code == 0
    assert "recording 06-cut-in matches from 3.0 s to 7.0 s" in done.output
