"""In-memory connections of DuckDB that print nothing."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

if TYPE_CHECKING:
    import duckdb

__all__ = ["connect_in_memory", "fetch_columns"]


def fetch_columns(found: duckdb.DuckDBPyConnection) -> dict[str, NDArray[Any]]:
    """The columns of what SQL has found."""
    return found.fetchnumpy()


def connect_in_memory(config: Mapping[str, bool | int | str] | None = None) -> duckdb.DuckDBPyConnection:
    """Connect to a DuckDB in memory, without a file.

    Args:
        config: Settings that DuckDB takes at the start.
    """
    import duckdb  # noqa: PLC0415 - takes long to load

    connection = duckdb.connect(":memory:", config={**(config or {})})
    # where Python is interactive, DuckDB draws how far a long query has come, between whatever the program writes;
    # in a notebook without widgets it does not, and cannot be asked not to
    with contextlib.suppress(duckdb.InvalidInputException):
        connection.execute("SET enable_progress_bar = false")
    return connection
