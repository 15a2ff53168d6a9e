"""Predictions are read from every format alike; what is unsound is told by name."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest

from scenicq.errors import DataError
from scenicq.importers.prediction_checks import find_doubts
from scenicq.importers.prediction_files import read_predictions

BOX = {"class": "Car", "position": [3.0, 4.0], "heading": 0.5, "width": 2.0, "length": 4.0, "score": 0.75}


def refused(code: str, path: Path) -> str:
    with pytest.raises(DataError) as caught:
        read_predictions(path)
    assert caught.value.diagnostics[0].code == code
    return caught.value.diagnostics[0].message


def lines(path: Path, *labels: dict[str, Any]) -> Path:
    path.write_text("\n".join(map(json.dumps, labels)))
    return path


def detection(**given: Any) -> dict[str, Any]:
    half = math.sin(0.25), math.cos(0.25)
    box = {"sample_token": "a", "translation": [3, 4, 1], "size": [2, 4, 1.5], "rotation": [half[1], 0, 0, half[0]],
           "velocity": [1, 0], "detection_name": "car", "detection_score": 0.75, "attribute_name": ""}  # fmt: skip
    return {**box, **given}


def nuscenes(path: Path, results: dict[str, Any]) -> Path:
    path.write_text(json.dumps({"meta": {"use_lidar": True}, "results": results}))
    return path


def columns(**given: Any) -> dict[str, Any]:
    table = {"log_id": ["log"], "timestamp_ns": [7], "category": ["BUS"], "score": [0.75], "tx_m": [3.0],
             "ty_m": [4.0], "tz_m": [0.0], "length_m": [4.0], "width_m": [2.0], "height_m": [1.5],
             "qw": [math.cos(0.25)], "qx": [0.0], "qy": [0.0], "qz": [math.sin(0.25)]}  # fmt: skip
    return {**table, **given}


def argoverse2(path: Path, **given: Any) -> Path:
    feather.write_feather(pa.table(columns(**given)), path)
    return path


def test_formats_say_the_same(tmp_path: Path) -> None:
    found = read_predictions(lines(tmp_path / "a.jsonl", {"id": "a", "objects": [BOX]}, {"id": "b", "objects": []}))
    assert (found.frames, found.classes, found.frame.tolist()) == (["a", "b"], ["Car"], [0])
    own = read_predictions(nuscenes(tmp_path / "a.json", {"a": [detection()], "b": []}))
    other = read_predictions(argoverse2(tmp_path / "a.feather"))
    assert (own.frames, own.classes) == (["a", "b"], ["car"])
    assert (other.frames, other.classes, other.of_ego) == (["log/7"], ["BUS"], True)
    for each in (found, own, other):
        values = [each.x, each.y, each.width, each.length, each.score]
        assert [value.tolist() for value in values] == [[3.0], [4.0], [2.0], [4.0], [0.75]]
    assert found.heading[0] == 0.5
    assert own.heading[0] == pytest.approx(0.5 - math.pi / 2)
    assert other.heading[0] == pytest.approx(0.5)
    assert (own.vx[0], own.height[0]) == (1.0, 1.5)
    assert np.isnan(found.vx[0])


def test_parquet_with_lists_or_with_rows(tmp_path: Path) -> None:
    labels = [{"id": "a", "objects": [BOX, {**BOX, "score": 0.5}]}, {"id": "b", "objects": []}]
    pq.write_table(pa.Table.from_pylist(labels), tmp_path / "a.parquet")
    flat = {"frame": ["a", "a"], "class": ["Car", "Car"], "x": [3.0, 3.0], "y": [4.0, 4.0], "heading": [0.5, 0.5],
            "width": [2.0, 2.0], "length": [4.0, 4.0], "score": [0.75, 0.5]}  # fmt: skip
    pq.write_table(pa.table(flat), tmp_path / "b.parquet")
    nested, rows = read_predictions(tmp_path / "a.parquet"), read_predictions(tmp_path / "b.parquet")
    assert (nested.frames, rows.frames) == (["a", "b"], ["a"])
    for each in (nested, rows):
        assert each.score.tolist() == [0.75, 0.5]
        assert each.x.tolist() == [3.0, 3.0]
        assert each.frame.tolist() == [0, 0]


def test_null_and_nan_are_no_numbers(tmp_path: Path) -> None:
    """Programs write NaN where JSON has null: velocities may be unknown, what must be known is told by its frame."""
    unknown = detection(velocity=[math.nan, None], size=[2, 4, -math.inf])
    found = read_predictions(nuscenes(tmp_path / "a.json", {"NaN": [unknown], "b": []}))
    assert found.frames == ["NaN", "b"]
    assert np.isnan([found.vx[0], found.vy[0], found.height[0]]).all()
    box = {**BOX, "velocity": [math.nan, 1.0], "class": 'a, NaN, "b'}
    found = read_predictions(lines(tmp_path / "a.jsonl", {"id": "a", "objects": [box]}))
    assert np.isnan(found.vx[0])
    assert (found.vy[0], found.classes) == (1.0, ['a, NaN, "b'])
    for value in (math.nan, None):
        for name, path in (
            ("score", lines(tmp_path / "b.jsonl", {"id": "frame 7", "objects": [{**BOX, "score": value}]})),
            ("x", lines(tmp_path / "c.jsonl", {"id": "frame 7", "objects": [{**BOX, "position": [value, 1]}]})),
            ("score", nuscenes(tmp_path / "b.json", {"frame 7": [detection(detection_score=value)]})),
            ("width", nuscenes(tmp_path / "c.json", {"frame 7": [detection(size=[value, 1, 1])]})),
        ):
            message = refused("predictions-invalid", path)
            assert f"`{name}` makes no sense" in message
            assert "frame 7" in message
    message = refused("file-invalid", nuscenes(tmp_path / "d.json", {"frame 7": [detection(rotation=[None, 0, 0, 0])]}))
    assert "frame 7" in message


UNSOUND: dict[str, tuple[str, Callable[[Path], Path]]] = {
    "nan": ("predictions-invalid", lambda p: nuscenes(p / "a.json", {"a": [detection(rotation=[0, 0, 0, 0])]})),
    "size": ("predictions-invalid", lambda p: lines(p / "a.jsonl", {"id": "a", "objects": [{**BOX, "width": 0}]})),
    "nan column": ("predictions-invalid", lambda p: argoverse2(p / "a.feather", tx_m=[math.nan])),
    "without heading": (
        "predictions-invalid",
        lambda p: lines(p / "a.jsonl", {"id": "a", "objects": [{**BOX, "heading": None}]}),
    ),
    "box twice": ("predictions-duplicate", lambda p: nuscenes(p / "a.json", {"a": [detection(), detection()]})),
    "frame twice": (
        "predictions-duplicate",
        lambda p: lines(p / "a.jsonl", {"id": "a", "objects": []}, {"id": "a", "objects": []}),
    ),
    "no score": ("file-invalid", lambda p: lines(p / "a.jsonl", {"id": "a", "objects": [{"class": "Car"}]})),
    "no results": ("file-invalid", lambda p: lines(p / "a.json", {"id": "a"})),
    "no JSON": ("file-invalid", lambda p: lines(p / "a.json", {"id": "a"}, {"id": "b"})),
    "no feather": ("file-invalid", lambda p: lines(p / "a.feather", {})),
    "no Parquet": ("file-invalid", lambda p: lines(p / "a.parquet", {})),
    "other extension": ("file-invalid", lambda p: lines(p / "a.txt", {})),
    "not there": ("file-missing", lambda p: p / "a.json"),
}


@pytest.mark.parametrize("name", UNSOUND)
def test_what_is_unsound_is_told(name: str, tmp_path: Path) -> None:
    code, write = UNSOUND[name]
    assert "a." in refused(code, write(tmp_path))


def test_missing_columns_are_named(tmp_path: Path) -> None:
    table = columns()
    del table["score"]
    feather.write_feather(pa.table(table), tmp_path / "a.feather")
    assert "`score`" in refused("file-invalid", tmp_path / "a.feather")
    pq.write_table(pa.table({"frame": ["a"], "class": ["Car"]}), tmp_path / "a.parquet")
    assert "`x`" in refused("file-invalid", tmp_path / "a.parquet")


def scored(score: float, **given: Any) -> dict[str, Any]:
    return detection(detection_score=score, **given)


DOUBTFUL: dict[str, tuple[str, dict[str, Any]]] = {
    "nothing": ("no box at all", {"a": [], "b": []}),
    "one score": ("all scores are the same", {"a": [scored(0.5)], "b": [scored(0.5, translation=[9, 9, 1])]}),
    "one box everywhere": (
        "the same boxes are in all 3 frames",
        {name: [scored(0.1 * number)] for number, name in enumerate(("a", "b", "c"), 1)} | {"d": []},
    ),
    "too many": (
        "1 samples have more than 500 boxes",
        {"a": [scored(n / 600, translation=[n, 0, 1]) for n in range(501)], "b": [scored(0.5)]},
    ),
    "an attribute": (
        "no attributes called vehicle.flying",
        {"a": [scored(0.5, attribute_name="vehicle.flying"), scored(0.4, attribute_name="vehicle.parked")]},
    ),
}


@pytest.mark.parametrize("what", DOUBTFUL)
def test_what_a_benchmark_refuses_and_what_is_no_model_is_told(tmp_path: Path, what: str) -> None:
    told, results = DOUBTFUL[what]
    found = list(find_doubts(read_predictions(nuscenes(tmp_path / "a.json", results))))
    assert len(found) == 1
    assert told in found[0]


def test_files_without_meta_are_told(tmp_path: Path) -> None:
    fine = {"a": [scored(0.5), scored(0.4, translation=[9, 9, 1])], "b": [scored(0.3)], "c": [scored(0.2)]}
    assert list(find_doubts(read_predictions(nuscenes(tmp_path / "a.json", fine)))) == []
    (tmp_path / "b.json").write_text(json.dumps({"results": fine}))
    (told,) = find_doubts(read_predictions(tmp_path / "b.json"))
    assert told.startswith("`meta`")
