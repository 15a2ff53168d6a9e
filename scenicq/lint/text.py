"""What the text of a program alone gives away: what asks nothing, reversed ranges, names that nothing uses."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import cache

from scenicq.compiler.models import library_texts
from scenicq.compiler.roots import root_classes
from scenicq.errors import Diagnostic, similar
from scenicq.lint.measured import lint_measured
from scenicq.lint.terms import (
    ANGLE_PROPERTIES,
    ORDERS,
    Values,
    compared_sides,
    is_angle,
    links,
    literal_number,
    make_warning,
    set_once,
    terms,
    text_of,
)
from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import walk

__all__ = ["lint_text"]

_FASTEST_MPS = 45.0
"""What few vehicles on roads reach: the most that Scenic's own vehicles drive."""
_MEASURED = frozenset({"speed", "width", "length", "height", "x", "y", "acceleration", "angularSpeed"})
_SPEEDS_ELSEWHERE = re.compile(r"\b(km/?h|kmph|kph|mph)\b", re.IGNORECASE)
_SPEEDS_HERE = re.compile(r"\bm(/s|ps\b)|met(er|re)s? (a|per) second", re.IGNORECASE)
_DIGITS = re.compile(r"\d+(\.\d+)?")
_IN_METRES_A_SECOND = {"mph": " * 0.447"}
_RANGES = frozenset({"Range", "DiscreteRange", "TruncatedNormal"})
_VIEW = frozenset({"visibleDistance", "viewAngle", "viewAngles", "viewDistance"})
_READ_BY_MODELS = frozenset({"ego", "workspace", "simulation", "simulator", "_"})
_OF_SCENIC = frozenset({
    "viewAngles", "orientationStdDev", "angularVelocity", "baseOffset", "onDirection", "visionSensorOffset",
    "sideComponentThresholds", "lastActions", "pitch", "roll", "orientation", "shape", "contactTolerance", "occluding",
    "viewRayDensity", "viewRayCount", "viewRayDistanceScaling", "showVisibleRegion", "sensors", "render",
})  # fmt: skip
"""Properties that Scenic's own classes have, and that say nothing of a box in the plane."""


def lint_text(body: tuple[ast.Statement, ...], *, properties: bool) -> Iterator[Diagnostic]:
    """What the text of a program gives away.

    Args:
        body: The program.
        properties: Whether properties that no class has are named, too; with a dataset its labels say more.
    """
    nodes = list(walk(*body))
    values = set_once(body, nodes)
    for node in nodes:
        yield from _range(node)
        yield from _exact(node)
        yield from _alone(node)
        yield from _two(node)
        yield from _speeds(node, values)
        yield from _truths(node)
        yield from _units(node)
    yield from lint_measured(nodes, values)
    yield from _egos(body)
    yield from _unseen(nodes)
    yield from _unused(nodes)
    if properties:
        yield from _unknown_properties(nodes)


# --- statements


def _is_condition(node: ast.SyntaxNode) -> bool:
    match node:
        case ast.ComparisonChain():
            return True
        case ast.BoolOp():
            return all(map(_is_condition, node.values))
        case ast.UnaryOp(operator="not"):
            return _is_condition(node.operand)
        case _:
            return False


