"""Rows that msgspec decodes become what `json` and the reader of single rows make of them, or are left to these."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import DecodeError

from scenicq.importers.base import Options
from scenicq.importers.fields import InvalidError, check_characters
from label_rows import labels_of
from scenicq.importers.nuscenes import NuScenes
from scenicq.importers.nuscenes_boxes import Boxes, BoxReader, of_rows
from scenicq.importers.nuscenes_rows import ANNOTATIONS
from scenicq.importers.report import Report
from scenicq.store.columns import RecordingColumns, columns_of
from scenicq.store.labels import Recording

TINY = Path(__file__).parents[2] / "sample_data" / "nuscenes_tiny"
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


def by_row(rows: list[dict[str, Any]]) -> Boxes | None:
    """The reference; None where a row is unsound."""
    reader = BoxReader(*READER)
    try:
        return of_rows([reader.row(row["token"], row) for row in rows])
    except InvalidError:
        return None


def columns(text: str) -> Boxes | None:
    """What is made of the text of some rows at once; None where they are left to the reader of single rows."""
    try:
        return BoxReader(*READER).columns(ANNOTATIONS.decode(text))
    except (DecodeError, RecursionError):
        return None


def same(one: Boxes, two: Boxes) -> bool:
    return (list(one.tokens), one.attributes, one.samples.tolist(), one.tracks.tolist(), one.values.tobytes()) == (
        *(list(two.tokens), two.attributes, two.samples.tolist(), two.tracks.tolist()),
        np.ascontiguousarray(two.values).tobytes(),
    )


@settings(deadline=None)
@given(rows=st.lists(annotations, min_size=1, max_size=5), indent=st.sampled_from([None, 0, 2]), ascii_=st.booleans())
def test_sound_rows_are_read_alike(rows: list[dict[str, Any]], indent: int | None, ascii_: bool) -> None:
    found, expected = columns(json.dumps(rows, indent=indent, ensure_ascii=ascii_)), by_row(rows)
    assert expected is not None
    assert found is not None
    assert same(found, expected)


@settings(deadline=None, max_examples=300)
@given(rows=st.lists(annotations, min_size=1, max_size=3), data=st.data())
def test_unsound_rows_are_left_to_the_other(rows: list[dict[str, Any]], data: st.DataObject) -> None:
    row = data.draw(st.sampled_from(rows))
    row[data.draw(st.sampled_from(sorted(row)))] = data.draw(st.sampled_from(JUNK))
    agrees(json.dumps(rows))


@settings(deadline=None, max_examples=300)
@given(rows=st.lists(annotations, min_size=1, max_size=3), data=st.data())
def test_changed_texts_are_read_alike_or_left_to_the_other(rows: list[dict[str, Any]], data: st.DataObject) -> None:
    text = json.dumps(rows, ensure_ascii=False)
    for _ in range(data.draw(st.integers(1, 2))):
        at = data.draw(st.integers(0, len(text)))
        text = text[:at] + data.draw(st.sampled_from(PIECES)) + text[at + data.draw(st.integers(0, 2)) :]
    agrees(text)


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
        '"token": "\\ud800"',
        '"token": "\\udc00"',
        '"unused": "\\ud800 and more"',
        '"unused": "\x01"',
        '"unused": 1e999',
        '"unused": [1, {"a": [null, true]}]',
        '"unused": tru',
        '"unused": 01',
        f'"unused": {"[" * 100_000}{"]" * 100_000}',
        '"num_lidar_pts": 9223372036854775807',
        '"num_lidar_pts": 9223372036854775808',
        '"num_lidar_pts": -9223372036854775808',
        '"num_lidar_pts": -0',
        '"num_lidar_pts": 1.0',
        '"num_lidar_pts": true',
        '"visibility_token": ""',
        '"size": [0, 1, 1]',
        '"size": [5e-324, 1, 1]',
    ],
)
def test_a_field_that_comes_again_is_read_alike(field: str) -> None:
    row = {"token": "p", "sample_token": "s0", "instance_token": "t0", "translation": [1, 2.5, 3], "size": [1, 2, 3]}
    agrees(f"[{json.dumps(row | {'rotation': [1, 0, 0, 0]})[:-1]}, {field}}}]")


def agrees(text: str) -> None:
    """Whatever is read at once is what single rows are."""
    found = columns(text)
    if found is not None:
        rows = json.loads(text)
        check_characters(rows)
        expected = by_row(rows)
        assert expected is not None
        assert same(found, expected)


def tiny(folder: Path, table: str, change: Any) -> tuple[list[RecordingColumns | Recording], Report]:
    """The recordings of the sample data after a change of a table."""
    for file in (TINY / "v1.0-tiny").iterdir():
        rows = json.loads(file.read_bytes())
        if file.stem == table:
            change(rows)
        (folder / file.name).write_text(json.dumps(rows, indent=0))
    report = Report()
    return list(NuScenes().read(folder, Options(), report).recordings(report)), report


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
    assert [problem.message for problem in report.told if problem.what == "object"] == [expected]
    counts = [
        sum(len(one.objects.id) for one in found if isinstance(one, RecordingColumns)) for found in (before, after)
    ]
    assert counts[1] == counts[0] - 1


def test_labels_and_columns_agree(tmp_path: Path) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()
    for found in tiny(folder, "", None)[0]:
        assert isinstance(found, RecordingColumns)
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
    assert all(isinstance(one, Recording | RecordingColumns) for one in found)
    assert [
        (problem.what, "is used twice" in problem.message) for problem in report.told if problem.what == "object"
    ] == [("object", True)]


def test_times_near_the_largest_number_have_no_wrong_velocity(tmp_path: Path) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()

    def change(rows: list[dict[str, Any]]) -> None:
        for number, row in enumerate(sorted(rows, key=lambda row: row["timestamp"])):
            row["timestamp"] = 2**63 - 1 - number * 10_000_000 if number else 1 - 2**63

    found, _ = tiny(folder, "sample", change)
    assert all(isinstance(one, RecordingColumns) and np.isnan(one.objects.vx).all() for one in found)
    assert all(isinstance(one, RecordingColumns) and np.isnan(one.egos.vx).all() for one in found)


@pytest.mark.parametrize("field", ["token", "sample_token"])
def test_half_a_character_is_left_out(tmp_path: Path, field: str) -> None:
    folder = tmp_path / "v1.0-tiny"
    folder.mkdir()
    _, report = tiny(folder, "sample_annotation", lambda rows: rows[0].update({field: "\ud800"}))
    assert any("half of a character" in problem.message for problem in report.told)
