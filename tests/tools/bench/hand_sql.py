"""Questions to a fleet (`fleet.py`) as Scenic programs and as SQL written by hand over the columns of its store."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from fleet import NEEDLE, fleet_map

from scenicq.geometry.elements import Lane, NetworkElement
from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, Tolerance

__all__ = ["MACROS", "QUESTIONS", "Question"]

SCENARIOS = Path(__file__).parents[3] / "sample_data" / "scenarios"
SAMPLE = MatchOptions(classes="coarse", radius=50.0)
WIDE = MatchOptions()
"""The default tolerance: 0.25 m and 5 degrees."""
NARROW = MatchOptions(tolerance=EXACT)
SPEED = MatchOptions(tolerance=Tolerance(other=0.1))


@dataclass(frozen=True, slots=True)
class Question:
    """A question.

    Attributes:
        program: In Scenic.
        options: How it is matched.
        sql: Names the frames that match.
    """

    program: str
    options: MatchOptions
    sql: str


VEHICLES = "('Car', 'Truck', 'Bicycle')"
"""Classes of the fleet that `--classes coarse` takes for cars."""
DRIVABLE = "('lane', 'road', 'intersection', 'drivable')"
MACROS = (
    f"CREATE MACRO turned(a, b) AS least(abs(a - b) % {math.tau}, {math.tau} - abs(a - b) % {math.tau})",
    "CREATE MACRO along(heading, directions, away) AS "
    "len(list_filter(directions, lambda d: turned(heading, d) <= away)) > 0",
    # metres from a point to a rectangle whose sides are parallel to the axes
    "CREATE MACRO off(x, y, x0, x1, y0, y1) AS "
    "sqrt(greatest(x0 - x, x - x1, 0) ** 2 + greatest(y0 - y, y - y1, 0) ** 2)",
)


def _near(frame: str, object_: str, kinds: str, reach: float = 0.25) -> str:
    """That an object is in a region, or within reach of it."""
    return (
        f"EXISTS (FROM memberships m WHERE m.frame = {frame} AND m.object = {object_} AND m.kind IN {kinds} "
        f"AND m.distance <= {reach})"
    )


EGO = f"""
ego AS (SELECT * FROM labels l WHERE along(ego_heading, ego_road_directions, radians({{}}))
        AND {_near("l.frame", "'ego'", "{}")})"""
DRIVER = EGO.format(5, DRIVABLE)
"""An ego that is a car as the world model has it: on a road, along it."""
SAMPLE_EGO = EGO.format(20, "('lane', 'intersection')")
CROSSINGS = ", ".join(str(each.shape.bounds) for each in fleet_map() if each.kind == "intersection")
"""The fleet's intersections are rectangles."""


def _sample(name: str, sql: str) -> Question:
    return Question((SCENARIOS / f"{name}.scenic").read_text(), SAMPLE, sql)


def _driving(program: str, rest: str, options: MatchOptions = WIDE) -> Question:
    """A program of the driving world, with an ego as that has it."""
    return Question(f"model scenic.domains.driving.model\nego = new Car\n{program}\n", options, f"WITH {DRIVER}{rest}")


@functools.cache
def _fleet() -> Network:
    return Network("fleet", fleet_map())


def _meant(of: Callable[[Lane], Iterable[NetworkElement | None]]) -> str:
    """Pairs of a lane and what is meant by it, as rows of SQL."""
    pairs = {(lane.id, each.id) for lane in _fleet().lanes for each in of(lane) if each is not None}
    return ", ".join(f"('{lane}', '{each}')" for lane, each in sorted(pairs))


def _ahead(lane: Lane, metres: float) -> list[Lane]:
    """A lane and those that it leads to which begin at most so far behind its end."""
    begins, waiting = {lane: 0.0}, [lane]
    while waiting:
        now = waiting.pop()
        assert now.centerline is not None
        end = 0.0 if now is lane else begins[now] + sum(line.length for line in now.centerline.lines)
        for each in now.successors:
            if end <= metres and end < begins.get(each, math.inf):
                begins[each] = end
                waiting.append(each)
    return list(begins)


