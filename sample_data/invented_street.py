"""The street that `generate_formats.py` writes in many formats.

It runs along x: one lane each way, then an intersection; the ego drives east at 10 m/s, a car comes towards it at
8 m/s, somebody on foot waits to cross and then goes north.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["ACTORS", "CAR", "EGO", "LANES", "START_NS", "STEPS", "STEP_S", "WALKER", "Actor", "Lane", "Point"]

STEPS, STEP_S = 6, 0.1
START_NS = 1_700_000_000_000_000_000
Point = tuple[float, float]


@dataclass(frozen=True)
class Actor:
    """Something that moves straight: kind, start, velocity, yaw from +x, length, width, height."""

    name: str
    kind: str
    start: Point
    velocity: Point
    yaw: float
    size: tuple[float, float, float]

    def at(self, step: int) -> Point:
        """Position of the centre at a step."""
        return self.start[0] + self.velocity[0] * step * STEP_S, self.start[1] + self.velocity[1] * step * STEP_S


EGO = Actor("ego", "car", (10.0, -1.75), (10.0, 0.0), 0.0, (4.877, 2.0, 1.473))
CAR = Actor("oncoming", "car", (50.0, 1.75), (-8.0, 0.0), math.pi, (4.5, 1.9, 1.6))
WALKER = Actor("walker", "pedestrian", (40.0, -5.0), (0.0, 1.5), math.pi / 2, (0.7, 0.6, 1.75))
ACTORS = (EGO, CAR, WALKER)


@dataclass(frozen=True)
class Lane:
    """A straight lane: left and right boundary in the direction of travel, the lanes beside, before and after it."""

    id: int
    left: tuple[Point, Point]
    right: tuple[Point, Point]
    beside: int
    before: tuple[int, ...]
    after: tuple[int, ...]
    crossing: bool


LANES = (
    Lane(1, ((0.0, 0.0), (60.0, 0.0)), ((0.0, -3.5), (60.0, -3.5)), 2, (), (3,), False),
    Lane(2, ((60.0, 0.0), (0.0, 0.0)), ((60.0, 3.5), (0.0, 3.5)), 1, (4,), (), False),
    Lane(3, ((60.0, 0.0), (80.0, 0.0)), ((60.0, -3.5), (80.0, -3.5)), 4, (1,), (9,), True),
    Lane(4, ((80.0, 0.0), (60.0, 0.0)), ((80.0, 3.5), (60.0, 3.5)), 3, (9,), (2,), True),
)
"""Lane 9 is not in the map: what lies at its edge is often named and not there."""
