"""A whole evaluation on the sample data: figures, errors by name, intervals of recordings, several scenarios."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from shapely.geometry import Polygon

from scenicq.errors import DataError
from scenicq.evaluate.comparison import Share
from scenicq.evaluate.detection import detect
from scenicq.evaluate.evaluation import Evaluation, evaluate
from scenicq.evaluate.pages import _whiskers, write_pages
from scenicq.evaluate.region_of_interest import RegionOfInterest
from scenicq.evaluate.rows import COLUMNS, evaluation_record, flat_rows, overview
from scenicq.evaluate.simulation import read_simulated
from scenicq.geometry.features import MapFeature
from scenicq.importers.motion import pose_of_euler_angles
from scenicq.importers.prediction_files import read_predictions
from scenicq.importers.predictions import ARGOVERSE2, NUSCENES, Predictions
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import Record, record
from scenicq.query.execution.result_origin import name_origin
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, OutOfPlane, Recording
from scenicq.store.writer import write_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"
PARKED = SAMPLES / "parked"


@pytest.fixture(scope="module")
def results(street: Dataset) -> list[Result]:
    return list(Query(street, read_program(PARKED / "parked_car.scenic")).results())


@pytest.fixture(scope="module")
def predictions() -> Predictions:
    return read_predictions(PARKED / "predictions.jsonl")


@pytest.fixture(scope="module")
def judged(street: Dataset, results: list[Result], predictions: Predictions) -> Evaluation:
    query = Query(street, read_program(PARKED / "parked_car.scenic"))
    found = evaluate({"parked_car": query}, street, predictions, simulated=PARKED / "runs.csv")
    assert found.scenarios[0].matching == len(results)
    return found


def refused(code: str, run: Callable[[], object]) -> str:
    with pytest.raises(DataError) as caught:
        run()
    assert caught.value.diagnostics[0].code == code
    return caught.value.diagnostics[0].message


def test_the_planted_failure_is_found(judged: Evaluation) -> None:
    (found,) = judged.scenarios
    (role,) = found.roles
    assert role.about == "role parkedCar"
    assert role.share.of == found.matching
    assert role.share.interval[0] < role.share.rate < role.share.interval[1]
    assert role.interval[0] > 0
    assert role.p_value < 0.01
    assert role.sentence.startswith("missed ")
    assert found.simulated is not None
    assert found.simulated.says == "for"
    gap = [each for each in found.slices if each.by.endswith("parked_car.scenic:6:7")]
    assert len(gap) == 5
    assert gap[0].share.rate > 0.5 > gap[-1].share.rate


def test_counts_are_those_of_a_loop(judged: Evaluation, street: Dataset, results: list[Result]) -> None:
    """Without other cars near, the parked car is found where a box of its class lies within two metres."""
    boxes = {
        label["id"]: label["objects"]
        for label in map(json.loads, (PARKED / "predictions.jsonl").read_text().splitlines())
    }
    missed = 0
    for label in street.labels(result.frame for result in results):
        thing = next(each for each in label.objects if each.id == "parked")
        near = [
            b for b in boxes[label.frame] if b["class"] == "Car" and math.dist(b["position"], (thing.x, thing.y)) < 2
        ]
        missed += not near
    assert judged.scenarios[0].roles[0].share.missed == missed


def test_the_score_that_counts(street: Dataset, results: list[Result], predictions: Predictions) -> None:
    strict = evaluate({"a": results}, street, predictions, least_score=2.0).scenarios[0]
    assert strict.roles[0].share.rate == 1
    assert {each.recall[0] for each in strict.classes} == {0.0}
    assert max(each.average_precision[0] for each in strict.classes) > 0.5


def test_scores_may_be_below_zero(street: Dataset, results: list[Result], predictions: Predictions) -> None:
    """Logits say what probabilities do."""
    plain = evaluate({"a": results}, street, predictions)
    logits = evaluate({"a": results}, street, replace(predictions, score=predictions.score - 7))
    assert logits.scenarios[0].roles == plain.scenarios[0].roles
    for one, other in zip(logits.scenarios[0].classes, plain.scenarios[0].classes, strict=True):
        assert (one.recall, one.precision, one.average_precision) == (
            other.recall, other.precision, other.average_precision
        )  # fmt: skip
        assert {name: found[0] for name, found in one.errors.items()} == pytest.approx(
            {name: found[0] for name, found in other.errors.items()}
        )
    assert plain.least_score == 0
    assert logits.least_score == pytest.approx(predictions.score.min() - 7, abs=0.5)
    for wrong in (math.nan, -math.inf, math.inf):
        with pytest.raises(DataError) as refused:
            evaluate({"a": results}, street, predictions, least_score=wrong)
        assert refused.value.diagnostics[0].code == "option-invalid"


def test_a_perfect_model(street: Dataset, results: list[Result], predictions: Predictions) -> None:
    perfect = [
        {
            "id": label.frame,
            "objects": [
                {"class": o.category, "position": [o.x, o.y], "heading": o.heading, "width": o.width,
                 "length": o.length, "score": 0.9, "velocity": o.velocity}
                for o in label.objects
            ],
        }
        for label in street.labels()
    ]  # fmt: skip
    file = street.path.parent / "perfect.jsonl"
    file.write_text("\n".join(map(json.dumps, perfect)))
    found = evaluate({"a": results}, street, file).scenarios[0]
    assert found.roles[0].share.rate == 0
    assert found.roles[0].share.interval[1] < 0.3
    assert found.roles[0].says in ("no worse", "too little")
    for each in found.classes:
        assert (each.recall[0], each.precision[0]) == (1, 1)
        assert each.average_precision[0] == pytest.approx(1)
        assert all(value == pytest.approx(0, abs=1e-9) for value, _ in each.errors.values())
    assert found.worst[0].missed == 0


def test_intervals_of_recordings_are_results(street: Dataset, results: list[Result], predictions: Predictions) -> None:
    """Roles are played by tracks, in every frame of the interval."""
    times: dict[str, list[int]] = {}
    for each in results:
        times.setdefault(each.recording, []).append(each.timestamp_us)
    records = [
        {"recording": name, "start_us": min(mine), "end_us": max(mine), "verdict": "match", "witness": {},
         "correspondence": {"ego": "ego", "parkedCar": "parked"},
         "frames": {"first": "a", "last": "b", "count": len(mine)}}
        for name, mine in times.items()
    ]  # fmt: skip
    every = [record(each, every=True) for each in results]
    by_frame = evaluate({"a": every}, street, predictions).scenarios[0]
    by_interval = evaluate({"a": records}, street, predictions).scenarios[0]
    assert by_interval.roles[0].share == by_frame.roles[0].share
    assert by_interval.matching == by_frame.matching


def test_unknown_frames_are_in_neither_group(street: Dataset, results: list[Result], predictions: Predictions) -> None:
    records = [record(each) for each in results]
    records[0] = structs.replace(records[0], verdict="unknown")
    found = evaluate({"a": records}, street, predictions).scenarios[0]
    assert found.matching == len(results) - 1
    assert found.matching + found.other == street.manifest.total.frames - 1


@pytest.mark.slow
def test_several_scenarios_are_corrected_together(
    street: Dataset, results: list[Result], predictions: Predictions
) -> None:
    half = [each for each in results if each.recording < "09"]
    both = evaluate({"all": results, "half": half}, street, predictions)
    for each in both.scenarios:
        assert each.roles[0].p_corrected >= each.roles[0].p_value
    few = evaluate({"few": results[:3]}, street, predictions)
    assert "no-verdict" in {each.code for each in few.warnings}
    assert few.scenarios[0].roles[0].says == "too little"
    assert "equally large recordings" in few.scenarios[0].roles[0].because


def test_the_same_seed_gives_the_same(street: Dataset, results: list[Result], predictions: Predictions) -> None:
    first, second = (evaluation_record(evaluate({"a": results}, street, predictions, seed=4)) for _ in range(2))
    assert first == second


def test_rows_have_the_columns(judged: Evaluation) -> None:
    rows = list(flat_rows(judged))
    assert all(tuple(row) == tuple(COLUMNS) for row in rows)
    assert {row["table"] for row in rows} == {"roles", "all", "classes", "slices", "simulated", "frames"}
    json.dumps(evaluation_record(judged), allow_nan=False)


def test_pages(judged: Evaluation, street: Dataset, tmp_path: Path) -> None:
    text = write_pages(judged, street, tmp_path / "pages").read_text(encoding="utf-8")
    assert judged.scenarios[0].roles[0].sentence.replace("<", "&lt;") in text
    assert 'class="prediction"' in text
    assert 'class="missed asked"' in text
    worst = judged.scenarios[0].worst[0]
    assert text.index('id="frame-0-0"') < text.index('id="frame-0-1"')
    assert f'href="#frame-0-0">{worst.frame}<' in text
    assert "1 false box<" in text
    (balance,) = judged.scenarios[0].balances
    drawn = 2 + len(judged.scenarios[0].slices) + sum(len(each.parts) for each in balance.covariates)
    assert text.count('class="whiskers"') == drawn
    assert text.count('class="own rate"') == drawn
    assert "Scenarios" not in text
    write_pages(judged, street, tmp_path / "pages")


def test_shares_are_drawn_where_they_are() -> None:
    own = Share(1, 4, 0.25, (0.1, 0.5))
    text = _whiskers(own, Share(0, 0, math.nan, (math.nan, math.nan)))
    assert 'd="M10.0 7H50.0" class="own"' in text
    assert "M25.0 7h0" in text
    assert "other" not in text
    assert "M25.0 7H25.0" in _whiskers(Share(1, 4, 0.25, (math.nan, math.nan)), None)


@pytest.mark.slow
def test_several_scenarios_are_in_one_table(
    street: Dataset, results: list[Result], predictions: Predictions, tmp_path: Path
) -> None:
    half = [each for each in results if each.recording < "09"]
    runs = tmp_path / "runs.csv"
    runs.write_text("scenario,failed\n" + "".join(f"{name},{n % 2}\n" for name in ("all", "half") for n in range(40)))
    both = evaluate({"all": results, "half": half}, street, predictions, simulated=runs)
    _, head, rows = overview(both)
    assert [row[0] for row in rows] == ["all", "half"]
    assert all(len(row) == len(head) for row in rows)
    assert [row[-1] for row in rows] == [each.simulated.says for each in both.scenarios if each.simulated]
    assert overview(evaluate({"all": results}, street, predictions))[1][-1] == "SAYS"
    text = write_pages(both, street, tmp_path / "pages").read_text(encoding="utf-8")
    assert '<a href="#scenario-1">half</a>' in text
    assert 'id="scenario-1"' in text


@pytest.mark.slow
def test_what_does_not_fit_is_told(street: Dataset, results: list[Result], predictions: Predictions) -> None:
    def run(found: Predictions, **more: Any) -> Callable[[], Evaluation]:
        return lambda: evaluate({"a": results}, street, found, **more)

    without = np.flatnonzero(predictions.frame < len(predictions.frames) - 1)
    fewer = replace(predictions.taken(without), frames=predictions.frames[:-1])
    assert predictions.frames[-1] in refused("predictions-missing", run(fewer))
    assert run(fewer, missing="empty")().scenarios[0].matching == len(results)
    assert run(fewer, missing="skip")().scenarios[0].matching <= len(results)
    other = replace(predictions, frames=[*predictions.frames[:-1], "elsewhere"])
    assert "elsewhere" in refused("predictions-unmatched", run(other))
    assert run(other, missing="skip")().scenarios
    nowhere = replace(predictions, frames=[f"x{name}" for name in predictions.frames])
    refused("predictions-unmatched", run(nowhere, missing="skip"))
    refused("predictions-frame", run(replace(predictions, x=predictions.x + 5000)))
    refused("unknown-class", run(replace(predictions, classes=["Car", "spaceship"])))
    refused("option-invalid", run(predictions, distance_m=3.0))
    refused("file-invalid", lambda: evaluate([structs.replace(record(results[0]), frame="other")], street, predictions))
    nobody = structs.replace(record(results[0]), correspondence={"parkedCar": "nobody"})
    refused("file-invalid", lambda: evaluate([nobody], street, predictions))
    strange = {"frame": "a", "recording": "r", "verdict": 3}
    assert "`$.verdict`" in refused("file-invalid", lambda: evaluate([strange], street, predictions))


def test_results_say_which_dataset_they_are_of(
    street: Dataset, results: list[Result], predictions: Predictions
) -> None:
    def of(dataset: str) -> list[Record]:
        return [record(each, dataset) for each in results]

    mine = name_origin(street)
    assert evaluation_record(evaluate(of(mine), street, predictions))["dataset"] == mine
    assert not any("has changed" in each.message for each in evaluate(of(mine), street, predictions).warnings)
    older = evaluate(of(mine.partition("@")[0] + "@0"), street, predictions)
    assert sum("the dataset has changed" in each.message for each in older.warnings) == 1
    told = refused("option-invalid", lambda: evaluate(of("elsewhere@0"), street, predictions))
    assert "different datasets" in told


def test_boxes_of_the_ego_frame(street: Dataset, predictions: Predictions) -> None:
    """Boxes seen from the ego are found as the same boxes on the map are."""
    labels = {label.frame: label for label in street.labels()}
    egos = [labels[predictions.frames[number]].ego for number in predictions.frame.tolist()]
    heading = np.array([ego.heading for ego in egos])
    dx = predictions.x - np.array([ego.x for ego in egos])
    dy = predictions.y - np.array([ego.y for ego in egos])
    seen = replace(
        predictions,
        x=-np.sin(heading) * dx + np.cos(heading) * dy,
        y=-np.cos(heading) * dx - np.sin(heading) * dy,
        heading=predictions.heading - heading,
        of_ego=True,
    )
    one, other = detect(street, predictions), detect(street, seen)
    for threshold, owner in one.owner.items():
        assert owner.tolist() == other.owner[threshold].tolist()
    assert one.errors == pytest.approx(other.errors, abs=1e-9, nan_ok=True)


def test_rules_of_the_benchmarks(street: Dataset, predictions: Predictions) -> None:
    """Ranges, numbers of boxes and boxes without points are as the protocol says."""
    near = replace(predictions, protocol=replace(predictions.protocol, range_m=15.0))
    found = detect(street, near)
    assert found.distance[found.object_class >= 0].max() < 15
    assert (found.object_class >= 0).sum() < len(found.object_class)
    few = replace(predictions, protocol=replace(predictions.protocol, most=2))
    found = detect(street, few)
    assert np.bincount(found.frame).max() == 2
    assert (found.predictions.score[:-1] >= found.predictions.score[1:]).all()
    assert NUSCENES.ranges_m["barrier"] == 30
    assert ARGOVERSE2.range_m == 150


def test_objects_of_roles_that_do_not_count_are_told(
    street: Dataset, results: list[Result], predictions: Predictions
) -> None:
    """A benchmark's range leaves out some of what plays a role, or all of it."""
    whole = evaluate({"a": results}, street, predictions)
    assert whole.scenarios[0].roles[0].uncounted == 0
    assert "objects-uncounted" not in {each.code for each in whole.warnings}
    for range_m in (12.0, 1.0):
        near = replace(predictions, protocol=replace(predictions.protocol, range_m=range_m))
        found = evaluate({"a": results}, street, near)
        (role,) = found.scenarios[0].roles
        assert role.uncounted > 0
        assert role.uncounted + role.asked == len(results)
        told = next(each for each in found.warnings if each.code == "objects-uncounted").message
        assert f"{role.uncounted} of {len(results)} objects of role parkedCar" in told
    assert role.sentence == f"role parkedCar: none of {len(results)} objects counts"


