"""What regions say of the points and boxes that lie in them, meet them, or are some way off: bounds for many cases.

A point that lies anywhere in a box is no farther from the middle of the box than a corner is, which tells how far it is
from any region by asking for the middle alone. A random disc or rectangle lies in a disc around its centre.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import CannotEvaluate
from scenicq.forest.nodes import Constant, Contains, DiscAt, Encloses, Intersects, Node, RectangleAt, SectorAt
from scenicq.geometry.membership import bounds, distance_many, may_be_within
from scenicq.geometry.regions import Region
from scenicq.match.fields import interval_domain as domain
from scenicq.match.fields.interval_domain import Enclosure
from scenicq.match.tolerance import SLACK

__all__ = ["Bounds", "distance_between", "known_region", "middles", "places_of"]

Bounds = Callable[[Node], Enclosure]
"""What is known of a node so far."""

_NOTHING = np.array([[np.inf], [-np.inf]])


def distance_between(region: Node, place: Enclosure) -> Enclosure:
    """How far points are from a region.

    Args:
        region: The region.
        place: Where the points can be, (2, 2, n).
    """
    found = np.stack([np.zeros(place.shape[-1]), np.full(place.shape[-1], np.inf)])
    known = known_region(region)
    if known is None:
        return found
    middle, reach = middles(place)
    near = np.nonzero(np.isfinite(reach))[0]
    try:
        away = distance_many(known, middle[:, near].T)
    except CannotEvaluate:
        return found
    found[:, near] = np.stack([np.maximum(away - reach[near] - SLACK, 0.0), away + reach[near] + SLACK])
    # nothing is known of how far anything is from nothing
    found[1, np.isinf(found[0])] = np.inf
    return found


def places_of(
    node: Contains | Intersects | Encloses, vector: Bounds, scalar: Bounds
) -> Iterator[tuple[Node, Enclosure]]:
    """Points that a condition on regions names, with where they can be if it holds.

    Args:
        node: The condition.
        vector: The bounds of a point so far, (2, 2, n).
        scalar: The bounds of a number so far, (2, n).
    """
    match node:
        case Contains():
            pairs = [(node.region, node.point, None)]
        case Encloses():
            pairs = [(node.outer, _center(node.inner), None)]
        case Intersects():
            pairs = [(node.left, _center(node.right), node.right), (node.right, _center(node.left), node.left)]
    for region, point, other in pairs:
        if point is None:
            continue
        place = vector(point)
        own = np.zeros((2, place.shape[-1])) if other is None else _radius(other, scalar)
        known, center = known_region(region), _center(region)
        if known is not None:
            yield point, _within(known, place, own[1] + SLACK)
        elif center is not None:
            reach = domain.add(own, _radius(region, scalar))[1] + SLACK
            off = np.stack([np.stack([-reach, reach])] * 2)
            yield point, domain.add(vector(center), off)
            apart = domain.lengths(domain.subtract(place, vector(center)))[0] > reach
            yield point, np.where(apart, _NOTHING, domain.everything(place))


def _within(region: Region, place: Enclosure, reach: NDArray[np.float64]) -> Enclosure:
    """The points within some metres of a region."""
    west, south, east, north = bounds(region)
    box = np.array([[west, east], [south, north]])[..., None] + np.stack([-reach, reach])
    middle, around = middles(place)
    asked = np.nonzero(np.isfinite(around) & np.isfinite(reach))[0]
    if len(asked):
        # one reach for all is enough: boxes that are narrowed together are alike
        far = float((around + reach)[asked].max())
        missed = asked[~may_be_within(region, middle[:, asked].T, far)]
        box = np.array(np.broadcast_to(box, place.shape))
        box[..., missed] = _NOTHING
    return box


def middles(place: Enclosure) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The middles (2, n) of boxes, and how far a point of them can be from there; infinite where nothing is known."""
    finite = np.isfinite(place).all(axis=(0, 1))
    safe = np.where(finite, place, 0.0)
    middle = safe.mean(axis=1)
    reach = np.hypot(*(safe[:, 1] - safe[:, 0])) / 2 + SLACK
    return middle, np.where(finite, reach, np.inf)


def known_region(region: Node) -> Region | None:
    """The region that an expression is, if it is known."""
    value = region.value if isinstance(region, Constant) else None
    return value if isinstance(value, Region) else None


def _center(region: Node) -> Node | None:
    """The middle of a disc, a sector or a rectangle that may be random."""
    match region:
        case DiscAt() | SectorAt() | RectangleAt():
            return region.center
        case _:
            return None


def _radius(region: Node, scalar: Bounds) -> Enclosure:
    """How far a point of a disc, a sector or a rectangle can be from its centre."""
    match region:
        case DiscAt() | SectorAt():
            return domain.magnitude(scalar(region.radius))
        case RectangleAt():
            return domain.lengths(np.stack([scalar(region.width), scalar(region.length)])) * 0.5
        case _:
            return np.array([[0.0], [np.inf]])
