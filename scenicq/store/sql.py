"""Writing values into SQL."""

from __future__ import annotations

__all__ = ["sql_text"]


def sql_text(value: str) -> str:
    """A string literal that reads back as the same string."""
    return "'" + value.replace("'", "''") + "'"
