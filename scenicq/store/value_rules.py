"""Rules for the values of each column: one table for writers, and for readers of a stranger's dataset.

`validation` holds the columns of Parquet files to it, an ingest what it has read, before anything is written.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.store.columns import MemberColumns, RecordingColumns
from scenicq.store.wkb import FARTHEST_M

__all__ = [
    "LONGEST_NAME",
    "TEXT_KEYS",
    "Problems",
    "find_problems",
    "is_json",
    "json_object",
    "longest_text",
    "plain_object_problem",
    "unsound_reals",
]

LONGEST_NAME, LONGEST_JSON = 1 << 12, 1 << 20
"""Characters of a text."""
_HALF_TURN = math.pi + 1e-6
_LONGEST_NUMBER = 300
"""Digits: 10**308 is the last power that a float can hold."""
_PLACES = frozenset({"x", "y", "z", "ego_x", "ego_y", "ego_z"})
_TURNS = frozenset(
    "heading ego_heading relative_heading road_directions ego_road_directions pitch roll ego_pitch ego_roll".split()
)
_NOT_NEGATIVE = frozenset(
    "distance turn section_turn begins ego_distance width length height ego_width ego_length ego_height"
    " ego_along_less ego_along_more ego_beside_less ego_beside_more".split(),
)
TEXT_KEYS = frozenset({"frame", "recording", "map"})
"""Names that must not be empty."""
_REALS = ("x", "y", "z", "heading", "pitch", "roll", "width", "length", "height", "vx", "vy")
_TEXTS = ("id", "track", "source_class", "attributes")


def is_json(column: str) -> bool:
    """Whether a column's texts are JSON."""
    return column.endswith(("attributes", "params", "properties"))


def longest_text(column: str) -> int:
    """Characters that a text of a column may have."""
    return LONGEST_JSON if is_json(column) else LONGEST_NAME


def unsound_reals(column: str, values: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.bool_], str]]:
    """Find the values of a column that break a rule.

    Args:
        column: Its name.
        values: nan where nothing is observed, shape (n,).

    Yields:
        For each rule, True where a value breaks it, shape (n,), and the fact.
    """
    yield np.isinf(values), "is not finite"
    if column in _PLACES:
        yield np.abs(values) > FARTHEST_M, "is no place on a map"
    if column in _TURNS:
        yield np.abs(values) > _HALF_TURN, "is not an angle between -pi and pi"
    if column in _NOT_NEGATIVE:
        yield values < 0.0, "is negative"


def plain_object_problem(text: str) -> str | None:
    """Say why a text is no JSON object of plain values; None where it is one."""
    values = json_object(text)
    if values is None:
        return "is no JSON object of finite numbers"
    plain = all(isinstance(value, str | int | float | bool) for value in values.values())
    return None if plain else "has a value that is neither text nor number nor truth value"


def json_object(text: str) -> dict[str, Any] | None:
    """The object that a JSON text is, with numbers that floats can hold; None where it is none."""
    try:
        value = json.loads(text, parse_constant=_refuse_constant, parse_float=_finite, parse_int=_whole)
    except (ValueError, RecursionError):
        return None
    return cast("dict[str, Any]", value) if isinstance(value, dict) else None


def _refuse_constant(text: str) -> NoReturn:
    raise ValueError(text)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def _whole(text: str) -> int:
    if len(text) > _LONGEST_NUMBER:
        raise ValueError(text)
    return int(text)


@dataclass(slots=True)
class Problems:
    """What is unsound in a recording.

    Attributes:
        labels, objects, sensors: The fact for each row that is unsound, of those with several the first one.
    """

    labels: dict[int, str] = field(default_factory=dict[int, str])
    objects: dict[int, str] = field(default_factory=dict[int, str])
    sensors: dict[int, str] = field(default_factory=dict[int, str])

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self.labels or self.objects or self.sensors)


def find_problems(recording: RecordingColumns) -> Problems:
    """Find what is unsound in a recording; an unsound ego makes its label unsound."""
    found = Problems()
    for name in TEXT_KEYS & {"recording", "map"}:
        text = recording.name if name == "recording" else recording.map
        if problem := _text_problem(name, text):
            found.labels.update(dict.fromkeys(range(len(recording.frames)), f"`{name}` {problem}"))
    _add_texts(found.labels, "frame", recording.frames)
    _add_texts(found.labels, "params", recording.params)
    _add_members(found.labels, recording.egos, "ego_")
    _add_members(found.objects, recording.objects, "")
    _add_texts(found.sensors, "channel", recording.channels)
    _add_texts(found.sensors, "path", recording.paths)
    return found


def _add_members(found: dict[int, str], members: MemberColumns, prefix: str) -> None:
    for name in _REALS:
        values = getattr(members, name)
        for wrong, what in () if values is None else unsound_reals(prefix + name, values):
            for row in np.flatnonzero(wrong).tolist():
                found.setdefault(row, f"`{name}` {what}")
    for name in _TEXTS:
        _add_texts(found, name, getattr(members, name))


def _add_texts(found: dict[int, str], column: str, texts: Sequence[str | None]) -> None:
    most = _LONGEST_NUMBER if is_json(column) else LONGEST_NAME
    # by far most are short; a JSON text of ours that is short has no number that is too long, either
    if column not in TEXT_KEYS and max(map(len, filter(None, texts)), default=0) <= most:
        return
    for row, text in enumerate(texts):
        if text is not None and (problem := _text_problem(column, text)):
            found.setdefault(row, f"`{column}` {problem}")


def _text_problem(column: str, text: str) -> str | None:
    if len(text) > longest_text(column):
        return f"is longer than {longest_text(column)} characters"
    if column in TEXT_KEYS and not text:
        return "is empty"
    return plain_object_problem(text) if is_json(column) and len(text) > _LONGEST_NUMBER else None