def _through(
    place: str, of: Callable[[Lane], Iterable[NetworkElement | None]], middle: int = 0, sort: str = "Car"
) -> Question:
    """Somebody in what the map says of the ego's lane, 5 to 20 m from it."""
    program = (
        f"other = new {sort} in {place}, facing Range({middle - 20}, {middle + 20}) deg relative to ego.heading\n"
        "require 5 < (distance to other) < 20"
    )
    sql = f""",
meant(lane, region) AS (VALUES {_meant(of)}),
here AS (SELECT m.frame, r.region FROM memberships m JOIN meant r ON r.lane = m.region
         WHERE m.object = 'ego' AND m.kind = 'lane' AND m.distance <= 0.05)
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
JOIN memberships m ON m.frame = a.frame AND m.object = a.id JOIN here h ON h.frame = a.frame AND h.region = m.region
WHERE a.class = '{sort}' AND m.distance <= 0.25 AND a.ego_distance > 5 AND a.ego_distance < 20
AND turned(a.relative_heading, radians({middle})) <= radians(25)"""
    return _driving(program, sql)


_ON_COURSE = (
    "a.ego_along - a.ego_along_less > {} AND a.ego_along + a.ego_along_more < {} "
    "AND greatest(abs(a.ego_beside - a.ego_beside_less), abs(a.ego_beside + a.ego_beside_more)) < {}"
)
"""That a label object is surely along the ego's course by so much, and beside it by less than so much."""


