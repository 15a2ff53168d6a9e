"""Texts in cells of CSV: no terminal obeys one, a spreadsheet need take none for a formula, each can be read back.

A text that would be either begins with `'` in its cell, with backslashes and what a terminal would obey escaped. What
only a spreadsheet misreads stays as it is where programs read the cells, which join frames by their names.
"""

from __future__ import annotations

import re
from typing import Any

from scenicq.errors import CONTROL, printable

__all__ = ["SPREADSHEET_MARK", "quote_cell", "unquote_cell"]

SPREADSHEET_MARK = "\ufeff"
"""Begins a file for spreadsheets, which take one without it for a text of the machine's own encoding."""
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What makes a spreadsheet take a cell for a formula."""
_ESCAPED = re.compile(r"\\(?:\\|t|r|x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8})")


def quote_cell(value: Any, *, spreadsheet: bool) -> Any:
    """What stands in a cell for a value; for what is no text, the value.

    Args:
        value: The value.
        spreadsheet: Whether formulas are quoted, too.
    """
    if not isinstance(value, str):
        return value
    if not value.startswith((*_FORMULA, "'") if spreadsheet else "'") and not CONTROL.search(value):
        return value
    return "'" + printable(value.replace("\\", "\\\\"))


def unquote_cell(cell: str) -> str:
    """The text of a cell."""
    if not cell.startswith("'"):
        return cell
    return _ESCAPED.sub(_unescaped, cell[1:])


def _unescaped(found: re.Match[str]) -> str:
    return found[0].encode().decode("unicode_escape")
