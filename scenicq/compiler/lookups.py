"""What lies at a place: `network.laneAt(p)`, `ego.lane`, `road.laneAt(p)` and their like.

At a known place it is one element, or None. At a random one it is a random choice between the elements whose index is
a function of the place (see `occupancy`), so that any two look-ups at one place agree; its attributes are again random
choices. Where elements of one kind overlap, any of them may be meant; which one is chosen once for a place, for lanes,
their sections, groups and roads together. Those lanes at an object's place are its own that lead its way or continue
the last of its track (`ElementAtPoint.along`), unless all are asked for (`LaneRule`): `obj.lane`, its sections, groups
and roads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, cast

from scenicq.compiler.coerce import property_node, to_heading, to_node, to_vector
from scenicq.compiler.element_lookups import LOOKUPS, AbstractLookup, LookupTable, own, ways_at, ways_everywhere
from scenicq.compiler.known_properties import as_constant
from scenicq.compiler.values import Builtin, Choice, Instance, ModelValue, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import GOING, LAST_LANE, Constant, Node, Select, Undefined, Vector
from scenicq.geometry.abstract_map import AbstractArea, AbstractList, AbstractOccupancy, NeedsMapError
from scenicq.geometry.elements import Intersection, NetworkElement
from scenicq.geometry.links import AHEAD, AHEAD_M, LISTS, find_link
from scenicq.geometry.network import Network
from scenicq.geometry.occupancy import ElementAtPoint

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["among", "follow_link", "going_of", "look_up", "look_up_of", "look_up_ways"]

_WITH_NOTHING = 2
"""Outcomes of a look-up over an abstract map: any element, and none."""


def look_up_of(run: Interpreter, owner: Instance, name: str, reject: ModelValue, span: Span) -> ModelValue:
    """What lies where an object is: of several lanes one that leads the way it goes.

    Args:
        run: The interpreter.
        owner: The object.
        name: Which look-up of the network.
        reject: Whether there is no scene where there is no element.
        span: Where it is asked for.

    Raises:
        ScenarioError: As `look_up`.
    """
    going = going_of(run, owner, span) if LOOKUPS[name][0] == "lane" else ()
    return look_up(run, run.network, name, owner, reject, span, going)


def going_of(run: Interpreter, owner: Instance, span: Span) -> tuple[Node, ...]:
    """Which way an object goes and the last lane of its track; nothing where all lanes are its own."""
    if run.lanes == "any" or owner.index is None:
        return ()
    if GOING not in owner.properties:
        owner.properties[GOING] = to_heading(owner, span)
        # who is in a scene has been nowhere before
        owner.properties[LAST_LANE] = build.constant(None, span)
    return tuple(to_node(property_node(owner, name, span), span) for name in (GOING, LAST_LANE))


def look_up(
    run: Interpreter,
    network: Network,
    name: str,
    point: ModelValue,
    reject: ModelValue,
    span: Span,
    going: tuple[Node, ...] = (),
) -> ModelValue:
    """`network.laneAt(point)` and its like.

    Args:
        run: The interpreter.
        network: The network.
        name: Which look-up.
        point: The place.
        reject: Whether there is no scene where there is no element; then the result is never None.
        span: The call.
        going: Which way goes who is there and the last lane of its track, where that tells its lanes from others.

    Raises:
        ScenarioError: impossible-requirement, where there is no element at a known place but must be.
    """
    table = run.lookups.table((id(network), name), lambda: LookupTable.of_network(network, name))
    known = getattr(network, name, None)
    return _at(run, (id(network), name), table, point, reject, span, known, going=going)


def follow_link(run: Interpreter, choice: Choice, name: str, span: Span) -> ModelValue:
    """What an attribute of the element at a place leads to, over an abstract map: a look-up at the same place.

    Args:
        run: The interpreter.
        choice: The element; an option of it is abstract.
        name: The attribute.
        span: Where it is asked for.

    Raises:
        NeedsMapError: The attribute is no link of all such elements, or may be one of something else.
    """
    known = run.lookups.abstract.get(id(choice.index))
    if known is None or len(choice.options) != _WITH_NOTHING or choice.options[0] is not known.element:
        raise NeedsMapError
    kind, there = known.element.kind, known.element.found
    found = find_link(kind, name)
    listed = name in LISTS.get(kind, {})
    if choice.options[1] is not None or not (found or listed or (kind, name) == ("lane", AHEAD)):
        raise NeedsMapError
    # None has no attributes
    run.excluded.add(choice.index, [1], _WITH_NOTHING, span)
    if found is not None:
        link, needed = found
        return _linked(run, known, (known.key, link), there.through(link), span, needed=needed)
    if listed:
        inside = there.through(name)

        def draw(span: Span) -> ModelValue:
            # each draw is one of its own
            key = (known.key, name, len(run.lookups.tables))
            return _linked(run, known, key, there.through(name, is_drawn=True), span, needed=True)

        return AbstractList(inside, draw, lambda span: _linked(run, known, (known.key, name), inside, span))
    return Builtin(name, lambda span, distance=50: _area_ahead(run, choice, there, distance, span))


def _linked(
    run: Interpreter, known: AbstractLookup, key: object, found: AbstractOccupancy, span: Span, *, needed: bool = False
) -> Choice:
    """What an element leads to, as a look-up where it lies."""
    table = run.lookups.table(key, lambda: LookupTable.of_any(found, known.table.family, run.network))
    if not table.options:
        raise NeedsMapError
    index = run.lookups.index(key, table, known.place, known.going, span)
    if needed:
        run.excluded.add(index, [1], _WITH_NOTHING, span)
    return Choice(index, (*run.lookups.options(table, index), None), _WITH_NOTHING)


def _area_ahead(run: Interpreter, choice: Choice, there: AbstractOccupancy, distance: ModelValue, span: Span) -> Node:
    """What `lanesAhead` of the lane at a place gives, over an abstract map."""
    number = as_constant(run, distance)
    number = number.value if isinstance(number, Constant) else number
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 <= number <= AHEAD_M:
        raise NeedsMapError
    area = AbstractArea(there.through(AHEAD, within=float(number)), run.network.roadDirection)
    nowhere = Undefined("there is no such element here")
    return Select(choice.index, (build.constant(area, span), build.constant(nowhere, span)), span=span)


def among(
    run: Interpreter, elements: Sequence[NetworkElement], name: str, point: ModelValue, reject: ModelValue, span: Span
) -> ModelValue:
    """The same among some elements only, as in `road.laneAt(point)`."""
    key = (name, tuple(element.id for element in elements))
    table = run.lookups.table(key, lambda: LookupTable.of_layers(name, f"{name} {key}", [own(elements)]))
    return _at(run, key, table, point, reject, span, None)


def look_up_ways(run: Interpreter, intersection: Intersection, point: ModelValue, span: Span) -> ModelValue:
    """`intersection.maneuversAt(point)`: the ways through it that pass a point."""
    key, name = ("maneuversAt", intersection.id), f"maneuversAt of {intersection.id}"
    if not intersection.maneuvers:
        return ()
    table = run.lookups.table(key, lambda: LookupTable.of_layers(name, name, ways_everywhere(intersection)))
    return _at(run, key, table, point, None, span, lambda x, y: ways_at(intersection, x, y), ())


def _at(
    run: Interpreter,
    key: object,
    table: LookupTable,
    point: ModelValue,
    reject: ModelValue,
    span: Span,
    known: Callable[[float, float], ModelValue] | None,
    nothing: ModelValue = None,
    going: tuple[Node, ...] = (),
) -> ModelValue:
    run.budget.step(span, run.budget.LOOK_UP_STEPS)
    place = to_vector(point, span)
    certain = as_constant(run, place)
    if isinstance(certain, Constant):
        options = (*table.options, nothing)
        x, y = cast(Vector, certain.value)
        heading = as_constant(run, going[0]) if going else None
        if isinstance(heading, Constant) and isinstance(heading.value, float):
            first = ElementAtPoint(table.occupancy, 0, by_heading=True)
            found = options[round(first.along(x, y, heading.value) * table.occupancy.scale)]
        else:
            found = options[table.occupancy.at(x, y)[0]] if known is None else known(x, y)
        if found is None and reject:
            raise fail("impossible-requirement", f"there is nothing for `{table.occupancy.name}` at this point", span,
                       "no scene is left", ("without `reject`, the result is None",))  # fmt: skip
        return found
    if not table.options:
        if reject:
            raise fail("map-lacks", f"the map has nothing for `{table.occupancy.name}`", span, "there is none",
                       ("the map of another dataset may have it",))  # fmt: skip
        return None
    index = run.lookups.index(key, table, place, going, span)
    options = (*run.lookups.options(table, index), nothing)
    run.budget.step(span, len(options) // run.budget.ITEMS_PER_STEP)
    if reject:
        run.excluded.add(index, [len(table.options)], len(options), span)
    return Choice(index, options, len(options))
