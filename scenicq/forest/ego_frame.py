"""Expressions over columns that say where objects are as seen from the ego, so that no angles are computed.

A length times the sine or cosine of its own bearing is a coordinate of the turned vector; a difference of places turned
by the ego's heading is a column of the store, and its length another. Both hold but for rounding, which only
conditions with slack may pass over.
"""

from __future__ import annotations

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Constant,
    Coordinate,
    Feature,
    Node,
    Norm,
    Rotate,
    Scale,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, transform

__all__ = ["DISTANCE", "PLACE", "in_ego_frame"]

PLACE, DISTANCE = "place in the ego's frame", "distance to the ego"
"""Features of label objects that programs cannot name."""


def in_ego_frame(root: Node, ego: int) -> Node:
    """An expression with `PLACE` and `DISTANCE` of objects where it computes them.

    Args:
        root: The expression.
        ego: The index of the ego.
    """

    def step(node: Node) -> Node:
        match node:
            case Arithmetic(op=ArithmeticOp.MUL, args=(one, other)):
                return _as_coordinate(one, other) or _as_coordinate(other, one) or node
            case Norm() if (seen := _seen_from(node.vector, ego)) is not None:
                return Feature(seen.object, DISTANCE, "scalar", seen.current, span=node.span)
            case _:
                return node

    def turned(node: Node) -> Node:
        match node:
            case Rotate(angle=Arithmetic(op=ArithmeticOp.NEG, args=(angle,))) if (
                seen := _seen_from(node.vector, ego)
            ) is not None and _is(angle, ego, "heading", seen.current):
                return Feature(seen.object, PLACE, "vector", seen.current, span=node.span)
            case _:
                return node

    # lengths stay as they are until products with them are found
    products = transform(root, lambda node: node if isinstance(node, Norm) else step(node))
    return transform(products, lambda node: turned(step(node)))


def _is(node: Node, index: int, name: str, current: bool) -> bool:
    return isinstance(node, Feature) and (node.object, node.property, node.current) == (index, name, current)


def _seen_from(vector: Node, ego: int) -> Feature | None:
    """The place of an object, if a vector is that less the ego's at the same time."""
    match vector:
        case VectorSum(
            left=Feature(property="position") as seen, right=Scale(vector=place, factor=Constant(value=factor))
        ) if factor == -1.0 and _is(place, ego, "position", seen.current) and seen.object != ego:
            return seen
        case _:
            return None


def _as_coordinate(length: Node, wave: Node) -> Node | None:
    """A length times the sine or cosine of an angle that has the same vector's bearing in it, if they are just that."""
    if not (
        isinstance(length, Norm) and isinstance(wave, Arithmetic) and wave.op in (ArithmeticOp.SIN, ArithmeticOp.COS)
    ):
        return None
    angle = wave.args[0]
    while isinstance(angle, Arithmetic) and angle.op is ArithmeticOp.WRAP:
        angle = angle.args[0]
    turn = _beside_bearing(angle, length.vector)
    if turn is None:
        return None
    by, sign = turn
    place = length.vector if by is None else Rotate(length.vector, by, span=length.span)
    if wave.op is ArithmeticOp.COS:
        return Coordinate(place, 1, span=length.span)
    across = Coordinate(place, 0, span=length.span)
    return across if sign < 0 else Arithmetic(ArithmeticOp.NEG, (across,), span=length.span)


def _beside_bearing(angle: Node, vector: Node) -> tuple[Node | None, int] | None:
    """What an angle adds to a vector's bearing, or to that with its sign turned around, with the sign."""
    if _bearing_of(angle, vector):
        return None, 1
    match angle:
        case Arithmetic(op=ArithmeticOp.SUB, args=(one, other)) if _bearing_of(one, vector):
            return Arithmetic(ArithmeticOp.NEG, (other,), span=other.span), 1
        case Arithmetic(op=ArithmeticOp.SUB, args=(one, other)) if _bearing_of(other, vector):
            # cos(a - b) = cos(b - a), sin(a - b) = -sin(b - a)
            return Arithmetic(ArithmeticOp.NEG, (one,), span=one.span), -1
        case Arithmetic(op=ArithmeticOp.ADD, args=(one, other)) if _bearing_of(one, vector):
            return other, 1
        case Arithmetic(op=ArithmeticOp.ADD, args=(one, other)) if _bearing_of(other, vector):
            return one, 1
        case _:
            return None


def _bearing_of(node: Node, vector: Node) -> bool:
    """Whether a node is the bearing of a vector."""
    return isinstance(node, Bearing) and _alike(node.vector, vector)


def _alike(one: Node, other: Node) -> bool:
    """Whether two expressions are written the same way, over features and numbers alone."""
    pairs = [(one, other)]
    while pairs:
        a, b = pairs.pop()
        if a is b:
            continue
        match a, b:
            case Feature(), Feature():
                same = (a.object, a.property, a.current) == (b.object, b.property, b.current)
            case Constant(value=float()), Constant(value=float()):
                same = a.value == b.value
            case (VectorSum(), VectorSum()) | (Scale(), Scale()) | (Rotate(), Rotate()) | (VectorOf(), VectorOf()):
                same = True
            case Coordinate(), Coordinate():
                same = a.axis == b.axis
            case Arithmetic(), Arithmetic():
                same = a.op is b.op and len(a.args) == len(b.args)
            case _:
                same = False
        if not same:
            return False
        pairs += zip(children(a), children(b), strict=True)
    return True