def test_simulated_runs(tmp_path: Path) -> None:
    file = tmp_path / "runs.csv"
    file.write_text("scenario,failed\na,1\na,0\na,true\nb,no\n")
    found = {name: each.share for name, each in read_simulated(file).items()}
    assert found["a"].rate == pytest.approx(2 / 3)
    assert found["b"].rate == 0
    file.write_text("scenario,score\na,0.25\na,0.75\n")
    assert read_simulated(file)["a"].share.rate == pytest.approx(0.5)
    file.write_text("scenario,failed\n" + "a,1\na,0\n" * 60_000)
    found = {name: each.share for name, each in read_simulated(file).items()}
    assert (found["a"].of, found["a"].rate) == (120_000, 0.5)
    assert found["a"].interval == pytest.approx((0.4972, 0.5028), abs=1e-4)
    endless = f"scenario,failed\na,1\n{'a' * 200_000},1\n"
    for text in (
        endless,
        "scenario,score\n,0.5\n",
        "scenario,score\na,1.5\n",
        "scenario,failed\na,maybe\n",
        "scenario\na\n",
        "failed\n1\n",
    ):
        file.write_text(text)
        refused("file-invalid", lambda: read_simulated(file))
    refused("file-missing", lambda: read_simulated(tmp_path / "none.csv"))