QUESTIONS = {
    "01_pedestrian_facing_ego": _sample(
        "01_pedestrian_facing_ego",
        f"""
WITH {SAMPLE_EGO}
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
JOIN memberships m ON m.frame = a.frame AND m.object = a.id
WHERE a.class = 'Adult' AND a.ego_distance <= 50 AND abs(a.relative_heading) > radians(70)
AND m.kind IN ('lane', 'intersection') AND m.distance <= 0.25""",
    ),
    "02_crossing_cars": _sample(
        "02_crossing_cars",
        f"""
WITH {SAMPLE_EGO},
crossing(x0, y0, x1, y1) AS (VALUES {CROSSINGS}),
car AS (SELECT a.* FROM objects a JOIN ego USING (frame) JOIN memberships m ON m.frame = a.frame AND m.object = a.id
        WHERE a.class IN {VEHICLES} AND a.ego_distance <= 50 AND m.kind = 'intersection' AND m.distance <= 0.25),
near AS (SELECT frame FROM ego WHERE EXISTS (FROM crossing WHERE off(ego_x, ego_y, x0, x1, y0, y1) < 10))
SELECT DISTINCT l.frame FROM car l JOIN car r USING (frame) JOIN near USING (frame)
WHERE l.relative_heading BETWEEN radians(45) AND radians(140)
AND -r.relative_heading BETWEEN radians(45) AND radians(140) AND turned(l.heading, r.heading) > radians(100)""",
    ),
    "03_against_traffic": _sample(
        "03_against_traffic",
        f"""
WITH ego AS (
    SELECT * FROM labels l
    WHERE len(list_filter(ego_road_directions, lambda d: turned(ego_heading, d) >= radians(85))) > 0
    AND {_near("l.frame", "'ego'", DRIVABLE)})
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
JOIN memberships m ON m.frame = a.frame AND m.object = a.id
WHERE a.class IN {VEHICLES} AND a.ego_distance < 10 AND along(a.heading, a.road_directions, radians(20))
AND m.kind IN {DRIVABLE} AND m.distance <= 0.25
AND abs(a.ego_right) * cos(radians(67.5)) - a.ego_ahead * sin(radians(67.5)) <= 0.25""",
    ),
    "04_two_lane_traffic": _sample(
        "04_two_lane_traffic",
        f"""
WITH {SAMPLE_EGO},
car AS (SELECT a.*, ego.ego_length FROM objects a JOIN ego USING (frame)
        WHERE a.class IN {VEHICLES} AND a.ego_distance <= 50),
follower AS (SELECT * FROM car WHERE along(heading, road_directions, radians(20))),
leader AS (SELECT * FROM follower
           WHERE off(ego_right, ego_ahead, -1, 1, (ego_length + length) / 2, (ego_length + length) / 2 + 40) <= 0.25),
oncoming AS (SELECT * FROM car
             WHERE off(ego_right, ego_ahead, -10, -1, 0, 50) <= 0.25 AND turned(relative_heading, pi()) <= radians(45))
SELECT DISTINCT o.frame FROM oncoming o JOIN follower s ON s.frame = o.frame AND s.id <> o.id
JOIN leader l ON l.frame = o.frame AND l.id <> o.id AND l.id <> s.id
WHERE off((s.x - o.x) * cos(o.heading) + (s.y - o.y) * sin(o.heading),
          (s.y - o.y) * cos(o.heading) - (s.x - o.x) * sin(o.heading),
          -1, 1, (o.length + s.length) / 2, (o.length + s.length) / 2 + 40) <= 0.25""",
    ),
    "05_cut_in_from_right": _sample(
        "05_cut_in_from_right",
        f"""
WITH ego AS (
    SELECT * FROM labels l WHERE along(ego_heading, ego_road_directions, radians(20))
    AND EXISTS (FROM memberships m WHERE m.frame = l.frame AND m.object = 'ego' AND m.distance <= 0.25
                AND m.region IN (SELECT id FROM lanes WHERE "right" IS NOT NULL)))
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class IN {VEHICLES} AND a.ego_distance <= 50 AND off(a.ego_right, a.ego_ahead, 0, 4, 0, 5) <= 0.25
AND len(list_filter(a.road_directions, lambda d: turned(a.heading, d) BETWEEN radians(10) AND radians(35))) > 0""",
    ),
    "needle": Question(
        NEEDLE,
        WIDE,
        f"""
WITH {DRIVER}
SELECT DISTINCT a.frame FROM objects a JOIN ego l USING (frame)
WHERE a.class = 'Truck'
AND len(list_filter(a.road_directions, lambda d: turned(a.heading - radians(90), d) <= radians(15))) > 0
AND off(a.ego_right, a.ego_ahead, 0, 0, (l.ego_length + a.length) / 2 + 4,
        (l.ego_length + a.length) / 2 + 8) <= 0.25""",
    ),
    "a car ahead": _driving(
        "lead = new Car ahead of ego by Range(5, 15)",
        """
SELECT DISTINCT a.frame FROM objects a JOIN ego e USING (frame)
WHERE a.class = 'Car' AND abs(a.relative_heading) <= radians(5)
AND off(a.ego_right, a.ego_ahead, 0, 0, (e.ego_length + a.length) / 2 + 5,
        (e.ego_length + a.length) / 2 + 15) <= 0.25""",
    ),
    "an oncoming car": _driving(
        "other = new Car offset by (Range(-10, 10), Range(20, 40)), facing Range(170, 190) deg relative to ego.heading",
        """
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Car' AND turned(a.relative_heading, pi()) <= radians(15)
AND off(a.ego_right, a.ego_ahead, -10, 10, 20, 40) <= 0.25""",
    ),
    "a cone in the way": _driving(
        "cone = new Cone ahead of ego by (Range(-3, 3), Range(5, 30)), facing Range(-180, 180) deg",
        """
SELECT DISTINCT a.frame FROM objects a JOIN ego e USING (frame)
WHERE a.class = 'Cone'
AND off(a.ego_right, a.ego_ahead, -3, 3, (e.ego_length + a.length) / 2 + 5,
        (e.ego_length + a.length) / 2 + 30) <= 0.25""",
    ),
    "a truck to the left": _driving(
        "truck = new Truck left of ego by Range(0.5, 4)",
        """
SELECT DISTINCT a.frame FROM objects a JOIN ego e USING (frame)
WHERE a.class = 'Truck' AND abs(a.relative_heading) <= radians(5)
AND off(a.ego_right, a.ego_ahead, -(e.ego_width + a.width) / 2 - 4,
        -(e.ego_width + a.width) / 2 - 0.5, 0, 0) <= 0.25""",
    ),
    "a platoon": _driving(
        "first = new Car ahead of ego by Range(1, 20)\nsecond = new Car ahead of first by Range(1, 20)",
        """,
car AS (SELECT a.*, e.ego_length FROM objects a JOIN ego e USING (frame) WHERE a.class = 'Car'),
first AS (SELECT * FROM car WHERE abs(relative_heading) <= radians(5)
          AND off(ego_right, ego_ahead, 0, 0, (ego_length + length) / 2 + 1, (ego_length + length) / 2 + 20) <= 0.25)
SELECT DISTINCT f.frame FROM first f JOIN car s ON s.frame = f.frame AND s.id <> f.id
WHERE turned(s.heading, f.heading) <= radians(5)
AND off((s.x - f.x) * cos(f.heading) + (s.y - f.y) * sin(f.heading),
          (s.y - f.y) * cos(f.heading) - (s.x - f.x) * sin(f.heading),
          0, 0, (f.length + s.length) / 2 + 1, (f.length + s.length) / 2 + 20) <= 0.25""",
    ),
    "a bicycle beside": _driving(
        "bike = new Bicycle on road\nrequire (distance to bike) < 25\nrequire abs(relative heading of bike) < 30 deg",
        f"""
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Bicycle' AND along(a.heading, a.road_directions, radians(5)) AND a.ego_distance < 25
AND abs(a.relative_heading) < radians(30) AND {_near("a.frame", "a.id", DRIVABLE)}""",
    ),
    "a walker beside a car": _driving(
        "car = new Car on road\nwalker = new Pedestrian on sidewalk, facing Range(-180, 180) deg\n"
        "require (distance from car to walker) < 6\nrequire (distance to car) < 30",
        f""",
car AS (SELECT a.* FROM objects a JOIN ego USING (frame) WHERE a.class = 'Car' AND a.ego_distance < 30
        AND along(a.heading, a.road_directions, radians(5)) AND {_near("a.frame", "a.id", DRIVABLE)}),
walker AS (SELECT a.* FROM objects a JOIN ego USING (frame) WHERE a.class = 'Adult'
           AND {_near("a.frame", "a.id", "('sidewalk')")})
SELECT DISTINCT c.frame FROM car c JOIN walker w ON w.frame = c.frame
AND sqrt((w.x - c.x) ** 2 + (w.y - c.y) ** 2) < 6""",
    ),
    "a standing car": _driving(
        "other = new Car on road, with speed Range(0, 0.5)\nrequire (distance to other) < 15",
        f"""
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Car' AND along(a.heading, a.road_directions, radians(5)) AND a.ego_distance < 15
AND sqrt(a.motion_vx ** 2 + a.motion_vy ** 2) <= 0.6 AND {_near("a.frame", "a.id", DRIVABLE)}""",
        SPEED,
    ),
    "a walker in view": Question(
        "model scenic.domains.driving.model\nego = new Car with visibleDistance 40, with viewAngle 90 deg,\n"
        "    facing Range(-20, 20) deg relative to roadDirection\n"
        "walker = new Pedestrian on visible sidewalk, facing Range(-180, 180) deg\n",
        NARROW,
        f"""
WITH {EGO.format(20.0573, DRIVABLE).replace("0.25", "0.001")}
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Adult' AND a.ego_distance <= 40.001 AND {_near("a.frame", "a.id", "('sidewalk')", 0.001)}
AND abs(a.ego_right) * cos(radians(45)) - a.ego_ahead * sin(radians(45)) <= 0.001""",
    ),
    "any car on a road": _driving("", "\nSELECT frame FROM ego"),
    "a car in my lane": _through("ego.lane", lambda lane: [lane]),
    "oncoming beside me": _through("ego.oppositeLaneGroup", lambda lane: [lane.group._opposite], 180),
    "in the lane to my left": _through(
        "ego.laneSection.laneToLeft", lambda lane: [each.lane for each in [lane.sections[0]._laneToLeft] if each]
    ),
    "in my lane group": _through("ego.laneGroup", lambda lane: [lane.group]),
    "on my road, either way": _through("ego.road", lambda lane: [lane.road], 180),
    "a cyclist in my lane": _through("ego.lane", lambda lane: [lane], 0, "Bicycle"),
    "the other is in my lane": _driving(
        "other = new Car in everywhere, facing Range(-20, 20) deg relative to ego.heading\n"
        "require other.lane is ego.lane\nrequire 5 < (distance to other) < 20",
        """,
here AS (SELECT m.frame, m.region FROM memberships m
         WHERE m.object = 'ego' AND m.kind = 'lane' AND m.distance <= 0.05)
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
JOIN memberships m ON m.frame = a.frame AND m.object = a.id JOIN here h ON h.frame = a.frame AND h.region = m.region
WHERE a.class = 'Car' AND m.distance <= 0.05 AND a.ego_distance > 5 AND a.ego_distance < 20
AND abs(a.relative_heading) <= radians(25)""",
    ),
    "in a lane that branches": _driving(
        "require len(ego.lane.maneuvers) > 1\n"
        "other = new Truck in everywhere, facing Range(-20, 20) deg relative to ego.heading\n"
        "require 5 < (distance to other) < 20",
        f""",
branches(lane, region) AS (VALUES {_meant(lambda lane: [lane] if len(lane.maneuvers) > 1 else [])}),
here AS (SELECT DISTINCT m.frame FROM memberships m JOIN branches t ON t.lane = m.region
         WHERE m.object = 'ego' AND m.kind = 'lane' AND m.distance <= 0.05)
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame) JOIN here USING (frame)
WHERE a.class = 'Truck' AND a.ego_distance > 5 AND a.ego_distance < 20
AND abs(a.relative_heading) <= radians(25)""",
    ),
    "in the lanes ahead": _through("ego.lane.lanesAhead(30)", lambda lane: _ahead(lane, 30.0)),
    "beside me in my lane group": _driving(
        "other = new Car in ego.laneGroup, facing Range(-20, 20) deg relative to ego.heading\n"
        "require not (other.position in ego.lane)\nrequire 5 < (distance to other) < 20",
        f""",
meant(lane, region) AS (VALUES {_meant(lambda lane: [lane.group])}),
here AS (SELECT m.frame, m.region AS lane, r.region FROM memberships m JOIN meant r ON r.lane = m.region
         WHERE m.object = 'ego' AND m.kind = 'lane' AND m.distance <= 0.05)
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
JOIN memberships m ON m.frame = a.frame AND m.object = a.id JOIN here h ON h.frame = a.frame AND h.region = m.region
WHERE a.class = 'Car' AND m.distance <= 0.25 AND a.ego_distance > 5 AND a.ego_distance < 20
AND abs(a.relative_heading) <= radians(25) AND NOT EXISTS (
    FROM memberships n WHERE n.frame = a.frame AND n.object = a.id AND n.region = h.lane AND n.distance <= 0)""",
    ),
    "a car on a crossing ahead": _driving(
        "other = new Car at ego offset by (Range(-8, 8), Range(0, 30)), facing Range(-180, 180) deg\n"
        "require other.position in crossing",
        f"""
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Car' AND off(a.ego_right, a.ego_ahead, -8, 8, 0, 30) <= 0.25
AND {_near("a.frame", "a.id", "('crossing')", 0.0)}""",
    ),
    "a cone on the shoulder": _driving(
        "cone = new Cone on shoulder, facing Range(-180, 180) deg\nrequire (distance to cone) < 20",
        f"""
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Cone' AND a.ego_distance < 20 AND {_near("a.frame", "a.id", "('shoulder')")}""",
    ),
    "near an intersection": _driving(
        "require (distance from ego to intersection) < 10\nother = new Car on road\nrequire (distance to other) < 20",
        f""",
crossing(x0, y0, x1, y1) AS (VALUES {CROSSINGS}),
near AS (SELECT frame FROM ego WHERE EXISTS (FROM crossing WHERE off(ego_x, ego_y, x0, x1, y0, y1) < 10))
SELECT DISTINCT a.frame FROM objects a JOIN near USING (frame)
WHERE a.class = 'Car' AND a.ego_distance < 20 AND along(a.heading, a.road_directions, radians(5))
AND {_near("a.frame", "a.id", DRIVABLE)}""",
    ),
    "ahead on the course": _driving(
        "from scenicq.labels import along, beside\n"
        "lead = new Car in everywhere, facing Range(-180, 180) deg\n"
        "require 0 < along(ego, lead) < 20\nrequire abs(beside(ego, lead)) < 1.5",
        f"""
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Car' AND a.ego_distance <= 50 AND {_ON_COURSE.format(0, 20, 1.5)}""",
    ),
    "a lead that drives": _driving(
        "from scenicq.labels import along, beside\n"
        "lead = new Truck in everywhere, facing Range(-30, 30) deg relative to ego.heading\n"
        "require 5 < along(ego, lead) < 30\nrequire abs(beside(ego, lead)) < 1.5\nrequire lead.speed > 2",
        f"""
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Truck' AND a.ego_distance <= 50 AND {_ON_COURSE.format(5, 30, 1.5)}
AND abs(a.relative_heading) <= radians(35) AND sqrt(a.motion_vx ** 2 + a.motion_vy ** 2) > 2""",
    ),
    "nobody on the course": _driving(
        "from scenicq.labels import along, beside, others\n"
        "require not any(0 < along(ego, c) < 30 and abs(beside(ego, c)) < 2 for c in others(Car))",
        """
SELECT frame FROM ego WHERE frame NOT IN (
    SELECT frame FROM objects a WHERE a.class = 'Car'
    AND coalesce(a.ego_along + a.ego_along_more > 0, true) AND coalesce(a.ego_along - a.ego_along_less < 30, true)
    AND coalesce(a.ego_beside + a.ego_beside_more > -2, true)
    AND coalesce(a.ego_beside - a.ego_beside_less < 2, true))""",
    ),
    "the nearest ahead": _driving(
        "from scenicq.labels import nearest\n"
        "lead = new Truck in everywhere, facing Range(-180, 180) deg\nrequire lead is nearest(Truck, ahead=True)",
        """
SELECT DISTINCT a.frame FROM objects a JOIN ego USING (frame)
WHERE a.class = 'Truck' AND a.ego_along - a.ego_along_less > 0
AND NOT EXISTS (
    SELECT 1 FROM objects b WHERE b.frame = a.frame AND b.class = 'Truck' AND b.ego_distance < a.ego_distance
    AND coalesce(b.ego_along + b.ego_along_more > 0, true))""",
    ),
    "nobody near": _driving(
        "from scenicq.labels import others\nrequire not any((distance to c) < 15 for c in others(Car))",
        """
SELECT frame FROM ego WHERE frame NOT IN (SELECT frame FROM objects a WHERE a.class = 'Car' AND a.ego_distance < 15)""",
    ),
    "three on foot": _driving(
        "from scenicq.labels import count\nrequire count(Pedestrian, within=CircularRegion(ego, 30)) >= 3",
        """
SELECT a.frame FROM objects a JOIN ego USING (frame) WHERE a.class = 'Adult' AND a.ego_distance <= 30
GROUP BY a.frame HAVING count(*) >= 3""",
    ),
    "two in one intersection": _driving(
        "one = new Car in intersection, facing Range(-180, 180) deg\n"
        "two = new Truck in intersection, facing Range(-180, 180) deg\n"
        "require network.intersectionAt(one) is network.intersectionAt(two)",
        """,
inside AS (SELECT a.frame, a.class, CASE WHEN m.distance <= 0.05 THEN m.region END AS region
           FROM objects a JOIN ego USING (frame) JOIN memberships m ON m.frame = a.frame AND m.object = a.id
           WHERE m.kind = 'intersection' AND m.distance <= 0.25)
SELECT DISTINCT a.frame FROM inside a JOIN inside b ON b.frame = a.frame AND a.region IS NOT DISTINCT FROM b.region
WHERE a.class = 'Car' AND b.class = 'Truck'""",
    ),
    "a cyclist on another's road": _driving(
        "car = new Car on road\nbike = new Bicycle in car.road, facing Range(-180, 180) deg\n"
        "require (distance from car to bike) < 10\nrequire (distance to car) < 20",
        f""",
meant(lane, region) AS (VALUES {_meant(lambda lane: [lane.road])}),
car AS (SELECT a.frame, a.x, a.y, r.region FROM objects a JOIN ego USING (frame)
        JOIN memberships m ON m.frame = a.frame AND m.object = a.id JOIN meant r ON r.lane = m.region
        WHERE a.class = 'Car' AND a.ego_distance < 20 AND along(a.heading, a.road_directions, radians(5))
        AND m.kind = 'lane' AND m.distance <= 0.05)
SELECT DISTINCT c.frame FROM car c JOIN objects b ON b.frame = c.frame
JOIN memberships m ON m.frame = b.frame AND m.object = b.id AND m.region = c.region
WHERE b.class = 'Bicycle' AND m.distance <= 0.25 AND sqrt((b.x - c.x) ** 2 + (b.y - c.y) ** 2) < 10""",
    ),
}
