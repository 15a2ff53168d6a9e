"""Predictions joined with labels, whatever a dataset and a file lack; against a plain loop."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenicq.errors import DataError
from scenicq.evaluate.detection import Detection, detect
from scenicq.evaluate.evaluation import evaluate
from scenicq.evaluate.precision import _interpolated
from scenicq.importers.predictions import PLAIN, THRESHOLDS_M, Predictions, Protocol
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

NEAREST = Protocol("nearest", tree=True, nearest_only=True, last_first=False)


def fleet(folder: Path, rng: np.random.Generator, frames: int, most: int, recordings: int = 2) -> Dataset:
    """Recordings of frames with up to some objects each, of two classes; many frames have none."""
    made = []
    for recording in range(recordings):
        labels = tuple(
            Label(f"r{recording}/{frame}", f"r{recording}", frame, "none", LabelObject("ego", "Car", "car", 0, 0, 0),
                  tuple(LabelObject(f"o{number}", *(("Car", "car") if number % 2 else ("Adult", "person")),
                                    *rng.uniform(-6, 6, 2).tolist(), 0.0, 2.0, 4.0)
                        for number in range(int(rng.integers(0, most + 1)))))
            for frame in range(frames)
        )  # fmt: skip
        made.append(Recording(f"r{recording}", "none", labels))
    write_dataset(folder, made, {}, name="fleet")
    return open_dataset(folder)


def boxes(names: list[str], rng: np.random.Generator, count: int, protocol: Protocol = PLAIN) -> Predictions:
    """Boxes anywhere, with few different scores."""
    unknown = np.full(count, math.nan)
    return Predictions(
        "boxes", protocol, names, rng.integers(0, max(len(names), 1), count).astype(np.int32), ["Car", "Adult"],
        rng.integers(0, 2, count).astype(np.int32), rng.uniform(-6, 6, count), rng.uniform(-6, 6, count),
        np.zeros(count), np.full(count, 2.0), np.full(count, 4.0), unknown, unknown, unknown,
        rng.integers(1, 6, count) / 5, unknown, [], np.full(count, -1, dtype=np.int8),
    )  # fmt: skip


def by_loop(found: Detection, threshold: float, *, nearest_only: bool) -> list[int]:
    """The label object of each prediction, one after the other in their order."""
    taken: set[int] = set()
    owners: list[int] = []
    for number in range(len(found.frame)):
        alike = np.flatnonzero(
            (found.objects.frame == found.frame[number]) & (found.object_class == found.prediction_class[number])
        )
        away = np.hypot(
            found.objects.x[alike] - found.predictions.x[number], found.objects.y[alike] - found.predictions.y[number]
        )
        order = [int(alike[place]) for place in np.argsort(away, kind="stable")]
        distance = dict(zip(alike.tolist(), away.tolist(), strict=True))
        asked = order[:1] if nearest_only else order
        its = next((each for each in asked if each not in taken), -1)
        if nearest_only and its >= 0:
            taken.add(its)
        if its >= 0 and distance[its] < threshold:
            taken.add(its)
            owners.append(its)
        else:
            owners.append(-1)
    return owners


@pytest.mark.parametrize("at_once", [1, 7, 10_000])
@pytest.mark.parametrize("protocol", [PLAIN, NEAREST])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.one_in(12)
def test_the_same_as_a_loop_in_pieces_of_any_size(tmp_path: Path, at_once: int, protocol: Protocol, seed: int) -> None:
    rng = np.random.default_rng(seed)
    dataset = fleet(tmp_path / "d", rng, 6, 5)
    names = [label.frame for label in dataset.labels()]
    found = detect(dataset, boxes(names, rng, 60, protocol), at_once=at_once)
    assert (np.diff(found.predictions.score) <= 0).all()
    for threshold in THRESHOLDS_M:
        owners = found.owner[threshold].tolist()
        assert owners == by_loop(found, threshold, nearest_only=protocol.nearest_only)
        assert threshold < 4 or max(owners) >= 0
        told = [-math.inf] * len(found.objects.frame)
        for number, owner in enumerate(owners):
            if owner >= 0:
                told[owner] = float(found.predictions.score[number])
        assert found.score[threshold].tolist() == told
    known = ~np.isnan(found.errors[:, 0])
    assert known.tolist() == [owner >= 0 for owner in found.owner[2.0]]


@pytest.mark.parametrize(("most", "count"), [(0, 0), (0, 5), (3, 0), (3, 5)])
@pytest.mark.parametrize("recordings", [1, 2])
@pytest.mark.one_in(4)
def test_datasets_and_files_may_be_empty(tmp_path: Path, most: int, count: int, recordings: int) -> None:
    rng = np.random.default_rng(1)
    dataset = fleet(tmp_path / "d", rng, 2, most, recordings)
    names = [label.frame for label in dataset.labels()]
    results = [{"frame": names[0], "recording": "r0", "timestamp_us": 0, "verdict": "match", "correspondence": {},
                "witness": {}}]  # fmt: skip
    for lacking in ({"verdict": "match"}, {"verdict": "match", "recording": "r0"}, {"verdict": "match", "frame": "x"}):
        with pytest.raises(DataError) as refused:
            evaluate([lacking], dataset, boxes(names, rng, count))
        assert refused.value.diagnostics[0].code == "file-invalid"
    for given in (results, []):
        judged = evaluate({"a": given}, dataset, boxes(names, rng, count))
        (one,) = judged.scenarios
        assert (one.matching, one.other) == (len(given), len(names) - len(given))
        assert 0 <= one.all_objects.share.missed <= one.all_objects.share.of
        assert one.all_objects.sentence


@pytest.mark.parametrize("of_ego", [False, True])
def test_boxes_of_the_other_frame_of_reference_are_refused(tmp_path: Path, *, of_ego: bool) -> None:
    """Near the origin of a map the distance from the ego says nothing; where the boxes fit does."""
    rng = np.random.default_rng(4)
    labels, on_map, seen = [], [], []
    for frame in range(12):
        turn = 0.4 * frame - 2
        ego = LabelObject("ego", "Car", "car", 100.0 - 15 * frame, 60.0, turn)
        away = rng.uniform(-40, 40, (4, 2))
        objects = [
            LabelObject(f"o{number}", "Car", "car", ego.x + dx, ego.y + dy, 0.0, 2.0, 4.0)
            for number, (dx, dy) in enumerate(away.tolist())
        ]
        labels.append(Label(f"r/{frame:02}", "r", frame, "none", ego, tuple(objects)))
        on_map += [(each.x, each.y) for each in objects]
        ahead, left = (-math.sin(turn), math.cos(turn)), (-math.cos(turn), -math.sin(turn))
        seen += [(float(each @ ahead), float(each @ left)) for each in away]
    write_dataset(tmp_path / "d", [Recording("r", "none", tuple(labels))], {}, name="d")
    dataset = open_dataset(tmp_path / "d")
    plain = boxes([label.frame for label in labels], rng, 48)
    frame = np.repeat(np.arange(12), 4).astype(np.int32)
    placed = {
        which: replace(plain, frame=frame, category=np.zeros(48, dtype=np.int32), x=np.array(at)[:, 0],
                       y=np.array(at)[:, 1], of_ego=of_ego)
        for which, at in (("map", on_map), ("ego", seen))
    }  # fmt: skip
    right, wrong = ("ego", "map") if of_ego else ("map", "ego")
    assert (detect(dataset, placed[right]).owner[0.5] >= 0).all()
    with pytest.raises(DataError, match=f"were they in the frame of the {wrong}") as refused:
        detect(dataset, placed[wrong])
    assert refused.value.diagnostics[0].code == "predictions-frame"
    # a model that finds nothing is no mistake of the file
    lost = replace(placed[right], x=placed[right].x + 200.0)
    assert (detect(dataset, lost).owner[4.0] < 0).mean() > 0.9


def test_rows_are_interpolated_as_numpy_does_each() -> None:
    rng = np.random.default_rng(2)
    at = np.linspace(0, 1, 101)
    for _ in range(30):
        x = np.sort(rng.integers(0, 12, (6, 9)) / 11, axis=1)
        y = rng.random((6, 9))
        found = _interpolated(at, x, y)
        for row in range(6):
            assert found[row] == pytest.approx(np.interp(at, x[row], y[row], right=0), abs=1e-12)
