"""Recordings beside the simulated runs that rebuild them: by least squares, by chance, and by the command."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from scenicq.evaluate.paired_runs import PairedRuns, pair_runs
from scenicq.store.dataset import Dataset

PARKED = Path(__file__).parents[3] / "sample_data" / "parked"


def drawn(seed: int, recordings: int, scenes: int, noise: float, *, foretells: bool = True) -> PairedRuns:
    """Scenes of which the first are recorded; simulation knows how hard each is, or nothing of it."""
    rng = np.random.default_rng((seed, recordings))
    hard = rng.beta(2, 5, scenes)
    known = np.clip(0.8 * hard + 0.1 + rng.normal(0, noise, scenes), 0, 1) if foretells else rng.beta(2, 5, scenes)
    scene = np.repeat(np.arange(scenes), 20)
    failed = (rng.random(len(scene)) < known[scene]).astype(np.float64)
    cluster = np.repeat(np.arange(recordings), 12)
    missed = rng.random(len(cluster)) < hard[cluster]
    found = pair_runs(failed, np.where(scene < recordings, scene, -1), scene, missed, cluster, "recording")
    assert found is not None
    return found


def test_the_slope_is_that_of_least_squares() -> None:
    """Weighted by the objects of each recording, with an intercept."""
    rng = np.random.default_rng(5)
    cluster = np.repeat(np.arange(10), rng.integers(3, 20, 10))
    hard = rng.random(10)
    missed = rng.random(len(cluster)) < hard[cluster]
    scene = np.arange(300)
    failed = np.concatenate((np.clip(hard + rng.normal(0, 0.1, 10), 0, 1), rng.random(290)))
    found = pair_runs(failed, np.where(scene < 10, scene, -1), scene, missed, cluster, "recording")
    assert found is not None
    of = np.bincount(cluster)
    real = np.bincount(cluster, missed) / of
    root = np.sqrt(of * of)  # a cluster departs by its weight times the difference
    (_, slope), *_ = np.linalg.lstsq(
        np.column_stack((root, root * (failed[:10] - np.average(failed[:10], weights=of)))),
        root * (real - np.average(real, weights=of)), rcond=None,
    )  # fmt: skip
    plain = np.average(real, weights=of)
    wanted = plain - slope * (np.average(failed[:10], weights=of) - failed.mean())
    assert found.real.rate == pytest.approx(plain)
    assert found.difference == pytest.approx(plain - np.average(failed[:10], weights=of))
    assert found.adjusted[0] == pytest.approx(wanted, abs=0.02)
    assert 0.5 < found.explained < 1


@pytest.mark.slow
@pytest.mark.parametrize(("recordings", "noise"), [(8, 0.02), (12, 0.02), (12, 0.1), (30, 0.02)])
def test_intervals_hold_the_truth_and_are_narrower(recordings, noise) -> None:
    found = [drawn(seed, recordings, 200, noise) for seed in range(400)]
    used = [each for each in found if not math.isnan(each.adjusted[0])]
    assert len(used) > 200
    held = np.mean([each.adjusted[1][0] <= 2 / 7 <= each.adjusted[1][1] for each in used])
    assert held > 0.93 - 0.022
    widths = np.mean([(each.adjusted[1][1] - each.adjusted[1][0], each.real.interval[1] - each.real.interval[0])
                      for each in used], axis=0)  # fmt: skip
    assert widths[0] < 0.95 * widths[1]


def test_what_simulation_does_not_foretell_is_left_out() -> None:
    """By half of the datasets it explains less than chance would: nothing is taken from it."""
    found = [drawn(seed, 12, 60, 0.0, foretells=False) for seed in range(40)]
    nothing = [each for each in found if each.explained <= 0]
    assert len(nothing) > 15
    assert all(math.isnan(each.adjusted[0]) for each in nothing)
    assert all("nothing is taken from it" in each.sentence for each in nothing)


def test_what_cannot_be_taken_from_simulation() -> None:
    """Fewer than five pairs, recordings without runs, and runs of nothing but the recordings."""
    few = drawn(1, 4, 50, 0.02)
    assert math.isnan(few.interval[0])
    assert math.isnan(few.explained)
    alone = drawn(1, 20, 20, 0.02)
    assert alone.explained > 0
    assert math.isnan(alone.adjusted[0])
    scene = np.arange(10)
    cluster = np.repeat(np.arange(12), 5)
    missed = np.random.default_rng(2).random(60) < (cluster / 12)
    found = pair_runs(scene / 12, scene, scene, missed, cluster, "drive")
    assert found is not None
    assert (found.pairs, found.without) == (10, 2)
    assert math.isnan(found.adjusted[0])
    assert "10 drives that runs rebuild" in found.sentence
    assert pair_runs(scene / 12, np.full(10, -1), scene, missed, cluster, "drive") is None


def evaluated(run: Callable[..., Result], street: Dataset, runs: Path) -> Result:
    return run("evaluate", PARKED / "parked_car.scenic", street.path, "--predictions", PARKED / "predictions.jsonl",
               "--simulated", runs, "--format", "json")  # fmt: skip


@pytest.mark.parametrize("column", ["recording", "frame"])
@pytest.mark.one_in(2)
def test_the_command_pairs_runs_with_what_they_rebuild(
    run: Callable[..., Result], street: Dataset, tmp_path: Path, column: str
) -> None:
    plain = json.loads(evaluated(run, street, PARKED / "runs.csv").stdout)["scenarios"][0]
    assert plain["simulated"]["paired"] is None
    labels = [json.loads(line) for line in (PARKED / "labels.jsonl").read_text().splitlines()]
    rebuilt = sorted({each["recording"] for each in labels})
    if column == "frame":
        rebuilt = [next(each["id"] for each in labels if each["recording"] == name) for name in rebuilt]
    runs = tmp_path / "runs.csv"
    lines = [f"parked_car,{number % 2},{name}" for number, name in enumerate(rebuilt)] + ["parked_car,1,"] * 40
    runs.write_text("\n".join([f"scenario,failed,{column}", *lines]))
    found = json.loads(evaluated(run, street, runs).stdout)["scenarios"][0]
    paired = found["simulated"]["paired"]
    assert paired["pairs"] == found["roles"][0]["recordings"]
    assert paired["without_runs"] == 0
    assert paired["missed"]["rate"] == pytest.approx(found["roles"][0]["missed"]["rate"])
    assert paired["sentence"] in found["simulated"]["sentence"]
    runs.write_text(f"scenario,failed,{column}\nparked_car,1,elsewhere\n")
    done = evaluated(run, street, runs)
    assert done.exit_code == 2
    assert "a run rebuilds `elsewhere`" in done.stderr
