"""The five scenarios of the query paper on every sample source: an answer, or what the dataset lacks for one."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenicq.errors import ScenarioError
from scenicq.importers.ingest import ingest
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.frame_explanation import explain, show_explanation
from scenicq.store.dataset import Dataset, open_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"
SCENARIOS = sorted((SAMPLES / "scenarios").glob("*.scenic"))
WITHOUT_MAP = ("kitti_tiny", "openlabel_tiny")
MATCHES = {"crossroads": [19, 5, 3, 7, 4], "nuscenes_tiny": [4, 0, 0, 0, None]}
"""Matches of each scenario, None where the map has no two lanes beside each other; elsewhere there are none."""


@pytest.fixture(params=["crossroads", *sorted(path.name for path in SAMPLES.glob("*_tiny")), "interaction_tiny none"])
def dataset(request: pytest.FixtureRequest, tmp_path: Path) -> Dataset:
    name, _, ego = request.param.partition(" ")
    ingest(SAMPLES / name, tmp_path / name, ego=ego or None)
    return open_dataset(tmp_path / name)


def lacking(error: ScenarioError, dataset: Dataset) -> None:
    """What is lacking is told with the dataset."""
    (diagnostic,) = error.diagnostics
    assert diagnostic.code == "map-lacks"
    assert dataset.name in diagnostic.message
    assert diagnostic.span is not None
    assert diagnostic.hints


@pytest.mark.one_in(4)
def test_every_scenario_has_an_answer(dataset: Dataset) -> None:
    labels = list(dataset.labels())
    options = MatchOptions(tolerance=EXACT, ego="label" if labels[0].has_ego else "any")
    counts: list[int | None] = []
    for path in SCENARIOS:
        query = Query(dataset, read_program(path), QueryOptions(options, every=True))
        try:
            results = list(query.results())
        except ScenarioError as error:
            lacking(error, dataset)
            counts.append(None)
            continue
        assert query.funnel.frames == len(results) == len(labels)
        for result in results:
            assert isinstance(result.verdict, Match | NoMatch)
            assert isinstance(result.verdict, Match) or result.verdict.cause.what
        counts.append(sum(isinstance(result.verdict, Match) for result in results))
        label = labels[len(labels) // 2]
        scenario, _ = query.compile(label.map)
        text = show_explanation(explain(Matcher(scenario, options), label))
        assert text.startswith(f"frame {label.frame} ")
        assert "it matches with these values" in text or ("excluded" in text and path.name in text)
        assert "Traceback" not in text
    name = Path(dataset.name).name
    assert counts == ([None] * 5 if name in WITHOUT_MAP else MATCHES.get(name, [0, 0, 0, 0, None]))
