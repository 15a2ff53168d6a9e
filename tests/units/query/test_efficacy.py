"""The efficacy experiment of the query paper (section 6.1) on its recordings, against an independent reading."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset

ROOT = Path(__file__).parents[3]
SCENARIOS = sorted((ROOT / "sample_data" / "scenarios").glob("0*.scenic"))
SOURCES = {
    "boston": ROOT.parent / "shared" / "data" / "boston",
    "crossroads": ROOT / "sample_data" / "crossroads",
}
OPTIONS = MatchOptions(tolerance=parse_tolerance("x=0.25,y=0.25,heading=5deg"), classes="coarse", radius=50.0)

sys.path.insert(0, str(ROOT / "tests" / "oracles" / "labels"))
import five_scenarios  # noqa: E402


@pytest.fixture(scope="module", params=SOURCES)
def data(request, tmp_path_factory) -> tuple[Path, Dataset]:
    source = SOURCES[request.param]
    if not source.exists():
        pytest.skip(f"{source} is not there: the recordings of the experiment are not free to redistribute")
    target = tmp_path_factory.mktemp("data") / request.param
    ingest(source, target)
    return source, open_dataset(target)


@pytest.fixture(scope="module")
def expected(data) -> dict[int, dict[str, list[dict[str, str]]]]:
    source, _ = data
    found = {}
    for number in range(1, 6):
        frames = five_scenarios.frames(
            source,
            number,
            tolerance_x=0.25,
            tolerance_y=0.25,
            heading_tolerance=math.radians(5),
            coarse=True,
            radius=50,
        )
        found[number] = {frame: ways for frame, ways in frames.items() if ways}
    return found


def verdicts(dataset: Dataset, number: int, **changes: object) -> dict[str, object]:
    match = replace(OPTIONS, **{k: v for k, v in changes.items() if k == "method"})  # type: ignore[arg-type]
    options = QueryOptions(match=match, solver="portable", prefilter=bool(changes.get("prefilter", True)))
    query = Query(dataset, read_program(SCENARIOS[number - 1]), options)
    return {result.frame: result.verdict for result in query.results()}


@pytest.mark.parametrize("number", range(1, 6))
@pytest.mark.parametrize("prefilter", [True, False], ids=["prefilter", "no prefilter"])
@pytest.mark.one_in(36)
def test_the_frames_are_those_of_the_independent_reading(data, expected, number, prefilter):
    found = verdicts(data[1], number, prefilter=prefilter)
    assert not any(isinstance(verdict, Unknown) for verdict in found.values())
    assert set(found) == set(expected[number])
    for frame, verdict in found.items():
        assert isinstance(verdict, Match)
        assert dict(verdict.correspondence) in expected[number][frame]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["smt", "monolithic"])
@pytest.mark.parametrize("number", range(1, 6))
@pytest.mark.parametrize("prefilter", [True, False], ids=["prefilter", "no prefilter"])
def test_the_solver_alone_finds_the_same_frames(data, expected, number, method, prefilter):
    found = verdicts(data[1], number, method=method, prefilter=prefilter)
    assert not any(isinstance(verdict, Unknown) for verdict in found.values())
    assert set(found) == set(expected[number])


def test_the_counts_of_the_paper_s_setting(data, expected):
    source, dataset = data
    if source.name == "boston":
        assert dataset.manifest.total.frames == 707
        assert [len(expected[number]) for number in range(1, 6)] == [69, 7, 2, 3, 0]
    else:
        assert all(0 < len(expected[number]) < dataset.manifest.total.frames for number in range(1, 6))
