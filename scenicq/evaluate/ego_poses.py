"""Where the ego of each frame is by its source: the frame in which some models give their boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.annotations import Annotations, Frames
from scenicq.importers.predictions import Predictions
from scenicq.store.dataset import Dataset

__all__ = ["EgoPoses"]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int32]


class EgoPoses:
    """The frames of the egos: x ahead, y to the left, z up, from the point by which the source places the ego.

    That is the rear axle where the dataset says how far the middle of the ego lies ahead of it. An ego whose tilt is
    not known stands upright.
    """

    def __init__(self, dataset: Dataset, frames: Frames) -> None:
        """Take them from a dataset."""
        behind = dataset.manifest.provenance.facts.get("ego_centre_ahead_of_rear_axle_m", 0.0)
        behind = float(behind) if isinstance(behind, int | float) else 0.0
        heading, pitch, roll = map(np.nan_to_num, (frames.ego_heading, frames.ego_pitch, frames.ego_roll))
        sine, cosine = np.sin(heading), np.cos(heading)
        sp, cp, sr, cr = np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
        # heading 0 is +y: upright, ahead is (-sin, cos, 0) and left (-cos, -sin, 0)
        self._ahead = np.stack((-sine * cp, cosine * cp, -sp))
        self._left = np.stack((-sine * sp * sr - cosine * cr, cosine * sp * sr - sine * cr, cp * sr))
        self._up = np.stack((-sine * sp * cr + cosine * sr, cosine * sp * cr + sine * sr, cp * cr))
        centre = np.stack((frames.ego_x, frames.ego_y, np.nan_to_num(frames.ego_z)))
        self._origin = centre - behind * self._ahead

    def away(self, boxes: Predictions | Annotations, frame: Numbers, *, spatial: bool) -> Reals:
        """Distances of boxes on the map from the origin of their frames, shape (n,): in space or in the plane."""
        ox, oy, oz = self._origin[:, frame]
        away = np.hypot(boxes.x - ox, boxes.y - oy)
        return np.hypot(away, boxes.z - oz) if spatial else away

    def on_map(self, frame: Numbers, ahead: Reals, left: Reals, up: Reals) -> tuple[Reals, Reals, Reals]:
        """Points of the egos' frames in that of the map."""
        x, y, z = self._origin[:, frame] + self.turned(frame, ahead, left, up)
        return x, y, z

    def seen(self, frame: Numbers, x: Reals, y: Reals) -> tuple[Reals, Reals]:
        """How far ahead and to the left of the origins places of the map lie, in the plane."""
        dx, dy = x - self._origin[0, frame], y - self._origin[1, frame]
        ahead, left = (dx * axis[0, frame] + dy * axis[1, frame] for axis in (self._ahead, self._left))
        return ahead, left

    def turned(self, frame: Numbers, ahead: Reals, left: Reals, up: Reals) -> Reals:
        """Directions of the egos' frames in that of the map, shape (3, n)."""
        return ahead * self._ahead[:, frame] + left * self._left[:, frame] + up * self._up[:, frame]

    def heading_on_map(self, frame: Numbers, yaw: Reals) -> Reals:
        """The headings of what is turned by an angle from ahead, counter-clockwise, about the egos' own z axis."""
        x, y, _ = np.cos(yaw) * self._ahead[:, frame] + np.sin(yaw) * self._left[:, frame]
        return np.arctan2(-x, y)

    def heading_seen(self, frame: Numbers, heading: Reals) -> Reals:
        """The angle from ahead of each heading: the inverse of `heading_on_map`."""
        (ax, ay, _), (lx, ly, _) = self._ahead[:, frame], self._left[:, frame]
        x, y = -np.sin(heading), np.cos(heading)
        # Cramer's rule; the determinant is positive unless the ego lies on its side
        return np.arctan2(ax * y - ay * x, ly * x - lx * y)
