"""Writing values into SQL."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["sql_list", "sql_text"]


def sql_text(value: str) -> str:
    """A string literal that reads back as the same string."""
    return "'" + value.replace("'", "''") + "'"


def sql_list(values: Iterable[str]) -> str:
    """A list of string literals."""
    return "[" + ", ".join(map(sql_text, values)) + "]"
