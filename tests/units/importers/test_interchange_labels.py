"""Lines of an interchange folder become what `json` says they are; what is left out of them is told."""

from __future__ import annotations

import json
import math
import pickle
from collections import Counter
from copy import deepcopy
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from label_rows import labels_of

from scenicq.geometry.angles import normalize
from scenicq.importers.base import ClassNames, LabelChecker
from scenicq.importers.interchange_labels import LabelLines
from scenicq.importers.report import Report
from scenicq.store.columns import RecordingColumns
from scenicq.store.labels import Label, LabelObject, OutOfPlane

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
    {"position": st.tuples(reals, reals).map(list), "heading": st.none() | reals},
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


def read(lines: list[bytes], angle: str = "heading") -> tuple[RecordingColumns | None, Report]:
    report = Report()
    taken = LabelLines("r", ClassNames(CLASSES, report), angle, report)
    for number, line in enumerate(lines, start=1):
        taken.add(line, f"labels.jsonl:{number}")
    found = LabelChecker({"town", "x", "ego"}, report).check_columns(taken.columns(), taken.places, taken.maps)
    return pickle.loads(pickle.dumps(found)), report


def plain_object(entry: dict[str, Any], id: str, turn: float, angle: str) -> LabelObject:
    """An ego or object as the page of the format has it."""
    heading = entry[angle]
    name = entry.get("class") or ""
    space = [entry.get("z"), *(None if entry.get(key) is None else normalize(entry[key]) for key in ("pitch", "roll"))]
    return LabelObject(
        id=id,
        category=CLASSES[name] if name else "Car",
        source_class=name,
        x=entry["position"][0],
        y=entry["position"][1],
        heading=None if heading is None else normalize(heading + turn),
        width=entry.get("width"),
        length=entry.get("length"),
        height=entry.get("height"),
        velocity=tuple(entry["velocity"]) if entry.get("velocity") else None,
        track=entry.get("track") or None,
        attributes=entry.get("attributes") or {},
        out_of_plane=None if space == [None] * 3 else OutOfPlane(*space),
    )


@settings(deadline=None)
@given(labels=recordings(), yaw=st.booleans())
def test_sound_labels_are_what_json_says(labels: list[dict[str, Any]], yaw: bool) -> None:
    angle = "yaw" if yaw else "heading"
    turn = -math.pi / 2 if yaw else 0.0
    for label in labels:
        tracks: set[str] = set()
        for each in (label["ego"], *label["objects"]):
            if each.get("track") in tracks:
                each["track"] = None  # one that comes twice in a label is not sound
            tracks.update([each["track"]] if each.get("track") else [])
    labels = json.loads(json.dumps(labels).replace('"heading"', f'"{angle}"'))
    columns, report = read([json.dumps(label).encode() for label in labels], angle)
    assert columns is not None
    assert {problem.code for problem in report.problems} <= {"assumed"}
    found = labels_of(columns)
    assert [label.timestamp_us for label in found] == sorted(label["timestamp_us"] for label in labels)
    by_id = {label["id"]: label for label in labels}
    for label in found:
        told = by_id[label.frame]
        assert label.params == (told["params"] or {})
        assert label.ego == plain_object(told["ego"], "ego", turn, angle)
        assert list(label.objects) == [plain_object(each, each["id"], turn, angle) for each in told["objects"]]
        files = told["sensors"] or {}
        assert label.sensors == {name: file if isinstance(file, str) else file["path"] for name, file in files.items()}
        assert set(label.cameras) == {name for name, file in files.items() if file == CAMERA}


def places(value: Any) -> list[tuple[Any, Any]]:
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    return [(value, key) for key in keys] + [place for key in keys for place in places(value[key])]


