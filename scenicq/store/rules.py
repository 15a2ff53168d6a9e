"""What the tables of a part say of each other: one table of rules in SQL, each of which finds the rows that break it.

Readers take rows by number, the prefilter joins them by name; both must find the same. In the rules each table has the
column `row`, the numbers of its rows from 0; `objects` and `sensors` have `label`, the row of their label.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import closing
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.store.camera_rows import CAMERA_COLUMNS, camera_problem, cameras_of
from scenicq.store.in_memory import connect_in_memory
from scenicq.store.schema import MEMBERSHIP_RADIUS_M, ArrowTable
from scenicq.store.validation import invalid

__all__ = ["PART_COLUMNS", "RULES", "RowRule", "check_counts", "check_frame_index", "check_part"]

PART_COLUMNS = {
    "labels": {"frame", "recording", "timestamp_us", "map", "ego_x", "ego_y", "ego_heading", "object_count",
               "first_object", "sensor_count", "first_sensor", "class_counts"},
    "objects": {"frame", "recording", "timestamp_us", "ordinal", "id", "class", "x", "y", "heading", "ego_right",
                "ego_ahead", "ego_distance", "relative_heading"},
    "memberships": {"frame", "object", "distance"},
    "sensors": {"frame", "channel", *CAMERA_COLUMNS},
}  # fmt: skip
"""The columns of each table by which the tables of a part are compared."""

_CLOSE = 1e-6
"""How far computed columns may be from what is computed again: metres, radians."""


ROWS = {
    "labels": """
        SELECT l.*, lag((recording, timestamp_us, frame)) OVER rows AS key_above, lag(recording) OVER rows AS above,
            lag(map) OVER rows AS map_above, coalesce(found, []) AS classes
        FROM labels l LEFT JOIN (
            SELECT label, list_sort(list({'key': class, 'value': n})) AS found
            FROM (SELECT label, class, count(*) AS n FROM objects GROUP BY ALL) GROUP BY label
        ) o ON l.row = o.label WINDOW rows AS (ORDER BY row)""",
    "objects": """
        SELECT t.*, l.frame AS own_frame, l.recording AS own_recording, l.timestamp_us AS own_time, first_object,
            ego_heading, x - ego_x AS dx, y - ego_y AS dy, t.heading - ego_heading AS turn,
            row_number() OVER (PARTITION BY label, id ORDER BY t.row) AS nth
        FROM objects t JOIN labels l ON t.label = l.row""",
    "sensors": """
        SELECT t.*, l.frame AS own_frame, row_number() OVER (PARTITION BY label, channel ORDER BY t.row) AS nth
        FROM sensors t JOIN labels l ON t.label = l.row""",
    "memberships": """
        SELECT m.*, frame IN (SELECT frame FROM labels) AS has_frame, (frame, object) IN (
            SELECT (frame, id) FROM objects UNION ALL SELECT (frame, 'ego') FROM labels) AS has_object
        FROM memberships m""",
}
"""The rows of each table with what rules compare them to; a rule is a condition on these."""


class RowRule(NamedTuple):
    """A rule: a condition that no row of a table may meet.

    Attributes:
        table, column: Where a row that breaks it is blamed.
        what: The fact.
        bad: The condition of SQL that such a row meets, over `ROWS`.
    """

    table: str
    column: str
    what: str
    bad: str


def _position(column: str, expected: str) -> RowRule:
    off = f"abs({column} - ({expected})) > {_CLOSE} * greatest(1, abs({expected}))"
    return RowRule(
        "objects", column, "is not what the positions say", f"{off} OR ({column} IS NULL) <> (({expected}) IS NULL)"
    )


def _camera(column: str, numbers: int) -> RowRule:
    what = f"has not the {numbers} numbers of a camera, or has numbers without one"
    return RowRule("sensors", column, what, f"len({column}) <> CASE WHEN image_width IS NULL THEN 0 ELSE {numbers} END")


_OTHER = "is not that of the label that the row belongs to"
_OFF = "relative_heading - turn"
RULES = (
    RowRule("labels", "frame", "comes before the row above, or twice", "key_above >= (recording, timestamp_us, frame)"),
    RowRule("labels", "map", "is no map of which the manifest knows", "map NOT IN (SELECT name FROM maps)"),
    RowRule("labels", "map", "changes within a recording", "above = recording AND map_above <> map"),
    RowRule("labels", "class_counts", "is not how many objects of each class the label has",
         "list_sort(map_entries(class_counts)) <> classes"),
    RowRule("objects", "frame", _OTHER, "frame <> own_frame"),
    RowRule("objects", "recording", _OTHER, "recording <> own_recording"),
    RowRule("objects", "timestamp_us", _OTHER, "timestamp_us <> own_time"),
    RowRule("objects", "ordinal", "is not the row's number within its label", "ordinal <> row - first_object"),
    RowRule("objects", "id", "is the name of the ego", "id = 'ego'"),
    RowRule("objects", "id", "occurs twice in a label", "nth > 1"),
    _position("ego_right", "dx * cos(ego_heading) + dy * sin(ego_heading)"),
    _position("ego_ahead", "dy * cos(ego_heading) - dx * sin(ego_heading)"),
    _position("ego_distance", "sqrt(dx * dx + dy * dy)"),
    RowRule("objects", "relative_heading", "is not what the headings say",
         f"abs(atan2(sin({_OFF}), cos({_OFF}))) > {_CLOSE} OR (relative_heading IS NULL) <> (turn IS NULL)"),
    RowRule("sensors", "frame", _OTHER, "frame <> own_frame"),
    RowRule("sensors", "channel", "occurs twice in a label", "nth > 1"),
    RowRule("sensors", "image_height", "is there without the width, or is not",
         "(image_height IS NULL) <> (image_width IS NULL)"),
    _camera("intrinsics", 4),
    _camera("camera_pose", 7),
    RowRule("memberships", "distance", f"is more than {MEMBERSHIP_RADIUS_M} m",
         f"distance > {MEMBERSHIP_RADIUS_M + _CLOSE}"),
    RowRule("memberships", "frame", "is no frame of this part", "NOT has_frame"),
    RowRule("memberships", "object", "is not in the frame", "NOT has_object"),
)  # fmt: skip
"""Every rule; the first that is broken is told."""


def check_part(tables: Mapping[str, ArrowTable], names: Mapping[str, str], maps: Collection[str]) -> None:
    """Check the tables of one part against each other.

    Args:
        tables: `labels`, `objects`, `memberships` and `sensors`, each sound by itself, with `PART_COLUMNS` at least.
        names: What their files are called.
        maps: Names of the maps that labels may refer to.

    Raises:
        DataError: dataset-invalid.
    """
    owners = check_counts(tables, names)
    with closing(connect_in_memory({"threads": 1})) as connection:
        for name, table in [*tables.items(), ("maps", pa.table({"name": pa.array(sorted(maps), pa.string())}))]:
            rows = table.select([each for each in table.column_names if each in PART_COLUMNS.get(name, ("name",))])
            rows = rows.append_column("row", pa.array(np.arange(len(table))))
            rows = rows.append_column("label", pa.array(owners[name])) if name in owners else rows
            # of a reader DuckDB makes a table of its own; to scan one of Arrow's it loads more than it saves
            connection.register("reader", rows.to_reader())
            connection.execute(f"CREATE TEMP TABLE {name} AS SELECT * FROM reader")
        for name, rows in ROWS.items():
            rules = [rule for rule in RULES if rule.table == name]
            first = ", ".join(f"min(row) FILTER (WHERE {rule.bad})" for rule in rules)
            found = connection.execute(f"SELECT {first} FROM ({rows})").fetchone() or ()
            for rule, row in zip(rules, found, strict=True):
                if row is not None:
                    invalid(names[name], rule.what, row, rule.column)
    for row, camera in enumerate(cameras_of(tables["sensors"])):
        if camera is not None and (problem := camera_problem(camera)) is not None:
            invalid(names["sensors"], problem, row)


def check_counts(tables: Mapping[str, ArrowTable], names: Mapping[str, str]) -> dict[str, NDArray[np.int64]]:
    """Check that labels claim the rows of `objects` and `sensors` that there are, one after the other.

    Args:
        tables: `labels`, `objects` and `sensors`, each sound by itself.
        names: What their files are called.

    Returns:
        The number of the label that each row of `objects` and of `sensors` belongs to.

    Raises:
        DataError: dataset-invalid.
    """
    labels, file = tables["labels"], names["labels"]
    owners: dict[str, NDArray[np.int64]] = {}
    for table, what in (("objects", "object"), ("sensors", "sensor")):
        counts = labels[f"{what}_count"].to_numpy().astype(np.int64)
        wrong = labels[f"first_{what}"].to_numpy() != np.cumsum(counts) - counts
        if wrong.any():
            invalid(file, "is not where the rows before it end", int(np.argmax(wrong)), f"first_{what}")
        if counts.sum() != len(tables[table]):
            invalid(names[table], f"has {len(tables[table])} rows, and labels claim {counts.sum()}")
        owners[table] = np.repeat(np.arange(len(labels)), counts)
    return owners


def check_frame_index(rows: ArrowTable, expected: ArrowTable, name: str) -> None:
    """Check the table of frames against the one that the labels have.

    Raises:
        DataError: dataset-invalid.
    """
    if not rows.select(expected.column_names).equals(expected):
        invalid(name, "does not say where the frames are")
