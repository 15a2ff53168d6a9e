"""Reading fields of records that nobody has checked: every value is of the right type and finite, or `InvalidError`."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any, cast

from scenicq.store.value_rules import LONGEST_NAME

__all__ = [
    "LONGEST_TEXT",
    "NO_MAP",
    "InvalidError",
    "check_characters",
    "integer",
    "items",
    "number",
    "optional_items",
    "optional_number",
    "optional_record",
    "optional_text",
    "parse_json",
    "positive",
    "record",
    "replace_non_finite",
    "text",
    "vector",
    "whole",
]

Record = Mapping[str, Any]
NO_MAP = "none"
"""The map of labels that lie on none."""
LONGEST_TEXT = LONGEST_NAME
"""Characters of a name."""
_LARGEST = 2**63 - 1
_TEXT_OR_NON_FINITE = re.compile(rb'("(?:[^"\\]|\\.)*")|NaN|-?Infinity')


class InvalidError(ValueError):
    """A field is not what it must be; the message is a fact that lacks only the place."""


def parse_json(content: bytes) -> object:
    """The value of a JSON text.

    Raises:
        InvalidError: It is none, is nested too deeply, or has half of a character, which no file can hold.
    """
    try:
        value: object = json.loads(content)
        if b"\\u" in content:
            check_characters(value)
        return value
    except RecursionError as error:
        raise InvalidError("not JSON: nested too deeply") from error
    except ValueError as error:
        raise InvalidError(f"not JSON: {error}") from error


def replace_non_finite(content: bytes, by: bytes) -> bytes:
    """A text with something else for NaN and infinities, which are no JSON but often written."""
    return _TEXT_OR_NON_FINITE.sub(lambda found: found[1] or by, content)


def check_characters(value: object) -> None:
    """Refuse a value with half of a surrogate pair in a text; only an escape can make one.

    Raises:
        InvalidError: There is one.
    """
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        raise InvalidError("it has half of a character (a lone surrogate)") from error


def record(value: object, what: str) -> Record:
    """A JSON object."""
    if not isinstance(value, dict):
        raise InvalidError(f"{what} is not an object but {_kind(value)}")
    return cast(Record, value)


def items(fields: Record, key: str) -> list[Any]:
    """A list."""
    value = _present(fields, key)
    if not isinstance(value, list):
        raise InvalidError(f"`{key}` is not a list but {_kind(value)}")
    return cast(list[Any], value)


def optional_record(fields: Record, key: str) -> Record:
    """A JSON object; an empty one where the field is absent or null."""
    return record(fields[key], f"`{key}`") if fields.get(key) is not None else {}


def optional_items(fields: Record, key: str) -> list[Any]:
    """A list; an empty one where the field is absent or null."""
    return items(fields, key) if fields.get(key) is not None else []


def text(fields: Record, key: str) -> str:
    """A text that is not empty."""
    value = _present(fields, key)
    if not isinstance(value, str):
        raise InvalidError(f"`{key}` is not a text but {_kind(value)}")
    if not value:
        raise InvalidError(f"`{key}` is empty")
    if len(value) > LONGEST_TEXT:
        raise InvalidError(f"`{key}` is longer than {LONGEST_TEXT} characters")
    return value


def optional_text(fields: Record, key: str) -> str | None:
    """A text; None where the field is absent, null or empty."""
    return text(fields, key) if fields.get(key) not in (None, "") else None


def integer(fields: Record, key: str) -> int:
    """A whole number that 64 bits hold; 3.0 is one, too."""
    value = _present(fields, key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidError(f"`{key}` is not a whole number but {_kind(value)}")
    return whole(value, key)


def whole(value: float, key: str) -> int:
    """The whole number that a number is, if 64 bits hold it.

    Raises:
        InvalidError: It is none.
    """
    if isinstance(value, float) and not value.is_integer():
        raise InvalidError(f"`{key}` is {value!r}, which is not a whole number: round it")
    if abs(value) > _LARGEST:
        raise InvalidError(f"`{key}` is out of range")
    return int(value)


def number(fields: Record, key: str) -> float:
    """A finite number."""
    return _finite(_present(fields, key), key)


def optional_number(fields: Record, key: str) -> float | None:
    """A finite number; None where the field is absent or null."""
    value = fields.get(key)
    return None if value is None else _finite(value, key)


def positive(fields: Record, key: str) -> float | None:
    """A finite number above 0; None where the field is absent or null."""
    value = optional_number(fields, key)
    if value is not None and value <= 0:
        raise InvalidError(f"`{key}` is not positive")
    return value


def vector(fields: Record, key: str, size: int) -> tuple[float, ...]:
    """A list of `size` finite numbers."""
    value = items(fields, key)
    # By far the most frequent case, decided without the rest.
    if len(value) == size and set(map(type, value)) == {float} and math.isfinite(sum(value)):
        return tuple(value)
    if len(value) != size:
        raise InvalidError(f"`{key}` has {len(value)} numbers, not {size}")
    return tuple([_finite(element, key) for element in value])


def _present(fields: Record, key: str) -> object:
    value = fields.get(key)
    if value is None:
        raise InvalidError(f"`{key}` is missing")
    return value


def _finite(value: object, key: str) -> float:
    # By far the most frequent case, decided without the rest.
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidError(f"`{key}` is not a number but {_kind(value)}")
    try:
        finite = float(value)
    except OverflowError:
        finite = math.inf
    if not math.isfinite(finite):
        raise InvalidError(f"`{key}` is not finite")
    return finite


def _kind(value: object) -> str:
    names = ((bool, "a boolean"), (int | float, "a number"), (str, "a text"), (list, "a list"), (dict, "an object"))
    return next((name for kind, name in names if isinstance(value, kind)), "null")
