"""The course of an object: the line through the centres of its track, and where others are along and beside it.

Points under `MERGED_M` apart count as one, as boxes of what stands still jitter. Beyond its ends a course goes on along
the centreline of the lane there and of those that it leads to (joining it within `JOIN_M`), and where there is none
along the heading, for `BEYOND_M`, as if it were driven at `BEYOND_MPS`. The course of what is seen at one place alone
is that of its lane, both ways.

A place is measured from its *foot*, the nearest point of the course. A course may come by a place several times: it
does so wherever it is at most `PASS_M` farther from it than at its nearest, and of these passes the one that is nearest
in time to where the object itself is counts; of those that are so but for `SOON_S`, as where lanes part, the one that
is nearest to the place. What is measured lies between two numbers, which are equal but where
several feet are equally near (between their values), and beyond the end (at least what is left).

Metres, seconds, radians. Ahead is where the object's box faces, left is positive.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree
from shapely.geometry import LineString, MultiPolygon, Polygon

from scenicq.budget import look
from scenicq.geometry import shapes
from scenicq.geometry.angles import azimuth_array, direction
from scenicq.geometry.boxes import box_polygons
from scenicq.geometry.elements import Lane
from scenicq.geometry.network import Network
from scenicq.geometry.regions import PolygonSet, PolylineSet, Region

__all__ = ["BEYOND_M", "GAP_S", "NO_COURSE", "CourseLine", "CoursePlace", "Measures", "StoredCourse", "TrackStretch",
           "lane_course", "measure", "track_courses"]  # fmt: skip

Numbers = NDArray[np.float64]
_Ends: TypeAlias = tuple[float, float, float, float]

GAP_S = 1.5
"""Seconds without a label at which a course is cut, if nothing else is said."""
BEYOND_M = 50.0
"""How far a course goes on beyond its ends."""
BEYOND_MPS = 10.0
"""How fast a course counts as driven beyond its ends."""
MERGED_M = 0.5
"""Points of a track that are nearer to each other than this count as one."""
JOIN_M = 10.0
"""Within so much of its end a course that goes on joins the centreline."""
PASS_M = 3.5
"""How much farther from a place than at its nearest a course may be to come by it."""
ALONG_RAD = math.radians(60)
"""How far the direction of a lane may be from a heading that it leads on."""
_END = ""
"""The name of the end of a course, from which others lead on."""
_EQUAL_M = 1e-6
"""Distances that differ by less are equal."""
_ONE_M = 0.01
"""Feet that are nearer to each other than this are one."""
SOON_S = 1.0
"""Passes of which one is nearer in time by less are equally near."""
_JOINT_M = 1.0
"""How far apart lanes may begin at a place for one to go on in the other."""
_KNOWN = 4096
"""Measures that are kept of a course."""
_AT_ONCE = 4_096
"""Places that are measured at once."""
_FEW = 2_000
"""Pairs of places and segments that are looked at without a search."""


@dataclass(frozen=True, slots=True)
class Measures:
    """How far places are along and beside a course: between two numbers each, shape (n,), infinite where unknown.

    Attributes:
        along: How far ahead, behind negative.
        beside: How far to the left, right negative.
        extended: Whether the course was not driven there, but goes on beyond its ends; not told of stored ends.
    """

    along: tuple[Numbers, Numbers]
    beside: tuple[Numbers, Numbers]
    extended: NDArray[np.bool_]

    def end(self, axis: int, upper: int) -> Numbers:
        """The lower (0) or upper (1) ends of what is measured along (axis 0) or beside (axis 1)."""
        return (self.beside if axis else self.along)[upper]


@dataclass(frozen=True, slots=True)
class _Piece:
    """A polyline of a course in its direction.

    Attributes:
        xy: Its points, shape (n, 2), n at least 2.
        s: How far along the course the first is.
        times: When each point was first and last passed, shape (n, 2); that of the end that it leads on from, beyond.
        open_start, open_end: Whether the course is unknown before and behind it.
        extended: Whether it was not driven.
    """

    xy: Numbers
    s: float
    times: Numbers
    open_start: bool = False
    open_end: bool = False
    extended: bool = True


class CourseLine:
    """A course as a line, cut into segments.

    Attributes:
        pieces: What it is made of.
        joints: Segments with which pieces end, each with one with which another goes on.
    """

    def __init__(self, pieces: Sequence[_Piece], joints: Sequence[tuple[int, int]]) -> None:
        """Take the pieces, and pairs of them of which the second goes on where the first ends."""
        self.pieces = tuple(pieces)
        firsts = np.cumsum([0, *(len(each.xy) - 1 for each in pieces)]).tolist()
        self.joints = [(firsts[one + 1] - 1, firsts[other]) for one, other in joints]
        self._corridors: dict[float, PolygonSet] = {}
        self._known: dict[tuple[float, ...], tuple[float, ...]] = {}
        self.start = np.concatenate([each.xy[:-1] for each in pieces])
        self.step = np.concatenate([np.diff(each.xy, axis=0) for each in pieces])
        self.length = np.hypot(*self.step.T)
        lengths = [np.hypot(*np.diff(each.xy, axis=0).T) for each in pieces]
        self.s = np.concatenate(
            [each.s + np.concatenate(([0.0], np.cumsum(mine)[:-1])) for each, mine in zip(pieces, lengths, strict=True)]
        )
        self.begins = np.concatenate([each.times[:-1] for each in pieces])
        self.ends = np.concatenate([each.times[1:] for each in pieces])
        self.linked = np.concatenate([np.arange(len(mine)) > 0 for mine in lengths])
        sized = [(each, len(each.xy) - 1) for each in pieces]
        self.open_start = np.concatenate([_at(0, size, each.open_start) for each, size in sized])
        self.open_end = np.concatenate([_at(-1, size, each.open_end) for each, size in sized])
        self.extended = np.concatenate([np.full(size, each.extended) for each, size in sized])

    @cached_property
    def tree(self) -> STRtree:
        """Its segments by place."""
        ends = np.stack((self.start, self.start + self.step), axis=1)
        return STRtree(shapes.segments(ends))

    @cached_property
    def region(self) -> PolylineSet:
        """The line as a region."""
        return PolylineSet(tuple(LineString(each.xy) for each in self.pieces), "the course")

    def measure(self, asked: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
        """How far places are along and beside the line; the same question is answered once.

        Args:
            asked: How far along the object is, when, which way it faces, and x and y of the place.

        Returns:
            The ends of both (`CoursePlace.ends`), and 1 where the place is beyond what was driven.
        """
        known = {each: self._known[each] for each in asked if each in self._known}
        new = [each for each in dict.fromkeys(asked) if each not in known]
        if new:
            numbers = np.array(new)
            ends, extended = _of_line(self, numbers[:, :3], numbers[:, 3:])
            rows: list[list[float]] = np.column_stack((ends, extended)).tolist()
            found = {each: (*row,) for each, row in zip(new, rows, strict=True)}
            known |= found
            if len(new) <= _KNOWN:
                if len(self._known) + len(new) > _KNOWN:
                    self._known.clear()
                self._known |= found
        return [known[each] for each in asked]

    def within(self, half_width: float) -> Region:
        """What lies within so many metres of the line."""
        if half_width == 0:
            return self.region
        if half_width not in self._corridors:
            whole = shapes.union_all([shapes.round_band(each, half_width) for each in self.region.lines])
            self._corridors[half_width] = PolygonSet((cast("Polygon | MultiPolygon", whole),), "the corridor")
        return self._corridors[half_width]


def _at(place: int, size: int, value: bool) -> NDArray[np.bool_]:
    found = np.zeros(size, np.bool_)
    found[place] = value
    return found


@dataclass(frozen=True, eq=False)
class TrackStretch:
    """The samples of a track without gaps.

    Attributes:
        times_s: When they are, in order, shape (n,).
        places: x, y, heading, width, length and jerk of each, nan where they are not known, shape (n, 6).
        directions: Which way the course goes at each, without jumps of a full turn; shape (0,) of what stands still.
    """

    times_s: Numbers
    places: Numbers
    directions: Numbers

    @property
    def jerks(self) -> Numbers:
        """The slope of the acceleration at each sample."""
        return self.places[:, 5]

    @cached_property
    def is_boxed(self) -> NDArray[np.bool_]:
        """At which samples the box is known."""
        return cast("NDArray[np.bool_]", ~np.isnan(self.places[:, :5]).any(axis=1))

    @cached_property
    def boxes(self) -> NDArray[np.object_]:
        """The boxes that are known."""
        return box_polygons(*self.places[self.is_boxed, :5].T)


@dataclass(frozen=True, slots=True, eq=False)
class CoursePlace:
    """The course of an object with where on it the object is at one time.

    Attributes:
        line: The course; None where nothing tells it.
        s: How far along it the object is.
        time_s: When.
        sign: -1 where the box faces against the course, as while the object reverses; else 1.
        stretch: What was seen of the object; None where nothing but one label is known.
        sample: Which of these samples it is.
    """

    line: CourseLine | None
    s: float = 0.0
    time_s: float = 0.0
    sign: float = 1.0
    stretch: TrackStretch | None = None
    sample: int = 0

    def stored_ends(self, _x: float, _y: float) -> _Ends | None:
        """The ends that are known of a place without the line."""
        return None

    def ends(self, x: float, y: float) -> _Ends:
        """The ends between which a place is along and beside the course; the same question is answered once."""
        if self.line is None:
            return -math.inf, math.inf, -math.inf, math.inf
        (found,) = self.line.measure([(self.s, self.time_s, self.sign, x, y)])
        return found[0], found[1], found[2], found[3]


NO_COURSE = CoursePlace(None)


class StoredCourse(CoursePlace):
    """A course of which it is known where some places are; the line is made when something else is asked."""

    def __init__(
        self, known: Callable[[], Mapping[tuple[float, float], _Ends]], make: Callable[[], CoursePlace]
    ) -> None:
        """Take what tells the ends of the places that are known, and what makes the course."""
        vars(self).update(_tell=known, _make=make)

    @cached_property
    def _known(self) -> Mapping[tuple[float, float], _Ends]:
        tell: Callable[[], Mapping[tuple[float, float], _Ends]] = vars(self)["_tell"]
        return tell()

    @cached_property
    def _made(self) -> CoursePlace:
        make: Callable[[], CoursePlace] = vars(self)["_make"]
        return make()

    def stored_ends(self, x: float, y: float) -> _Ends | None:
        """The ends that are known of a place without the line."""
        return self._known.get((x, y))

    @property
    def line(self) -> CourseLine | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As of any course."""
        return self._made.line

    @property
    def s(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As of any course."""
        return self._made.s

    @property
    def time_s(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As of any course."""
        return self._made.time_s

    @property
    def sign(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As of any course."""
        return self._made.sign

    @property
    def stretch(self) -> TrackStretch | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As of any course."""
        return self._made.stretch

    @property
    def sample(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As of any course."""
        return self._made.sample

    def ends(self, x: float, y: float) -> _Ends:
        """As of any course."""
        return self.stored_ends(x, y) or self._made.ends(x, y)


def measure(courses: Sequence[CoursePlace], xy: Numbers) -> Measures:
    """How far places are along and beside courses, place by place.

    Args:
        courses: The course of each place.
        xy: The places, shape (n, 2).
    """
    unknown = (-math.inf, math.inf, -math.inf, math.inf, 0.0)
    found: list[tuple[float, ...]] = [unknown] * len(courses)
    by_line: dict[int, list[int]] = {}
    places = xy.tolist()
    for number, each in enumerate(courses):
        stored = each.stored_ends(*places[number])
        if stored is not None:
            found[number] = (*stored, 0.0)
        elif each.line is not None:
            by_line.setdefault(id(each.line), []).append(number)
    for numbers in by_line.values():
        line = cast(CourseLine, courses[numbers[0]].line)
        for first in range(0, len(numbers), _AT_ONCE):
            look()
            some = numbers[first : first + _AT_ONCE]
            mine = [(courses[each], places[each]) for each in some]
            asked = [(each.s, each.time_s, each.sign, *place) for each, place in mine]
            for number, measured in zip(some, line.measure(asked), strict=True):
                found[number] = measured
    low, high, right, left, extended = np.array(found).reshape(-1, 5).T
    return Measures((low, high), (right, left), extended > 0)


def _of_line(line: CourseLine, own: Numbers, xy: Numbers) -> tuple[Numbers, NDArray[np.bool_]]:
    """The ends of `along` and `beside` of places by one line, shape (n, 4), and which are beyond what was driven.

    Args:
        line: The line.
        own: Where the object is, when, and which way it faces, shape (n, 3).
        xy: The places, shape (n, 2).
    """
    near = _Segments(line, xy)
    passes = near.passes(line.joints)
    # of each pass what is nearest, of these the passes that are soonest, and of these what is nearest
    feet = np.flatnonzero(near.away <= _least(near.away, passes)[passes] + _EQUAL_M)
    row, segment = near.row[feet], near.segment[feet]
    part, raw, away = (each[feet] for each in (near.part, near.raw, near.away))
    late = _time_apart(line, segment, part, own[row, 1])
    soon = np.unique(passes[feet][late <= _least(late, row)[row] + SOON_S])
    mine = np.isin(passes[feet], soon)
    mine &= away <= _least(np.where(mine, away, np.inf), row)[row] + _EQUAL_M
    row, segment = row[mine], segment[mine]
    part, raw, away = (each[mine] for each in (part, raw, away))

    sign = own[row, 2]
    ahead = (line.s[segment] + part * line.length[segment] - own[row, 0]) * sign
    to, step = xy[row] - line.start[segment], line.step[segment]
    left = np.copysign(away, step[:, 0] * to[:, 1] - step[:, 1] * to[:, 0]) * sign
    beyond = line.open_end[segment] & (raw > 1 + 1e-12)
    before = line.open_start[segment] & (raw < -1e-12)
    outside = beyond | before
    forth, back = outside & ((sign > 0) == beyond), outside & ((sign > 0) == before)
    low, high = np.where(back, -np.inf, ahead), np.where(forth, np.inf, ahead)
    right, left = np.where(outside, -np.inf, left), np.where(outside, np.inf, left)
    starts = np.searchsorted(row, np.arange(len(xy)))
    found = np.column_stack([
        np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts),
        np.minimum.reduceat(right, starts), np.maximum.reduceat(left, starts),
    ])  # fmt: skip
    # feet on both sides of a corner are one
    for start in (0, 2):
        same = found[:, start + 1] - found[:, start] <= _ONE_M
        found[same, start + 1] = found[same, start]
    return found, np.logical_or.reduceat(line.extended[segment], starts)


class _Segments:
    """The segments by which a line comes by places: those at most `PASS_M` farther from one than the nearest is.

    Attributes:
        row, segment: Pairs of the number of a place, ascending, and of a segment, ascending; shape (k,).
        raw: How far along its segment the foot of a place would be on its line, as a share.
        part: The same within the segment.
        away: How far the place is from the segment.
        reached: Whether the place is as near to where the segment begins as segments may be.
    """

    def __init__(self, line: CourseLine, xy: Numbers) -> None:
        """Find the segments of a line that are near places (n, 2)."""
        self._count = len(line.s)
        keys = np.arange(len(xy) * self._count) if len(xy) * self._count <= _FEW else self._around(line, xy)
        row, segment = keys // self._count, keys % self._count
        to, step = (xy[row] - line.start[segment]).T, line.step[segment].T
        raw = (to[0] * step[0] + to[1] * step[1]) / line.length[segment] ** 2
        part = np.clip(raw, 0.0, 1.0)
        away = np.hypot(to[0] - part * step[0], to[1] - part * step[1])
        reach = np.minimum.reduceat(away, np.searchsorted(row, np.arange(len(xy)))) + PASS_M
        reached = np.hypot(*to) <= reach[row]
        active = away <= reach[row]
        self._keys, self.row, self.segment = (each[active] for each in (keys, row, segment))
        self.raw, self.part, self.away = (each[active] for each in (raw, part, away))
        self.reached = reached[active]
        # a pass goes on from segment to segment where the corner between them is within reach, too
        self._goes_on = np.zeros(len(self.row), np.bool_)
        follows = (self._keys[1:] == self._keys[:-1] + 1) & line.linked[self.segment[1:]]
        self._goes_on[1:] = follows & self.reached[1:]

    def _around(self, line: CourseLine, xy: Numbers) -> NDArray[np.intp]:
        """The pairs that the search tree finds, as numbers in order."""
        points = shapes.points(xy)
        reach = shapes.tree_distances(line.tree, points) + PASS_M
        row, segment = shapes.tree_pairs_within(line.tree, points, reach + _EQUAL_M)
        return np.sort(row * self._count + segment)

    def passes(self, joints: Sequence[tuple[int, int]]) -> NDArray[np.intp]:
        """The number of the pass of each pair; joints are segments that end where others begin."""
        found = np.cumsum(~self._goes_on) - 1
        for end, start in joints:
            begins = np.flatnonzero((self.segment == start) & self.reached)
            ends = self._keys[begins] - start + end
            place = np.minimum(np.searchsorted(self._keys, ends), len(self._keys) - 1)
            there = self._keys[place] == ends
            one, other = found[place[there]], found[begins[there]]
            if np.any(one != other):
                renamed = np.arange(len(found))
                renamed[other] = one
                found = renamed[found]
        return found


def _least(values: Numbers, group: NDArray[np.intp]) -> Numbers:
    """The least value of each of some groups, which are numbered below the number of values."""
    least = np.full(len(values), np.inf)
    np.minimum.at(least, group, values)
    return least


def _time_apart(line: CourseLine, segment: NDArray[np.intp], part: Numbers, time: Numbers) -> Numbers:
    """Seconds between times and when the object was at points of segments, shape (k,); 0 while it stood there."""
    begins, ends = line.begins[segment], line.ends[segment]
    inside = begins[:, 1] + part * (ends[:, 0] - begins[:, 1])
    low = np.where(part <= 0, begins[:, 0], np.where(part >= 1, ends[:, 0], inside))
    high = np.where(part <= 0, begins[:, 1], np.where(part >= 1, ends[:, 1], inside))
    return np.maximum(np.maximum(low - time, time - high), 0.0)


def lane_course(network: Network, x: float, y: float, heading: float | None) -> CoursePlace:
    """The course of what is seen at one place alone: that of its lane.

    Args:
        network: The map.
        x: The place.
        y: The place.
        heading: The box's; None if it is not known.
    """
    numbers = np.array([[x, y, math.nan if heading is None else heading]])
    return track_courses(network, np.zeros(1), numbers, math.inf)[0]


def track_courses(network: Network, times_s: Numbers, places: Numbers, gap_s: float) -> list[CoursePlace]:
    """The course of an object at each sample of its track.

    Args:
        network: The map.
        times_s: When the samples are, in order, shape (n,).
        places: x, y and heading of each, the heading nan where it is not known, shape (n, 3); with what else a
            `TrackStretch` has of them, shape (n, 6).
        gap_s: Between samples farther apart than this the course is cut.
    """
    if not len(times_s):
        return []
    cuts = np.flatnonzero(np.diff(times_s) > gap_s) + 1
    found: list[CoursePlace] = []
    for first, end in pairwise([0, *cuts.tolist(), len(times_s)]):
        look()
        found += _stretch(network, times_s[first:end], places[first:end])
    return found


def _stretch(network: Network, times: Numbers, places: Numbers) -> list[CoursePlace]:
    """The courses at the samples of a track without gaps."""
    xy, headings = places[:, :2], places[:, 2]
    firsts, which = _merged(xy)
    corners = xy[firsts]
    if len(firsts) == 1:
        stretch = TrackStretch(times, places, np.empty(0)) if places.shape[1] > 3 else None
        return [
            replace(each, stretch=stretch, sample=number)
            for number, each in enumerate(_of_one_place(network, times, places))
        ]
    lasts = np.append(np.array(firsts[1:]) - 1, len(xy) - 1)
    steps = np.diff(corners, axis=0)
    lengths = np.hypot(*steps.T)
    starts = np.concatenate(([0.0], np.cumsum(lengths)))
    own = _Piece(corners, 0.0, np.column_stack([times[firsts], times[lasts]]), extended=False)
    ends = (
        (corners[-1], steps[-1] / lengths[-1], float(headings[-1]), float(times[-1])),
        (corners[0], -steps[0] / lengths[0], float(headings[0]), float(times[0])),
    )
    onwards = _onwards(network, *ends[0][:3], join=True)
    back = _onwards(network, *ends[1][:3], join=True)
    pieces = [own, *(_forward(each, float(starts[-1]), ends[0][3]) for each in onwards),
              *(_backward(each, ends[1][3]) for each in back)]  # fmt: skip
    ahead, behind = _links(onwards, 1), _links(back, 1 + len(onwards))
    joints = [(0 if one is None else one, other) for one, other in ahead]
    joints += [(other, 0 if one is None else one) for one, other in behind]
    line = CourseLine(pieces, joints)
    found: list[CoursePlace] = []
    segments: list[int] = []
    for number, corner in enumerate(which):
        best: tuple[float, int, float] | None = None
        for segment in (corner, corner - 1):  # of equals the one that it drives on
            if 0 <= segment < len(steps):
                to = xy[number] - corners[segment]
                part = float(to @ steps[segment]) / lengths[segment] ** 2
                low = -math.inf if segment == 0 else 0.0
                high = math.inf if segment == len(steps) - 1 else 1.0
                part = min(max(part, low), high)
                away = float(np.hypot(*(to - part * steps[segment])))
                if best is None or away < best[0] - _EQUAL_M:
                    best = away, segment, part
        assert best is not None
        _, segment, part = best
        faces = direction(float(headings[number]))
        against = float(steps[segment] @ np.array(faces)) < 0
        s = float(starts[segment] + part * lengths[segment])
        found.append(CoursePlace(line, s, float(times[number]), -1.0 if against else 1.0))
        segments.append(segment)
    if places.shape[1] == 3:
        return found
    stretch = TrackStretch(times, places, np.unwrap(azimuth_array(*steps.T))[segments])
    return [replace(each, stretch=stretch, sample=number) for number, each in enumerate(found)]


def _merged(xy: Numbers) -> tuple[list[int], list[int]]:
    """The samples with which points of a course begin, and by sample the number of its point."""
    firsts, which = [0], [0]
    for number in range(1, len(xy)):
        if np.hypot(*(xy[number] - xy[firsts[-1]])) >= MERGED_M:
            firsts.append(number)
        which.append(len(firsts) - 1)
    return firsts, which


def _of_one_place(network: Network, times: Numbers, places: Numbers) -> list[CoursePlace]:
    """The courses at the samples of what stands at one place."""
    known = places[~np.isnan(places[:, 2])]
    if not len(known):
        return [NO_COURSE] * len(times)
    corner, heading = places[0, :2], float(known[0, 2])
    faces = np.array(direction(heading))
    onwards = _onwards(network, corner, faces, heading, join=False)
    back = _onwards(network, corner, -faces, heading, join=False)
    pieces = [*(_forward(each, 0.0, float(times[-1])) for each in onwards),
              *(_backward(each, float(times[0])) for each in back)]  # fmt: skip
    ahead, behind = _links(onwards, 0), _links(back, len(onwards))
    joints = [(one, other) for one, other in ahead if one is not None]
    joints += [(other, one) for one, other in behind if one is not None]
    firsts, lasts = ([other for one, other in links if one is None] for links in (ahead, behind))
    joints += [(last, first) for last in lasts for first in firsts
               if np.hypot(*(pieces[last].xy[-1] - pieces[first].xy[0])) <= _JOINT_M]  # fmt: skip
    line = CourseLine(pieces, joints)
    return [
        CoursePlace(line, float((places[number, :2] - corner) @ faces), float(time))
        for number, time in enumerate(times.tolist())
    ]


@dataclass(frozen=True, slots=True)
class _Onward:
    """A polyline that leads away from an end of a course.

    Attributes:
        xy: Its points, shape (n, 2).
        far: How far from the end it begins.
        is_last: Whether the course ends with it.
        name: The lane that it follows.
        after: The names of what it goes on from.
    """

    xy: Numbers
    far: float
    is_last: bool
    name: str = ""
    after: Sequence[str] = (_END,)


def _links(onwards: Sequence[_Onward], first: int) -> list[tuple[int | None, int]]:
    """Which of some polylines leads to which, by numbers from a first one on; None for the end of the course."""
    number = {each.name: first + place for place, each in enumerate(onwards)}
    return [
        (None if name == _END else number[name], first + place)
        for place, each in enumerate(onwards)
        for name in each.after
        if name == _END or name in number
    ]


def _forward(each: _Onward, s: float, time: float) -> _Piece:
    when = time + (each.far + _lengths(each.xy)) / BEYOND_MPS
    return _Piece(each.xy, s + each.far, np.column_stack([when, when]), open_end=each.is_last)


def _backward(each: _Onward, time: float) -> _Piece:
    lengths = _lengths(each.xy)
    when = (time - (each.far + lengths) / BEYOND_MPS)[::-1]
    s = -each.far - float(lengths[-1])
    return _Piece(each.xy[::-1], s, np.column_stack([when, when]), open_start=each.is_last)


def _lengths(line: Numbers) -> Numbers:
    """How far along a polyline its points are."""
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))


def _onwards(network: Network, end: Numbers, outward: Numbers, heading: float, *, join: bool) -> list[_Onward]:
    """How a course goes on beyond an end.

    Args:
        network: The map.
        end: The end, shape (2,).
        outward: The direction in which the course leaves it, of length 1.
        heading: That of the box there; nan where it is not known.
        join: Whether the course goes over from the end to the centreline; else it begins on it.
    """
    ways: list[bool] = []
    faces = outward if math.isnan(heading) else np.array(direction(heading))
    starts: list[tuple[Lane, Numbers, Numbers | None]] = []
    for lane in network.lanesAt(float(end[0]), float(end[1])):
        line = _centreline(lane)
        if line is None:
            continue
        segment, part = _foot(line, end)
        step = line[segment + 1] - line[segment]
        if float(step @ faces) < math.cos(ALONG_RAD) * float(np.hypot(*step)):
            continue
        foot = line[segment] + part * step
        forward = float(step @ outward) >= 0
        rest = [foot, *line[segment + 1 :]] if forward else [foot, *line[segment::-1]]
        starts.append((lane, _without_equals(np.array(rest)), end - foot if join else None))
        ways.append(forward)
    found = [each for way in (True, False) for each in _along_lanes(
        [start for start, forward in zip(starts, ways, strict=True) if forward is way], forward=way
    )]  # fmt: skip
    if not found:
        ahead = outward if float(faces @ outward) == 0 else faces * math.copysign(1.0, float(faces @ outward))
        found = [_Onward(np.array([end, end + BEYOND_M * ahead]), 0.0, is_last=True)]
    return found


def _along_lanes(starts: Sequence[tuple[Lane, Numbers, Numbers | None]], *, forward: bool) -> list[_Onward]:
    """The rests of lanes and the lanes that they lead to (or that lead to them), each once, by its nearest beginning.

    Args:
        starts: The lanes, with what is left of their centrelines and from how far beside these the course comes.
        forward: Whether it goes on in the direction of travel.
    """
    found: list[_Onward] = []
    begins = {lane.id: 0.0 for lane, _, _ in starts}
    # the lanes that each is led to by; of starts the end itself
    after: dict[str, list[str]] = {lane.id: [_END] for lane, _, _ in starts}
    waiting = [(0.0, number, *start) for number, start in enumerate(starts)]
    count = len(starts)
    while waiting:
        far, _, now, line, aside = heapq.heappop(waiting)
        if far > begins[now.id]:
            continue
        own = _cut(line, BEYOND_M - far)
        end = far + float(_lengths(line)[-1])
        following = (now.successors if forward else now.predecessors) if end < BEYOND_M else ()
        leads_on = False
        for each in following:
            others = _centreline(each)
            if others is None:
                continue
            leads_on = True
            after.setdefault(each.id, []).append(now.id if len(line) > 1 else _END)
            if end < begins.get(each.id, math.inf):
                begins[each.id] = end
                count += 1
                heapq.heappush(waiting, (end, count, each, others if forward else others[::-1], aside))
        if end < BEYOND_M and not leads_on and len(line) > 1:
            # the map ends here
            last = line[-1] - line[-2]
            own = np.vstack([line, line[-1] + (BEYOND_M - end) * last / np.hypot(*last)])
        if len(own) > 1:
            xy = own if aside is None else _joined(own, far, aside)
            found.append(_Onward(xy, far, not leads_on, now.id, after[now.id]))
    return found


def _joined(line: Numbers, far: float, aside: Numbers) -> Numbers:
    """A part of a course that comes from beside the centreline and joins it."""
    if far >= JOIN_M:
        return line
    lengths = _lengths(line)
    # between corners of the centreline it comes nearer evenly
    at = np.union1d(lengths, [JOIN_M - far]) if JOIN_M - far < lengths[-1] else lengths
    points = np.column_stack([np.interp(at, lengths, line[:, axis]) for axis in (0, 1)])
    return _without_equals(points + np.maximum(0.0, 1.0 - (at + far) / JOIN_M)[:, None] * aside)


def _cut(line: Numbers, length: float) -> Numbers:
    """The beginning of a polyline."""
    lengths = _lengths(line)
    if lengths[-1] <= length:
        return line
    kept = int(np.searchsorted(lengths, length, side="left"))
    end = [np.interp(length, lengths, line[:, axis]) for axis in (0, 1)]
    return _without_equals(np.vstack([line[:kept], end]))


def _centreline(lane: Lane) -> Numbers | None:
    """The points of a lane's centreline in the direction of travel; None where the map gives none."""
    if lane.centerline is None:
        return None
    points = np.vstack([shapes.coordinates(each) for each in lane.centerline.lines])
    line = _without_equals(points)
    return line if len(line) > 1 else None


def _without_equals(line: Numbers) -> Numbers:
    differs = np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-9) if len(line) > 1 else np.ones(1, np.bool_)
    return line[differs]


def _foot(line: Numbers, place: Numbers) -> tuple[int, float]:
    """The segment of a polyline that is nearest to a place, and where on it."""
    steps = np.diff(line, axis=0)
    to = place - line[:-1]
    part = np.clip((to * steps).sum(axis=1) / (steps**2).sum(axis=1), 0.0, 1.0)
    segment = int(np.argmin(np.hypot(*(to - part[:, None] * steps).T)))
    return segment, float(part[segment])
