"""Regions that programs make: discs, sectors, rectangles, polygons, polylines, sets of points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import shapely

from scenicq.compiler.coerce import to_field, to_heading, to_region, to_scalar, to_vector
from scenicq.compiler.values import ModelValue, describe, fail
from scenicq.errors import CannotEvaluate, Span
from scenicq.forest import build
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.compute import fold
from scenicq.forest.evaluate import evaluate
from scenicq.forest.nodes import ArithmeticOp, Constant, DirectionAt, DiscAt, Node, RectangleAt, Undefined
from scenicq.geometry.fields import VectorField
from scenicq.geometry.regions import PointSet, PolygonSet, PolylineSet
from scenicq.geometry.road_direction import along_lines

__all__ = ["REGION_FUNCTIONS"]


def _circular(
    span: Span, center: ModelValue, radius: ModelValue, resolution: ModelValue = None, name: ModelValue = None
) -> ModelValue:
    return fold(DiscAt(to_vector(center, span), to_scalar(radius, span), span=span))


def _sector(
    span: Span,
    center: ModelValue,
    radius: ModelValue,
    heading: ModelValue,
    angle: ModelValue,
    resolution: ModelValue = None,
    name: ModelValue = None,
) -> ModelValue:
    return build.sector(
        to_vector(center, span), to_scalar(radius, span), to_heading(heading, span), to_scalar(angle, span), span
    )


def _rectangular(
    span: Span,
    position: ModelValue,
    heading: ModelValue,
    width: ModelValue,
    length: ModelValue = None,
    height: ModelValue = None,
    name: ModelValue = None,
) -> ModelValue:
    # sides are mirrored where they are negative, as Scenic does
    size = [_magnitude(to_scalar(side, span), span) for side in (width, height if length is None else length)]
    return fold(RectangleAt(to_vector(position, span), to_heading(heading, span), *size, span=span))


def _magnitude(side: Node, span: Span) -> Node:
    return build.arithmetic(ArithmeticOp.ABS, side, span=span) if scalar_bounds(side)[0] < 0 else side


def _points(values: ModelValue, span: Span, least: int) -> list[tuple[float, float]]:
    if not isinstance(values, list | tuple):
        raise fail("wrong-type", "a list of points is needed here", span, f"this is {describe(values)}")
    points: list[tuple[float, float]] = []
    for value in cast("list[ModelValue]", values):
        point = _known(to_vector(value, span))
        if point is None:
            raise fail("unsupported-region", "the corners of this region must be known", span, "a random corner")
        points.append(point)
    if len(points) < least:
        raise fail("wrong-value", f"at least {least} points are needed here", span)
    return points


def _known(point: Node) -> tuple[float, float] | None:
    """The one value that a point has, such as of where a field leads that has one direction there; else None."""
    choices = False

    def choose(node: DirectionAt, headings: tuple[float, ...]) -> float:
        nonlocal choices
        choices = True
        return headings[0]

    try:
        value = evaluate(point, {}, None, choose)
    except CannotEvaluate:
        return None
    return None if choices or isinstance(value, Undefined) else cast("tuple[float, float]", value)


def _orientation(value: ModelValue, span: Span) -> VectorField | None:
    if value is None:
        return None
    return cast(VectorField, cast(Constant, to_field(value, span)).value)


def _polygonal(
    span: Span, points: ModelValue, orientation: ModelValue = None, name: ModelValue = "PolygonalRegion"
) -> ModelValue:
    polygon = shapely.Polygon(_points(points, span, 3))
    if not polygon.is_valid or polygon.area == 0:
        raise fail("wrong-value", "this polygon is not simple", span, "it crosses itself or has no area",
                   ("list the corners in order around the region",))  # fmt: skip
    return build.constant(PolygonSet((polygon,), str(name), _orientation(orientation, span)), span)


def _polyline(
    span: Span, points: ModelValue, orientation: ModelValue = True, name: ModelValue = "PolylineRegion"
) -> ModelValue:
    line = shapely.LineString(_points(points, span, 2))
    if line.length == 0:
        raise fail("wrong-value", "this polyline has no length", span, "all points are the same")
    if orientation is True:
        return build.constant(PolylineSet((line,), str(name), along_lines((line,), str(name))), span)
    return build.constant(PolylineSet((line,), str(name), _orientation(orientation or None, span)), span)


def _point_set(
    span: Span,
    name: ModelValue,
    points: ModelValue,
    kdTree: ModelValue = None,  # noqa: N803 - Scenic's name
    orientation: ModelValue = None,
    tolerance: ModelValue = None,
) -> ModelValue:
    if orientation is not None:
        raise fail("unsupported-region", "a set of points with an orientation is not supported", span, "oriented",
                   ("state the heading with `facing`",))  # fmt: skip
    return build.constant(PointSet(tuple(_points(points, span, 1)), str(name)), span)


def _workspace(span: Span, region: ModelValue = None, **_: ModelValue) -> ModelValue:
    return to_region(region, span)


def _refuse(what: str, hint: str) -> Callable[..., Any]:
    def call(span: Span, *_: ModelValue, **__: ModelValue) -> ModelValue:
        raise fail("unsupported-construct", f"{what} is not supported", span, "cannot be matched", (hint,))

    return call


REGION_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "CircularRegion": _circular,
    "SectorRegion": _sector,
    "RectangularRegion": _rectangular,
    "PolygonalRegion": _polygonal,
    "PolylineRegion": _polyline,
    "PointSetRegion": _point_set,
    "Workspace": _workspace,
    "VectorField": _refuse(
        "a vector field given by a function", "use `roadDirection` or the orientation of an element"
    ),
    "PolygonalVectorField": _refuse("a vector field given by cells", "use `roadDirection` or constant headings"),
    "GridRegion": _refuse("a region given by a grid", "use `PolygonalRegion`"),
    "MeshVolumeRegion": _refuse("a region in space", "use `PolygonalRegion`"),
    "MeshSurfaceRegion": _refuse("a region in space", "use `PolygonalRegion`"),
    "BoxRegion": _refuse("a region in space", "use `RectangularRegion`"),
    "SpheroidRegion": _refuse("a region in space", "use `CircularRegion`"),
    "PathRegion": _refuse("a region in space", "use `PolylineRegion`"),
}
"""What programs call the regions: takes the place of the call and its arguments."""
