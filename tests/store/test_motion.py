"""Observed motion: what a label says counts first, the rest comes from its track, never across a gap."""

import hashlib
import json
import math

import numpy as np
import pyarrow.parquet as pq
import pytest

from scenicq.errors import DataError, Source
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.columns import RecordingColumns, columns_of
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.motion import motion_of
from scenicq.store.parquet import part_path
from scenicq.store.rebuild import rebuild
from scenicq.store.schema import ADDED, SCHEMA_VERSION
from scenicq.store.writer import write_dataset

CAR = ("Car", "car")


def recording(times_s, seen, name="r"):
    """A recording whose label objects at each time are given as keyword arguments of `LabelObject`."""
    labels = [
        Label(
            f"{name}-{number}",
            name,
            round(time * 1e6),
            "none",
            LabelObject("ego", *CAR, x=0.0, y=10 * time, heading=0.0),
            tuple(LabelObject(f"o{place}", *CAR, **each) for place, each in enumerate(objects)),
        )
        for number, (time, objects) in enumerate(zip(times_s, seen, strict=True))
    ]
    return Recording(name, "none", tuple(labels))


def motion(columns: RecordingColumns):
    label_of = np.repeat(np.arange(len(columns.frames)), columns.object_counts)
    return motion_of(np.array(columns.times_us)[label_of], columns.objects, columns.objects.track)


def along(path, **more):
    """One object of one track at each place."""
    return [[{"x": x, "y": y, "track": "t", **more}] for x, y in path]


def test_a_velocity_is_a_central_difference_and_one_sided_at_the_ends():
    found = motion(columns_of(recording([0, 0.5, 1.0], along([(0, 0), (0, 2), (0, 8)]))))
    assert found.vy.tolist() == [4.0, 8.0, 12.0]
    assert found.vx.tolist() == [0.0, 0.0, 0.0]
    assert found.derived.all()


def test_the_labels_own_velocity_counts_first():
    seen = along([(0, 0), (0, 2), (0, 8)])
    seen[1][0]["velocity"] = (1.0, 2.0)
    found = motion(columns_of(recording([0, 0.5, 1.0], seen)))
    assert found.vy.tolist() == [4.0, 2.0, 12.0]
    assert found.derived.tolist() == [True, False, True]


def test_nothing_is_said_across_a_gap():
    found = motion(columns_of(recording([0, 1.6, 3.1], along([(0, 0), (0, 2), (0, 5)]))))
    assert np.isnan(found.vy[0])
    assert found.vy[1:].tolist() == [2.0, 2.0]
    assert found.derived.tolist() == [False, True, True]


def test_what_has_no_track_has_no_motion():
    found = motion(columns_of(recording([0, 0.5], along([(0, 0), (0, 2)], track=None, velocity=None))))
    assert np.isnan(found.vy).all()
    assert not found.derived.any()


def test_tracks_are_told_apart_whatever_their_order_in_a_label():
    one, other = {"x": 0.0, "y": 0.0, "track": "a"}, {"x": 5.0, "y": 0.0, "track": "b"}
    later = [{**other, "y": 3.0}, {**one, "y": 1.0}]
    found = motion(columns_of(recording([0, 1], [[one, other], later])))
    assert found.vy.tolist() == [1.0, 3.0, 3.0, 1.0]


def test_acceleration_is_that_along_the_heading():
    # it moves along -x (heading 90 degrees) and slows down from 10 m/s by 2 m/s every second
    path = [(-10 * t + t * t, 0.0) for t in (0, 0.5, 1, 1.5, 2)]
    found = motion(columns_of(recording([0, 0.5, 1, 1.5, 2], along(path, heading=math.pi / 2))))
    assert found.acceleration[2] == pytest.approx(-2.0)


def test_a_yaw_rate_goes_across_the_seam():
    seen = [[{"x": 0.0, "y": 0.0, "track": "t", "heading": heading}] for heading in (3.0, -3.2 + math.tau - 0.1, -3.0)]
    found = motion(columns_of(recording([0, 0.5, 1.0], seen)))
    assert found.yaw_rate[1] == pytest.approx(math.tau - 6.0)


