"""Methods of map elements: which of their parts lies at a place, what their direction leads to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, cast

from scenicq.compiler.coerce import to_vector
from scenicq.compiler.element_lookups import ways_at
from scenicq.compiler.following import follow
from scenicq.compiler.known_properties import as_constant
from scenicq.compiler.lanes_ahead import lanes_ahead
from scenicq.compiler.lookups import among, look_up, look_up_ways
from scenicq.compiler.random_values import is_choice, lift
from scenicq.compiler.road_attributes import computed_attribute
from scenicq.compiler.values import Builtin, ModelValue, describe, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import Constant, DirectionAt, Node, Vector
from scenicq.geometry.elements import (
    Intersection,
    Lane,
    LaneGroup,
    LaneSection,
    NetworkElement,
    Road,
    RoadSection,
)
from scenicq.geometry.network import Network

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["METHODS", "find_among", "method_of", "nominal_directions"]

_PARTS: dict[str, tuple[tuple[type, Callable[[Any], Sequence[NetworkElement]]], ...]] = {
    "sectionAt": ((Lane, lambda lane: lane.sections), (Road, lambda road: road.sections)),
    "laneAt": (
        (LaneGroup, lambda group: group.lanes),
        (Road, lambda road: road.lanes),
        (RoadSection, lambda section: section.lanes),
    ),
    "laneGroupAt": ((Road, lambda road: road.laneGroups),),
    "laneSectionAt": ((Road, lambda road: [section for lane in road.lanes for section in lane.sections]),),
}
"""Look-ups among the parts of an element."""

METHODS = frozenset({"nominalDirectionsAt"})
"""Methods that every element and the network have."""


def find_among(run: Interpreter, point: ModelValue, elements: ModelValue, reject: ModelValue, span: Span) -> ModelValue:
    """`network.findPointIn(point, elements, reject)`.

    Raises:
        ScenarioError: wrong-type, for what are no elements.
    """
    known = isinstance(elements, list | tuple)
    if not known or not all(isinstance(each, NetworkElement) for each in cast("list[Any]", elements)):
        raise fail("wrong-type", "a known list of elements of the map is needed here", span,
                   f"this is {describe(elements)}")  # fmt: skip
    return among(run, list(cast("Sequence[NetworkElement]", elements)), "findPointIn", point, reject, span)


def method_of(run: Interpreter, value: NetworkElement, name: str) -> Builtin | None:
    """A method of an element, None if it has no such method."""
    parts = next((parts for kind, parts in _PARTS.get(name, ()) if isinstance(value, kind)), None)
    if parts is not None:
        return Builtin(name, _finder(run, parts(value), f"{name} of {value.id}"))
    if name == "crossingAt" and isinstance(value, Road):

        def crossing(span: Span, point: ModelValue, reject: ModelValue = None) -> ModelValue:
            found = computed_attribute(run, value, "crossings", span)
            assert found is not None
            return among(run, found[0], f"crossingAt of {value.id}", point, reject, span)

        return Builtin(name, crossing)
    if name == "nominalDirectionsAt" and value.orientation is not None:
        return nominal_directions(run, value)
    if name == "maneuversAt" and isinstance(value, Intersection):
        return Builtin(name, lambda span, point: look_up_ways(run, value, point, span))
    if name == "lanesAhead" and isinstance(value, Lane):
        return Builtin(name, lambda span, distance=50: build.constant(lanes_ahead(run, value, distance, span), span))
    if name == "shiftedBy" and isinstance(value, LaneSection):
        return Builtin(name, lambda span, offset: _shifted(run, value, offset, span))
    if name == "flowFrom" and value.orientation is not None:
        field = build.constant(value.orientation)

        def flow(
            span: Span,
            point: ModelValue,
            distance: ModelValue,
            steps: ModelValue = None,
            stepSize: ModelValue = None,  # noqa: N803 - Scenic's name
        ) -> ModelValue:
            if steps is not None or stepSize is not None:
                raise fail("unsupported-construct", "steps of one's own are not supported here", span, "given here",
                           ("leave them out: steps are at most 5 m long",))  # fmt: skip
            return follow(run, field, point, distance, span).properties["position"]

        return Builtin(name, flow)
    return None


def _finder(run: Interpreter, parts: Sequence[NetworkElement], name: str) -> Callable[..., ModelValue]:
    def find(span: Span, point: ModelValue, reject: ModelValue = None) -> ModelValue:
        return among(run, parts, name, point, reject, span)

    return find


def nominal_directions(run: Interpreter, owner: Network | NetworkElement) -> Builtin:
    """`nominalDirectionsAt`: the directions of traffic at a point, in an element or in whatever lies there."""

    def directions(span: Span, point: ModelValue, reject: ModelValue = None) -> ModelValue:
        found = look_up(run, owner, "nominalDirectionsAt", point, reject, span) if isinstance(owner, Network) else owner
        place = as_constant(run, to_vector(point, span))
        return lift(lambda element: _directions(element, place, span), found, span=span, spread=is_choice)

    return Builtin("nominalDirectionsAt", directions)


def _directions(element: ModelValue, place: Node, span: Span) -> ModelValue:
    """The directions of traffic of one element; at a random place of an intersection, the one of any way there."""
    field = element.orientation if isinstance(element, NetworkElement) else None
    if field is None:
        return ()
    if not isinstance(place, Constant):
        return (DirectionAt(build.constant(field, span), place, span=span),)
    x, y = cast(Vector, place.value)
    fields = [field]
    if isinstance(element, Intersection):
        lanes = (maneuver.connectingLane for maneuver in ways_at(element, x, y))
        fields = [lane.orientation for lane in lanes if lane is not None and lane.orientation is not None]
    return tuple(heading for each in fields if (heading := each.first(x, y)) is not None)


def _shifted(run: Interpreter, section: LaneSection, offset: ModelValue, span: Span) -> ModelValue:
    """The section some lanes over: to the left, or to the right where the number is negative."""
    if isinstance(offset, bool) or not isinstance(offset, int):
        raise fail("wrong-type", "`shiftedBy` needs a known whole number", span)
    found: LaneSection | None = section
    for _ in range(abs(offset)):
        run.budget.step(span)
        found = getattr(found, "_laneToLeft" if offset > 0 else "_laneToRight")
        if found is None:
            raise fail("map-lacks", f"the map says that {section.name} has no lane so far over", span,
                       "not in this map")  # fmt: skip
    return found
