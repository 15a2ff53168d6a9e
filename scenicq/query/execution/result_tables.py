"""Results as Arrow tables with typed columns: the label object of each role is a field of its own.

correspondence   struct   one text a role, null where nobody plays it
witness          map      place of a random variable -> its numbers: one, or the two of a point
cause            struct   what, detail, place, reason; null in a match
sensors          map      channel -> path

For intervals, `frames` is a struct of the first and the last frame and how many there are.
"""

# pyarrow has no type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportUnknownParameterType=false

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import pyarrow as pa

from scenicq.query.execution.result_origin import METADATA, ORIGIN

__all__ = ["DENSITY_COLUMNS", "read_row", "result_schema", "result_table", "roles_of"]

_CAUSE = ("what", "detail", "place", "reason")


def roles_of(records: Iterable[Mapping[str, Any]]) -> tuple[str, ...]:
    """The roles that records name, in the order in which they come up: the ego, which every scenario has, first."""
    return tuple(dict.fromkeys(("ego", *(role for each in records for role in each["correspondence"]))))


DENSITY_COLUMNS = ("log_density", "log_density_error", "log_weight", "no_density")
"""Columns of results that are ranked: numbers, and why there is none."""


def result_schema(
    roles: Sequence[str], *, origin: str = "", ranked: bool = False, over_time: bool = False
) -> pa.Schema:
    """The columns of results.

    Args:
        roles: Names of the scenario's objects, in its order.
        origin: The dataset that they come from, as `name_origin` says it; "" where it is not known.
        ranked: Whether results have a density.
        over_time: Whether the results are intervals.
    """
    text = pa.string()
    kinds = (pa.float64(), pa.float64(), pa.float64(), text)
    more = list(zip(DENSITY_COLUMNS, kinds, strict=True)) if ranked else []
    time, frame, frames = (
        pa.int64(),
        ("frame", text),
        pa.struct([("first", text), ("last", text), ("count", pa.int64())]),
    )
    of_interval = [("recording", text), ("start_us", time), ("end_us", time), ("frames", frames)]
    return pa.schema(
        [
            *(of_interval if over_time else [frame, ("recording", text), ("timestamp_us", time)]),
            ("verdict", text),
            ("correspondence", pa.struct([(role, text) for role in roles])),
            ("witness", pa.map_(text, pa.list_(pa.float64()))),
            ("cause", pa.struct([(name, text) for name in _CAUSE])),
            ("open_ended", pa.bool_()) if over_time else ("sensors", pa.map_(text, text)),
            *more,
        ],
        metadata={METADATA: origin.encode()} if origin else None,
    )


def result_table(records: Iterable[Mapping[str, Any]], schema: pa.Schema) -> pa.Table:
    """Records as a table.

    Args:
        records: As `scenicq.query.execution.results.record` gives them.
        schema: Of `result_schema`, with every role that the records name.
    """
    return pa.Table.from_pylist([_row(each) for each in records], schema=schema)


def _row(record: Mapping[str, Any]) -> dict[str, Any]:
    witness = cast("Mapping[str, float | Sequence[float]]", record["witness"])
    cells = {name: value for name, value in record.items() if name != ORIGIN}
    return {
        **cells,
        "witness": [(place, [value] if isinstance(value, int | float) else value) for place, value in witness.items()],
        "sensors": list(record.get("sensors", {}).items()),
    }


def read_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """The record that a row was made of.

    Args:
        row: As pyarrow's `to_pylist` gives it, of any of the columns.
    """
    found = dict(row)
    for name in ("correspondence", "cause"):
        if isinstance(cells := found.get(name), dict):
            found[name] = {key: value for key, value in cast("dict[str, Any]", cells).items() if value is not None}
    for name in ("witness", "sensors"):
        if isinstance(pairs := found.get(name), list):
            found[name] = dict(cast("list[tuple[str, Any]]", pairs))
    if isinstance(witness := found.get("witness"), dict):
        numbers = cast("dict[str, list[float]]", witness)
        found["witness"] = {place: value[0] if len(value) == 1 else value for place, value in numbers.items()}
    if found.get("cause", ...) is None:
        del found["cause"]
    return found
