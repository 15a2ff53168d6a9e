"""What the text of a program alone gives away: angles without `deg`, reversed ranges, names that nothing uses."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from functools import cache

from scenicq.compiler.models import library_texts
from scenicq.compiler.roots import root_classes
from scenicq.errors import Diagnostic, Span, similar
from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import children, walk

__all__ = ["lint_text"]

_FASTEST_MPS = 45.0
"""What few vehicles on roads reach: the most that Scenic's own vehicles drive."""
_FULL_TURN = math.tau * (1 + 1e-9)
_ANGLE_PROPERTIES = frozenset({"heading", "yaw", "roadDeviation", "viewAngle", "parentOrientation"})
_MEASURED = frozenset({"speed", "width", "length", "height", "x", "y", "acceleration", "angularSpeed"})
_ORDERS = frozenset({"<", "<=", ">", ">=", "==", "!="})
_RANGES = frozenset({"Range", "DiscreteRange", "TruncatedNormal"})
_VIEW = frozenset({"visibleDistance", "viewAngle", "viewAngles", "viewDistance"})
_POINTS = frozenset({"Point", "OrientedPoint"})
_READ_BY_MODELS = frozenset({"ego", "workspace", "simulation", "simulator", "_"})
_OF_SCENIC = frozenset({
    "viewAngles", "orientationStdDev", "angularVelocity", "baseOffset", "onDirection", "visionSensorOffset",
    "sideComponentThresholds", "lastActions", "pitch", "roll", "orientation", "shape", "contactTolerance", "occluding",
    "viewRayDensity", "viewRayCount", "viewRayDistanceScaling", "showVisibleRegion", "sensors", "render",
})  # fmt: skip
"""Properties that Scenic's own classes have, and that say nothing of a box in the plane."""


def _warning(code: str, message: str, span: Span, label: str, *hints: str) -> Diagnostic:
    return Diagnostic(code, message, span, label, hints=hints, severity="warning")


def lint_text(body: tuple[ast.Statement, ...], *, properties: bool) -> Iterator[Diagnostic]:
    """What the text of a program gives away.

    Args:
        body: The program.
        properties: Whether properties that no class has are named, too; with a dataset its labels say more.
    """
    nodes = list(walk(*body))
    for node in nodes:
        yield from _angles(node)
        yield from _range(node)
        yield from _exact(node)
        yield from _alone(node)
        yield from _two(node)
        yield from _fast(node)
    yield from _signed(nodes)
    yield from _egos(body)
    yield from _unseen(nodes)
    yield from _facing_objects(nodes)
    yield from _unused(nodes)
    if properties:
        yield from _unknown_properties(nodes)


# --- angles


def _number(node: ast.SyntaxNode) -> float | None:
    """The value of a number that the text says outright."""
    match node:
        case ast.LiteralValue(value=bool()):
            return None
        case ast.LiteralValue(value=int() | float() as value):
            return float(value)
        case ast.UnaryOp(operator="-" | "+" as sign):
            inner = _number(node.operand)
            return None if inner is None else -inner if sign == "-" else inner
        case ast.Phrase(row=phrases.DEG):
            inner = _number(node.given[0])
            return None if inner is None else math.radians(inner)
        case _:
            return None


def _terms(node: ast.SyntaxNode) -> Iterator[ast.SyntaxNode]:
    """The numbers that an expression of an angle is made of, down to those with `deg`."""
    stack = [node]
    while stack:
        each = stack.pop()
        if _number(each) is not None:
            yield each
            continue
        match each:
            case ast.UnaryOp() | ast.Phrase(row=phrases.RELATION) | ast.IfElse() | ast.Tuple():
                stack.extend(reversed(tuple(children(each))))
            case ast.BinaryOp(operator="+" | "-"):
                stack += [each.right, each.left]
            case ast.Call(function=ast.Name(id="Range" | "Uniform" | "DiscreteRange" | "Normal" | "abs")):
                stack += [argument.value for argument in reversed(each.arguments)]
            case _:
                pass


def _is_angle(node: ast.SyntaxNode) -> bool:
    match node:
        case ast.Attribute(name=name):
            return name in _ANGLE_PROPERTIES
        case ast.UnaryOp(operator="-" | "+"):
            return _is_angle(node.operand)
        case ast.BinaryOp(operator="+" | "-"):
            return _is_angle(node.left) or _is_angle(node.right)
        case ast.Call(function=ast.Name(id="abs" | "min" | "max")):
            return any(_is_angle(argument.value) for argument in node.arguments)
        case _:
            return isinstance(node, ast.Phrase) and node.row.measures == "angle"


def _links(chain: ast.ComparisonChain) -> Iterator[tuple[ast.SyntaxNode, str, ast.SyntaxNode]]:
    """The comparisons of a chain, each with both sides."""
    sides = [chain.left, *(each.right for each in chain.comparisons)]
    for (left, right), link in zip(itertools.pairwise(sides), chain.comparisons, strict=True):
        yield left, link.operator, right


def _compared(chain: ast.ComparisonChain) -> list[ast.SyntaxNode]:
    """The sides of a chain that are compared by order or equality."""
    return [chain.left, *(each.right for each in chain.comparisons if each.operator in _ORDERS)]


def _order_of(chain: ast.ComparisonChain) -> Iterator[tuple[ast.SyntaxNode, ast.SyntaxNode]]:
    """Which sides of a chain are to be below which others."""
    for left, operator, right in _links(chain):
        if operator in ("<", "<="):
            yield left, right
        elif operator in (">", ">="):
            yield right, left


