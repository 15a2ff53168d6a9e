"""Annotations of nuScenes by column."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from itertools import chain, starmap

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.importers.fields import InvalidError, whole
from scenicq.importers.nuscenes_rows import Annotation
from scenicq.store.columns import pick_rows, to_json

__all__ = ["BoxReader", "Boxes", "headings", "is_unit", "join_boxes", "norms_of", "vectors"]


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Annotations, one element or row each.

    Attributes:
        tokens: Tokens of the annotations.
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
        """Select boxes by their numbers, in that order."""
        return Boxes(**{each.name: pick_rows(getattr(self, each.name), order) for each in fields(self)})


def join_boxes(parts: Sequence[Boxes]) -> Boxes:
    """Put boxes one after the other."""
    nothing = np.zeros(0, dtype=np.int64)
    parts = [Boxes((), nothing, nothing, np.zeros((0, 7)), ()), *parts]
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

    def boxes(self, rows: Sequence[Annotation], tell: Callable[[int, str], None]) -> Boxes:
        """Read the boxes of the annotations that are sound.

        Args:
            rows: The annotations.
            tell: Called with the number of each that is not, and what is wrong, in order.
        """
        samples = [self._samples.get(row.sample_token, -1) for row in rows]
        tracks = [self._tracks.get(row.instance_token, -1) for row in rows]
        norms = norms_of([row.rotation for row in rows])
        also = [
            self._also(row.attribute_tokens, row.visibility_token, row.num_lidar_pts, row.num_radar_pts) for row in rows
        ]
        units = is_unit(norms)
        problems = {number: str(told) for number, told in enumerate(also) if isinstance(told, InvalidError)}
        problems |= dict.fromkeys(np.flatnonzero(~units).tolist(), "`rotation` is not a unit quaternion")
        for name, numbers in (("instance", tracks), ("sample", samples)):
            if -1 in numbers:
                lost = [number for number, found in enumerate(numbers) if found < 0]
                problems |= {n: f"{name} `{getattr(rows[n], f'{name}_token')}` is not there" for n in lost}
        if problems:
            for number in sorted(problems):
                tell(number, problems[number])
            return self.boxes([row for number, row in enumerate(rows) if number not in problems], tell)
        values = np.empty((len(rows), 7))
        values[:, [0, 1, 6]] = vectors([row.translation for row in rows], 3)
        values[:, 2] = headings(vectors([row.rotation for row in rows], 4), norms)
        values[:, 3:6] = vectors([row.size for row in rows], 3)
        numbers = np.array(samples, dtype=np.int64), np.array(tracks, dtype=np.int64)
        attributes = [told for told in also if not isinstance(told, InvalidError)]
        return Boxes([row.token for row in rows], *numbers, values, attributes)

    def _text(
        self, tokens: tuple[str, ...] | None, level: str | None, lidar: float | None, radar: float | None
    ) -> str | InvalidError | None:
        """What else is said, as JSON, or what is wrong with it: `vehicle.parked` becomes `vehicle: parked`."""
        told: dict[str, str | int] = {}
        for token in tokens or ():
            if token not in self._attributes:
                return InvalidError(f"attribute `{token}` is not there")
            group, _, value = self._attributes[token].rpartition(".")
            told[group or "attribute"] = value
        if level:
            told["visibility"] = self._visible.get(level, level)
        try:
            counts = {"num_lidar_pts": lidar, "num_radar_pts": radar}
            told |= {key: whole(count, key) for key, count in counts.items() if count is not None}
        except InvalidError as error:
            return error
        return to_json(told)


def norms_of(rotations: Collection[tuple[float, ...]]) -> NDArray[np.float64]:
    """How long some quaternions are, to the last bit as `math.hypot` has it, shape (n,)."""
    return np.fromiter(starmap(math.hypot, rotations), np.float64, len(rotations))


def is_unit(norms: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which quaternions are turns, written with whatever accuracy, shape (n,)."""
    return (norms > 0.5) & (norms < 2)


def headings(rotations: NDArray[np.float64], norms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Headings to the last bit, as NumPy's own functions would not give them, shape (n,).

    Args:
        rotations: Quaternions w, x, y, z, shape (n, 4).
        norms: How long they are, shape (n,).
    """
    a, b, c, d = rotations.T / norms
    across, along = 2 * (a * d + b * c), 1 - 2 * (c * c + d * d)
    yaws = np.fromiter(map(math.atan2, across.tolist(), along.tolist()), np.float64, len(norms))
    return normalize_array(yaws - math.pi / 2)


def vectors(values: Collection[tuple[float, ...]], size: int) -> NDArray[np.float64]:
    """Some vectors of one size, shape (n, size)."""
    return np.fromiter(chain.from_iterable(values), np.float64, size * len(values)).reshape(-1, size)
