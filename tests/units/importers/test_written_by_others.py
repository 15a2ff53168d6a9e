"""Sources as other tools write them: byte order marks, typed times, a number for two, decimal commas, lost links."""

from __future__ import annotations

import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.feather as pf
import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.importers.tfrecord import crc32c
from scenicq.store.dataset import open_dataset

SAMPLES = Path(__file__).parents[3] / "sample_data"


def copy(name: str, tmp_path: Path) -> Path:
    return Path(shutil.copytree(SAMPLES / name, tmp_path / "source"))


def labels_of(source: Path, target: Path):
    summary = ingest(source, target)
    return list(open_dataset(target).labels()), summary


@pytest.mark.parametrize(
    "name",
    ["kitti_tiny", "interaction_tiny", "openlabel_tiny", "nuscenes_tiny", "crossroads", "commonroad_tiny",
     "forecasting_tiny"],
)  # fmt: skip
@pytest.mark.one_in(3)
def test_a_byte_order_mark_changes_nothing(name: str, tmp_path: Path) -> None:
    plain, _ = labels_of(SAMPLES / name, tmp_path / "plain")
    source = copy(name, tmp_path)
    for file in source.rglob("*"):
        if file.suffix in (".txt", ".csv", ".json", ".jsonl", ".geojson", ".xml", ".osm"):
            file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    marked, _ = labels_of(source, tmp_path / "marked")
    assert marked == plain
    assert len(open_dataset(tmp_path / "marked").maps) == len(open_dataset(tmp_path / "plain").maps)


@pytest.mark.parametrize("unit", ["ns", "us"])
def test_times_that_have_a_type_are_times(unit: str, tmp_path: Path) -> None:
    plain, _ = labels_of(SAMPLES / "argoverse2_tiny", tmp_path / "plain")
    source = copy("argoverse2_tiny", tmp_path)
    for file in source.rglob("*.feather"):
        table = pf.read_table(file)
        column = table.schema.get_field_index("timestamp_ns")
        times = table["timestamp_ns"].cast(pa.timestamp("ns")).cast(pa.timestamp(unit))
        pf.write_feather(table.set_column(column, "timestamp_ns", times), file)
    typed, _ = labels_of(source, tmp_path / "typed")
    assert typed == plain


def test_a_number_that_a_car_and_a_person_share_is_two_tracks(tmp_path: Path) -> None:
    plain, _ = labels_of(SAMPLES / "interaction_tiny", tmp_path / "plain")
    source = copy("interaction_tiny", tmp_path)
    people = next(source.rglob("pedestrian*.csv"))
    people.write_text(people.read_text().replace("P1,", "1,"))
    shared, summary = labels_of(source, tmp_path / "shared")
    assert shared == plain
    assert {each.track for label in shared for each in label.objects if each.category == "Pedestrian"} == {"P1"}
    assert any(entry.name == "people numbered apart" for entry in summary.left_out)


def test_a_decimal_comma_is_told_with_its_place(tmp_path: Path) -> None:
    source = copy("interaction_tiny", tmp_path)
    chart = next(source.rglob("*.osm"))
    chart.write_text(chart.read_text().replace('lat="0.0"', 'lat="0,0"'))
    _, summary = labels_of(source, tmp_path / "d")
    told = [each.message for each in summary.diagnostics]
    assert any("node: `lat` is not a number but `0,0`" in message for message in told), told


def test_examples_for_tensorflow_are_named(tmp_path: Path) -> None:
    content = b"\x0a\x14roadgraph_samples/id"
    length = len(content).to_bytes(8, "little")
    checks = [crc32c(part) for part in (length, content)]
    masked = [((each >> 15 | each << 17) + 0xA282EAD8 & 0xFFFFFFFF).to_bytes(4, "little") for each in checks]
    (tmp_path / "x.tfrecord").write_bytes(length + masked[0] + content + masked[1])
    with pytest.raises(DataError) as error:
        ingest(tmp_path / "x.tfrecord", tmp_path / "d")
    assert any("`scenario`" in hint for each in error.value.diagnostics for hint in each.hints)
