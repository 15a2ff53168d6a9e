"""Regions picked by chance or by what lies at a hidden place: only those near the label's object can be meant.

`new Car on network.laneAt(p)` is a point in one of a thousand lanes. The label says where the car is, so that few lanes
are left; the hidden place then has nothing to do but lie in one of these.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest import build
from scenicq.forest.bounds import Box
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import CompareOp, Constant, Identity, Index, Node, PointIn, Select, Undefined, Value
from scenicq.forest.walk import leaves
from scenicq.geometry import shapes
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.proximity import meets
from scenicq.geometry.regions import Region
from scenicq.match.linear.linear_relaxation import position_boxes
from scenicq.match.problem.conditioned import Item, conditioned, fact
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["Picked", "picked"]

_MOST = 16
"""Regions that are tried one by one."""
"""Metres by which boxes are grown, so that rounding loses nothing."""


@dataclass(frozen=True, slots=True)
class Picked:
    """The constraints where one region is picked.

    Attributes:
        items: The constraints, with one that the region is picked where that is not for chance to say.
        given: The option, if chance picks it.
    """

    items: list[Item]
    given: dict[Identity, Value]


def picked(items: Sequence[Item], tolerance: Tolerance) -> list[Picked] | None:
    """The constraints once for each region in which a random point can be, None if there is no such point.

    Args:
        items: The constraints, conditioned.
        tolerance: Per feature.
    """
    points = [leaf for leaf in leaves(*(node for _, node, _ in items)) if isinstance(leaf, PointIn)]
    chosen = [leaf for leaf in points if isinstance(leaf.region, Select) and _is_plain(leaf.region)]
    boxes = position_boxes(items, tolerance) if chosen else {}
    best: tuple[Select, list[int]] | None = None
    for leaf in chosen:
        box = boxes.get(leaf.identity)
        if box is None or not all(map(math.isfinite, (*box[0], *box[1]))):
            continue
        pick = cast(Select, leaf.region)
        numbers = _near(tuple(cast(Constant, option).value for option in pick.options), box)
        if len(numbers) <= _MOST and (best is None or len(numbers) < len(best[1])):
            best = pick, numbers
    return None if best is None else [_with(items, best[0].index, number) for number in best[1]]


def _is_plain(pick: Select) -> bool:
    return kind_of(pick.index) == "scalar" and all(isinstance(option, Constant) for option in pick.options)


@lru_cache(maxsize=64)
def _extents(regions: tuple[Value, ...]) -> NDArray[np.float64]:
    """Rows west, south, east, north; of what is no region nothing."""
    nowhere = (math.inf, math.inf, -math.inf, -math.inf)
    found = [nowhere if _is_nothing(region) else region_bounds(cast(Region, region)) for region in regions]
    return np.array(found)


def _is_nothing(region: Value) -> bool:
    return region is None or isinstance(region, Undefined)


def _near(regions: tuple[Value, ...], box: Box) -> list[int]:
    """The numbers of the regions that meet a box."""
    (x0, x1), (y0, y1) = box
    west, south, east, north = _extents(regions).T
    touching = (west <= x1 + SLACK) & (east >= x0 - SLACK) & (south <= y1 + SLACK) & (north >= y0 - SLACK)
    if x0 > x1 or y0 > y1:
        return []
    around = shapes.box(x0 - SLACK, y0 - SLACK, x1 + SLACK, y1 + SLACK)
    numbers: list[int] = np.nonzero(touching)[0].tolist()
    return [number for number in numbers if meets(cast(Region, regions[number]), around) is not False]


def _with(items: Sequence[Item], index: Node, number: int) -> Picked:
    value = float(number)
    if isinstance(index, Index):
        given: dict[Identity, Value] = {index.identity: value}
        return Picked(conditioned(items, given), given)
    fixed = conditioned(items, memo={id(index): Constant(value, span=index.span)})
    holds = build.compare(CompareOp.EQ, index, Constant(value, span=index.span), index.span)
    return Picked([*fixed, fact(holds)], {})
