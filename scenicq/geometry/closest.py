"""The point of a term that is closest to a given one, in closed form.

A closest point is the given point itself, its projection on an edge or on a circle, a corner, or a crossing of an edge
or a circle with a circle. All of these are listed, those that satisfy every condition kept, and the closest of them is
the answer, so there is none exactly when the term is empty.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry import shapes
from scenicq.geometry.regions import SLACK
from scenicq.geometry.shapes import XY
from scenicq.geometry.terms import Term

__all__ = ["closest_point", "nearest_on_circles"]


def closest_point(term: Term, x: float, y: float) -> XY | None:
    """The point of a term that is closest to (x, y), or None if the term is empty."""
    if term.clip.is_empty:
        return None
    point = shapes.nearest_point(term.clip, x, y)
    circles = np.array([(c.x, c.y, c.radius) for c in (*term.inside, *term.outside)]).reshape(-1, 3)
    if _allowed(np.array([point]), term, circles)[0]:
        return point
    query = np.array((x, y))
    edges = shapes.edges(term.clip)
    on_clip = np.concatenate(
        [edges[:, :2], _projections(edges, np.vstack([query, circles[:, :2]])), _cuts(edges, circles)]
    )
    free = np.concatenate([query[None], nearest_on_circles(query, circles), _crossings(circles)])
    free = free[_allowed(free, term, circles)]
    free = free[shapes.distances(shapes.points(free), term.clip) <= SLACK]
    found = np.concatenate([on_clip[_allowed(on_clip, term, circles)], free])
    if not len(found):
        return None
    best = found[np.argmin(np.hypot(found[:, 0] - x, found[:, 1] - y))]
    return float(best[0]), float(best[1])


def _allowed(xy: NDArray[np.float64], term: Term, circles: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points satisfy the conditions on the circles."""
    depth = np.hypot(xy[:, None, 0] - circles[:, 0], xy[:, None, 1] - circles[:, 1]) - circles[:, 2]
    count = len(term.inside)
    return np.all(depth[:, :count] <= SLACK, axis=1) & np.all(depth[:, count:] >= -SLACK, axis=1)


def _projections(edges: NDArray[np.float64], centers: NDArray[np.float64]) -> NDArray[np.float64]:
    """The point of each edge that is nearest to each centre."""
    start, along = edges[:, :2], edges[:, 2:] - edges[:, :2]
    squared = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    share = ((centers[:, None] - start) * along).sum(axis=2) / squared
    return (start + np.clip(share, 0.0, 1.0)[..., None] * along).reshape(-1, 2)


def _cuts(edges: NDArray[np.float64], circles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where edges cross circles."""
    start, along = edges[None, :, :2], (edges[:, 2:] - edges[:, :2])[None]
    length = np.maximum(np.hypot(along[..., 0], along[..., 1]), np.finfo(float).tiny)
    unit = along / length[..., None]
    offset = circles[:, None, :2] - start
    foot = (offset * unit).sum(axis=2)
    apart = offset[..., 0] * unit[..., 1] - offset[..., 1] * unit[..., 0]
    half = np.sqrt(np.maximum(circles[:, None, 2] ** 2 - apart**2, 0.0))
    hit = np.abs(apart) <= circles[:, None, 2]
    places = np.stack([foot - half, foot + half])
    on_edge = hit & (places >= 0.0) & (places <= length)
    return (start + places[..., None] * unit)[on_edge]


def nearest_on_circles(query: NDArray[np.float64], circles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points of circles, rows of x, y and radius, that are nearest to a query, or to many; shapes are broadcast."""
    offset = query - circles[:, :2]
    length = np.hypot(offset[:, 0], offset[:, 1])
    unit = np.where(length[:, None] > 0, offset / np.where(length > 0, length, 1.0)[:, None], (1.0, 0.0))
    return circles[:, :2] + unit * circles[:, 2:]


def _crossings(circles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where circles cross or touch each other."""
    first, second = np.triu_indices(len(circles), k=1)
    a, b = circles[first], circles[second]
    offset = b[:, :2] - a[:, :2]
    apart = np.hypot(offset[:, 0], offset[:, 1])
    ok = apart > 0
    a, b, offset, apart = a[ok], b[ok], offset[ok], apart[ok]
    unit = offset / apart[:, None]
    foot = (apart**2 + a[:, 2] ** 2 - b[:, 2] ** 2) / (2 * apart)
    half = np.sqrt(np.maximum(a[:, 2] ** 2 - foot**2, 0.0))
    aside = np.stack([-unit[:, 1], unit[:, 0]], axis=1) * half[:, None]
    middle = a[:, :2] + unit * foot[:, None]
    return np.concatenate([middle + aside, middle - aside])
