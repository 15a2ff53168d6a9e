"""How alike those are who are compared: shares and means by a loop over weights, and that a page shows them."""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from scenicq.evaluate.balance import balance
from scenicq.evaluate.clusters import find_clusters, parameters_of
from scenicq.evaluate.evaluation import Evaluation, evaluate
from scenicq.evaluate.pages import write_pages
from scenicq.evaluate.rows import balance_table, evaluation_record
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query
from scenicq.store.dataset import Dataset

PARKED = Path(__file__).parents[3] / "sample_data" / "parked"


@pytest.fixture(scope="module")
def judged(street: Dataset) -> Evaluation:
    query = Query(street, read_program(PARKED / "parked_car.scenic"))
    return evaluate({"parked_car": query}, street, PARKED / "predictions.jsonl")


def test_shares_and_means_are_those_of_a_loop(judged: Evaluation) -> None:
    (scenario,) = judged.scenarios
    (role,), (told,) = scenario.roles, scenario.balances
    groups, detection = role.groups, judged.detection
    assert groups is not None
    assert groups.weight.sum() == pytest.approx(1)
    assert len(groups.own) == role.share.of
    assert not set(groups.own.tolist()) & set(groups.others.tolist())
    own: defaultdict[str, float] = defaultdict(float)
    others: defaultdict[str, float] = defaultdict(float)
    for number in groups.own.tolist():
        frame = int(detection.objects.frame[number])
        own[detection.frames.recordings[int(detection.frames.recording[frame])]] += 1 / len(groups.own)
    for number, weight in zip(groups.others.tolist(), groups.weight.tolist(), strict=True):
        frame = int(detection.objects.frame[number])
        others[detection.frames.recordings[int(detection.frames.recording[frame])]] += weight
    recording = next(each for each in told.covariates if each.by == "recording")
    for name, mine, theirs in recording.parts[:-1]:
        assert (mine, theirs) == pytest.approx((own[name], others[name]))
    assert recording.common == pytest.approx(sum(min(own[name], others[name]) for name in own | others))
    distance = told.covariates[0]
    away = [math.dist((detection.objects.x[n], detection.objects.y[n]),
                      (detection.frames.ego_x[detection.objects.frame[n]],
                       detection.frames.ego_y[detection.objects.frame[n]])) for n in groups.own.tolist()]  # fmt: skip
    assert distance.means[0] == pytest.approx(np.mean(away))
    for each in told.covariates:
        assert sum(mine for _, mine, _ in each.parts) == pytest.approx(1)
        assert sum(theirs for _, _, theirs in each.parts) == pytest.approx(1)
        assert len(each.parts) <= 12


def test_classes_of_distance_hold_what_lies_in_them(judged: Evaluation) -> None:
    (role,) = judged.scenarios[0].roles
    told = balance(role, judged.detection, {})
    assert told is not None
    assert role.groups is not None
    away = judged.detection.distance[role.groups.own]
    for name, own, _ in told.covariates[0].parts:
        low, high = float(name.split()[0]), float(name.split()[2])
        assert own == pytest.approx(np.mean((away >= low) & (away < high)))
    clusters = find_clusters(judged.detection.frames)
    assert [each.by for each in judged.scenarios[0].balances[0].covariates[2:]] == [
        f"param {name}" for name in parameters_of(judged.detection.frames, clusters)
    ]


def test_a_page_begins_with_what_was_found(judged: Evaluation, street: Dataset, tmp_path: Path) -> None:
    """In one sentence: what, how surely, against whom, and what was not looked at; then how alike they are."""
    (scenario,) = judged.scenarios
    finding = scenario.roles[0].finding(scenario.undecided)
    for part in ("more often than others that are alike", "95 % interval", "recordings)", "beside others of the same"):
        assert part in finding
    text = write_pages(judged, street, tmp_path / "pages").read_text(encoding="utf-8")
    title = balance_table(scenario.balances[0])[0].removeprefix("role ")
    assert text.index(finding.replace("<", "&lt;")) < text.index(title) < text.index(scenario.roles[0].sentence[:20])
    record = evaluation_record(judged)["scenarios"][0]
    assert record["findings"] == [finding]
    assert record["balance"][0]["about"] == "role parkedCar"


def test_what_was_not_looked_at_is_said(judged: Evaluation) -> None:
    (role,) = judged.scenarios[0].roles
    assert "7 undecided frames" in role.finding(7)
    without = role.asked - sum(role.places)
    assert (f"{without:,} of {role.asked:,} objects" in role.finding(0)) == bool(without)
