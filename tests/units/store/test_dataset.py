"""Writing and reading datasets: what goes in comes out, and damage is noticed."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import duckdb
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, box

from scenicq.errors import DataError, Source
from scenicq.geometry.features import MapFeature
from scenicq.query.execution.run import Query
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.manifest import MANIFEST, Counts
from scenicq.store.writer import DatasetWriter, write_dataset

EAST = -math.pi / 2
MAP = (
    MapFeature("street", "road", box(0, -4, 100, 4), {"forward": "group"}),
    MapFeature("group", "lane_group", box(0, -4, 100, 0), {"road": "street"}),
    MapFeature(
        "lane",
        "lane",
        box(0, -4, 100, 0),
        {"centerline": [[[0.0, -2.0], [100.0, -2.0]]], "road": "street", "group": "group", "successors": ["other"]},
    ),
    MapFeature("other", "lane", box(100, -4, 200, 0), {"centerline": [[[100.0, -2.0], [200.0, -2.0]]]}),
    MapFeature("kerb", "curb", LineString([(0, 4), (100, 4)])),
    MapFeature("pond", "pond", box(300, 300, 310, 310).difference(box(302, 302, 303, 303)), {"depth": 1.5}),
)


def label(frame: str, recording: str = "r1", time: int = 0, **changes: object) -> Label:
    values: dict[str, object] = {
        "frame": frame,
        "recording": recording,
        "timestamp_us": time,
        "map": "town",
        "ego": LabelObject("ego", "Car", "", 10.0, -2.0, EAST, 1.8, 4.5, None, (5.0, 0.0)),
        "objects": (
            LabelObject("a", "Truck", "lorry", 20.0, -3.0, EAST, 2.5, 8.0, 3.0, (5.0, 0.1), "t1", {"doors": 2}),
            LabelObject("b", "Object", "blob", 10.0, 5.5, None, attributes={"text": 'ü"\n', "on": True, "f": 0.1}),
        ),
        "params": {"weather": "rain", "time": 12.5},
        "sensors": {"CAM": "a/b.jpg", "LIDAR": "c.bin"},
    }
    return Label(**(values | changes))  # pyright: ignore[reportArgumentType]


def write(target: Path, *labels: Label, force: bool = False) -> Dataset:
    names = sorted({entry.recording for entry in labels})
    recordings = [Recording(name, "town", tuple(x for x in labels if x.recording == name)) for name in names]
    write_dataset(target, recordings, {"town": MAP}, name="test", force=force)
    return open_dataset(target)


def codes(error: pytest.ExceptionInfo[DataError]) -> set[str]:
    return {diagnostic.code for diagnostic in error.value.diagnostics}


def test_labels_come_back_equal_and_in_order(tmp_path: Path) -> None:
    labels = [label("z", time=1), label("a", time=2, objects=(), params={}, sensors={}), label("m", "r2", 0)]
    dataset = write(tmp_path / "d", *labels)
    assert list(dataset.labels()) == labels
    assert dataset.manifest.total == Counts(3, 4)
    assert dataset.manifest.by_class == {"Object": 2, "Truck": 2}
    assert dataset.manifest.tracks == 2
    assert dataset.manifest.span_us == (0, 2)


def test_chosen_frames(tmp_path: Path) -> None:
    labels = [label(f"f{number:02}", time=number) for number in range(20)]
    dataset = write(tmp_path / "d", *labels)
    assert list(dataset.labels(["f07", "f03", "f04", "nowhere"])) == [labels[3], labels[4], labels[7]]
    assert list(dataset.labels([])) == []


@pytest.mark.slow
def test_many_rows_are_split_into_row_groups_and_joined_again(tmp_path: Path) -> None:
    many = tuple(LabelObject(str(number), "Cone", "cone", 1.0 + number, 0.0) for number in range(700))
    labels = [label(f"f{number:04}", time=number, objects=many[: 500 + number % 200]) for number in range(300)]
    dataset = write(tmp_path / "d", *labels)
    rows = dataset.connect().execute(
        "SELECT max(row_group_id) FROM parquet_metadata(?)", [str(dataset.files("objects")[0])]
    )
    assert rows.fetchall() == [(1,)]
    assert list(dataset.labels()) == labels


reals = st.floats(-1e6, 1e6)
texts = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=5)
scalars = st.dictionaries(texts, st.one_of(texts, reals, st.booleans()), max_size=2)
members = st.builds(
    LabelObject,
    id=texts,
    category=st.sampled_from(["Car", "Object"]),
    source_class=texts,
    x=reals,
    y=reals,
    heading=st.none() | st.floats(-math.pi, math.pi, exclude_min=True),
    width=st.none() | st.floats(0.1, 10),
    length=st.none() | st.floats(0.1, 10),
    height=st.none() | st.floats(0.1, 10),
    velocity=st.none() | st.tuples(reals, reals),
    track=st.none() | texts,
    attributes=scalars,
)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    entries=st.lists(
        st.tuples(members, st.lists(members, max_size=3, unique_by=lambda x: x.id), scalars), min_size=1, max_size=4
    )
)
def test_round_trip_of_any_label(tmp_path: Path, entries: list[tuple[LabelObject, list[LabelObject], dict]]) -> None:
    labels = [
        label(
            f"f{number}",
            time=number,
            ego=LabelObject("ego", ego.category, ego.source_class, ego.x, ego.y, ego.heading, track=ego.track),
            objects=tuple(member for member in others if member.id != "ego"),
            params=params,
        )
        for number, (ego, others, params) in enumerate(entries)
    ]
    assert list(write(tmp_path / "d", *labels, force=True).labels()) == labels


def test_maps_come_back_equal(tmp_path: Path) -> None:
    dataset = write(tmp_path / "d", label("f"))
    assert dataset.features("town") == MAP
    assert dataset.features("nowhere") == ()
    assert dataset.network("town").roadDirection.values(10, -2) == pytest.approx((EAST,))
    assert dataset.maps == ("town",)


def test_computed_columns(tmp_path: Path) -> None:
    connection = write(tmp_path / "d", label("f")).connect()
    rows = connection.sql(
        "SELECT id, ego_right, ego_ahead, ego_distance, relative_heading, road_directions, lane FROM objects"
    ).fetchall()
    lorry, blob = rows
    assert lorry[:5] == pytest.approx(("a", 1.0, 10.0, math.hypot(10, 1), 0.0))
    assert lorry[5] == pytest.approx([EAST])
    assert lorry[6] == "lane"
    assert blob[1] == pytest.approx(-7.5)
    assert blob[4] is None
    assert blob[6] is None
    ego = connection.sql("SELECT ego_lane, ego_road_directions, class_counts['Truck'], object_count FROM labels")
    assert ego.fetchall() == [("lane", [pytest.approx(EAST)], 1, 2)]


def test_memberships_hold_everything_within_two_metres(tmp_path: Path) -> None:
    connection = write(tmp_path / "d", label("f")).connect()
    rows = connection.sql("SELECT object, kind, region, distance FROM memberships ORDER BY ALL").fetchall()
    assert rows == [
        ("a", "lane", "lane", 0.0),
        ("a", "lane_group", "group", 0.0),
        ("a", "road", "street", 0.0),
        ("b", "curb", "kerb", 1.5),
        ("b", "road", "street", 1.5),
        ("ego", "lane", "lane", 0.0),
        ("ego", "lane_group", "group", 0.0),
        ("ego", "road", "street", 0.0),
    ]


def test_connection_reads_nothing_else(tmp_path: Path) -> None:
    connection = write(tmp_path / "d o't", label("f")).connect(threads=1, memory_limit="200MB")
    assert connection.sql("SELECT count(*) FROM sensors").fetchall() == [(2,)]
    (tmp_path / "secret.csv").write_text("a\n1\n")
    with pytest.raises(duckdb.Error):
        connection.sql(f"SELECT * FROM read_csv('{tmp_path}/secret.csv')").fetchall()
    with pytest.raises(duckdb.Error):
        connection.execute("SET enable_external_access = true")


def test_two_writes_are_byte_identical(tmp_path: Path) -> None:
    first, second = (write(tmp_path / name, label("f"), label("g", "r2")) for name in ("one", "two"))
    names = sorted(path.relative_to(first.path) for path in first.path.rglob("*") if path.is_file())
    assert names == sorted(path.relative_to(second.path) for path in second.path.rglob("*") if path.is_file())
    assert all((first.path / name).read_bytes() == (second.path / name).read_bytes() for name in names)


def test_order_is_the_callers_duty(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="comes after"):
        write_dataset(
            tmp_path / "d", [Recording(name, "town", (label(name, name),)) for name in ("r2", "r1")], {}, name="d"
        )
    with pytest.raises(ValueError, match="order of time"), DatasetWriter(tmp_path / "d", {}) as writer:
        writer.add(Recording("r", "town", (label("a", time=2), label("b", time=1))))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", ["folder", "file", "interchange"])
def test_a_foreign_target_is_never_replaced(tmp_path: Path, content: str) -> None:
    target = tmp_path / "d"
    if content == "file":
        target.write_text("mine")
    else:
        target.mkdir()
    if content == "interchange":
        (target / MANIFEST).write_text('{"interchange": 1}')
    with pytest.raises(DataError) as error:
        write(target, label("f"), force=True)
    assert codes(error) == {"target-exists"}
    assert target.exists()


def test_a_dataset_is_replaced_only_by_force(tmp_path: Path) -> None:
    write(tmp_path / "d", label("old"))
    with pytest.raises(DataError) as error:
        write(tmp_path / "d", label("new"))
    assert codes(error) == {"target-exists"}
    assert [entry.frame for entry in open_dataset(tmp_path / "d").labels()] == ["old"]
    write(tmp_path / "d", label("new"), force=True)
    assert [entry.frame for entry in open_dataset(tmp_path / "d").labels()] == ["new"]
    assert [path.name for path in tmp_path.iterdir()] == ["d"]


def test_an_interrupted_replacement_keeps_the_old_dataset(tmp_path: Path) -> None:
    write(tmp_path / "d", label("old"))

    def interrupted() -> Iterator[Recording]:
        yield Recording("r1", "town", (label("new"),))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_dataset(tmp_path / "d", interrupted(), {"town": MAP}, name="test", force=True)
    assert [entry.frame for entry in open_dataset(tmp_path / "d").labels()] == ["old"]
    assert [path.name for path in tmp_path.iterdir()] == ["d"]


def test_target_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for target in (tmp_path / "file" / "d", tmp_path / "nowhere" / "d"):
        with pytest.raises(DataError) as error:
            write(target, label("f"))
        assert codes(error) == {"target-unwritable"}


def test_what_a_killed_process_left_is_removed(tmp_path: Path) -> None:
    (tmp_path / ".d.partial" / "objects").mkdir(parents=True)
    (tmp_path / ".d.partial" / "objects" / "part-00007.parquet").write_text("cut off")
    (tmp_path / ".d.partial" / "lock").write_text("")
    dataset = write(tmp_path / "d", label("f"))
    assert [path.name for path in tmp_path.iterdir()] == ["d"]
    assert list((dataset.path / "objects").iterdir()) == list(dataset.files("objects"))
    assert not (dataset.path / "lock").exists()


def test_two_processes_do_not_write_one_target(tmp_path: Path) -> None:
    with DatasetWriter(tmp_path / "d", {"town": MAP}) as writer:
        with pytest.raises(DataError, match="another ingest is writing") as error:
            write_dataset(tmp_path / "d", [], {}, name="other")
        assert codes(error) == {"target-exists"}
        writer.add(Recording("r1", "town", (label("f"),)))
        writer.finish(name="mine")
    assert [entry.frame for entry in open_dataset(tmp_path / "d").labels()] == ["f"]


def test_a_reader_keeps_the_version_that_it_began_with(tmp_path: Path) -> None:
    write(tmp_path / "d", label("old"))
    reader = open_dataset(tmp_path / "d")
    other = reader.connect()
    write(tmp_path / "d", label("new"), force=True)
    assert [entry.frame for entry in reader.labels()] == ["old"]
    assert other.sql("SELECT frame FROM labels").fetchall() == [("old",)]
    assert [entry.frame for entry in open_dataset(tmp_path / "d").labels()] == ["new"]
    assert [path.name for path in tmp_path.iterdir()] == ["d"]
    reader.release()
    write(tmp_path / "d", label("newer"), force=True)
    assert list((tmp_path / "d" / "labels").iterdir()) == list(open_dataset(tmp_path / "d").files("labels"))


def test_opening_what_is_no_dataset(tmp_path: Path) -> None:
    for content in (None, "{}", '{"interchange": 1}', "[]"):
        if content is not None:
            (tmp_path / MANIFEST).write_text(content)
        with pytest.raises(DataError) as error:
            open_dataset(tmp_path)
        assert codes(error) == {"store-missing"}


def test_opening_another_version(tmp_path: Path) -> None:
    path = write(tmp_path / "d", label("f")).path / MANIFEST
    path.write_text(json.dumps(json.loads(path.read_text()) | {"schema": 999}))
    with pytest.raises(DataError) as error:
        open_dataset(tmp_path / "d")
    assert codes(error) == {"store-version"}


@pytest.mark.parametrize("damage", ["manifest cut", "key missing", "path outside", "file missing", "file cut"])
def test_opening_a_damaged_dataset(tmp_path: Path, damage: str) -> None:
    dataset = write(tmp_path / "d", label("f"))
    manifest, objects = dataset.path / MANIFEST, dataset.files("objects")[0]
    content = json.loads(manifest.read_text())
    if damage == "manifest cut":
        manifest.write_bytes(manifest.read_bytes()[:100])
    elif damage == "key missing":
        del content["tables"]["objects"]
        manifest.write_text(json.dumps(content))
    elif damage == "path outside":
        content["tables"]["objects"][0]["path"] = "../../etc/passwd"
        manifest.write_text(json.dumps(content))
    elif damage == "file missing":
        objects.unlink()
    else:
        objects.write_bytes(objects.read_bytes()[:-1])
    with pytest.raises(DataError) as error:
        open_dataset(tmp_path / "d")
    assert codes(error) == {"store-damaged"}


@pytest.mark.parametrize("table", ["labels", "objects", "sensors", "memberships", "regions", "frame_index"])
def test_a_file_that_cannot_be_read_any_more_is_named(tmp_path: Path, table: str) -> None:
    dataset = write(tmp_path / "d", label("f"))
    (path,) = dataset.files(table)
    path.write_bytes(bytes(path.stat().st_size))
    program = Source("any.scenic", "model scenic.domains.driving.model\nego = new Car on road\n")
    with pytest.raises(DataError, match=f"{table}/part-00000-.* has changed") as error:
        list(Query(open_dataset(tmp_path / "d"), program).results())
    assert codes(error) == {"store-damaged"}
    assert len(error.value.diagnostics) == 1


def test_verify_notices_a_changed_byte(tmp_path: Path) -> None:
    dataset = write(tmp_path / "d", label("f"))
    dataset.verify()
    objects = dataset.files("objects")[0]
    content = bytearray(objects.read_bytes())
    content[len(content) // 2] ^= 1
    objects.write_bytes(content)
    with pytest.raises(DataError) as error:
        open_dataset(tmp_path / "d").verify()
    assert codes(error) == {"store-damaged"}
