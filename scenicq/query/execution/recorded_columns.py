"""Recorded values as columns: `recorded.gap` in CSV, a field `gap` of the struct `recorded` in Arrow.

What is recorded over an interval has six columns: `recorded.gap.first`, `last`, `minimum`, `maximum`, `mean`, `values`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import msgspec

from scenicq.forest.nodes import Kind
from scenicq.forest.scenario import Scenario
from scenicq.query.execution.csv_cells import unquote_cell
from scenicq.query.execution.records import CellRecord, Record, SeriesRecord, json_text

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = [
    "ColumnKind",
    "RecordedColumn",
    "cells_of_row",
    "columns_of",
    "columns_of_records",
    "flat_table",
    "is_cell",
    "read_cells",
    "recorded_struct",
    "show_cell",
    "struct_of_row",
]

_PREFIX = "recorded."
_PARTS = SeriesRecord.__struct_fields__
ColumnKind = Literal["number", "truth", "vector", "text"]
_KINDS: dict[Kind, ColumnKind] = {"scalar": "number", "boolean": "truth", "vector": "vector"}


@dataclass(frozen=True, slots=True)
class RecordedColumn:
    """A recorded value in a table.

    Attributes:
        name: What it is called.
        kind: What its values are; a "text" may be JSON, too.
        series: Whether there is one at each sample of an interval.
    """

    name: str
    kind: ColumnKind
    series: bool

    @property
    def cells(self) -> tuple[str, ...]:
        """The names of its columns in CSV."""
        return tuple(f"{_PREFIX}{self.name}.{part}" for part in _PARTS) if self.series else (f"{_PREFIX}{self.name}",)


def columns_of(scenarios: Iterable[Scenario], *, over_time: bool) -> tuple[RecordedColumn, ...]:
    """The columns of what a program records.

    Args:
        scenarios: The program over each map.
        over_time: Whether results are intervals.
    """
    found: dict[str, RecordedColumn] = {}
    for each in (record for scenario in scenarios for record in scenario.records):
        made = RecordedColumn(each.name, _KINDS.get(each.kind, "text"), over_time and each.when == "always")
        known = found.setdefault(each.name, made)
        if known != made:
            found[each.name] = RecordedColumn(each.name, "text", made.series)
    return tuple(found.values())


def columns_of_records(records: Iterable[Record]) -> tuple[RecordedColumn, ...]:
    """The columns of what results carry, by the values that they have."""
    kinds: dict[str, tuple[set[ColumnKind], bool]] = {}
    for record in records:
        for name, value in (record.recorded or {}).items():
            series = isinstance(value, SeriesRecord)
            seen = {_kind(each) for each in (value.values if isinstance(value, SeriesRecord) else [value])} - {None}
            kinds.setdefault(name, (set(), series))[0].update(cast("set[ColumnKind]", seen))
    return tuple(RecordedColumn(name, _common(found), series) for name, (found, series) in kinds.items())


def _common(kinds: set[ColumnKind]) -> ColumnKind:
    """The kind of a column with values of some kinds; numbers where there is none."""
    if len(kinds) > 1:
        return "text"
    (one,) = kinds or {cast(ColumnKind, "number")}
    return one


def _kind(value: CellRecord) -> ColumnKind | None:
    match value:
        case None:
            return None
        case bool():
            return "truth"
        case str():
            return "text"
        case tuple():
            return "vector"
        case _:
            return "number"


def show_cell(value: CellRecord) -> str:
    """A recorded value for people."""
    match value:
        case None:
            return "-"
        case bool():
            return "yes" if value else "no"
        case str():
            return value
        case tuple():
            return f"({', '.join(f'{each:z.2f}' for each in value)})"
        case _:
            return f"{value:z.3g}"


# --- CSV


def cells_of_row(record: Record, columns: Sequence[RecordedColumn]) -> dict[str, str | None]:
    """The cells of a result, JSON each; None is empty."""
    told: Mapping[str, Any] = record.recorded or {}
    found: dict[str, str | None] = {}
    for each in columns:
        value = told.get(each.name)
        parts = [value] if not each.series else [getattr(value, part, None) for part in _PARTS]
        found.update((name, None if part is None else json_text(part))
                     for name, part in zip(each.cells, parts, strict=True))  # fmt: skip
    return found


def is_cell(name: str | None) -> bool:
    """Whether a column of CSV is one of a recorded value."""
    return name is not None and name.startswith(_PREFIX)


def read_cells(row: Mapping[str, str]) -> dict[str, Any]:
    """What cells of a row say of recorded values, as the field `recorded` has it; nothing where there are none.

    Raises:
        msgspec.DecodeError: A cell is no JSON.
    """
    cells = {name.removeprefix(_PREFIX): unquote_cell(text) for name, text in row.items() if is_cell(name)}
    found: dict[str, Any] = {}
    for name, text in cells.items():
        owner, _, part = name.rpartition(".")
        value = None if text == "" else msgspec.json.decode(text)
        if part in _PARTS and f"{owner}.values" in cells:
            found.setdefault(owner, {})[part] = value
        else:
            found[name] = value
    # of what does not match nothing is recorded
    missing = all(value is None or (isinstance(value, dict) and value["values"] is None) for value in found.values())
    return {} if missing and not row.get("unrecorded") else {"recorded": found}


# --- Arrow


def recorded_struct(columns: Sequence[RecordedColumn]) -> pa.DataType:
    """The type of the column `recorded`."""
    import pyarrow as pa  # noqa: PLC0415 - takes long to load

    types = {"number": pa.float64(), "truth": pa.bool_(), "vector": pa.list_(pa.float64()), "text": pa.string()}

    def of(each: RecordedColumn) -> pa.DataType:
        own = types[each.kind]
        if not each.series:
            return own
        parts = {"values": pa.list_(own), **dict.fromkeys(("minimum", "maximum", "mean"), pa.float64())}
        return pa.struct([(part, parts.get(part, own)) for part in _PARTS])

    return pa.struct([(each.name, of(each)) for each in columns])


def flat_table(table: pa.Table) -> pa.Table:
    """A table of results with a column for each recorded value, named as in CSV, in place of the struct."""
    if "recorded" not in table.column_names:
        return table
    place, own = table.column_names.index("recorded"), table.select(["recorded"])
    while any(str(each.type).startswith("struct") for each in own.schema):
        own = own.flatten()
    table = table.remove_column(place)
    for number, name in enumerate(own.column_names):
        table = table.add_column(place + number, name, own.column(name))
    return table


def struct_of_row(told: Mapping[str, Any], kind: pa.DataType) -> dict[str, Any]:
    """The struct of a row.

    Args:
        told: What is recorded, as plain values.
        kind: The type that `recorded_struct` gives.
    """
    found: dict[str, Any] = {}
    for each in kind:
        value = told.get(each.name)
        if isinstance(value, dict):
            parts, own = cast("dict[str, Any]", value), each.type.field("first").type
            ends = {part: _cell(parts[part], own) for part in ("first", "last")}
            found[each.name] = {**parts, **ends, "values": [_cell(item, own) for item in parts["values"]]}
        else:
            found[each.name] = _cell(value, each.type)
    return found


def _cell(value: Any, kind: pa.DataType) -> Any:
    """A value as a column has it: where that is of texts, JSON stands for what is none."""
    return json_text(value) if str(kind) == "string" and not isinstance(value, str | None) else value
