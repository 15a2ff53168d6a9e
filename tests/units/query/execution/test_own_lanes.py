"""Matches, explanations and pictures name the lanes of the roles whose lanes a program asks for."""

from __future__ import annotations

import json

import pytest
from turning_cars import BEFORE, TURNING, dataset_of

from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import record
from scenicq.query.execution.result_files import read_records
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

ASKING = """model scenic.domains.driving.model
ego = new Car in everywhere, facing Range(-180, 180) deg
other = new Car in everywhere, facing Range(-180, 180) deg
require ego.lane is ego.lane
"""
TOLD = [
    {"ego": {"own": ["in"], "others": []}},
    # its heading leads along the lane that crosses, and it comes from the one that leads to the turn
    {"ego": {"own": ["u", "cross"], "others": []}},
    {"ego": {"own": ["u"], "others": ["cross"]}},
]
PATH = [BEFORE, TURNING, (0, 5, 0)]


@pytest.fixture
def asked(tmp_path):
    dataset_of(tmp_path, PATH)
    (tmp_path / "p.scenic").write_text(ASKING)
    return tmp_path / "p.scenic", tmp_path / "d"


def lanes_of(lines: str):
    return [json.loads(line).get("lanes") for line in lines.splitlines()]


@pytest.mark.parametrize("how", [
    [], ["--no-prefilter"], pytest.param(["--all-matches"], marks=pytest.mark.slow),
    pytest.param(["--method", "smt"], marks=pytest.mark.slow),
])  # fmt: skip
def test_matches_name_the_lanes(run, asked, how):
    found = lanes_of(run("match", *asked, "--format", "jsonl", *how).stdout)
    assert [each for number, each in enumerate(found) if each not in found[:number]] == TOLD


def test_with_any_lane_all_are_its_own(run, asked):
    both = {"ego": {"own": ["u", "cross"], "others": []}}
    assert lanes_of(run("match", *asked, "--format", "jsonl", "--lanes", "any").stdout) == [TOLD[0], both, both]


@pytest.mark.parametrize(("rest", "told"), [([], TOLD[1:2]), (["--lanes", "any"], TOLD[1:2])])
def test_what_lies_ahead_asks_for_lanes(run, asked, rest, told):
    asked[0].write_text(
        "model scenic.domains.driving.model\nfrom scenicq.labels import ahead\n"
        "ego = new Car in everywhere, facing Range(-180, 180) deg\n"
        "require (0, 5) in ahead(ego, 2)\n"
    )
    found = lanes_of(run("match", *asked, "--format", "jsonl", *rest).stdout)
    assert found[:1] == told
    assert all(set(each["ego"]["own"]) <= {"in", "u", "cross"} for each in found)


def test_a_program_that_asks_for_no_lane_is_told_none(run, asked):
    asked[0].write_text("model scenic.domains.driving.model\nego = new Car at (2, -3)\n")
    assert lanes_of(run("match", *asked, "--format", "jsonl").stdout) == [None]


def test_intervals_name_those_at_their_first_frame(run, asked):
    asked[0].write_text(f"{ASKING}require always ego.lane is ego.lane\nterminate after 0.5 seconds\n")
    assert lanes_of(run("match", *asked, "--format", "jsonl", "--intervals", "all").stdout) == TOLD[:2]


@pytest.mark.parametrize("form", ["jsonl", "csv", "parquet"])
@pytest.mark.one_in(3)
def test_they_are_read_back(run, asked, tmp_path, form):
    file = tmp_path / f"found.{form}"
    run("match", *asked, "-o", file)
    query = Query(open_dataset(asked[1]), read_program(str(asked[0])), QueryOptions())
    found = [record(each).lanes for each in query.results()]
    assert [each.lanes for each in read_records(file)] == found
    assert len(found) == 3


def test_explanations_and_pictures_name_them(run, asked):
    assert "\nego is in `u`, lies in `cross`, too\n" in run("explain", *asked, "2").stdout
    assert "ego = ego (car), in `u` or `cross`<" in run("show", asked[1], "1", "--scenario", asked[0]).stdout
    # what comes closest to a frame that does not match
    asked[0].write_text(f"{ASKING}require ego.lane is network.elements['cross']\n")
    assert "\nego is in `in`\n" in run("explain", *asked, "0", "--exit-zero").stdout
