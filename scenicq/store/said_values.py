"""What labels say beside the columns: the attributes of objects and the parameters of labels, with their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from scenicq.store.dataset import Dataset

if TYPE_CHECKING:
    import duckdb

__all__ = ["SaidValues", "said_attributes", "said_params", "said_types"]


@dataclass(slots=True)
class SaidValues:
    """What is said under one name.

    Attributes:
        count: How often something is.
        numbers: The least and the greatest number; None where none is.
        others: How often each text and truth value is.
    """

    count: int = 0
    numbers: tuple[float, float] | None = None
    others: dict[str, int] = field(default_factory=dict[str, int])


_ATTRIBUTES = "(SELECT attributes AS said FROM objects UNION ALL SELECT ego_attributes FROM labels)"
_TYPES = {"VARCHAR": str, "BOOLEAN": bool}
"""What JSON has beside numbers."""


def said_types(dataset: Dataset) -> Mapping[str, frozenset[type]]:
    """The types of the values of each attribute of egos and objects."""
    found: dict[str, set[type]] = {}
    with dataset.blamed(), dataset.connect() as connection:
        rows = connection.execute(
            "SELECT DISTINCT name, json_type(said, '/' || replace(replace(name, '~', '~0'), '/', '~1')) FROM ("
            f"SELECT unnest(json_keys(said)) AS name, said FROM (SELECT DISTINCT said FROM {_ATTRIBUTES} "
            "WHERE said IS NOT NULL))"
        ).fetchall()
    for name, kind in rows:
        found.setdefault(name, set()).add(_TYPES.get(kind, float))
    return {name: frozenset(types) for name, types in found.items()}


def said_attributes(dataset: Dataset) -> Mapping[str, SaidValues]:
    """The attributes of egos and objects by name, those that most have first."""
    with dataset.blamed(), dataset.connect() as connection:
        return _said(connection, _ATTRIBUTES)


def said_params(dataset: Dataset) -> Mapping[str, SaidValues]:
    """The parameters of labels by name, those that most have first."""
    with dataset.blamed(), dataset.connect() as connection:
        return _said(connection, "(SELECT params AS said FROM labels)")


def _said(connection: duckdb.DuckDBPyConnection, source: str) -> Mapping[str, SaidValues]:
    # a name may have any characters: as a JSON pointer each is one step
    rows = connection.execute(
        "SELECT name, CASE WHEN number THEN NULL ELSE value ->> '$' END AS text, count(*), "
        "min(CASE WHEN number THEN value::DOUBLE END), max(CASE WHEN number THEN value::DOUBLE END) "
        "FROM (SELECT name, value, json_type(value) NOT IN ('VARCHAR', 'BOOLEAN') AS number FROM ("
        "SELECT name, json_extract(said, '/' || replace(replace(name, '~', '~0'), '/', '~1')) AS value FROM ("
        f"SELECT unnest(json_keys(said)) AS name, said FROM {source} WHERE said IS NOT NULL))) GROUP BY ALL"
    ).fetchall()
    found: dict[str, SaidValues] = {}
    for name, text, count, least, most in rows:
        mine = found.setdefault(name, SaidValues())
        mine.count += count
        if text is None:
            mine.numbers = least, most
        else:
            mine.others[text] = count
    for each in found.values():
        each.others = dict(sorted(each.others.items(), key=lambda item: (-item[1], item[0])))
    return dict(sorted(found.items(), key=lambda item: (-item[1].count, item[0])))
