"""How SQL reads the files of a dataset, in the one place that makes scans.

To DuckDB a path is language: it takes `NAME=VALUE` in the name of any folder for a column, and `*`, `?` and `[` for
patterns. Folders have the names that users choose, so a scan reads just its files, and just the columns of the schema.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from scenicq.store.place import StoreFile
from scenicq.store.schema import SCHEMAS
from scenicq.store.sql import sql_list

__all__ = ["allowed_paths", "scan"]

_PATTERN = re.compile(r"[*?\[]")
"""What makes DuckDB look for files that are named alike."""


def scan(table: str, files: Iterable[StoreFile], *, numbered: bool = False) -> str:
    """What SQL selects from, in parentheses: the rows of some files of a table, with the columns of its schema.

    Args:
        table: Name of the table.
        files: Its files, one at least.
        numbered: Whether there is also `file_row_number`, the number of each row in its file.
    """
    columns = [f'"{name}"' for name in SCHEMAS[table].names] + ["file_row_number"] * numbered
    options = "hive_partitioning = false, union_by_name = false"
    options += ", file_row_number = true" if numbered else ""
    return f"(SELECT {', '.join(columns)} FROM read_parquet({sql_list(map(_pattern, files))}, {options}))"


def allowed_paths(files: Iterable[StoreFile]) -> list[str]:
    """What a connection must be allowed to read, so that `scan` reads some files."""
    return list(dict.fromkeys(text for file in files for text in (str(file), _pattern(file))))


def _pattern(file: StoreFile) -> str:
    """The pattern that the path of a file alone fits; names of files elsewhere hold nothing to be escaped."""
    return _PATTERN.sub(lambda found: f"[{found[0]}]", str(file)) if isinstance(file, Path) else str(file)