def lone_box(frame: str, **values: float) -> Predictions:
    """One prediction of a car."""
    columns = {"x": 0.0, "y": 0.0, "heading": 0.0, "width": 2.0, "length": 4.0, "height": 1.5, "vx": math.nan,
               "vy": math.nan, "score": 0.5, "z": math.nan, **values}  # fmt: skip
    zero = np.zeros(1, dtype=np.int32)
    return Predictions("one.feather", ARGOVERSE2, [frame], zero, ["REGULAR_VEHICLE"], zero, attributes=[],
                       attribute=np.full(1, -1, dtype=np.int8),
                       **{name: np.array([value]) for name, value in columns.items()})  # fmt: skip


def tilted(folder: Path, *, height: float | None = 2.0) -> Dataset:
    """An ego with its front down by 0.1 and its left side up by 0.2; in its frame a car 10 m ahead and 1 m above."""
    ego = LabelObject("ego", "Car", "EGO_VEHICLE", 100.0, 50.0, 0.5, out_of_plane=OutOfPlane(height, 0.1, 0.2))
    pose = pose_of_euler_angles(0.2, 0.1, 0.5 + math.pi / 2, (100.0, 50.0, 2.0))
    car = pose.compose(pose_of_euler_angles(0.0, 0.0, 0.3, (10.0, 0.0, 1.0)))
    x, y, z = car.origin
    other = LabelObject("a", "Car", "REGULAR_VEHICLE", x, y, car.heading, 2.0, 4.0, 1.5,
                        attributes={"num_interior_pts": 9},
                        out_of_plane=OutOfPlane(z, car.pitch, car.roll))  # fmt: skip
    label = Label("r/1", "r", 0, "town", ego, (other,))
    road = MapFeature("d", "drivable", Polygon([(0, 0), (100, 0), (100, 200), (0, 200)]), {})
    yard = MapFeature("e", "drivable", Polygon([(190, 0), (200, 0), (200, 10), (190, 10)]), {})
    write_dataset(folder, [Recording("r", "town", (label,))], {"town": (road, yard)}, name="d")
    return open_dataset(folder)


