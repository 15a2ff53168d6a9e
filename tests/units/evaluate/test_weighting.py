"""Frames weighted to the program's own distribution: shares are those that the program's scenes would have."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenicq.errors import DataError, Source
from scenicq.evaluate.evaluation import evaluate
from scenicq.evaluate.ranking import rank_results
from scenicq.evaluate.rows import evaluation_record
from scenicq.evaluate.weighting import log_weights, weigh
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

PROGRAM = Source(
    "gap.scenic",
    "ego = new Object at (0, 0), facing 0\nother = new Object at (Range(-1, 1), Range(0, 20)), facing 0\n",
)


def test_values_are_spread_as_the_program_spreads_them() -> None:
    """Skewed values of a uniform variable have the mean of the uniform distribution when they are weighted."""
    rng = np.random.default_rng(3)
    values = np.column_stack((rng.beta(1, 2, 1500), rng.uniform(0, 5, 1500)))
    weights = np.exp(log_weights(np.zeros(1500), values, [()] * 1500))
    assert weights.mean() == pytest.approx(1)
    assert np.average(values[:, 0]) == pytest.approx(1 / 3, abs=0.02)
    assert np.average(values[:, 0], weights=weights) == pytest.approx(0.5, abs=0.05)
    assert np.average(values[:, 0] < 0.2, weights=weights) == pytest.approx(0.2, abs=0.03)
    assert np.average(values[:, 1], weights=weights) == pytest.approx(2.5, abs=0.15)


def test_the_programs_density_counts() -> None:
    rng = np.random.default_rng(4)
    values = rng.uniform(0, 1, (2000, 1))
    weights = np.exp(log_weights(np.log(2 * values[:, 0]), values, [()] * 2000))
    assert np.average(values[:, 0], weights=weights) == pytest.approx(2 / 3, abs=0.02)


def test_finite_choices_are_weighted_by_how_often_they_come() -> None:
    rng = np.random.default_rng(5)
    often = rng.random(1000) < 0.85
    weights = np.exp(log_weights(np.zeros(1000), rng.uniform(0, 1, (1000, 1)), [(bool(each),) for each in often]))
    assert weights[often].sum() / weights.sum() == pytest.approx(0.5, abs=0.05)


def test_many_frames_are_estimated_from_some_of_them() -> None:
    rng = np.random.default_rng(6)
    values = rng.beta(2, 1, (5000, 1))
    weights = np.exp(log_weights(np.zeros(5000), values, [()] * 5000))
    assert np.average(values[:, 0], weights=weights) == pytest.approx(0.5, abs=0.04)


@pytest.mark.parametrize(
    ("shape", "nuisance", "within"), [((1, 2), 0, 0.03), ((1, 2), 1, 0.03), ((1, 3), 1, 0.05), ((1, 2), 3, 0.03)]
)
def test_what_is_rare_counts_as_much_as_the_program_says(shape: tuple[int, int], nuisance: int, within: float) -> None:
    """A quarter of the program's values, 43 to 58 % of the dataset's; further variables that say nothing."""
    shares, plain = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        values = np.column_stack((rng.beta(*shape, 450), *rng.uniform(0, 1, (nuisance, 450))))
        near = values[:, 0] < 0.25
        shares.append(np.average(near, weights=np.exp(log_weights(np.zeros(450), values, [()] * 450))))
        plain.append(near.mean())
    assert np.mean(plain) > 0.42
    assert np.mean(shares) == pytest.approx(0.25, abs=within)


def test_a_frame_alone_of_its_kind_is_one_of_them() -> None:
    kinds = [("a",)] * 5 + [("b",)]
    weights = np.exp(log_weights(np.zeros(6), np.zeros((6, 0)), kinds))
    assert weights.tolist() == pytest.approx([0.6] * 5 + [3.0])


@pytest.mark.parametrize("values", [np.zeros((0, 2)), np.ones((3, 2)), np.zeros((2, 0)), np.array([[0.0], [1e9]])])
def test_few_or_equal_frames_have_equal_weights(values: np.ndarray) -> None:
    count = len(values)
    assert log_weights(np.zeros(count), values, [()] * count).tolist() == pytest.approx([0.0] * count)


def test_objects_without_a_density_are_left_out() -> None:
    log_weight = np.array([0.0, math.log(3), math.nan])
    found = weigh("x", np.array([True, False, True]), log_weight, np.array([0, 1, 1]))
    assert found.share.rate == pytest.approx(0.25)
    assert (found.objects, found.left_out) == (2, 1)
    assert found.equal == pytest.approx(16 / 10)
    assert "1 without a density are left out" in found.sentence
    none = weigh("x", np.ones(1, dtype=bool), np.array([math.nan]), np.zeros(1, dtype=int))
    assert none.sentence.endswith("no density is known")


@pytest.fixture(scope="module")
def query(tmp_path_factory: pytest.TempPathFactory) -> Query:
    """Objects that are more often near than the program says."""
    rng = np.random.default_rng(7)
    recordings = []
    for number in range(30):
        labels = tuple(
            Label(f"{number:02}/{frame:02}", f"r{number:02}", frame, "none",
                  LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0),
                  (LabelObject("a", "Car", "car", rng.uniform(-1, 1), 20 * rng.beta(1, 2), 0.0, 2.0, 4.0),))
            for frame in range(15)
        )  # fmt: skip
        recordings.append(Recording(f"r{number:02}", "none", labels))
    folder = tmp_path_factory.mktemp("near") / "d"
    write_dataset(folder, recordings, {}, name="near")
    return Query(open_dataset(folder), PROGRAM)


@pytest.fixture(scope="module")
def ranked(query: Query) -> list[Result]:
    return rank_results(query, query.results())


def predictions(query: Query, file: Path) -> Path:
    """A model that sees nothing nearer than 5 m: a quarter of what the program makes."""
    lines = []
    for label in query.dataset.labels():
        boxes = [
            {"class": "Car", "position": [o.x, o.y], "heading": 0, "width": 2, "length": 4, "score": 1}
            for o in label.objects
            if o.y > 5
        ]
        lines.append(json.dumps({"id": label.frame, "objects": boxes}))
    file.write_text("\n".join(lines))
    return file


def test_matches_of_equal_density_keep_their_order(query: Query, ranked: list[Result]) -> None:
    assert {round(each.density.log, 9) for each in ranked if each.density and each.density.log} == {
        round(-math.log(40), 9)
    }
    assert [each.frame for each in ranked] == [label.frame for label in query.dataset.labels()]


def test_a_share_missed_is_that_of_the_programs_scenes(query: Query, ranked: list[Result], tmp_path: Path) -> None:
    found = evaluate({"near": ranked}, query.dataset, predictions(query, tmp_path / "boxes.jsonl"))
    (one,) = found.scenarios[0].weighted
    assert found.scenarios[0].roles[0].share.rate > 0.38
    assert one.share.rate == pytest.approx(0.25, abs=0.06)
    assert one.share.interval[0] < one.share.rate < one.share.interval[1] < 0.38
    assert one.objects == len(ranked) == 450
    assert 100 < one.equal < 450
    assert one.left_out == 0
    told = evaluation_record(found)["scenarios"][0]["weighted"][0]
    assert told["sentence"] == one.sentence
    assert one.sentence.startswith("missed ")


def test_without_densities_nothing_is_weighted(query: Query, ranked: list[Result], tmp_path: Path) -> None:
    file = predictions(query, tmp_path / "boxes.jsonl")
    plain = [replace(each, density=None) for each in ranked]
    assert evaluate({"near": plain}, query.dataset, file).scenarios[0].weighted == ()
    fixed = Source("fixed.scenic", "ego = new Object at (0, 0), facing 0\n")
    results = rank_results(other := Query(query.dataset, fixed), list(Query(query.dataset, fixed).results()))
    assert other.dataset is query.dataset
    (one,) = evaluate({"fixed": results}, query.dataset, file).scenarios[0].weighted
    assert one.objects == 0
    assert one.left_out > 0


def test_weights_of_files_are_read_and_checked(query: Query, tmp_path: Path) -> None:
    file = predictions(query, tmp_path / "boxes.jsonl")
    known = {"frame": "00/00", "recording": "r00", "timestamp_us": 0, "verdict": "match", "witness": {},
             "correspondence": {"other": "a"}}  # fmt: skip
    (one,) = evaluate([known | {"log_weight": "0.5"}], query.dataset, file).scenarios[0].weighted
    assert one.share.of == pytest.approx(math.exp(0.5))
    for wrong in ("much", "inf", 1e9):
        with pytest.raises(DataError) as refused:
            evaluate([known | {"log_weight": wrong}], query.dataset, file)
        assert refused.value.diagnostics[0].code == "file-invalid"
