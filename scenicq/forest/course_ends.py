"""Conditions on numbers that are known up to two ends: measures of courses (`CourseCoordinate`, `Measure`).

A condition on such a number becomes two on its ends: one that holds only where the condition surely does, one that
holds wherever it may. Where the form of a condition does not tell which ends these are, it is known where
they are equal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from scenicq.forest import build
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    MIRRORED,
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    CourseCoordinate,
    LogicOp,
    Measure,
    Node,
)
from scenicq.forest.walk import children, postorder, transform
from scenicq.geometry.measures import OF_TRACKS

__all__ = ["Truths", "has_ends", "join", "opposite", "truths_by_ends"]

Truths = tuple[Node, Node]
"""A condition that holds only where another surely holds, and one that holds wherever that may hold."""


def opposite(truths: Truths) -> Truths:
    """The same of the negation."""
    certain, possible = truths
    return build.opposite(possible), build.opposite(certain)


def join(op: LogicOp, *args: Truths) -> Truths:
    """`and` or `or`; what is known of the operands decides it where that is enough."""
    return build.connect(op, [certain for certain, _ in args]), build.connect(op, [possible for _, possible in args])


def has_ends(node: Node) -> bool:
    """Whether a node is a number that is known up to two ends."""
    if isinstance(node, Measure) and node.measure not in OF_TRACKS:
        return False
    return isinstance(node, CourseCoordinate | Measure) and node.end is None


def truths_by_ends(node: Node) -> Truths:
    """What a condition on values is known to be where some of them are known up to two ends."""
    if isinstance(node, Compare) and (kind_of(node.left), kind_of(node.right)) == ("scalar", "scalar"):
        left, right = _ends(node.left), _ends(node.right)
        if left is not None and right is not None:
            return _compared(node, left, right)
    measures = (each for each in postorder((node,)) if isinstance(each, CourseCoordinate | Measure))
    numbers = [each for each in measures if has_ends(each)]
    lower = {id(each): replace(each, end=0) for each in numbers}
    exact = [build.compare(CompareOp.LE, replace(each, end=1), lower[id(each)], node.span) for each in numbers]
    same = transform(node, lambda each: lower.get(id(each), each))
    inexact = [build.opposite(each) for each in exact]
    return build.connect(LogicOp.AND, [*exact, same]), build.connect(LogicOp.OR, [*inexact, same])


def _compared(node: Compare, left: Truths, right: Truths) -> Truths:
    def less(op: CompareOp, one: Truths, other: Truths) -> Truths:
        (low, high), (below, above) = one, other
        return build.compare(op, high, below, node.span), build.compare(op, low, above, node.span)

    match node.op:
        case CompareOp.LT | CompareOp.LE:
            return less(node.op, left, right)
        case CompareOp.GT | CompareOp.GE:
            return less(MIRRORED[node.op], right, left)
        case CompareOp.EQ | CompareOp.NE:
            same = join(LogicOp.AND, less(CompareOp.LE, left, right), less(CompareOp.LE, right, left))
            return same if node.op is CompareOp.EQ else opposite(same)


def _ends(root: Node) -> Truths | None:
    """Two expressions between which a number is; None where its form does not tell."""
    found: dict[int, Truths | None] = {}
    reading: set[int] = set()
    for node in postorder((root,)):
        below = children(node)
        if has_ends(node) or any(id(each) in reading for each in below):
            reading.add(id(node))
            found[id(node)] = _ends_of(node, [found[id(each)] for each in below])
        else:
            found[id(node)] = node, node
    return found[id(root)]


def _ends_of(node: Node, below: list[Truths | None]) -> Truths | None:
    """As `_ends`, given those of what is below."""
    if isinstance(node, CourseCoordinate | Measure) and (has_ends(node) or node.end is not None):
        return (replace(node, end=0), replace(node, end=1)) if has_ends(node) else None
    args = [each for each in below if each is not None]
    if not isinstance(node, Arithmetic) or len(args) < len(below):
        return None

    def made(op: ArithmeticOp, *parts: Node) -> Node:
        return build.arithmetic(op, *parts, span=node.span)

    lows, highs = [low for low, _ in args], [high for _, high in args]
    match node.op:
        case ArithmeticOp.ADD | ArithmeticOp.MIN | ArithmeticOp.MAX:
            return made(node.op, *lows), made(node.op, *highs)
        case ArithmeticOp.SUB:
            return made(node.op, lows[0], highs[1]), made(node.op, highs[0], lows[1])
        case ArithmeticOp.NEG:
            return made(node.op, highs[0]), made(node.op, lows[0])
        case ArithmeticOp.ABS:
            less = made(ArithmeticOp.NEG, highs[0])
            nearest = made(ArithmeticOp.MAX, lows[0], less, build.constant(0.0))
            return nearest, made(ArithmeticOp.MAX, highs[0], made(ArithmeticOp.NEG, lows[0]))
        case ArithmeticOp.MUL | ArithmeticOp.DIV:
            return _scaled(node.op, args, made)
        case _:
            return None


def _scaled(op: ArithmeticOp, args: list[Truths], made: Callable[..., Node]) -> Truths | None:
    """The ends of a number times a known one, or divided by it."""
    one, other = args
    if op is ArithmeticOp.MUL and isinstance(one[0], Constant):
        one, other = other, one
    factor = other[0]
    if not isinstance(factor, Constant) or not isinstance(factor.value, float) or factor.value == 0.0:
        return None
    low, high = (made(op, each, factor) for each in one)
    return (low, high) if factor.value > 0 else (high, low)