def _angles(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Numbers of more than a full turn where an angle stands."""
    places: list[ast.SyntaxNode] = []
    match node:
        case ast.Phrase():
            places += node.of_kind("heading")
        case ast.WithSpecifier(property=name) if name in _ANGLE_PROPERTIES:
            places = [node.value]
        case ast.PropertyDefault(name=name) if name in _ANGLE_PROPERTIES:
            places = [node.value]
        case ast.ComparisonChain():
            sides = _compared(node)
            if any(map(_is_angle, sides)):
                places = [side for side in sides if not _is_angle(side)]
        case _:
            pass
    for place in places:
        for term in _terms(place):
            value = _number(term)
            if value is not None and abs(value) > _FULL_TURN and not ast.is_phrase(term, phrases.DEG):
                text = term.span.text
                yield _warning(
                    "angle-without-deg", f"`{text}` is an angle of {abs(value) / math.tau:.1f} full turns", term.span,
                    "angles are in radians", f"write `{text} deg` for degrees",
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
                yield _warning(
                    "facing-object", f"`facing {name}` is the direction in which `{name}` itself faces", heading.span,
                    "taken for its heading", f"`facing toward {name}` turns to it",
                    f"`facing {name}.heading` says that its heading is meant",
                )  # fmt: skip
            case _:
                pass


def _signed(nodes: list[ast.SyntaxNode]) -> Iterator[Diagnostic]:
    """Angles that are bounded from above alone, by an amount: they may be as far to the right as they like."""
    pairs = [(node, *each) for node in nodes if isinstance(node, ast.ComparisonChain) for each in _order_of(node)]
    bounded_below = {_text(high) for _, _, high in pairs}
    for node, angle, end in pairs:
        most = _number(end)
        if isinstance(angle, ast.Phrase) and _is_angle(angle) and most is not None and 0 < most < math.pi:
            text = _text(angle)
            if text not in bounded_below:
                yield _warning(
                    "angle-without-abs", f"`{text}` is negative to the right, so every angle to the right is below "
                    f"{_text(end)}", node.span, "bounds one side alone",
                    f"`abs({text}) < {_text(end)}` bounds both sides",
                )  # fmt: skip


def _text(node: ast.SyntaxNode) -> str:
    return " ".join(node.span.text.split())


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
        yield _warning(
            "condition-alone", "this condition asks nothing: no `require` stands before it", node.span,
            "is worked out and forgotten", f"write `require {_text(node)}`",
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
        yield _warning(
            "ego-twice", f"the ego of line {line} is an object of the scene, too", each.span, "is the ego from here on",
            "give one of the two another name",
        )  # fmt: skip


def _two(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """`Uniform` of two numbers on both sides of 0: a range through 0 may be meant."""
    match node:
        case ast.Call(function=ast.Name(id="Uniform"), arguments=(first, second)):
            low, high = (_number(each.value) for each in (first, second))
            if low is not None and high is not None and low < 0 < high and (low, high) != (-1, 1):
                if any(ast.is_phrase(each.value, phrases.DEG) for each in (first, second)):
                    return
                one, other = (each.value.span.text for each in (first, second))
                yield _warning(
                    "choice-of-two", f"this is {one} or {other}, and nothing between", node.span, "one of two numbers",
                    f"`Range({one}, {other})` is all between them",
                )  # fmt: skip
        case _:
            pass


def _fast(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Speeds above what roads see."""
    places: list[ast.SyntaxNode] = []
    match node:
        case ast.WithSpecifier(property="speed"):
            places = [node.value]
        case ast.ComparisonChain():
            sides = _compared(node)
            if any(isinstance(side, ast.Attribute) and side.name == "speed" for side in sides):
                places += sides
        case _:
            pass
    for place in places:
        for term in _terms(place):
            value = _number(term)
            if value is not None and value > _FASTEST_MPS:
                text = term.span.text
                yield _warning(
                    "speed-beyond-roads", f"{text} m/s are {value * 3.6:.0f} km/h", term.span, "speeds are in m/s",
                    f"write `{text} / 3.6` for km/h",
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
                yield _warning(
                    "default-view", f"`{_text(seen)}` asks whether it is within the view that its class has by "
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
            return name in _ANGLE_PROPERTIES | _MEASURED
        case ast.Call(function=ast.Name(id="abs")) if node.arguments:
            return _is_measured(node.arguments[0].value)
        case _:
            return isinstance(node, ast.Phrase) and bool(node.row.measures)


def _exact(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    """Measured numbers that are asked to be a number exactly."""
    if not isinstance(node, ast.ComparisonChain):
        return
    for left, operator, right in _links(node):
        if operator != "==" or _is_measured(left) == _is_measured(right):
            continue
        measured, number = (left, right) if _is_measured(left) else (right, left)
        if _number(number) is not None:
            near = measured.span.text if _number(number) == 0 else f"({measured.span.text}) - {number.span.text}"
            within = "5 deg" if _is_angle(measured) else "0.5"
            yield _warning(
                "exact-number", f"`==` asks for exactly {number.span.text}, which what is measured hardly ever is",
                node.span, "no tolerance holds in requirements",
                f"`abs({near}) < {within}` asks for what is near it",
            )  # fmt: skip


# --- ranges


def _range(node: ast.SyntaxNode) -> Iterator[Diagnostic]:
    match node:
        case ast.Call(function=ast.Name(id=name)) if name in _RANGES and len(node.arguments) >= 2:
            low, high = (_number(argument.value) for argument in node.arguments[-2:])
            if low is not None and high is not None and low > high:
                first, second = (argument.value.span.text for argument in node.arguments[-2:])
                yield _warning(
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
            yield _warning("unused-variable", f"nothing uses `{target.id}`", target.span, "set here", *hints)


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
            yield _warning("unknown-property", message, node.property_span, "set here", *hints)
