"""`--near`, `--all-matches` and `explain` on the sample data."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace

import pytest

from scenicq.limits import LIMITS
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.nearest_miss import closest, nearest_misses
from scenicq.store.dataset import open_dataset

SETTING = QueryOptions(match=MatchOptions(tolerance=parse_tolerance("position=0.25,heading=5deg")), solver="portable")


@pytest.fixture
def query(crossroads, scenarios):
    return Query(open_dataset(crossroads), read_program(scenarios / "02_crossing_cars.scenic"), SETTING)


@pytest.mark.slow
def test_the_ranking_is_that_of_looking_at_every_frame(query):
    (name,) = query.dataset.maps
    matcher = Matcher(query.compile(name)[0], query.options.match)
    everything = replace(query.options, every=True, prefilter=False)
    frames = [result.frame for result in Query(query.dataset, query.source, everything).results()]
    widenings = {label.frame: closest(matcher, label) for label in query.dataset.labels(frames)}
    expected = sorted(found.widening_m for found in widenings.values() if found is not None and found.widening_m)[:4]
    ranked = nearest_misses(query, 4)
    assert [widenings[result.frame].widening_m for result in ranked] == pytest.approx(expected, rel=0.03)
    for result in ranked:
        assert isinstance(result.verdict, NoMatch)
        tolerance = parse_tolerance(re.search(r"with (\S+)", result.verdict.cause.detail).group(1))
        (label,) = query.dataset.labels([result.frame])
        assert isinstance(Matcher(matcher.scenario, MatchOptions(tolerance=tolerance)).match(label), Match)


@pytest.mark.slow
def test_a_ranking_that_has_not_looked_at_all_says_so(run, crossroads, scenarios, monkeypatch):
    words = ("match", scenarios / "02_crossing_cars.scenic", crossroads, "--near", 2, "--jobs", 1, "--format", "ids")
    told = "warning[ranking-cut]: --near looked at 3 frames: others may come closer"
    assert told not in run(*words).stderr
    monkeypatch.setattr(LIMITS, "ranked_frames", 3)
    assert run(*words).stderr.count(told) == 1
    assert run(*words, "--summary").stderr.count(told) == 1


def test_the_ranking_leaves_out_what_cannot_be_among_the_closest(query):
    seen = []
    ranked = nearest_misses(query, 1, progress=seen.append)
    assert len(ranked) == 1
    assert len(seen) < query.dataset.manifest.total.frames / 2


def test_the_ranking_looks_at_so_many_frames_only(query):
    seen = []
    nearest_misses(query, 2, most_frames=5, progress=seen.append)
    assert len(seen) == 5


def test_all_matches_lists_every_correspondence(query, crossroads):
    every = Query(query.dataset, query.source, replace(SETTING, all_matches=True))
    results = list(every.results())
    once = list(query.results())
    assert [frame for frame, _ in itertools.groupby(result.frame for result in results)] == [r.frame for r in once]
    shown = [(result.frame, tuple(sorted(result.verdict.correspondence.items()))) for result in results]
    assert len(shown) == len(set(shown)) >= len(once)
    assert every.funnel.matches == query.funnel.matches == len(once)


def test_the_command_explains_and_writes_formulas(run, crossroads, scenarios, tmp_path):
    scenario = scenarios / "02_crossing_cars.scenic"
    found = run("match", scenario, crossroads, "--near", "1", "--format", "jsonl")
    *matches, near = [json.loads(line) for line in found.stdout.splitlines()]
    assert near["verdict"] == "no_match"
    assert near["cause"]["what"] == "tolerance"
    good = run("explain", scenario, crossroads, matches[0]["frame"])
    assert good.exit_code == 0
    assert "it matches with these values" in good.stdout
    bad = run("explain", scenario, crossroads, near["frame"], "--smt2", tmp_path / "formulas")
    assert bad.exit_code == 1
    assert "it would match with --tolerance" in bad.stdout
    files = sorted((tmp_path / "formulas").iterdir())
    assert files
    assert all("; verdict: " in file.read_text() for file in files)
    lost = run("explain", scenario, crossroads, "no-such-frame")
    assert lost.exit_code == 2
