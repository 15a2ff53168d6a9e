"""Annotations of nuScenes by column: a block of rows at once where all are sound, else row by row."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize, normalize_array
from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.sound_columns import UNUSUAL, are, column, demand, vectors
from scenicq.store.columns import to_json

__all__ = ["Box", "BoxReader", "Boxes", "found", "joined", "of_rows", "pose"]

_COUNTS = ("num_lidar_pts", "num_radar_pts")
_LARGEST = 2**63 - 1

Box = tuple[str, int, int, tuple[float, ...], str | None]
"""One annotation: see `Boxes`."""


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Annotations, one element or row each.

    Attributes:
        tokens: Of the annotations.
        samples, tracks: Numbers of the sample and of the instance, shape (n,).
        values: x, y, heading, width, length, height in metres and radians, shape (n, 6).
        attributes: What else is said, as JSON; None where there is nothing.
    """

    tokens: Sequence[str]
    samples: NDArray[np.int64]
    tracks: NDArray[np.int64]
    values: NDArray[np.float64]
    attributes: Sequence[str | None]

    def take(self, order: NDArray[np.intp]) -> Boxes:
        """Those of some numbers, in their order."""
        numbers: list[int] = order.tolist()
        return Boxes(
            [self.tokens[number] for number in numbers],
            self.samples[order],
            self.tracks[order],
            self.values[order],
            [self.attributes[number] for number in numbers],
        )


def of_rows(rows: Sequence[Box]) -> Boxes:
    """The columns of single annotations."""
    return Boxes(
        [token for token, *_ in rows],
        np.array([sample for _, sample, *_ in rows], dtype=np.int64),
        np.array([track for _, _, track, *_ in rows], dtype=np.int64),
        np.array([values for *_, values, _ in rows], dtype=np.float64).reshape(-1, 6),
        [attributes for *_, attributes in rows],
    )


def joined(parts: Sequence[Boxes]) -> Boxes:
    """One after the other."""
    parts = [of_rows(()), *parts]
    return Boxes(
        [token for part in parts for token in part.tokens],
        np.concatenate([part.samples for part in parts]),
        np.concatenate([part.tracks for part in parts]),
        np.concatenate([part.values for part in parts]),
        [text for part in parts for text in part.attributes],
    )


