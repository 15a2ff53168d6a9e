"""The figures of a benchmark as a whole, worked out by hand: classes without labels count as the benchmark counts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenicq.evaluate.benchmark import benchmark_figures
from scenicq.evaluate.detection import DISTANCES, DetectionDistances, detect
from scenicq.importers.predictions import ARGOVERSE2, NUSCENES, PLAIN, Predictions, Protocol
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, OutOfPlane, Recording
from scenicq.store.writer import write_dataset

FRAMES, FLAT = 4, OutOfPlane(0.0, 0.0, 0.0)
SOURCES = {"nuscenes": ("vehicle.car", "human.pedestrian.adult"), "argoverse2": ("REGULAR_VEHICLE", "PEDESTRIAN")}
NAMES = {"nuscenes": ("car", "pedestrian"), "argoverse2": ("REGULAR_VEHICLE", "PEDESTRIAN")}


def places(number: int) -> tuple[float, float]:
    return 6.0 * number - 9, 12.0 + number


@pytest.fixture(params=["nuscenes", "argoverse2"])
def protocol(request) -> Protocol:
    return {"nuscenes": NUSCENES, "argoverse2": ARGOVERSE2}[request.param]


@pytest.fixture
def dataset(protocol, tmp_path) -> Dataset:
    """Frames with two cars and two people each, all known but attributes."""
    sources = SOURCES.get(protocol.name, ("car", "person"))
    labels = tuple(
        Label(
            f"f{n}", "r", 500_000 * n, "none", LabelObject("ego", "Car", "car", 0, 0, 0, out_of_plane=FLAT),
            tuple(
                LabelObject(f"o{k}", ("Car", "Adult")[k % 2], sources[k % 2], *places(k), 0.0, width=2.0, length=4.0,
                            height=1.5, velocity=(0.0, 1.0), out_of_plane=FLAT)
                for k in range(4)
            ),
        )
        for n in range(FRAMES)
    )  # fmt: skip
    write_dataset(tmp_path / "d", [Recording("r", "none", labels)], {}, name="d")
    return open_dataset(tmp_path / "d")


def found_boxes(protocol: Protocol, classes: tuple[int, ...], away: float, turn: float) -> Predictions:
    """Every object of some classes, some metres off and turned."""
    rows = [(n, k) for n in range(FRAMES) for k in range(4) if k % 2 in classes]
    count = len(rows)
    xy = np.array([places(k) for _, k in rows]).reshape(-1, 2)
    return Predictions(
        "boxes", protocol, [f"f{n}" for n in range(FRAMES)], np.array([n for n, _ in rows], dtype=np.int32),
        list(NAMES.get(protocol.name, ("Car", "Adult"))), np.array([k % 2 for _, k in rows], dtype=np.int32),
        xy[:, 0] + away, xy[:, 1], np.full(count, turn), np.full(count, 2.0), np.full(count, 4.0), np.full(count, 1.5),
        np.zeros(count), np.ones(count), np.linspace(0.9, 0.5, count), np.zeros(count), [],
        np.full(count, -1, dtype=np.int8),
    )  # fmt: skip


def test_what_is_found_exactly(dataset, protocol):
    told = benchmark_figures(detect(dataset, found_boxes(protocol, (0, 1), 0.0, 0.0)))
    assert (told.frames, told.all_frames) == (FRAMES, FRAMES)
    if protocol is NUSCENES:
        errors = {"translation": 8 / 10, "scale": 8 / 10, "orientation": 7 / 9, "velocity": 6 / 8, "attribute": 1.0}
        assert told.average_precision == pytest.approx(2 / 10)
        assert told.score == pytest.approx((5 * 0.2 + sum(1 - each for each in errors.values())) / 10)
        assert len(told.without_labels) == 8
    else:
        errors = {"translation": 24 / 26 * 2, "scale": 24 / 26, "orientation": 24 / 26 * math.pi}
        assert told.average_precision == pytest.approx(2 / 26)
        assert told.score == pytest.approx(2 / 26)
    assert dict(told.errors) == pytest.approx(errors)
    assert told.measure in told.sentence


def test_what_is_found_a_metre_off_and_turned(dataset, protocol):
    """At 0.5 m nothing is found, at 1, 2 and 4 m everything; of people nothing is."""
    told = benchmark_figures(detect(dataset, found_boxes(protocol, (0,), 0.75, 0.3)))
    classes = 10 if protocol is NUSCENES else 26
    assert told.average_precision == pytest.approx(3 / 4 / classes)
    largest = protocol.largest_errors["translation"]
    assert told.errors["translation"] == pytest.approx((0.75 + (classes - 1) * largest) / classes)
    if protocol is ARGOVERSE2:
        kept = np.mean([1 - 0.75 / 2, 1.0, 1 - 0.3 / math.pi])
        assert told.score == pytest.approx(3 / 4 * kept / 26)


@pytest.mark.parametrize("protocol", [PLAIN], ids=["interchange"])
def test_labels_of_the_interchange_format_have_none(dataset, protocol):
    assert benchmark_figures(detect(dataset, found_boxes(protocol, (0, 1), 0.0, 0.0))) is None


def test_a_class_may_have_a_distance_of_its_own(dataset, protocol):
    car, person = NAMES.get(protocol.name, ("", ""))
    found = detect(dataset, found_boxes(protocol, (0, 1), 0.75, 0.0))
    assert found.classes.index(car) != found.classes.index(person)
    for said, missed in (
        ("2", set()),
        ("0.5", {car, person}),
        (f"2,{person}=0.5", {person}),
        ({"": 0.5, car: 4}, {person}),
    ):
        within = DetectionDistances.of(DISTANCES.read(said))
        lost = {found.classes[n] for n in found.object_class[np.isneginf(found.found_score(within))]}
        false = {found.classes[n] for n in found.prediction_class[found.is_false(within)]}
        assert lost == false == missed, said


@pytest.mark.parametrize("said", ["3", "2,", "2,car=3", "car=2,car=1", "=", "nan", {}, {"car": "x"}, None, True])
def test_what_is_no_distance(said):
    with pytest.raises((ValueError, OverflowError)):
        DISTANCES.read(said)
