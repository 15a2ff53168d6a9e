"""What a program asks of a map that has none of it: no frame on that map can match, and the user is told."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import cast

from scenicq.compiler.values import fail
from scenicq.errors import Note
from scenicq.forest.nodes import (
    Constant,
    DirectionAt,
    Encloses,
    Logic,
    LogicOp,
    Node,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Select,
    Undefined,
    Value,
)
from scenicq.forest.scenario import BuiltIn, Requirement, Scenario, ScenarioObject
from scenicq.forest.walk import children
from scenicq.geometry.regions import DifferenceOf, IntersectionOf, PolygonSet, PolylineSet, UnionOf
from scenicq.geometry.road_direction import RoadDirection

__all__ = ["absent_parts", "check_directions", "check_enforced", "list_names"]


def absent_parts(area: Node) -> tuple[str, ...] | None:
    """What an area consists of, by the names of the map's parts, if none of it is on the map; None if some may be.

    Where its parts lie is not looked at: two that do not meet may have nothing in common.
    """
    found: list[tuple[str, ...] | None] = []
    todo: list[tuple[Node, tuple[Node, ...] | None]] = [(area, None)]
    while todo:
        node, parts = todo.pop()
        if parts is None:
            parts = _parts(node)
            if parts:
                todo += [(node, parts), *((part, None) for part in parts)]
            else:
                found.append(_absent(node.value) if isinstance(node, Constant) else None)
            continue
        each, found = found[-len(parts) :][::-1], found[: -len(parts)]
        missing = [names for names in each if names is not None]
        gone = bool(missing) if _is_common(node) else len(missing) == len(parts)
        found.append(tuple(dict.fromkeys(name for names in missing for name in names)) if gone else None)
    return found[0]


def _parts(area: Node) -> tuple[Node, ...]:
    """The regions without which a region has no point, or one of them."""
    match area:
        case Select():
            return area.options
        case RegionUnion() | RegionIntersection():
            return area.parts
        case RegionDifference():
            return (area.base,)
        case Constant(value=UnionOf() | IntersectionOf() as region):
            return tuple(Constant(part) for part in region.parts)
        case Constant(value=DifferenceOf() as region):
            return (Constant(region.base),)
        case _:
            return ()


def _is_common(area: Node) -> bool:
    return isinstance(area.value if isinstance(area, Constant) else area, RegionIntersection | IntersectionOf)


def _absent(value: Value) -> tuple[str, ...] | None:
    match value:
        case PolygonSet() | PolylineSet():
            # `road` is the area that one can drive on
            return None if not value.is_empty else ("road" if value.name == "drivable" else value.name,)
        case Undefined():
            return ()
        case _:
            return None


def check_directions(objects: Iterable[ScenarioObject], requirements: Iterable[Requirement]) -> None:
    """Refuse what depends on a direction of traffic on a map that has none: no label could ever match.

    Args:
        objects: Whose positions and headings are looked at.
        requirements: Those that must hold; Scenic's own are passed over.

    Raises:
        ScenarioError: map-lacks.
    """
    for owner in objects:
        for name in ("heading", "position"):
            given = None if name in owner.mutated else owner.properties.get(name)
            needed = None if given is None else _needed_direction(given.value)
            if given is None or needed is None:
                continue
            placed = given.explicit and given.span is not None
            hints = ("`facing Range(0, 360) deg` needs nothing from the map",) if name == "heading" else ()
            raise fail(
                "map-lacks", _NO_LANE.format(_named(needed)), given.span if placed else owner.span,
                "needs lanes" if placed else f"the default {name} of `{owner.category}` needs lanes", hints,
                (Note(needed.span, "the default"),) if needed.span is not None and not placed else (),
            )  # fmt: skip
    for requirement in requirements:
        needed = _needed_direction(requirement.condition) if requirement.built_in is None else None
        if needed is not None:
            raise fail("map-lacks", _NO_LANE.format(_named(needed)), needed.span or requirement.span, "needs lanes",
                       ("leave out what needs it",))  # fmt: skip


def check_enforced(scenario: Scenario, enforced: Collection[BuiltIn]) -> None:
    """Refuse to enforce that objects lie where their class wants them, on a map that has no such place.

    Args:
        scenario: The scenario.
        enforced: Scenic's own requirements that are in force.

    Raises:
        ScenarioError: map-lacks.
    """
    for requirement in scenario.requirements:
        kind, condition = requirement.built_in, requirement.condition
        if kind is None or kind not in enforced or not isinstance(condition, Encloses):
            continue
        names = absent_parts(condition.outer)
        if names is not None:
            owner = scenario.objects[requirement.objects[0]]
            raise fail(
                "map-lacks", f"the map `{scenario.map}` has nothing for {list_names(names)}", owner.span,
                f"`--enforce {kind.value}` wants `{owner.name}` inside",
                ("without it the map is not needed",),
                (Note(requirement.span, "the default"),) if requirement.span not in (None, owner.span) else (),
            )  # fmt: skip


def list_names(names: Iterable[str]) -> str:
    """Names of parts of a map, as messages give them."""
    return " and ".join(f"`{name}`" for name in names) or "this"


_NO_LANE = "the map has no lane whose direction `{}` could be"


def _fields(node: DirectionAt) -> list[Value]:
    options = node.field.options if isinstance(node.field, Select) else (node.field,)
    return [option.value if isinstance(option, Constant) else None for option in options]


def _named(node: DirectionAt) -> str:
    return cast(RoadDirection, _fields(node)[0]).name


def _needed_direction(root: Node) -> DirectionAt | None:
    """A direction of traffic without which an expression has no value, or does not hold, and that is nowhere.

    One side of an `or`, or an option of a choice, is none: the other may do.
    """
    todo: list[tuple[Node, LogicOp | None]] = [(root, LogicOp.AND)]
    seen: set[tuple[int, LogicOp | None]] = set()
    while todo:
        node, lost_by = todo.pop()
        if (id(node), lost_by) in seen:
            continue
        seen.add((id(node), lost_by))
        match node:
            case DirectionAt() if all(isinstance(each, RoadDirection) and each.is_nowhere for each in _fields(node)):
                return node
            case Logic(op=LogicOp.NOT):
                other = {LogicOp.AND: LogicOp.OR, LogicOp.OR: LogicOp.AND, None: None}[lost_by]
                todo += [(arg, other) for arg in node.args]
            case Logic():
                todo += [(arg, lost_by) for arg in node.args if node.op is lost_by]
            case Select():
                todo.append((node.index, None))
            case _:
                todo += [(child, None) for child in children(node)]
    return None
