"""A typed front for the functions of shapely that this package uses: shapely itself carries no type annotations."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUnknownParameterType=false, reportMissingTypeStubs=false

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, TypeAlias, cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree, ops
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry import shape as shape_of
from shapely.geometry.base import BaseGeometry

Shape: TypeAlias = BaseGeometry
"""Any shapely geometry."""
XY: TypeAlias = tuple[float, float]
"""A point, in metres."""
GeometryError = shapely.errors.ShapelyError
"""Raised where shapes cannot be made or compared, such as those with coordinates that are not finite."""
Bounds: TypeAlias = tuple[float, float, float, float]
"""A box: xmin, ymin, xmax, ymax."""
Coordinates: TypeAlias = NDArray[np.float64]
"""Points, shape (n, 2)."""
_SLIT = 1e-3
"""Metres on either side by which slits between polygons are closed."""


def point(x: float, y: float) -> Point:
    """A point."""
    return Point(x, y)


def box(xmin: float, ymin: float, xmax: float, ymax: float) -> Shape:
    """An axis-parallel rectangle."""
    return cast(Shape, shapely.box(xmin, ymin, xmax, ymax))


def boxes(bounds: Coordinates) -> NDArray[Any]:
    """Array (n,) of axis-parallel rectangles from rows xmin, ymin, xmax, ymax."""
    return cast("NDArray[Any]", shapely.box(*bounds.T))


def polygon(corners: Coordinates | Sequence[XY]) -> Shape:
    """A polygon without holes from its corners."""
    return cast(Shape, shapely.polygons(np.asarray(corners, dtype=float)))


def line(corners: Coordinates | Sequence[XY]) -> Shape:
    """A polyline."""
    return cast(Shape, shapely.linestrings(np.asarray(corners, dtype=float)))


def segments(ends: NDArray[np.float64]) -> NDArray[Any]:
    """Lines between two points each, whose coordinates have shape (n, 2, 2)."""
    return cast("NDArray[Any]", shapely.linestrings(ends))


def points(xy: Coordinates) -> NDArray[Any]:
    """Array (n,) of points."""
    return cast("NDArray[Any]", shapely.points(xy))


def array(geometries: Sequence[Shape] | NDArray[Any]) -> NDArray[Any]:
    """Array (n,) of geometries, as the vectorised functions want it."""
    result = np.empty(len(geometries), dtype=object)
    result[:] = geometries
    return result


def simple_parts(geometries: Sequence[Shape]) -> tuple[Shape, ...]:
    """The simple, non-empty parts of geometries, in order."""
    return tuple(part for part in shapely.get_parts(array(geometries)) if not part.is_empty)


def total_bounds(geometries: Sequence[Shape]) -> Bounds:
    """The box around all of them; (inf, inf, -inf, -inf) for none."""
    if not geometries:
        return (np.inf, np.inf, -np.inf, -np.inf)
    xmin, ymin, xmax, ymax = shapely.total_bounds(array(geometries))
    return float(xmin), float(ymin), float(xmax), float(ymax)


def bounds_of(shape: Shape) -> Bounds:
    """The box around a geometry."""
    return shape.bounds


def tree_query(tree: STRtree, shape: Shape) -> NDArray[np.intp]:
    """Indices of the geometries whose boxes meet the box of a shape."""
    return cast("NDArray[np.intp]", tree.query(shape))


def tree_within(tree: STRtree, shape: Shape, distance: float) -> NDArray[np.intp]:
    """Indices of the geometries within a distance of a shape."""
    return cast("NDArray[np.intp]", tree.query(shape, predicate="dwithin", distance=distance))


def tree_pairs_within(
    tree: STRtree, geometries: NDArray[Any], distance: float | NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """All pairs (index of a geometry, index in the tree) within a distance of each other."""
    if isinstance(distance, float):
        # what has the shape of the geometries need not be brought to it, which takes longer than a query
        distance = np.full(geometries.shape, distance)
    found = tree.query(geometries, predicate="dwithin", distance=distance)
    return cast("NDArray[np.intp]", found[0]), cast("NDArray[np.intp]", found[1])


def tree_pairs(tree: STRtree, geometries: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """All pairs (index of a geometry, index in the tree) whose boxes meet."""
    found = tree.query(geometries)
    return cast("NDArray[np.intp]", found[0]), cast("NDArray[np.intp]", found[1])


def tree_pairs_around(
    tree: STRtree, xy: Coordinates, reach: float | NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """All pairs (index of a point, index in the tree) where the box of the geometry meets a square about the point."""
    return tree_pairs(tree, cast("NDArray[Any]", shapely.box(*(xy - reach).T, *(xy + reach).T)))


def tree_nearest(
    tree: STRtree, geometries: NDArray[Any]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """For each geometry its nearest ones in the tree, ties included: (index, index in the tree, distance)."""
    pairs, distances = tree.query_nearest(geometries, return_distance=True)
    return cast("NDArray[np.intp]", pairs[0]), cast("NDArray[np.intp]", pairs[1]), distances


def tree_distances(tree: STRtree, geometries: NDArray[Any]) -> NDArray[np.float64]:
    """How far each geometry is from what is nearest in the tree."""
    distances: NDArray[np.float64] = tree.query_nearest(geometries, all_matches=False, return_distance=True)[1]
    return distances


def distance(a: Shape, b: Shape) -> float:
    """Distance of two geometries; inf if one is empty."""
    result = float(shapely.distance(a, b))
    return np.inf if np.isnan(result) else result


def distances(a: NDArray[Any], b: NDArray[Any] | Shape) -> NDArray[np.float64]:
    """Distances of geometries, pair by pair."""
    return shapely.distance(a, b)


def covers(a: Shape, b: Shape) -> bool:
    """Whether no point of b lies outside of a."""
    return bool(shapely.covers(a, b))


def prepare(geometries: Sequence[Shape]) -> NDArray[np.object_]:
    """The geometries as an array, indexed so that comparing those of many corners with many others is fast."""
    found = array(geometries)
    shapely.prepare(found)
    return found


def within_many(a: NDArray[Any], b: NDArray[Any], distance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether two geometries are within a distance of each other, pair by pair; `a` is best prepared."""
    return shapely.dwithin(a, b, cast(float, distance))


