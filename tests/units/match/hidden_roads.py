"""Programs whose cars hang on directions at hidden places: along a bend of many short segments, and in chains."""

from __future__ import annotations

import math

import numpy as np
from shapely import LineString

from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network

TURN = np.linspace(0.0, 1.5 * math.pi, 60)
LINE = [(20.0 * math.cos(angle), 20.0 * math.sin(angle)) for angle in TURN.tolist()]
AREA = LineString(LINE).buffer(2.0, cap_style="flat")
BEND = Network(
    "bend",
    [
        MapFeature("road", "road", AREA, {"forward": "group"}),
        MapFeature("group", "lane_group", AREA, {"road": "road"}),
        MapFeature("lane", "lane", AREA, {"road": "road", "group": "group", "centerline": [LINE]}),
    ],
)
ON_BEND = "model scenic.domains.driving.model\nego = new Car\nspot = new OrientedPoint on road\n"
BENDS = {
    "a known way": "new Car following roadDirection from spot for 12",
    "a random way": "new Car following roadDirection from spot for Range(5, 15)",
    "facing as there": "new Car following roadDirection from spot for 12, "
    "facing Range(-5, 5) deg relative to spot.heading",
    "two ways": "next = new OrientedPoint following roadDirection from spot for 4\n"
    "new Car following roadDirection from next for 6",
}
CHAIN = """
ego = new Car on intersection
shift = Range(-0.5, 0.5)
last = ego
for i in range({cars}):
    center = follow roadDirection from (front of last) for Range(2, 8)
    spot = new OrientedPoint right of center by shift, facing Range(-5, 5) deg relative to roadDirection
    last = new Car ahead of spot
"""
