"""`--near` over time: the recordings that come closest, and what would let each through."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from scenicq.errors import Source
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.nearest_interval import nearest_intervals
from scenicq.store.dataset import open_dataset
from scenicq.temporal.interval_options import IntervalOptions

HEAD = """from math import cos, sin
model scenic.domains.driving.model
def ahead(thing):
    return (distance from ego to thing) * cos((angle from ego to thing) - ego.heading)
ego = new Car
"""
OPTIONS = QueryOptions(match=MatchOptions(tolerance=parse_tolerance("position=0.25,heading=5deg")), solver="portable")
FOR_SECONDS = replace(OPTIONS, time=IntervalOptions(min_duration_s=3))


def ask(dataset, program, options=OPTIONS):
    return Query(open_dataset(dataset), Source("program.scenic", HEAD + program), options)


def matching(query):
    return {each.recording for each in query.results() if isinstance(each.verdict, Match)}


def with_tolerance(text, program, dataset):
    options = replace(FOR_SECONDS, match=replace(FOR_SECONDS.match, tolerance=parse_tolerance(text)))
    return ask(dataset, program, options)


@pytest.mark.slow
def test_under_the_tolerance_that_is_told_the_recording_matches_and_under_a_smaller_one_it_does_not(crossroads):
    program = "other = new Car ahead of ego by Range(3, 20)\n"
    query = ask(crossroads, program, FOR_SECONDS)
    found = nearest_intervals(query, 2)
    assert len(found) == 2
    assert not {each.recording for each in found} & matching(query)
    for each in found:
        assert isinstance(each.verdict, NoMatch)
        assert each.interval is not None
        assert set(each.verdict.partial) == {"ego", "other"}
        told = each.verdict.cause.detail.removeprefix("would match with ")
        assert each.recording in matching(with_tolerance(told, program, crossroads))
    metres = float(re.search(r"position=([\d.]+)", found[0].verdict.cause.detail).group(1))
    for text, matches in ((f"position={metres}", True), (f"position={0.97 * metres}", False)):
        # no other recording is closer
        assert (matching(with_tolerance(text, program, crossroads)) > matching(query)) == matches


@pytest.mark.slow
def test_a_ranking_that_has_not_looked_at_all_recordings_says_so(crossroads, monkeypatch):
    program = "parked = new Car\nrequire (distance to parked) < 30\nrequire always parked.speed < 0.2\n"
    for most, cut in ((200, []), (1, ["ranking-cut"])):
        monkeypatch.setattr(LIMITS, "ranked_recordings", most)
        query = ask(crossroads, program)
        nearest_intervals(query, 3)
        assert [each.code for each in query.funnel.warnings if each.code == "ranking-cut"] == cut


@pytest.mark.slow
def test_with_the_number_that_is_told_the_recording_matches(crossroads):
    program = "parked = new Car\nrequire (distance to parked) < 30\nrequire always parked.speed < 0.2\n"
    query = ask(crossroads, program)
    first, *more = nearest_intervals(query, 3)
    amounts = []
    for each in (first, *more):
        told = re.fullmatch(r"`parked.speed < 0.2` would do with ([\d.]+) instead of 0.2", each.verdict.cause.detail)
        assert each.recording not in matching(query)
        assert each.verdict.cause.place.startswith("program.scenic:8:")
        assert each.recording in matching(ask(crossroads, program.replace("0.2", told.group(1))))
        amounts.append(float(told.group(1)))
    assert amounts == sorted(amounts)
    assert matching(ask(crossroads, program.replace("0.2", str(0.99 * amounts[0])))) == matching(query)


@pytest.mark.slow
def test_a_number_that_is_not_enough_is_not_told(crossroads):
    # both requirements are broken, so that no number helps alone; and no tolerance does
    program = (
        "other = new Car\nrequire 5 < ahead(other) < 60 and other.speed > 1\n"
        "require eventually other.speed > 50\nrequire eventually ego.speed > 60\nterminate after 2 seconds\n"
    )
    assert nearest_intervals(ask(crossroads, program), 3) == []


@pytest.mark.slow
def test_from_the_command_line(run, crossroads, tmp_path):
    path = tmp_path / "parked.scenic"
    path.write_text(HEAD + "parked = new Car\nrequire always parked.speed < 0.2\n", encoding="utf-8")
    words = ("--near", 1, "--report", tmp_path / "report", "--format", "table", "--jobs", 1)
    done = run("match", path, crossroads, *words)
    assert done.exit_code == 0
    assert "no_match: `parked.speed < 0.2` would do with" in " ".join(done.stdout.split())
    page = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "near miss" in page


@pytest.mark.slow
def test_an_interval_that_is_too_short_says_which_duration_would_do(crossroads):
    program = "other = new Car ahead of ego by Range(3, 20)\n"
    options = replace(FOR_SECONDS, time=IntervalOptions(min_duration_s=20))
    query = ask(crossroads, program, options)
    assert not matching(query)
    first = nearest_intervals(query, 1)[0]
    told = re.fullmatch(r"would match with --min-duration ([\d.]+)", first.verdict.cause.detail)
    shorter = replace(FOR_SECONDS, time=IntervalOptions(min_duration_s=float(told.group(1))))
    longer = replace(FOR_SECONDS, time=IntervalOptions(min_duration_s=float(told.group(1)) + 0.02))
    assert matching(ask(crossroads, program, shorter)) == {first.recording}
    assert not matching(ask(crossroads, program, longer))


@pytest.mark.slow
def test_a_number_that_the_program_says_twice_is_one_number(crossroads):
    program = (
        "walker = new Pedestrian\nrequire (distance to walker) > 3\nrequire eventually (distance to walker) < 1\n"
        "terminate when (distance to walker) < 1\n"
    )
    query = ask(crossroads, program)
    assert not matching(query)
    first = nearest_intervals(query, 1)[0]
    told = re.fullmatch(r"`\(distance to walker\) < 1` would do with ([\d.]+) instead of 1", first.verdict.cause.detail)
    assert matching(ask(crossroads, program.replace("< 1", f"< {float(told.group(1)) + 0.001}"))) == {first.recording}
