"""Annotations become what the page of the format says of what `json` reads; what is unsound is told."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from label_rows import labels_of
from msgspec import DecodeError

from scenicq.geometry.angles import normalize
from scenicq.importers.base import ImportOptions
from scenicq.importers.fields import InvalidError
from scenicq.importers.nuscenes import NuScenes
from scenicq.importers.nuscenes_boxes import BoxReader
from scenicq.importers.nuscenes_rows import ANNOTATIONS
from scenicq.importers.report import Report
from scenicq.store.columns import RecordingColumns, columns_of
from scenicq.store.labels import Recording

TINY = Path(__file__).parents[3] / "sample_data" / "nuscenes_tiny"
ATTRIBUTES = {
    "a": "vehicle.parked",
    "b": "pedestrian.moving",
    "c": "plain",
    "d": "num_lidar_pts.x",
    "e": "visibility.y",
}
READER = ({"s0": 0, "s1": 1}, {"t0": 0, "t1": 1}, ATTRIBUTES, {"1": "v0-40", "2": "v80-100"})
JUNK = [None, True, 0, -1, 2.5, float("nan"), 10**400, 2**63, "", "x", "ab", [], [1, None], [True, 1, 1], {}, ["a", 1]]

PIECES = [
    *'"\\{}[],:-0.e \n\t\x01ü\u2028',
    "null",
    "true",
    "NaN",
    "1e999",
    "\\u0061",
    "\\ud800",
    "01",
    "{}, ",
    '"size": 1, ',
]

ROW = {
    "token": "p",
    "sample_token": "s0",
    "instance_token": "t0",
    "translation": [1, 2.5, 3],
    "size": [1, 2, 3],
    "rotation": [1, 0, 0, 0],
}

reals = st.floats(-1e6, 1e6) | st.integers(-1000, 1000)
parts = st.floats(-0.9, 0.9)
annotations = st.fixed_dictionaries(
    {
        "token": st.sampled_from("pqr"),
        "sample_token": st.sampled_from(["s0", "s1"]),
        "instance_token": st.sampled_from(["t0", "t1"]),
        "translation": st.lists(reals, min_size=3, max_size=3),
        "rotation": st.tuples(st.floats(0.6, 0.9), parts, parts, parts).map(list),
        "size": st.lists(st.floats(0.1, 20) | st.integers(1, 9), min_size=3, max_size=3),
    },
    optional={
        "attribute_tokens": st.none() | st.lists(st.sampled_from("abcde"), max_size=3),
        "visibility_token": st.sampled_from([None, "", "1", "2", "ü"]),
        "num_lidar_pts": st.none() | st.integers(0, 2**63 - 1),
        "num_radar_pts": st.none() | st.integers(-1, 99),
    },
)


def plain(row: Any) -> tuple[Any, ...] | None:
    """What an annotation is by the page of the format, from what `json` makes of it; None where it is unsound."""
    samples, tracks, attributes, visible = READER

    def is_text(value: Any, *, empty: bool = False) -> bool:
        return isinstance(value, str) and (empty or value != "") and not any("\ud800" <= c <= "\udfff" for c in value)

    def is_whole(value: Any) -> bool:
        return type(value) in (int, float) and float("-inf") < value < float("inf") and value == int(value)

    def numbers(key: str, size: int) -> list[float]:
        value = row.get(key)
        if not isinstance(value, list) or len(value) != size or not {type(each) for each in value} <= {int, float}:
            raise ValueError(key)
        found = [float(each) for each in value]
        if not all(map(math.isfinite, found)):
            raise ValueError(key)
        return found

    try:
        x, y, z = numbers("translation", 3)
        w, *turn = numbers("rotation", 4)
        size = numbers("size", 3)
    except (AttributeError, OverflowError, ValueError):
        return None
    norm = math.hypot(w, *turn)
    tokens, level = row.get("attribute_tokens"), row.get("visibility_token")
    counts = {key: row.get(key) for key in ("num_lidar_pts", "num_radar_pts") if row.get(key) is not None}
    sound = (
        is_text(row.get("token"))
        and isinstance(row.get("sample_token"), str)
        and row["sample_token"] in samples
        and isinstance(row.get("instance_token"), str)
        and row["instance_token"] in tracks
        and 0.5 < norm < 2
        and min(size) > 0
        and (
            tokens is None or (isinstance(tokens, list) and all(isinstance(t, str) and t in attributes for t in tokens))
        )
        and (level is None or is_text(level, empty=True))
        and all(is_whole(count) and abs(count) < 2**63 for count in counts.values())
    )
    if not sound:
        return None
    a, b, c, d = (each / norm for each in (w, *turn))
    heading = normalize(math.atan2(2 * (a * d + b * c), 1 - 2 * (c * c + d * d)) - math.pi / 2)
    told: dict[str, Any] = {}
    for token in tokens or ():
        group, _, value = attributes[token].rpartition(".")
        told[group or "attribute"] = value
    told |= {"visibility": visible.get(level, level)} if level else {}
    told |= {key: int(count) for key, count in counts.items()}
    values = (x, y, heading, *size, z)
    return row["token"], samples[row["sample_token"]], tracks[row["instance_token"]], values, told


def boxes(texts: list[str]) -> tuple[list[tuple[Any, ...]], int]:
    """What becomes of the texts of some rows, and how many of them are told."""
    rows, told = [], []
    for text in texts:
        try:
            rows.append(ANNOTATIONS.decode(text.encode(errors="surrogatepass"), Report()))
        except InvalidError as error:
            told.append(str(error))
    found = BoxReader(*READER).boxes(rows, lambda _, problem: told.append(problem))
    attributes = [json.loads(each or "{}") for each in found.attributes]
    parts = (found.tokens, found.samples.tolist(), found.tracks.tolist(), map(tuple, found.values.tolist()), attributes)
    return list(zip(*parts, strict=True)), len(told)


def agrees(texts: list[str]) -> None:
    """All that is sound is read, all else is told; and rows that are decoded at once are what they are alone."""
    expected = [made for text in texts if (made := plain(json.loads(text))) is not None]
    found, told = boxes(texts)
    assert repr(found) == repr(expected)
    assert len(found) + told == len(texts)
    try:
        at_once = ANNOTATIONS.many.decode(f"[{','.join(texts)}]")
    except DecodeError:
        return
    assert at_once == [ANNOTATIONS.decode(text.encode(), Report()) for text in texts]


@settings(deadline=None)
@given(rows=st.lists(annotations, min_size=1, max_size=5), indent=st.sampled_from([None, 0, 2]), ascii_=st.booleans())
def test_sound_rows_are_what_json_says(rows: list[dict[str, Any]], indent: int | None, ascii_: bool) -> None:
    texts = [json.dumps(row, indent=indent, ensure_ascii=ascii_) for row in rows]
    assert boxes(texts)[1] == 0
    agrees(texts)


@settings(deadline=None, max_examples=300)
@given(rows=st.lists(annotations, min_size=1, max_size=3), data=st.data())
def test_unsound_rows_are_told(rows: list[dict[str, Any]], data: st.DataObject) -> None:
    row = data.draw(st.sampled_from(rows))
    row[data.draw(st.sampled_from([*sorted(row), "other"]))] = data.draw(st.sampled_from(JUNK))
    agrees([json.dumps(row) for row in rows])


@settings(deadline=None, max_examples=300)
@given(row=annotations, data=st.data())
def test_changed_texts_are_read_as_json_reads_them_or_told(row: dict[str, Any], data: st.DataObject) -> None:
    text = json.dumps(row, ensure_ascii=False)
    for _ in range(data.draw(st.integers(1, 2))):
        at = data.draw(st.integers(0, len(text)))
        text = text[:at] + data.draw(st.sampled_from(PIECES)) + text[at + data.draw(st.integers(0, 2)) :]
    found, told = boxes([text])
    assert len(found) + told == 1
    if found:
        assert repr(found) == repr([plain(json.loads(text))])


@pytest.mark.parametrize(
    "field",
    [
        '"translation": [-0, -0.0, 1e-400]',
        '"translation": [123456789012345678901234567890, 9007199254740993, 1]',
        '"translation": [1e999, 1, 1]',
        '"translation": [NaN, 1, 1]',
        f'"translation": [1{"0" * 400}, 1, 1]',
        '"token": "q"',
        '"token": ""',
        '"token": "\\u0071\\ud83d\\ude00"',
        '"unused": 1e999',
        '"unused": [1, {"a": [null, true]}]',
        '"num_lidar_pts": 9223372036854775807',
        '"num_lidar_pts": 9223372036854775808',
        '"num_lidar_pts": -9223372036854775808',
        '"num_lidar_pts": -0',
        '"num_lidar_pts": 1.0',
        '"num_lidar_pts": 1.5',
        '"num_lidar_pts": true',
        '"visibility_token": ""',
        '"size": [0, 1, 1]',
        '"size": [5e-324, 1, 1]',
    ],
)
def test_a_field_that_comes_again_counts(field: str) -> None:
    agrees([f"{json.dumps(ROW)[:-1]}, {field}}}"])


@pytest.mark.parametrize(
    "field",
    [
        '"token": "\\ud800"',
        '"unused": "\\ud800 and more"',
        '"unused": tru',
        '"unused": 01',
        f'"unused": {"[" * 100_000}{"]" * 100_000}',
    ],
)
def test_what_no_file_can_hold_is_told(field: str) -> None:
    assert boxes([f"{json.dumps(ROW)[:-1]}, {field}}}"]) == ([], 1)


def tiny(folder: Path, table: str, change: Any) -> tuple[list[RecordingColumns], Report]:
    """The recordings of the sample data after a change of a table."""
    for file in (TINY / "v1.0-tiny").iterdir():
        rows = json.loads(file.read_bytes())
        if file.stem == table:
            change(rows)
        (folder / file.name).write_text(json.dumps(rows, indent=0))
    report = Report()
    return list(NuScenes().read(folder, ImportOptions(), report).recordings(report)), report


def test_a_bad_row_among_good_ones_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()

    def change(rows: list[dict[str, Any]]) -> None:
        rows[3]["rotation"] = [9, 9, 9, 9]

    (before, _), (after, report) = tiny(folder, "", change), tiny(folder, "sample_annotation", change)
    table = (folder / "sample_annotation.json").read_text().splitlines()
    row = json.loads((TINY / "v1.0-tiny" / "sample_annotation.json").read_bytes())[3]["token"]
    line = table.index(f'"token": "{row}",')
    expected = f"sample_annotation.json:{line}: annotation `{row}`: `rotation` is not a unit quaternion"
    assert [problem.message for problem in report.problems if problem.what == "object"] == [expected]
    counts = [sum(len(one.objects.id) for one in found) for found in (before, after)]
    assert counts[1] == counts[0] - 1


def test_labels_and_columns_agree(tmp_path: Path) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()
    for found in tiny(folder, "", None)[0]:
        again = columns_of(Recording(found.name, found.map, tuple(labels_of(found))))
        assert (again.frames, again.params, again.objects.attributes) == (
            found.frames,
            found.params,
            found.objects.attributes,
        )
        assert again.objects.vx.tobytes() == np.ascontiguousarray(found.objects.vx).tobytes()


def test_an_annotation_that_is_there_twice_counts_once(tmp_path: Path) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()
    found, report = tiny(folder, "sample_annotation", lambda rows: rows.append(rows[0]))
    assert sum(len(one.objects.id) for one in found) == 12
    assert [
        (problem.what, "is used twice" in problem.message) for problem in report.problems if problem.what == "object"
    ] == [("object", True)]


def test_times_near_the_largest_number_have_no_wrong_velocity(tmp_path: Path) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()

    def change(rows: list[dict[str, Any]]) -> None:
        for number, row in enumerate(sorted(rows, key=lambda row: row["timestamp"])):
            row["timestamp"] = 2**63 - 1 - number * 10_000_000 if number else 1 - 2**63

    found, _ = tiny(folder, "sample", change)
    assert all(np.isnan(one.objects.vx).all() for one in found)
    assert all(np.isnan(one.egos.vx).all() for one in found)


@pytest.mark.parametrize("field", ["token", "sample_token"])
def test_half_a_character_is_left_out(tmp_path: Path, field: str) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()
    _, report = tiny(folder, "sample_annotation", lambda rows: rows[0].update({field: "\ud800"}))
    assert any("half of a character" in problem.message for problem in report.problems)