def test_boxes_of_a_tilted_ego_are_compared_in_space(tmp_path: Path) -> None:
    dataset = tilted(tmp_path / "d")
    found = detect(dataset, replace(lone_box("r/1", x=10.3, y=0.4, z=1.2, heading=0.7), of_ego=True))
    assert not found.flat
    assert found.owner[1.0].tolist() == [0]
    assert found.owner[0.5].tolist() == [-1]
    assert found.errors[0, [0, 2]].tolist() == pytest.approx([math.hypot(0.3, 0.4, 0.2), 0.4])
    far = detect(dataset, replace(lone_box("r/1", x=10.0, z=3.1), of_ego=True))
    assert far.owner[2.0].tolist() == [-1]


def test_without_heights_boxes_are_compared_in_the_plane(tmp_path: Path) -> None:
    dataset = tilted(tmp_path / "d", height=None)
    found = detect(dataset, replace(lone_box("r/1", x=10.0, z=9.0), of_ego=True))
    assert found.flat
    assert found.owner[4.0].tolist() == [0]
    result = {"frame": "r/1", "verdict": "match", "recording": "r", "timestamp_us": 0, "correspondence": {},
              "witness": {}}  # fmt: skip
    warned = evaluate([result], dataset, replace(lone_box("r/1", x=10.0, z=9.0), of_ego=True)).warnings
    assert "heights-unknown" in {each.code for each in warned}