def _alone(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Conditions that are a statement of their own."""
    if isinstance(node, ast.ExpressionStatement) and _is_condition(node.value):
        yield make_warning(
            "condition-alone", "this condition asks nothing: no `require` stands before it", node.span,
            "is worked out and forgotten", f"write `require {text_of(node)}`",
        )  # fmt: skip


def _egos(body: tuple[ast.Statement, ...]) -> Iterator[Diagnostic]:
    """A second object that is called `ego`: the first one is there, too."""
    made = [
        each for each in body
        if isinstance(each, ast.Assign) and isinstance(each.value, ast.New)
        and any(isinstance(target, ast.Name) and target.id == "ego" for target in each.targets)
    ]  # fmt: skip
    for each in made[1:]:
        line = made[0].span.source.position(made[0].span.start)[0]
        yield make_warning(
            "ego-twice", f"the ego of line {line} is an object of the scene, too", each.span, "is the ego from here on",
            "give one of the two another name",
        )  # fmt: skip


def _two(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """`Uniform` of two numbers on both sides of 0: a range through 0 may be meant."""
    match node:
        case ast.Call(function=ast.Name(id="Uniform"), arguments=(first, second)):
            low, high = (literal_number(each.value) for each in (first, second))
            if low is not None and high is not None and low < 0 < high and (low, high) != (-1, 1):
                if any(ast.is_phrase(each.value, phrases.DEG) for each in (first, second)):
                    return
                one, other = (each.value.span.text for each in (first, second))
                yield make_warning(
                    "choice-of-two", f"this is {one} or {other}, and nothing between", node.span, "one of two numbers",
                    f"`Range({one}, {other})` is all between them",
                )  # fmt: skip
        case _:
            pass


def _truths(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Truth values in an order: as numbers they are 0 and 1."""
    if not isinstance(node, ast.ComparisonChain):
        return
    for left, operator, right in links(node):
        side = next((each for each in (left, right) if isinstance(each, ast.ComparisonChain | ast.BoolOp)), None)
        if operator in ORDERS and side is not None:
            whole = " ".join((text_of(left), operator, text_of(right)))
            yield make_warning(
                "truth-compared", f"`{text_of(side)}` is true or false, which are 1 and 0 as numbers", node.span,
                "compares a truth value", f"`{whole}` without brackets compares all three"
                if isinstance(side, ast.ComparisonChain) else "`and` and `or` join whole conditions",
            )  # fmt: skip


def _units(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Numbers beside which a comment says that they are speeds in another unit."""
    match node:
        case ast.Assign(value=value) | ast.ParamItem(value=value) | ast.WithSpecifier(property="speed", value=value):
            pass
        case _:
            return
    numbers = list(terms(value, {}))
    if not numbers or any(isinstance(each, ast.BinaryOp) for each in walk(value)):
        return
    last = value.span.source.line(value.span.source.position(value.span.end - 1)[0])
    comment = last[value.span.source.position(value.span.end - 1)[1] :].partition("#")[2]
    unit = _SPEEDS_ELSEWHERE.search(comment)
    said = {float(each.group()) for each in _DIGITS.finditer(comment)}
    if unit is None or _SPEEDS_HERE.search(comment) or (said and said.isdisjoint(map(literal_number, numbers))):
        return
    factor = _IN_METRES_A_SECOND.get(unit.group().lower(), " / 3.6")
    yield make_warning(
        "unit-in-comment", f"`{text_of(value)}` is taken as it is, whatever unit the comment names", value.span,
        "speeds are in m/s", f"write `{text_of(value)}{factor}` for {unit.group()}",
    )  # fmt: skip


# --- speeds


def _speeds(node: ast.SyntaxNode, values: Values) -> Iterator[Diagnostic]:
    """Speeds above what roads see, and below 0."""
    places: list[ast.SyntaxNode] = []
    match node:
        case ast.WithSpecifier(property="speed"):
            places = [node.value]
        case ast.ComparisonChain():
            sides = compared_sides(node)
            if any(isinstance(side, ast.Attribute) and side.name == "speed" for side in sides):
                places += sides
        case _:
            pass
    for place in places:
        found = [(value, term) for term in terms(place, values) if (value := literal_number(term)) is not None]
        for value, term in found:
            text = term.span.text
            if value > _FASTEST_MPS:
                yield make_warning(
                    "speed-beyond-roads", f"{text} m/s are {value * 3.6:.0f} km/h", term.span, "speeds are in m/s",
                    f"write `{text} / 3.6` for km/h",
                )  # fmt: skip
        if any(value < 0 for value, _ in found):
            yield make_warning(
                "speed-negative", f"`{text_of(place)}` is below 0: a speed says how fast, not which way",
                place.span, "no speed is negative", "`facing 180 deg relative to roadDirection` goes against the road",
            )  # fmt: skip


def _unseen(nodes: list[ast.SyntaxNode]) -> Iterator[Diagnostic]:
    """`not` of what can be seen, under the view that classes have by default."""
    given = {node.property for node in nodes if isinstance(node, ast.WithSpecifier)}
    given |= {node.name for node in nodes if isinstance(node, ast.PropertyDefault | ast.Attribute)}
    if given & _VIEW:
        return
    for node in nodes:
        match node:
            case ast.UnaryOp(operator="not", operand=ast.Phrase(row=phrases.CAN_SEE) as seen):
                yield make_warning(
                    "default-view", f"`{text_of(seen)}` asks whether it is within the view that its class has by "
                    "default: nothing hides anything", node.span, "a matter of distance and direction",
                    "a requirement on the distance says it plainly",
                    "`with visibleDistance 30, with viewAngle 120 deg` sets a view",
                )  # fmt: skip
            case _:
                pass


# --- numbers that labels measure


def _is_measured(node: ast.SyntaxNode) -> bool:
    match node:
        case ast.Attribute(name=name):
            return name in ANGLE_PROPERTIES | _MEASURED
        case ast.Call(function=ast.Name(id="abs")) if node.arguments:
            return _is_measured(node.arguments[0].value)
        case _:
            return isinstance(node, ast.Phrase) and bool(node.row.measures)


def _exact(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Measured numbers that are asked to be a number exactly."""
    if not isinstance(node, ast.ComparisonChain):
        return
    for left, operator, right in links(node):
        if operator != "==" or _is_measured(left) == _is_measured(right):
            continue
        measured, asked = (left, right) if _is_measured(left) else (right, left)
        if literal_number(asked) is not None:
            near = measured.span.text if literal_number(asked) == 0 else f"({measured.span.text}) - {asked.span.text}"
            within = "5 deg" if is_angle(measured) else "0.5"
            yield make_warning(
                "exact-number", f"`== {asked.span.text}` will almost never hold: measurements are not exact",
                node.span, "tolerances do not apply in requirements",
                f"`abs({near}) < {within}` asks for what is near it",
            )  # fmt: skip


def _range(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    match node:
        case ast.Call(function=ast.Name(id=name)) if name in _RANGES and len(node.arguments) >= 2:
            low, high = (literal_number(argument.value) for argument in node.arguments[-2:])
            if low is not None and high is not None and low > high:
                first, second = (argument.value.span.text for argument in node.arguments[-2:])
                yield make_warning(
                    "range-reversed", f"this `{name}` ends before it starts", node.span,
                    "the lower end comes first", f"write `{second}, {first}`",
                )  # fmt: skip
        case _:
            pass


# --- names


def _unused(nodes: list[ast.SyntaxNode]) -> Iterator[Diagnostic]:
    """Variables that are set and never read; an object is there whether it is named again or not."""
    assigned = [(target, node) for node in nodes if isinstance(node, ast.Assign) for target in node.targets]
    written = {id(target) for target, _ in assigned}
    read = {node.id for node in nodes if isinstance(node, ast.Name) and id(node) not in written}
    read |= {item.id for node in nodes if isinstance(node, ast.Global | ast.Nonlocal) for item in node.names}
    # what is skipped may read anything
    if any(isinstance(node, ast.DynamicDefinition) and not node.body for node in nodes):
        return
    held = {id(line) for node in nodes if isinstance(node, ast.ClassDef) for line in node.body}
    told: set[str] = set()
    for target, node in assigned:
        if id(node) in held or any(isinstance(part, ast.New | ast.Call) for part in walk(node.value)):
            continue
        # up to Scenic 2 the bare name of a class is an object
        if isinstance(node.value, ast.Name) and node.value.id[:1].isupper():
            continue
        if isinstance(target, ast.Name) and target.id not in read | told | _READ_BY_MODELS and target.id[0] != "_":
            told.add(target.id)
            near = similar(target.id, read)
            hints = (f"`{near}` is read, and spelled nearly like it",) if near else ()
            yield make_warning("unused-variable", f"nothing uses `{target.id}`", target.span, "set here", *hints)


@cache
def _library_properties() -> frozenset[str]:
    lines = (node for module in library_texts() for node in walk(*module.body))
    names = {line.name for line in lines if isinstance(line, ast.PropertyDefault)}
    roots = {name for cls in root_classes(3).values() for name in cls.definitions}
    return frozenset(names | roots) | _OF_SCENIC


def _unknown_properties(nodes: Iterable[ast.SyntaxNode]) -> Iterator[Diagnostic]:
    """Properties that no class has and that the program does not read itself."""
    nodes = list(nodes)
    known = set(_library_properties())
    known |= {node.name for node in nodes if isinstance(node, ast.PropertyDefault)}
    known |= {node.name for node in nodes if isinstance(node, ast.Attribute)}
    for node in nodes:
        if isinstance(node, ast.WithSpecifier) and node.property not in known:
            near = similar(node.property, known)
            hints = [f"`{near}` is spelled nearly like it"] if near else []
            hints.append("where it is an attribute of labels, `scenicq check SCENARIO DATASET` says so")
            message = f"no class has a property `{node.property}`, and nothing reads it"
            yield make_warning("unknown-property", message, node.property_span, "set here", *hints)
