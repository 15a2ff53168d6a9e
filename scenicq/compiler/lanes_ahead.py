"""The area of a lane and of those that it leads to, and what of it lies ahead of an object.

Maps cut lanes as they like, often after a few metres.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from scenicq.compiler.coerce import to_vector
from scenicq.compiler.lookups import going_of
from scenicq.compiler.values import Instance, ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import AheadInLanes, Constant, Node
from scenicq.geometry.elements import Lane
from scenicq.geometry.lanes_ahead import lanes_from
from scenicq.geometry.regions import PolygonSet

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["ahead", "lanes_ahead"]


def ahead(run: Interpreter, span: Span, owner: ModelValue, distance: ModelValue) -> Node:
    """`ahead(obj, d)` of `scenicq.labels`: what lies in an object's lanes, from it to so many metres on.

    Raises:
        ScenarioError: wrong-type, where it is no object; wrong-value, for what is no positive known number; map-lacks,
            where no lane has a direction.
    """
    if not isinstance(owner, Instance) or owner.index is None:
        shown = f"a hidden `{owner.cls.name}`" if isinstance(owner, Instance) else describe(owner)
        raise fail("wrong-type", f"{shown} has no lanes: `ahead` asks for those of an object", span,
                   "no object here", ("name an object, such as `ego`",))  # fmt: skip
    number = distance.value if isinstance(distance, Constant) else distance
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 < number < 1e6:
        raise fail("wrong-value", "`ahead` needs a known number of metres, which is positive", span,
                   f"this is {number if isinstance(number, int | float) else describe(distance)}")  # fmt: skip
    if run.network.roadDirection.is_nowhere:
        hint = f"`0 < along(A, B) < {number:g} and abs(beside(A, B)) < 1.5` asks for B on the course of A, with no map"
        raise fail("map-lacks", "the map has no lane in which anything could be ahead", span, "needs lanes", (hint,))
    way, last = going_of(run, owner, span) or (build.constant(None, span), build.constant(None, span))
    return AheadInLanes(to_vector(owner, span), way, last, build.constant(float(number)), run.network, span=span)


def lanes_ahead(run: Interpreter, lane: Lane, distance: ModelValue, span: Span) -> PolygonSet:
    """A lane and all lanes that it leads to which begin at most so far behind its end.

    Args:
        run: The run of the program.
        lane: The lane.
        distance: Metres along centrelines; a known number.
        span: Where the program asks for it.

    Raises:
        ScenarioError: wrong-type, for what is no known number of metres.
    """
    if isinstance(distance, bool) or not isinstance(distance, int | float) or not math.isfinite(distance):
        raise fail("wrong-type", "`lanesAhead` needs a known number of metres", span, f"this is {describe(distance)}")
    begins = lanes_from(lane, distance, lambda: run.budget.step(span))
    return PolygonSet(
        tuple(each.polygon for each in begins),
        f"{lane.name} and what it leads to",
        run.network.roadDirection,
        tuple(each.id for each in begins),
    )