@pytest.mark.parametrize(
    ("x", "y", "heading", "counts"),
    [(106.5, 100, 0.0, False), (106.5, 100, math.pi / 2, True), (203.5, 5, 0.0, False), (99, 100, 0.0, True)],
)
def test_boxes_away_from_the_drivable_area_do_not_count(
    tmp_path: Path, x: float, y: float, heading: float, *, counts: bool
) -> None:
    """A corner must lie within 5 m of it, and inside the box of whole metres around it."""
    dataset = tilted(tmp_path / "d")
    area = RegionOfInterest(dataset, detect(dataset, lone_box("r/1", x=100, y=50)).frames, 5.0)
    placed = lone_box("r/1", x=x, y=y, heading=heading)
    assert area.holds(placed, placed.frame).tolist() == [counts]


def test_attributes_of_the_nuscenes_task(street: Dataset, tmp_path: Path) -> None:
    """An attribute is right or wrong where the label has one; other classes have no such error."""
    told = {"a": {"vehicle": "parked"}, "b": {"vehicle": "moving"}, "c": {}}
    cars = tuple(
        LabelObject(name, "Car", "vehicle.car", 10.0 * place, 0.0, 0.0, 2.0, 4.0, 1.5,
                    attributes={"num_lidar_pts": 1, **told[name]})
        for place, name in enumerate("abc")
    )  # fmt: skip
    label = Label("f", "r", 0, "none", LabelObject("ego", "Car", "ego", 0.0, 5.0, 0.0), cars)
    write_dataset(tmp_path / "d", [Recording("r", "none", (label,))], {}, name="d")
    boxes = [
        {"translation": [10 * place, 0, 0], "size": [2, 4, 1.5], "rotation": [0.5**0.5, 0, 0, 0.5**0.5],
         "detection_name": "car", "detection_score": 0.9 - place / 10, "attribute_name": name}
        for place, name in enumerate(["vehicle.parked", "vehicle.parked", "vehicle.moving"])
    ]  # fmt: skip
    file = tmp_path / "boxes.json"
    file.write_text(json.dumps({"results": {"f": boxes}}))
    found = detect(open_dataset(tmp_path / "d"), read_predictions(file))
    assert found.errors[:2, 4].tolist() == [0, 1]
    assert math.isnan(found.errors[2, 4])
    assert {"barrier", "traffic_cone"} == NUSCENES.no_attribute
