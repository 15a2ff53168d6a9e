"""Count what is known of motion in a dataset: from labels, from tracks, how often, with which gaps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from scenicq.store.dataset import Dataset
from scenicq.store.motion import LONGEST_GAP_US

if TYPE_CHECKING:
    import duckdb

__all__ = ["Gaps", "LabelIntervals", "ObservedMotion", "QuantityCoverage", "observed_motion"]

_OWNERS = MappingProxyType({"ego": ("labels", "ego_"), "objects": ("objects", "")})
"""The table and the beginning of the columns of the ego and of label objects."""


@dataclass(frozen=True, slots=True)
class QuantityCoverage:
    """How many egos or label objects have a quantity, and from where.

    Attributes:
        own: From the label itself.
        derived: From the samples of the track.
        unknown: Not at all.
    """

    own: int
    derived: int
    unknown: int

    @property
    def total(self) -> int:
        """All of them."""
        return self.own + self.derived + self.unknown


@dataclass(frozen=True, slots=True)
class LabelIntervals:
    """Seconds between two labels of a recording: the shortest, the median and the longest."""

    shortest: float
    median: float
    longest: float


@dataclass(frozen=True, slots=True)
class Gaps:
    """Gaps over which no motion is derived (`LONGEST_GAP_US`).

    Attributes:
        recordings: Between labels of recordings.
        tracks: Between samples of tracks.
    """

    recordings: int
    tracks: int


@dataclass(frozen=True, slots=True)
class ObservedMotion:
    """Motion in a dataset.

    Attributes:
        known: By quantity and owner, such as "velocity of objects"; owners of whom there are any.
        steps: Between labels; None where no recording has two.
        gaps: Where too long.
        without_track: Label objects that nothing identifies in other labels.
    """

    known: Mapping[str, QuantityCoverage]
    steps: LabelIntervals | None
    gaps: Gaps
    without_track: int


def observed_motion(dataset: Dataset) -> ObservedMotion:
    """Count what a dataset observes of motion.

    Raises:
        DataError: A file has changed.
    """
    with dataset.blamed(), dataset.connect() as connection:
        known: dict[str, QuantityCoverage] = {}
        for owner, (table, prefix) in _OWNERS.items():
            total, velocity, derived, acceleration, yaw_rate = _numbers(
                connection,
                f"count({prefix}x), count({prefix}motion_vx), "
                f"count(*) FILTER ({prefix}motion_vx IS NOT NULL AND {prefix}motion_derived), "
                f"count({prefix}acceleration), count({prefix}yaw_rate) FROM {table}",
            )
            if total:
                known[f"velocity of {owner}"] = QuantityCoverage(velocity - derived, derived, total - velocity)
                known[f"acceleration of {owner}"] = QuantityCoverage(0, acceleration, total - acceleration)
                known[f"angularSpeed of {owner}"] = QuantityCoverage(0, yaw_rate, total - yaw_rate)
        shortest, median, longest, gaps = _numbers(
            connection,
            "coalesce(min(step), 0), coalesce(quantile_disc(step, 0.5), 0), coalesce(max(step), 0), "
            f"count(*) FILTER (step > {LONGEST_GAP_US}) FROM (SELECT timestamp_us - lag(timestamp_us) OVER "
            "(PARTITION BY recording ORDER BY timestamp_us) AS step FROM labels) WHERE step IS NOT NULL",
        )
        (in_tracks,) = _numbers(
            connection,
            f"count(*) FILTER (step > {LONGEST_GAP_US}) FROM (SELECT timestamp_us - lag(timestamp_us) OVER "
            "(PARTITION BY recording, track ORDER BY timestamp_us) AS step FROM objects WHERE track IS NOT NULL)",
        )
        (without,) = _numbers(connection, "count(*) FILTER (track IS NULL) FROM objects")
    steps = LabelIntervals(shortest / 1e6, median / 1e6, longest / 1e6) if longest else None
    return ObservedMotion(known, steps, Gaps(gaps, in_tracks), without)


def _numbers(connection: duckdb.DuckDBPyConnection, selected: str) -> tuple[int, ...]:
    row = connection.execute(f"SELECT {selected}").fetchone()
    assert row is not None
    return tuple(map(int, row))
