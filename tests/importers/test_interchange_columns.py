"""The reader of columns gives what the reader of labels gives, or nothing."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenicq.importers.base import ClassNames, Labels
from scenicq.importers.interchange import _LabelReader, _parsed
from scenicq.importers.interchange_columns import read_columns
from scenicq.importers.label_rows import labels_of
from scenicq.importers.report import Report
from scenicq.store.columns import MemberColumns, RecordingColumns, columns_of
from scenicq.store.labels import Recording

CLASSES = {"car": "Car", "adult": "Adult"}
JUNK = [None, True, False, 0, -1, 2.5, float("nan"), 10**400, "", "x", "ego", [], [1, None], [1, True], {}, {"a": [1]}]
CAMERA = {
    "path": "a.jpg",
    "width": 640,
    "height": 360,
    "intrinsics": [500, 500.5, 320, 180],
    "position": [1, 2, 1.5],
    "rotation": [0.5, -0.5, 0.5, -0.5],
}

reals = st.floats(-1e6, 1e6) | st.integers(-1000, 1000)
optional_sizes = st.none() | st.floats(0.1, 20)
scalars = st.none() | st.dictionaries(st.sampled_from("abü"), st.sampled_from(["x", 1, 0.1, True, 10**30]), max_size=2)
members = st.fixed_dictionaries(
    {"position": st.tuples(reals, reals).map(list), "heading": reals},
    optional={
        "width": optional_sizes,
        "length": optional_sizes,
        "height": optional_sizes,
        "velocity": st.none() | st.tuples(reals, reals).map(list),
        "track": st.sampled_from([None, "", "t1"]),
        "attributes": scalars,
        "z": st.none() | reals,
        "pitch": st.none() | reals,
        "roll": st.none() | st.floats(-4, 4),
    },
)
objects = st.builds(lambda entry, name: entry | {"class": name}, members, st.sampled_from(sorted(CLASSES)))
egos = st.builds(lambda entry, name: entry | name, members, st.sampled_from([{}, {"class": "car"}, {"class": ""}]))


@st.composite
def recordings(draw: st.DrawFn) -> list[dict[str, Any]]:
    times = draw(st.lists(st.integers(-5, 10**15), min_size=1, max_size=4, unique=True))
    return [
        {
            "id": f"f{number}",
            "recording": "r",
            "timestamp_us": time,
            "map": "town",
            "ego": draw(egos),
            "objects": [entry | {"id": f"o{n}"} for n, entry in enumerate(draw(st.lists(objects, max_size=3)))],
            "params": draw(scalars),
            "sensors": draw(
                st.sampled_from(
                    [None, {}, {"CAM": "a.jpg", "LIDAR": "b.bin"}, {"CAM": CAMERA, "REAR": {"path": "r.jpg"}}]
                )
            ),
        }
        for number, time in enumerate(times)
    ]


def reference(lines: list[bytes], *, yaw: bool) -> tuple[RecordingColumns | None, bool]:
    """What the reader of labels makes of some lines, and whether anything was wrong with them."""
    report = Report()
    reader = _LabelReader(ClassNames(CLASSES, report), -np.pi / 2 if yaw else 0.0, report)
    named = [(line, f"labels.jsonl:{number}") for number, line in enumerate(lines, start=1)]
    found = Labels({"town", "x", "ego"}, report).recording("r", list(reader.labels(named, "r")))
    return (None if found is None else columns_of(found)), bool(report.counts)


def same(one: Any, two: Any) -> bool:
    if isinstance(one, RecordingColumns | MemberColumns):
        return all(same(getattr(one, field.name), getattr(two, field.name)) for field in fields(one))
    if isinstance(one, np.ndarray):
        return one.tobytes() == two.tobytes()
    return one == two


@settings(deadline=None)
@given(labels=recordings(), yaw=st.booleans())
def test_sound_recordings_are_read_alike(labels: list[dict[str, Any]], yaw: bool) -> None:
    for label in labels:
        tracks: set[str] = set()
        for each in (label.get("ego") or {}, *label.get("objects", ())):
            if each.get("track") in tracks:
                each["track"] = None  # one that comes twice in a label is not sound
            tracks.update([each["track"]] if each.get("track") else [])
    text = json.dumps(labels)
    labels = json.loads(text.replace('"heading"', '"yaw"') if yaw else text)
    lines = [json.dumps(label).encode() for label in labels]
    columns, (expected, wrong) = (
        read_columns(list(map(_parsed, lines)), "r", CLASSES, yaw=yaw),
        reference(lines, yaw=yaw),
    )
    assert not wrong
    assert columns is not None
    assert same(columns, expected)
    assert same(columns_of(Recording("r", columns.map, tuple(labels_of(columns)))), columns)


def places(value: Any) -> list[tuple[Any, Any]]:
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    return [(value, key) for key in keys] + [place for key in keys for place in places(value[key])]


@settings(deadline=None, max_examples=300)
@given(labels=recordings(), draw=st.data())
def test_unsound_recordings_are_left_to_the_other(labels: list[dict[str, Any]], draw: st.DataObject) -> None:
    container, key = draw.draw(st.sampled_from(places(labels)[1:] or [(labels, 0)]))
    container[key] = draw.draw(st.sampled_from(JUNK))
    lines = [json.dumps(label).encode() for label in labels]
    columns, (expected, wrong) = (
        read_columns(list(map(_parsed, lines)), "r", CLASSES, yaw=False),
        reference(lines, yaw=False),
    )
    if columns is not None and Labels({"town", "x", "ego"}, Report()).accept(columns):
        assert not wrong
        assert same(columns, expected)


@pytest.mark.parametrize("name", ["spaceship", ""])
def test_an_unknown_class_is_left_to_the_other(name: str) -> None:
    entry = {"position": [0, 0], "heading": 0, "id": "a", "class": name}
    label = {"id": "f", "recording": "r", "timestamp_us": 0, "map": "town", "ego": entry, "objects": [entry]}
    assert read_columns([label], "r", CLASSES, yaw=False) is None
