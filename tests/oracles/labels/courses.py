"""The course of an object by its definition, as points two centimetres apart: shares no code with what it judges.

A course is a graph of points: each knows how far along it is, when it was passed, and its neighbours. Passes are
connected parts, feet are points that are nearer than their neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from shapely import Point
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

STEP = 0.02
BEYOND, MERGED, JOIN, PASS, SOON = 50.0, 0.5, 10.0, 3.5, 1.0
XY = tuple[float, float]


@dataclass
class Spot:
    """A point of a course."""

    at: XY
    s: float
    first: float
    last: float
    driven: bool
    ends: int = 0
    """1 where the course is not known any farther, -1 where it is not known before."""
    near: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class RawLane:
    """A lane as the map has it."""

    area: BaseGeometry
    line: LineString
    after: tuple[str, ...]
    before: tuple[str, ...]


Lanes = Mapping[str, RawLane]
Sample = tuple[float, float, float, float | None]
"""Seconds, x, y, heading."""


def lanes_of(features: Sequence[Any]) -> dict[str, RawLane]:
    """The lanes of a map's elements; which lead to which either of both may say."""
    raw = {each.id: each for each in features if each.kind == "lane" and "centerline" in each.properties}
    after: dict[str, list[str]] = {name: [] for name in raw}
    before: dict[str, list[str]] = {name: [] for name in raw}
    for name, each in raw.items():
        pairs = [(name, other) for other in each.properties.get("successors", ())]
        pairs += [(other, name) for other in each.properties.get("predecessors", ())]
        for one, other in pairs:
            if one in raw and other in raw and other not in after[one]:
                after[one].append(other)
                before[other].append(one)
    return {
        name: RawLane(
            each.shape, LineString([xy for part in each.properties["centerline"] for xy in part]),
            tuple(after[name]), tuple(before[name]),
        )
        for name, each in raw.items()
    }  # fmt: skip


def faces(heading: float) -> XY:
    return -math.sin(heading), math.cos(heading)


def dot(a: XY, b: XY) -> float:
    return a[0] * b[0] + a[1] * b[1]


def less(a: XY, b: XY) -> XY:
    return a[0] - b[0], a[1] - b[1]


