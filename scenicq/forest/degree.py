"""Whether expressions are affine in some of their random variables, by their form."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Coordinate,
    Identity,
    Node,
    Scale,
    Select,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, is_leaf, postorder

__all__ = ["NOT_AFFINE", "degree"]

NOT_AFFINE = 2
"""The degree of what is not affine."""


def degree(
    roots: Sequence[Node],
    variables: Collection[Identity],
    other: Callable[[Node, Sequence[int]], int] = lambda _node, _own: NOT_AFFINE,
) -> int:
    """0 for expressions that do not depend on some variables, 1 for affine ones, whatever the others come out as.

    Args:
        roots: The expressions; the greatest degree counts.
        variables: The variables.
        other: The degree of a node of another kind than arithmetic, vectors and choices, from those of its children, of
            which one depends on a variable.
    """
    known: dict[int, int] = {}
    for node in postorder(roots):
        own = [known[id(child)] for child in children(node)]
        if is_leaf(node) and node.identity in variables:  # type: ignore[union-attr]
            known[id(node)] = 1
        else:
            known[id(node)] = _degree_of(node, own, other) if any(own) else 0
    return max(known[id(root)] for root in roots)


def _degree_of(node: Node, own: Sequence[int], other: Callable[[Node, Sequence[int]], int]) -> int:
    match node:
        case Arithmetic(op=ArithmeticOp.ADD | ArithmeticOp.SUB | ArithmeticOp.NEG):
            return max(own)
        case Arithmetic(op=ArithmeticOp.MUL) | Scale():
            return min(sum(own), NOT_AFFINE)
        case Arithmetic(op=ArithmeticOp.DIV):
            return own[0] if not own[1] else NOT_AFFINE
        case VectorOf() | VectorSum() | Coordinate():
            return max(own)
        case Select():
            return max(own) if not own[0] else NOT_AFFINE
        case _:
            return other(node, own)
