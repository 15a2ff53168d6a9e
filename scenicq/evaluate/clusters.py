"""Group recordings into clusters, and frames by their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.annotations import Frames
from scenicq.forest.components import connected_components

__all__ = ["CLUSTER_KEYS", "RECORDING", "Clusters", "find_clusters", "parameters_of"]

Numbers = NDArray[np.int64]

RECORDING = "recording"
CLUSTER_KEYS = ("log", "logfile", "drive", "day", "date", "vehicle")
"""Parameters that say which recordings belong together, the first that a dataset has."""
_NAMES = 12
"""Values above which a parameter is no kind of frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """Recordings that belong together.

    Attributes:
        unit: What they share, such as "drive"; "recording" where each stands alone.
        number: The cluster of each frame, shape (frames,).
        count: How many there are.
    """

    unit: str
    number: Numbers
    count: int


def find_clusters(frames: Frames, key: str | None = None) -> Clusters:
    """Find the clusters of frames.

    Args:
        frames: The dataset's.
        key: A parameter whose values recordings of one cluster share, or "recording"; by default the first of
            `CLUSTER_KEYS` that every frame has.

    Raises:
        DataError: option-invalid: some frame lacks the parameter.
    """
    recordings = Clusters(RECORDING, frames.recording.astype(np.int64), len(frames.recordings))
    if key == RECORDING:
        return recordings
    known = {name for params in frames.params for name in params}
    everywhere = [name for name in sorted(known) if all(name in params for params in frames.params)]
    if key is None:
        key = next((name for name in CLUSTER_KEYS if name in everywhere), None)
        if key is None:
            return recordings
    if key not in everywhere:
        lacking = "some frames lack the parameter" if key in known else "no frame has a parameter"
        hint = f"it may be {', '.join((RECORDING, *everywhere))}"
        raise DataError(Diagnostic("option-invalid", f"{lacking} `{key}`", hints=(hint,)))
    _, value = np.unique([str(params[key]) for params in frames.params], return_inverse=True)
    return Clusters(key, *_joined(value, frames.recording))


def _joined(value: Numbers, recording: NDArray[np.int32]) -> tuple[Numbers, int]:
    """The cluster of each frame; a recording in which the value changes joins the clusters of all its values."""
    pairs = np.unique(np.column_stack((value, recording)), axis=0)
    recordings = np.split(pairs[:, 1], np.flatnonzero(np.diff(pairs[:, 0])) + 1)
    parts = connected_components([each.tolist() for each in recordings])
    cluster = np.empty(int(value.max(initial=-1)) + 1, dtype=np.int64)
    for number, part in enumerate(parts):
        cluster[part] = number
    return cluster[value], len(parts)


def parameters_of(frames: Frames, clusters: Clusters) -> Mapping[str, tuple[list[str], Numbers]]:
    """The parameters that tell kinds of frames apart, each with its values and the number of each frame's.

    Left out are numbers with many values, and what names a cluster or a recording: of two kinds of frames each must
    come from two clusters at least.
    """
    found: dict[str, tuple[list[str], Numbers]] = {}
    for name in sorted({name for params in frames.params for name in params} - {clusters.unit}):
        told = [str(params[name]) if name in params else "" for params in frames.params]
        values, number = np.unique(told, return_inverse=True)
        if not 1 < len(values) <= _NAMES:
            continue
        pairs = np.unique(np.column_stack((number, clusters.number)), axis=0)
        if (np.bincount(pairs[:, 0]) > 1).sum() > 1:
            found[name] = [str(value) for value in values], number.astype(np.int64)
    return found
