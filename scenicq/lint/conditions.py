"""What a compiled program gives away on a map: requirements that always or never hold, boxes that fit nowhere.

Intervals tell whether a requirement can fail or hold: headings lie within half a turn, speeds and sizes are not
negative, positions lie near the map. What intervals leave open is not spoken of.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import cast

from shapely import minimum_rotated_rectangle
from shapely.geometry import MultiPolygon, Polygon

from scenicq.compiler.temporal import is_temporal
from scenicq.errors import Diagnostic, Span
from scenicq.forest.bounds import Box, scalar_bounds
from scenicq.forest.build import opposite
from scenicq.forest.condition import expand
from scenicq.forest.nodes import (
    MIRRORED,
    Compare,
    CompareOp,
    Constant,
    Encloses,
    Feature,
    Identity,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Normal,
    Range,
    RectangleAt,
    Select,
    VectorOf,
)
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.forest.value_numbers import ValueNumbers
from scenicq.forest.walk import features, leaves, postorder, transform
from scenicq.geometry import shapes
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.network import Network
from scenicq.geometry.regions import Nowhere, PolygonSet, PolylineSet
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.store.classes import ancestors, fold, is_class
from scenicq.syntax import ast

__all__ = ["lint_scenario"]

_FREE_TO_TURN = frozenset({"Pedestrian", "Animal", "Prop"})
"""Classes whose objects may face anywhere unless a program says otherwise."""
_CHANGING = frozenset({"speed", "acceleration", "angularSpeed"})
_BEYOND_MAP_M = 200.0
"""How far beyond the edges of the map labels may lie."""
_MOST_POLYGONS = 2000
_ROUNDING_M = 0.01
_NEAR_M = 1.0
"""A tolerance of positions below which few recorded objects stand at a point that a program names."""


def _warning(code: str, message: str, span: Span | None, label: str, *hints: str) -> Diagnostic:
    return Diagnostic(code, message, span, label, hints=hints, severity="warning")


def lint_scenario(
    scenario: Scenario, body: tuple[ast.Statement, ...], network: Network | None, options: MatchOptions
) -> Iterator[Diagnostic]:
    """What a program gives away once it is compiled over a map.

    Args:
        scenario: As compiled, not made ready.
        body: Its text.
        network: The map; None where a made-up street stands in for one.
        options: Classes.
    """
    yield from _dropped(scenario, body)
    box = None if network is None else _map_box(network)
    for requirement in scenario.requirements:
        if requirement.built_in is None:
            yield from _constant(requirement, box)
            if network is not None:
                yield from _too_large(scenario, requirement)
    yield from _exclusive(scenario)
    yield from _unbounded(scenario)
    yield from _folded(scenario, options)
    yield from _headings(scenario)
    yield from _mutated(scenario)
    yield from _exact(scenario, options)
    yield from _exact_places(scenario, options)


def _dropped(scenario: Scenario, body: tuple[ast.Statement, ...]) -> Iterator[Diagnostic]:
    """Requirements that are known to hold without a scene: the compiler has left them out."""
    kept = {each.span for each in (*scenario.requirements, *scenario.soft)}
    for statement in body:
        if isinstance(statement, ast.Require) and statement.span not in kept and not is_temporal(statement.condition):
            yield _always(statement.span)


def _always(span: Span | None) -> Diagnostic:
    return _warning("requirement-always", "this requirement holds in every scene", span, "excludes nothing")


def _map_box(network: Network) -> Box | None:
    region = network.drivableRegion
    if isinstance(region, Nowhere):
        return None
    west, south, east, north = region_bounds(region)
    far = _BEYOND_MAP_M
    return (west - far, east + far), (south - far, north + far)


def _between(low: float, high: float) -> Node:
    return Range(Constant(low), Constant(high))


def _of_label(feature: Feature, box: Box | None) -> Node:
    """A number that can have any value that a label may have for a feature."""
    if feature.property == "position" and box is not None:
        return VectorOf(_between(*box[0]), _between(*box[1]))
    match feature.property:
        case "heading":
            return _between(-math.pi, math.pi)
        case "speed" | "width" | "length" | "height":
            return _between(0.0, math.inf)
        case _:
            return feature


def _constant(requirement: Requirement, box: Box | None) -> Iterator[Diagnostic]:
    """A requirement that intervals decide."""
    memo: dict[int, Node] = {}
    bounded = transform(
        requirement.condition, lambda node: _of_label(node, box) if isinstance(node, Feature) else node, memo
    )
    truth = _truth(bounded)
    if truth is True:
        yield _always(requirement.span)
    elif truth is False:
        where = "" if box is None else " on this map"
        yield _warning(
            "requirement-never", f"no scene{where} satisfies this requirement", requirement.span,
            "excludes everything",
        )  # fmt: skip


def _truth(root: Node) -> bool | None:
    """Whether a condition is known to hold or to fail; None where intervals do not tell."""
    found: dict[int, bool | None] = {}
    for node in postorder((root,)):
        match node:
            case Constant(value=bool() as value):
                found[id(node)] = value
            case Compare():
                found[id(node)] = _order(node)
            case Logic():
                args = [found.get(id(arg)) for arg in node.args]
                found[id(node)] = _logic(node.op, args)
            case _:
                found[id(node)] = None
    return found[id(root)]


def _logic(op: LogicOp, args: list[bool | None]) -> bool | None:
    match op:
        case LogicOp.NOT:
            return None if args[0] is None else not args[0]
        case LogicOp.AND:
            return False if False in args else None if None in args else True
        case LogicOp.OR:
            return True if True in args else None if None in args else False


def _order(node: Compare) -> bool | None:
    if node.op in (CompareOp.EQ, CompareOp.NE):
        return None
    left, right = scalar_bounds(node.left), scalar_bounds(node.right)
    if node.op in (CompareOp.GT, CompareOp.GE):
        left, right = right, left
    strict = node.op in (CompareOp.LT, CompareOp.GT)
    if left[1] < right[0] or (not strict and left[1] == right[0]):
        return True
    if left[0] > right[1] or (strict and left[0] == right[1]):
        return False
    return None


_End = tuple[float, bool, Span | None]
"""A bound, what breaks a tie between equal ones, and the requirement that it is of."""


def _exclusive(scenario: Scenario) -> Iterator[Diagnostic]:
    """Requirements that bound the same number so that nothing is left."""
    numbers = ValueNumbers()
    ends: dict[int, tuple[_End, _End]] = {}
    for requirement in scenario.requirements:
        for compared, op, number in () if requirement.built_in is not None else _bounds(requirement.condition):
            which = numbers.expression(compared)
            low, high = ends.get(which, ((-math.inf, False, None), (math.inf, False, None)))
            strict = op in (CompareOp.LT, CompareOp.GT)
            if op in (CompareOp.LT, CompareOp.LE):
                high = min(high, (number, not strict, requirement.span), key=lambda end: end[:2])
            else:
                low = max(low, (number, strict, requirement.span), key=lambda end: end[:2])
            if low[0] > high[0] or (low[0] == high[0] and (low[1] or not high[1])):
                spans = sorted((each for each in (low[2], high[2]) if each is not None), key=lambda each: each.start)
                if len(spans) == 2:
                    line = spans[0].source.position(spans[0].start)[0]
                    beside = "both sides of this requirement" if spans[0] == spans[1] else f"this and line {line}"
                    yield _warning(
                        "requirement-never", f"no scene satisfies {beside}", spans[1], "excludes everything",
                    )  # fmt: skip
                return
            ends[which] = low, high


def _bounds(condition: Node) -> Iterator[tuple[Node, CompareOp, float]]:
    """The numbers that a condition bounds by a number, whatever else it asks."""
    stack = [condition]
    while stack:
        match stack.pop():
            case Logic(op=LogicOp.AND, args=args):
                stack += args
            case Logic(op=LogicOp.NOT, args=(Compare() as compare,)):
                stack.append(opposite(compare))
            case Compare(op, compared, Constant(value=int() | float() as number)) if op in MIRRORED:
                yield compared, op, float(number)
            case Compare(op, Constant(value=int() | float() as number), compared) if op in MIRRORED:
                yield compared, MIRRORED[op], float(number)
            case _:
                pass


def _unbounded(scenario: Scenario) -> Iterator[Diagnostic]:
    """Orders of numbers one side of which is random, without bounds, and said nowhere else."""
    given = [each.value for owner in scenario.objects for each in owner.properties.values() if each.explicit]
    asked = [each for each in scenario.requirements if each.built_in is None]
    roots = [*given, *(each.condition for each in (*asked, *scenario.soft))]
    # whether a number stands in one root alone; what is drawn of it there is for that root to choose
    uses = Counter(leaf for root in roots for leaf in {each.identity for each in leaves(root)})
    for requirement in asked:
        free = (
            side
            for node in postorder((requirement.condition,))
            if isinstance(node, Compare) and node.op in MIRRORED
            for side in (node.left, node.right)
            if _is_free(side, uses)
        )
        for side in free:
            written = _written(side.span) if side.span is not None else "a number"
            yield _warning(
                "unbounded-number", f"`{written}` may come out as any number: one of them lets this hold",
                requirement.span, "excludes nothing", "`TruncatedNormal(mean, deviation, low, high)` has bounds",
            )  # fmt: skip


def _is_free(side: Node, uses: Mapping[Identity, int]) -> bool:
    """Whether a side of an order is a random number without bounds that nothing else reads."""
    drawn = leaves(side)
    alone = len(drawn) == 1 and isinstance(drawn[0], Normal) and uses[drawn[0].identity] == 1
    return alone and not features(side) and scalar_bounds(side) == (-math.inf, math.inf)


# --- boxes


def _too_large(scenario: Scenario, requirement: Requirement) -> Iterator[Diagnostic]:
    """`in` of an object whose box fits into no part of the region."""

    def sized(feature: Feature) -> Node | None:
        if feature.property in ("width", "length"):
            return scenario.objects[feature.object].properties[feature.property].value
        return None

    for node in postorder((requirement.condition,)):
        if not (isinstance(node, Encloses) and isinstance(node.inner, RectangleAt)):
            continue
        outers = node.outer.options if isinstance(node.outer, Select) else (node.outer,)
        regions = [outer.value for outer in outers if isinstance(outer, Constant)]
        if len(regions) < len(outers) or not all(isinstance(each, PolygonSet | PolylineSet) for each in regions):
            continue
        width, length = (scalar_bounds(expand(side, sized))[0] for side in (node.inner.width, node.inner.length))
        if not (math.isfinite(width) and math.isfinite(length)):
            continue
        short, long = sorted((width, length))
        if not any(_fits(region, short, long) for region in regions if isinstance(region, PolygonSet)):
            # what the program calls it is what stands there; the map may call it otherwise
            written = _written(node.span).rpartition(" in ")[2] if node.span is not None else ""
            name = written or cast("PolygonSet | PolylineSet", regions[0]).name
            where = f"`{name}`" if len(regions) == 1 else "any of these"
            yield _warning(
                "box-cannot-fit", f"a box of {width:.3g} m by {length:.3g} m fits nowhere into {where}",
                requirement.span, "the whole box must lie inside",
                "`X.position in R` asks of the centre of `X` alone",
            )  # fmt: skip


def _fits(region: PolygonSet, short: float, long: float) -> bool:
    """Whether a box may fit into a part of a region, by the parts' smallest rectangles."""
    if any(_may_hold(shape, short, long) for shape in region.polygons):
        return True
    if len(region.polygons) > _MOST_POLYGONS:
        return True
    joined = shapes.union_all(region.polygons)
    parts = joined.geoms if isinstance(joined, MultiPolygon) else (joined,)
    return any(_may_hold(part, short, long) for part in parts if isinstance(part, Polygon))


