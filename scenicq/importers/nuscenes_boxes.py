"""Annotations of nuScenes by column: a block of rows at once where all are sound, else row by row."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain, starmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize, normalize_array
from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.nuscenes_rows import Annotation
from scenicq.store.columns import to_json

__all__ = ["Box", "BoxReader", "Boxes", "found", "joined", "of_rows", "pose"]

_COUNTS = ("num_lidar_pts", "num_radar_pts")

Box = tuple[str, int, int, tuple[float, ...], str | None]
"""One annotation: see `Boxes`."""


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Annotations, one element or row each.

    Attributes:
        tokens: Of the annotations.
        samples, tracks: Numbers of the sample and of the instance, shape (n,).
        values: x, y, heading, width, length, height, z in metres and radians, shape (n, 7).
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
        np.array([values for *_, values, _ in rows], dtype=np.float64).reshape(-1, 7),
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
        # many rows say the same
        self._also = cache(self._text)

    def row(self, token: str, row: Record) -> Box:
        """A single annotation.

        Raises:
            InvalidError: It is unsound.
        """
        sample = found(self._samples, fields.text(row, "sample_token"), "sample")
        track = found(self._tracks, fields.text(row, "instance_token"), "instance")
        x, y, heading, z = pose(row)
        size = fields.vector(row, "size", 3)
        if min(size) <= 0:
            raise InvalidError("`size` is not positive")
        told = self._told(fields.optional_items(row, "attribute_tokens"), fields.optional_text(row, "visibility_token"))
        for key in _COUNTS:
            if row.get(key) is not None:
                told[key] = fields.integer(row, key)
        return token, sample, track, (x, y, heading, *size, z), to_json(told)

    def columns(self, rows: Sequence[Annotation]) -> Boxes | None:
        """All of some annotations, as `row` makes them; None where it would refuse one."""
        try:
            samples = _numbers(self._samples, [row.sample_token for row in rows])
            tracks = _numbers(self._tracks, [row.instance_token for row in rows])
            values = np.empty((len(rows), 7))
            values[:, [0, 1, 6]] = _vectors([row.translation for row in rows], 3)
            values[:, 2] = _headings([row.rotation for row in rows])
            values[:, 3:6] = _vectors([row.size for row in rows], 3)
            also = [
                self._also(row.attribute_tokens, row.visibility_token, row.num_lidar_pts, row.num_radar_pts)
                for row in rows
            ]
        except InvalidError:
            return None
        return Boxes([row.token for row in rows], samples, tracks, values, also)

    def _text(
        self, tokens: tuple[str, ...] | None, level: str | None, lidar: int | None, radar: int | None
    ) -> str | None:
        """What else an annotation says, as JSON."""
        told = self._told(tokens or (), level or None)
        told |= {key: count for key, count in zip(_COUNTS, (lidar, radar), strict=True) if count is not None}
        return to_json(told)

    def _told(self, tokens: Iterable[Any], level: str | None) -> dict[str, str | int]:
        """What else an annotation says: `vehicle.parked` becomes `vehicle: parked`."""
        told: dict[str, str | int] = {}
        for token in tokens:
            group, _, value = found(self._attributes, token, "attribute").rpartition(".")
            told[group or "attribute"] = value
        if level is not None:
            told["visibility"] = self._visible.get(level, level)
        return told


def pose(row: Record) -> tuple[float, float, float, float]:
    """x, y, heading and z of `translation` and `rotation`.

    Raises:
        InvalidError: They are unsound.
    """
    x, y, z = fields.vector(row, "translation", 3)
    a, b, c, d = fields.vector(row, "rotation", 4)
    norm = math.hypot(a, b, c, d)
    if not 0.5 < norm < 2:
        raise InvalidError("`rotation` is not a unit quaternion")
    a, b, c, d = a / norm, b / norm, c / norm, d / norm
    yaw = math.atan2(2 * (a * d + b * c), 1 - 2 * (c * c + d * d))
    return x, y, normalize(yaw - math.pi / 2), z


def _headings(rotations: Sequence[tuple[float, ...]]) -> NDArray[np.float64]:
    """The headings of `pose`, shape (n,), to the last bit, as NumPy's own functions would not give them.

    Raises:
        InvalidError: A rotation is unsound.
    """
    norms = np.fromiter(starmap(math.hypot, rotations), np.float64, len(rotations))
    if not np.all((norms > 0.5) & (norms < 2)):
        raise InvalidError("`rotation` is not a unit quaternion")
    a, b, c, d = _vectors(rotations, 4).T / norms
    across, along = 2 * (a * d + b * c), 1 - 2 * (c * c + d * d)
    yaws = np.fromiter(map(math.atan2, across.tolist(), along.tolist()), np.float64, len(rotations))
    return normalize_array(yaws - math.pi / 2)


def _vectors(values: Collection[tuple[float, ...]], size: int) -> NDArray[np.float64]:
    """Some vectors of one size, shape (n, size)."""
    return np.fromiter(chain.from_iterable(values), np.float64, size * len(values)).reshape(-1, size)


def _numbers(known: Mapping[str, int], tokens: Sequence[str]) -> NDArray[np.int64]:
    """The numbers of some tokens, shape (n,).

    Raises:
        InvalidError: One has none.
    """
    try:
        return np.array([known[token] for token in tokens], dtype=np.int64)
    except KeyError as error:
        raise InvalidError(f"`{error.args[0]}` is not there") from error


def found(table: Mapping[str, Any], token: object, name: str) -> Any:
    """What a table has for a token.

    Raises:
        InvalidError: Nothing.
    """
    if not isinstance(token, str) or token not in table:
        raise InvalidError(f"{name} `{token}` is not there")
    return table[token]
