"""Check that predictions lie in the frame of reference of their format: the map's, or the ego's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.annotations import Frames
from scenicq.evaluate.assignment import Centres, find_pairs
from scenicq.evaluate.ego_poses import EgoPoses
from scenicq.importers.predictions import THRESHOLDS_M, Predictions

__all__ = ["check_distance", "check_fit"]

Numbers = NDArray[np.int32]

_ABSURD_M = 300.0
"""No sensor sees so far: boxes whose median distance from the ego is larger are in another frame of reference."""
_ASKED = 50_000
"""Boxes that are looked at, at most: those of the highest scores."""
_FEWEST = 20
"""Boxes from which something can be said."""
_HARDLY, _OFTEN = 0.1, 0.3
"""Shares of the boxes near a label object of their class: in the wrong frame at most, in the right one at least."""


def check_distance(predictions: Predictions, frame: Numbers, frames: Frames) -> None:
    """Refuse boxes on the map of which half lie farther from the ego than any sensor sees.

    Raises:
        DataError: predictions-frame.
    """
    if len(frame):
        away = float(np.median(np.hypot(predictions.x - frames.ego_x[frame], predictions.y - frames.ego_y[frame])))
        if away > _ABSURD_M:
            message = f"{predictions.name}: half of the boxes lie more than {away:,.0f} m from the ego of their frame"
            raise _wrong(message)


def check_fit(name: str, boxes: Centres, owner: Numbers, labels: Centres, poses: EgoPoses, *, of_ego: bool) -> None:
    """Refuse boxes that are hardly ever near a label object, but often would be in the other frame of reference.

    Args:
        name: The file's name.
        boxes: Predictions on the map, in the order of falling scores.
        owner: The label object of each prediction at the largest centre distance, -1 without.
        labels: The label objects that count.
        poses: The poses of the egos.
        of_ego: Whether the boxes were taken to lie in the ego's frame.

    Raises:
        DataError: predictions-frame.
    """
    frame, x, y, found = boxes.frame[:_ASKED], boxes.x[:_ASKED], boxes.y[:_ASKED], int((owner[:_ASKED] >= 0).sum())
    number = min(len(frame), len(labels.x))
    if number < _FEWEST or found > _HARDLY * number:
        return
    x, y = poses.seen(frame, x, y) if of_ego else poses.on_map(frame, x, y, np.zeros(len(frame)))[:2]
    moved = Centres(frame, boxes.category[:_ASKED], x, y)
    near = len(np.unique(find_pairs(moved, labels, max(THRESHOLDS_M)).prediction))
    if near >= _OFTEN * number:
        other = "map" if of_ego else "ego"
        message = f"{found} of {len(frame)} boxes are near a label object of their class, but {near} would be"
        raise _wrong(f"{name}: {message} were they in the frame of the {other}")


def _wrong(message: str) -> DataError:
    hint = "nuScenes and interchange: the frame of the map; Argoverse 2: the frame of the ego at that time"
    return DataError(Diagnostic("predictions-frame", message, hints=(hint,)))
