"""Each rule on what tables say of each other finds the row that breaks it, and nothing in sound tables."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset
from scenicq.store.rules import PART_COLUMNS, RULES, check_part
from scenicq.store.schema import SCHEMAS

Rows = list[dict[str, Any]]
NAMES = {name: name for name in PART_COLUMNS}
CAMERA = {"image_width": 640, "image_height": 360, "intrinsics": [500.0, 510.0, 320.0, 180.0],
          "camera_pose": [1.0, 2.0, 1.5, 1.0, 0.0, 0.0, 0.0]}  # fmt: skip


def change(row: int, **values: Any) -> Callable[[Rows], None]:
    return lambda rows: rows[row].update(values)


def beside(row: int, column: str, by: Any) -> Callable[[Rows], None]:
    return lambda rows: rows[row].update({column: rows[row][column] + by})


def twice(first: int, column: str) -> Callable[[Rows], None]:
    return lambda rows: rows[first + 1].update({column: rows[first][column]})


def miscounted(rows: Rows) -> None:
    (name, count), *others = rows[4]["class_counts"]
    rows[4]["class_counts"] = [(name, count + 1), *others]


DAMAGE: dict[tuple[str, str, str], tuple[int | None, Callable[[Rows], None]]] = {
    ("labels", "frame", "comes before"): (5, beside(5, "timestamp_us", -(10**9))),
    ("labels", "map", "is no map"): (3, change(3, map="elsewhere")),
    ("labels", "map", "changes within"): (7, change(7, map="other")),
    ("labels", "class_counts", "is not how many"): (4, miscounted),
    ("objects", "frame", "is not that"): (9, change(9, frame="elsewhere")),
    ("objects", "recording", "is not that"): (9, change(9, recording="elsewhere")),
    ("objects", "timestamp_us", "is not that"): (9, beside(9, "timestamp_us", 1)),
    ("objects", "ordinal", "is not the row"): (9, beside(9, "ordinal", 1)),
    ("objects", "id", "is the name of the ego"): (9, change(9, id="ego")),
    ("objects", "id", "occurs twice"): (None, lambda rows: twice(pair(rows), "id")(rows)),
    ("objects", "ego_right", "positions"): (9, beside(9, "ego_right", 1e-3)),
    ("objects", "ego_ahead", "positions"): (9, change(9, ego_ahead=None)),
    ("objects", "ego_distance", "positions"): (9, beside(9, "ego_distance", 1e-3)),
    ("objects", "relative_heading", "headings"): (9, beside(9, "relative_heading", 1e-5)),
    ("sensors", "frame", "is not that"): (2, change(2, frame="elsewhere")),
    ("sensors", "channel", "occurs twice"): (None, lambda rows: twice(pair(rows), "channel")(rows)),
    ("sensors", "image_height", "without the width"): (2, change(2, image_height=360)),
    ("sensors", "intrinsics", "4 numbers"): (2, change(2, **CAMERA | {"intrinsics": [1.0]})),
    ("sensors", "camera_pose", "7 numbers"): (2, change(2, camera_pose=[1.0])),
    ("memberships", "distance", "more than"): (6, change(6, distance=2.1)),
    ("memberships", "frame", "is no frame"): (6, change(6, frame="elsewhere")),
    ("memberships", "object", "is not in the frame"): (6, change(6, object="elsewhere")),
}


def pair(rows: Rows) -> Any:
    """The first row that is followed by another of its frame."""
    return next((n for n, (one, other) in enumerate(pairwise(rows)) if one["frame"] == other["frame"]), None)


@pytest.fixture(scope="module", params=["crossroads", "nuscenes_tiny"])
def tables(request, tmp_path_factory) -> dict[str, Any]:

    target = tmp_path_factory.mktemp("rules") / "d"
    ingest(Path(__file__).parents[3] / "sample_data" / request.param, target)
    dataset = open_dataset(target)
    return {name: pq.read_table(dataset.path / dataset.manifest.tables[name][0].path) for name in PART_COLUMNS}


def check(tables: dict[str, Any], **changed: Rows) -> None:
    """Check tables, some of which have other rows."""
    maps = [*tables["labels"]["map"].to_pylist(), "other"]
    check_part(
        tables | {name: pa.Table.from_pylist(rows, SCHEMAS[name]) for name, rows in changed.items()}, NAMES, maps
    )


def test_every_rule_has_its_damage(tables):
    check(tables)
    assert sorted(rule[:2] for rule in RULES) == sorted(place[:2] for place in DAMAGE)


@pytest.mark.parametrize("damage", DAMAGE, ids=" ".join)
@pytest.mark.one_in(3)
def test_the_row_that_breaks_a_rule_is_named(tables, damage):
    table, column, what = damage
    row, spoil = DAMAGE[damage]
    rows = tables[table].to_pylist()
    if len(rows) <= 9 or (row is None and pair(rows) is None):
        pytest.skip("the sample has too few rows")
    row = pair(rows) + 1 if row is None else row
    spoil(rows)
    with pytest.raises(DataError) as refused:
        check(tables, **{table: rows})
    (told,) = refused.value.diagnostics
    assert told.code == "dataset-invalid"
    assert told.message.startswith(f"{table}, row {row + 1}, column `{column}`: ")
    assert what in told.message


@pytest.mark.parametrize(
    "values", [{"image_width": 0}, {"intrinsics": [0.0, 1.0, 1.0, 1.0]}, {"camera_pose": [0.0] * 7}]
)
def test_a_camera_that_is_none_is_named(tables, values):
    rows = tables["sensors"].to_pylist()
    rows[2].update(CAMERA)
    check(tables, sensors=rows)
    rows[2].update(values)
    with pytest.raises(DataError, match=r"sensors, row 3: the (image|intrinsics|rotation)"):
        check(tables, sensors=rows)