class Course:
    """The course of a track about one of its samples, and where on it the object is then."""

    def __init__(self, samples: Sequence[Sample], number: int, lanes: Lanes, gap: float) -> None:
        first = number
        while first and samples[first][0] - samples[first - 1][0] <= gap:
            first -= 1
        end = number + 1
        while end < len(samples) and samples[end][0] - samples[end - 1][0] <= gap:
            end += 1
        self.spots: list[Spot] = []
        self.lanes = lanes
        self.track = list(samples[first:end])
        self.own = number - first
        self.time = samples[number][0]
        self.known = self._make()

    def _line(self, points: Sequence[XY], s: float, times: Sequence[tuple[float, float]], driven: bool) -> list[int]:
        """Spots along a polyline, from its first point to its last."""
        made: list[int] = []
        for (one, other), (before, after) in zip(pairwise(points), pairwise(times), strict=True):
            length = math.dist(one, other)
            count = max(1, round(length / STEP))
            for k in range(count + 1):
                if k == 0 and made:
                    continue
                part = k / count
                time = before[1] + part * (after[0] - before[1])
                first, last = (time, time) if 0 < part < 1 else before if part == 0 else after
                at = one[0] + part * (other[0] - one[0]), one[1] + part * (other[1] - one[1])
                self.spots.append(Spot(at, s + part * length, first, last, driven))
                made.append(len(self.spots) - 1)
            s += length
        for a, b in pairwise(made):
            self._tie(a, b)
        return made

    def _tie(self, a: int, b: int) -> None:
        self.spots[a].near.append(b)
        self.spots[b].near.append(a)

    def _make(self) -> bool:
        corners, spans = [0], []
        which = [0]
        for k, (_, x, y, _) in enumerate(self.track[1:], 1):
            if math.dist((x, y), self.track[corners[-1]][1:3]) >= MERGED:
                corners.append(k)
            which.append(len(corners) - 1)
        points = [self.track[k][1:3] for k in corners]
        for k in range(len(corners)):
            mine = [self.track[n][0] for n, c in enumerate(which) if c == k]
            spans.append((mine[0], mine[-1]))
        now = self.track[self.own]
        if len(points) == 1:
            headings = [each[3] for each in self.track if each[3] is not None]
            if not headings:
                return False
            self.sign, forth = 1.0, faces(headings[0])
            self.s = dot(less(now[1:3], points[0]), forth)
            until, since = self.track[-1][0], self.track[0][0]
            heads = self._beyond(points[0], forth, headings[0], until, 0.0, +1, None, join=False)
            tails = self._beyond(points[0], (-forth[0], -forth[1]), headings[0], since, 0.0, -1, None, join=False)
            for a in heads:
                for b in tails:
                    if math.dist(self.spots[a].at, self.spots[b].at) < 1:
                        self._tie(a, b)
            return True
        own = self._line(points, 0.0, spans, driven=True)
        # where the object is: beside the corner that it is at, on the parts before and behind that
        corner = which[self.own]
        best = None
        lengths = [math.dist(a, b) for a, b in pairwise(points)]
        for part in (corner, corner - 1):
            if not 0 <= part < len(lengths):
                continue
            a, b = points[part], points[part + 1]
            along = less(b, a)
            raw = dot(less(now[1:3], a), along) / lengths[part] ** 2
            raw = max(raw, 0) if part else raw
            raw = min(raw, 1) if part < len(lengths) - 1 else raw
            off = math.dist(now[1:3], (a[0] + raw * along[0], a[1] + raw * along[1]))
            if best is None or off < best[0] - 1e-6:
                best = off, sum(lengths[:part]) + raw * lengths[part], along
        _, self.s, along = best
        self.sign = -1.0 if now[3] is not None and dot(along, faces(now[3])) < 0 else 1.0
        last, start = less(points[-1], points[-2]), less(points[0], points[1])
        ends = self.track[-1], self.track[0]
        self._beyond(points[-1], last, ends[0][3], ends[0][0], sum(lengths), +1, own[-1], join=True)
        self._beyond(points[0], start, ends[1][3], ends[1][0], 0.0, -1, own[0], join=True)
        return True

    def _beyond(
        self, end: XY, out: XY, heading: float | None, time: float, s: float, way: int, tied: int | None,
        *, join: bool,
    ) -> list[int]:  # fmt: skip
        """What follows beyond an end; the first spots of it."""
        size = math.hypot(*out)
        out = out[0] / size, out[1] / size
        ahead = out if heading is None else faces(heading)
        heads: list[int] = []
        starts: dict[bool, list[tuple[float, str, float, XY, int | None]]] = {True: [], False: []}
        here = Point(end)
        near = [name for name, lane in self.lanes.items() if lane.area.distance(here) <= 1e-9]
        near = near or [name for name, lane in self.lanes.items() if lane.area.distance(here) <= 0.05]
        for name in near:
            line = self.lanes[name].line
            at = line.project(here)
            parts = [LineString(pair) for pair in pairwise(line.coords)]
            # at a corner the part that comes first counts
            nearest = min(parts, key=lambda part: round(part.distance(here), 9))
            course = less(nearest.coords[1], nearest.coords[0])
            if dot(course, ahead) < 0.5 * math.hypot(*course):
                continue
            foot = line.interpolate(at)
            aside = less(end, (foot.x, foot.y)) if join else (0.0, 0.0)
            starts[dot(course, out) >= 0].append((0.0, name, at, aside, tied))
        for forward in (True, False):
            heads += self._lanes(starts[forward], forward, time, s, way)
        if not heads:
            flip = -1 if dot(ahead, out) < 0 else 1
            stop = end[0] + flip * BEYOND * ahead[0], end[1] + flip * BEYOND * ahead[1]
            heads.append(self._outward([end, stop], s, 0.0, time, way, tied, ends=True)[0])
        return heads

    def _outward(
        self, points: Sequence[XY], s: float, far: float, time: float, way: int, tied: int | None, *, ends: bool
    ) -> list[int]:  # fmt: skip
        made = self._line(points, far, [(time, time)] * len(points), driven=False)
        for each in made:
            # as if at ten metres a second
            self.spots[each].first = self.spots[each].last = time + way * self.spots[each].s / 10
            self.spots[each].s = s + way * self.spots[each].s
        if tied is not None:
            self._tie(tied, made[0])
        if ends:
            self.spots[made[-1]].ends = way
        return made

    def _lanes(
        self, waiting: list[tuple[float, str, float, XY, int | None]], forward: bool, time: float, s: float, way: int
    ) -> list[int]:
        done: set[str] = set()
        first: dict[str, int] = {}
        heads: list[int] = []
        while waiting:
            waiting.sort(key=lambda each: each[0])
            far, now, at, aside, tied = waiting.pop(0)
            if now in done:
                # another way has led here before
                if tied is not None and now in first:
                    self._tie(tied, first[now])
                continue
            done.add(now)
            lane = self.lanes[now]
            rest = lane.line.length - at if forward else at
            others = (lane.after if forward else lane.before) if far + rest < BEYOND else ()
            is_last = not others
            whole = BEYOND - far if is_last else rest
            if rest <= 1e-9:
                whole = 0.0
            places = [k * whole / 800 for k in range(801)] if whole > 1e-9 else []
            spots = [self._at(lane.line, at + d if forward else at - d) for d in places]
            fade = [max(0.0, 1 - (far + d) / JOIN) for d in places]
            points = [(x + f * aside[0], y + f * aside[1]) for (x, y), f in zip(spots, fade, strict=True)]
            if len(points) > 1:
                made = self._outward(points, s, far, time, way, tied, ends=is_last)
                heads += [made[0]] if far == 0 else []
                first[now] = made[0]
                tied = made[-1]
            for each in others:
                waiting.append((far + rest, each, 0.0 if forward else self.lanes[each].line.length, aside, tied))
        return heads

    @staticmethod
    def _at(line: LineString, far: float) -> XY:
        """A point of a line, or of what goes on straight where it ends."""
        known = line.interpolate(min(max(far, 0.0), line.length))
        a, b = line.coords[:2] if far < 0 else line.coords[-2:]
        more = (min(far, 0.0) + max(far - line.length, 0.0)) / math.dist(a, b)
        return known.x + more * (b[0] - a[0]), known.y + more * (b[1] - a[1])

    def plausible(self, place: XY, slack: float = 0.03) -> list[tuple[float, float | None, int]]:
        """Where a place may be: along, beside (None where unknown), and 1 or -1 where it is at least or at most that.

        One, but where two passes or feet are equal but for some centimetres.
        """
        away = [math.dist(each.at, place) for each in self.spots]
        found: dict[tuple[int, float], tuple[float, float | None, int]] = {}
        for reach in (min(away) + PASS - slack, min(away) + PASS + slack):
            passes: list[list[int]] = []
            seen: set[int] = set()
            for start in range(len(away)):
                if start in seen or away[start] > reach:
                    continue
                part, todo = [], [start]
                seen.add(start)
                while todo:
                    k = todo.pop()
                    part.append(k)
                    for other in self.spots[k].near:
                        if other not in seen and away[other] <= reach:
                            seen.add(other)
                            todo.append(other)
                passes.append(part)

            def late(k: int) -> float:
                return max(self.spots[k].first - self.time, self.time - self.spots[k].last, 0.0)

            lateness = []
            for part in passes:
                nearest = min(away[k] for k in part)
                lateness.append(min(late(k) for k in part if away[k] <= nearest + 1e-9))
            timely = [part for part, each in zip(passes, lateness, strict=True) if each <= min(lateness) + SOON + slack]
            sure = [part for part, each in zip(passes, lateness, strict=True) if each <= min(lateness) + SOON - slack]
            best = min(min(away[k] for k in part) for part in sure)
            for part in timely:
                for k in part:
                    low = all(away[k] <= away[other] for other in self.spots[k].near)
                    if low and away[k] <= best + slack:
                        # at a sharp corner a place may be on either side
                        for other in self.spots[k].near:
                            value = self._value(k, other, place)
                            found[k, math.copysign(1.0, value[1] or 0.0)] = value
        return list(found.values())

    def _value(self, k: int, neighbour: int, place: XY) -> tuple[float, float | None, int]:
        spot = self.spots[k]
        other = self.spots[neighbour]
        step = less(other.at, spot.at)
        forth = step if other.s > spot.s else (-step[0], -step[1])
        to = less(place, spot.at)
        outward = dot(forth, to) * (spot.ends or 1)
        side = math.hypot(*to) * (1 if forth[0] * to[1] - forth[1] * to[0] > 0 else -1)
        beyond = spot.ends and outward > 0.05 * math.hypot(*forth)
        sign = self.sign
        return (spot.s - self.s) * sign, None if beyond else side * sign, int(spot.ends * sign) if beyond else 0
