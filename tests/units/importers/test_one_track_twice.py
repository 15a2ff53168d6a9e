"""One track is at most one object of a label: of two the first is kept, and the source is told where."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from scenicq.errors import DataError, Source
from scenicq.geometry.default_street import street
from scenicq.importers.base import LabelChecker
from scenicq.importers.ingest import ingest
from scenicq.importers.report import Report
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.verification import verify_computed
from scenicq.store.writer import write_dataset

STREET = street()
CROSSROADS = Path(__file__).parents[3] / "sample_data/crossroads"


def thing(id_: str, x: float, track: str | None) -> LabelObject:
    return LabelObject(id_, "Car", "car", x, 0.0, 0.0, 2.0, 4.5, 1.5, None, track)


LABEL = Label("f", "r", 1, STREET.name, thing("ego", 0.0, None), (
    thing("a", 10.0, "t"), thing("b", 50.0, "t"), thing("c", 60.0, "u"), thing("d", 70.0, None),
    thing("e", 80.0, None), thing("g", 90.0, "t"),
))  # fmt: skip


def test_every_importer_keeps_the_first_and_tells_of_the_others():
    report = Report()
    recording = LabelChecker({STREET.name}, report).check_labels("r", [(LABEL, "source line 7")])
    assert recording is not None
    assert list(recording.objects.id) == ["a", "c", "d", "e"]
    assert [each.message for each in report.problems] == [
        f"source line 7: object `{id_}` of label `f`: has the track `t` of object `a`, which is kept"
        for id_ in ("b", "g")
    ]


def test_an_object_with_the_ego_s_track_is_left_out():
    """The importer that takes an object for the ego and leaves it among the objects, too, is told."""
    report = Report()
    label = replace(LABEL, ego=replace(LABEL.ego, track="u"))
    recording = LabelChecker({STREET.name}, report).check_labels("r", [(label, "source line 7")])
    assert recording is not None
    assert list(recording.objects.id) == ["a", "d", "e"]
    assert "source line 7: object `c` of label `f`: has the track `u` of object `ego`, which is kept" in [
        each.message for each in report.problems
    ]


def test_a_source_with_one_track_twice_is_told_so(tmp_path):
    """Two objects in a label, but one track: what is said of it at one sample must not be true of the other."""
    source = tmp_path / "source"
    source.mkdir()
    lines = [json.loads(line) for line in (CROSSROADS / "labels.jsonl").read_text().splitlines()[:6]]
    for file in ("dataset.json", "maps"):
        (source / file).symlink_to(CROSSROADS / file)
    first, second = lines[3]["objects"][:2]
    second["track"] = first["track"] = "same"
    (source / "labels.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    summary = ingest(source, tmp_path / "dataset")
    told = [each.message for each in summary.diagnostics if "track `same`" in each.message]
    assert len(told) == 1
    assert f"`{second['id']}`" in told[0]
    assert f"`{lines[3]['id']}`" in told[0]
    verify_computed(open_dataset(tmp_path / "dataset"))
    with pytest.raises(DataError):
        ingest(source, tmp_path / "strict", strict=True)


def test_verification_tells_of_a_dataset_that_has_one_track_twice(tmp_path):
    recording = Recording("r", STREET.name, (LABEL,))
    write_dataset(tmp_path / "d", iter([recording]), {STREET.name: STREET.features}, name="twice")
    with pytest.raises(DataError, match="two objects of one track"):
        verify_computed(open_dataset(tmp_path / "d"))


def test_no_interval_takes_two_objects_of_a_label_for_one(tmp_path):
    recording = LabelChecker({STREET.name}, Report()).check_labels("r", [(LABEL, "")])
    assert recording is not None
    write_dataset(tmp_path / "d", iter([recording]), {STREET.name: STREET.features}, name="once")
    text = (
        "model scenic.domains.driving.model\nego = new Car in everywhere, facing 0 deg\n"
        "c = new Car in everywhere, facing 0 deg\nrequire (distance to c) < 20\n"
        "require eventually (distance to c) > 40\n"
    )
    query = Query(open_dataset(tmp_path / "d"), Source("once.scenic", text), QueryOptions())
    assert list(query.results()) == []
