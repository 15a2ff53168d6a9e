"""Measure whether a map fits the labels on it, and say what is most likely wrong where it does not.

Vehicles lie on lanes, those that move head along them, a left neighbour lies on the left, lanes are as wide as lanes
are, and labels lie where the map is. A map that is mirrored, turned, in degrees or elsewhere misses one of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree

from scenicq.errors import Diagnostic
from scenicq.geometry.angles import normalize_array
from scenicq.store.classes import is_subclass
from scenicq.store.dataset import Dataset

if TYPE_CHECKING:
    import duckdb

    from scenicq.geometry.features import MapFeature

__all__ = ["MOST_MAPS", "MapFit", "fit_of", "map_fits", "misfits"]

Reals = NDArray[np.float64]

MOST_MAPS = 50
"""Maps that are looked at: those with the most labels."""
_MOST_VEHICLES = 4000
_FEWEST, _FEWEST_MOVING, _FEWEST_NEIGHBOURS = 20, 10, 8
_MOVING_MPS = 3.0
_NEAR_M = 2.5
_MOVING_ON_LANES, _ANY_ON_LANES = 0.9, 0.35
_DEVIATION, _AGAINST, _MOST_AGAINST, _WRONG_SIDE = math.radians(40), math.radians(60), 0.1, 0.25
"""In four real recordings with maps, 96 to 100 % of moving vehicles are on lanes; at most 1 % run against them."""
_WIDTHS_M = (1.2, 9.0)
_DRIVABLE = ("lane", "road", "intersection", "drivable")


@dataclass(frozen=True, slots=True)
class Vehicles:
    """Vehicles on a map: columns of the same length.

    Attributes:
        x, y: Metres.
        heading: Radians; nan where unknown.
        moves: Whether it moves, as far as that is known.
    """

    x: Reals
    y: Reals
    heading: Reals
    moves: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class MapFit:
    """What was measured of a map; None where there is too little to measure.

    Attributes:
        map: Its name.
        vehicles: How many were looked at.
        on_lanes: Share of vehicles, of moving ones where they are enough, that lie on a road.
        deviation: Median angle between moving vehicles and the direction of the road, radians.
        against: Share of moving vehicles that head otherwise than every lane near them.
        wrong_side: Share of neighbours that lie on the other side than the map says.
        width_m: Median width of lanes.
        outside: Share of vehicles outside of the map's bounds.
        cause: What most likely is wrong; "" where map and labels fit.
        hint: What mends it.
    """

    map: str
    vehicles: int
    on_lanes: float | None
    deviation: float | None
    against: float | None
    wrong_side: float | None
    width_m: float | None
    outside: float | None
    cause: str = ""
    hint: str = ""


def map_fits(dataset: Dataset) -> list[MapFit]:
    """Measure the maps with the most labels, by name.

    Raises:
        DataError: A file has changed.
    """
    counts = dataset.manifest.by_map
    names = sorted(dataset.maps, key=lambda name: (-counts[name].frames if name in counts else 0, name))[:MOST_MAPS]
    with dataset.blamed(), dataset.connect() as connection:
        return [fit_of(name, dataset.features(name), _vehicles(connection, name)) for name in sorted(names)]


def misfits(fits: Sequence[MapFit]) -> tuple[Diagnostic, ...]:
    """Warn of each map that does not fit."""
    return tuple(
        Diagnostic(
            "map-does-not-fit", f"map `{fit.map}`: {_facts(fit)}: {fit.cause}", hints=(fit.hint,), severity="warning"
        )
        for fit in fits
        if fit.cause
    )


def _facts(fit: MapFit) -> str:
    said: list[str] = []
    if fit.on_lanes is not None:
        said.append(f"{fit.on_lanes:.0%} of vehicles are on a lane")
    if fit.deviation is not None:
        said.append(f"moving ones deviate from its direction by {math.degrees(fit.deviation):.0f} deg in the median")
    if fit.against:
        said.append(f"{fit.against:.0%} of them head otherwise than the lanes near them")
    if fit.wrong_side:
        said.append(f"{fit.wrong_side:.0%} of neighbours lie on the other side")
    if fit.outside:
        said.append(f"{fit.outside:.0%} of vehicles lie outside of it")
    if fit.width_m is not None and not _WIDTHS_M[0] <= fit.width_m <= _WIDTHS_M[1]:
        said.append(f"lanes are {fit.width_m:.2g} m wide")
    return ", ".join(said)


def fit_of(name: str, features: Sequence[MapFeature], vehicles: Vehicles) -> MapFit:
    """Measure one map.

    Args:
        name: The map's name.
        features: Its elements.
        vehicles: Those on it.
    """
    lanes = _Lanes(features)
    count = len(vehicles.x)
    enough = count >= _FEWEST and lanes.any
    found = lanes.measure(vehicles) if enough else (None, None, None)
    outside = lanes.outside(vehicles) if enough else None
    fit = MapFit(name, count, *found, lanes.wrong_side(), lanes.width(), outside)
    cause, hint = _cause(fit, lanes, vehicles)
    return replace(fit, cause=cause, hint=hint)


def _vehicles(connection: duckdb.DuckDBPyConnection, name: str) -> Vehicles:
    classes = [category for (category,) in connection.execute("SELECT DISTINCT class FROM objects").fetchall()]
    wanted = [category for category in classes if is_subclass(category, "Vehicle")]
    rows = connection.execute(
        "WITH every AS (SELECT ego_x AS x, ego_y AS y, ego_heading AS heading, ego_motion_vx AS vx, "
        "ego_motion_vy AS vy, frame FROM labels WHERE map = $name AND ego_class <> '' UNION ALL "
        "SELECT x, y, heading, motion_vx, motion_vy, o.frame FROM objects AS o JOIN "
        "(SELECT frame, recording FROM labels WHERE map = $name) USING (frame, recording) "
        "WHERE class IN (SELECT unnest($wanted))) "
        "SELECT x, y, heading, vx, vy FROM every ORDER BY hash(frame), x, y LIMIT $most",
        {"name": name, "wanted": wanted, "most": _MOST_VEHICLES},
    ).fetchnumpy()
    columns = {key: np.ma.filled(np.ma.asarray(values, dtype=np.float64), math.nan) for key, values in rows.items()}
    moves = np.nan_to_num(np.hypot(columns["vx"], columns["vy"])) > _MOVING_MPS
    return Vehicles(columns["x"], columns["y"], columns["heading"], moves)


def _centerline(feature: MapFeature) -> list[list[list[float]]]:
    return feature.properties.get("centerline") or []


class _Lanes:
    """The roads of a map, to be asked about many places."""

    def __init__(self, features: Sequence[MapFeature]) -> None:
        self._lines: dict[str, Reals] = {}
        self._lanes = [feature for feature in features if feature.kind in ("lane", "lane_section")]
        for feature in self._lanes:
            lines = [np.array(line, dtype=np.float64) for line in _centerline(feature)]
            if lines:
                self._lines[feature.id] = np.concatenate(lines)
        self._areas = STRtree([feature.shape for feature in features if feature.kind in _DRIVABLE])
        self.any = bool(self._lanes) and len(self._areas) > 0
        starts = [line[:-1] for line in self._lines.values()]
        ends = [line[1:] for line in self._lines.values()]
        self._starts = np.concatenate(starts) if starts else np.empty((0, 2))
        self._steps = (np.concatenate(ends) if ends else np.empty((0, 2))) - self._starts
        pairs = np.stack([self._starts, self._starts + self._steps], axis=1)
        self._segments = STRtree(np.asarray(shapely.linestrings(pairs)) if len(pairs) else [])

    def measure(self, vehicles: Vehicles) -> tuple[float, float | None, float | None]:
        """`on_lanes`, `deviation` and `against` of a `MapFit`."""
        points = np.asarray(shapely.points(vehicles.x, vehicles.y))
        # What stands may stand beside the road.
        asked = points[vehicles.moves] if self.asks_moving(vehicles) else points
        on_lanes = len(np.unique(self._areas.query(asked, predicate="intersects")[0])) / len(asked)
        some = np.flatnonzero(vehicles.moves & ~np.isnan(vehicles.heading))
        if len(some) < _FEWEST_MOVING:
            return on_lanes, None, None
        rows, segments = self._segments.query(points[some], predicate="dwithin", distance=_NEAR_M)
        ways = np.arctan2(-self._steps[segments, 0], self._steps[segments, 1])
        apart = np.abs(normalize_array(vehicles.heading[some][rows] - ways))
        least = np.full(len(some), np.inf)
        np.minimum.at(least, rows, apart)
        known = least[np.isfinite(least)]
        if len(known) < _FEWEST_MOVING:
            return on_lanes, None, None
        return on_lanes, float(np.median(known)), float((known > _AGAINST).mean())

    def asks_moving(self, vehicles: Vehicles) -> bool:
        """Whether enough vehicles move for them alone to be asked for."""
        return int(vehicles.moves.sum()) >= _FEWEST

    def wrong_side(self) -> float | None:
        """The share of neighbours that lie on the wrong side."""
        wrong = count = 0
        for feature in self._lanes:
            own = self._lines.get(feature.id)
            for key, sign in (("left", 1.0), ("right", -1.0)):
                other = self._lines.get(str(feature.properties.get(key)))
                if own is None or other is None or len(own) < 2:
                    continue
                place = len(own) // 2
                step = own[place] - own[place - 1]
                middle = (own[place] + own[place - 1]) / 2
                line = shapely.linestrings(other)
                near = shapely.get_coordinates(shapely.shortest_line(shapely.points(middle), line))[-1] - middle
                across = float(step[0] * near[1] - step[1] * near[0])
                if abs(across) > float(np.hypot(*step)):  # over a metre to the side
                    count += 1
                    wrong += across * sign < 0
        return float(wrong) / count if count >= _FEWEST_NEIGHBOURS else None

    def width(self) -> float | None:
        """Median width of lanes."""
        widths = [
            feature.shape.area / length
            for feature in self._lanes
            if feature.kind == "lane" and feature.id in self._lines
            if (length := float(np.hypot(*np.diff(self._lines[feature.id], axis=0).T).sum())) > 0
        ]
        return float(np.median(widths)) if len(widths) >= 3 else None

    def outside(self, vehicles: Vehicles) -> float:
        """Share of places outside of the bounds of the roads."""
        low_x, low_y, high_x, high_y = shapely.total_bounds(self._areas.geometries)
        inside = (vehicles.x >= low_x) & (vehicles.x <= high_x) & (vehicles.y >= low_y) & (vehicles.y <= high_y)
        return 1 - float(inside.mean())


def _turned(quarter: int) -> Callable[[Vehicles], Vehicles]:
    c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarter]
    return lambda v: Vehicles(c * v.x - s * v.y, s * v.x + c * v.y, v.heading + quarter * math.pi / 2, v.moves)


def _heading(turn: float, sign: float = 1.0) -> Callable[[Vehicles], Vehicles]:
    return lambda v: Vehicles(v.x, v.y, sign * v.heading + turn, v.moves)


_ANGLE = "`angle` in `dataset.json` says from where angles are counted: `heading` from +y, `yaw` from +x"
_PLACE = "`--map NAME=FILE` takes a map whose axes are those of the labels"
_SIDE = 'a road with `rule="LHT"`, or centrelines in driving direction, say on which side traffic keeps'
_CANDIDATES: Mapping[str, tuple[Callable[[Vehicles], Vehicles], str]] = {
    "headings are 90 degrees too large, as yaw taken for heading is": (_heading(-math.pi / 2), _ANGLE),
    "headings are 90 degrees too small, as heading taken for yaw is": (_heading(math.pi / 2), _ANGLE),
    "traffic keeps to the other side, or centrelines run against it": (_heading(math.pi), _SIDE),
    "headings grow clockwise": (_heading(0.0, -1.0), "give headings that grow counter-clockwise"),
    "headings grow clockwise from +x": (_heading(-math.pi / 2, -1.0), "give headings that grow counter-clockwise"),
    "x points the other way: map or labels are mirrored": (lambda v: Vehicles(-v.x, v.y, -v.heading, v.moves), _PLACE),
    "y points the other way: map or labels are mirrored": (
        lambda v: Vehicles(v.x, -v.y, math.pi - v.heading, v.moves), _PLACE,
    ),
    "x and y are swapped": (lambda v: Vehicles(v.y, v.x, -v.heading - math.pi / 2, v.moves), _PLACE),
    "map or labels are turned by 90 degrees": (_turned(1), _PLACE),
    "map or labels are turned by 180 degrees": (_turned(2), _PLACE),
    "map or labels are turned by 270 degrees": (_turned(3), _PLACE),
}  # fmt: skip


def _cause(fit: MapFit, lanes: _Lanes, vehicles: Vehicles) -> tuple[str, str]:
    """Say what is most likely wrong, and what mends it; nothing where the map fits."""
    if fit.width_m is not None and fit.width_m < 0.01:
        return (
            "its coordinates are degrees, not metres",
            "`ogr2ogr -t_srs EPSG:326ZZ` projects a map (ZZ: its UTM zone)",
        )
    if fit.width_m is not None and not _WIDTHS_M[0] <= fit.width_m <= _WIDTHS_M[1]:
        return "its coordinates are not metres", "scale the map, or project it with `ogr2ogr -t_srs EPSG:326ZZ`"
    if fit.wrong_side is not None and fit.wrong_side > _WRONG_SIDE:
        return "the map is mirrored, or its centrelines run against traffic", _SIDE
    least = _MOVING_ON_LANES if lanes.asks_moving(vehicles) else _ANY_ON_LANES
    off = fit.on_lanes is not None and fit.on_lanes < least
    if not off and (fit.deviation or 0.0) <= _DEVIATION and (fit.against or 0.0) <= _MOST_AGAINST:
        return "", ""
    best, found = (0.0, -math.inf), ""  # of those that are as good, the first: headings are wrong more often
    for cause, (change, _) in _CANDIDATES.items():
        share, deviation, against = lanes.measure(change(vehicles))
        if share < least or (deviation or 0.0) > _DEVIATION / 2 or (against or 0.0) > _MOST_AGAINST:
            continue
        if (score := (round(share, 2), -round(deviation or 0.0, 1))) > best:
            best, found = score, cause
    if found:
        return found, _CANDIDATES[found][1]
    if off or (fit.deviation or 0.0) <= _DEVIATION:
        return "map and labels do not lie in one place: another origin, or another map", _PLACE
    return "labels do not head as the map's lanes do", _SIDE
