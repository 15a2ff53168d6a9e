"""Results as Arrow tables, whose columns are the fields of records: each role is a field of its own.

correspondence   struct   one text a role, null where nobody plays it
witness          map      place of a random variable -> its numbers: one, or the two of a point
cause            struct   what, detail, place, reason; null in a match
sensors          map      channel -> path
recorded         struct   what the program records, one field a value; see `recorded_columns`
unrecorded       map      name of a recorded value -> why it is null -> how often
frames           struct   of an interval: first, last, count
timeline         list     what roles do from when to when: kind, of, mode (what, place), start_us, end_us, frames

The dataset and the summary stand in the metadata.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import msgspec
import pyarrow as pa
from msgspec import inspect

from scenicq.query.execution.recorded_columns import RecordedColumn, recorded_struct, struct_of_row
from scenicq.query.execution.records import (
    DENSITY,
    RECORDED,
    FrameRecord,
    IntervalRecord,
    Record,
    json_text,
    record_of,
)
from scenicq.query.execution.result_summary import ResultSummary

__all__ = [
    "METADATA",
    "read_row",
    "read_summary",
    "result_schema",
    "result_table",
    "roles_of",
    "stated_summary",
    "summary_metadata",
]

METADATA = b"scenicq.dataset"
"""Key of the metadata, under which the dataset stands."""
_SUMMARY = b"scenicq.summary"
"""Key of that under which the summary stands, as JSON."""
_PLAIN: dict[type[inspect.Type], Any] = {
    inspect.StrType: pa.string,
    inspect.LiteralType: pa.string,
    inspect.IntType: pa.int64,
    inspect.FloatType: pa.float64,
    inspect.BoolType: pa.bool_,
}


def roles_of(records: Iterable[Record]) -> tuple[str, ...]:
    """The roles that records name, in the order in which they come up: the ego, which every scenario has, first."""
    return tuple(dict.fromkeys(("ego", *(role for each in records for role in each.correspondence))))


def result_schema(
    roles: Sequence[str], *, origin: str = "", ranked: bool = False, over_time: bool = False, every: bool = False,
    recorded: Sequence[RecordedColumn] = (), timelines: bool = False,
) -> pa.Schema:  # fmt: skip
    """The columns of results.

    Args:
        roles: Names of the scenario's objects, in its order.
        origin: The dataset that they come from, as `name_origin` says it; "" where it is not known.
        ranked: Whether results have a density.
        over_time: Whether the results are intervals.
        every: Whether each correspondence by which a frame matches is a result.
        recorded: What the program records.
        timelines: Whether results say what roles do from when to when.
    """
    left_out = {"dataset", "summary", *(() if ranked else DENSITY), *(() if every else ("all_matches",)),
                *(() if timelines else ("timeline",))}  # fmt: skip
    left_out |= set(() if recorded else RECORDED)
    own = {"correspondence": pa.struct([(role, pa.string()) for role in roles]), "recorded": recorded_struct(recorded)}
    columns = [
        (each.name, own[each.name] if each.name in own else _column(each.type))
        for each in _struct(IntervalRecord if over_time else FrameRecord).fields
        if each.name not in left_out
    ]
    return pa.schema(columns, metadata={METADATA: origin.encode()} if origin else None)


def _struct(kind: type[Record]) -> inspect.StructType:
    return cast(inspect.StructType, inspect.type_info(kind))


def _column(kind: inspect.Type) -> pa.DataType:
    """The column of a field: what may be absent is null, a number or several of them are a list."""
    match kind:
        case inspect.StructType():
            return pa.struct([(each.name, _column(each.type)) for each in kind.fields])
        case inspect.ListType():
            return pa.list_(_column(kind.item_type))
        case inspect.DictType():
            return pa.map_(pa.string(), _column(kind.value_type))
        case inspect.UnionType():
            if any(isinstance(each, inspect.TupleType) for each in kind.types):
                return pa.list_(pa.float64())
            (known,) = (each for each in kind.types if not isinstance(each, inspect.NoneType))
            return _column(known)
        case _:
            return _PLAIN[type(kind)]()


def result_table(records: Iterable[Record], schema: pa.Schema) -> pa.Table:
    """Records as a table.

    Args:
        records: The records.
        schema: As `result_schema` makes it, with every role that the records name.
    """
    kind = schema.field("recorded").type if "recorded" in schema.names else None
    return pa.Table.from_pylist([_row(each, kind) for each in records], schema=schema)


def summary_metadata(summary: ResultSummary) -> dict[bytes, bytes]:
    """The metadata that says a summary."""
    return {_SUMMARY: json_text(summary).encode()}


def stated_summary(metadata: Mapping[bytes, bytes] | None) -> bytes:
    """What metadata say of all results, as a line of JSON that carries it and is no result; b"" for nothing."""
    text = (metadata or {}).get(_SUMMARY)
    return b"" if text is None else b'{"summary": %b}' % text


def read_summary(metadata: Mapping[bytes, bytes] | None) -> ResultSummary | None:
    """The summary that metadata say, if they do.

    Raises:
        msgspec.DecodeError: It is none.
    """
    text = (metadata or {}).get(_SUMMARY)
    return None if text is None else msgspec.json.decode(text, type=ResultSummary)


def _row(record: Record, recorded: pa.DataType | None) -> dict[str, Any]:
    cells: dict[str, Any] = msgspec.to_builtins(record)
    if recorded is not None and "recorded" in cells:
        cells["recorded"] = struct_of_row(cells["recorded"], recorded)
    if "unrecorded" in cells:
        cells["unrecorded"] = [(name, [*reasons.items()]) for name, reasons in cells["unrecorded"].items()]
    if "lanes" in cells:
        cells["lanes"] = [*cells["lanes"].items()]
    listed = ((place, [value] if isinstance(value, int | float) else value) for place, value in record.witness.items())
    return cells | {"witness": [*listed], "sensors": [*cells.get("sensors", {}).items()]}


def read_row(row: Mapping[str, Any], origin: str = "") -> Record:
    """The record that a row was made of.

    Args:
        row: As pyarrow's `to_pylist` gives it, of any of the columns.
        origin: The dataset.

    Raises:
        msgspec.ValidationError: It is no record's.
    """
    found = {name: value for name, value in row.items() if value is not None or name in DENSITY}
    for name in ("correspondence", "cause"):
        if isinstance(cells := found.get(name), dict):
            found[name] = {key: value for key, value in cast("dict[str, Any]", cells).items() if value is not None}
    for name in ("witness", "lanes", "sensors", "unrecorded"):
        if isinstance(pairs := found.get(name), list):
            found[name] = dict(cast("list[tuple[str, Any]]", pairs))
    if isinstance(reasons := found.get("unrecorded"), dict):
        found["unrecorded"] = {name: dict(told) for name, told in cast("dict[str, Any]", reasons).items()}
    if isinstance(witness := found.get("witness"), dict):
        numbers = cast("dict[str, list[float]]", witness)
        found["witness"] = {place: value[0] if len(value) == 1 else value for place, value in numbers.items()}
    return cast(Record, record_of(found | ({"dataset": origin} if origin else {})))