def test_labels_from_a_store_carry_it(tmp_path):
    write_dataset(tmp_path / "d", [recording([0, 0.5, 1.0], along([(0, 0), (0, 2), (0, 8)]))], {}, name="d")
    labels = [*open_dataset(tmp_path / "d").labels()]
    assert [label.objects[0].motion.velocity for label in labels] == [(0.0, 4.0), (0.0, 8.0), (0.0, 12.0)]
    assert all(label.objects[0].motion.derived and label.objects[0].velocity is None for label in labels)
    assert labels[1].ego.motion.velocity == (0.0, 10.0)
    assert labels[1].ego.motion.acceleration == 0.0


def make_older(folder, version):
    """Take from a dataset the columns of the source that its version did not have."""
    manifest = folder / "dataset.json"
    content = json.loads(manifest.read_text())
    assert content["schema"] == SCHEMA_VERSION
    added = {name for later, names in ADDED.items() if later > version for name in names}
    (description,) = (folder / "segments").iterdir()
    texts = {manifest: manifest.read_text(), description: description.read_text()}
    for table in ("labels", "objects", "sensors"):
        (part,) = content["tables"][table]
        file = folder / part["path"]
        rows = pq.read_table(file)
        pq.write_table(rows.drop_columns([n for n in rows.column_names if n.removeprefix("ego_") in added]), file)
        data = file.read_bytes()
        digest = hashlib.sha256(data).hexdigest()
        named = part_path(table, 0, digest)
        file.rename(folder / named)
        new = {
            part["path"]: named,
            part["sha256"]: digest,
            f'"bytes": {part["bytes"]}': f'"bytes": {len(data)}',
            f"[{part['bytes']},": f"[{len(data)},",
        }
        for before, after in new.items():
            texts = {changed: text.replace(before, after) for changed, text in texts.items()}
    texts[manifest] = texts[manifest].replace(f'"schema": {SCHEMA_VERSION}', f'"schema": {version}')
    for changed, text in texts.items():
        changed.write_text(text)


def test_an_older_dataset_is_brought_up_to_date(tmp_path):
    write_dataset(tmp_path / "d", [recording([0, 0.5, 1.0], along([(0, 0), (0, 2), (0, 8)]))], {}, name="d")
    manifest = tmp_path / "d" / "dataset.json"
    before = manifest.read_text()
    for version in (2, 3):
        make_older(tmp_path / "d", version)
        with pytest.raises(DataError, match=f"version {version}") as refused:
            open_dataset(tmp_path / "d")
        assert "scenicq index" in refused.value.diagnostics[0].hints[0]
        rebuild(open_dataset(tmp_path / "d", older=True, check=False))
        assert manifest.read_text() == before


def test_a_derived_speed_is_compared_and_read(tmp_path):
    write_dataset(tmp_path / "d", [recording([0, 0.5, 1.0], along([(0, 0), (0, 2), (0, 8)]))], {}, name="d")
    for lines, frames in {
        "new Object at (0, Range(-1, 9)), with speed 8": ["r-1"],
        "other = new Object at (0, Range(-1, 9))\nrequire other.speed > 7 and ego.speed > 9": ["r-1", "r-2"],
        "other = new Object at (0, Range(-1, 9))\nrequire other.acceleration > 1 and other.angularSpeed == 0": [],
    }.items():
        program = Source("p.scenic", f"ego = new Object at (0, Range(-1, 99)), facing 0\n{lines}\n")
        for prefilter in (True, False):
            query = Query(open_dataset(tmp_path / "d"), program, QueryOptions(prefilter=prefilter))
            found = list(query.results())
            assert [result.frame for result in found if isinstance(result.verdict, Match)] == frames, lines
            # without headings nothing says how speeds change
            assert ("acceleration" in lines) == any(isinstance(result.verdict, Unknown) for result in found)
