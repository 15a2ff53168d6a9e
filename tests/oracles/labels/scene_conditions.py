"""The referee's label: its bodies, and the conditions in which the five programs are written."""

import math
from dataclasses import dataclass

import shapely
from road_map import Area, RoadMap
from shapely.geometry.base import BaseGeometry

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Body:
    """An annotated object or the ego: centre (m), heading (rad), `Car`, `Pedestrian` or None, length (m)."""

    id: str
    x: float
    y: float
    heading: float
    kind: str | None
    length: float


def _angle(angle: float) -> float:
    """The same angle in [-pi, pi]."""
    return math.remainder(angle, math.tau)


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Half widths of the position box along x and y (m) and of the heading arc (rad), and the boundary slack."""

    x: float
    y: float
    heading: float
    slack: float


class Scene:
    """One label on its map, with the conditions in which the five programs are written."""

    def __init__(
        self, road_map: RoadMap, ego: Body, bodies: list[Body], tolerances: Tolerances, radius: float | None
    ) -> None:
        """Keep the label objects whose centre is within `radius` (m) of the ego's; None keeps them all."""
        self.map = road_map
        self.ego = ego
        self.slack = tolerances.slack
        self.radius = math.inf if radius is None else radius
        self._tolerances = tolerances
        near = [body for body in bodies if self.distance(body) <= self.radius + self.slack]
        self.cars = [body for body in near if body.kind == "Car"]
        self.pedestrians = [body for body in near if body.kind == "Pedestrian"]
        self._directions: dict[str, frozenset[float]] = {}

    def distance(self, body: Body) -> float:
        """Distance (m) from the ego's centre to the body's."""
        return math.hypot(body.x - self.ego.x, body.y - self.ego.y)

    def _half_sizes(self) -> tuple[float, float]:
        """Half the width and half the height of a tolerance box (m)."""
        return max(self._tolerances.x + self.slack, 0.0), max(self._tolerances.y + self.slack, 0.0)

    def box(self, body: Body) -> BaseGeometry:
        """All positions within tolerance of the body's: a box, or a segment or point where a tolerance is 0."""
        a, b = self._half_sizes()
        return shapely.MultiPoint([(body.x + i * a, body.y + j * b) for i in (-1, 1) for j in (-1, 1)]).convex_hull

    def on(self, area: Area, body: Body, view: tuple[float, float] | None = None) -> bool:
        """Whether the body's position may lie in the area, cut to the radius and, if given, to a view of the ego.

        Args:
            area: The region.
            body: The object to be placed.
            view: Visible distance (m) and full view angle (rad, less than pi) of the ego.
        """
        box, centre = self.box(body), shapely.Point(self.ego.x, self.ego.y)
        reach = self.radius if view is None else min(self.radius, view[0])
        for i in area.meeting(box):
            piece = area.polygons[i].intersection(box)
            if view is not None:
                piece = piece.intersection(self._wedge(*view))
            if not piece.is_empty and piece.distance(centre) <= reach + self.slack:
                return True
        return False

    def _wedge(self, distance: float, angle: float) -> BaseGeometry:
        """A triangle from the ego whose part within `distance` of the ego is the view sector."""
        half = angle / 2 + self.slack
        if half >= math.pi / 2:
            raise ValueError("the sector of a view angle of 180 degrees or more is no triangle")
        side = 2 * distance / math.cos(half)
        sides = (self.ego.heading - half, self.ego.heading + half)
        tips = [(self.ego.x - side * math.sin(h), self.ego.y + side * math.cos(h)) for h in sides]
        return shapely.Polygon([(self.ego.x, self.ego.y), *tips])

    def facing(self, body: Body, degrees: Interval, base: float) -> bool:
        """Whether the body's heading may be `base` (rad) plus an angle of the interval (degrees)."""
        middle = math.radians((degrees[0] + degrees[1]) / 2)
        half = math.radians((degrees[1] - degrees[0]) / 2)
        allowed = half + max(self._tolerances.heading + self.slack, 0.0)
        return abs(_angle(body.heading - base - middle)) <= allowed

    def facing_road(self, body: Body, *degrees: Interval) -> bool:
        """Whether the body's heading may be the road direction at its label position plus an angle of an interval."""
        return any(
            self.facing(body, interval, base) for interval in degrees for base in self._directions_at_label(body)
        )

    def _directions_at_label(self, body: Body) -> frozenset[float]:
        if body.id not in self._directions:
            found = self.map.directions(body.x, body.y)
            moves = [(self.slack, 0.0), (-self.slack, 0.0), (0.0, self.slack), (0.0, -self.slack)]
            for dx, dy in moves if self.slack else []:
                moved = self.map.directions(body.x + dx, body.y + dy)
                found = found | moved if self.slack > 0 else found & moved
            self._directions[body.id] = found
        return self._directions[body.id]

    def offset(self, body: Body, anchor: Body, right: Interval, ahead: Interval) -> bool:
        """Whether the body's position may be the anchor's plus a local offset from a rectangle (m).

        Two convex shapes are apart exactly if they are apart along the normal of one of their sides; those are here the
        map axes and the anchor's own.
        """
        a, b = self._half_sizes()
        x, y = body.x - anchor.x, body.y - anchor.y
        box = [(x + i * a, y + j * b) for i in (-1, 1) for j in (-1, 1)]
        cos, sin = math.cos(anchor.heading), math.sin(anchor.heading)
        rectangle = [
            (u * cos - v * sin, u * sin + v * cos)
            for u in (right[0] - self.slack, right[1] + self.slack)
            for v in (ahead[0] - self.slack, ahead[1] + self.slack)
        ]
        for nx, ny in ((1.0, 0.0), (0.0, 1.0), (cos, sin), (-sin, cos)):
            ours = [px * nx + py * ny for px, py in box]
            theirs = [px * nx + py * ny for px, py in rectangle]
            if max(ours) < min(theirs) or max(theirs) < min(ours):
                return False
        return True

    def ahead_of(self, body: Body, anchor: Body, right: Interval, gap: Interval) -> bool:
        """Like `offset`, with `gap` (m) measured from the anchor's front edge to the body's rear edge."""
        between = anchor.length / 2 + body.length / 2
        return self.offset(body, anchor, right, (gap[0] + between, gap[1] + between))

    def turned_more_than(self, degrees: float, body: Body, other: Body) -> bool:
        """`abs(relative heading of body from other) > degrees`, on the label's values."""
        return abs(_angle(body.heading - other.heading)) > math.radians(degrees) - self.slack

    def nearer_than(self, metres: float, distance: float) -> bool:
        """`distance < metres`, on the label's values."""
        return distance < metres + self.slack
