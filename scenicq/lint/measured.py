"""What the text of a program gives away of angles, and of what is measured between two objects."""

from __future__ import annotations

import math
from collections.abc import Iterator

from scenicq.errors import Diagnostic
from scenicq.lint.terms import (
    ANGLE_PROPERTIES,
    ORDERS,
    Values,
    compared_sides,
    is_angle,
    literal_number,
    make_warning,
    order_of,
    terms,
    text_of,
)
from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import walk

__all__ = ["lint_measured"]

_FULL_TURN = math.tau * (1 + 1e-9)
_BACK = math.radians(160)
"""A heading beyond which almost everything faces the other way."""
_POINTS = frozenset({"Point", "OrientedPoint"})


def lint_measured(nodes: list[ast.SyntaxNode], values: Values) -> Iterator[Diagnostic]:
    """What the text gives away of angles and measures.

    Args:
        nodes: All of the program.
        values: What its names stand for.
    """
    for node in nodes:
        yield from _angles(node, values)
        yield from _deviations(node, values)
        yield from _sums(node)
        yield from _differences(node)
    yield from _signed(nodes)
    yield from _facing_objects(nodes)
    yield from _from_ego(nodes)


def _angles(node: ast.SyntaxNode, values: Values) -> Iterator[Diagnostic]:
    """Numbers of more than a full turn where an angle stands."""
    places: list[ast.SyntaxNode] = []
    match node:
        case ast.Phrase():
            places += node.of_kind("heading")
        case ast.WithSpecifier(property=name) if name in ANGLE_PROPERTIES:
            places = [node.value]
        case ast.PropertyDefault(name=name) if name in ANGLE_PROPERTIES:
            places = [node.value]
        case ast.ComparisonChain():
            sides = compared_sides(node)
            if any(map(is_angle, sides)):
                places = [side for side in sides if not is_angle(side)]
        case _:
            pass
    for place in places:
        for term in terms(place, values):
            value = literal_number(term)
            if value is not None and abs(value) > _FULL_TURN and not ast.is_phrase(term, phrases.DEG):
                text = term.span.text
                yield make_warning(
                    "angle-without-deg", f"`{text}` is an angle of {abs(value) / math.tau:.1f} full turns", term.span,
                    "angles are in radians", f"write `{text} deg` for degrees",
                )  # fmt: skip


def _deviations(node: ast.SyntaxNode, values: Values) -> Iterator[Diagnostic]:
    """Plain numbers for how an object is turned from the road: metres beside its lane may be meant, or degrees."""
    match node:
        case ast.WithSpecifier(property="roadDeviation", value=place):
            pass
        case ast.PropertyDefault(name="roadDeviation", value=place):
            pass
        case _:
            return
    for term in terms(place, values):
        value = literal_number(term)
        if value and abs(value) <= _FULL_TURN and not ast.is_phrase(term, phrases.DEG):
            text, degrees = term.span.text, f"{math.degrees(value):.3g} deg"
            yield make_warning(
                "deviation-without-deg", f"`roadDeviation` turns an object from the road, `{text}` by {degrees}",
                term.span, "an angle in radians", f"write `{degrees}`, or `{text} deg` for degrees",
                "`left of SPOT by M` and `right of SPOT by M` place an object M metres beside a spot",
            )  # fmt: skip


def _facing_objects(nodes: list[ast.SyntaxNode]) -> Iterator[Diagnostic]:
    """Objects where a heading stands: their own heading is taken, not the direction to them."""
    objects = {"ego"}
    for node in nodes:
        match node:
            case ast.Assign(value=ast.New(cls=ast.Name(id=cls))) if cls not in _POINTS:
                objects |= {target.id for target in node.targets if isinstance(target, ast.Name)}
            case _:
                pass
    for node in nodes:
        match node:
            case ast.Phrase(row=phrases.FACING, operands=(ast.Name(id=name) as heading,)) if name in objects:
                yield make_warning(
                    "facing-object", f"`facing {name}` is the direction in which `{name}` itself faces", heading.span,
                    "taken for its heading", f"`facing toward {name}` turns to it",
                    f"`facing {name}.heading` says that its heading is meant",
                )  # fmt: skip
            case _:
                pass


def _signed(nodes: list[ast.SyntaxNode]) -> Iterator[Diagnostic]:
    """Angles that are bounded from above alone, by an amount: they may be as far to the right as they like."""
    pairs = [(node, *each) for node in nodes if isinstance(node, ast.ComparisonChain) for each in order_of(node)]
    right = "negative to the right"
    for end_at, angle_at, least, sign, verb, why in (
        (1, 2, _BACK, ">", "has", f"{right}, down to -180 deg: half of what faces the other way is left out"),
        (2, 1, 0.0, "<", "bounds", f"{right}, so every angle to the right is below {{end}}"),
    ):
        bounded = {text_of(each[end_at]) for each in pairs}
        for each in pairs:
            end, angle = each[end_at], each[angle_at]
            size, text = literal_number(end), text_of(angle)
            if not isinstance(angle, ast.Phrase) or not is_angle(angle) or size is None or text in bounded:
                continue
            if least < size < math.pi:
                yield make_warning(
                    "angle-without-abs", f"`{text}` is {why.format(end=text_of(end))}", each[0].span,
                    "bounds one side alone", f"`abs({text}) {sign} {text_of(end)}` {verb} both sides",
                )  # fmt: skip


