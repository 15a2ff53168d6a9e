"""What warnings read off the text of a program: its numbers, through the names that it gives them, and orders."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping

from scenicq.errors import Diagnostic, Span
from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import children, walk

__all__ = [
    "ANGLE_PROPERTIES",
    "ORDERS",
    "Values",
    "compared_sides",
    "is_angle",
    "links",
    "literal_number",
    "make_warning",
    "order_of",
    "set_once",
    "terms",
    "text_of",
]  # fmt: skip

ANGLE_PROPERTIES = frozenset({"heading", "yaw", "roadDeviation", "viewAngle", "parentOrientation"})
ORDERS = frozenset({"<", "<=", ">", ">="})
_COMPARED = frozenset({"<", "<=", ">", ">=", "==", "!="})
Values = Mapping[str, ast.SyntaxNode]
"""What stands for a name in all of a program; a parameter by `param` and its name."""


def make_warning(code: str, message: str, span: Span, label: str, *hints: str) -> Diagnostic:
    """A warning at a place of the text."""
    return Diagnostic(code, message, span, label, hints=hints, severity="warning")


def text_of(node: ast.SyntaxNode) -> str:
    """How a node is written, on one line."""
    return " ".join(node.span.text.split())


def literal_number(node: ast.SyntaxNode) -> float | None:
    """The value of a number that the text says outright."""
    match node:
        case ast.LiteralValue(value=bool()):
            return None
        case ast.LiteralValue(value=int() | float() as value):
            return float(value)
        case ast.UnaryOp(operator="-" | "+" as sign):
            inner = literal_number(node.operand)
            return None if inner is None else -inner if sign == "-" else inner
        case ast.Phrase(row=phrases.DEG):
            inner = literal_number(node.given[0])
            return None if inner is None else math.radians(inner)
        case _:
            return None


def set_once(body: tuple[ast.Statement, ...], nodes: list[ast.SyntaxNode]) -> Values:
    """What the names and parameters of a program stand for that it sets once, outside of any other statement."""
    names = Counter(
        node.id
        for each in nodes
        if isinstance(each, ast.Assign)
        for node in walk(*each.targets)
        if isinstance(node, ast.Name)
    )
    local = {each.name for each in nodes if isinstance(each, ast.Parameter)}
    local |= {
        node.id for each in nodes if isinstance(each, ast.For | ast.Clause | ast.AugmentedAssign)
        for node in walk(each.target) if isinstance(node, ast.Name)
    }  # fmt: skip
    found: dict[str, ast.SyntaxNode] = {}
    for statement in body:
        match statement:
            case ast.Assign(targets=(ast.Name(id=name),), value=value) if names[name] == 1 and name not in local:
                found[name] = value
            case ast.Param(items=items):
                found |= {f"param {item.name}": item.value for item in items}
            case _:
                pass
    return found


def _stands_for(node: ast.SyntaxNode, values: Values) -> ast.SyntaxNode | None:
    match node:
        case ast.Name(id=name):
            return values.get(name)
        case ast.Attribute(value=ast.Name(id="globalParameters"), name=name):
            return values.get(f"param {name}")
        case _:
            return None


def terms(node: ast.SyntaxNode, values: Values) -> Iterator[ast.SyntaxNode]:
    """The numbers that an expression is made of, down to those with `deg`, through the names that it reads."""
    stack, seen = [node], set[int]()
    while stack:
        each = stack.pop()
        if literal_number(each) is not None:
            yield each
            continue
        if (value := _stands_for(each, values)) is not None and id(value) not in seen:
            seen.add(id(value))
            stack.append(value)
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


def is_angle(node: ast.SyntaxNode) -> bool:
    """Whether the text shows that an expression is an angle."""
    match node:
        case ast.Attribute(name=name):
            return name in ANGLE_PROPERTIES
        case ast.UnaryOp(operator="-" | "+"):
            return is_angle(node.operand)
        case ast.BinaryOp(operator="+" | "-"):
            return is_angle(node.left) or is_angle(node.right)
        case ast.Call(function=ast.Name(id="abs" | "min" | "max")):
            return any(is_angle(argument.value) for argument in node.arguments)
        case _:
            return isinstance(node, ast.Phrase) and node.row.measures == "angle"


def links(chain: ast.ComparisonChain) -> Iterator[tuple[ast.SyntaxNode, str, ast.SyntaxNode]]:
    """The comparisons of a chain, each with both sides."""
    sides = [chain.left, *(each.right for each in chain.comparisons)]
    for (left, right), link in zip(itertools.pairwise(sides), chain.comparisons, strict=True):
        yield left, link.operator, right


def compared_sides(chain: ast.ComparisonChain) -> list[ast.SyntaxNode]:
    """The sides of a chain that are compared by order or equality."""
    return [chain.left, *(each.right for each in chain.comparisons if each.operator in _COMPARED)]


def order_of(chain: ast.ComparisonChain) -> Iterator[tuple[ast.SyntaxNode, ast.SyntaxNode]]:
    """Which sides of a chain are to be below which others."""
    for left, operator, right in links(chain):
        if operator in ("<", "<="):
            yield left, right
        elif operator in (">", ">="):
            yield right, left