class BoxReader:
    """From rows of the table `sample_annotation` to boxes."""

    def __init__(
        self,
        samples: Mapping[str, int],
        tracks: Mapping[str, int],
        attributes: Mapping[str, str],
        visible: Mapping[str, str],
    ) -> None:
        """Take the numbers of samples and instances, names of attributes and levels of visibility, by token."""
        self._samples = samples
        self._tracks = tracks
        self._attributes = attributes
        self._visible = visible
        self._beginnings: dict[tuple[tuple[str, ...], str | None], str] = {}

    def row(self, token: str, row: Record) -> Box:
        """A single annotation.

        Raises:
            InvalidError: It is unsound.
        """
        sample = found(self._samples, fields.text(row, "sample_token"), "sample")
        track = found(self._tracks, fields.text(row, "instance_token"), "instance")
        x, y, heading = pose(row)
        size = fields.vector(row, "size", 3)
        if min(size) <= 0:
            raise InvalidError("`size` is not positive")
        told = self._told(fields.optional_items(row, "attribute_tokens"), fields.optional_text(row, "visibility_token"))
        for key in _COUNTS:
            if row.get(key) is not None:
                told[key] = fields.integer(row, key)
        return token, sample, track, (x, y, heading, *size), to_json(told)

    def columns(self, rows: list[Any]) -> Boxes | None:
        """All annotations of a block; None if anything is not as it should be."""
        try:
            return self._columns(rows)
        except (InvalidError, *UNUSUAL):
            return None

    def _columns(self, rows: list[Any]) -> Boxes:
        tokens = column(rows, "token")
        demand(are(tokens, str) and "" not in tokens)
        values = np.empty((len(rows), 6))
        values[:, :2] = vectors(column(rows, "translation"), 3)[:, :2]
        values[:, 2] = _headings(vectors(column(rows, "rotation"), 4))
        values[:, 3:] = vectors(column(rows, "size"), 3)
        demand(not np.any(values[:, 3:] <= 0))
        return Boxes(
            tokens,
            _numbers(self._samples, column(rows, "sample_token")),
            _numbers(self._tracks, column(rows, "instance_token")),
            values,
            self._texts(rows),
        )

    def _texts(self, rows: list[dict[str, Any]]) -> list[str | None]:
        """What `to_json` makes of the attributes of each row: the counts differ, what is before them hardly does."""
        counts = [column(rows, key) for key in _COUNTS]
        demand(all(are(values, int, type(None)) for values in counts))
        names, levels = column(rows, "attribute_tokens"), column(rows, "visibility_token")
        demand(are(names, list, type(None)) and are(levels, str, type(None)))
        known, texts = self._beginnings, list[str | None]()
        for given, level, lidar, radar in zip(names, levels, *counts, strict=True):
            key = tuple(given or ()), level
            beginning = known.get(key)
            if beginning is None:
                beginning = known[key] = self._beginning(given or [], level or None)
            if lidar is not None:
                demand(abs(lidar) <= _LARGEST)
                beginning += f',"num_lidar_pts":{lidar}'
            if radar is not None:
                demand(abs(radar) <= _LARGEST)
                beginning += f',"num_radar_pts":{radar}'
            texts.append(f"{{{beginning[1:]}}}" if beginning else None)
        return texts

    def _beginning(self, tokens: list[Any], level: str | None) -> str:
        """The JSON of attributes and visibility without its braces, with a comma before; "" for nothing."""
        told = self._told(tokens, level)
        demand(told.keys().isdisjoint(_COUNTS))
        return f",{(to_json(told) or '')[1:-1]}" if told else ""

    def _told(self, tokens: list[Any], level: str | None) -> dict[str, str | int]:
        """What else an annotation says: `vehicle.parked` becomes `vehicle: parked`."""
        told: dict[str, str | int] = {}
        for token in tokens:
            group, _, value = found(self._attributes, token, "attribute").rpartition(".")
            told[group or "attribute"] = value
        if level is not None:
            told["visibility"] = self._visible.get(level, level)
        return told


def pose(row: Record) -> tuple[float, float, float]:
    """Position and heading of `translation` and `rotation`.

    Raises:
        InvalidError: They are unsound.
    """
    x, y, _ = fields.vector(row, "translation", 3)
    a, b, c, d = fields.vector(row, "rotation", 4)
    norm = math.hypot(a, b, c, d)
    if not 0.5 < norm < 2:
        raise InvalidError("`rotation` is not a unit quaternion")
    a, b, c, d = a / norm, b / norm, c / norm, d / norm
    yaw = math.atan2(2 * (a * d + b * c), 1 - 2 * (c * c + d * d))
    return x, y, normalize(yaw - math.pi / 2)


def _headings(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """The headings of `pose` to the last bit, which NumPy's own functions of angles would not give."""
    norms = np.array(list(map(math.hypot, *rotations.T.tolist())), dtype=np.float64)
    demand(bool(np.all((norms > 0.5) & (norms < 2))))
    a, b, c, d = rotations.T / norms
    across, along = 2 * (a * d + b * c), 1 - 2 * (c * c + d * d)
    yaws = np.array(list(map(math.atan2, across.tolist(), along.tolist())), dtype=np.float64)
    return normalize_array(yaws - math.pi / 2)


def _numbers(known: Mapping[str, int], tokens: list[Any]) -> NDArray[np.int64]:
    numbers = list(map(known.get, tokens))
    demand(None not in numbers)
    return np.array(numbers, dtype=np.int64)


def found(table: Mapping[str, Any], token: object, name: str) -> Any:
    """What a table has for a token.

    Raises:
        InvalidError: Nothing.
    """
    if not isinstance(token, str) or token not in table:
        raise InvalidError(f"{name} `{token}` is not there")
    return table[token]
