"""How many matches there are by a tolerance alone: those that the same query leaves out with it exact."""

from __future__ import annotations

import math

import pytest

from scenicq.errors import Source
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.tolerance_share import ToleranceCounts, by_tolerance_alone
from scenicq.store.dataset import open_dataset

MODEL = "model scenic.domains.driving.model\n"
PROGRAMS = {
    "an edge": "ego = new Car on road\nlead = new Car in CircularRegion(ego, {reach})\n",
    "directions": "ego = new Car on road\nlead = new Car on road, facing Range(0, 40) deg relative to ego.heading\n",
    "no places": "ego = new Car in everywhere, facing Range(-180, 180) deg\n",
}
TOLERANCES = {
    "positions": ("position=0.25,heading=5deg", "position=0.001,heading=5deg"),
    "headings": ("position=0.25,heading=5deg", "position=0.25,heading=5deg,lead.heading=0.001"),
    "a box": ("x=0.3,y=0.2,ego.position=1,heading=5deg", "position=0.001,heading=5deg"),
}


def reach_of(dataset) -> float:
    """A tenth of a metre less than a car is away."""
    away = [
        math.hypot(each.x - label.ego.x, each.y - label.ego.y)
        for label in dataset.labels()
        for each in label.objects
        if each.category == "Car"
    ]
    return sorted(away)[len(away) // 2] - 0.1


def matching(dataset, program, tolerance):
    program = program.format(reach=reach_of(dataset))
    options = QueryOptions(MatchOptions(tolerance=parse_tolerance(tolerance)))
    query = Query(dataset, Source("p.scenic", MODEL + program), options)
    return query, [each for each in query.results() if isinstance(each.verdict, Match)]


@pytest.mark.parametrize(("name", "what"), [
    ("an edge", "positions"), ("directions", "headings"), ("an edge", "a box"), ("no places", "positions"),
])  # fmt: skip
def test_it_counts_what_an_exact_part_leaves_out(crossroads, name, what):
    dataset = open_dataset(crossroads)
    given, exact = TOLERANCES[what]
    query, found = matching(dataset, PROGRAMS[name], given)
    kept = {each.frame for each in matching(dataset, PROGRAMS[name], exact)[1]}
    left = {each.frame for each in found} - kept
    share = by_tolerance_alone(query, found, math.inf)
    assert share.matches == len(found) > 0
    assert (share.headings if what == "headings" else share.positions) == len(left)
    assert bool(left) == (name != "no places")


def test_there_may_be_no_time(crossroads):
    query, found = matching(open_dataset(crossroads), PROGRAMS["an edge"], "0.3")
    assert by_tolerance_alone(query, found, 0.0) == ToleranceCounts(0, 0, 0)


def test_an_interval_counts_by_its_first_frame(crossroads):
    dataset = open_dataset(crossroads)
    over_time = PROGRAMS["an edge"] + "require eventually lead.speed > -1\nterminate after 1 seconds\n"
    (given, exact), alone = TOLERANCES["positions"], 0
    query, found = matching(dataset, over_time, given)
    begin = {(each.frame, each.verdict.correspondence["lead"]) for each in found}
    starts = {(each.frame, each.verdict.correspondence["lead"]) for each in matching(dataset, over_time, exact)[1]}
    share = by_tolerance_alone(query, found, math.inf)
    assert share.matches == len(found) > 0
    # one that is left out may begin where another one of the longer query does not
    alone = len(begin - starts)
    assert 0 < share.positions <= alone


@pytest.mark.parametrize("rest", [[], ["--tolerance", "exact"]])
def test_the_summary_tells_it(run, crossroads, tmp_path, rest):
    program = PROGRAMS["an edge"].format(reach=reach_of(open_dataset(crossroads)))
    (tmp_path / "p.scenic").write_text(MODEL + program)
    told = run("match", tmp_path / "p.scenic", crossroads, "--summary", *rest).stderr
    assert ("by a tolerance alone" in told) == (not rest)
    told = run("match", tmp_path / "p.scenic", crossroads, "--summary", "--min-duration", "0.1", *rest).stderr
    assert ("at their first frames" in told) == (not rest)


def test_the_summary_tells_what_directions_of_the_model_leave_out(run, crossroads, tmp_path):
    (tmp_path / "p.scenic").write_text(f"{MODEL}ego = new Car\nother = new Car\n")
    told = run("match", tmp_path / "p.scenic", crossroads, "--summary").stderr
    assert "leaves to the default" in told
    assert "failed first at `ego.heading`" in told or "failed first at `other.heading`" in told
    (tmp_path / "p.scenic").write_text(f"{MODEL}ego = new Car facing 0 deg\n")
    assert "leaves to the default" not in run("match", tmp_path / "p.scenic", crossroads, "--summary").stderr