def covers_many(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    """`covers`, pair by pair."""
    return shapely.covers(a, b)


def _overlay(operation: Callable[..., Any], *operands: Any, exact: bool = True) -> Any:
    """The result of an operation on areas; on a grid where GEOS cannot tell how edges cross, ever coarser."""
    # coordinates near the end of all numbers overflow
    with np.errstate(all="ignore"):
        for grid in _GRIDS[not exact :]:
            try:
                return operation(*operands, grid_size=grid)
            except shapely.GEOSException:
                continue
        return operation(*map(_repaired, operands), grid_size=_GRIDS[-1])


def _repaired(shape: Any) -> Any:
    """A shape whose edges do not cross, without what has fewer dimensions; each of an array."""
    if isinstance(shape, np.ndarray):
        return array([_repaired(each) for each in cast("list[Shape]", shape.tolist())])
    parts = shapely.get_parts(shapely.make_valid(shape))
    return shapely.union_all(parts[shapely.get_dimensions(parts) == shapely.get_dimensions(shape)])


_GRIDS = (None, 1e-9, 1e-7, 1e-5)
"""Metres that coordinates are rounded to, the exact ones first."""


def intersection(a: Shape, b: Shape) -> Shape:
    """What two geometries share."""
    return _overlay(shapely.intersection, a, b)


def pair_intersections(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """What each pair of geometries has in common."""
    return _overlay(shapely.intersection, a, b)


def shared_areas(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    """What each pair of polygons has in common, in square metres."""
    return shapely.area(pair_intersections(a, b))


def intersections(geometries: Sequence[Shape], window: Shape) -> list[Shape]:
    """What each geometry shares with another one."""
    return [intersection(each, window) for each in geometries]


def difference(a: Shape, b: Shape) -> Shape:
    """The closure of what lies in a and not in b."""
    return _overlay(shapely.difference, a, b)


def difference_many(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """`difference`, pair by pair."""
    return cast("NDArray[Any]", _overlay(shapely.difference, a, b))


def union_all(geometries: Sequence[Shape]) -> Shape:
    """The union."""
    return _overlay(shapely.union_all, array(geometries))


def snapped_union(geometries: Sequence[Shape]) -> Shape:
    """The union, with coordinates rounded to a nanometre so that slivers close."""
    return _overlay(shapely.union_all, array(geometries), exact=False)


def areas(geometries: Sequence[Shape] | NDArray[Any]) -> NDArray[np.float64]:
    """Areas in square metres, shape (n,)."""
    return shapely.area(array(geometries))


def lengths(geometries: Sequence[Shape]) -> NDArray[np.float64]:
    """Lengths in metres, shape (n,)."""
    return shapely.length(array(geometries))


def nearest_point(shape: Shape, x: float, y: float) -> XY:
    """The point of a non-empty shape that is nearest to (x, y); the point itself if it lies inside."""
    coordinates = shapely.get_coordinates(shapely.shortest_line(shape, Point(x, y)))
    return float(coordinates[0, 0]), float(coordinates[0, 1])


def nearest_of(geometries: NDArray[Any], others: NDArray[Any]) -> Coordinates:
    """The points of non-empty shapes that are nearest to other ones, pair by pair, (n, 2)."""
    return shapely.get_coordinates(shapely.shortest_line(geometries, others))[::2]


def inner_point(shape: Shape) -> XY:
    """A point of a non-empty shape, inside where it has an inside."""
    found = shapely.get_coordinates(shapely.point_on_surface(shape))
    return float(found[0, 0]), float(found[0, 1])


QUARTER_SEGMENTS = 16
"""Sides of the polygon that stands for a quarter of a circle in `grown`."""


def grown(shape: Shape, width: float) -> Shape:
    """What lies within `width` metres of a shape, circles as polygons inside of them."""
    return cast(Shape, shapely.buffer(shape, width, quad_segs=QUARTER_SEGMENTS))


def band(shape: Shape, width: float) -> Shape:
    """The polygon of what lies within `width` metres of a shape."""
    return cast(Shape, shapely.buffer(shape, width, quad_segs=2))


def round_band(shape: Shape, width: float) -> Shape:
    """`band` to a ten-thousandth of its width."""
    return cast(Shape, shapely.buffer(shape, width, quad_segs=64))


def divide_polygon(shape: Shape, others: Sequence[Shape]) -> tuple[Shape, ...]:
    """A polygon cut along the borders of others: its parts, each inside or outside of any of them."""
    if not others:
        return (shape,)
    lines = union_all(shapely.boundary(array([shape, *others])).tolist())
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
    return tuple(face for face in faces if shapely.contains_xy(shape, *inner_point(face)))


def split(area: Polygon, across: LineString) -> list[Polygon]:
    """The parts into which a line cuts a polygon; itself where the line does not go through it."""
    return cast("list[Polygon]", list(ops.split(area, across).geoms))


def part_of_line(along: LineString, start: float, end: float) -> LineString:
    """A line from so many metres along it to so many."""
    return cast(LineString, ops.substring(along, start, end))


def places_along(shape: Shape, step: float) -> Coordinates:
    """Places on the border of a shape, about `step` metres apart, to some centimetres."""
    dense = shapely.get_coordinates(shapely.segmentize(shapely.boundary(shape), step))
    places = np.unique(np.round(dense, 1), axis=0)
    # where four are on one circle, as on a grid, GEOS makes no diagram
    return places + np.random.default_rng(0).uniform(-0.02, 0.02, places.shape)


def voronoi_cells(places: Coordinates, bounds: Bounds) -> list[Shape]:
    """For each of some different places the part of a box that is nearest to it."""
    cells = shapely.get_parts(shapely.voronoi_polygons(shapely.multipoints(places), extend_to=box(*bounds)))
    cell, place = STRtree(points(places)).query(cells, predicate="contains")
    found = np.empty(len(places), dtype=object)
    found[place] = pair_intersections(cells[cell], np.full(len(cell), box(*bounds)))
    return cast("list[Shape]", found.tolist())


def erode(shape: Shape, by: float) -> Shape:
    """A polygon without what lies within `by` metres of its boundary; slits narrower than 2 mm count as closed."""
    return shapely.buffer(shapely.buffer(shape, _SLIT, quad_segs=4), -by - _SLIT, quad_segs=4)


def coordinates(shape: Shape) -> Coordinates:
    """All vertices, shape (n, 2)."""
    return shapely.get_coordinates(shape)


def no_shapes(count: int) -> NDArray[Any]:
    """Array (n,) without a shape, for some to be put in."""
    return np.full(count, None, dtype=object)  # type: ignore[call-overload]


def are_there(geometries: NDArray[Any]) -> NDArray[np.bool_]:
    """Where an array (n,) has a shape."""
    return ~shapely.is_missing(geometries)


def coordinates_of_many(geometries: NDArray[Any]) -> NDArray[np.float64]:
    """All vertices of shapes (n,) that have equally many, shape (n, k, 2)."""
    found = shapely.get_coordinates(geometries)
    return found.reshape(len(geometries), -1, 2) if len(geometries) else np.empty((0, 0, 2))


def edges(shape: Shape) -> NDArray[np.float64]:
    """The segments that bound a shape, (n, 4) rows x0, y0, x1, y1; a point is a segment of no length."""
    parts = simple_parts([shape])
    while any(part.geom_type.startswith(("Multi", "GeometryCollection")) for part in parts):
        parts = simple_parts(parts)
    curves: list[Shape] = []
    dots: list[Shape] = []
    for part in parts:
        if part.geom_type == "Polygon":
            curves += shapely.get_rings(part).tolist()
        elif part.geom_type == "Point":
            dots.append(part)
        else:
            curves.append(part)
    corners, owner = shapely.get_coordinates(array(curves), return_index=True)
    same = owner[1:] == owner[:-1]
    segments = np.concatenate([corners[:-1][same], corners[1:][same]], axis=1)
    single = shapely.get_coordinates(array(dots))
    return np.concatenate([segments, np.concatenate([single, single], axis=1)])


def triangulate(shape: Shape) -> NDArray[np.float64]:
    """Triangles (n, 3, 2), counter-clockwise, that tile a polygon."""
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
    if not len(parts):
        return np.empty((0, 3, 2))
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]
    ahead, aside = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ahead[:, 0] * aside[:, 1] - ahead[:, 1] * aside[:, 0]
    corners[area < 0] = corners[area < 0][:, ::-1]
    return corners[area != 0]


def without_straight_corners(shape: Shape) -> Shape:
    """The same shape without the vertices that lie exactly on a straight edge."""
    return shapely.simplify(shape, 0.0)


def polygonal_part(shape: Shape) -> tuple[Shape, ...]:
    """The polygons of a geometry."""
    return tuple(part for part in simple_parts(simple_parts([shape])) if part.geom_type == "Polygon")


def corner_count(shape: Shape) -> int:
    """Number of vertices."""
    return int(shapely.get_num_coordinates(shape))


def from_geojson(geometry: dict[str, Any]) -> Shape:
    """A geometry from its GeoJSON object, without third coordinates; a malformed one raises no error of GEOS."""
    try:
        return shapely.force_2d(shape_of(geometry))
    except shapely.errors.ShapelyError as error:
        raise ValueError(str(error)) from error


def plain_polygons(geometries: Sequence[Any]) -> list[Shape | None]:
    """What `from_geojson` makes of the plain ones among JSON values, all at once; None for every other.

    Plain is a valid polygon of one closed ring of finite coordinates in pairs.
    """
    found: list[Shape | None] = [None] * len(geometries)
    rings = {place: ring for place, given in enumerate(geometries) if (ring := _plain_ring(given)) is not None}
    numbers = list(chain.from_iterable(chain.from_iterable(rings.values())))
    if not rings or not {*map(type, numbers)} <= {int, float}:
        return found
    try:
        corners = np.array(numbers, dtype=float).reshape(-1, 2)
    except OverflowError:
        return found
    if np.isfinite(corners).all():
        owner = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings.values()])
        made = np.asarray(shapely.polygons(shapely.linearrings(corners, indices=owner)))
        sound = np.asarray(shapely.is_valid(made))
        for place, shape, valid in zip(rings, made.tolist(), sound.tolist(), strict=True):
            found[place] = shape if valid else None
    return found


def _plain_ring(geometry: Any) -> list[list[Any]] | None:
    """The only ring of a polygon if it is closed and all its positions are pairs."""
    if type(geometry) is not dict or geometry.get("type") != "Polygon":
        return None
    rings = geometry.get("coordinates")
    if type(rings) is not list or len(rings) != 1 or type(rings[0]) is not list or len(rings[0]) < 4:
        return None
    ring = rings[0]
    pairs = {*map(type, ring)} == {list} and {*map(len, ring)} == {2}
    return ring if pairs and ring[0] == ring[-1] else None


def is_finite(shape: Shape) -> bool:
    """Whether all coordinates are finite."""
    return bool(np.isfinite(shapely.get_coordinates(shape)).all())


def invalid_reason(shape: Shape) -> str | None:
    """Why a geometry is not valid, or None if it is."""
    return None if shapely.is_valid(shape) else str(shapely.is_valid_reason(shape))
