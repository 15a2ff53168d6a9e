"""Rewrite expressions to the columns of the store that give objects' positions in the frame of the ego.

The store has for each label object its position relative to the ego, turned by the ego's heading (`PLACE`), and its
distance (`DISTANCE`). Two rewrites find where an expression computes these, so that SQL need not compute angles:

- `norm(v) * cos(bearing(v) + a)` is a coordinate of `v`, turned by `a`; with `sin`, the other one.
- The object's position less the ego's, turned by minus the ego's heading, is `PLACE`; its norm is `DISTANCE`.

Both change values by rounding errors. Only conditions that allow for these may be rewritten.
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
"""Features of label objects that the store has and programs cannot name."""


def in_ego_frame(root: Node, ego: int) -> Node:
    """Put `PLACE` and `DISTANCE` of objects where an expression computes them.

    Args:
        root: The expression.
        ego: The index of the ego.
    """

    def rewrite_product_or_norm(node: Node) -> Node:
        match node:
            case Arithmetic(op=ArithmeticOp.MUL, args=(one, other)):
                return _as_coordinate(one, other) or _as_coordinate(other, one) or node
            case Norm() if (position := _relative_position(node.vector, ego)) is not None:
                return Feature(position.object, DISTANCE, "scalar", position.current, span=node.span)
            case _:
                return node

    def rewrite_rotation(node: Node) -> Node:
        match node:
            case Rotate(angle=Arithmetic(op=ArithmeticOp.NEG, args=(angle,))) if (
                position := _relative_position(node.vector, ego)
            ) is not None and _is_feature(angle, ego, "heading", position.current):
                return Feature(position.object, PLACE, "vector", position.current, span=node.span)
            case _:
                return node

    # a norm that has become `DISTANCE` no longer shows whose product with a cosine is a coordinate: products come first
    products = transform(root, lambda node: node if isinstance(node, Norm) else rewrite_product_or_norm(node))
    return transform(products, lambda node: rewrite_rotation(rewrite_product_or_norm(node)))


def _is_feature(node: Node, index: int, name: str, current: bool) -> bool:
    return isinstance(node, Feature) and (node.object, node.property, node.current) == (index, name, current)


def _relative_position(vector: Node, ego: int) -> Feature | None:
    """The position of an object, if a vector is this position less the ego's at the same time."""
    match vector:
        case VectorSum(
            left=Feature(property="position") as position, right=Scale(vector=origin, factor=Constant(value=factor))
        ) if factor == -1.0 and _is_feature(origin, ego, "position", position.current) and position.object != ego:
            return position
        case _:
            return None


def _as_coordinate(length: Node, wave: Node) -> Node | None:
    """The coordinate that a length times a sine or cosine is; None if it is not one of the same vector's bearing."""
    if not (
        isinstance(length, Norm) and isinstance(wave, Arithmetic) and wave.op in (ArithmeticOp.SIN, ArithmeticOp.COS)
    ):
        return None
    angle = wave.args[0]
    while isinstance(angle, Arithmetic) and angle.op is ArithmeticOp.WRAP:
        angle = angle.args[0]
    rest = _without_bearing(angle, length.vector)
    if rest is None:
        return None
    turn, sign = rest
    vector = length.vector if turn is None else Rotate(length.vector, turn, span=length.span)
    if wave.op is ArithmeticOp.COS:
        return Coordinate(vector, 1, span=length.span)
    # headings count from +y, so that the sine of a bearing points to -x
    across = Coordinate(vector, 0, span=length.span)
    return across if sign < 0 else Arithmetic(ArithmeticOp.NEG, (across,), span=length.span)


def _without_bearing(angle: Node, vector: Node) -> tuple[Node | None, int] | None:
    """The rest and the sign in `angle = sign * (bearing + rest)`, a rest of None for 0; None for any other angle."""
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
    return isinstance(node, Bearing) and _is_same_expression(node.vector, vector)


def _is_same_expression(one: Node, other: Node) -> bool:
    """Whether two expressions over features and numbers have the same operations in the same order."""
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
