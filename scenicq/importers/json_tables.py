"""Large JSON files that hold one list of objects, read one object at a time with its line number."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scenicq.errors import DataError, Diagnostic

__all__ = ["read_list"]

_CHUNK = 1 << 20
_LONGEST = 1 << 23
_GAP = re.compile(r"[\s,]*")


def read_list(path: Path) -> Iterator[tuple[Any, int]]:
    """The elements of a JSON list, each with the number of the line where it begins.

    Memory is that of a chunk of the file and of one element.

    Raises:
        DataError: `file-missing`, or `file-invalid` with file and line.
    """
    try:
        with path.open(encoding="utf-8") as file:
            buffer = file.read(_CHUNK).lstrip("\ufeff")
            start = len(buffer) - len(buffer.lstrip())
            line = 1 + buffer.count("\n", 0, start)
            if buffer[start : start + 1] != "[":
                raise _invalid(path, line, "does not begin with a list")
            decode = json.JSONDecoder().raw_decode
            position = start + 1
            while True:
                gap = _GAP.match(buffer, position)
                end = gap.end() if gap else position
                line += buffer.count("\n", position, end)
                position = end
                if buffer.startswith("]", position):
                    return
                try:
                    element, end = decode(buffer, position)
                except RecursionError as error:
                    raise _invalid(path, line, "is nested too deeply") from error
                except ValueError as error:
                    # Either the file is unsound here or the chunk ends inside of the element.
                    more = file.read(_CHUNK)
                    if not more or len(buffer) - position > _LONGEST:
                        raise _invalid(path, line, "is cut off or is not JSON here") from error
                    buffer, position = buffer[position:] + more, 0
                    continue
                yield element, line
                line += buffer.count("\n", position, end)
                position = end
    except UnicodeDecodeError as error:
        raise DataError(Diagnostic("file-invalid", f"{path} is not UTF-8 text")) from error
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from error


def _invalid(path: Path, line: int, what: str) -> DataError:
    return DataError(Diagnostic("file-invalid", f"{path}:{line} {what}"))