def _may_hold(shape: Polygon | MultiPolygon, short: float, long: float) -> bool:
    if shape.is_empty or shape.area < short * long:
        return False
    frame = minimum_rotated_rectangle(shape)
    if not isinstance(frame, Polygon):
        return False
    corners = list(frame.exterior.coords)
    sides = sorted(math.dist(corners[place], corners[place + 1]) for place in (0, 1))
    return sides[0] >= short - _ROUNDING_M and sides[1] >= long - _ROUNDING_M


# --- classes


def _folded(scenario: Scenario, options: MatchOptions) -> Iterator[Diagnostic]:
    """Classes that the program names and `--classes coarse` does not tell from others."""
    told: dict[str, None] = {}
    for owner in scenario.objects:
        if options.classes == "fine" or owner.category in told or not is_class(owner.category):
            continue
        folded = fold(owner.category, options.classes)
        if folded != owner.category:
            told[owner.category] = None
            yield _warning(
                "class-folded", f"with coarse classes `{owner.category}` matches every `{folded}`", owner.span,
                "this class is folded", "`--classes fine` tells them apart",
            )  # fmt: skip


# --- headings


def _headings(scenario: Scenario) -> Iterator[Diagnostic]:
    """Objects that may face anywhere by their class, but not by the specifier that places them."""
    for owner in scenario.objects:
        position, heading = (owner.properties.get(name) for name in ("position", "heading"))
        if position is None or heading is None or not position.explicit or position.span is None:
            continue
        given = not heading.explicit or heading.span == position.span
        turns = any(isinstance(node, Range) for node in postorder((heading.value,)))
        if given and not turns and is_class(owner.category) and _FREE_TO_TURN & set(ancestors(owner.category)):
            placed = _written(position.span)
            yield _warning(
                "heading-implied", f"`{placed}` also says which way `{owner.name}` faces", position.span,
                "gives its heading, too", "`facing Range(0, 360) deg` lets it face anywhere",
            )  # fmt: skip