@settings(deadline=None, max_examples=300)
@given(labels=recordings(), draw=st.data())
def test_what_is_not_there_is_told(labels: list[dict[str, Any]], draw: st.DataObject) -> None:
    labels = deepcopy(labels)  # what is drawn may be shared between draws
    container, key = draw.draw(st.sampled_from(places(labels)[1:] or [(labels, 0)]))
    container[key] = draw.draw(st.sampled_from(JUNK))
    columns, report = read([json.dumps(label).encode() for label in labels])
    found: list[Label] = [] if columns is None else labels_of(columns)
    left: Counter[str] = Counter()
    for entry in report.counts:
        if not entry.kept and entry.code != "not-read":
            left[entry.what] += entry.count
    assert len(found) + left["label"] == len(labels)
    if not left["label"]:
        assert sum(len(label.objects) for label in found) + left["object"] == sum(
            len(label["objects"]) for label in labels
        )
    for problem in report.problems:
        assert problem.message.startswith(
            ("labels.jsonl:", "labels have no map", "class ", "recording ", "an angle", "map ")
        )


LINE = {"id": "f", "recording": "r", "timestamp_us": 0, "map": "town", "ego": {"position": [0, 0], "heading": 0}}
THING = {"id": "a", "class": "car", "position": [1, 2], "heading": 0}


@pytest.mark.parametrize(
    ("field", "told"),
    [
        ('"position": [NaN, 1]', "`position[0]` is not finite"),
        ('"position": [0, -Infinity]', "`position[1]` is not finite"),
        ('"position": [0, {"x": "NaN"}]', "`position[1]` is not a number but an object"),
        ('"velocity": [1, "NaN"]', "`velocity[1]` is not a number but a text"),
        ('"velocity": [1]', "`velocity` does not have 2 elements"),
        ('"height": 0', "`height` is not positive"),
        ('"class": ""', "`class` is empty"),
        (f'"track": "{"x" * 4097}"', "`track` is longer than 4096 characters"),
        ('"attributes": []', "`attributes` is not an object but a list"),
        ('"z": 1e8', "`z` is no place on a map"),
    ],
)
def test_what_is_wrong_with_an_object_is_told_with_its_path(field: str, told: str) -> None:
    text = json.dumps(LINE | {"objects": [THING, THING | {"id": "b", "track": '"NaN'}]})
    columns, report = read([f"{text[:-3]}, {field}}}]}}".encode()])
    assert columns is not None
    assert list(columns.objects.id) == ["a"]
    assert [problem.message for problem in report.problems] == [f"labels.jsonl:1: object `b` of label `f`: {told}"]


def test_a_field_of_no_list_is_counted_and_what_is_beside_it_read() -> None:
    things = [THING, THING | {"id": "b", "score": 0.5, "more": {}}, THING | {"id": "c", "score": [{}, {}]}]
    columns, report = read([json.dumps(LINE | {"objects": things, "weather": "NaN"}).encode()])
    assert columns is not None
    assert list(columns.objects.id) == ["a", "b", "c"]
    counts = {entry.name: entry.count for entry in report.counts}
    assert counts == {"labels/weather": 1, "labels/objects/score": 3}


def test_a_mark_at_the_beginning_is_no_part_of_the_line() -> None:
    columns, report = read([b"\xef\xbb\xbf" + json.dumps(LINE | {"objects": []}).encode()])
    assert columns is not None
    assert not report.counts


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (b"{", "not JSON: Expecting property name"),
        (b'{"id": "\xff"}', "not JSON: 'utf-8' codec"),
        (b'{"id": "\\ud800"}', "not JSON: it has half of a character"),
        (b'{"id": "f", "params": ' + b"[" * 100_000, "not JSON: nested too deeply"),
        (b"[1]", "it is not an object but a list"),
        (b'{"id": "f", "timestamp_us": NaN}', "label `f`: `timestamp_us` is not finite"),
        (b'{"timestamp_us": 1}', "`id` is missing"),
    ],
)
def test_a_line_that_is_no_label(line: bytes, told: str) -> None:
    columns, report = read([line, json.dumps(LINE | {"objects": []}).encode()])
    assert columns is not None
    assert list(columns.frames) == ["f"]
    (problem,) = report.problems
    assert problem.message.startswith(f"labels.jsonl:1: {told}")
