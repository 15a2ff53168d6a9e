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
    times = [0, 0.5, 1, 1.5, 2]
    seen = along([(-10 * t + t * t, 0.0) for t in times], heading=math.pi / 2)
    for time, (one,) in zip(times, seen, strict=True):
        one["velocity"] = (-10 + 2 * time, 0.0)
    found = motion(columns_of(recording(times, seen)))
    assert found.acceleration == pytest.approx([-2.0] * 5)


def test_an_acceleration_takes_four_samples_and_a_second():
    for times, there in (
        ([0, 0.5, 1], False), ([0, 0.1, 0.2, 0.3], False), ([0, 0.5, 1, 1.5], True), ([0, 0.2, 0.4, 0.6, 0.8, 1], True),
        ([0, 0.5, 2.1, 2.6], False),
    ):  # fmt: skip
        found = motion(columns_of(recording(times, along([(0, t * t) for t in times], heading=0.0))))
        assert (~np.isnan(found.acceleration)).all() == there, times
        assert (~np.isnan(found.acceleration)).any() == there, times


def test_one_slow_step_is_no_braking():
    # a bus at 5.6 m/s of which one speed at 10 Hz is halved
    seen = along([(0, 5.6 * n / 10) for n in range(30)], heading=0.0, velocity=(0.0, 5.6))
    seen[15][0]["velocity"] = (0.0, 2.8)
    found = motion(columns_of(recording([n / 10 for n in range(30)], seen)))
    assert np.abs(found.acceleration).max() < 1.6
    assert found.acceleration[15] == pytest.approx(0.0, abs=1e-9)


def fitted(times, speeds, middle):
    """The slope of a line through the speeds around a sample: as many on both sides as give a second and four."""
    whole = [0]
    for number in range(1, len(times)):
        whole.append(whole[-1] + (round(times[number] - times[number - 1], 6) > 1.5))
    mine = [number for number in range(len(times)) if whole[number] == whole[middle]]
    for reach in range(1, len(times)):
        chosen = [number for number in mine if abs(number - middle) <= reach]
        seconds = [times[number] for number in chosen]
        if len(chosen) >= 4 and round(seconds[-1] - seconds[0], 6) >= 1:
            return np.polyfit(seconds, [speeds[number] for number in chosen], 1)[0]
    return math.nan


@pytest.mark.parametrize("seed", range(20))
def test_accelerations_are_those_of_polyfit(seed):
    chance = np.random.default_rng(seed)
    times = np.round(np.cumsum(chance.choice([0.1, 0.25, 0.5, 1.0, 1.75], 40, p=[0.4, 0.2, 0.25, 0.1, 0.05])), 2)
    count = len(times)
    headings, ways = chance.uniform(-3, 3, (2, count)), chance.normal(0, 5, (2, 2, count))
    missing = chance.random((2, count)) < 0.1
    seen = [
        [
            {"x": 0.0, "y": 0.0, "track": "ab"[which], "velocity": tuple(ways[which, :, number]),
             "heading": None if missing[which, number] else headings[which, number]}
            for which in chance.permutation(2)
        ]
        for number in range(count)
    ]  # fmt: skip
    columns = columns_of(recording(times, seen))
    found = motion(columns).acceleration
    for which in (0, 1):
        known = np.flatnonzero(~missing[which])
        turned = np.arctan2(-ways[which, 0], ways[which, 1]) - headings[which]
        along_it = np.hypot(*ways[which]) * np.sign(np.cos(turned))
        expected = np.full(count, np.nan)
        for place, number in enumerate(known):
            expected[number] = fitted(times[known], along_it[known], place)
        mine = [place for place, track in enumerate(columns.objects.track) if track == "ab"[which]]
        np.testing.assert_allclose(found[mine], expected, atol=1e-6)


def test_a_yaw_rate_goes_across_the_seam():
    seen = [[{"x": 0.0, "y": 0.0, "track": "t", "heading": heading}] for heading in (3.0, -3.2 + math.tau - 0.1, -3.0)]
    found = motion(columns_of(recording([0, 0.5, 1.0], seen)))
    assert found.yaw_rate[1] == pytest.approx(math.tau - 6.0)


def test_labels_from_a_store_carry_it(tmp_path):
    seen = along([(0, 0), (0, 2), (0, 8)])
    write_dataset(tmp_path / "d", [recording([0, 0.5, 1.0], seen)], {}, name="d")
    labels = [*open_dataset(tmp_path / "d").labels()]
    assert [label.objects[0].motion.velocity for label in labels] == [(0.0, 4.0), (0.0, 8.0), (0.0, 12.0)]
    assert all(label.objects[0].motion.derived and label.objects[0].velocity is None for label in labels)
    assert labels[1].ego.motion.velocity == (0.0, 10.0)
    assert labels[1].ego.motion.acceleration is None


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
    for version in (2, 3, 4):
        make_older(tmp_path / "d", version)
        with pytest.raises(DataError, match=f"version {version}") as refused:
            open_dataset(tmp_path / "d")
        assert "scenicq index" in refused.value.diagnostics[0].hints[0]
        rebuild(open_dataset(tmp_path / "d", older=True, check=False))
        assert manifest.read_text() == before


@pytest.mark.slow
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


@pytest.mark.parametrize("seed", range(3))
def test_speeds_near_the_end_of_all_numbers_give_finite_accelerations_or_none(seed):
    """Velocities are what a source says; what a table holds is a number or nothing."""
    random = np.random.default_rng(seed)
    sizes = random.choice([1.0, 1e150, 1e300, 1.7e308], size=(40, 2)) * random.choice([-1, 1], size=(40, 2))
    seen = [[{"x": 0.0, "y": 0.0, "track": "t", "heading": 0.3, "velocity": (vx, vy)}] for vx, vy in sizes.tolist()]
    found = motion(columns_of(recording(np.arange(40) * 0.25, seen)))
    assert not np.isinf(found.acceleration).any()
    assert np.isnan(found.acceleration).any()