# --- noise


def _mutated(scenario: Scenario) -> Iterator[Diagnostic]:
    """Places and directions that the program gives, and that noise without bound takes back."""
    lost: dict[Span, str] = {}
    for owner in scenario.objects:
        for name in sorted(owner.mutated & owner.properties.keys()):
            given = owner.properties[name]
            if given.explicit and given.span is not None:
                lost.setdefault(given.span, owner.name)
    if lost:
        names = ", ".join(f"`{name}`" for name in dict.fromkeys(lost.values()))
        yield _warning(
            "mutated-place", f"where the program puts {names} excludes nothing: `mutate` adds noise without bound",
            min(lost, key=lambda span: span.start), "may be anywhere",
            "leave `mutate` out: `--tolerance` allows for what is not exact",
        )  # fmt: skip


def _written(span: Span) -> str:
    return " ".join(span.text.split())


# --- numbers that labels measure


def _exact(scenario: Scenario, options: MatchOptions) -> Iterator[Diagnostic]:
    """Numbers that change from label to label, given exactly and compared without tolerance."""
    tolerance = options.tolerance.for_scenario(scenario)
    if tolerance.position <= EXACT.position:
        return  # labels are said to be generated
    for owner in scenario.objects:
        for name in _CHANGING & owner.properties.keys():
            given = owner.properties[name]
            if (
                given.explicit
                and isinstance(given.value, Constant)
                and tolerance.of(owner.index, name).size <= EXACT.other
            ):
                number = f"{given.value.value:g}"
                yield _warning(
                    "exact-number", f"`{name}` will almost never be exactly {number}: measurements are not exact",
                    given.span, "compared without tolerance",
                    f"`--tolerance {name}=0.5` allows for it, as does `Range(a, b)` instead of {number}",
                )  # fmt: skip


def _exact_places(scenario: Scenario, options: MatchOptions) -> Iterator[Diagnostic]:
    """One point beside another object, to within a small tolerance."""
    tolerance = options.tolerance.for_scenario(scenario)
    if tolerance.position <= EXACT.position:
        return  # labels are said to be generated
    for owner in scenario.objects:
        given = owner.properties.get("position")
        if given is None or not given.explicit or given.span is None or "position" in owner.mutated:
            continue
        near = tolerance.of(owner.index, "position").size
        nodes = list(postorder((given.value,)))
        beside = any(isinstance(node, Feature) and node.object != owner.index for node in nodes)
        if beside and near < _NEAR_M and not any(isinstance(node, Leaf | Select) for node in nodes):
            yield _warning(
                "exact-place",
                f"`{_written(given.span)}` is one point: `{owner.name}` must stand within {near:g} m of it", given.span,
                "a place without extent", "`at ego offset by Range(-2, 2) @ Range(3, 30)` is an area",
            )  # fmt: skip