def _sums(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Two headings one of which is said relative to the other: that is their sum."""
    match node:
        case ast.Phrase(
            row=phrases.RELATION,
            operands=(ast.Attribute(name="heading") as one, ast.Attribute(name="heading") as other),
        ):
            yield make_warning(
                "angle-sum", f"`{text_of(node)}` is the sum of the two headings", node.span,
                "adds a turn to a direction",
                f"`relative heading of {text_of(one.value)} from {text_of(other.value)}` is their difference",
            )  # fmt: skip
        case _:
            pass


def _differences(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Differences of two directions in an order: they jump by a full turn where one passes the seam."""
    if not isinstance(node, ast.ComparisonChain):
        return
    for side in [node.left, *(each.right for each in node.comparisons if each.operator in ORDERS)]:
        match side:
            case ast.Call(function=ast.Name(id="abs"), arguments=(argument,)):
                inner = argument.value
            case _:
                inner = side
        match inner:
            case ast.BinaryOp(operator="-", left=left, right=right) if _are_directions(left, right):
                ends = (text_of(each.value if isinstance(each, ast.Attribute) else each) for each in (left, right))
                one, other = (f"({each})" if " " in each else each for each in ends)
                yield make_warning(
                    "angle-difference",
                    f"`{text_of(inner)}` is off by a full turn where the two lie on either side of south", inner.span,
                    "350 deg where -10 deg is meant",
                    f"`relative heading of {one} from {other}` lies within half a turn",
                )  # fmt: skip
            case _:
                pass


def _are_directions(left: ast.SyntaxNode, right: ast.SyntaxNode) -> bool:
    """Whether both are directions on the map, one of them that of an object, which may face anywhere."""
    headings = [isinstance(each, ast.Attribute) and each.name == "heading" for each in (left, right)]
    return any(headings) and all(
        heading or (isinstance(each, ast.Phrase) and each.row in phrases.DIRECTIONS)
        for heading, each in zip(headings, (left, right), strict=True)
    )


def _left_out(node: ast.SyntaxNode) -> tuple[ast.Phrase, str, str] | None:
    """A measure between a name and the ego, which nothing names: it, the name, and `to` or `from`, the ego's word."""
    match node:
        case ast.Phrase(row=row) if row.measures:
            for operand, value in zip(row.operands, node.operands, strict=True):
                match node.given:
                    case [ast.Name(id=name)] if value is None and operand.is_ego:
                        return node, name, operand.word
                    case _:
                        pass
        case _:
            pass
    return None


def _from_ego(nodes: list[ast.SyntaxNode]) -> Iterator[Diagnostic]:
    """What is measured from the ego, as nothing else is said, where another object must or may be meant."""
    for measure, name, word in filter(None, map(_left_out, nodes)):
        if name == "ego":
            text = text_of(measure)
            yield make_warning(
                "measured-from-ego", f"`{text}` is measured {word} the ego, too: from itself to itself", measure.span,
                "of the ego alone", f"`{text} {word} X` says {word} what; in a behavior, `self` is who behaves so",
            )  # fmt: skip
    behaving = _behaving(nodes)
    objects = {
        target.id for node in nodes if isinstance(node, ast.Assign) and isinstance(node.value, ast.New)
        for target in node.targets if isinstance(target, ast.Name)
    }  # fmt: skip
    for definition in nodes:
        if not isinstance(definition, ast.DynamicDefinition) or definition.kind != "behavior":
            continue
        who = behaving.get(definition.name, {"ego"})
        for measure, name, word in filter(None, map(_left_out, walk(*definition.body))):
            if "ego" not in who and name in objects - who - {"ego"}:
                text = text_of(measure)
                yield make_warning(
                    "measured-from-ego", f"`{text}` is measured {word} the ego, whoever behaves so", measure.span,
                    f"not {word} `self`", f"write `{text} {word} self`",
                )  # fmt: skip


def _behaving(nodes: list[ast.SyntaxNode]) -> dict[str, set[str]]:
    """The objects that have each behavior, by name; of one that has none, an empty name."""
    found: dict[str, set[str]] = {}
    named = {id(node.value): node for node in nodes if isinstance(node, ast.Assign)}
    for node in nodes:
        for each in node.specifiers if isinstance(node, ast.New) else ():
            match each:
                case ast.WithSpecifier(
                    property="behavior", value=ast.Name(id=behavior) | ast.Call(function=ast.Name(id=behavior))
                ):
                    targets = named[id(node)].targets if id(node) in named else ()
                    names = {target.id for target in targets if isinstance(target, ast.Name)}
                    found.setdefault(behavior, set()).update(names or {""})
                case _:
                    pass
    return found
