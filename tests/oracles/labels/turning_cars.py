"""A car that turns around in a lane that another one crosses."""

from __future__ import annotations

import math

from shapely import box

from scenicq.geometry.features import MapFeature
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

IN, U = 1, 2
"""Numbers of two lanes among the elements of the map."""
MAP = [
    MapFeature("meadow", "drivable", box(-40, -40, 40, 40)),
    MapFeature("in", "lane", box(0, -40, 4, 0), {"centerline": [[[2, -40], [2, 0]]], "successors": ["u"]}),
    MapFeature("u", "lane", box(-4, 0, 4, 8), {"centerline": [[[2, 0], [2, 4], [-2, 4], [-2, 0]]]}),
    MapFeature("out", "lane", box(-4, -40, 0, 0), {"centerline": [[[-2, 0], [-2, -40]]], "predecessors": ["u"]}),
    MapFeature("cross", "lane", box(-20, 2, 20, 6), {"centerline": [[[-20, 4], [20, 4]]]}),
]
BEFORE, INSIDE, TURNING = (2, -3, 0), (0, 7, 90), (0, 5, -40)
"""In the lane that leads to the turn; in the turn alone; where it is crossed, the heading as of who drives across."""


def dataset_of(tmp_path, path, step_s=0.5):
    """A car whose places (x, y, degrees) come one after the other, another one that stays, and the ego on that path."""
    labels = []
    for number, (x, y, degrees) in enumerate(path):
        heading = None if degrees is None else math.radians(degrees)
        car = LabelObject("a", "Car", "car", x, y, heading, track="ego 1")
        parked = LabelObject("b", "Car", "car", 30, 30, 0.0)
        ego = LabelObject("ego", "Car", "car", x, y, heading)
        labels.append(Label(f"{number}", "r", round(number * step_s * 1e6), "m", ego, (parked, car)))
    write_dataset(tmp_path / "d", iter([Recording("r", "m", tuple(labels))]), {"m": MAP}, name="d")
    return open_dataset(tmp_path / "d")
